"""Recombination: the best plan along the states of several plans."""

from dataclasses import replace
from itertools import count, islice, product

import numpy as np
import pytest
from brute_force import all_paths, pixels_of, views_of
from hypothesis import given, reject
from hypothesis import strategies as st
from pool import meetings, problems
from random_certificates import random_narrowing
from strategies import Calls, examples, tiny

from cocap_opt.formulations.certificates.staged import Narrowing, NotEndedError
from cocap_opt.formulations.certificates.staged.joint_paths import BestPlan
from cocap_opt.formulations.column_generation.parameters import DEFAULTS, RecombinationParameters
from cocap_opt.formulations.column_generation.primal import recombination
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.recombination import Recombination
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Objective, Plan, Problem
from cocap_opt.referee import _Referee, check
from cocap_opt.stop import Limit, LimitReached


def some_plans(model: Model, rng: np.random.Generator, most: int = 4) -> list[Incumbent]:
    """Plans of a small problem that obey the rules, drawn at random; some may be equal."""
    problem = model.problem
    paths = [all_paths(problem, robot) for robot in range(len(problem.robots))]
    if not all(paths):
        return []
    drawn = (
        Incumbent.of_plan(
            model, Plan(paths=tuple(own[int(rng.integers(len(own)))] for own in paths))
        )
        for _ in range(60)
    )
    return list(islice((plan for plan in drawn if plan is not None), most))


def best_along(problem: Problem, plans: list[Incumbent], model: Model) -> float:
    """J of the best plan along the states of some plans; robots of a class share them."""
    visited = [
        {
            (t, state)
            for plan in plans
            for robot in model.class_of[own].robots
            for t, state in enumerate(plan.paths[robot])
        }
        for own in range(len(problem.robots))
    ]
    paths = [
        [
            path
            for path in all_paths(problem, robot)
            if all(
                (t, model.class_of[robot].graph.index(state)) in visited[robot]
                for t, state in enumerate(path)
            )
        ]
        for robot in range(len(problem.robots))
    ]
    pixels = [pixels_of(problem, robot, own) for robot, own in enumerate(paths)]
    numbers = [*product(*(range(len(own)) for own in paths))]
    seen = [
        np.sum([own[k] for own, k in zip(pixels, some, strict=True)], axis=0) for some in numbers
    ]
    values = views_of(problem, np.array(seen))
    referee = _Referee(problem)  # rewards are in `values`, so no verdict is needed
    for n in np.argsort(-values).tolist():
        plan = Plan(paths=tuple(own[k] for own, k in zip(paths, numbers[n], strict=True)))
        if not referee.violations(plan) and not referee.conflicts(plan):
            return float(values[n])
    raise AssertionError("some of the plans obey the rules")


def known(plans: list[Incumbent]) -> Recombination:
    """A recombination of some plans."""
    found = Recombination(DEFAULTS.recombination)
    for plan in plans:
        found.add(plan)
    return found


@pytest.fixture
def drawn() -> tuple[list[Incumbent], Narrowing]:
    """Plans of the tiny scene, and what is left above the first of them."""
    rng, model = np.random.default_rng(0), compiled(tiny())
    plans = some_plans(model, rng, 12)
    return plans, random_narrowing(model, plans[0].value - 1, rng)


@examples(40)
@given(
    st.one_of(problems(robots=[2, 3], most_plans=400), meetings(), meetings(team=3)),
    st.integers(0, 10**9),
    st.sampled_from([1, 4]),
)
def test_the_best_plan_along_the_states_of_several_is_found(
    problem: Problem, seed: int, first_plans: int
) -> None:
    """By enumeration, there is none that is better, however many are taken at first."""
    rng, problem = np.random.default_rng(seed), problem.replace(objective=Objective())
    model = compiled(problem)
    plans = some_plans(model, rng)
    if len(plans) < 2:
        reject()
    first = plans[0]
    narrowing = random_narrowing(model, first.value - 1, rng)
    parameters = RecombinationParameters(first_plans=first_plans)
    found = replace(known(plans), parameters=parameters)
    better = [*found.better_plans(first, narrowing)]
    values = [first.value, *(plan.value for plan in better)]
    assert values == sorted(set(values))
    assert values[-1] == pytest.approx(best_along(problem, plans, model))
    assert all(check(problem, model.plan(plan.paths)).valid for plan in better)


def test_more_and_more_plans_are_taken_and_none_twice(
    drawn: tuple[list[Incumbent], Narrowing], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice as many each time; what has ended is not begun again."""
    plans, narrowing = drawn
    asked = count()

    def nothing(narrowing: Narrowing, *_: object) -> BestPlan:
        next(asked)
        return BestPlan(narrowing, -np.inf)

    monkeypatch.setattr(recombination, "best_plan", nothing)
    found = known(plans)
    assert 8 < len(found.values) <= 16
    assert not [*found.better_plans(plans[0], narrowing)]
    assert not [*found.better_plans(plans[0], narrowing)]
    assert next(asked) == 3  # of 4, 8 and 16


def test_too_many_plans_are_tried_again_once_less_is_open(
    drawn: tuple[list[Incumbent], Narrowing], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not before, as it would fail again."""
    plans, narrowing = drawn
    asked = count()

    def failing(_: Narrowing, *__: object) -> BestPlan:
        next(asked)
        raise NotEndedError

    monkeypatch.setattr(recombination, "best_plan", failing)
    found, room = known(plans), narrowing.room_above(plans[0].value)
    for _ in range(2):
        assert not [*found.better_plans(plans[0], narrowing)]
    assert next(asked) == 1
    constants = narrowing.constants - 0.5 * room / len(narrowing.constants)
    narrowing = replace(narrowing, constants=constants)
    assert not [*found.better_plans(plans[0], narrowing)]
    assert next(asked) == 3


def test_a_better_plan_is_kept_where_a_limit_ends_the_next_recombination(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The search has it, though it does not end."""
    model = compiled(tiny())
    search = Search(model)
    plans = sorted(some_plans(model, np.random.default_rng(0), 12), key=lambda plan: plan.value)
    best, calls = plans[-1], count()
    search.incumbent = plans[0]
    search.recombination.values = {plan.paths: plan.value for plan in plans[:-1]}

    def limited(narrowing: Narrowing, *_: object) -> BestPlan:
        if next(calls):
            raise LimitReached(Limit.TIME)
        return BestPlan(narrowing, best.value, best.paths)

    monkeypatch.setattr(recombination, "best_plan", limited)
    narrowing = search.narrowing(search.alone.duals, search.value)
    assert narrowing is not None
    with pytest.raises(LimitReached):
        search.recombine(narrowing)
    assert search.incumbent is not None and search.incumbent.paths == best.paths


def test_the_best_plans_are_kept() -> None:
    """Once there are twice as many as are kept, the others are forgotten."""
    plan = some_plans(compiled(tiny()), np.random.default_rng(0))[0]
    found, most = Recombination(DEFAULTS.recombination), DEFAULTS.recombination.most_plans
    values = [float(k * 37 % 1000) for k in range(3 * most)]
    for k, value in enumerate(values):
        columns = [
            column._replace(along=column.along._replace(states=(*column.path[:-1], k)))
            for column in plan.columns
        ]
        changed = Incumbent(plan.model, tuple(columns))
        changed.__dict__["value"] = value
        found.add(changed)
    kept = sorted(found.values.values())
    assert len(kept) <= 2 * most
    assert kept[-most:] == sorted(values)[-most:]


def test_joint_states_must_decide_and_there_must_be_several_plans() -> None:
    """Where moves are rewarded, and of one plan alone, there is no recombination."""
    model = compiled(tiny())
    plans = some_plans(model, np.random.default_rng(0))
    assert known(plans).applies_to(model)
    assert not known(plans[:1]).applies_to(model)
    rewarded = compiled(tiny().replace(objective=Objective(stationarity=3.0)))
    assert not known(plans).applies_to(rewarded)


def test_recombination_keeps_to_its_limit(drawn: tuple[list[Incumbent], Narrowing]) -> None:
    """It is looked at before each recombination."""
    plans, narrowing = drawn
    with pytest.raises(LimitReached):
        next(known(plans).better_plans(plans[0], narrowing, Calls(0)))
