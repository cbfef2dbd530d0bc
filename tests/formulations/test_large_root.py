"""The root of scenes with very many robots: cuts of robots that are alike, and no masters."""

from itertools import islice
from types import SimpleNamespace

import hypothesis.strategies as st
import numpy as np
import pytest
from brute_force import optimum
from hypothesis import given
from pool import meetings, problems
from scipy import sparse
from strategies import Calls, examples

from cocap_opt.formulations.certificates import Curve, Cut, Pricing
from cocap_opt.formulations.certificates.format import MOST_WORK
from cocap_opt.formulations.column_generation import large_root
from cocap_opt.formulations.column_generation.alike_cuts import alike_cut, grown_multisets
from cocap_opt.formulations.column_generation.arc_search import ArcSearch
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.column_generation.mixture_ascent import (
    MixtureProgram,
    mixture_ascent,
)
from cocap_opt.formulations.column_generation.ruled_ascent import RuledAscent, _RuledProgram
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import LimitReached

some_problems = st.one_of(meetings(), problems(robots=[1, 2, 3]))
numbers = st.floats(0.05, 1.0)


@examples(60)
@given(st.lists(st.tuples(numbers, numbers), min_size=1, max_size=4), st.integers(1, 9))
def test_the_highest_multiset_grows_by_gains_alone(
    curve: list[tuple[float, float]], robots: int
) -> None:
    """Of the multisets that are gone through, the highest is as high as that of all corners."""
    roots, shares = np.array(sorted(dict(curve).items())).T
    values = roots * shares
    grown = grown_multisets(roots**2, values, robots)
    constant = Cut.valid(0, {0: Curve(roots, values)}, (robots,)).constant
    assert grown is not None
    assert grown.heights.max() == pytest.approx(constant, abs=1e-9)


@examples(40)
@given(st.lists(st.tuples(numbers, numbers), min_size=2, max_size=12), st.integers(12, 70))
def test_a_cut_of_robots_that_are_alike_is_valid_and_cuts(
    views: list[tuple[float, float]], robots: int
) -> None:
    """Its constant is what makes it valid, and it is below what was known at the mixture."""
    roots, amounts = np.array(views).T
    seen = Seen(np.zeros(len(roots), dtype=np.int64), roots, amounts)
    known = float(min(np.sqrt(amounts @ roots**2), amounts @ roots))
    cut = alike_cut(3, seen, 1.0, robots, known, 1e-4)
    if cut is not None:
        assert seen.height(cut) < known
        assert Cut.valid(3, cut.curves, (robots,)).constant <= cut.constant + 1e-9


@pytest.mark.parametrize("robots", [128, 129, 256, 257, 999])
def test_cuts_have_no_more_breakpoints_than_a_certificate_may(robots: int) -> None:
    """However many robots there are; beyond 256 there is no cut, by either separation."""
    roots, amounts = np.array([0.2, 0.5, 1.0]), np.array([0.5, 0.4, 0.6])
    seen = Seen(np.zeros(3, dtype=np.int64), roots, amounts)
    known = float(min(np.sqrt(amounts @ roots**2), amounts @ roots))
    for cut in (
        alike_cut(0, seen, 1.0, robots, known, 1e-6),
        seen.best_cut(0, np.ones(1), (robots,), known, 1e-6),
    ):
        assert cut is None or robots * len(cut.curves[0].roots) <= MOST_WORK


def test_a_root_far_below_others_has_no_beta() -> None:
    """Of so small a beta nothing but rounding would be left, and kappa would be anything."""
    roots = np.array([[1.0], [1.0], [100.0]])
    base = SimpleNamespace(
        roots=sparse.csr_array(roots), pixels=sparse.csr_array(roots**2), weights=np.ones(1),
        bonus=np.zeros(3),
    )  # fmt: skip
    cut = Cut(0, {0: Curve(np.array([1.0, 100.0]), np.array([0.5, 99.5]))}, 0.5)
    heights = sparse.csr_array(cut.phi(0, roots))
    program = _RuledProgram(base, [cut], np.zeros(0), 1.0, heights, sparse.csr_array((3, 0)))
    for amount in np.linspace(0.0, 1.0, 200):
        judged = program.judged(np.array([1.0, amount, 0.01]))
        left = 1.0 - float(judged.shares[0]) - float(judged.alpha[0])
        assert left <= 0.0 if judged.beta[0] == 0.0 else judged.beta[0] > 1e-12


@examples(10)
@given(some_problems)
def test_every_step_under_rules_gives_a_bound(problem: Problem) -> None:
    """The certificate of the best multipliers, with rows and cuts, bounds all plans."""
    search = Search(compiled(problem))
    if search.alone.bound == -np.inf or problem.objective.over_time:
        return
    first = next(mixture_ascent(search.model, search.pricer, search.alone))
    ascent = RuledAscent(search, first.mixture, first.priced)
    best = optimum(problem).value
    for _ in range(4):
        ascent.step()
        for priced in (ascent._priced, ascent.best):
            bound = Pricing.of(search.model, priced.duals.certificate(search.model)).bound
            assert bound == pytest.approx(priced.bound, rel=1e-9, abs=1e-6)
            assert bound >= best - 1e-6
        ascent.add_cuts()


@examples(10)
@given(some_problems)
def test_plans_over_known_arcs_obey_the_rules_and_get_no_worse(problem: Problem) -> None:
    """Moves lead from a plan to plans that the referee accepts, of no less J."""
    search = Search(compiled(problem))
    if search.alone.bound == -np.inf or search.incumbent is None or problem.objective.over_time:
        return
    steps = islice(mixture_ascent(search.model, search.pricer, search.alone), 3)
    columns = [column for step in steps for column in step.priced.columns]
    arcs = ArcSearch(search.model, search.incumbent, columns)
    arcs.search(5, np.random.default_rng(0))
    plan = arcs.plan()
    assert plan is not None
    assert plan.value >= search.value * (1 - 1e-9)
    verdict = check(problem, search.model.plan(plan.paths))
    assert verdict.valid
    assert verdict.reward == pytest.approx(plan.value, rel=1e-9, abs=1e-9)


def test_work_without_masters_asks_often_whether_to_stop() -> None:
    """Mixtures are raised, and plans changed, in steps; a large team's take tenths of a second."""
    search = Search(compiled(load_scene("corridor", 0)))
    first = next(mixture_ascent(search.model, search.pricer, search.alone))
    program = MixtureProgram(search.model, first.mixture.columns)
    raised = _RuledProgram(
        program, [], np.zeros(0), 1.0, *[sparse.csr_array((len(program.robots), 0))] * 2
    ).raised
    for raise_ in (program.raised, raised):
        stop = Calls(2)
        with pytest.raises(LimitReached):
            raise_(first.mixture.amounts, -np.inf, stop)
    told: list[int] = []
    assert search.incumbent is not None
    columns = first.mixture.columns
    arcs = ArcSearch(search.model, search.incumbent, columns, tell=lambda: told.append(1))
    arcs.search(3, search.rng)
    assert len(told) == 3


@examples(8)
@given(some_problems)
def test_optima_are_the_same_without_masters_at_first(problem: Problem) -> None:
    """Branch-and-price that treats a small scene as a large one proves the same optimum."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(large_root, "MANY_ROBOT_STEPS", 0)
        result = branch_and_price(problem)
    best = optimum(problem).value
    assert result.value == pytest.approx(best, rel=1e-6, abs=1e-6)
    assert result.bound >= best * (1 - 1e-9) - 1e-9
