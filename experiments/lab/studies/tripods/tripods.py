"""Fixed cameras on walls: proved optima compared with the placements of lab-camera-optimizer.

Each is also judged by the other's measure. Ours is the share of the zones' points, by weight, that
so many cameras see; theirs is a score with many parts, which do not include ours.
"""

import math
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Annotated, NamedTuple, Self

import numpy as np
from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results, load_csv, markdown
from cocap_opt.experiments.lab.studies.options import Out, Seconds
from cocap_opt.experiments.lab.studies.runs import ProcessorLimit
from cocap_opt.experiments.lab.studies.tripods.program import Placed, Program
from cocap_opt.experiments.lab.studies.tripods.rooms import (
    LANDSCAPE,
    PORTRAIT,
    ROOMS,
    Cells,
    Mounted,
    Room,
    exactly,
)
from cocap_opt.footage.quality import Assumptions, Quality
from cocap_opt.output.printing import Listing
from cocap_opt.problem import Plan, Problem, State
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.run.engine import BOUND_METHOD, run
from cocap_opt.run.options import Option

_TABLE = "tripods.csv"
_APART = 30.0  # degrees
_ALL = 1 - 1e-9  # share that counts as all, in view of rounding


class Value(NamedTuple):
    """The value of a placement by our measure.

    Attributes
    ----------
    seen : share of points, by weight, that so many cameras see
    apart : share that two cameras see from at least 30 degrees apart
    """

    seen: float
    apart: float

    @classmethod
    def of(cls, problem: Problem, chosen: Sequence[State], seen_by: int) -> Self:
        """Returns the value of cameras in some states, in the order of the problem's drones."""
        plan = _plan(problem, chosen)
        views = problem.objective.views
        assert views is not None  # the rooms' problems count views
        quality = Quality.of(problem, plan, assumptions=Assumptions(at_least=views.at_least))
        weights = problem.importance
        apart = np.nan_to_num(quality.angles) >= _APART
        seen, wide = (
            float(weights[found].sum() / weights.sum())
            for found in (quality.views >= seen_by, apart)
        )
        return cls(seen, wide)


class Best(NamedTuple):
    """The best placement found, and a bound that no placement exceeds.

    Attributes
    ----------
    cameras : the placed cameras
    value : their value
    bound : upper bound on the share of points, by weight, that so many cameras see
    seconds : CPU time of all searches
    is_proved : True if it is proved that no other placement has more views
    """

    cameras: list[Mounted]
    value: Value
    bound: float
    seconds: float
    is_proved: bool


class TripodRow(NamedTuple):
    """A room with so many cameras, placed by both programs: a row of tripods.csv.

    Shares are of points, by weight. `theirs` means lab-camera-optimizer.
    """

    room: str
    cameras: int
    seen_by: int  # number of cameras that must see a point
    points: int
    theirs: float  # share that so many cameras see, in its unrounded placement
    theirs_rounded: float  # the same, in its placement rounded to our cells
    theirs_apart: float  # share that two see from 30 degrees apart
    ours: float  # share that so many cameras see, in our placement
    ours_apart: float
    bound: float  # bound on this share, for all placements in our cells
    proved: bool
    theirs_score: float  # its score of its placement
    ours_score: float  # its score of our placement
    theirs_seconds: float  # CPU time
    ours_seconds: float
    heading_rounding: float  # degrees, largest rounding of its cameras' headings
    tilt_rounding: float  # degrees


def tripods(
    *,
    theirs: Annotated[
        Path, Parameter(help="Python interpreter with lab-camera-optimizer 1.2.1 installed")
    ],
    room: Annotated[
        list[str] | None, Parameter(negative="", consume_multiple=True, help="rooms")
    ] = None,
    cameras: Annotated[str, Parameter(help="numbers of cameras")] = "2-8",
    seen_by: Annotated[int, Parameter(help="number of cameras that must see each point")] = 2,
    limit: Seconds = 20.0,
    out: Out = None,
) -> None:
    """Measures, prints, and writes the table (tripods.csv)."""
    results, program = Results.into(out), Program(theirs)
    numbers = [n for n in Option("--cameras").numbers(cameras) if n >= seen_by]
    for name in room or ():
        Option("--room").require_one_of(name, ROOMS)
    rows: list[TripodRow] = []
    for each in [ROOMS[name] for name in room or ROOMS]:
        for row in compared(each, numbers, seen_by, limit, program):
            rows.append(row)
            results.save(_TABLE, rows)  # after each room, in case the study is stopped
    Listing("cameras on walls", [row._asdict() for row in rows]).print()


def compared(
    room: Room, numbers: Sequence[int], seen_by: int, seconds: float, program: Program
) -> Iterator[TripodRow]:
    """Yields a row for each number of cameras in a room.

    Parameters
    ----------
    seconds : CPU time for each of our searches; there is one for each number of cameras in
        landscape, until all points are seen
    """
    for number in numbers:
        placed = program.place(room, number)
        best = best_placement(room, number, seen_by, seconds)
        (score,) = program.score(room, [best.cameras])
        say(f"{room.name}, {number} cameras: {best.value.seen:.4f} of at most {best.bound:.4f}")
        yield _row(room, seen_by, placed, best, score)


def _row(room: Room, seen_by: int, placed: Placed, best: Best, score: float) -> TripodRow:
    cells = Cells(room)
    rounded = [(c, nearest(cells, c)) for c in placed.cameras]
    turned = [_turn(c.heading, state.heading * 360 / cells.headings) for c, state in rounded]
    tilted = [
        abs(room.tilt(c.y, c.heading, c.height) - cells.tilts[state.pitch]) for c, state in rounded
    ]
    # The search counts views, up to so many per point, so the share of points may not be the best.
    attained = best.is_proved and best.value.seen >= _ALL * best.bound
    exact = value_as_placed(room, placed.cameras, seen_by)
    in_cells = value_in_cells(room, placed.cameras, seen_by)
    return TripodRow(
        room.name, len(placed.cameras), seen_by, len(room.points), exact.seen, in_cells.seen,
        exact.apart, best.value.seen, best.value.apart, best.bound, attained, placed.score,
        score, placed.seconds, best.seconds, max(turned),
        math.degrees(max(tilted)),
    )  # fmt: skip


def value_as_placed(room: Room, cameras: Sequence[Mounted], seen_by: int) -> Value:
    """Returns the value of cameras with headings rounded to a degree, and exact tilts."""
    cells, states = exactly(room, cameras)
    return _value(cells, states, seen_by)


def value_in_cells(room: Room, cameras: Sequence[Mounted], seen_by: int) -> Value:
    """Returns the value of cameras that are rounded to states of our problem."""
    cells = Cells(room)
    states = {
        side: [nearest(cells, camera) for camera in cameras if camera.orientation == side]
        for side in (LANDSCAPE, PORTRAIT)
    }
    return _value(cells, states, seen_by)


def nearest(cells: Cells, camera: Mounted) -> State:
    """Returns the candidate at the place of a camera with the nearest heading and tilt.

    Headings count first, then tilts.
    """
    wanted = cells.state(camera)
    turn, tilt = 360 / cells.headings, cells.room.tilt(camera.y, camera.heading, camera.height)

    def far(state: State) -> tuple[float, float, float]:
        away = math.dist(state[:3], wanted[:3])
        return (
            away,
            _turn(state.heading * turn, camera.heading),
            abs(cells.tilts[state.pitch] - tilt),
        )

    return min(cells.candidates(camera.orientation), key=far)


def best_placement(room: Room, number: int, seen_by: int, seconds: float) -> Best:
    """Returns the best placement of so many cameras, for all numbers of cameras in landscape."""
    cells, spent = Cells(room), ProcessorLimit(math.inf)
    candidates = {side: cells.candidates(side) for side in (LANDSCAPE, PORTRAIT)}
    found: list[tuple[float, list[Mounted], Value]] = []
    bound, proved = 0.0, True
    for upright in range(number + 1):
        counts = {LANDSCAPE: number - upright, PORTRAIT: upright}
        starts = {side: [candidates[side]] * count for side, count in counts.items()}
        problem = cells.problem(seen_by, starts)
        judged = run(problem, BOUND_METHOD, ProcessorLimit(seconds))
        most = seen_by * problem.importance.sum()
        bound = max(bound, judged.result.bound / most)
        proved &= judged.reason == Reason.OPTIMAL
        if judged.valid:
            chosen = [path[0] for path in judged.result.plan.paths]
            sides = [side for side, count in counts.items() for _ in range(count)]
            mounted = [cells.camera(side, s) for side, s in zip(sides, chosen, strict=True)]
            found.append((judged.reward / most, mounted, Value.of(problem, chosen, seen_by)))
            if judged.reward / most >= _ALL:  # nothing is better
                bound, proved = 1.0, True
                break
    _, mounted, value = max(found, key=itemgetter(0))
    return Best(mounted, value, min(bound, 1.0), spent.seconds, proved)


def _value(cells: Cells, states: dict[str, list[State]], seen_by: int) -> Value:
    starts = {side: [(state,) for state in chosen] for side, chosen in states.items()}
    chosen = [state for of_side in states.values() for state in of_side]
    problem = cells.problem(seen_by, starts)
    verdict = check(problem, _plan(problem, chosen))
    if not verdict.valid:
        raise RuntimeError(f"the placement breaks a rule: {verdict}")
    return Value.of(problem, chosen, seen_by)


def _plan(problem: Problem, chosen: Sequence[State]) -> Plan:
    return Plan(paths=tuple((state,) * (problem.horizon + 1) for state in chosen))


def _turn(first: float, second: float) -> float:
    """Returns the angle (degrees) between two headings."""
    return abs((first - second + 180) % 360 - 180)


def stored_placements() -> list[TripodRow]:
    """Returns the stored rows."""
    return load_csv(STORED / _TABLE, TripodRow, "tripods")


def tripods_in_markdown() -> str:
    """Returns the stored comparison in Markdown."""
    return markdown([
        {
            "room": row.room,
            "cameras": row.cameras,
            "its, seen by two": f"{100 * row.theirs:.1f} %",
            "in our cells": f"{100 * row.theirs_rounded:.1f} %",
            "ours": f"{100 * row.ours:.1f} %",
            "at most": f"{100 * row.bound:.1f} %{'' if row.proved else ' *'}",
            "its, 30 degrees apart": f"{100 * row.theirs_apart:.0f} %",
            "ours, apart": f"{100 * row.ours_apart:.0f} %",
            "its score": f"{row.theirs_score:.1f}",
            "its score of our cameras": f"{row.ours_score:.1f}",
            "its time": f"{row.theirs_seconds:.1f} s",
            "our time": f"{row.ours_seconds:.1f} s",
        }
        for row in stored_placements()
    ])  # fmt: skip


def tripods_in_words() -> str:
    """States in how many rows each program's cameras see all points, and which scores higher."""
    rows = stored_placements()
    ours, theirs, rounded = (
        sum(getattr(row, field) >= _ALL for row in rows)
        for field in ("ours", "theirs", "theirs_rounded")
    )
    proved = sum(row.proved for row in rows)
    higher = sum(row.theirs_score > row.ours_score for row in rows)
    least = min(rows, key=lambda row: row.theirs)
    return (
        f"In {ours} of {len(rows)} rows, two of our cameras see every point, and {proved} of our "
        f"placements are proved best. Two of its cameras see every point in {theirs} rows in its "
        f"own placement, and in {rounded} rows in our cells; the smallest share is "
        f"{100 * least.theirs:.1f} %, with {least.cameras} cameras in `{least.room}`. By its "
        f"score, its placement is better in {higher} of {len(rows)} rows."
    )
