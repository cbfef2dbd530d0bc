from dataclasses import replace

import numpy as np
import pytest
from test_flight import sampled

from cocap_opt.data import FloatArray
from cocap_opt.flight.bernstein import elevated
from cocap_opt.flight.delays import FINE, bearable_delay, bearable_delay_of_people
from cocap_opt.flight.trajectory import DEGREE, Trajectory
from cocap_opt.problem import Actor, Airspace, CollisionRules, Problem, Robot, State
from cocap_opt.world.workspace import HeightMap

STEP = 2.0
_CROSSING = 1.5 - np.sqrt(2) * 0.2


def lines(*ends: FloatArray) -> Trajectory:
    """Flights straight through points [T+1, 3], one per drone."""
    corners = np.pad(np.array(ends, dtype=np.float64), ((0, 0), (0, 0), (0, 2)))
    pieces = elevated(np.stack([corners[:, :-1], corners[:, 1:]], axis=-1), DEGREE)
    problem = Problem(
        name="lines", height_map=HeightMap(heights=np.zeros((3, 3))), horizon=pieces.shape[1],
        robots=tuple(Robot(start=State(i, 0)) for i in range(len(ends))), step=STEP, actors=(),
    )  # fmt: skip
    return Trajectory(problem, pieces)


def along(axis: int, first: float, speed: float, *, height: float = 0.0) -> FloatArray:
    """Points of four steps along x or y, so many m per step."""
    points = np.zeros((5, 3))
    points[:, axis] = first + speed * np.arange(5)
    points[:, 2] = height
    return points


@pytest.mark.parametrize(
    ("one", "other", "rules", "steps"),
    [
        # Both cross a point at 10 m a step, one at step 1 and the other at step 2.5.
        (along(0, -10, 10), along(1, -25, 10), {}, _CROSSING),
        # The same, 1 m above it: in space they need be only 1.73 m apart seen from above.
        (along(0, -10, 10), along(1, -25, 10, height=1), {}, 1.5 - np.sqrt(6) * 0.1),
        (along(0, -10, 10), along(1, -25, 10, height=1), {"vertical": 1.0}, np.inf),
        (along(0, -10, 10), along(1, -25, 10, height=0.9), {"vertical": 1.0}, _CROSSING),
        # One follows the other on a line, 5 m behind.
        (along(0, 5, 10), along(0, 0, 10), {}, 0.3),
        # Side by side, just so far apart as they must be, and as far apart in line.
        (along(0, 0, 10), along(0, 0, 10) + np.array([0, 2, 0]), {}, np.inf),
        (along(0, 2, 10), along(0, 0, 10), {}, 0.0),
        # One arrives where the other has left from 1.2 steps before: it must not be late to go.
        (along(0, -30, 10), along(0, 8, 10), {}, 3.6),
        # Nobody moves.
        (along(0, 0, 0), along(0, 2, 0), {}, np.inf),
    ],
)  # fmt: skip
def test_delays_of_lines_are_exact(
    one: FloatArray, other: FloatArray, rules: dict[str, float], steps: float
) -> None:
    """A drone may be late by what geometry says, up to the stated error, and never by more."""
    asked = CollisionRules(separation=2.0, **rules)
    for found in (
        bearable_delay(lines(one, other), asked),
        bearable_delay(lines(other, one), asked),
    ):
        assert steps * STEP - FINE - 1e-6 <= found <= steps * STEP + 1e-6


def test_a_nearer_clash_of_other_steps_is_found() -> None:
    """A clash of moments in two steps counts before a later one of moments in the same step."""
    one = along(0, -10, 10)
    same = along(1, -0.5, 10) + np.array([-0.5, 0, 0])  # 0.9 steps before
    others = along(1, -7.5, 10) + np.array([2, 0, 0])  # 0.45 steps before, in the step before
    found = bearable_delay(lines(one, same, others), CollisionRules(separation=2.0))
    exact = (0.45 - np.sqrt(2) * 0.2) * STEP
    assert exact - FINE - 1e-6 <= found <= exact + 1e-6


def test_one_drone_alone_bears_any_delay() -> None:
    """Without a pair there is nothing to be too close to."""
    assert bearable_delay(lines(along(0, 0, 10)), CollisionRules(separation=2.0)) == np.inf


def first_clash(flown: Trajectory, rules: CollisionRules, per_step: int) -> float:
    """Seconds of the least delay at which samples of two drones are too close."""
    places = sampled(flown, per_step)
    count = places.shape[1]
    for late in range(count):
        padded = np.pad(places, ((0, 0), (late, late), (0, 0)), mode="edge")  # they hover
        ahead, behind = padded[:, late:], padded[:, : count + late]
        ways = behind[None] - ahead[:, None]
        near = rules.too_near(ways) & ~np.eye(len(places), dtype=np.bool_)[..., None]
        if near.any():
            return late * flown.step / per_step
    return np.inf


def test_delays_are_those_of_samples() -> None:
    """On random curves, samples clash soon above the delay, and never below it."""
    rng, finite = np.random.default_rng(3), 0
    for k in range(16):
        pieces = rng.normal(0.0, 4.0, (2, 3, 5, 6)) + 3 * rng.normal(0.0, 1.0, (2, 1, 5, 1))
        flown = lines(along(0, 0, 1)[:4], along(0, 0, 1)[:4]).with_pieces(pieces)
        rules = CollisionRules(separation=rng.uniform(0.5, 2), vertical=k % 2)
        found, sample = bearable_delay(flown, rules), first_clash(flown, rules, 50)
        assert found <= sample
        assert sample == np.inf or sample <= found + 3 * STEP / 50
        finite += 0 < found < np.inf
    assert finite > 5


def beside_people(flown: Trajectory, walks: list[FloatArray], airspace: Airspace) -> Trajectory:
    """The same flights beside people who walk through points [T+1, 2], in some airspace."""
    poses = (np.column_stack([walk, np.zeros((len(walk), 2))]) for walk in walks)
    actors = tuple(Actor(poses=pose) for pose in poses)
    return replace(flown, problem=flown.problem.replace(actors=actors, airspace=airspace))


@pytest.mark.parametrize(
    ("walk", "above", "steps"),
    [
        (
            along(1, -25, 10),
            None,
            _CROSSING,
        ),  # they cross 1.5 steps after it
        (along(1, 5, -10), None, 0.5 - np.sqrt(2) * 0.2),  # half a step before it
        (along(0, 20, 0), None, 0.0),  # somebody stands where the drone flies
        (along(1, -25, 10), 4.0, np.inf),  # the drone is 10 m above heads
    ],
)
def test_delays_towards_people_are_exact(
    walk: FloatArray, above: float | None, steps: float
) -> None:
    """Whoever is late, a drone or a person, counts; distances are those that the airspace asks."""
    far = np.array([100.0, 100.0, 0.0])
    flown = lines(along(0, -10, 10, height=12.0), along(1, 0, 0) + far)
    airspace = Airspace(people_aside=2.0, people_above=above)
    corner = np.array(flown.problem.height_map.origin)
    found = bearable_delay_of_people(
        beside_people(flown, [walk[:, :2] + corner, far[:2] + 50 + 0 * walk[:, :2]], airspace)
    )
    assert steps * STEP - FINE - 1e-6 <= found <= steps * STEP + 1e-6
    none = beside_people(flown, [walk[:, :2]], Airspace())
    assert bearable_delay_of_people(none) == np.inf
