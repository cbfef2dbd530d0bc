"""The root of scenes with very many robots: cuts of robots that are alike, and masters late."""

from itertools import count, islice, pairwise, product
from types import SimpleNamespace

import hypothesis.strategies as st
import numpy as np
import pytest
from ascent import raised_mixtures
from brute_force import optimum
from counting import either
from hypothesis import given, reject
from pool import meetings, problems
from scipy import sparse
from scipy.optimize import linprog
from strategies import Calls, examples

from cocap_opt.formulations.certificates import Pricing, verify
from cocap_opt.formulations.certificates.envelope import Curve, Cut
from cocap_opt.formulations.certificates.format import MOST_WORK
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.column_generation.master.alike_cuts import _grown_multisets, alike_cut
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.master.pricing import Priced
from cocap_opt.formulations.column_generation.master.resource_use import roots_seen
from cocap_opt.formulations.column_generation.master.ruled_program import RuledProgram
from cocap_opt.formulations.column_generation.master.state_cuts import state_cut
from cocap_opt.formulations.column_generation.parameters import (
    DEFAULTS,
    LargeRootParameters,
    Parameters,
)
from cocap_opt.formulations.column_generation.primal.arc_search import ArcSearch
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.large_root import LargeRoot, _RuledAscent
from cocap_opt.formulations.column_generation.tree.relaxation import Relaxation
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.mixture_ascent import raised
from cocap_opt.model import PathCells, compiled
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.returns import Returns
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, LimitReached, never

# As a large scene, whose ascent ends with the first turn that does not close its whole gap.
AS_LARGE = Parameters(large_root=LargeRootParameters(many_robot_steps=0, least_closed=1.0))

some_problems = either(st.one_of(meetings(), problems(robots=[1, 2, 3])))
numbers = st.floats(0.05, 1.0)
OPTIMA = {"corridor": 15159.036848877447, "bottleneck": 54899.771720915975}  # of seed 0


@examples(60)
@given(st.lists(st.tuples(numbers, numbers), min_size=1, max_size=4), st.integers(1, 9))
def test_the_highest_multiset_grows_by_gains_alone(
    curve: list[tuple[float, float]], robots: int
) -> None:
    """Of the multisets that are gone through, the highest is as high as that of all corners."""
    roots, shares = np.array(sorted(dict(curve).items())).T
    values = roots * shares
    grown = _grown_multisets(roots**2, values, robots, DEFAULTS.alike_cuts.most_growing)
    constant = Cut.valid(0, {0: Curve(roots, values)}, (robots,)).constant
    assert grown is not None
    assert grown[1].max() == pytest.approx(constant, abs=1e-9)


@examples(40)
@given(st.lists(st.tuples(numbers, numbers), min_size=2, max_size=12), st.integers(12, 70))
def test_a_cut_of_robots_that_are_alike_is_valid_and_cuts(
    views: list[tuple[float, float]], robots: int
) -> None:
    """Its constant is what makes it valid, and it is below what was known at the mixture."""
    roots, amounts = np.array(views).T
    seen = Seen(np.zeros(len(roots), dtype=np.int64), roots, amounts)
    known = float(min(np.sqrt(amounts @ roots**2), amounts @ roots))
    cut = alike_cut(3, seen, 1.0, robots, known, 1e-4, DEFAULTS.alike_cuts)
    if cut is not None:
        assert seen.height(cut) < known
        assert Cut.valid(3, cut.curves, (robots,)).constant <= cut.constant + 1e-9


def uneven() -> tuple[Seen, float]:
    """Three roots of robots of one class, and the height of the known bounds at them."""
    roots, amounts = np.array([0.2, 0.5, 1.0]), np.array([0.5, 0.4, 0.6])
    known = float(min(np.sqrt(amounts @ roots**2), amounts @ roots))
    return Seen(np.zeros(3, dtype=np.int64), roots, amounts), known


@pytest.mark.parametrize(("robots", "breakpoints"), [(12, 3), (64, 3), (128, 2)])
def test_robots_that_are_alike_have_a_cut_if_a_certificate_may_have_breakpoints(
    robots: int, breakpoints: int
) -> None:
    """One for each root if there may be as many; with fewer, the cut still cuts."""
    seen, known = uneven()
    cut = alike_cut(0, seen, 1.0, robots, known, 1e-6, DEFAULTS.alike_cuts)
    assert cut is not None
    assert len(cut.curves[0].roots) == breakpoints
    assert seen.height(cut) < known - 5e-3


@pytest.mark.parametrize("robots", [128, 129, 256, 257, 999])
def test_cuts_have_no_more_breakpoints_than_a_certificate_may(robots: int) -> None:
    """However many robots there are; beyond 256 there is no cut, by either separation."""
    seen, known = uneven()
    for cut in (
        alike_cut(0, seen, 1.0, robots, known, 1e-6, DEFAULTS.alike_cuts),
        seen.best_cut(0, np.ones(1), (robots,), known, 1e-6),
    ):
        assert cut is None or robots * len(cut.curves[0].roots) <= MOST_WORK


def test_a_root_far_below_others_has_no_beta() -> None:
    """Of so small a beta nothing but rounding would be left, and kappa would be anything."""
    roots = np.array([[1.0], [1.0], [100.0]])
    base = SimpleNamespace(
        roots=sparse.csr_array(roots), pixels=sparse.csr_array(roots**2), weights=np.ones(1),
        bonus=np.zeros(3), returns=Returns(1, np.zeros(0)),
    )  # fmt: skip
    cut = Cut(0, {0: Curve(np.array([1.0, 100.0]), np.array([0.5, 99.5]))}, 0.5)
    along = [PathCells(0, (0,), ())] * 3
    program = RuledProgram(
        base, along, [cut], 1, sparse.csr_array((3, 0)), np.zeros(0), 1.0,
        DEFAULTS.ruled_ascent.least_share,
    )  # fmt: skip
    for amount in np.linspace(0.0, 1.0, 200):
        alpha, beta, shares, _ = program.multipliers(np.array([1.0, amount, 0.01]))
        left = 1.0 - float(shares[0]) - float(alpha[0])
        assert left <= 0.0 if beta[0] == 0.0 else beta[0] > 1e-12


@examples(10)
@given(some_problems)
def test_every_step_under_rules_gives_a_bound(problem: Problem) -> None:
    """The certificate of the best multipliers, with rows and cuts, bounds all plans."""
    search = Search(compiled(problem))
    if search.alone.bound == -np.inf or problem.objective.over_time:
        reject()
    mixture, _, first = next(raised_mixtures(search))
    relaxation = relaxation_of(search, first)
    ascent = _RuledAscent(relaxation, mixture)
    best = optimum(problem).value
    for _ in range(4):
        ascent.step()
        for priced in (ascent._priced, relaxation.best):
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
        reject()
    steps = islice(
        raised_mixtures(search),
        3,
    )
    columns = [column for _, _, priced in steps for column in priced.columns]
    arcs = ArcSearch(
        search.model, search.incumbent, columns, never, lambda: None, DEFAULTS.large_root
    )
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
    columns = next(raised_mixtures(search))[0].columns
    robots = np.array([column.robot for column in columns])
    amounts = np.full(len(robots), 0.5)
    with pytest.raises(LimitReached):
        raised(lambda at: at, robots, amounts, -np.inf, Calls(2), DEFAULTS.ascent)
    told: list[int] = []
    assert search.incumbent is not None
    arcs = ArcSearch(
        search.model, search.incumbent, columns, never, lambda: told.append(1), DEFAULTS.large_root
    )
    arcs.search(3, search.rng)
    assert len(told) == 3


@pytest.mark.parametrize("scene", ["corridor", "bottleneck"])
def test_moves_over_known_arcs_make_a_good_plan_of_hovering_drones(scene: str) -> None:
    """Twenty moves over the arcs of four pricings come within half a percent of the optimum."""
    search = Search(compiled(load_scene(scene, 0)))
    steps = islice(
        raised_mixtures(search),
        4,
    )
    columns = [column for _, _, priced in steps for column in priced.columns]
    assert search.incumbent is not None and search.value < 0.5 * OPTIMA[scene]
    arcs = ArcSearch(
        search.model, search.incumbent, columns, never, lambda: None, DEFAULTS.large_root
    )
    arcs.search(20, np.random.default_rng(0))
    plan = arcs.plan()
    assert plan is not None
    assert 0.995 * OPTIMA[scene] <= plan.value <= OPTIMA[scene] * (1 + 1e-9)


def relaxation_of(search: Search, best: Priced) -> Relaxation:
    """A relaxation with an empty master and the better of two bounds."""
    relaxation = Relaxation(search, Master(search.model, 2 * search.scale), search.alone)
    relaxation.offer(best)
    return relaxation


def large_root(scene: str, **parameters: float) -> LargeRoot:
    """The root of a scene after a first ascent, as if it were large."""
    changed = Parameters(large_root=LargeRootParameters(**parameters))  # type: ignore[arg-type]
    search = Search(compiled(load_scene(scene, 0)), parameters=changed)
    mixture, _, priced = next(raised_mixtures(search))
    relaxation = relaxation_of(search, priced)
    return LargeRoot(relaxation, mixture, lambda: search.cutoff(OPTIMALITY), rough=0.0)


@pytest.mark.slow
def test_plan_and_bound_come_near_in_turn() -> None:
    """The ascent lowers the bound before there are cuts, and cuts do after; the plan is optimal."""
    root = large_root("corridor")
    first = root.relaxation.best.bound
    root.begin()
    begun = root.relaxation.best.bound
    assert begun < first and not root.ascent.cuts
    root.solve()
    assert root.search.value == pytest.approx(OPTIMA["corridor"], rel=1e-9)
    assert OPTIMA["corridor"] <= root.relaxation.best.bound <= 1.0005 * OPTIMA["corridor"]
    assert root.relaxation.best.bound < begun and root.ascent.cuts and root.found


@pytest.mark.parametrize("least_closed", [0.0, 1.0])
def test_masters_take_over_once_the_ascent_closes_too_little(least_closed: float) -> None:
    """A turn that closes less than the given part of its gap is the ascent's last."""
    root = large_root("corridor", least_closed=least_closed)
    root.begin()
    for _ in range(4):
        before = root.relaxation.best.bound
        root._lower()
        assert OPTIMA["corridor"] <= root.relaxation.best.bound <= before
    assert (root.relaxation.iterations > 0) == (least_closed > 0)
    proved = root.relaxation.certificate("column-generation").proved
    assert proved == pytest.approx(root.relaxation.best.bound, rel=1e-9)


@pytest.mark.long
@pytest.mark.parametrize(
    ("owner", "name", "calls"),
    [
        (_RuledAscent, "step", 3),  # before there is a plan
        (_RuledAscent, "add_cuts", 0),
        (Relaxation, "step", 1),
        (ArcSearch, "_move", 4),
        (LargeRoot, "_respond", 0),
    ],
)
def test_a_limit_in_any_turn_leaves_the_bound_and_the_plan_so_far(
    owner: type, name: str, calls: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever kind of work it ends; what was proved by then is in the certificate."""
    problem, before, done = load_scene("corridor", 0), getattr(owner, name), count()
    bounds: list[float] = []

    def limited(self: object, *arguments: object) -> object:
        if next(done) >= calls:
            raise LimitReached(Limit.WORK)
        return before(self, *arguments)

    def noted(self: LargeRoot) -> None:
        told(self)
        bounds.append(self.relaxation.best.bound)

    told = LargeRoot._tell
    monkeypatch.setattr(LargeRoot, "_tell", noted)
    monkeypatch.setattr(owner, name, limited)
    result = branch_and_price(problem, parameters=AS_LARGE)
    assert result.limit is Limit.WORK
    assert result.certificate is not None
    assert verify(problem, result.certificate).bound == result.bound
    assert OPTIMA["corridor"] <= result.bound == pytest.approx(bounds[-1], rel=1e-9)
    assert result.bound < 1.01 * OPTIMA["corridor"]
    assert result.plan is not None
    assert check(problem, result.plan).reward == pytest.approx(result.value)
    assert result.value > 0.99 * OPTIMA["corridor"]


def test_moves_before_a_limit_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """The plan as the last whole move left it is offered, and its columns are known."""
    root, move, done = large_root("corridor"), ArcSearch._move, count()
    before = root.search.value

    def limited(self: ArcSearch, rng: np.random.Generator) -> None:
        if next(done) == 4:
            raise LimitReached(Limit.WORK)
        move(self, rng)

    monkeypatch.setattr(ArcSearch, "_move", limited)
    with pytest.raises(LimitReached):
        root._rearrange()
    assert root.search.value > 2 * before
    assert root.search.incumbent is not None
    assert {column.key for column in root.search.incumbent.columns} <= root.found.keys()


@pytest.mark.slow
@examples(8)
@given(some_problems)
def test_optima_are_the_same_if_masters_begin_late(problem: Problem) -> None:
    """Branch-and-price that treats a small scene as a large one proves the same optimum."""
    result = branch_and_price(problem, parameters=AS_LARGE)
    best = optimum(problem).value
    assert result.value == pytest.approx(best, rel=1e-6, abs=1e-6)
    assert result.bound >= best * (1 - 1e-9) - 1e-9


# -- state cuts ---------------------------------------------------------------------------------

cells_of_states = st.lists(
    st.lists(st.tuples(numbers, numbers), min_size=1, max_size=2), min_size=2, max_size=5
)


@examples(60)
@given(cells_of_states, st.floats(0.1, 0.9), st.floats(0.0, 0.2))
def test_the_search_for_a_state_cut_solves_its_packing_problem(
    by_cell: list[list[tuple[float, float]]], share: float, nearly: float
) -> None:
    """The cut's height at the mixture is the optimum over all sets of states, or nearly so."""
    pytest.importorskip("numba")
    from cocap_opt.formulations.column_generation.master.state_cut_kernel import tightest

    states = [(k, root**2, amount) for k, cell in enumerate(by_cell) for root, amount in cell]
    owners, pixels, amounts = (np.array(part) for part in zip(*states, strict=True))
    amounts /= np.bincount(owners, amounts)[owners]  # one robot in each cell
    touching = share * float(amounts @ pixels)
    first = np.searchsorted(owners, np.arange(len(by_cell) + 1))
    sets = [
        [state for state in chosen if state is not None]
        for chosen in product(*([None, *range(a, b)] for a, b in pairwise(first.tolist())))
    ]

    def root(seen: float) -> float:
        line = 0.5 * (touching + seen) / np.sqrt(touching)
        return float(line if seen < touching else np.sqrt(seen))

    gains = np.array([root(pixels[chosen].sum()) for chosen in sets])
    members = np.array([np.isin(np.arange(len(pixels)), chosen) for chosen in sets])
    found = linprog(-gains, np.vstack([members.T, np.ones(len(sets))]), np.append(amounts, 1.0))
    known = float(amounts @ np.sqrt(pixels))
    values = np.zeros(len(pixels))
    assert tightest(pixels, first, amounts, touching, known, 0.0, nearly, values)
    height = (gains - members @ values).max() + amounts @ values
    assert -found.fun - 1e-9 <= height <= -found.fun + nearly * max(known + found.fun, 0.0) + 1e-7
    assert (values >= 0).all()


@examples(10)
@given(some_problems)
def test_state_cuts_cut_off_mixtures_and_no_plan(problem: Problem) -> None:
    """A cut is lower than what is known at the mixture, and at no plan lower than its root."""
    pytest.importorskip("numba")
    search = Search(compiled(problem))
    if search.alone.bound == -np.inf or problem.objective.over_time or not problem.rules.vertex:
        reject()
    mixtures = [mixture for mixture, _, _ in islice(raised_mixtures(search), 3)]
    plan = optimum(problem).plan
    paths = () if plan is None else search.model.paths(plan)
    for view_sum, seen in roots_seen(mixtures[-1], problem):
        known = seen.known_height([])
        cut = state_cut(search.model, view_sum, seen, known, 0.0, DEFAULTS.state_cuts)
        if cut is None:
            continue
        assert seen.height(cut) < known
        at_plan = Mixture(
            [Column.of(search.model, robot, path) for robot, path in enumerate(paths)],
            np.ones(len(paths)),
        )
        for other, at in roots_seen(at_plan, problem):
            if other == view_sum:
                assert at.height(cut) >= np.sqrt((at.roots**2).sum()) - 1e-9
