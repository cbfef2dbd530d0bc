"""Recombination: the best plan along the states of several plans."""

from itertools import islice, product

import numpy as np
import pytest
from brute_force import all_paths, pixels_of, views_of
from hypothesis import given
from hypothesis import strategies as st
from pool import meetings, problems
from random_certificates import random_multipliers
from strategies import Calls, examples, tiny

from cocap_opt.formulations.certificates import Narrowing, NotEndedError
from cocap_opt.formulations.column_generation import recombination
from cocap_opt.formulations.column_generation.incumbent import Incumbent
from cocap_opt.formulations.column_generation.recombination import MOST_PLANS, Recombination
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Objective, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.stop import LimitReached


def some_plans(model: Model, rng: np.random.Generator, most: int = 4) -> list[Incumbent]:
    """Some plans of a small problem that obey the rules, drawn at random."""
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
    for n in np.argsort(-values).tolist():
        plan = Plan(paths=tuple(own[k] for own, k in zip(paths, numbers[n], strict=True)))
        if check(problem, plan).valid:
            return float(values[n])
    raise AssertionError("some of the plans obey the rules")


def narrowing_of(model: Model, value: float, rng: np.random.Generator) -> Narrowing:
    """What random multipliers leave above the J of a plan."""
    narrowing = Narrowing(model, random_multipliers(model, rng), value)
    narrowing.close_states()
    return narrowing


@examples(40)
@given(
    st.one_of(problems(robots=[2, 3], most_plans=400), meetings(), meetings(team=3)),
    st.integers(0, 10**9),
)
def test_the_best_plan_along_the_states_of_several_is_found(problem: Problem, seed: int) -> None:
    """By enumeration, there is none that is better."""
    rng, problem = np.random.default_rng(seed), problem.replace(objective=Objective())
    model = compiled(problem)
    plans = some_plans(model, rng)
    if not plans:
        return
    found = Recombination()
    for plan in plans:
        found.add(plan)
    first = plans[0]
    better = found.better(first, narrowing_of(model, first.value - 1, rng))
    best = first if better is None else better
    assert best.value == pytest.approx(best_along(problem, plans, model))
    assert better is None or check(problem, model.plan(better.paths)).valid


def test_it_is_not_done_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor again for too many plans, before less is open."""
    rng, model = np.random.default_rng(0), compiled(tiny())
    plans = some_plans(model, rng)
    found = Recombination()
    for plan in plans:
        found.add(plan)
    narrowing, asked = narrowing_of(model, plans[0].value - 1, rng), list[float]()
    best_plan = recombination.best_plan

    def asking(some: Narrowing, *args: object) -> object:
        asked.append(some.target)
        return best_plan(some, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(recombination, "best_plan", asking)
    best = found.better(plans[0], narrowing) or plans[0]
    assert len(asked) == 1
    assert found.better(best, narrowing) is None
    assert len(asked) == 1 + (best is not plans[0] and best.paths not in found.values)

    def failing(some: Narrowing, *_: object) -> object:
        asked.append(some.target)
        raise NotEndedError

    monkeypatch.setattr(recombination, "best_plan", failing)
    found, room = Recombination(), narrowing.room
    for plan in plans:
        found.add(plan)
    asked.clear()
    for number in (1, 2):
        for _ in range(2):
            assert found.better(plans[0], narrowing) is None
            assert len(asked) == number
        narrowing.constants -= 0.5 * room / len(narrowing.constants)


def test_the_best_plans_are_kept() -> None:
    """Where too many are found."""
    plan = some_plans(compiled(tiny()), np.random.default_rng(0))[0]
    found = Recombination()
    for k in range(3 * MOST_PLANS):
        columns = [
            column._replace(along=column.along._replace(states=(*column.path[:-1], k)))
            for column in plan.columns
        ]
        found.add(Incumbent(float(k % 100), tuple(columns)))
    assert MOST_PLANS <= len(found.values) <= 2 * MOST_PLANS
    assert max(found.values.values()) == 99.0
    kept = sorted(found.values.values())
    assert kept[-MOST_PLANS] >= 99 - MOST_PLANS


def test_it_is_left_out_where_joint_states_do_not_decide() -> None:
    """Where moves are rewarded, plans come from local search alone."""
    rng, model = np.random.default_rng(0), compiled(tiny().replace(
        objective=Objective(stationarity=3.0)
    ))  # fmt: skip
    plans = some_plans(model, rng)
    found = Recombination()
    for plan in plans:
        found.add(plan)
    assert found.better(plans[0], narrowing_of(model, plans[0].value - 1, rng)) is None


def test_it_keeps_to_its_limit() -> None:
    """As all that is long."""
    rng, model = np.random.default_rng(0), compiled(tiny())
    plans = some_plans(model, rng)
    found = Recombination()
    for plan in plans:
        found.add(plan)
    narrowing = narrowing_of(model, plans[0].value - 1, rng)
    with pytest.raises(LimitReached):
        found.better(plans[0], narrowing, Calls(0))
