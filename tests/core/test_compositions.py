"""Planners that are made of best responses: what each part adds, and what the best of them is."""

import numpy as np
import pytest
from brute_force import all_paths
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import WALL, examples, standing, tiny

from cocap_opt.coordination.low_level import (
    PlannedTeam,
    SingleRobotPath,
    SingleRobotTask,
    value_iteration,
)
from cocap_opt.coordination.neighbourhoods import (
    LARGEST,
    _exchanged,
    _neighbours,
    neighbourhood_search,
)
from cocap_opt.coordination.responses import Responses, followed, one_by_one
from cocap_opt.coordination.restricted_value_iteration import RestrictedValueIteration
from cocap_opt.graph.charges import NO_CHARGES
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.planners.cocap import cocap
from cocap_opt.planners.cocap_lns import cocap_lns
from cocap_opt.planners.constraint_tree import FocalNodes, Node, OpenNodes
from cocap_opt.planners.sequential import best_of_orders, sequential, sequential_rounds
from cocap_opt.problem import Plan, Problem, State
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, Stop, WorkLimit, never
from cocap_opt.world.workspace import HeightMap

SETTLED = ("sequential-rounds", "cocap-focal", "cocap-lns", "cocap-prices")
crowds = st.one_of(problems(), meetings(), meetings(team=3))


class Asked(Stop):
    """Stopping criterion that is reached after so many questions."""

    def __init__(self, calls: int) -> None:
        self.left = calls

    def reached(self) -> Limit | None:
        """Count down."""
        self.left -= 1
        return Limit.TIME if self.left < 0 else None


@pytest.mark.long
@pytest.mark.parametrize("name", SETTLED)
@examples(4)
@given(problem=st.one_of(problems(most_plans=500), meetings(), meetings(team=3)))
def test_no_robot_alone_can_gain(name: str, problem: Problem) -> None:
    """After rounds that obey the rules no other path of any one robot is better, and obeys them."""
    assume(not problem.objective.over_time)
    result = PLANNERS[name](problem, never)
    assume(result.plan is not None)
    for robot in range(len(problem.robots)):
        for path in all_paths(problem, robot):
            paths = list(result.plan.paths)
            paths[robot] = path
            changed = check(problem, Plan(paths=tuple(paths)))
            if changed.valid and not changed.conflicts:
                assert changed.reward <= result.value * (1 + 1e-8) + 1e-9


@examples(12)
@given(problem=crowds)
def test_what_is_added_never_loses(problem: Problem) -> None:
    """Rounds, further orders and neighbourhoods start from the sequential plan, and only gain."""
    first = sequential(problem)
    for planner in (sequential_rounds, best_of_orders, cocap_lns):
        result = planner(problem)
        assert result.value >= first.value
        if first.plan is not None:
            assert result.plan is not None
    assert cocap_lns(problem).value >= sequential_rounds(problem).value


def test_a_second_order_finds_what_the_first_does_not() -> None:
    """On these two scenes the first order is not the best, and no order is as good as a search."""
    for scene in ("corridor-tight", "tiny-trap"):
        problem = load_scene(scene, 0, {})
        values = [p(problem).value for p in (sequential, best_of_orders, cocap_lns)]
        assert values == sorted(values)
        assert values[0] < values[-1]


@pytest.mark.slow
@pytest.mark.parametrize("scene", ["corridor", "corridor-tight"])
def test_the_recommended_planner_is_near_the_optimum(scene: str) -> None:
    """Within 0.1 % of the proved optimum, and not below CoCap, on scenes of two drones."""
    for seed in range(2):
        problem = load_scene(scene, seed, {})
        best = PLANNERS["joint"](problem, never).value
        found = cocap_lns(problem).value
        assert 0.999 * best <= found <= best * (1 + 1e-9)
        assert found >= 0.999 * cocap(problem).value


@examples(12)
@given(problem=crowds, calls=st.integers(0, 60), name=st.sampled_from(SETTLED))
def test_stopped_anywhere(problem: Problem, calls: int, name: str) -> None:
    """Stopped after any number of questions, the plan obeys the rules, and the result says so."""
    stop = Asked(calls)
    result = PLANNERS[name](problem, stop)
    if stop.left >= 0:
        assert result.reason is not Reason.STOPPED
    if result.plan is not None:
        verdict = check(problem, result.plan)
        assert verdict.valid
        assert not verdict.conflicts


def test_more_responses_are_never_worse() -> None:
    """The search goes the same way however long it may go on."""
    problem = load_scene("corridor-tight", 3, {})
    values = [cocap_lns(problem, never, responses).value for responses in (2, 6, 14, 30)]
    assert values == sorted(values)


def test_the_search_asks_no_more_than_it_may() -> None:
    """A neighbourhood that has begun is finished; no other begins."""
    problem = load_scene("bottleneck-tight", 0, {})
    responses = Responses(value_iteration, never)
    nobody = PlannedTeam.nobody(compiled(problem))
    team, _ = followed(nobody, one_by_one(nobody, responses))
    for _ in neighbourhood_search(team, responses, 30, np.random.default_rng(1)):
        assert responses.asked <= 30 + 8 * team.size
    assert 30 <= responses.asked <= 30 + 8 * team.size


def test_a_neighbourhood_is_of_those_that_see_most_of_the_same() -> None:
    """Of many robots it is one and the seven that share the most with it; of few all are in it."""
    robots = tuple(tiny().robots[0].replace(start=State(x, 0)) for x in range(LARGEST + 4))
    wide = HeightMap(heights=np.zeros((LARGEST + 4, 3)), resolution=4.0)
    problem = tiny().replace(height_map=wide, robots=robots)
    team, rng = PlannedTeam.nobody(compiled(problem)), np.random.default_rng(0)
    for robot in range(team.size):
        seen = rng.choice([0.0, 0.0, 1.0, 9.0], size=problem.no_pixels().shape)
        seen *= robot < team.size - 1  # the last one sees nothing
        team = team.with_path(robot, SingleRobotPath((0,), seen, 0))
    for robot in range(team.size):
        shared = {
            other: float(
                np.sqrt(np.minimum(team.found[robot].pixels, team.found[other].pixels))
                @ problem.view_sum_weights
            )
            for other in range(team.size)
            if other != robot
        }
        first, *others = _neighbours(team, robot).tolist()
        assert first == robot
        assert others == sorted(shared, key=lambda other: -shared[other])[: LARGEST - 1]
    few = PlannedTeam(team.model, team.found[:LARGEST])
    assert _neighbours(few, 3).tolist() == list(range(LARGEST))


def test_what_was_answered_is_not_asked_again() -> None:
    """The same robot beside the same paths has the same answer, without the low level."""
    calls: list[int] = []

    def counted(task: object) -> object:
        calls.append(task.robot)
        return value_iteration(task)

    nobody = PlannedTeam.nobody(compiled(tiny()))
    responses = Responses(counted, never)
    assert responses.best(nobody, 0) == responses.best(nobody, 0)
    assert calls == [0]
    team = nobody.with_path(0, responses.best(nobody, 0))
    assert responses.best(team, 0) == responses.best(nobody, 0)  # its own path is no matter
    assert calls == [0]
    responses.best(team, 1)
    responses.best(nobody, 1)
    assert calls == [0, 1, 1]


def _node(value: float, conflicts: int) -> Node:
    """A node of this value; its conflicts are only counted."""
    team = PlannedTeam.nobody(compiled(tiny()))
    team.__dict__["conflicts"] = (None,) * conflicts
    return Node(team, (NO_CHARGES,) * team.size, value)


def test_a_focal_list_takes_the_fewest_conflicts_within_a_share_of_the_best() -> None:
    """Best first takes the greatest J; the focal list gives up at most 1 % of it."""
    nodes = [_node(100.0, 5), _node(99.5, 1), _node(99.2, 1), _node(98.0, 0)]
    focal, best = FocalNodes(), OpenNodes()
    for node in nodes:
        focal.push(node)
        best.push(node)
    assert [best.pop().value for _ in nodes] == [100.0, 99.5, 99.2, 98.0]
    assert [focal.pop().value for _ in nodes] == [99.5, 99.2, 100.0, 98.0]
    assert not focal
    assert (focal.pushed, focal.popped) == (4, 4)


def _niche() -> Problem:
    """Two robots that must pass each other in a corridor, where there is a niche."""
    niche = HeightMap(heights=np.array([[0.0, WALL], [0.0, 0.0], [0.0, WALL]]), resolution=4.0)
    one, other = tiny().robots
    one = one.replace(start=State(0, 0), goal=(2, 0))
    other = other.replace(start=State(2, 0, heading=2), goal=(0, 0))
    actors = (standing(9.0, 4.0, 0.0, 0.0, steps=4),)
    return tiny().replace(height_map=niche, robots=(one, other), actors=actors, horizon=4)


def test_where_sequential_planning_fails_there_is_a_tree() -> None:
    """It finds the plan, and a work limit, which counts its nodes only, stops it."""
    assert sequential(_niche()).reason is Reason.FAILED
    assert cocap_lns(_niche()).plan is not None
    assert cocap_lns(_niche(), WorkLimit(0)).limit is Limit.WORK
    problem = load_scene("corridor-tight", 0, {})
    assert cocap_lns(problem, WorkLimit(0), responses=1).limit is None


@examples(8)
@given(problem=crowds, width=st.sampled_from([1, 3, 10_000]))
def test_responses_over_few_states(problem: Problem, width: int) -> None:
    """They keep to charges, lose nothing, and are the best of all if all states are kept."""
    assume(not problem.objective.over_time)
    team = _planned(problem)
    restricted = RestrictedValueIteration.beside(team, never, width)
    for robot in range(team.size):
        for charges in (NO_CHARGES, team.avoiding(robot)):
            seen = team.pixels(without=robot)
            task = SingleRobotTask(team.model, robot, seen, charges, never)
            few, best = (
                team.with_path(robot, low_level(task))
                for low_level in (restricted, value_iteration)
            )
            verdict = check(problem, team.model.plan(few.paths))
            assert verdict.violations == ()
            assert charges is NO_CHARGES or verdict.conflicts == ()
            assert team.value * (1 - 1e-9) <= few.value <= best.value * (1 + 1e-9)
            assert width < 10_000 or few.value == pytest.approx(best.value)


@examples(8)
@given(problem=meetings(team=3))
def test_who_exchange_their_ways_see_the_same_together(problem: Problem) -> None:
    """Two robots that go on along each other's paths obey the rules and change no view sum."""
    team, rng = _planned(problem), np.random.default_rng(0)
    for _ in range(5):
        changed = _exchanged(team, np.arange(team.size), rng)
        if changed is not None:
            assert changed.paths != team.paths
            assert not changed.conflicts
            together = [sum(one.pixels for one in some.found) for some in (team, changed)]
            assert together[0] == pytest.approx(together[1])
            assert check(problem, team.model.plan(changed.paths)).valid


def _planned(problem: Problem) -> PlannedTeam:
    """A team that is planned sequentially."""
    nobody = PlannedTeam.nobody(compiled(problem))
    team, _ = followed(nobody, one_by_one(nobody, Responses(value_iteration, never)))
    assume(team.is_whole)
    return team
