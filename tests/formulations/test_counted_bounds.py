"""Bounds on scenes that count the drones that see people, and certificates that were altered."""

import math
from functools import cache

import msgspec
import numpy as np
import pytest
from brute_force import optimum
from counting import counting
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from random_certificates import random_multipliers, random_reference
from strategies import examples

from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates import CertificateError, EnvelopeCut, Multipliers, Pricing
from cocap_opt.formulations.certificates.checking import verify
from cocap_opt.formulations.simple_bounds import early_bound
from cocap_opt.model import Model, compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem, Views
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit

METHODS = dict(BOUNDS | EXACT)
QUICK = {"alone", "online", "brute-force"}  # of them, those that take no solver
COUNTED = counting(problems(over_time=True))


@cache
def counted() -> Problem:
    """The corridor, with its people counted."""
    problem = load_scene("corridor", 0)
    return problem.replace(objective=problem.objective.replace(views=Views(weight=50.0)))


@pytest.mark.parametrize("name", sorted(QUICK))
@examples(40)
@given(problem=COUNTED)
def test_bounds_are_no_less_than_the_optimum(name: str, problem: Problem) -> None:
    """Plan <= optimum <= bound, and the certificate proves what is claimed."""
    assert_bound(name, problem)


@pytest.mark.long
@pytest.mark.parametrize("name", sorted(METHODS.keys() - QUICK))
@examples(12)
@given(problem=COUNTED)
def test_bounds_by_solvers_are_no_less_than_the_optimum(name: str, problem: Problem) -> None:
    """The same, of methods that take longer."""
    assert_bound(name, problem)


def assert_bound(name: str, problem: Problem) -> None:
    """Plan <= optimum <= bound, and a plan that is called optimal is."""
    if METHODS[name].most_robots and len(problem.robots) > METHODS[name].most_robots:
        return
    best, result = optimum(problem).value, METHODS[name](problem)
    size = 1e-9 * (1 + abs(best)) if math.isfinite(best) else 0.0
    assert result.bound >= best - size
    if result.plan is not None:
        assert check(problem, result.plan).reward == pytest.approx(result.value, rel=1e-9, abs=1e-9)
        assert result.value <= best + size
    file = result.certificate
    if file is not None and file.bound is not None:
        assert verify(problem, file).bound >= best - size
    if METHODS[name].optimal and result.reason.value == "optimal":
        assert result.value == pytest.approx(best, rel=1e-4, abs=1e-6)


@examples(60)
@given(COUNTED, st.integers(0, 3))
def test_early_bounds_hold_with_part_of_the_coverage(problem: Problem, steps: int) -> None:
    """At steps that are not known all count whom a drone may have in its image."""
    best, bound = optimum(problem).value, early_bound(problem, Limit.TIME).bound
    assert bound >= best - 1e-9 * (1 + abs(best))
    compiled.cache_clear()
    assert early_bound(problem, Limit.TIME).bound >= best - 1e-9 * (1 + abs(best))


def test_a_plan_of_everything_is_worth_its_online_bound() -> None:
    """The online bound of a plan is no less than its J, and the gains at it are small."""
    problem = counted()
    plan = PLANNERS["cocap-rounds"](problem)
    online, alone = (BOUNDS[name](problem, start=plan.plan) for name in ("online", "alone"))
    assert plan.value <= online.bound <= alone.bound


def test_altered_views_are_refused() -> None:
    """Missing, of another shape, negative, or in a scene that counts nobody."""
    problem, rng = counted(), np.random.default_rng(0)
    model = Model(problem, use_cache=False)
    good = random_multipliers(model, rng)
    people = len(problem.actors)
    Pricing.of(model, good)
    negative = ((-1.0,) * people, *good.views[1:])
    infinite = ((math.inf,) * people, *good.views[1:])
    for views in ((), good.views[1:], ((),) * len(good.views), negative, infinite):
        for file in (good, random_reference(problem, rng)):
            with pytest.raises(CertificateError, match=r"certificate\.views: must"):
                Pricing.of(model, msgspec.structs.replace(file, views=views))
    plain = Model(load_scene("corridor", 0), use_cache=False)
    with pytest.raises(CertificateError, match=r"certificate\.views: must hold 0 rows"):
        Pricing.of(plain, good)


@pytest.mark.parametrize("beyond", [0, 1])
@pytest.mark.parametrize("t", [0, 3, 10**6])
def test_cuts_of_roots_are_refused_of_people(t: int, beyond: int) -> None:
    """A count has no cut, and none can be written: its faces end where people begin."""
    problem, rng = counted(), np.random.default_rng(0)
    model = Model(problem, use_cache=False)
    good: Multipliers = random_multipliers(model, rng)
    cut = EnvelopeCut(t, model.n_faces + beyond, (), 0.5)
    with pytest.raises(CertificateError, match="there is no view sum"):
        Pricing.of(model, msgspec.structs.replace(good, cuts=(cut,)))


def test_a_lower_price_of_views_never_proves_more_than_is_true() -> None:
    """Whatever is paid for views: the bound stays above J of a good plan."""
    problem = counted()
    model, plan = compiled(problem), PLANNERS["cocap-lns"](problem)
    rng = np.random.default_rng(1)
    good = random_multipliers(model, rng)
    for price in (0.0, 0.2, 0.5, 0.9, 1.0, 3.0):
        views = tuple((price,) * len(row) for row in good.views)
        assert Pricing.of(model, msgspec.structs.replace(good, views=views)).bound >= plan.value
