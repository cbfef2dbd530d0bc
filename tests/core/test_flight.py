from dataclasses import replace
from functools import lru_cache
from itertools import product as product_of

import numpy as np
import pytest

from cocap_opt.data import BoolArray, FloatArray, ProblemError
from cocap_opt.flight.bernstein import Peak, derivative, elevated, ever_positive, product, values
from cocap_opt.flight.delays import bearable_delay
from cocap_opt.flight.filming import view_reward
from cocap_opt.flight.pace import Demand
from cocap_opt.flight.robustness import Robustness
from cocap_opt.flight.safety import Nearest, dangers
from cocap_opt.flight.smooth import Smooth, _Blends, spare
from cocap_opt.flight.strain import SHORTENED, longest_move, strains, sufficient_step
from cocap_opt.flight.trajectory import Trajectory, split
from cocap_opt.problem import (
    NO_RULES,
    Actor,
    Airspace,
    AnyCamera,
    Camera,
    CollisionRules,
    Cone,
    Limits,
    Motion,
    Objective,
    Plan,
    Problem,
    Robot,
    State,
    Views,
)
from cocap_opt.referee import check
from cocap_opt.world.workspace import HeightMap, Mesh

SIZE, STEPS = 7, 6
RULES = [
    CollisionRules(),
    CollisionRules(separation=2.0),
    CollisionRules(separation=2.5),
    CollisionRules(separation=3.0, vertical=2.0),
]


def random_problem(rng: np.random.Generator) -> Problem:
    """A crowded scene: walls, slopes, a no-fly zone, people, several layers, some radius 2."""
    heights = np.where(rng.random((SIZE, SIZE)) < 0.15, 20.0, 0.0)
    datum = rng.random((SIZE, SIZE)) if rng.random() < 0.3 else None
    motion = Motion(
        radius=int(rng.integers(1, 3)), layers=(4.0, 6.0), clearance=0.5, turn=2, headings=8
    )
    zone = Mesh.box((4.2, 4.2, 0.0), (5.0, 5.5, 5.0))
    feet = np.array([3.5, 3.5, 0.0, 3.0]) + np.arange(STEPS + 1)[:, None] * [0.3, 0.2, 0, 0.4]
    airspace = Airspace(
        no_fly=(zone,) if rng.random() < 0.5 else (),
        ceiling=6.0 if rng.random() < 0.3 else None,
        people_aside=1.4 if rng.random() < 0.3 else 0.0,
    )
    camera = Camera(tilts=(0.2, 0.7, 1.2), width=400, height=300, focal=150.0)
    cells = rng.permutation(np.argwhere(heights == 0))[: rng.integers(1, 5)].tolist()
    robots = tuple(
        Robot(start=State(x, y, int(rng.integers(2)), int(rng.integers(8)), 1), motion=motion,
              camera=camera)
        for x, y in cells
    )  # fmt: skip
    return Problem(
        name="random", robots=robots, horizon=STEPS, step=0.5, airspace=airspace,
        height_map=HeightMap(heights=heights, origin=(500_000.0, 4_790_000.0), datum=datum),
        actors=(Actor(poses=feet + np.array([500_000.0, 4_790_000.0, 0, 0])),),
        rules=RULES[int(rng.integers(len(RULES)))],
    )  # fmt: skip


def random_plan(problem: Problem, rng: np.random.Generator) -> Plan | None:
    """A plan of random moves that obeys all rules, drone by drone, or None."""
    paths: list[tuple[State, ...]] = []
    for i in range(len(problem.robots)):
        alone = problem.replace(robots=problem.robots[: i + 1])
        if not problem.airspace.people_aside:  # nobody need be seen for that
            alone = alone.replace(actors=())
        for _ in range(30):
            path = random_path(problem.robots[i], rng)
            if check(alone, Plan(paths=(*paths, path))).valid:
                paths.append(path)
                break
        else:
            return None
    return Plan(paths=tuple(paths))


def random_path(robot: Robot, rng: np.random.Generator) -> tuple[State, ...]:
    """Moves at random, often straight on."""
    motion, path, move = robot.motion, [robot.start], np.zeros(3, dtype=np.int64)
    for _ in range(STEPS):
        if rng.random() < 0.6:
            r = motion.radius
            move = rng.integers([-r, -r, -1], [r + 1, r + 1, 2])
        a = path[-1]
        path.append(State(
            int(np.clip(a.x + move[0], 0, SIZE - 1)), int(np.clip(a.y + move[1], 0, SIZE - 1)),
            int(np.clip(a.layer + move[2], 0, 1)), int(a.heading + rng.integers(-2, 3)) % 8,
            int(np.clip(a.pitch + rng.integers(-1, 2), 0, 2)),
        ))  # fmt: skip
    return tuple(path)


@lru_cache
def flights(count: int = 6, seed: int = 0) -> list[tuple[Problem, Plan, Smooth]]:
    """Random scenes with plans and their smooth flights."""
    rng, found = np.random.default_rng(seed), []
    while len(found) < count:
        try:
            problem = random_problem(rng)
        except ProblemError:  # starts too close to each other, or in a zone
            continue
        if plan := random_plan(problem, rng):
            found.append((problem, plan, Smooth.of(problem, plan)))
    return found


def sampled(flown: Trajectory, per_step: int = 40) -> FloatArray:
    """Where drones are, [R, n, 3] m."""
    times = np.linspace(0.0, flown.seconds, flown.problem.horizon * per_step + 1)
    return flown.at(times).place.reshape(len(flown.pieces), -1, 3)


def too_near_matter(problem: Problem, places: FloatArray) -> BoolArray:
    """Samples [n] in which a drone is where none may be, by the columns of the workspace."""
    columns, forbidden = problem.workspace.columns, problem.workspace.forbidden
    found = np.zeros(places.shape[:2], dtype=np.bool_)
    for i, (robot, path) in enumerate(zip(problem.robots, places, strict=True)):
        for k, (x, y, z) in enumerate(path.round(9).tolist()):
            cell, own = problem.height_map.cell_of(x, y), robot.motion.clearance - 2e-6
            found[i, k] = (
                not problem.height_map.inside(*cell)
                or columns.solid_at(*cell, z - own, z + own)
                or forbidden.solid_at(*cell, z - 2e-6, z - 2e-6)
            )
    return found.any(axis=0)


def too_near_others(problem: Problem, places: FloatArray) -> BoolArray:
    """Samples [n] in which drones break the separation, or are too close to people."""
    steps, found = np.linspace(0, STEPS, places.shape[1]), np.zeros(places.shape[1], dtype=np.bool_)
    for i, one in enumerate(places):
        for other in places[:i]:
            if problem.rules.separation:
                found |= problem.rules.too_near(other - one)
        if problem.airspace.people_aside:
            (actor,) = problem.actors
            at = [np.interp(steps, range(STEPS + 1), axis) for axis in actor.middles.T]
            rules = problem.airspace.rules_beside(actor)
            found |= rules.too_near(one - np.column_stack(at))
    return found


@pytest.mark.slow
def test_smooth_flights_are_safe_wherever_they_are_sampled() -> None:
    """What is proved on polynomials holds on samples: distances, obstacles, zones, people."""
    kept = 0
    for problem, _, made in flights():
        if made.dangers:  # near people only, who do not walk at a drone's pace
            assert all("actors" in danger.words for danger in made.dangers)
            continue
        places = sampled(made.trajectory, 20)
        assert not too_near_matter(problem, places).any()
        assert not too_near_others(problem, places).any()
        kept += 1
    assert kept > len(flights()) / 2


def test_flights_that_are_unsafe_where_they_are_sampled_are_dangers() -> None:
    """Of flights at random, each step with a sample that breaks a rule is told."""
    rng, told, kept, of_matter = np.random.default_rng(1), 0, 0, 0
    for problem, plan, _ in flights():
        straight = Trajectory.straight(problem, plan)
        noise = rng.normal(0.0, 1.0, straight.pieces.shape) * (rng.random((STEPS, 1, 1)) < 0.7)
        flown = straight.with_pieces(straight.pieces + noise)
        found, places = {danger.step for danger in dangers(flown)}, sampled(flown, 20)
        matter, others = too_near_matter(problem, places), too_near_others(problem, places)
        for t in range(STEPS):
            own = slice(20 * t, 20 * t + 20)  # at its end is the next piece
            assert t in found or not (matter | others)[own].any()
            told += t in found
            kept += t not in found
            of_matter += matter[own].any() and not others[own].any()
    assert min(told, kept, of_matter) > 4


def flown_lines(
    heights: FloatArray, *lines: list[float], clearance: float = 0.5, vertical: float = 0.0
) -> Trajectory:
    """Flights of one step from x, y, z to x, y, z (m), of drones that keep 1.5 m apart."""
    motion = Motion(radius=1, layers=(4.0,), clearance=clearance)
    problem = Problem(
        name="lines", height_map=HeightMap(heights=heights), actors=(), horizon=1, step=1.0,
        robots=tuple(Robot(start=State(1 + 2 * i, 1), motion=motion) for i in range(len(lines))),
        rules=CollisionRules(separation=1.5, vertical=vertical),
    )  # fmt: skip
    ends = np.array(lines, dtype=np.float64).reshape(len(lines), 1, 2, 3).swapaxes(2, 3)
    return Trajectory(problem, elevated(np.pad(ends, ((0, 0), (0, 0), (0, 2), (0, 0))), 5))


MATTER, OUTSIDE = "comes too close to solid matter", "leaves the map"


@pytest.mark.parametrize(
    ("line", "block", "clearance", "words"),
    [
        ([1.5, 4.5, 4, 7.5, 4.5, 4], 20.0, 0.5, MATTER),
        ([1.5, 3.5, 4, 7.5, 3.5, 4], 20.0, 0.5, ""),
        ([1.5, 4.0, 4, 7.5, 4.0, 4], 20.0, 0.5, MATTER),  # along its side
        ([1.5, 4.5, 4, 7.5, 4.5, 4], 3.7, 0.5, MATTER),
        ([1.5, 4.5, 4, 7.5, 4.5, 4], 3.7, 0.2, ""),
        ([1.5, 3.5, 4, 9.5, 3.5, 4], 0.0, 0.5, OUTSIDE),
        ([1.5, 3.5, 4, 1.5, -0.5, 4], 0.0, 0.5, OUTSIDE),
    ],
)
def test_lines_through_walls_are_dangers(
    line: list[float], block: float, clearance: float, words: str
) -> None:
    """Through a block, beside it, over it within or outside the clearance, and off the map."""
    heights = np.zeros((9, 9))
    heights[4, 4] = block
    found = dangers(flown_lines(heights, line, clearance=clearance))
    assert [danger.words[: len(words)] for danger in found] == ([words] if words else [])


@pytest.mark.parametrize(("above", "is_near"), [(0.9, True), (1.1, False)])
def test_drones_may_be_above_each_other(above: float, is_near: bool) -> None:
    """Two that cross seen from above are apart by the height that the rules ask for."""
    one, other = [1.5, 4.5, 4, 5.5, 4.5, 4], [5.5, 4.5, 4 + above, 1.5, 4.5, 4 + above]
    flown = flown_lines(np.zeros((9, 9)), one, other, vertical=1.0)
    assert [danger.drones for danger in dangers(flown)] == [(0, 1)] * is_near


def test_straight_flights_are_what_the_referee_allows() -> None:
    """A plan that obeys the rules makes straight flights in which no danger is found."""
    for problem, plan, _ in flights():
        assert dangers(Trajectory.straight(problem, plan)) == []


def test_smooth_flights_pass_the_plan_without_jumps() -> None:
    """At each step drones are where the plan says; speed and acceleration are continuous."""
    for problem, plan, (flown, _, slowed, shortened) in flights():
        straight = Trajectory.straight(problem, plan)
        ends = flown.pieces[..., 0], flown.pieces[..., -1]
        np.testing.assert_array_equal(ends[0], straight.pieces[..., 0])
        for rates in (flown.velocities, flown.accelerations):
            np.testing.assert_allclose(rates[:, 1:, :, 0], rates[:, :-1, :, -1], atol=1e-8)
            assert np.abs(rates[:, [0, -1], :, [0, -1]]).max() < 1e-8  # at rest at both ends
        if not slowed + shortened:
            bends = np.diff(straight.velocities[:, :, :3, 0], axis=1) / flown.step
            np.testing.assert_allclose(flown.accelerations[:, 1:, :3, 0], bends, atol=1e-8)
        places, moved = sampled(flown), sampled(straight)
        apart = np.linalg.norm(places - moved, axis=-1).max()
        assert apart <= flown.distance_from(straight) <= apart + 1e-3
        # Cameras never look beyond the pitches of the steps on either side.
        pitch = flown.pieces[:, :, 4]
        low, high = pitch[..., [0, -1]].min(axis=-1), pitch[..., [0, -1]].max(axis=-1)
        assert ((low[..., None] - 1e-12 <= pitch) & (pitch <= high[..., None] + 1e-12)).all()


@pytest.mark.parametrize("every", [0.05, 0.3, 1.3])
def test_lines_between_rows_are_as_near_as_is_said(every: float) -> None:
    """No sample of a flight is farther from them than the bound, and some nearly as far."""
    for _, _, (flown, *_) in flights()[:2]:
        rows = np.append(np.arange(0.0, flown.seconds, every), flown.seconds)
        moments, places = np.linspace(0.0, flown.seconds, 1201), sampled(flown, 200)
        at = flown.at(rows).place.reshape(len(places), -1, 3)
        lines = np.array([[np.interp(moments, rows, axis) for axis in own.T] for own in at])
        most = np.linalg.norm(places - lines.swapaxes(1, 2), axis=-1).max()
        assert most <= flown.distance_from_chords(rows) <= 1.3 * most


def test_lines_between_the_steps_are_a_straight_flight() -> None:
    """The rows of a straight flight have nothing beside them."""
    problem, plan, _ = flights()[0]
    straight = Trajectory.straight(problem, plan)
    steps = np.arange(STEPS + 1) * straight.step
    assert straight.distance_from_chords(steps) < 1e-8


def test_demands_are_the_largest_of_all_samples() -> None:
    """Rates and accelerations of samples reach the stated ones, and never exceed them."""
    for _, _, (flown, *_) in flights()[:3]:
        count = STEPS * 1000
        places = sampled(flown, 1000)
        found = flown.at(np.linspace(0.0, flown.seconds, count + 1))
        pause = flown.seconds / count
        speeds = np.diff(places, axis=1) / pause
        yaw, pitch = (np.diff(row.reshape(len(places), -1)) / pause for row in found[3:])
        sampled_kinds = {
            "speed": np.hypot(speeds[..., 0], speeds[..., 1]),
            "climb": speeds[..., 2], "descent": -speeds[..., 2],
            "acceleration": np.linalg.norm(np.diff(speeds, axis=1), axis=-1) / pause,
            "yaw_rate": np.abs(yaw), "gimbal_rate": np.abs(pitch),
        }  # fmt: skip
        asked = Demand.all_of(flown, is_smooth=True)
        assert {(d.drone, d.kind) for d in asked} == set(
            product_of(range(len(places)), sampled_kinds)
        )
        for demand in asked:
            most = max(float(sampled_kinds[demand.kind][demand.drone].max()), 0.0)
            assert demand.most == pytest.approx(most, rel=2e-3, abs=2e-3)
        assert [demand.drone for demand in Demand.tightest(asked)] == list(range(len(flown.pieces)))


def test_a_step_that_would_do_does() -> None:
    """With so much longer steps a limit is kept, and with 1 % less it is not."""
    flown = flights()[0][2].trajectory
    found = Demand.all_of(flown, is_smooth=True)
    largest_ones = {d.kind: d for d in sorted(found, key=lambda d: d.most)}
    assert len(largest_ones) == 6
    for demand in largest_ones.values():
        limited = demand._replace(limit=demand.most / 3)
        assert not limited.is_kept
        for times, keeps in ((1 + 1e-6, True), (0.99, False)):
            step = flown.step * limited.slower * times
            slower = replace(flown, problem=flown.problem.replace(step=step))
            (own,) = (d for d in Demand.all_of(slower, True) if d[:2] == demand[:2])
            assert own._replace(limit=limited.limit).is_kept == keeps


def test_one_moment_a_step_is_the_plan() -> None:
    """Looked at at the steps only, straight and smooth flights have the view reward of the plan."""
    importance = tuple(float(1 + t) for t in range(STEPS + 1))
    for k, (problem, plan, made) in enumerate(flights()[:3]):
        (actor,) = problem.actors
        weighted = problem.replace(objective=Objective(over_time=True))
        if k:  # importance must not change where pixels add up over time
            weighted = problem.replace(actors=(actor.replace(importance=importance),))
        for one in (weighted, *(counted(weighted, least) for least in (0.1, 0.3, 0.9))):
            verdict = check(one, plan)
            expected = pytest.approx(verdict.reward - verdict.reward_moves, rel=1e-9)
            for flown in (made.trajectory, Trajectory.straight(problem, plan)):
                assert view_reward(replace(flown, problem=one), 1) == expected


def counted(problem: Problem, at_least: float, weight: float = 7.0) -> Problem:
    """The problem with drones that see people in its objective, the start included."""
    views = Views(cameras=2, weight=weight, at_least=at_least)
    return problem.replace(objective=problem.objective.replace(views=views, count_start=True))


@pytest.mark.parametrize(
    ("camera", "seen"),
    [
        (Camera(tilts=(0.4,), width=400, height=300, focal=150.0), [3, 2, 1, 0]),
        (Cone(opening=2.5), [3, 3, 3, 3]),
    ],
)
def test_people_are_counted_from_where_drones_are_flown(camera: AnyCamera, seen: list[int]) -> None:
    """In the middle of a move as if that were a step; who is half behind a tree may not count."""
    heights = np.zeros((7, 6))
    heights[3, 3] = 9.0  # 63 %, 52 % and 28 % of the person are visible from beside it
    robot = Robot(start=State(1, 0, heading=2), camera=camera, motion=Motion(layers=(3.0,), turn=0))
    fine = Problem(
        name="tree", height_map=HeightMap(heights=heights), horizon=2, step=0.5, robots=(robot,),
        actors=(Actor(poses=np.tile([3.0, 4.5, 0.0, 0.0], (3, 1))),), rules=NO_RULES,
    )  # fmt: skip
    faster = robot.replace(motion=robot.motion.replace(radius=2))
    coarse = fine.replace(horizon=1, step=1.0, robots=(faster,))
    path = tuple(State(x, 0, heading=2) for x in (1, 2, 3))
    for least, drones in zip((0.2, 0.5, 0.6, 0.9), seen, strict=True):
        verdict = check(counted(fine, least), Plan(paths=(path,)))
        assert sum(verdict.count_reward) == pytest.approx(7.0 * drones)
        expected = verdict.reward_at_start + sum(verdict.reward_per_step) / 2
        flown = Trajectory.straight(counted(coarse, least), Plan(paths=(path[::2],)))
        assert view_reward(flown, 2) == pytest.approx(expected, rel=1e-9)


def test_people_turn_the_short_way_round() -> None:
    """A yaw that is written with a turn more is the same, between the steps, too."""
    problem, _, made = flights()[0]
    (actor,) = problem.actors
    turned = actor.poses + 2 * np.pi * np.array([[0, 0, 0, t % 2] for t in range(STEPS + 1)])
    other = problem.replace(actors=(actor.replace(poses=turned),))
    found = [view_reward(replace(made.trajectory, problem=p), 5) for p in (problem, other)]
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    assert found[0] > 0


def test_drones_that_would_come_too_near_stop() -> None:
    """Two drones that turn towards each other at the separation pass more slowly, and keep it."""
    motion = Motion(radius=1, turn=0)
    problem = Problem(
        name="ties", height_map=HeightMap(heights=np.zeros((9, 9))), actors=(), horizon=4, step=1.0,
        robots=tuple(Robot(start=State(x, 0), motion=motion) for x in (2, 6)),
        rules=CollisionRules(separation=2.0),
    )  # fmt: skip
    one = [State(x, y) for x, y in ((2, 0), (3, 1), (3, 2), (3, 3), (2, 4))]
    plan = Plan(paths=(tuple(one), tuple(State(8 - s.x, s.y) for s in one)))
    made = Smooth.of(problem, plan)
    assert made.dangers == () and made.slowed > 0
    assert made.trajectory.least_distance() >= 2.0 - 1e-6
    free = Smooth.of(problem.replace(rules=CollisionRules()), plan)
    assert free.slowed == 0
    assert free.trajectory.least_distance() < 2.0


def test_drones_pass_people_as_far_as_the_plan() -> None:
    """A drone that turns at the minimum distance slows down where it would be nearer."""
    one = tuple(State(x, y) for x, y in ((2, 0), (3, 1), (3, 2), (3, 3), (2, 4)))
    person = Actor(poses=np.tile([5.5, 2.5, 0.0, 0.0], (5, 1)))
    problem = Problem(
        name="aside", height_map=HeightMap(heights=np.zeros((9, 9))), actors=(person,), horizon=4,
        robots=(Robot(start=one[0]),), step=1.0, airspace=Airspace(people_aside=2.0),
    )  # fmt: skip

    def least(made: Smooth) -> float:
        way = sampled(made.trajectory)[0, :, :2] - [5.5, 2.5]
        return float(np.hypot(*way.T).min())

    made = Smooth.of(problem, Plan(paths=(one,)))
    assert made.dangers == () and made.slowed > 0
    assert least(made) >= 2.0 - 1e-6
    assert least(Smooth.of(problem.replace(airspace=Airspace()), Plan(paths=(one,)))) < 1.999


def test_a_plan_with_a_little_to_spare_beside_people_has_a_smooth_flight() -> None:
    """Blends are shortened where somebody walks, as far as they must be, and all stays smooth."""
    shortened = 0
    for problem, plan, _ in flights():
        near = Nearest.of_people(Trajectory.straight(problem, plan))
        assert near is not None
        least = near.distance - spare(problem, problem.robots[0])
        if least < 0.1:
            continue
        problem = problem.replace(airspace=problem.airspace.replace(people_aside=least))
        flown, found, _, shorter = Smooth.of(problem, plan)
        assert found == ()
        places = sampled(flown, 20)
        assert not (too_near_matter(problem, places) | too_near_others(problem, places)).any()
        for rates in (flown.velocities, flown.accelerations):
            np.testing.assert_allclose(rates[:, 1:, :, 0], rates[:, :-1, :, -1], atol=1e-7)
        points = flown.at(np.arange(STEPS + 1) * flown.step).place
        expected = [problem.where(*own) for own in zip(problem.robots, plan.paths, strict=True)]
        np.testing.assert_allclose(points, np.concatenate(expected), atol=1e-8)
        shortened += shorter
    assert shortened > 1


@pytest.mark.parametrize("radius", [1, 2])
def test_the_longest_move_climbs_with_the_ground(radius: int) -> None:
    """To people a 40th of the longest of all moves between two places is to spare."""
    ground = np.random.default_rng(radius).uniform(0.0, 6.0, (5, 4))
    motion = Motion(radius=radius, layers=(4.0, 5.0, 7.0))
    robot = Robot(start=State(1, 1), motion=motion)
    problem = Problem(
        name="hill", height_map=HeightMap(heights=ground, datum=ground, resolution=1.5),
        robots=(robot,), actors=(), horizon=1, step=1.0,
    )  # fmt: skip
    states = [State(x, y, k) for x in range(5) for y in range(4) for k in range(3)]
    places = problem.where(robot, tuple(states))
    longest = max(
        np.linalg.norm(places[m] - places[n])
        for m, a in enumerate(states)
        for n, b in enumerate(states)
        if (b.layer - a.layer, b.x - a.x, b.y - a.y) in motion.moves
    )
    level = problem.replace(height_map=HeightMap(heights=np.zeros((5, 4)), resolution=1.5))
    share = spare(level, robot) / longest_move(level, motion)
    assert spare(problem, robot) == pytest.approx(share * longest, rel=1e-9)


def test_a_turn_beside_somebody_is_made_where_nobody_is_near() -> None:
    """A drone flies at the pace of somebody at the minimum distance, and turns before and after."""
    one = tuple(State(x, y) for x, y in ((0, 4), (1, 3), (2, 2), (3, 2), (4, 2), (5, 3)))
    walk = np.array([[0.5 + t, 0.5, 0.0, 0.0] for t in range(6)])
    problem = Problem(
        name="pace", height_map=HeightMap(heights=np.zeros((9, 9))), actors=(Actor(poses=walk),),
        robots=(Robot(start=one[0]),), horizon=5, step=1.0, airspace=Airspace(people_aside=2.0),
    )  # fmt: skip
    flown, found, slowed, shortened = Smooth.of(problem, Plan(paths=(one,)))
    assert found == () and slowed == 0 and shortened == 2
    straight = Trajectory.straight(problem, Plan(paths=(one,)))
    np.testing.assert_allclose(flown.pieces[0, 2:4], straight.pieces[0, 2:4], atol=1e-12)
    assert flown.distance_from(straight) > 0.05
    free = Smooth.of(problem.replace(airspace=Airspace()), Plan(paths=(one,)))
    assert free.shortened == 0


@pytest.mark.slow
def test_flights_in_more_pieces_are_the_same() -> None:
    """Nothing that is told of a flight depends on the number of pieces that its steps have."""

    def told(flown: Trajectory) -> list[float]:
        near, late = Nearest.of_people(flown), Robustness(flown).with_laggard(0.7 * flown.step)
        assert near is not None
        return [
            flown.seconds, flown.least_distance(), near.distance, near.t, late.apart, late.aside,
            *(demand.most for demand in Demand.all_of(flown, is_smooth=True)),
            flown.distance_from_chords(np.arange(0.0, flown.seconds, 0.3)),
            bearable_delay(flown, CollisionRules(separation=0.2)),
        ]  # fmt: skip

    for problem, plan, made in flights()[:3]:
        flown, straight = made.trajectory, Trajectory.straight(problem, plan)
        cut = flown.with_pieces(split(flown.pieces, 4))
        assert cut.parts == 4 * flown.parts
        np.testing.assert_allclose(sampled(cut, 7), sampled(flown, 7), atol=1e-9)
        assert cut.distance_from(straight) == pytest.approx(flown.distance_from(straight))
        assert told(cut) == pytest.approx(told(flown), rel=1e-3, abs=3e-3)
        broken = [{danger[:3] for danger in dangers(one)} for one in (cut, flown)]
        assert broken[0] == broken[1]


def test_polynomials_are_enclosed() -> None:
    """Products, values, largest values and positivity agree with samples."""
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 40, 6))
    shares = np.linspace(0, 1, 501)
    grids = [np.array([values(np.tile(row, (501, 1)), shares) for row in part])
             for part in (one, other, product(one, other), elevated(one, 9))]  # fmt: skip
    np.testing.assert_allclose(grids[2], grids[0] * grids[1], atol=1e-12)
    np.testing.assert_allclose(grids[3], grids[0], atol=1e-12)
    assert grids[0].max() <= Peak.of(one).value <= grids[0].max() + 1e-4
    both = ((grids[0] > 1e-3) & (grids[1] > 1e-3)).any(axis=1)
    never = ~((grids[0] > -1e-3) & (grids[1] > -1e-3)).any(axis=1)
    found = ever_positive([one, other])
    assert found[both].all() and not found[never].any()
    assert both.any() and never.any()


def test_polynomials_that_touch_count_as_positive() -> None:
    """Two that are 0 at a third, where no halving ends, cannot be proved never to be positive."""
    touching = [elevated(np.array([[-1.0, 2.0]]), 5), elevated(np.array([[1.0, -2.0]]), 5)]
    assert ever_positive(touching).all()
    assert not ever_positive([touching[0], touching[1] - 0.1]).any()


def test_cameras_turn_no_farther_than_the_plan() -> None:
    """Between rates of 10, 1 and 10 tilts a step, no pitch is beyond those at the steps."""
    camera = Camera(tilts=tuple(0.05 * k for k in range(22)), width=400, height=300, focal=150.0)
    motion = Motion(pitch_turn=10, turn=0)
    robot = Robot(start=State(1, 1, pitch=0), motion=motion, camera=camera)
    problem = Problem(
        name="tilts", height_map=HeightMap(heights=np.zeros((3, 3))), actors=(), horizon=3,
        robots=(robot,), step=1.0,
    )  # fmt: skip
    path = tuple(robot.start._replace(pitch=k) for k in (0, 10, 11, 21))
    pitch = Smooth.of(problem, Plan(paths=(path,))).trajectory.pieces[0, :, 4]
    assert (np.diff(pitch, axis=1) <= 1e-12).all()


LIMITED = {
    "speed": ("motion.radius", "use a step of 1.5 s"),
    "climb": ("motion.climb", "a step of 1 s"),
    "yaw_rate": ("motion.turn", "a step of 0.524 s"),
    "gimbal_rate": ("motion.pitch_turn", "a step of 0.5 s"),
}


@pytest.mark.parametrize("kind", LIMITED)
def test_moves_that_a_step_does_not_allow_are_refused(kind: str) -> None:
    """The message names the field, and a duration with which the scene is accepted."""
    limits = {"speed": 2 * 2**0.5, "climb": 2.0, "yaw_rate": 1.5, "gimbal_rate": 1.0}
    motion = Motion(radius=2, layers=(4.0, 6.0))
    field, words = LIMITED[kind]
    robot = Robot(start=State(1, 1), motion=motion, camera=Camera(tilts=(0.2, 0.7)),
                  limits=Limits(**{kind: limits[kind]}))  # fmt: skip
    scene = {"name": "fast", "height_map": HeightMap(heights=np.zeros((9, 9)), resolution=1.5),
             "robots": (robot,), "actors": (), "horizon": 2}  # fmt: skip
    with pytest.raises(ProblemError, match=rf"^robots\[0\]\.{field}: .*{words}"):
        Problem(**scene, step=0.4)
    Problem(**scene)
    Problem(**scene, step=1.5)
    with pytest.raises(ProblemError, match="a radius of 1"):
        Problem(**scene | {"robots": (robot.replace(limits=Limits(speed=3.0)),)}, step=1.0)


@pytest.mark.parametrize("motion", [Motion(), Motion(radius=0, layers=(4.0, 5.0, 7.0))])
def test_a_shortest_move_that_takes_long_from_rest_is_doubted(motion: Motion) -> None:
    """Half the acceleration times the squared step is 1 m at 1.25 s."""
    robot = Robot(start=State(1, 1), motion=motion, limits=Limits(acceleration=1.28))
    problem = Problem(
        name="heavy", height_map=HeightMap(heights=np.zeros((3, 3))), robots=(robot,), actors=(),
        horizon=2, step=1.249,
    )  # fmt: skip
    (words,) = strains(problem)
    assert words.startswith("drone 0 cannot move from rest within a step: the shortest move, 1 m")
    assert "m/s2; may exceed limits" in words
    still = robot.replace(motion=motion.replace(radius=0, layers=(4.0,)))
    for other in (problem.replace(step=1.25), problem.replace(robots=(still,), step=0.01)):
        assert not any("the shortest" in words for words in strains(other))


def test_a_run_up_makes_moves_that_none_can_make_from_rest() -> None:
    """A drone that stays for a step goes back and comes forth, in less than 2 m/s2."""
    path = tuple(State(x, 1) for x in (1, 1, 2, 3, 4, 4))
    robot = Robot(start=path[0], limits=Limits(acceleration=1.8))
    problem = Problem(
        name="run-up", height_map=HeightMap(heights=np.zeros((6, 3))), robots=(robot,), actors=(),
        horizon=5, step=1.0,
    )  # fmt: skip
    assert any("the shortest" in words for words in strains(problem))
    for way, kept in ((path, True), ((*path[1:], path[-1]), False)):
        asked = Demand.all_of(Smooth.of(problem, Plan(paths=(way,))).trajectory, True)
        assert all(one.is_kept for one in asked) == kept


def test_drones_that_may_be_refused_smooth_flights_are_told_once() -> None:
    """From rest to rest the longest move asks for 5.77 times its length by the squared step."""
    limits = Limits(acceleration=10 / 3**0.5 * 2**0.5)
    robots = tuple(Robot(start=State(x, 1), limits=limits) for x in (1, 2))
    problem = Problem(
        name="doubted", height_map=HeightMap(heights=np.zeros((9, 9))), robots=robots, actors=(),
        horizon=2, step=0.99,
    )  # fmt: skip
    (words,) = strains(problem)
    assert words.startswith(
        "drones 0 and 1 may exceed limits in smooth flights: up to acceleration"
    )
    assert "; steps of 1 s suffice for all" in words
    assert not strains(problem.replace(step=1.0)) and not strains(problem.replace(step=None))


def test_steep_ground_is_named_as_the_cause_of_a_climb_limit() -> None:
    """Where layers follow the ground and it alone is too steep, level layers are the way out."""
    ground = np.add.outer(2.0 * np.arange(9), np.zeros(9))
    robot = Robot(start=State(1, 1), motion=Motion(layers=(9.0, 10.0)),
                  limits=Limits(climb=2.0, descent=2.0))  # fmt: skip
    hill = HeightMap(heights=ground, datum=ground)
    problem = Problem(
        name="hill", height_map=hill, robots=(robot,), actors=(), horizon=2, step=1.0
    )  # fmt: skip
    (words,) = strains(problem)
    assert "the cause is the ground: layers above it rise or fall with it, by up to 2 m" in words
    assert 'flight = "above-sea" in a recipe makes them level' in words
    assert "layers at most" not in words  # nearer ones would be of no use
    assert "may exceed limits even in straight flights; in smooth ones up to climb" in words
    level = problem.replace(height_map=HeightMap(heights=ground))
    assert not strains(level)
    far = robot.replace(motion=Motion(layers=(9.0, 10.9)))
    (words,) = strains(level.replace(robots=(far,)))
    assert "layers at most 1.06 m apart" in words and "ground" not in words


def test_smooth_flights_of_any_plan_keep_limits_with_steps_that_suffice() -> None:
    """Drones that dart to and fro, up and down, are as fast as can be; no plan asks for more."""
    rng, motion = np.random.default_rng(1), Motion(layers=(4.0, 7.0))
    limits = Limits(speed=2.0, climb=2.0, descent=1.0, acceleration=3.0, yaw_rate=1.0)
    paths = rng.integers(0, 2, size=(20, 9, 3))
    robots = tuple(Robot(start=State(*path[0]), motion=motion, limits=limits)
                   for path in paths.tolist())  # fmt: skip
    problem = Problem(name="darting", height_map=HeightMap(heights=np.zeros((2, 2))),
                      robots=robots, actors=(), horizon=8, step=9.0, rules=NO_RULES)  # fmt: skip
    plan = Plan(paths=tuple(tuple(State(*at) for at in path) for path in paths.tolist()))
    step = sufficient_step(problem, True)
    assert step == 5.63  # of 3 m downwards
    made = Smooth.of(problem.replace(step=step), plan)
    assert not made.shortened
    found = Demand.all_of(made.trajectory, True)
    assert all(one.is_kept for one in found) and max(one.share for one in found) > 0.9
    assert sufficient_step(problem, True, shortened=True) == 8.82


@pytest.mark.slow
def test_shortened_blends_are_no_faster_than_said() -> None:
    """Whatever blends come of mending, rates are at most 2.94 times those of the longest move."""
    rng = np.random.default_rng(2)
    moves = rng.choice([-1.0, 1.0], size=(3000, 6, 1)) * np.ones(5)
    points = np.concatenate([np.zeros((3000, 1, 5)), np.cumsum(moves, axis=1)], axis=1)
    shape = points.shape[:2]
    shares = rng.choice([0.0, 0.25, 0.5, 1.0], size=shape)
    shares[:, [0, -1]] = 0.0
    sides = np.where(shares < 1, 0, rng.choice([-1, 0, 1], size=shape))
    cuts = rng.choice([1, 2, 4, 8], size=shape)
    blends = _Blends(shares, cuts, sides, *np.ones((2, *shape), dtype=np.bool_))
    rates = derivative(blends.pieces(points)) * cuts.max()
    assert 2.75 < Peak.of(rates[:, :, 0].reshape(-1, rates.shape[-1])).value <= SHORTENED
