"""Pools of columns: plans of known paths, and local search that starts from them."""

from itertools import chain, islice, product

import hypothesis.strategies as st
import numpy as np
import pytest
from ascent import raised_mixtures
from brute_force import optimum
from counting import either
from hypothesis import given, reject
from pool import meetings, problems
from strategies import Calls, examples

from cocap_opt.formulations.column_generation.parameters import DEFAULTS
from cocap_opt.formulations.column_generation.primal import local_search
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.local_search import LocalSearch, ResponseLimit
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.mixtures.column_pool import ColumnPool
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, compiled
from cocap_opt.objective import objective
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene

some_problems = either(st.one_of(meetings(), problems(robots=[2, 3], goals=False)))


def pooled(model: Model) -> tuple[ColumnPool, list[list[Column]]]:
    """A pool of the first columns that pricing brings, and these columns robot by robot."""
    search = Search(model)
    pool, own = ColumnPool(model), [{} for _ in model.problem.robots]
    if search.alone.bound > -np.inf:
        steps = islice(raised_mixtures(search), 3)
        for column, amount in chain.from_iterable(mixture.used() for mixture, _, _ in steps):
            pool.add(column, amount)
            own[column.robot][column.path] = column
    return pool, [[*columns.values()] for columns in own]


@examples(15)
@given(problem=some_problems)
def test_columns_are_worth_what_they_add_to_the_objective(problem: Problem) -> None:
    """State by state, the differences between columns are those of J beside the others' pixels."""
    model = compiled(problem)
    pool, own = pooled(model)
    if not all(own):
        reject()
    columns = [some[0] for some in own]
    others = problem.no_pixels()
    for column in columns[1:]:
        others[column.view_sums] += column.pixels
    worth = pool._choices()[0].worth(others)
    values = [
        objective(model, [column.path, *(one.path for one in columns[1:])]) for column in own[0]
    ]
    assert worth - worth[0] == pytest.approx(np.array(values) - values[0], abs=1e-6)


@examples(15)
@given(problem=some_problems)
def test_plans_of_a_pool_obey_the_rules_and_no_column_raises_them(problem: Problem) -> None:
    """Every draw is a plan that the referee accepts, whose J no robot can raise in the pool."""
    model = compiled(problem)
    pool, own = pooled(model)
    if not all(own):
        reject()
    for value, columns in islice(
        pool.drawn(np.random.default_rng(0), DEFAULTS.local_search.draws), 5
    ):
        verdict = check(problem, model.plan([column.path for column in columns]))
        assert verdict.valid
        assert verdict.reward == pytest.approx(value, rel=1e-9, abs=1e-9)
        assert value <= optimum(problem).value * (1 + 1e-9) + 1e-9
        for column in chain.from_iterable(own):
            paths = [column.path for column in columns]
            paths[column.robot] = column.path
            if check(problem, model.plan(paths)).valid:
                assert objective(model, paths) <= value * (1 + 1e-8) + 1e-9


@examples(15)
@given(problem=some_problems)
def test_ascent_never_lowers_a_plan(problem: Problem) -> None:
    """From any plan of a pool's columns it goes up, if anywhere, and stays within the rules."""
    model = compiled(problem)
    pool, own = pooled(model)
    for columns in islice(product(*own), 8):
        before = Incumbent.of(model, columns)
        if before is None:
            continue
        after = Incumbent.of(model, pool.ascended(columns)[1])
        assert after is not None
        assert after.value >= before.value * (1 - 1e-9)


@examples(10)
@given(problem=some_problems)
def test_local_search_from_a_mixture_is_a_plan_below_the_optimum(problem: Problem) -> None:
    """Its plan obeys the rules, is worth what it says, and no more than the optimum."""
    model = compiled(problem)
    _, own = pooled(model)
    columns = list(chain.from_iterable(own))
    amounts = np.array([1 / len(own[column.robot]) for column in columns])
    found = LocalSearch(model).from_mixture(Mixture(columns, amounts))
    if found is None:
        reject()
    verdict = check(problem, model.plan(found.paths))
    assert verdict.valid
    assert verdict.reward == pytest.approx(found.value, rel=1e-9, abs=1e-9)
    assert found.value <= optimum(problem).value * (1 + 1e-9) + 1e-9


@examples(30)
@given(problem=some_problems, calls=st.integers(0, 3), seed=st.integers(0, 10**9))
def test_a_rounding_that_is_stopped_is_completed_from_a_known_plan(
    problem: Problem, calls: int, seed: int
) -> None:
    """Whatever the mixture, all robots have paths that obey the rules."""
    model, rng = compiled(problem), np.random.default_rng(seed)
    known = LocalSearch(model).from_mixture(Mixture([], np.zeros(0)))
    if known is None:
        reject()
    _, own = pooled(model)
    columns = [column for column in chain.from_iterable(own) if rng.random() < 0.7]
    mixture = Mixture(columns, rng.random(len(columns)))
    found = LocalSearch(model, Calls(calls)).from_mixture(mixture, known)
    assert found is not None
    verdict = check(problem, model.plan(found.paths))
    assert verdict.valid and verdict.reward == pytest.approx(found.value, rel=1e-9, abs=1e-9)


def test_robots_whose_way_is_taken_have_that_of_the_known_plan() -> None:
    """One that must give up its column may be in the way of the next."""
    model = compiled(load_scene("tiny-queue", 0))
    _, own = pooled(model)
    known = Incumbent.of_plan(model, Plan.hovering(model.problem))
    assert known is not None
    number = 0
    for columns in product(*own):
        for left_out in range(len(own)):
            chosen = {one.robot: one for one in columns if one.robot != left_out}
            completed = local_search._completed(chosen, known, model.problem)
            assert Incumbent.of(model, completed) is not None
            assert completed[left_out] is known.columns[left_out]
            number += any(
                one is not chosen.get(one.robot) for one in completed if one.robot != left_out
            )
    assert number  # of cases in which a chosen column is given up


@pytest.mark.slow
def test_more_responses_find_no_worse_plans_and_each_is_told() -> None:
    """The course of local search does not depend on how long it may go on; it is never silent."""
    model = compiled(load_scene("bottleneck", 1))
    search = Search(model)
    *_, (mixture, _, _) = islice(raised_mixtures(search), 6)
    values = []
    for allowed in (1, 20, 60):
        allowance, told = ResponseLimit(allowed), []
        local = LocalSearch(model, allowance=allowance, tell=lambda told=told: told.append(1))
        found = local.from_mixture(mixture)
        assert found is not None
        values.append(found.value)
        assert len(told) >= allowed - max(allowance.left, 0)
    assert values == sorted(values)
