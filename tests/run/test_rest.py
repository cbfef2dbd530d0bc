"""The rest of a mission: its scene, its plans, and what is said of wrong ones."""

import math

import numpy as np
import pytest
from brute_force import all_paths, optimum
from counting import either
from hypothesis import assume, given
from hypothesis import strategies as st
from losing import value_with
from pool import problems
from strategies import examples, standing, tiny

import cocap_opt as co
from cocap_opt.data import FieldError, ProblemError
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.problem import Airspace, Limits, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result
from cocap_opt.run.rest import Rest
from cocap_opt.run.view_share import keeps_share
from cocap_opt.stop import Stop

Left = tuple[Problem, Plan, int, list[int]]  # mission, plan, step, drones that are lost


@st.composite
def missions(draw: st.DrawFn, most_plans: int = 3000) -> Left:
    """Problems of several steps with a random plan that obeys the rules, a step, and losses."""
    problem = draw(either(problems(most_plans=most_plans)).filter(lambda p: p.horizon > 1))
    paths = []
    for robot in range(len(problem.robots)):
        able = all_paths(problem, robot)
        assume(able)
        paths.append(draw(st.sampled_from(able)))
    plan = Plan(paths=tuple(paths))
    if not check(problem, plan).valid:
        plan = optimum(problem).plan
    assume(plan is not None)
    robots = range(len(problem.robots))
    lost = draw(st.lists(st.sampled_from(robots), unique=True, max_size=len(robots) - 1))
    return problem, plan, draw(st.integers(1, problem.horizon - 1)), lost


@pytest.mark.long
@examples(200)
@given(missions())
def test_the_whole_is_what_was_flown_and_the_rest(mission: Left) -> None:
    """J by an evaluator of another kind, with drones that contribute nothing once they are lost."""
    problem, plan, step, lost = mission
    rest = Rest.of(problem, plan, step, lost)
    verdict = check(rest.scene, rest.of_plan(plan))
    assert verdict.valid
    expected = value_with(problem, plan, step, lost)
    assert rest.reward_flown + verdict.reward == pytest.approx(expected, rel=1e-9, abs=1e-9)
    assert rest.step == step and len(rest.scene.robots) == len(problem.robots) - len(lost)
    joined = rest.joined(rest.of_plan(plan))
    assert joined == (None if lost else plan)


@pytest.mark.long(seconds=10)
@examples(40)
@given(missions(most_plans=800))
def test_a_new_rest_is_no_worse_and_its_bound_no_lower_than_the_optimum(mission: Left) -> None:
    """The sandwich: old rest, new rest, the optimum by brute force, and a bound that is checked."""
    problem, plan, step, lost = mission
    found = co.plan(problem, follow=plan, from_step=step, without=lost)
    scene, best = found.rest.problem, optimum(co.rest(problem, plan, step, lost)).value
    assert scene is not None and found.old is not None and not found.fault
    slack = 1e-9 * max(1.0, abs(best))
    assert found.old - slack <= found.rest.value <= best + slack
    assert found.rest.bound >= best - slack
    assert found.rest.gap <= 0.01 + 1e-9
    assert found.value == pytest.approx(found.flown + found.rest.value)
    checked = co.verify(scene, found.rest.plan, found.rest.certificate)
    assert checked.reward == pytest.approx(found.rest.value)
    if lost:
        assert found.plan is None
        return
    assert found.plan is not None and found.plan.paths[0][: step + 1] == plan.paths[0][: step + 1]
    assert co.verify(problem, found.plan).reward == pytest.approx(found.value)


@examples(40)
@given(missions(), st.sampled_from([0.3, 0.6, 0.9]), st.sampled_from([1, 2]))
def test_the_rest_asks_for_the_views_that_the_whole_lacks(
    mission: Left, share: float, cameras: int
) -> None:
    """A rest keeps its share if and only if the whole keeps its own; else that is said."""
    problem, plan, step, _ = mission
    asked = co.with_views(problem, cameras=cameras, weight=1.0, share=share)
    rest = Rest.of(asked, plan, step)
    views = rest.scene.objective.views
    assert views is not None
    kept = keeps_share(asked, plan)
    if rest.message:
        assert not kept and "out of reach" in rest.message and views.share is None
    else:
        assert keeps_share(rest.scene, rest.of_plan(plan)) == kept


def walking() -> tuple[Problem, Plan]:
    """Two drones, somebody who walks past a wall for four steps, and a plan of the optimum."""
    problem = tiny()
    poses = np.array([[9.0, 4.0 + t, 0.0, 0.3 * t] for t in range(5)])
    actor = problem.actors[0].replace(poses=poses, begin=10.0, importance=(1.0, 2.0, 3.0, 4.0, 5.0))
    problem = problem.replace(actors=(actor,), horizon=4, step=0.5)
    plan = co.plan(problem).plan
    assert plan is not None
    return problem, plan


def test_people_and_drones_go_on_from_where_they_are() -> None:
    """Poses, importances and times of tracks begin at the step; views at it do not count again."""
    problem, plan = walking()
    counted = problem.replace(objective=problem.objective.replace(count_start=True))
    scene = co.rest(counted, plan, 3, without=[0])
    (actor,), (robot,) = scene.actors, scene.robots
    assert actor.poses.tolist() == problem.actors[0].poses[3:].tolist()
    assert (actor.importance, actor.begin) == ((4.0, 5.0), 11.5)
    assert robot.start == plan.paths[1][3] and scene.horizon == 1
    assert not scene.objective.count_start
    assert scene.name == "tiny, from step 3, without drone 0"


def test_a_proof_of_the_rest_is_not_given_up_for_a_worse_bound() -> None:
    """An exact method has proved its plan: no second search, however short, takes that away."""
    scene = co.load("corridor")
    plan = co.plan(scene, "sequential").plan
    again = co.plan(scene, "branch-and-price", follow=plan, from_step=1, bound_limit=1e-6)
    assert again.rest.reason is Reason.OPTIMAL and again.rest.gap <= OPTIMALITY


def test_batteries_of_a_rest_have_what_is_left() -> None:
    """The seconds that were flown are gone; with homes nobody knows, and that is said."""
    scene = co.load("corridor").replace(step=2.0)
    limits = Limits(endurance=100.0)
    robots = tuple(robot.replace(limits=limits) for robot in scene.robots)
    plan = co.plan(scene, "sequential").plan
    rest = Rest.of(scene.replace(robots=robots), plan, 2)
    assert [robot.limits.endurance for robot in rest.scene.robots] == [96.0] * len(robots)
    assert not rest.message
    homes = [(state.x, state.y) for state in (robot.start for robot in robots)]
    homed = [robot.replace(home=home) for robot, home in zip(robots, homes, strict=True)]
    rest = Rest.of(scene.replace(robots=tuple(homed)), plan, 2)
    assert all(robot.limits.endurance is None for robot in rest.scene.robots)
    assert all(robot.home is None for robot in rest.scene.robots)
    assert rest.message.startswith("homes and batteries are ignored in the rest")


def test_a_planner_that_finds_nothing_better_leaves_the_old_rest() -> None:
    """Its plan is worse, or breaks a rule, or there is none: the answer says so."""
    problem, plan = walking()

    def nothing(problem: Problem, stop: Stop) -> Result:
        return Result.without_plan(Reason.FAILED, "gave up")

    def staying(problem: Problem, stop: Stop) -> Result:
        hovering = Plan.hovering(problem)
        assert hovering is not None
        return Result(hovering, check(problem, hovering).reward, Reason.FINISHED)

    old = co.check(co.rest(problem, plan, 1), Plan(paths=tuple(p[1:] for p in plan.paths)))
    for planner in (nothing, staying):
        found = co.plan(problem, planner, follow=plan, from_step=1, bound_limit=0)
        assert found.plan == plan and found.old == found.rest.value == old.reward
        assert "the old rest is kept" in found.rest.message
        assert math.isinf(found.rest.bound) and found.rest.certificate is None
    assert "from step 1, drones 0, 1" in found.summary() and "old rest" in found.summary()
    assert repr(found).startswith("Replanned(")


def test_people_who_walk_elsewhere_may_end_the_old_rest() -> None:
    """A plan is made from where drones are; the old rest is no plan there, for the reason given."""
    problem, plan = walking()
    (drone, _), (actor,) = plan.paths, problem.actors
    poses = actor.poses.copy()
    x, y = problem.height_map.centre(drone[3].x, drone[3].y)
    poses[3:, :2] = x, y
    moved = problem.replace(
        actors=(actor.replace(poses=poses),), airspace=Airspace(people_aside=0.5)
    )
    found = co.plan(moved, follow=plan, from_step=1)
    assert found.old is None and "person 0" in found.fault
    assert found.fault == "paths[0]: step 3 is 0 m from person 0"  # of the mission, not of the rest
    assert "no longer possible" in found.summary()
    assert found.plan is not None and co.check(moved, found.plan).valid
    with pytest.raises(ValueError, match=r"follow: the steps 0..3 cannot have been flown"):
        co.plan(moved, follow=plan, from_step=3)


def test_what_cannot_be_a_rest_is_refused() -> None:
    """One line names what is wrong and what is allowed."""
    problem, plan = walking()
    over_time = problem.replace(
        objective=problem.objective.replace(over_time=True),
        actors=(standing(9.0, 4.0, 0.0, 0.0, steps=4),),
    )
    short = Plan(paths=tuple(path[:-1] for path in plan.paths))
    away = Plan(paths=(plan.paths[1], plan.paths[0]))
    one_step, all_ = problem.replace(horizon=1), [0, 1]
    cases: list[tuple[Problem, Plan, int, list[int], str]] = [
        (problem, plan, 0, [], "from_step: must be a step from 1 to 3, of the steps 0..4, not 0"),
        (problem, plan, 4, [], "from_step: must be a step from 1 to 3, of the steps 0..4, not 4"),
        (one_step, plan, 1, [], "from_step: must be left out: tiny has only one step"),
        (problem, plan, 1, [2], "without: must be numbers of drones, 0..1, not 2"),
        (problem, plan, 1, [1, 1], "without: must name each drone only once"),
        (problem, plan, 1, all_, "without: must leave at least one of the 2 drones"),
        (problem, short, 1, [], "paths[0]: must have 5 states, for the steps 0..4, not 4"),
        (problem, Plan(paths=plan.paths[:1]), 1, [], "paths: must be 2, one for each drone, not 1"),
        (problem, away, 1, [], "paths[0]: must start at"),
        (over_time, plan, 2, [], "objective.over_time: must be false to plan a rest"),
    ]
    for mission, flown, step, lost, words in cases:
        with pytest.raises((FieldError, ProblemError)) as caught:
            Rest.of(mission, flown, step, lost)
        assert words in str(caught.value) and "\n" not in str(caught.value)
        with pytest.raises(ValueError, match=r"^(follow|from_step|without): "):
            co.plan(mission, follow=flown, from_step=step, without=lost)
    for words, options in (
        ("follow: must be the plan", {"from_step": 1}),
        ("from_step: must be given", {"follow": plan}),
        ("bound_limit: must be a number", {"follow": plan, "from_step": 1, "bound_limit": -1}),
    ):
        with pytest.raises(ValueError, match=words):
            co.plan(problem, **options)  # type: ignore[call-overload]
    with pytest.raises(TypeError, match=r"from_step: must be a whole number, not 1\.5"):
        co.rest(problem, plan, 1.5)  # type: ignore[arg-type]
