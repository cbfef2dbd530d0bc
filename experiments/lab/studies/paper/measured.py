"""The rows of the paper's study: those of its sweep, and what no sweep measures.

Searches take milliseconds, and the first one on a scene also makes what all later ones use. So
times are taken again, after that, as processor time, the least of three. Some compositions that
are no planners of their own are measured beside the planners: they leave a part out, or add one.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from csv import DictReader
from dataclasses import replace
from io import StringIO
from pathlib import Path
from statistics import median
from time import process_time

from cocap_opt.experiments.sweeps.cells import Cell
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.tables.rows import COLUMNS, BoundColumns, PlannedRow, Row
from cocap_opt.files.code import code_digest
from cocap_opt.model import Model, compiled
from cocap_opt.output.files import read_text, save_csv
from cocap_opt.planners import PLANNERS
from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.low_level import SingleRobotPath, value_iteration
from cocap_opt.planners.responses import Responses, followed, in_rounds
from cocap_opt.planners.results import result_of
from cocap_opt.planners.view_search import Compounded, ViewSearch
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Result
from cocap_opt.run.engine import is_lazy
from cocap_opt.run.judged import Judged
from cocap_opt.stop import Stop, TimeLimit, never

MEASURED = "measured.csv"  # in the folder of the results
POLISHED, DIVE = "cocap-polished", "cocap-vs-dive"
_SHORT, _LONG = 0.1, 10.0  # s: three runs below the first, none again from the second on
_KEPT = (
    "scene", "seed", "planner", "reward", "bound", "gap", "reason", "limit", "seconds",
    "coverage_seconds", "views", "conflicts", "robots", "actors", "steps", "time_limit",
    "bound_time_limit", "bound_reason", "bound_free_reason", "optimum", "optimum_free",
    "bound_free", "gap_free", "digest",
)  # fmt: skip


# -- compositions ------------------------------------------------------------------------------


def polished(problem: Problem, plan: Plan, stop: Stop = never) -> Result:
    """Returns a plan after rounds of best responses that obey the rules."""
    responses = Responses(value_iteration, stop)
    team = responses.nobody(problem)
    for robot, path in enumerate(team.model.paths(plan)):
        pixels = team.model.robot_pixels(robot, path)
        team = team.with_path(robot, SingleRobotPath(path, pixels, 0))
    team, limit = followed(team, in_rounds(team, responses))
    return result_of(team, limit)


def _dive(problem: Problem, stop: Stop) -> Result:
    """Plans as `cocap-vs` does, with gamma 1: nothing is discounted."""
    return cocap(problem, stop, low_level=ViewSearch(Compounded(1.0)))


# -- rows --------------------------------------------------------------------------------------


def completed(
    instances: Sequence[Instance], limit: float, path: Path, tell: Callable[[str], None]
) -> list[Row]:
    """Returns the rows of instances with times taken again, and those of the compositions.

    Rows that the file has already, made by the same code with the same limit, are not made again.

    Parameters
    ----------
    limit : s, of each planner
    path : CSV file of the rows, which is written after each instance
    tell : what is told how far it is
    """
    known: dict[str, list[Row]] = {}
    for row in read_rows(path) if path.exists() else []:
        known.setdefault(row.digest, []).append(row)
    rows: list[Row] = []
    for n, instance in enumerate(instances):
        key = _key(instance, limit)
        if key not in known:
            tell(f"{instance.problem.name} seed {instance.seed}: times ({n}/{len(instances)})")
            known[key] = [replace(row, digest=key) for row in _completed(instance, limit)]
        rows += known[key]
        _write_rows(path, rows)
    return rows


def _key(instance: Instance, limit: float) -> str:
    bounds = (instance.rows()[0].bound, instance.rows()[0].bound_free)
    code = f"{Cell.digest_of_code()} {code_digest(__name__)}"
    words = f"{instance.digest} {code} {limit} {sorted(instance.cells)} {bounds}"
    return hashlib.sha256(words.encode()).hexdigest()[:12]


def _completed(instance: Instance, limit: float) -> list[Row]:
    problem, rows = instance.problem, instance.rows()
    coverage = median(_coverage_seconds(problem) for _ in range(3))
    compiled(problem).prepare_all()
    PLANNERS["cocap-lns"](problem, TimeLimit(limit))  # makes what is made once
    rows = [_timed_again(row, problem, coverage, limit) for row in rows]
    for name, (result, seconds) in _variants(instance, limit):
        judged = Judged.of(name, problem, result)
        rows.append(replace(_row_beside(rows[0], problem, name, judged, limit), seconds=seconds))
    return rows


def _timed_again(row: Row, problem: Problem, coverage: float, limit: float) -> Row:
    name, seconds = row.planner or "", row.seconds
    if seconds is not None and seconds < _LONG and name in PLANNERS:
        seconds = _timed(PLANNERS[name], problem, limit, seconds)[1]
    return replace(row, seconds=seconds, coverage_seconds=0.0 if is_lazy(name) else coverage)


def _timed(
    planner: Callable[[Problem, Stop], Result], problem: Problem, limit: float, expected: float
) -> tuple[Result, float]:
    """Returns a planner's result, and the least processor time of its runs."""
    runs = []
    for _ in range(3 if expected < _SHORT else 1):
        before = process_time()
        result = planner(problem, TimeLimit(limit))
        runs.append((process_time() - before, result))
    seconds, result = min(runs, key=lambda run: run[0])
    return result, seconds


def _variants(
    instance: Instance, limit: float
) -> Iterator[tuple[str, tuple[Result, float | None]]]:
    """Yields the compositions with their results and seconds; a polish alone is not timed."""
    problem, plan = instance.problem, instance.plan("cocap")
    if plan is not None:
        yield POLISHED, (polished(problem, plan, TimeLimit(limit)), None)
    yield DIVE, _timed(_dive, problem, limit, _LONG)


def _row_beside(row: Row, problem: Problem, name: str, judged: Judged[Result], limit: float) -> Row:
    """Returns the row of another plan of the same instance."""
    judged.warn(problem, row.seed or 0, name)
    planned = PlannedRow.of_planner(problem, row.seed or 0, name, judged, time_limit=limit)
    if "evaluated" in judged.result.statistics and name == DIVE:
        planned = replace(planned, views=int(judged.result.statistics["evaluated"]))
    bound = BoundColumns(**{key: getattr(row, key) for key in BoundColumns.__dataclass_fields__})
    return Row.joined(planned, bound, row.digest)


def _coverage_seconds(problem: Problem) -> float:
    """Returns the processor time of the coverage of all states."""
    model, before = Model(problem, use_cache=False), process_time()
    model.prepare_all(never)
    return process_time() - before


# -- files -------------------------------------------------------------------------------------


def _write_rows(path: Path, rows: Sequence[Row]) -> None:
    """Writes the columns of rows on which answers and tables depend."""
    save_csv(path, [{key: _short(getattr(row, key)) for key in _KEPT} for row in rows])


def read_rows(path: Path) -> list[Row]:
    """Reads rows that `_write_rows` has written; all other columns are empty."""
    rows = DictReader(StringIO(read_text(path)))
    return [_row(fields, f"{path}: line {rows.line_num}") for fields in rows]


def _row(fields: Mapping[str, str], where: str) -> Row:
    return Row(**{
        name: column.parse(fields.get(name, ""), f"{where}: {name}")
        for name, column in COLUMNS.items()
        if not column.is_extra
    })  # fmt: skip


def _short(value: object) -> object:
    return float(f"{value:.9g}") if isinstance(value, float) else value
