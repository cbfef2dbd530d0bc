"""The two baselines: formation and planning one step ahead."""

import math
from itertools import chain, pairwise, product

import numpy as np
import pytest
from brute_force import (
    all_paths,
    bonus_of_move,
    objective_from_scratch,
    optimum,
    pixels_of,
    views_of,
)
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import WALL, Calls, examples, standing, tiny

from cocap_opt.coordination.low_level import SingleRobotTask
from cocap_opt.graph.networks import time_expanded_graph
from cocap_opt.model import Model, compiled
from cocap_opt.planners import PLANNERS, Planner
from cocap_opt.planners.formation import (
    STANDOFF,
    Circle,
    _distance_in_view,
    _flown,
    _nearest,
    formation,
)
from cocap_opt.planners.greedy import myopic
from cocap_opt.planners.one_step import one_step
from cocap_opt.problem import Actor, Airspace, Camera, Cone, Motion, Plan, Problem, Robot, State
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.stop import Limit, TimeLimit, never
from cocap_opt.world.workspace import HeightMap

NEIGHBOURS = Motion()
BOTH = [formation, one_step]
CAMERA = Camera(width=1000, height=2000, focal=1000.0, tilts=(0.7,))


def field(
    *robots: State, actors: tuple[Actor, ...] = (), horizon: int = 12, motion: Motion = NEIGHBOURS
) -> Problem:
    """Open field of 24 x 24 m, robots with cameras that must look at what they film."""
    return Problem(
        name="field",
        height_map=HeightMap(heights=np.zeros((24, 24))),
        robots=tuple(Robot(start=start, motion=motion, camera=CAMERA) for start in robots),
        actors=actors,
        horizon=horizon,
    )


def line(length: int, *starts: int, goals: tuple[int, ...], horizon: int) -> Problem:
    """Robots of one heading on a line of cells; nobody to see."""
    motion = Motion(headings=1)
    robots = tuple(
        Robot(start=State(x, 0), motion=motion, goal=(goal, 0))
        for x, goal in zip(starts, goals, strict=True)
    )
    grid = HeightMap(heights=np.zeros((length, 1)))
    return Problem(name="", height_map=grid, robots=robots, actors=(), horizon=horizon)


def metres(problem: Problem, robot: int, path: tuple[State, ...]) -> np.ndarray:
    """Places [T+1, 3] along a path: x, y and altitude in m."""
    layers = problem.robots[robot].motion.layers
    centres = [problem.height_map.centre(s.x, s.y) for s in path]
    return np.array(
        [aloft(problem, x, y, layers[s.layer]) for s, (x, y) in zip(path, centres, strict=True)]
    )


def aloft(problem: Problem, x: float, y: float, height: float) -> tuple[float, float, float]:
    """A point at a flight height; the ground off the map is that at its edge."""
    datum, size = problem.height_map.datum, problem.height_map.resolution
    if datum is None:
        return x, y, height
    i, j = (int(min(max(at // size, 0), n - 1)) for at, n in zip((x, y), datum.shape, strict=True))
    return x, y, height + datum[i, j]


# -- both ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("planner", BOTH)
@examples(12)
@given(problem=st.one_of(problems(over_time=True), meetings(), meetings(team=3)))
def test_plans_are_legal_and_never_above_the_optimum(planner: Planner, problem: Problem) -> None:
    """What is planned can be flown, obeys the rules and is worth what it says; no more than J*.

    Only goals can leave them without a plan, and "infeasible" is said only where there is none.
    """
    best, result = optimum(problem), planner(problem, never)
    assert result.limit is None and result.bound == math.inf
    if result.plan is None:
        assert result.reason in (Reason.FAILED, Reason.INFEASIBLE)
        assert result.reason is Reason.FAILED or best.plan is None
        assert any(robot.goal is not None for robot in problem.robots)
        return
    verdict = check(problem, result.plan)
    assert result.reason is Reason.FINISHED and verdict.valid
    assert result.value == pytest.approx(verdict.reward, rel=1e-9, abs=1e-9)
    assert result.value <= best.value + 1e-9 * max(1.0, best.value)


@pytest.mark.parametrize("planner", BOTH)
@examples(12)
@given(problem=problems(goals=False), calls=st.integers(0, 12))
def test_stopped_at_any_moment_there_is_a_plan(
    planner: Planner, problem: Problem, calls: int
) -> None:
    """Without goals a limit leaves a plan that obeys the rules: who has not moved stays."""
    stop = Calls(calls)
    result = planner(problem, stop)
    assert result.plan is not None
    assert check(problem, result.plan).valid
    assert (result.reason is Reason.STOPPED) == (stop.asked > calls)
    if calls == 0:
        assert all(len(set(path)) == 1 for path in result.plan.paths)


@pytest.mark.parametrize("planner", BOTH)
def test_only_views_are_evaluated_that_are_looked_at(
    planner: Planner,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The coverage of all states is never asked for; how much is, is said."""

    def prepared(*_: object) -> None:
        raise AssertionError("the coverage of all states")

    monkeypatch.setattr(Model, "prepare", prepared)
    actor = standing(13.2, 12.1, 0.0, 0.4, steps=12)
    problem = field(State(2, 2), State(20, 3), actors=(actor,))
    (robot_class,) = compiled(problem).classes
    reachable = np.count_nonzero(compiled(problem).reachable(robot_class))
    evaluated = planner(problem, never).statistics["evaluated"]
    assert 0 < evaluated < reachable / 10


@pytest.mark.parametrize("planner", BOTH)
def test_with_nobody_to_see_all_stay(planner: Planner) -> None:
    """Nothing is moved for nothing."""
    starts = State(2, 2, heading=3), State(20, 3, heading=1)
    assert planner(field(*starts), never).plan == Plan(paths=tuple((s,) * 13 for s in starts))


@pytest.mark.parametrize("planner", BOTH)
def test_goals_are_reached_or_missed_in_words(planner: Planner) -> None:
    """Who must go somewhere goes there; two who must pass on a line fail, which proves nothing."""
    plan = planner(line(6, 1, 3, goals=(0, 5), horizon=2), never).plan
    assert plan is not None
    assert [path[-1].x for path in plan.paths] == [0, 5]
    failed = planner(line(3, 0, 2, goals=(2, 0), horizon=4), never)
    assert (failed.plan, failed.reason, failed.value) == (None, Reason.FAILED, -math.inf)
    assert "drone" in failed.message and "failed_robot" in failed.statistics
    stopped = planner(line(6, 1, 3, goals=(0, 5), horizon=2), Calls(0))
    assert (stopped.plan, stopped.reason, stopped.limit) == (None, Reason.STOPPED, Limit.TIME)


# -- one step -----------------------------------------------------------------------------


def open_states(
    problem: Problem, paths: tuple[tuple[State, ...], ...], heads: list[State], robot: int, t: int
) -> list[State]:
    """Those of the states for step t+1 that obey the rules, as written."""
    here = problem.cell(robot, paths[robot][t])

    def clashes(head: State, other: int) -> bool:
        before = problem.cell(other, paths[other][t])
        after = problem.cell(other, paths[other][t + 1]) if other < robot else before
        there = problem.cell(robot, head)
        swaps = (there, here) == (before, after) and there != here
        return problem.too_close(there, after) or (problem.rules.swap and swaps)

    others = [other for other in range(len(paths)) if other != robot]
    return [head for head in heads if not any(clashes(head, other) for other in others)]


@examples(12)
@given(st.one_of(problems(over_time=True), meetings(), meetings(team=3)))
def test_one_step_takes_the_best_of_the_next_step(problem: Problem) -> None:
    """Each robot in turn: no state that it could go to adds more to J, by trying all.

    Of equally good ones it takes its own if that is among them.
    """
    plan = one_step(problem).plan
    assume(plan is not None and problem.actors)
    assert plan is not None
    seen = np.zeros((problem.horizon + 1, len(problem.face_weights)))  # by all so far
    for robot, path in enumerate(plan.paths):
        seen[0] += pixels_of(problem, robot, [path])[0, 0]
    # They hold only what lies on a way to the goal.
    graphs = [time_expanded_graph(problem, robot) for robot in range(len(plan.paths))]
    for t, robot in product(range(problem.horizon), range(len(plan.paths))):
        path = plan.paths[robot]
        gains, tail = [], path[t]
        heads = [head for head, _ in graphs[robot][tail, t]]
        heads = open_states(problem, plan.paths, heads, robot, t)
        rest = problem.horizon - t - 1
        pixels = pixels_of(problem, robot, [(tail,) * (t + 1) + (h,) * (rest + 1) for h in heads])
        for head, own in zip(heads, pixels, strict=True):
            after = seen.copy()
            after[t + 1] += own[t + 1]
            view = views_of(problem, after[None])[0] - views_of(problem, seen[None])[0]
            gains.append(view + bonus_of_move(problem, tail, head))
        assert path[t + 1] in heads
        gain = gains[heads.index(path[t + 1])]
        assert gain >= max(gains) - 1e-9 * max(1.0, abs(max(gains)))
        if tail in heads and gains[heads.index(tail)] == max(gains) == gain == 0.0:
            assert path[t + 1] == tail
        seen[t + 1] += pixels[heads.index(path[t + 1]), t + 1]


def test_one_step_sees_one_step_ahead_only() -> None:
    """What cannot be seen after one step is not looked for."""
    actor = standing(12.5, 12.5, 0.0, 0.4, steps=6)
    for heading, sees in ((4, False), (1, True)):
        problem = field(State(6, 7, heading=heading), actors=(actor,), horizon=6)
        narrow = Camera(width=400, height=4000, focal=500.0, tilts=(0.5,))
        problem = problem.replace(robots=(problem.robots[0].replace(camera=narrow),))
        result = one_step(problem)
        assert (result.value > 0) == sees
        assert PLANNERS["sequential"](problem).value > result.value
        assert sees or result.plan == Plan(paths=((problem.robots[0].start,) * 7,))


def test_nobody_moves_to_where_a_later_robot_still_is() -> None:
    """Robots in a row go one by one: the first can follow the second a step later only."""
    camera = Camera(width=400, height=400, focal=100.0, tilts=(math.pi / 2,))
    problem = Problem(
        name="row",
        height_map=HeightMap(heights=np.zeros((5, 1)), resolution=2.0),
        robots=tuple(
            Robot(start=State(x, 0), motion=Motion(headings=1), camera=camera) for x in (0, 1)
        ),
        actors=(standing(9.2, 1.1, 0.0, 0.1, steps=2),),
        horizon=2,
    )
    plan = one_step(problem).plan
    assert plan is not None
    assert [s.x for s in plan.paths[0]] == [0, 0, 1]
    assert plan.paths[1][1].x == 2


# -- formation ----------------------------------------------------------------------------


@pytest.mark.parametrize("robots", [1, 2, 3, 4, 5])
def test_robots_take_evenly_spaced_places_and_look_at_the_actor(robots: int) -> None:
    """In an open field, around somebody who stands: half a cell's diagonal off at most."""
    actor, slack = standing(12.3, 11.6, 0.0, 0.4, steps=12), math.sqrt(0.5) + 1e-9
    starts = [State(2 + 2 * i, 3 + 4 * (i % 2)) for i in range(robots)]
    problem = field(*starts, actors=(actor,))
    plan = formation(problem).plan
    assert plan is not None
    ways = np.array([metres(problem, i, p)[-1, :2] for i, p in enumerate(plan.paths)])
    ways -= actor.poses[0, :2]
    assert np.abs(np.hypot(*ways.T) - STANDOFF).max() <= slack
    bearings = np.sort(np.arctan2(ways[:, 1], ways[:, 0]))
    spaces = np.diff([*bearings, bearings[0] + math.tau])
    assert np.abs(spaces - math.tau / robots).max() <= 2 * math.asin(slack / STANDOFF)
    looks = np.array([path[-1].heading for path in plan.paths]) * math.tau / 8
    off = looks - np.arctan2(-ways[:, 1], -ways[:, 0])
    assert np.abs((off + math.pi) % math.tau - math.pi).max() <= CAMERA.half_angle + 1e-9


def test_a_circle_turns_to_what_counts() -> None:
    """Where only somebody's face counts, the robot goes in front, not to the nearest place."""
    weights = (1.0, 0.0, 0.0, 0.0, 0.0)
    actor = standing(12.5, 12.5, 0.0, 0.0, steps=20).replace(weights=weights)
    problem = field(State(4, 12), actors=(actor,), horizon=20)
    plan = formation(problem).plan
    assert plan is not None
    x, y, _ = metres(problem, 0, plan.paths[0])[-1]
    assert x > 15 and abs(y - 12.5) < x - 12.5


def test_a_formation_moves_with_its_actors() -> None:
    """Once it is there, it keeps its places around people who walk more slowly than it flies."""
    poses = np.array([[8.3 + 0.6 * t, 12.2, 0.0, 0.0] for t in range(17)])
    starts = State(4, 10), State(4, 13), State(8, 6)
    problem = field(*starts, actors=(Actor(poses=poses),), horizon=16)
    plan = formation(problem).plan
    assert plan is not None
    for robot, path in enumerate(plan.paths):
        far = np.linalg.norm(metres(problem, robot, path)[:, :2] - poses[:, :2], axis=1)
        assert np.abs(far[11:] - STANDOFF).max() < 1


def test_a_circle_is_wider_by_its_outermost_actor() -> None:
    """One robot for three people flies around their middle, clear of all of them."""
    people = [standing(x, 12.0, 0.0, 0.3, steps=3) for x in (10.0, 12.0, 14.0)]
    problem = field(State(12, 4), actors=tuple(people), horizon=3)
    (circle,) = Circle.share_out(problem, STANDOFF, 5.0, 8)
    far = np.linalg.norm(circle.at[0] - [12.0, 12.0], axis=-1)
    assert far == pytest.approx(np.full((4, 8), 2.0 + STANDOFF))


@examples(20)
@given(problems(goals=False))
def test_robots_and_people_are_shared_out_evenly(problem: Problem) -> None:
    """Everybody is on one circle, and no circle has two more than another."""
    found = Circle.share_out(problem, STANDOFF, 5.0, 1)
    assert len(found) == min(len(problem.robots), len(problem.actors))
    if found:
        robots = [sorted(circle.robots) for circle in found]
        actors = [sorted(circle.actors) for circle in found]
        assert sorted(chain(*robots)) == list(range(len(problem.robots)))
        assert [*chain(*actors)] == list(range(len(problem.actors)))
        for parts in (robots, actors):
            assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_robots_go_to_the_circles_that_they_start_at() -> None:
    """Who films whom is not a matter of numbers: nobody crosses the field."""
    people = standing(5.0, 12.0, 0.0, 0.0, steps=12), standing(19.0, 12.0, 0.0, 0.0, steps=12)
    problem = field(State(20, 3), State(3, 20), State(20, 20), State(3, 3), actors=people)
    circles = Circle.share_out(problem, STANDOFF, 5.0, 1)
    assert [sorted(circle.robots) for circle in circles] == [[1, 3], [0, 2]]


@examples(100)
@given(st.floats(0.1, 50.0), st.floats(0.5, 20.0), st.floats(-0.5, 1.5), st.sampled_from([50, 300]))
def test_the_distance_is_the_nearest_at_which_the_image_holds_it(
    above: float, wanted: float, tilt: float, height: int
) -> None:
    """What is so far below is in the image, and would not be at any distance closer to ours."""
    camera = Camera(width=400, height=height, focal=200.0, tilts=(tilt,))
    robot = tiny().robots[0].replace(camera=camera)
    half = math.atan(height / 2 / 200.0)
    assume(tilt + half > 0.05)
    found = _distance_in_view(robot, above, wanted)
    off = abs(math.atan2(above, found) - tilt) - half
    assert off <= 1e-9
    assert found == wanted or off >= -1e-9
    assert _distance_in_view(robot.replace(camera=Cone()), above, wanted) == wanted


@examples(8)
@given(problems(robots=[1]))
def test_one_robot_is_as_near_to_its_place_as_can_be(problem: Problem) -> None:
    """Of all paths none is nearer in all; of those through the same cells none has a greater J."""
    assume(problem.actors)
    plan = formation(problem, orientations=1).plan
    paths = all_paths(problem, 0)
    assert (plan is None) == (not paths)
    if plan is None:
        return
    circle = Circle.share_out(problem, STANDOFF, 5.0, 1)[0]
    target = np.array([aloft(problem, x, y, circle.height[0]) for x, y in circle.at[0, :, 0]])

    def far(path: tuple[State, ...]) -> float:
        return float(np.linalg.norm(metres(problem, 0, path) - target, axis=1).sum())

    assert far(plan.paths[0]) == pytest.approx(min(map(far, paths)))
    cells = [s[:3] for s in plan.paths[0]]
    alike = [path for path in paths if [s[:3] for s in path] == cells]
    best = max(objective_from_scratch(problem, Plan(paths=(path,))) for path in alike)
    assert objective_from_scratch(problem, plan) == pytest.approx(best)


@examples(40)
@given(st.integers(0, 10**6), st.integers(1, 4), st.integers(1, 3))
def test_circles_turn_as_well_as_robots_can_follow(seed: int, horizon: int, robots: int) -> None:
    """By trying all: the greatest reward of all turns that nobody is too slow for."""
    rng, turns = np.random.default_rng(seed), 4
    problem = field(*(State(3 * i, 2) for i in range(robots)), horizon=horizon)
    at = rng.uniform(10, 11.6, (robots, horizon + 1, turns, 2)).cumsum(axis=2)
    rewards = rng.choice([0.0, 1.0, 2.5], (horizon + 1, turns))
    middle, heights = np.zeros((horizon + 1, 2)), ((5.0,) * robots, (4.0,) * robots)
    circle = Circle(tuple(range(robots)), (0,), middle, at, *heights)

    def is_flown(way: tuple[int, ...]) -> bool:
        for t, (a, b) in enumerate(pairwise(way)):
            far = np.abs(at[:, t + 1, b] - at[:, t, a]).max(axis=1)
            unturned = np.abs(at[:, t + 1, a] - at[:, t, a]).max(axis=1)
            if (far > np.maximum(1.0, unturned)).any():
                return False
        return True

    ways = [way for way in product(range(turns), repeat=horizon + 1) if is_flown(way)]
    found = tuple(circle.best_turns(problem, rewards).tolist())
    assert found in ways

    def total(way: tuple[int, ...]) -> float:
        return float(sum(rewards[t, k] for t, k in enumerate(way)))

    assert total(found) == pytest.approx(max(map(total, ways)))


def test_a_formation_flies_around_walls() -> None:
    """A place behind or in a wall is approached, not flown through; the referee agrees."""
    heights = np.zeros((24, 24))
    heights[8:16, 14:17] = WALL
    problem = field(State(11, 20), State(3, 3), actors=(standing(12.2, 11.8, 0.0, 0.0, steps=12),))
    problem = problem.replace(height_map=HeightMap(heights=heights))
    plan = formation(problem).plan
    assert plan is not None and check(problem, plan).valid


def test_heights_are_those_that_can_be_flown() -> None:
    """A robot climbs to the layer nearest to the wanted height."""
    motion, person = Motion(layers=(2.0, 4.5, 9.0)), standing(12.2, 11.8, 0.0, 0.0, steps=12)
    problem = field(State(6, 6, layer=2), actors=(person,), motion=motion)
    for height, layer in ((5.0, 1), (1.0, 0), (30.0, 2)):
        plan = formation(problem, height=height).plan
        assert plan is not None
        assert plan.paths[0][-1].layer == layer


@pytest.mark.parametrize("lower", [0, 2])
def test_nearness_to_a_place_counts_the_ground_below(lower: int) -> None:
    """Of two cells beside a place that is blocked, the one at its altitude is nearer."""
    datum, walls = np.zeros((3, 3)), np.zeros((3, 3))
    datum[lower], walls[1, 1:] = -3.0, WALL
    motion = Motion(headings=1, corner_cutting=True)
    problem = Problem(
        name="slope", height_map=HeightMap(heights=datum + walls, datum=datum), actors=(),
        robots=(Robot(start=State(1, 0), motion=motion),), horizon=3,
    )  # fmt: skip
    places = _flown(problem.height_map, np.array([[1.5, 2.5]] * 4), motion.layers[0])
    task = SingleRobotTask(compiled(problem), 0, problem.no_pixels())
    path = _nearest(task, places)
    assert path is not None
    end = task.model.plan([path]).paths[0][-1]
    assert (end.x, end.y) == (2 - lower, 2)


# -- myopic ---------------------------------------------------------------------------------


@examples(15)
@given(problems())
def test_myopic_robots_do_not_look_at_one_another(problem: Problem) -> None:
    """Each flies what it would fly alone, whoever else is there."""
    together = myopic(problem).plan
    for robot, spec in enumerate(problem.robots):
        alone = myopic(problem.replace(robots=(spec,))).plan
        if together is not None and alone is not None:
            assert together.paths[robot] == alone.paths[0]


def beside_a_walker(
    size: tuple[int, int], poses: list[tuple[float, float]], start: tuple[int, int], aside: float
) -> Problem:
    """One drone that looks down, and one person to whom it keeps a distance."""
    camera = Camera(width=500, height=400, focal=100.0, tilts=(1.5,))
    robot = Robot(start=State(*start), motion=Motion(headings=1), camera=camera)
    rows = np.array([(x, y, 0.0, 0.0) for x, y in poses])
    return Problem(
        name="", height_map=HeightMap(heights=np.zeros(size)), robots=(robot,),
        actors=(Actor(poses=rows),), horizon=len(poses) - 1, airspace=Airspace(people_aside=aside),
    )  # fmt: skip


def test_one_step_at_a_time_people_are_where_they_are_then() -> None:
    """What people close at step 0 is open later, and a drone that is left behind has no plan."""
    problem = beside_a_walker((3, 1), [(1.5, 0.9), (3, 3.9), (3, 3.9)], (2, 0), 0.6)
    plan = one_step(problem).plan
    assert plan is not None and check(problem, plan).valid
    problem = beside_a_walker((7, 3), [(0.5 + 1.5 * t, 1.5) for t in range(5)], (3, 1), 0.9)
    result = one_step(problem, TimeLimit(0))
    assert (result.plan, result.reason) == (None, Reason.STOPPED)
