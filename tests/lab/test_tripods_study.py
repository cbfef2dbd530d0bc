"""The study of fixed cameras: tiny rooms against brute force, and what is stored of it."""

import itertools
import math
import random
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from cocap_opt.experiments.lab.results import STORED
from cocap_opt.experiments.lab.studies.tripods.program import Placed, Program
from cocap_opt.experiments.lab.studies.tripods.rooms import (
    LANDSCAPE,
    PORTRAIT,
    ROOMS,
    Cells,
    Mounted,
    Room,
    Zone,
)
from cocap_opt.experiments.lab.studies.tripods.tripods import (
    TripodRow,
    best_placement,
    compared,
    stored_placements,
    tripods_in_markdown,
    tripods_in_words,
    value_as_placed,
    value_in_cells,
)
from cocap_opt.files.documents import FileError
from cocap_opt.footage.shares import visible_shares
from cocap_opt.problem import NO_RULES, Plan

TINY = Room(
    "tiny", "none", (2.0, 1.5), 3.0, (60.0, 50.0), (1.2,), 0.6, 0.5, (0.5, 1.5),
    (Zone((0.5, 0.5, 1.5, 1.0), 1.0), Zone((1.0, 0.5, 1.0, 0.5), 2.0)),
    2, 0.8, 0.01, 2, person=0.5, whole=0.6,
)  # fmt: skip


class Shuffled(Program):
    """A stand-in for the program that mounts cameras at random, apart, and scores their number."""

    def place(self, room: Room, number: int) -> Placed:
        """Returns cameras drawn from a fixed seed."""
        return Placed(apart(room, number, random.Random(1)), float(number), 0.1)

    def score(self, room: Room, placements: Sequence[Sequence[Mounted]]) -> list[float]:
        """Returns the numbers of cameras."""
        return [float(len(cameras)) for cameras in placements]


def apart(room: Room, number: int, draw: random.Random) -> list[Mounted]:
    """Draws cameras among a room's candidates until they keep their distance."""
    cells = Cells(room)
    every = [
        cells.camera(side, state)
        for side in (LANDSCAPE, PORTRAIT)
        for state in cells.candidates(side)
    ]
    while True:
        drawn = draw.sample(every, number)
        if all(keep_apart(room, *pair) for pair in itertools.combinations(drawn, 2)):
            return drawn


def keep_apart(room: Room, a: Mounted, b: Mounted) -> bool:
    """Returns True if two cameras keep the room's distance, seen from above."""
    return (a.x - b.x) ** 2 + (a.y - b.y) ** 2 >= (room.spacing - 1e-6) ** 2


def seen_from(room: Room) -> dict[tuple[float, float], set[frozenset[int]]]:
    """Returns the largest sets of points that a camera sees from each place, by solid angles."""
    cells, found = Cells(room), dict[tuple[float, float], set[frozenset[int]]]()
    for side in (LANDSCAPE, PORTRAIT):
        states = cells.candidates(side)
        problem = cells.problem(1, {side: [states]}).replace(rules=NO_RULES)
        robots = tuple(problem.robots[0].replace(start=state) for state in states)
        plan = Plan(paths=tuple((state,) * len(room.points) for state in states))
        shares = visible_shares(problem.replace(robots=robots), plan)[:, :, 0]
        for state, seen in zip(states, (shares >= room.whole).T, strict=True):
            camera = cells.camera(side, state)
            points = frozenset(np.flatnonzero(seen).tolist())
            found.setdefault((camera.x, camera.y), set()).add(points)
    return {
        place: {one for one in sets if not any(one < other for other in sets)}
        for place, sets in found.items()
    }


def best_by_brute_force(room: Room, seen_by: int) -> float:
    """Returns the largest share of views of all pairs that are apart, up to so many of a point."""
    weights, sets, best = [weight for *_, weight in room.points], seen_from(room), 0.0
    for a, b in itertools.combinations(sets, 2):
        if math.dist(a, b) >= room.spacing - 1e-6:
            for one, other in itertools.product(sets[a], sets[b]):
                views = [min(seen_by, (k in one) + (k in other)) for k in range(len(weights))]
                value = sum(w * n for w, n in zip(weights, views, strict=True))
                best = max(best, value / (seen_by * sum(weights)))
    return best


@pytest.mark.slow(seconds=10)
@pytest.mark.parametrize("seen_by", [1, 2])
def test_the_best_placement_is_that_of_brute_force(seen_by: int) -> None:
    """Among all pairs of cameras, whatever their orientations, none is better."""
    best = best_placement(TINY, 2, seen_by, 20.0)
    assert best.is_proved
    assert best.bound == pytest.approx(best_by_brute_force(TINY, seen_by), abs=1e-9)
    assert best.value.seen <= best.bound + 1e-9


@pytest.mark.slow(seconds=5)
def test_no_placement_is_above_the_bound() -> None:
    """Whatever another program mounts, rounded to our cells it sees no more than is proved."""
    (row,) = compared(TINY, [2], 2, 20.0, Shuffled(Path()))
    assert_sound(row)
    assert row.heading_rounding == 0 and row.theirs_score == 2
    draw = random.Random(2)
    for _ in range(20):
        assert value_in_cells(TINY, apart(TINY, 2, draw), 2).seen <= row.bound + 1e-9


def test_a_point_in_two_zones_has_the_larger_weight() -> None:
    """Priorities do not add up."""
    assert TINY.points == [
        (0.5, 0.5, 1.0), (0.5, 1.0, 1.0), (1.0, 0.5, 2.0), (1.0, 1.0, 1.0), (1.5, 0.5, 1.0),
        (1.5, 1.0, 1.0),
    ]  # fmt: skip


def test_a_pillar_hides_points_and_takes_places() -> None:
    """A camera behind a pillar sees what it sees without, or less; none is mounted in it."""
    camera, level = Mounted(0.0, 1.5, -45.0, LANDSCAPE, 1.2), TINY._replace(whole=0.1)
    hidden = level._replace(pillars=((0.3, 0.8, 0.4, 1.4),))
    free, blocked = (value_as_placed(room, [camera], 1).seen for room in (level, hidden))
    assert blocked < free
    corner = TINY._replace(pillars=((0.9, 0.0, 1.1, 0.1),))
    assert not any(state[:2] == (2, 0) for state in Cells(corner).candidates(LANDSCAPE))


def test_a_python_without_the_program_is_refused() -> None:
    """The message names the option."""
    with pytest.raises(FileError, match="--theirs: must be a Python with lab-camera-optimizer"):
        Program(Path(sys.executable)).place(TINY, 2)
    with pytest.raises(FileError, match=r"--theirs: .*nowhere cannot be run"):
        Program(Path("/nowhere")).place(TINY, 2)


def assert_sound(row: TripodRow) -> None:
    """What either program places in our cells is at most the bound; shares are shares."""
    assert max(row.ours, row.theirs_rounded) <= row.bound + 1e-9 <= 1 + 2e-9
    assert min(row.theirs, row.theirs_apart, row.ours_apart) >= 0


def test_what_is_stored_is_sound_and_on_the_page() -> None:
    """Pages are made of it."""
    rows = stored_placements()
    for row in rows:
        assert_sound(row)
    assert {row.room for row in rows} <= set(ROOMS)
    table = tripods_in_markdown()
    assert len(table.splitlines()) == len(rows) + 2
    for row in rows:
        assert f"{row.theirs_score:.1f}" in table and f"{100 * row.theirs:.1f} %" in table
    assert str(len(rows)) in tripods_in_words()
    page = (Path(__file__).parents[2] / "docs/results/tripods.md").read_text()
    assert ": tripods -->" in page and ": tripods_in_words -->" in page
    assert (STORED / "tripods.csv").exists()
