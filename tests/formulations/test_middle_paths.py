"""Joint paths explored from a step in the middle: the J of the best plan is that from the start."""

import math

import numpy as np
import pytest
from brute_force import optimum
from counting import either
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from random_certificates import random_multipliers, random_narrowing, some_model
from strategies import examples, tiny

from cocap_opt.compiling import is_there
from cocap_opt.formulations.certificates import CertificateError, Staged
from cocap_opt.formulations.certificates.staged import (
    NotEndedError,
    best_plan,
    best_plan_from,
    compiled_search,
    may_begin_later,
    move_searches,
    price_staged,
)
from cocap_opt.formulations.certificates.staged.reached import sorting_keys
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Objective, Problem
from cocap_opt.referee import check

seeds = st.integers(0, 10**9)
any_problem = either(st.one_of(problems(), meetings(), meetings(team=3)))


def usable(problem: Problem, rng: np.random.Generator) -> Model:
    """A model of the problem without rewards for moves, if paths may begin at a later step."""
    objective = Objective(pixels=problem.objective.pixels, views=problem.objective.views)
    model = some_model(problem.replace(objective=objective), rng)
    assume(may_begin_later(model))
    return model


@examples(40)
@given(any_problem, seeds)
def test_from_every_step_the_best_plan_is_found(problem: Problem, seed: int) -> None:
    """A valid plan with the optimal J; no plan is above a higher target."""
    rng = np.random.default_rng(seed)
    model = usable(problem, rng)
    best = optimum(model.problem)
    assume(best.plan is not None)
    narrowing = random_narrowing(model, 0.7 * best.value - 1, rng)
    higher = narrowing.above(max(best.value * 1.01 + 1e-6, narrowing.target))
    for middle in range(1, model.problem.horizon + 1):
        found = best_plan_from(narrowing, middle, 10**6)
        assert found.value == pytest.approx(best.value)
        assert found.value == pytest.approx(best_plan(narrowing, 10**6).value)
        verdict = check(model.problem, model.plan(found.paths))
        assert verdict.valid
        assert verdict.reward == pytest.approx(found.value)
        nothing = best_plan_from(higher, middle, 10**6)
        assert nothing.value == -math.inf and not nothing.paths
        assert nothing.pricing.bound >= best.value
        with pytest.raises(NotEndedError):
            best_plan_from(narrowing, middle, found.nodes - 1)


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@examples(20)
@given(any_problem, seeds)
def test_compiled_searches_reach_the_same(problem: Problem, seed: int) -> None:
    """The same plan after as many nodes as plain searches."""
    rng = np.random.default_rng(seed)
    model = usable(problem, rng)
    value = optimum(model.problem).value
    assume(value > -math.inf)
    narrowing = random_narrowing(model, 0.7 * value - 1, rng)
    middle = int(rng.integers(1, model.problem.horizon + 1))
    plain = best_plan_from(narrowing, middle, 10**6, plain=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_search.KERNEL, "is_loaded", False)
        patch.setattr(move_searches, "PLAIN_NODES", -1)
        patch.setattr(move_searches, "_NODES_AT_ONCE", 4)
        assert best_plan_from(narrowing, middle, 10**6) == plain


@given(st.integers(1, 6), st.integers(0, 40), st.sampled_from([1, 2, 40, 2**21, 2**62]), seeds)
def test_few_keys_order_joint_states_as_all_their_columns_do(
    robots: int, rows: int, most: int, seed: int
) -> None:
    """Also where one key of 64 bits does not hold them all."""
    rng = np.random.default_rng(seed)
    placed = rng.integers(most, size=(rows, robots))
    keys = sorting_keys(placed)
    assert (np.lexsort(keys) == np.lexsort(placed.T)).all()
    assert len(keys) <= (robots if most > 40 else 1)
    alike = np.all([key[:, None] == key for key in keys], axis=0)
    assert (alike == (placed[:, None] == placed).all(axis=-1)).all()


def test_starts_must_be_fixed_and_joint_states_determine_j() -> None:
    """Otherwise paths may not begin at a later step, and a file that says so is rejected."""
    rng, problem = np.random.default_rng(0), tiny()
    first, second = problem.robots
    starts = [first.start, first.start._replace(heading=1)]
    free = problem.replace(robots=(first.replace(start=starts), second))
    rewarded = problem.replace(objective=Objective(keep_cell=1.0))
    for other, message in ((rewarded, "if moves are rewarded"), (free, "if starts are free")):
        model = compiled(other)
        assert not may_begin_later(model)
        with pytest.raises(ValueError, match=message):
            best_plan_from(random_narrowing(model, -1.0, rng), 1, 100)
        numbers = Staged(random_multipliers(model, rng), -1.0, (), -1.0, 1)
        with pytest.raises(CertificateError, match=r"paths_(from|above): not allowed"):
            price_staged(model, numbers)
