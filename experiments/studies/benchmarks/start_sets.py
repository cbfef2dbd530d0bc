"""Tables of Greedy Perspectives: planners over start sets, with a bound beside each number.

Where a scene's folder holds what their program planned, that is one plan more, from the start
poses in the scene's own file, in a table of its own.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path

from cocap_opt.data import ProblemError
from cocap_opt.experiments.console.progress import Watch, watching
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.results.files import make_folder, read_plan, save_csv
from cocap_opt.experiments.results.gap_table import cover, plans_of, rows_of, told_apart
from cocap_opt.experiments.results.rows import BOUND_METHOD, Judged, Row, of_others
from cocap_opt.experiments.studies.benchmarks.start_sets_table import (
    SetRun,
    publish,
    typed,
)
from cocap_opt.experiments.studies.benchmarks.tables import commit, read_csv
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Result
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.stop import FirstOf, Interrupt, Limit, TimeLimit, catch_interrupt

PLANNERS = ("formation", "one-step", "greedy", "sequential", "cocap", "cocap-vs", BOUND_METHOD)
THEIRS = "theirs"
PEER_PLAN, PEER_REWARD = "peer_paths.csv", "peer_reward.csv"


@dataclass(frozen=True)
class Peer:
    """What their program planned: the plan, and J of its pixels, with mixed and own tilts."""

    judged: Judged[Result]
    reported: float
    reported_own_tilt: float


@dataclass(frozen=True)
class Cell:
    """A scene and a start set; without a set, the start poses of the scene's own file."""

    problem: Problem
    start_set: int | None
    peer: Peer | None = None

    @cached_property
    def key(self) -> Row:
        """What its rows in the file say of it."""
        return {
            "scene": self.problem.name,
            "seed": self.start_set,
            "digest": problem_digest(self.problem),
        }


def start_sets(
    scenes: Sequence[str],
    sets: Sequence[int],
    limit: float,
    options: Mapping[str, str],
    out: Path | None = None,
) -> bool:
    """Measure what is not in `out`/runs.csv yet, and print and write the tables.

    Rows of a scene and set that were measured with another limit or other options are
    replaced, as are the plans and certificates that they name.

    Returns
    -------
    bool
        Whether all is measured: False after Ctrl-C.
    """
    cells = [*set_cells(scenes, sets, options), *peer_cells(scenes, options)]
    make_folder(out, "plans", "certificates")
    path = None if out is None else out / "runs.csv"
    rows = [] if path is None else read_csv(path)
    known = [typed(row, str(path)) for row in rows]
    todo = [cell for cell in cells if not _is_known(cell, limit, known)]
    if len(todo) < len(cells):
        say(f"{len(cells) - len(todo)} of {len(cells)} are in {path} already")
    rows = _others(todo, rows)
    _store(path, rows)
    try:
        with catch_interrupt() as interrupt, watching("start sets", parts=len(todo)) as watch:
            for cell in todo:
                found = _measured(cell, limit, interrupt, out, watch)
                if interrupt() is not Limit.NONE:  # what was cut short is not what was asked for
                    break
                rows += found
                _store(path, rows)
                watch.finish()
    finally:
        runs = [typed(row, str(path)) for row in rows]
        publish([run for cell in cells for run in runs if _belongs(cell, limit, run)], limit, out)
    return interrupt() is Limit.NONE


def set_cells(scenes: Sequence[str], sets: Sequence[int], options: Mapping[str, str]) -> list[Cell]:
    """A cell per scene and start set."""
    problems = told_apart({(s, k): load_scene(s, k, options) for s in scenes for k in sets})
    first: dict[tuple[str, str], int] = {}
    for (scene, k), problem in problems.items():
        other = first.setdefault((scene, problem_digest(problem)), k)
        if other != k:
            raise FileError(f"{scene}: --sets: {other} and {k} are the same start set; name one")
    return [Cell(problem, k) for (_, k), problem in problems.items()]


def peer_cells(scenes: Sequence[str], options: Mapping[str, str]) -> Iterator[Cell]:
    """A cell per scene that has what their program planned beside it."""
    own = {**options, "start-set": "yaml"}
    found = [scene for scene in dict.fromkeys(scenes) if _has_peer(scene)]
    problems = told_apart({(scene, 0): load_scene(scene, 0, own) for scene in found})
    for (scene, _), problem in problems.items():
        named = problem.replace(name=f"{problem.name}-own-starts")
        try:
            yield Cell(named, None, _peer(scene, named))
        except (FileError, ProblemError) as error:  # such as moves that other conventions forbid
            say(f"{scene}: their plan is left out: {error}")


def _folder(scene: str) -> Path:
    path = Path(scene)
    return path if path.is_dir() else path.parent


def _has_peer(scene: str) -> bool:
    """Whether it is a scene of theirs, with their plan and its reward beside it."""
    is_theirs = Path(scene).is_dir() or Path(scene).suffix.lower() in (".yaml", ".yml")
    files = (_folder(scene) / name for name in (PEER_PLAN, PEER_REWARD))
    return scene not in SCENES and is_theirs and all(file.is_file() for file in files)


def _peer(scene: str, problem: Problem) -> Peer:
    from cocap_opt.scenarios.formats.greedy_perspectives import read_reward

    _, plan = read_plan(_folder(scene) / PEER_PLAN, scene, problem)
    steps = slice(problem.first_step, None)
    reported = read_reward(_folder(scene) / PEER_REWARD, problem)
    return Peer(
        of_others(problem, plan),
        math.fsum(reported.as_reported[steps]),
        math.fsum(reported.own_tilt[steps]),
    )


def _measured(
    cell: Cell, limit: float, interrupt: Interrupt, out: Path | None, watch: Watch
) -> list[Row]:
    """Rows of a cell, their plan's first."""

    def limits() -> FirstOf:
        return FirstOf(interrupt, TimeLimit(limit))

    problem, number = cell.problem, cell.start_set or 0
    where = problem.name if cell.start_set is None else f"{problem.name} set {number}"
    watch.begin(where)
    cover(problem, limits(), watch)
    plans = plans_of(problem, number, PLANNERS, limits, out, watch)
    if cell.peer is not None:
        plans = {THEIRS: cell.peer.judged, **plans}
    rows = rows_of(problem, number, plans, limits, out, watch)
    say(f"{where}: {rows[-1]['reason']}, {_in_words(rows)}")
    return [_row(cell, limit, row) for row in rows]


def _in_words(rows: Sequence[Row]) -> str:
    return ", ".join(
        f"{row['planner']} {'-' if row['reward'] is None else format(row['reward'], ',.0f')}"
        for row in rows
    )


def _row(cell: Cell, limit: float, row: Row) -> Row:
    """Row of the file: that of the gap table, and what it was measured on."""
    peer = cell.peer if row["planner"] == THEIRS else None
    return (
        row
        | cell.key
        | {
            "rows": cell.problem.horizon + 1 - cell.problem.first_step,
            "reported": peer and peer.reported,
            "reported_own_tilt": peer and peer.reported_own_tilt,
            "limit_seconds": limit,
            "commit": commit(),
            "written": datetime.now(UTC).isoformat(timespec="seconds"),
        }
    )


def _others(cells: Sequence[Cell], rows: Sequence[Row]) -> list[Row]:
    """Rows that are of none of these cells, however measured."""
    names = {(cell.problem.name, cell.start_set) for cell in cells}
    runs = (typed(row, "runs.csv") for row in rows)
    return [row for row, run in zip(rows, runs, strict=True) if (run.scene, run.seed) not in names]


def _store(path: Path | None, rows: Sequence[Row]) -> None:
    """Write the file anew; rows that were read may lack columns that others have."""
    if path is None:
        return
    if not rows:
        path.unlink(missing_ok=True)
        return
    columns = list(dict.fromkeys(key for row in reversed(rows) for key in row))
    save_csv(path, [{key: row.get(key) for key in columns} for row in rows])


def _is_known(cell: Cell, limit: float, runs: Sequence[SetRun]) -> bool:
    """Whether all planners' runs of a cell are there."""
    planners = {run.planner for run in runs if _belongs(cell, limit, run)}
    return planners >= {*PLANNERS, *([THEIRS] if cell.peer else [])}


def _belongs(cell: Cell, limit: float, run: SetRun) -> bool:
    return run.limit_seconds == limit and cell.key == {
        "scene": run.scene,
        "seed": run.seed,
        "digest": run.digest,
    }
