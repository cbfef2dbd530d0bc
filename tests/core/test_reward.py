"""The objective: what it is worth, that it is monotone and submodular, how it breaks down."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from brute_force import objective_from_scratch
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples, tiny

from cocap_opt.data import FloatArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_reward, objective, view_reward
from cocap_opt.problem import Objective, Plan, Problem
from cocap_opt.referee import check

TEAMS = problems()


class Flown(NamedTuple):
    """A model and a path for each of its robots."""

    model: Model
    paths: tuple[Path, ...]

    @property
    def plan(self) -> Plan:
        """The paths as a plan."""
        return self.model.plan(self.paths)

    def pixels(self, robots: list[int]) -> FloatArray:
        """Pixels [Z] of some of the robots together."""
        total = self.model.problem.no_pixels()
        for robot in robots:
            total = total + self.model.robot_pixels(robot, self.paths[robot])
        return total

    def value(self, robots: list[int]) -> float:
        """J of some of the robots alone."""
        views = view_reward(self.model.problem, self.pixels(robots)).sum()
        return float(views) + sum(self.moves(robot) for robot in robots)

    def moves(self, robot: int) -> float:
        """What a robot is rewarded for its moves."""
        shape = self.model.class_of[robot].graph.shape
        return Bonuses.of(self.model.problem.objective).of_path(shape, self.paths[robot])


@st.composite
def flown(draw: st.DrawFn, teams: st.SearchStrategy[Problem] = TEAMS) -> Flown:
    """Random problems with random paths; goals are not minded, and people leave a way."""
    problem = draw(teams)
    airspace = problem.airspace.replace(people_aside=0.0, people_above=None)
    problem = problem.replace(airspace=airspace)
    model = Model(problem, use_cache=False)
    paths = []
    for i, robot_class in enumerate(model.class_of):
        path = [model.first_start(i)]
        for t in range(problem.horizon):
            heads = [path[-1], *robot_class.graph.successors(t, path[-1]).tolist()]
            path.append(draw(st.sampled_from(heads)))
        paths.append(tuple(path))
    return Flown(model, tuple(paths))


def without_goals(problem: Problem) -> Problem:
    """The problem with no goals, so that the referee accepts any path."""
    return problem.replace(robots=tuple(robot.replace(goal=None) for robot in problem.robots))


@examples(15)
@given(flown(TEAMS.map(without_goals)))
def test_objective_is_the_referees(run: Flown) -> None:
    """J of the planners, of the referee and from scratch are one number."""
    problem = run.model.problem
    value = objective(run.model, run.paths)
    verdict = check(problem, run.plan)
    assert verdict.violations == ()
    assert value == pytest.approx(verdict.reward, rel=1e-9, abs=1e-12)
    assert value == pytest.approx(objective_from_scratch(problem, run.plan), rel=1e-9, abs=1e-12)


@examples(20)
@given(flown(TEAMS.map(without_goals)))
def test_breakdowns_sum_to_the_objective(run: Flown) -> None:
    """Rewards by step and by face, plus those for moves, add up to J."""
    problem = run.model.problem
    verdict = check(problem, run.plan)
    bonus = sum(run.moves(robot) for robot in range(len(run.paths)))
    assert verdict.reward_moves == pytest.approx(bonus, rel=1e-12)
    rewards = view_reward(problem, run.pixels(list(range(len(run.paths)))))
    assert rewards.shape == ((problem.horizon + 1) * len(problem.face_weights),)
    table = rewards.reshape(problem.horizon + 1, -1)
    np.testing.assert_allclose(verdict.reward_per_step, table[1:].sum(axis=1), rtol=1e-9)
    np.testing.assert_allclose(verdict.face_reward, table.sum(axis=0), rtol=1e-9)
    assert verdict.reward_at_start == pytest.approx(table[0].sum(), rel=1e-9)
    by_step = verdict.reward_at_start + math.fsum(verdict.reward_per_step) + bonus
    assert by_step == pytest.approx(verdict.reward, rel=1e-12, abs=1e-12)
    by_face = math.fsum(verdict.face_reward) + bonus
    assert by_face == pytest.approx(verdict.reward, rel=1e-12, abs=1e-12)


@examples(15)
@given(flown(), st.data())
def test_monotone_and_submodular(run: Flown, data: st.DataObject) -> None:
    """One more robot never costs, and gains the less the more robots are there already."""
    robots = list(range(len(run.paths)))
    more = data.draw(st.lists(st.sampled_from(robots), unique=True, max_size=len(robots)))
    fewer = more[: data.draw(st.integers(0, len(more)))]
    for robot in robots:
        if robot in more:
            continue
        late = run.value([*more, robot]) - run.value(more)
        early = run.value([*fewer, robot]) - run.value(fewer)
        scale = 1.0 + run.value(robots)
        assert late >= -1e-12 * scale
        assert late <= early + 1e-12 * scale


@examples(20)
@given(flown(), st.data())
def test_marginal_rewards_telescope(run: Flown, data: st.DataObject) -> None:
    """Marginal rewards along the robots' paths, in any order, add up to J."""
    total, before = 0.0, list[int]()
    for robot in data.draw(st.permutations(range(len(run.paths)))):
        robot_class = run.model.class_of[robot]
        reward = marginal_reward(run.model, robot_class, run.pixels(before))
        gain = sum(float(reward[t, state]) for t, state in enumerate(run.paths[robot]))
        gain += run.moves(robot)
        before.append(robot)
        total += gain
        assert total == pytest.approx(run.value(before), rel=1e-9, abs=1e-9)


@examples(12)
@given(flown(TEAMS.map(without_goals)), st.floats(0.01, 100.0))
def test_stationarity_counts_unchanged_states(run: Flown, bonus: float) -> None:
    """Each step in which a robot's whole state stays the same adds the stationarity reward."""
    problem = run.model.problem
    none = problem.replace(objective=problem.objective.replace(stationarity=0.0))
    some = problem.replace(objective=problem.objective.replace(stationarity=bonus))
    stays = sum(path[t] == path[t + 1] for path in run.plan.paths for t in range(problem.horizon))
    gain = check(some, run.plan).reward - check(none, run.plan).reward
    assert gain == pytest.approx(bonus * stays, rel=1e-9, abs=1e-9)


@examples(12)
@given(flown(TEAMS.map(without_goals)))
def test_start_counts_only_if_asked(run: Flown) -> None:
    """Counting the start adds the start's views, whatever is flown afterwards."""
    problem = run.model.problem
    late = problem.replace(objective=problem.objective.replace(count_start=False))
    early = problem.replace(objective=problem.objective.replace(count_start=True))
    without, with_ = check(late, run.plan), check(early, run.plan)
    assert without.reward_at_start == 0.0
    assert with_.reward_per_step == without.reward_per_step
    assert with_.reward == pytest.approx(without.reward + with_.reward_at_start, rel=1e-12)
    hover = Plan(paths=tuple((path[0],) * (problem.horizon + 1) for path in run.plan.paths))
    assert check(early, hover).reward_at_start == with_.reward_at_start


def hovering(problem: Problem) -> Plan:
    """All robots stay where they start."""
    return Plan(paths=tuple((r.start,) * (problem.horizon + 1) for r in problem.robots))


def test_weights_scale_their_faces() -> None:
    """A face's reward is its weight times the root of its pixels; weight 0 takes it out."""
    problem = tiny()
    plain = check(problem, hovering(problem))
    assert sum(value > 0 for value in plain.face_reward) >= 2
    weights = (0.0, 1.0, 2.5, 0.5, 0.0)
    actor = problem.actors[0].replace(weights=weights)
    weighted = check(problem.replace(actors=(actor,)), hovering(problem))
    expected = [w * value for w, value in zip(weights, plain.face_reward, strict=True)]
    assert weighted.face_reward == pytest.approx(expected, rel=1e-12)


@examples(12)
@given(flown(TEAMS.map(without_goals)))
def test_actor_without_weight_is_worth_nothing(run: Flown) -> None:
    """Actors whose faces all have weight 0 leave the rewards for moves only."""
    problem = run.model.problem
    worthless = tuple(
        actor.replace(weights=(0.0,) * len(actor.face_weights)) for actor in problem.actors
    )
    nobody = check(problem.replace(actors=()), run.plan)
    assert nobody.reward == nobody.reward_moves
    assert check(problem.replace(actors=worthless), run.plan).reward == nobody.reward


def test_view_sum_weights_are_zero_before_the_first_step() -> None:
    """The weights by view sum repeat the faces' weights at every step that counts."""
    problem = tiny()
    assert problem.view_sum_weights.tolist() == [0.0] * 5 + [1.0] * 10
    early = problem.replace(objective=Objective(count_start=True))
    assert early.view_sum_weights.tolist() == [1.0] * 15


def test_pixels_add_up_within_a_step_only() -> None:
    """Two robots that see one face share a root; one robot's steps do not."""
    problem = tiny()
    twins = problem.replace(robots=(problem.robots[1],) * 2, rules=problem.rules.replace(
        vertex=False, swap=False))  # fmt: skip
    alone = problem.replace(robots=(problem.robots[1],))
    both, one = check(twins, hovering(twins)), check(alone, hovering(alone))
    assert one.reward > 0
    assert both.reward == pytest.approx(math.sqrt(2) * one.reward, rel=1e-12)
    longer = alone.replace(
        horizon=2,
        actors=(alone.actors[0].replace(poses=np.tile(alone.actors[0].poses[1], (3, 1))),),
    )
    first, second = check(longer, hovering(longer)).reward_per_step
    assert first == second > 0
