"""The rows of the paper's study: rows of its sweep, and measurements that sweeps do not make.

Searches take milliseconds, and the first one on a scene also makes what all later ones use. So
times are measured again afterwards, as CPU time, the least of three. Some compositions that are not
planners are measured, too: planners without one of their parts, or with another one.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from statistics import median
from typing import NamedTuple

from cocap_opt.console.streams import say
from cocap_opt.coordination.low_level import SingleRobotPath, value_iteration
from cocap_opt.coordination.responses import Responses, followed, in_rounds
from cocap_opt.experiments.lab.results import read_csv
from cocap_opt.experiments.lab.studies.runs import TimedRun, processor_seconds
from cocap_opt.experiments.sweeps.cells import SweepCell
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.tables.rows import COLUMNS, BoundColumns, GapRow, PlannedRow
from cocap_opt.files.code import code_digest
from cocap_opt.method import Method
from cocap_opt.model import Model, compiled
from cocap_opt.output.files import save_csv
from cocap_opt.planners import PLANNERS, RECOMMENDED
from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.results import result_of
from cocap_opt.planners.view_search import Compounded, ViewSearch
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result
from cocap_opt.run.engine import is_lazy
from cocap_opt.run.judged import Judged
from cocap_opt.stop import Stop, TimeLimit, never

MEASURED = "measured.csv"  # in the folder of the results
POLISHED, DIVE = "cocap-polished", "cocap-vs-dive"
_REPEATS = 3  # runs of quick searches
_QUICK, _SLOW = 0.1, 10.0  # s: quicker searches are repeated; slower ones are not timed again
_KEPT = (
    "scene", "seed", "planner", "reward", "bound", "gap", "reason", "limit", "seconds",
    "coverage_seconds", "views", "conflicts", "seen_by_two", "seen_by_three", "median_error",
    "robots", "actors", "steps", "time_limit",
    "bound_time_limit", "bound_reason", "bound_free_reason", "optimum", "optimum_free",
    "bound_free", "gap_free", "digest",
)  # fmt: skip


# -- compositions ------------------------------------------------------------------------------


def polished(problem: Problem, stop: Stop = never, *, plan: Plan) -> Result:
    """Improves a plan by rounds of best responses that obey the rules."""
    responses = Responses(value_iteration, stop)
    team = responses.nobody(problem)
    for robot, path in enumerate(team.model.paths(plan)):
        team = team.with_path(robot, SingleRobotPath.of(team.model, robot, path))
    team, limit = followed(team, in_rounds(team, responses))
    return result_of(team, limit)


# `cocap-vs` with gamma 1, i.e. without discount.
_DIVING = Method(partial(cocap, low_level=ViewSearch(Compounded(1.0))), lazy=True)


# -- rows --------------------------------------------------------------------------------------


def completed(instances: Sequence[Instance], limit: float, folder: Path) -> list[GapRow]:
    """Returns the rows of instances with times measured again, and rows of the compositions.

    The file in the folder is written after each instance. Rows that the same code with the same
    limit has already written there are not computed again.

    Parameters
    ----------
    limit : time limit (s) of each planner
    """
    path, known = folder / MEASURED, dict[str, list[GapRow]]()
    for row in read_rows(path) if path.exists() else []:
        known.setdefault(row.digest, []).append(row)
    rows: list[GapRow] = []
    for n, instance in enumerate(instances):
        measurements = _Measurements(instance, limit)
        key = measurements.key
        if key not in known:
            say(f"{instance.problem.name} seed {instance.seed}: times ({n}/{len(instances)})")
            known[key] = [replace(row, digest=key) for row in measurements.rows()]
        rows += known[key]
        save_csv(path, [_kept(row) for row in rows])
    return rows


class _Measurements(NamedTuple):
    """The measurements on an instance whose sweep has ended.

    Attributes
    ----------
    limit : s, of each planner
    """

    instance: Instance
    limit: float

    @property
    def key(self) -> str:
        """A digest of everything that the rows depend on."""
        swept = self.instance.rows()[0]
        code = f"{SweepCell.digest_of_code()} {code_digest(__name__)}"
        bounds, cells = (swept.bound, swept.bound_free), sorted(self.instance.cells)
        words = f"{self.instance.digest} {code} {self.limit} {cells} {bounds}"
        return hashlib.sha256(words.encode()).hexdigest()[:12]

    def rows(self) -> list[GapRow]:
        """Returns the rows of the sweep with times measured again, and of the compositions."""
        problem, swept = self.instance.problem, self.instance.rows()
        coverage = median(_coverage_seconds(problem) for _ in range(_REPEATS))
        compiled(problem).prepare_all()
        self._run(RECOMMENDED, RECOMMENDED)  # computes everything that is computed only once
        rows = [self._timed_again(row) for row in swept] + list(self._compositions(swept[0]))
        lazy = {DIVE, *filter(is_lazy, PLANNERS)}
        return [
            replace(row, coverage_seconds=0.0 if row.planner in lazy else coverage) for row in rows
        ]

    def _timed_again(self, row: GapRow) -> GapRow:
        name, expected = row.planner, row.seconds
        if name is None or name not in PLANNERS or expected is None or expected >= _SLOW:
            return row
        repeats = _REPEATS if expected < _QUICK else 1
        return replace(row, seconds=min(self._run(name, name).seconds for _ in range(repeats)))

    def _compositions(self, swept: GapRow) -> Iterator[GapRow]:
        """Yields the rows of the compositions; polishing alone is not timed.

        Parameters
        ----------
        swept : a row of the same instance, for its bounds
        """
        plan = self.instance.plan("cocap")
        if plan is not None:
            polish = self._run(POLISHED, Method(partial(polished, plan=plan)))
            of_both = polish.judged._replace(views=None)  # CoCap's views are unknown
            yield self._row(swept, POLISHED, of_both, None)
        dive = self._run(DIVE, _DIVING)
        yield self._row(swept, DIVE, dive.judged, dive.seconds)

    def _row(
        self, swept: GapRow, name: str, judged: Judged[Result], seconds: float | None
    ) -> GapRow:
        problem, seed = self.instance.problem, swept.seed or 0
        judged.warn(problem, seed, name)
        planned = PlannedRow.of_planner(problem, seed, name, judged, time_limit=self.limit)
        bounds = BoundColumns(**{f.name: getattr(swept, f.name) for f in fields(BoundColumns)})
        return replace(GapRow.joined(planned, bounds, swept.digest), seconds=seconds)

    def _run(self, name: str, method: str | Method[Result]) -> TimedRun:
        return TimedRun.of(self.instance.problem, method, TimeLimit(self.limit), name=name)


def _coverage_seconds(problem: Problem) -> float:
    """Returns the CPU time of the coverage of all states."""
    model, begin = Model(problem, use_cache=False), processor_seconds()
    model.prepare_all()
    return processor_seconds() - begin


# -- files -------------------------------------------------------------------------------------


def _kept(row: GapRow) -> dict[str, object]:
    """Returns the columns that answers and tables need, with nine digits."""
    return {name: _rounded(getattr(row, name)) for name in _KEPT}


def _rounded(value: object) -> object:
    return float(f"{value:.9g}") if isinstance(value, float) else value


def read_rows(path: Path) -> list[GapRow]:
    """Reads the rows of a file; columns that it lacks are empty."""
    return read_csv(path, _row)


def _row(written: dict[str, str]) -> GapRow:
    return GapRow(**{
        name: column.parse(written.get(name, ""), name)
        for name, column in COLUMNS.items()
        if not column.is_extra
    })  # fmt: skip
