"""The referee: it finds what is broken, and agrees with the planners' own view of conflicts."""

import math
import re
from collections import Counter
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from brute_force import objective_from_scratch
from hypothesis import given
from hypothesis import strategies as st
from strategies import WALL, examples, tiny

from cocap_opt.model import compiled
from cocap_opt.planners.greedy import greedy
from cocap_opt.problem import (
    NO_RULES,
    VERTEX_ONLY,
    Actor,
    Airspace,
    Camera,
    Cell,
    CollisionRules,
    Conflict,
    Motion,
    Objective,
    Plan,
    Problem,
    Robot,
    State,
    SwapConflict,
    VertexConflict,
)
from cocap_opt.problem.rules import TOLERANCE
from cocap_opt.referee import Verdict, _Referee, check
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.world.workspace import HeightMap, Mesh

HEADINGS = 8


def arena(
    *starts: State,
    horizon: int = 2,
    rules: CollisionRules = CollisionRules(),
    resolution: float = 1.0,
    goal: tuple[int, int] | None = None,
    motion: Motion = Motion(),
    tilts: tuple[float, ...] = (0.1, 0.2, 0.3),
) -> Problem:
    """A 6 x 4 map with a wall in cell (3, 1) and nothing to see; layers as the motion has."""
    heights = np.zeros((6, 4))
    heights[3, 1] = WALL
    robots = tuple(
        Robot(start=start, motion=motion, camera=Camera(tilts=tilts), goal=goal) for start in starts
    )
    return Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=resolution),
        robots=robots,
        actors=(),
        horizon=horizon,
        rules=rules,
    )


def path_of(*cells: tuple[int, ...]) -> tuple[State, ...]:
    """Path of states."""
    return tuple(State(*cell) for cell in cells)


S = State(2, 1)
BROKEN: dict[str, tuple[tuple[State, ...], str]] = {
    "teleport": (path_of((2, 1), (2, 1), (0, 1)), "step 1 to 2 moves more than 1 cells"),
    "teleport along y": (path_of((2, 1), (2, 3), (2, 3)), "step 0 to 1 moves more than 1 cells"),
    "turn": (path_of((2, 1), (2, 1, 0, 2), (2, 1, 0, 2)), "step 0 to 1 turns more than 1 headings"),
    "about-turn": (
        path_of((2, 1), (2, 1, 0, 4), (2, 1, 0, 4)), "step 0 to 1 turns more than 1 headings",
    ),
    "climb": (path_of((2, 1), (2, 1, 2), (2, 1, 2)), "step 0 to 1 climbs more than 1 layers"),
    "pitch": (
        path_of((2, 1), (2, 1, 0, 0, 2), (2, 1, 0, 0, 2)),
        "step 0 to 1 pitches more than 1 steps",
    ),
    "corner": (path_of((2, 1), (2, 0), (3, 1)), "step 2 is inside an obstacle"),
    "corner cut": (path_of((2, 1), (3, 0), (3, 0)), "step 0 to 1 passes the blocked cell (3, 1)"),
    "corner cut on the way back": (
        path_of((2, 1), (2, 2), (3, 2), (2, 1)), "step 2 to 3 passes the blocked cell (3, 1)",
    ),
    "into the wall": (path_of((2, 1), (3, 1), (2, 1)), "step 1 is inside an obstacle"),
    "off the map": (path_of((2, 1), (2, 0), (2, -1)), "step 2 is outside the map"),
    "far off the map": (path_of((2, 1), (99, 0), (2, 1)), "step 1 is outside the map"),
    "no such layer": (path_of((2, 1), (2, 1, 3), (2, 1)), "step 1 is at a height that"),
    "negative layer": (path_of((2, 1), (2, 1, -1), (2, 1)), "step 1 is at a height that"),
    "no such heading": (path_of((2, 1), (2, 1, 0, 8), (2, 1)), "step 1 is at a heading that"),
    "negative heading": (path_of((2, 1), (2, 1, 0, -1), (2, 1)), "step 1 is at a heading that"),
    "no such pitch": (path_of((2, 1), (2, 1, 0, 0, 3), (2, 1)), "step 1 is at a tilt that"),
    "wrong start": (path_of((2, 2), (2, 2), (2, 2)), "must start at (2, 1, 0, 0, 0), not at (2, 2"),
    "wrong start heading": (path_of((2, 1, 0, 1), (2, 1), (2, 1)), "0), not at (2, 1, 0, 1, 0)"),
    "too short": (path_of((2, 1), (2, 1)), "3 states, for the steps 0..2, not 2"),
    "too long": (path_of((2, 1), (2, 1), (2, 1), (2, 1)), "3 states, for the steps 0..2, not 4"),
    "empty": ((), "3 states, for the steps 0..2, not 0"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_broken_motion_is_found(case: str) -> None:
    """Each way to break the motion is found, once, and named with robot and step."""
    path, fault = BROKEN[case]
    horizon = 3 if case == "corner cut on the way back" else 2
    problem = arena(S, horizon=horizon, motion=Motion(layers=(5.0, 7.0, 9.0)))
    verdict = check(problem, Plan(paths=(path,)))
    assert len(verdict.violations) == 1
    assert verdict.violations[0].startswith("paths[0]: ")
    assert fault in verdict.violations[0]
    assert not verdict.valid
    assert math.isnan(verdict.reward)


@pytest.mark.parametrize("number", [0, 1, 3])
def test_wrong_number_of_paths_is_found(number: int) -> None:
    """A plan needs exactly one path per robot."""
    problem = arena(S, State(0, 0))
    verdict = check(problem, Plan(paths=(path_of((2, 1), (2, 1), (2, 1)),) * number))
    assert verdict.violations == (f"paths: must be 2, one for each drone, not {number}",)


def test_missed_goal_is_found() -> None:
    """A robot that does not end in its goal cell breaks its motion; any heading there is fine."""
    problem = arena(S, goal=(1, 1))
    missed = check(problem, Plan(paths=(path_of((2, 1), (1, 1), (2, 1)),)))
    assert missed.violations == ("paths[0]: must end in cell (1, 1), not in cell (2, 1)",)
    reached = Plan(paths=(path_of((2, 1), (2, 1, 0, 7), (1, 1, 0, 6)),))
    assert check(problem, reached).valid


def test_every_fault_of_every_robot_is_named() -> None:
    """Faults of several robots and steps are all reported."""
    problem = arena(S, State(0, 0))
    plan = Plan(
        paths=(path_of((2, 1), (0, 1), (2, 1)), path_of((0, 0), (0, 0, 0, 3), (0, 0, 0, 6)))
    )
    found = _Referee(problem).violations(plan)
    assert [fault.split(":")[0] for fault in found] == ["paths[0]"] * 2 + ["paths[1]"] * 2


def test_steps_of_one_fault_are_in_one_line() -> None:
    """Off the map, in an obstacle, in a no-fly zone and above the ceiling are told apart."""
    square = np.array([(x, y, z) for z in (0.0, 6.0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))])
    sides = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)]
    for a, b in ((0, 1), (1, 2), (2, 3), (3, 0)):
        sides += [(a, b, b + 4), (a, b + 4, a + 4)]
    zone = Mesh(vertices=square, triangles=np.array(sides))
    problem = arena(S, horizon=8, motion=Motion(layers=(5.0, 9.0))).replace(
        airspace=Airspace(no_fly=(zone,), ceiling=8.0)
    )
    path = path_of(S, (0, 0), (0, 0), (2, 0), (0, 0), (3, 1), (0, 0, 1), (9, 0), (0, 0))  # type: ignore[arg-type]
    assert check(problem, Plan(paths=(path,))).violations == (
        "paths[0]: steps 1-2, 4, 8 are in a no-fly zone",
        "paths[0]: step 5 is inside an obstacle",
        "paths[0]: step 6 is above the ceiling",
        "paths[0]: step 7 is outside the map",
    )
    wide = arena(State(3, 3), motion=Motion(clearance=1.0))
    over = Plan(paths=(path_of((3, 3), (3, 2), (3, 1)),))
    assert check(wide, over).violations == (
        "paths[0]: step 2 is inside an obstacle, or within 1 m above or below one",
    )
    around = Plan(paths=(path_of((2, 1), (1, 0), (0, 1)),))
    assert check(problem.replace(horizon=2), around).violations == (
        "paths[0]: step 1 to 2 passes the cell (0, 0), which is in a no-fly zone",
    )


def test_what_is_allowed_is_not_reported() -> None:
    """Turning over the end of the ring, climbing and pitching by one step are legal."""
    problem = arena(S, motion=Motion(layers=(5.0, 7.0, 9.0)))
    plan = Plan(paths=(path_of((2, 1), (1, 2, 1, 7, 1), (2, 2, 2, 0, 2)),))
    assert check(problem, plan).valid
    cutting = arena(S, motion=Motion(corner_cutting=True))
    assert check(cutting, Plan(paths=(path_of((2, 1), (3, 0), (4, 1)),))).valid


def judged(problem: Problem, *paths: tuple[State, ...]) -> tuple[Verdict, list[Conflict]]:
    """The referee's verdict and the planners' own list of conflicts."""
    plan = Plan(paths=paths)
    verdict = check(problem, plan)
    assert verdict.violations == ()
    return verdict, list(plan.conflicts(problem))


MEETING = (path_of((0, 0), (1, 0), (1, 0)), path_of((2, 0), (1, 0), (2, 0)))
SWAPPING = (path_of((0, 0), (1, 0), (1, 0)), path_of((1, 0), (0, 0), (0, 0)))


def test_vertex_conflict_is_found() -> None:
    """Two robots in one cell at one step break the vertex rule, whatever their headings."""
    starts = [path[0] for path in MEETING]
    verdict, found = judged(arena(*starts), *MEETING)
    assert verdict.conflicts == ("step 1: drones 0 and 1 are in one cell",)
    assert found == [VertexConflict(1, (0, 1), (Cell(1, 0), Cell(1, 0)))]
    turned = (MEETING[0], path_of((2, 0), (1, 0, 0, 1), (2, 0)))
    assert judged(arena(*starts), *turned)[1] == found
    assert not verdict.valid
    verdict, found = judged(arena(*starts, rules=NO_RULES), *MEETING)
    assert verdict.valid
    assert found == []


def test_swap_conflict_is_found() -> None:
    """Two robots that exchange cells break the swap rule, where it is on, at the step they do."""
    starts = [path[0] for path in SWAPPING]
    verdict, found = judged(arena(*starts), *SWAPPING)
    assert verdict.conflicts == ("step 0 to 1: drones 0 and 1 swap cells",)
    assert found == [SwapConflict(0, (0, 1), (Cell(0, 0), Cell(1, 0)))]
    verdict, found = judged(arena(*starts, rules=VERTEX_ONLY), *SWAPPING)
    assert verdict.valid
    assert found == []


def test_following_is_no_swap() -> None:
    """A robot may enter the cell that another one leaves, unless they exchange cells."""
    paths = (path_of((0, 0), (1, 0), (2, 0)), path_of((1, 0), (2, 0), (2, 1)))
    verdict, found = judged(arena(State(0, 0), State(1, 0)), *paths)
    assert verdict.valid
    assert found == []


def test_separation_is_found() -> None:
    """Robots closer than the separation conflict at that step, also across layers."""
    motion = Motion(layers=(5.0, 6.0, 9.0), climb=2)
    starts = (State(0, 0), State(4, 0))
    rules = CollisionRules(separation=1.5)
    problem = arena(*starts, rules=rules, resolution=1.0, motion=motion)
    near = (path_of((0, 0), (1, 0), (1, 0)), path_of((4, 0), (3, 0), (2, 0, 1)))
    verdict, found = judged(problem, *near)
    assert verdict.conflicts == ("step 2: drones 0 and 1 are 1.41 m apart, less than 1.5 m",)
    assert found == [VertexConflict(2, (0, 1), (Cell(1, 0, 0), Cell(2, 0, 1)))]
    high = (near[0], path_of((4, 0), (3, 0), (2, 0, 2)))
    assert judged(problem, *high)[0].valid


def test_robots_in_different_layers_do_not_conflict() -> None:
    """Above one another robots are in different cells; layers are compared by their heights."""
    low, high = Motion(layers=(5.0,)), Motion(layers=(3.0, 5.0, 9.0))
    problem = arena(State(0, 0), State(2, 0))
    first, second = problem.robots
    paths = (MEETING[0], path_of((2, 0, 2), (1, 0, 2), (2, 0, 2)))
    above = second.replace(start=State(2, 0, 2), motion=high)
    apart = problem.replace(robots=(first.replace(motion=low), above))
    verdict, found = judged(apart, *paths)
    assert verdict.valid
    assert found == []
    # Layer 1 of the second robot is at the same height as layer 0 of the first.
    level = second.replace(start=State(2, 0, 1), motion=high)
    together = problem.replace(robots=(first.replace(motion=low), level))
    verdict, found = judged(together, MEETING[0], path_of((2, 0, 1), (1, 0, 1), (2, 0, 1)))
    assert len(verdict.conflicts) == 1
    assert found == [VertexConflict(1, (0, 1), (Cell(1, 0, 1), Cell(1, 0, 1)))]


@pytest.mark.parametrize(
    ("resolution", "separation"), [(0.1, 0.3), (0.1, 0.6), (0.7, 2.1), (0.3, 0.9), (1.1, 3.3)]
)
def test_planners_and_referee_measure_distance_alike(resolution: float, separation: float) -> None:
    """Exactly at the separation, planners and referee agree at every place of the map."""
    heights = np.zeros((30, 1))
    problem = Problem(
        name="",
        height_map=HeightMap(heights=heights, resolution=resolution),
        robots=(Robot(start=State(0, 0)), Robot(start=State(29, 0))),
        actors=(),
        horizon=1,
        rules=CollisionRules(separation=separation),
    )
    cells = round(separation / resolution)
    for x in range(1, 29 - cells):
        plan = Plan(paths=(path_of((0, 0), (x, 0)), path_of((29, 0), (x + cells, 0))))
        planners = len(list(plan.conflicts(problem)))
        assert planners == len(_Referee(problem).conflicts(plan)), f"cells {x} and {x + cells}"


@st.composite
def crowds(draw: st.DrawFn) -> tuple[Problem, Plan]:
    """Two to four robots in a few cells, on random walks that nobody keeps apart."""
    motion = Motion(headings=1, layers=draw(st.sampled_from([(5.0,), (5.0, 7.0)])))
    other = Motion(headings=1, layers=(7.0,))
    rules = draw(
        st.sampled_from([
            NO_RULES, VERTEX_ONLY, CollisionRules(), CollisionRules(separation=1.0),
            CollisionRules(separation=1.25), CollisionRules(swap=False, separation=2.0),
            CollisionRules(separation=1.5, vertical=0.7),
            CollisionRules(separation=1.0, vertical=2.5),
        ])
    )  # fmt: skip
    horizon, team, paths = draw(st.integers(1, 4)), [], []
    for _ in range(draw(st.integers(2, 4))):
        flown = draw(st.sampled_from([motion, motion, other]))
        where = st.tuples(
            st.integers(0, 2), st.integers(0, 1), st.integers(0, len(flown.layers) - 1)
        ).map(lambda cell: State(*cell))
        path = [draw(where)]
        for _ in range(horizon):
            step = draw(where)
            near = max(abs(a - b) for a, b in zip(step, path[-1], strict=True)) <= 1
            path.append(step if near else path[-1])
        team.append(Robot(start=path[0], motion=flown))
        paths.append(tuple(path))
    problem = Problem(
        name="",
        height_map=HeightMap(heights=np.zeros((3, 2))),
        robots=tuple(team),
        actors=(),
        horizon=horizon,
        rules=NO_RULES,
    )
    # Rules are set past the check: the plans here may conflict from the start.
    return _with_rules(problem, rules), Plan(paths=tuple(paths))


class _Ruled:
    """A problem under rules that its starts break, which `Problem` itself would refuse."""

    def __init__(self, problem: Problem, rules: CollisionRules) -> None:
        self._problem, self.rules = problem, rules

    def __getattr__(self, name: str) -> object:
        return getattr(self._problem, name)

    def too_close(self, a: Cell, b: Cell) -> bool:
        """Ask the problem's own method, under these rules."""
        return Problem.too_close(self, a, b)  # type: ignore[arg-type]


def _with_rules(problem: Problem, rules: CollisionRules) -> Problem:
    return _Ruled(problem, rules)  # type: ignore[return-value]


def test_views_of_a_plan_are_judged_once_with_rules_and_without(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It takes the referee's time, and rules change nothing but the conflicts."""
    judged, views = [], _Referee._view_rewards
    monkeypatch.setattr(
        _Referee, "_view_rewards", lambda own, seen: judged.append(own) or views(own, seen)
    )
    problem = arena(*(path[0] for path in SWAPPING))
    verdict, free = (check(one, Plan(paths=SWAPPING)) for one in (problem, problem.without_rules()))
    assert len(judged) == 1
    assert (len(verdict.conflicts), replace(verdict, conflicts=())) == (1, free)
    assert verdict == _Referee(problem).verdict(Plan(paths=SWAPPING))


def test_a_swap_of_drones_that_are_too_near_is_counted_at_its_ends() -> None:
    """Between steps only those count that keep the separation at both of them."""
    problem = _with_rules(arena(*(path[0] for path in SWAPPING)), CollisionRules(separation=2.0))
    plan = Plan(paths=SWAPPING)
    said = _Referee(problem).conflicts(plan)
    assert [words.split(":")[0] for words in said] == ["step 0", "step 1", "step 2"]
    assert [conflict.t for conflict in plan.conflicts(problem)] == [0, 1, 2]


@examples(80)
@given(crowds())
def test_planners_and_referee_agree_on_conflicts(case: tuple[Problem, Plan]) -> None:
    """The planners' list of conflicts and the referee's name the same robots and steps."""
    problem, plan = case
    assert _Referee(problem).violations(plan) == []
    named = []
    for conflict in plan.conflicts(problem):
        i, k = conflict.robots
        assert i < k
        at_step = isinstance(conflict, VertexConflict)
        when = f"step {conflict.t}" if at_step else f"step {conflict.t} to {conflict.t + 1}"
        named.append((when, f"drones {i} and {k}", isinstance(conflict, SwapConflict)))
    found = []
    for text in _Referee(problem).conflicts(plan):
        when, words = text.split(": ")
        found.append((when, re.split(" are| swap| pass", words)[0], "swap" in words))
    assert sorted(named) == sorted(found)
    steps = [conflict.t for conflict in plan.conflicts(problem)]
    assert steps == sorted(steps)


def test_conflicts_come_earliest_first() -> None:
    """The first conflict, which the constraint tree branches on, is of the earliest step."""
    starts = (State(0, 0), State(1, 0), State(0, 2), State(1, 2))
    paths = (
        path_of((0, 0), (0, 0), (1, 0)),
        path_of((1, 0), (1, 0), (1, 0)),
        path_of((0, 2), (1, 2), (1, 2)),
        path_of((1, 2), (0, 2), (1, 2)),
    )
    found = judged(arena(*starts), *paths)[1]
    assert [(type(c), c.t, c.robots) for c in found] == [
        (SwapConflict, 0, (2, 3)),
        (VertexConflict, 2, (0, 1)),
        (VertexConflict, 2, (2, 3)),
    ]


# Where robots can go from (1, 1), and which rewards that earns: stationarity (thousands), the
# cell (hundreds), the heading (tens) and balance (ones).
EARNED = {
    "nothing changes": ((1, 1, 0, 0, 0), 1111),
    "a turn": ((1, 1, 0, 1, 0), 101),
    "another pitch": ((1, 1, 0, 0, 1), 111),
    "a climb": ((1, 1, 1, 0, 0), 11),
    "a climb and a turn": ((1, 1, 1, 7, 0), 1),
    "ahead": ((2, 1, 0, 0, 0), 10),
    "ahead with a turn": ((2, 1, 0, 1, 0), 0),
    "a diagonal": ((2, 2, 0, 0, 0), 10),
    "an anti-diagonal": ((2, 0, 0, 0, 0), 11),
    "the other anti-diagonal": ((0, 2, 0, 0, 0), 11),
    "an anti-diagonal with a turn": ((0, 2, 0, 7, 0), 1),
    "an anti-diagonal with a climb": ((0, 2, 1, 7, 1), 1),
}


@pytest.mark.parametrize("case", EARNED)
def test_rewards_for_moves_add_up(case: str) -> None:
    """Each kept thing is rewarded for itself; dx + dy = 0 counts whatever else changes."""
    end, earned = EARNED[case]
    rates = Objective(stationarity=1000.0, keep_cell=100.0, keep_heading=10.0, balanced=1.0)
    problem = arena(State(1, 1), horizon=1, motion=Motion(layers=(5.0, 7.0)))
    verdict = check(problem.replace(objective=rates), Plan(paths=(path_of((1, 1), end),)))
    assert verdict.valid
    assert verdict.reward_moves == verdict.reward == earned
    assert check(problem, Plan(paths=(path_of((1, 1), end),))).reward_moves == 0.0


def test_rewards_for_moves_count_every_robot_and_step() -> None:
    """Two robots, three moves: what each of them earns adds up, the start earns nothing."""
    rates = Objective(keep_cell=0.01, keep_heading=0.02, balanced=100.0)
    problem = arena(State(1, 1), State(5, 3), horizon=3).replace(objective=rates)
    first = path_of((1, 1), (2, 0), (2, 0, 0, 1), (1, 0, 0, 1))
    verdict = check(problem, Plan(paths=(first, path_of((5, 3), (5, 3), (4, 3), (4, 2)))))
    # Of the first: heading and balance, cell and balance, heading. Of the other: all three, and
    # the heading twice.
    expected = (0.02 + 100) + (0.01 + 100) + 0.02 + (0.03 + 100) + 2 * 0.02
    assert verdict.reward_moves == pytest.approx(expected, rel=1e-15)


def test_verdict_of_the_tiny_instance() -> None:
    """The referee's numbers of a plan of the tiny instance are those added up from scratch."""
    problem = tiny()
    plan = Plan(
        paths=(
            path_of((0, 0), (0, 1), (0, 2, 0, 1)),
            path_of((3, 2, 0, 2), (3, 2, 0, 2), (3, 1, 0, 2)),
        )
    )
    verdict = check(problem, plan)
    assert verdict.valid
    assert verdict.reward == pytest.approx(objective_from_scratch(problem, plan), rel=1e-12)
    assert len(verdict.reward_per_step) == problem.horizon
    assert len(verdict.face_reward) == 5
    assert verdict.reward > 0


SAMPLES = np.linspace(0.0, 1.0, 81)  # drones that move to a neighbouring cell are nearest at one
APART = (CollisionRules(separation=2.0), CollisionRules(separation=2.5, vertical=1.5))
TAKING_LONG = ("corridor", "bridge", "bottleneck", "passage", "field", "delft")


def sampled_conflicts(problem: Problem, plan: Plan, rules: CollisionRules) -> Counter[str]:
    """Steps and pairs of drones that are too close together at one of many moments."""
    flown = [problem.where(r, p) for r, p in zip(problem.robots, plan.paths, strict=True)]
    found: Counter[str] = Counter()
    for (i, one), (k, other) in combinations(enumerate(flown), 2):
        for t in range(problem.horizon + 1):
            last = min(t + 1, problem.horizon)
            begin, end = other[t] - one[t], other[last] - one[last]
            ways = begin + SAMPLES[:, None] * (end - begin)
            near = np.linalg.norm(ways[:, : 2 if rules.vertical else 3], axis=1)
            low = near < max(rules.separation - TOLERANCE, TOLERANCE)
            if rules.vertical:
                low &= np.abs(ways[:, 2]) < rules.vertical - TOLERANCE
            if low[0]:
                found[f"step {t}: drones {i} and {k}"] += 1
            swap = np.allclose(one[t], other[last]) and np.allclose(one[last], other[t])
            between = rules.separation and low.any() and not (low[0] or low[-1])
            if (swap and not np.allclose(begin, 0) and not low[0]) or between:
                found[f"step {t} to {last}: drones {i} and {k}"] += 1
    return found


@pytest.mark.long
@pytest.mark.parametrize(
    "scene",
    [
        *(name for name in SCENES if not name.startswith(TAKING_LONG)),
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("corridor-tight", *TAKING_LONG)),
    ],
)
def test_conflicts_of_greedy_plans_are_those_that_samples_find(scene: str) -> None:
    """Under the scene's rules and under separations, pair by pair and step by step."""
    problem = load_scene(scene, 0)
    plan = greedy(problem).plan
    assert plan is not None
    for rules in (problem.rules, *APART):
        said = _Referee(_with_rules(problem, rules)).conflicts(plan)
        named = Counter(re.split(" are| swap| pass", words)[0] for words in said)
        assert named == sampled_conflicts(problem, plan, rules), rules


@pytest.mark.parametrize("stray", [0.0, 0.15])
def test_no_move_leads_through_a_person(stray: float) -> None:
    """It ends at the distance that an even speed needs, but not at that of an uneven one."""
    problem = Problem(
        name="through", height_map=HeightMap(heights=np.zeros((12, 1))), horizon=1,
        robots=(Robot(start=State(3, 0), motion=Motion(radius=5, headings=1)),),
        actors=(Actor(poses=np.array([[5.5, 0.5, 0.0, 0.0]] * 2)),),
        airspace=Airspace(people_aside=2.0, people_stray=stray),
    )  # fmt: skip
    verdict = check(problem, Plan(paths=((State(3, 0), State(8, 0)),)))
    assert verdict.violations == ("paths[0]: step 0 to 1 passes too close to person 0",)
    graph = compiled(problem).class_of[0].graph
    assert graph.place(0, 8, 0) not in graph.heads_at(0, np.array([graph.place(0, 3, 0)]))
