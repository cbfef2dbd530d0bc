import json
import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from itertools import combinations, count, product
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from brute_force import all_paths, bonus_of, objective_from_scratch, optimum
from counting import counting, either
from hypothesis import given, reject
from hypothesis import strategies as st
from joint_enumeration import does_count, joint_by_enumeration
from pool import meetings, problems
from random_certificates import (
    as_rows,
    random_multipliers,
    random_narrowing,
    random_prices,
    random_staged,
    some_model,
)
from strategies import Calls, examples, tiny

import cocap_opt as co
import cocap_opt.formulations.certificates.staged.stages as checker
import cocap_opt.formulations.column_generation.step_envelopes.step_searches as step_searches
from cocap_opt.compiling import functions, is_there
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import (
    CertificateError,
    CertificateFile,
    Multipliers,
    Row,
    Staged,
    UnfinishedError,
    verify,
)
from cocap_opt.formulations.certificates.checking import priced
from cocap_opt.formulations.certificates.format import Stage, StepConstant
from cocap_opt.formulations.certificates.resources import Cells, Moves
from cocap_opt.formulations.certificates.staged import (
    JointStates,
    Narrowing,
    NotEndedError,
    best_plan,
    best_plan_from,
    compiled_search,
    conflicts,
    may_be_used,
    most_profitable,
    move_searches,
)
from cocap_opt.formulations.certificates.staged import search as plain_search
from cocap_opt.formulations.certificates.staged.conflicts import Conflicts
from cocap_opt.formulations.certificates.staged.joint_paths import BestPlan
from cocap_opt.formulations.certificates.staged.move_searches import Choices, MoveSearches
from cocap_opt.formulations.certificates.staged.relaxation import Conditions, Relaxation
from cocap_opt.formulations.certificates.staged.search import MostProfitable, all_that_count
from cocap_opt.formulations.certificates.staged.stages import price_staged
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.column_generation.master.flow_paths import StartChoice, mixture_of_flow
from cocap_opt.formulations.column_generation.parameters import (
    BundleParameters,
    EnvelopeParameters,
    ListParameters,
    Parameters,
)
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.counting import (
    joint_states_left,
    states_left,
)
from cocap_opt.formulations.column_generation.step_envelopes.envelopes import step_envelopes
from cocap_opt.formulations.column_generation.step_envelopes.heights import Heights
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known
from cocap_opt.formulations.column_generation.step_envelopes.local_optima import (
    KERNEL as LOCAL_SEARCH,
)
from cocap_opt.formulations.column_generation.step_envelopes.local_optima import local_optima
from cocap_opt.formulations.column_generation.step_envelopes.price_bundle import PriceBundle
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.explanation import explain
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.formulations.result import OPTIMALITY, certify
from cocap_opt.formulations.second_opinion import SecondOpinion
from cocap_opt.mixtures.columns import Arc
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Objective, Plan, Problem, Views
from cocap_opt.referee import check
from cocap_opt.returns import Returns
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, LimitReached, Stop, never

ONLY_LISTS = EnvelopeParameters(
    few_states_left=0, most_states_left=0, most_states_of_few=0, stalled=0.0
)

seeds = st.integers(0, 10**9)
any_problem = either(st.one_of(problems(), meetings(), meetings(team=3)))
any_meeting = either(st.one_of(meetings(), meetings(team=3)))


def without_rewards(problem: Problem) -> Problem:
    """The same problem, whose moves are worth nothing."""
    objective = Objective(pixels=problem.objective.pixels, views=problem.objective.views)
    return problem.replace(objective=objective)


@pytest.mark.slow
@examples(20)
@given(any_problem, seeds)
def test_no_plan_is_worth_more_than_any_staged_certificate_proves(
    problem: Problem, seed: int
) -> None:
    """Whatever the prices and the target: optimum <= max(target, bound of what is left)."""
    rng, best = np.random.default_rng(seed), optimum(problem)
    model = some_model(problem, rng)
    value = best.value if math.isfinite(best.value) else 0.0
    for target in (value * 0.999 - 1e-3, value, float(rng.uniform(0, 1.2)) * value, -1.0):
        staged = random_staged(model, target, rng)
        pricing = price_staged(model, staged)
        assert pricing.bound >= max(target, best.value)
        if staged.paths_above is not None:  # all plans above it were tried
            most = max(staged.paths_above, best.value)
            assert pricing.bound <= most + 1e-9 * abs(most) + 2 * pricing.rounding + 1e-9


def test_the_searches_of_a_file_share_one_amount_of_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that needs more is not verified, which does not make it false."""
    model, steps = compiled(tiny()), list[int]()

    def noted(
        joint: JointStates, least: float, most_nodes: int, stop: Stop, plain: bool
    ) -> MostProfitable:
        assert most_nodes == checker.MOST_NODES - sum(steps)
        found = most_profitable(joint, least, most_nodes, stop, plain)
        steps.append(found.nodes)
        return found

    def trying(
        narrowing: Narrowing, from_step: int, most_nodes: int, stop: Stop, plain: bool
    ) -> BestPlan:
        assert most_nodes == checker.MOST_NODES - sum(steps)
        found = best_plan_from(narrowing, from_step, most_nodes, stop, plain)
        steps.append(found.nodes)
        return found

    monkeypatch.setattr(checker, "most_profitable", noted)
    monkeypatch.setattr(checker, "best_plan_from", trying)
    stage = Stage((), tuple(StepConstant(t, -100.0) for t in (1, 2)))
    multipliers = random_multipliers(model, np.random.default_rng(0))
    certificate = Staged(multipliers, -1.0, (stage, stage), -1.0)
    price_staged(model, certificate)
    assert len(steps) == 5 and min(steps) > 0
    total, first = sum(steps), steps[0]
    for most in (total, total - 1, first):
        steps.clear()
        monkeypatch.setattr(checker, "MOST_NODES", most)
        if most == total:
            price_staged(model, certificate)
            continue
        with pytest.raises(UnfinishedError, match=r"not verified: .* may still hold"):
            price_staged(model, certificate)


@pytest.mark.parametrize("calls", [0, 1])
def test_a_limit_of_time_leaves_a_file_unverified(calls: int) -> None:
    """What it claims may hold; it is neither said that it does nor that it does not."""
    certificate = branch_and_price(tiny()).certificate
    assert certificate is not None
    with pytest.raises(UnfinishedError, match=r"the limit \(time\) .* may still hold"):
        verify(tiny(), certificate, stop=Calls(calls))


@pytest.mark.slow
@examples(12)
@given(either(problems(most_plans=60)), seeds, st.floats(0, 1))
def test_plans_above_the_target_visit_only_states_that_are_left(
    problem: Problem, seed: int, share: float
) -> None:
    """Fixing closes no state of a plan above the target, and what counts has its joint states."""
    rng = np.random.default_rng(seed)
    paths = [all_paths(problem, robot) for robot in range(len(problem.robots))]
    plans = [Plan(paths=tuple(chosen)) for chosen in product(*paths)]
    plans = [plan for plan in plans if next(plan.conflicts(problem), None) is None]
    if not plans:
        reject()
    worths = [objective_from_scratch(problem, plan) for plan in plans]
    model = some_model(problem, rng)
    target = share * max(worths)
    narrowing = Narrowing.of(model, random_multipliers(model, rng), target).closed()
    for plan, worth in zip(plans, worths, strict=True):
        if worth <= target * (1 + 1e-9):
            continue
        states = model.paths(plan)
        for t in range(problem.horizon + 1):
            placed = [
                (number, states[robot][t])
                for number, robot_class in enumerate(model.classes)
                for robot in robot_class.robots
            ]
            assert all(narrowing.left[number][t, state] for number, state in placed)
            joint = narrowing.joint_states(t)
            at = list(zip(joint.class_of.tolist(), joint.states.tolist(), strict=True))
            assert does_count(joint, [at.index(one) for one in placed])


def random_joint_states(rng: np.random.Generator) -> JointStates:
    """Joint states of one to three classes of robots; the last of the faces may be counts."""
    sizes = tuple(rng.integers(1, 4, size=rng.integers(1, 4)).tolist())
    counts = rng.integers(1, 6, size=len(sizes))
    n, faces = int(counts.sum()), int(rng.integers(1, 6))
    pixels = rng.uniform(0, 50, (n, faces)) * (rng.random((n, faces)) < 0.6)
    n_roots = int(rng.integers(faces + 1)) if rng.integers(2) else faces
    pixels[:, n_roots:] = pixels[:, n_roots:] > 0
    caps = rng.integers(1, 4, faces - n_roots).astype(np.float64)
    places = int(rng.integers(1, n + 1))
    too_near = rng.random((places, places)) < 0.15
    too_near |= np.eye(places, dtype=np.bool_) & bool(rng.integers(2))  # the rule of vertices
    near = Conflicts(rng.integers(places, size=n), lambda: too_near | too_near.T)
    return JointStates(
        1, sizes, np.repeat(np.arange(len(sizes)), counts), np.arange(n), pixels,
        rng.uniform(0.5, 2, faces), Returns(n_roots, caps),
        rng.uniform(-1, 8, n), rng.uniform(-1, 8, n),
        float(rng.choice([-np.inf, -5.0, 0.0, 4.0])), near,
    )  # fmt: skip


@examples(20)
@given(counting(problems()), seeds)
def test_joint_states_are_worth_what_plans_are(problem: Problem, seed: int) -> None:
    """Faces and people whom drones see, at all steps, and the moves: together they are J."""
    rng, plan = np.random.default_rng(seed), optimum(problem).plan
    if plan is None:
        reject()
    model = some_model(problem, rng)
    narrowing = Narrowing.of(model, random_multipliers(model, rng), -1.0)
    numbers = {robot: k for k, robots in enumerate(model.classes) for robot in robots.robots}
    worth = sum(bonus_of(problem, path) for path in plan.paths)
    for t in range(problem.horizon + 1):
        joint = narrowing.joint_states(t)
        at = list(zip(joint.class_of.tolist(), joint.states.tolist(), strict=True))
        chosen = [at.index((numbers[i], path[t])) for i, path in enumerate(model.paths(plan))]
        worth += joint.worth(chosen)
        assert joint.worths(np.array([chosen])) == pytest.approx(joint.worth(chosen))
    assert worth == pytest.approx(objective_from_scratch(problem, plan), rel=1e-9, abs=1e-9)


@examples(40)
@given(counting(problems()), seeds)
def test_constants_of_multipliers_bound_the_most_profit(problem: Problem, seed: int) -> None:
    """At each step, of the faces and the people together; a search of some states agrees."""
    rng = np.random.default_rng(seed)
    model = some_model(problem, rng)
    narrowing = Narrowing.of(model, random_multipliers(model, rng), -1.0)
    whole = narrowing._prices.pixels.constant
    assert narrowing.constants.sum() == pytest.approx(whole)
    for t in range(problem.first_step, problem.horizon + 1):
        joint = narrowing.joint_states(t)
        some = np.sort(rng.permutation(len(joint.states))[:12])
        joint = replace(joint.part(some, -np.inf), ceilings=(), limits=())
        if any(not (joint.class_of == c).any() for c in range(len(joint.sizes))):
            continue
        every = [joint.reduced_profit(chosen) for chosen in joint_by_enumeration(joint)]
        highest = max(every, default=-np.inf)
        assert most_profitable(joint, -np.inf, 10**6).profit == pytest.approx(highest)
        assert highest <= narrowing.ceiling(t)


@examples(30)
@given(seeds)
def test_the_search_finds_the_highest_of_all_joint_states(seed: int) -> None:
    """The plain search agrees with enumeration, and collects all joint states that count."""
    joint = random_joint_states(np.random.default_rng(seed))
    every = joint_by_enumeration(joint)
    found, _ = all_that_count(joint, 10**6)
    assert sorted(tuple(sorted(chosen)) for chosen in found) == every
    best = most_profitable(joint, -np.inf, 10**6)
    assert best.profit == pytest.approx(max(map(joint.reduced_profit, every), default=-np.inf))
    assert tuple(sorted(best.positions)) in every or not every
    assert most_profitable(joint, best.profit + 1, 10**6).profit == best.profit + 1


def part_of(joint: JointStates, listed: IntArray) -> JointStates:
    """The joint states of some of the states, and of the faces that these see."""
    seen = (joint.pixels[listed] > 0).any(axis=0)
    return replace(
        joint, class_of=joint.class_of[listed], states=joint.states[listed],
        pixels=joint.pixels[np.ix_(listed, seen)], weights=joint.weights[seen],
        returns=joint.returns.part(np.flatnonzero(seen)),
        price=joint.price[listed], charge=joint.charge[listed],
        conflicts=joint.conflicts.part(listed),
    )  # fmt: skip


@examples(30)
@given(seeds)
def test_a_profit_is_the_same_whatever_else_is_listed(seed: int) -> None:
    """To the last bit, in any order, with other states and other faces beside."""
    rng = np.random.default_rng(seed)
    joint = random_joint_states(rng)
    chosen = rng.integers(len(joint.states), size=int(rng.integers(1, 12)))
    others = rng.random(len(joint.states)) < 0.5
    listed = np.union1d(chosen, np.flatnonzero(others))
    part, again = part_of(joint, listed), rng.permutation(np.searchsorted(listed, chosen))
    assert part.worth(again.tolist()) == joint.worth(chosen.tolist())
    assert part.reduced_profit(again.tolist()) == joint.reduced_profit(chosen.tolist())


@examples(30)
@given(seeds)
def test_a_part_of_the_states_has_no_joint_state_above_the_highest_of_all(seed: int) -> None:
    """Where many are as high but for rounding, a checker finds what a producer did, exactly."""
    rng, n = np.random.default_rng(seed), 7
    seen = rng.uniform(1, 50, n)
    around = np.array([np.roll(seen, k) for k in range(n)])  # which pairs see as much
    price = 10 * (1 + rng.integers(-3, 4, n) * 2.0**-52)
    joint = JointStates(
        1, (int(rng.integers(2, 5)),), np.zeros(n, dtype=np.int64), np.arange(n), around,
        np.ones(n), Returns(n, np.zeros(0)), price, np.zeros(n), -np.inf,
        Conflicts(np.arange(n), lambda: np.eye(n, dtype=np.bool_)),
    )  # fmt: skip
    most = most_profitable(joint, -np.inf, 10**6).profit
    for _ in range(10):
        listed = np.flatnonzero(rng.random(n) < 0.8)
        assert most_profitable(part_of(joint, listed), most, 10**6).profit == most


def with_ceilings(joint: JointStates, rng: np.random.Generator) -> JointStates:
    """The same joint states, with the ceilings that other prices make."""
    every, ceilings = joint_by_enumeration(joint), []
    for _ in range(int(rng.integers(1, 3))):
        more = rng.choice([-1.0, 0.0, 2.0, 5.0], len(joint.states)) + rng.normal(0, 1e-3)
        earlier = replace(joint, price=joint.price - more)
        most = max(map(earlier.reduced_profit, every), default=0.0)
        ceilings.append((most + 1e-9 + float(rng.choice([0.0, 3.0])), more))
    return replace(joint, ceilings=tuple(ceilings))


def with_limits(joint: JointStates, rng: np.random.Generator) -> JointStates:
    """The same joint states, with the limits that slacks make: `counts` does not know of them."""
    every, limits = joint_by_enumeration(joint), []
    for _ in range(int(rng.integers(1, 3))):
        slack = rng.choice([0.0, 1.0, 4.0, 20.0], len(joint.states)) + rng.normal(0, 1e-3)
        earlier = replace(joint, price=joint.charge - slack)
        most = max(map(earlier.reduced_profit, every), default=0.0)
        limits.append((most + 1e-9 + float(rng.choice([0.0, 3.0])), slack))
    return replace(joint, limits=tuple(limits))


@examples(30)
@given(seeds)
def test_limits_leave_out_what_slacks_forbid(seed: int) -> None:
    """A joint state of more slack than there is room for is left out, whatever it is worth."""
    rng = np.random.default_rng(seed)
    joint = replace(random_joint_states(rng), floor=0.0)
    slack, room = rng.uniform(0, 3, len(joint.states)), float(rng.uniform(0, 8))
    found, _ = all_that_count(replace(joint, limits=((room, slack),)), 10**6)
    every, _ = all_that_count(joint, 10**6)
    within = [chosen for chosen in every if slack[list(chosen)].sum() <= room]
    assert sorted(found) == sorted(within)


@pytest.mark.parametrize("with_bounds", [with_ceilings, with_limits])
@examples(30)
@given(seeds)
def test_ceilings_and_limits_leave_out_no_joint_state_that_counts(
    with_bounds: Callable[[JointStates, np.random.Generator], JointStates], seed: int
) -> None:
    """What earlier prices and slacks prove shortens the search and changes nothing it finds."""
    rng = np.random.default_rng(seed)
    joint = random_joint_states(rng)
    below = with_bounds(joint, rng)
    for least in (-np.inf, 0.0, 10.0):
        best = most_profitable(joint, least, 10**6)
        assert most_profitable(below, least, 10**6).profit == pytest.approx(best.profit)
    assert all_that_count(below, 10**6)[0] == all_that_count(joint, 10**6)[0]


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_the_compiled_search_finds_the_same() -> None:
    """The compiled search agrees with the plain one, however often it is interrupted."""
    rng = np.random.default_rng(0)
    for _ in range(40):
        joint = random_joint_states(rng)
        joint = with_ceilings(joint, rng) if rng.integers(2) else joint
        joint = with_limits(joint, rng) if rng.integers(2) else joint
        least = float(rng.choice([-np.inf, 0.0, 10.0]))
        plain = most_profitable(joint, least, 10**6, plain=True)
        compiled_ = plain_search._run_compiled(joint, least, 10**6, never)
        assert compiled_.best == pytest.approx(plain.profit)
        assert compiled_.nodes == plain.nodes
        if plain.positions:
            assert joint.reduced_profit(compiled_.positions) == pytest.approx(plain.profit)


@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@pytest.mark.long
def test_searches_take_what_they_are_compiled_for_ahead() -> None:
    """Other types or layouts of their arrays would compile them once more, in silence."""
    every: list[object] = []
    for kernel in (compiled_search.KERNEL, LOCAL_SEARCH):
        kernel.load()
        every += functions.kept_functions(kernel.functions)
    rng, narrowing = np.random.default_rng(0), open_narrowing(1)
    with functions.nothing_compiled(every), pytest.MonkeyPatch.context() as patch:
        for _ in range(5):
            joint = with_ceilings(random_joint_states(rng), rng)
            plain_search._run_compiled(joint, 0.0, 10**6, never)
            local_optima(joint, [], BundleParameters())
        patch.setattr(move_searches, "PLAIN_NODES", -1)
        patch.setattr(move_searches, "_NODES_AT_ONCE", 500)
        with pytest.raises(LimitReached):
            best_plan(narrowing, 10**9, Calls(5))


@pytest.mark.parametrize(
    "compiled_",
    [
        None,
        BundleParameters(),
        BundleParameters(full_starts=1, high_states=1),
        BundleParameters(few_robots=0, many_full_starts=1, many_high_states=1),
    ],
)
@examples(20)
@given(seeds)
def test_local_search_finds_joint_states_that_count_and_are_high(
    compiled_: BundleParameters | None, seed: int
) -> None:
    """None is higher than the highest; where all states are tried, no robot can raise one alone."""
    if compiled_ is not None and not is_there():
        pytest.skip("needs the extra [fast]")
    rng = np.random.default_rng(seed)
    joint = random_joint_states(rng)
    every = joint_by_enumeration(joint)
    starts = [list(every[k]) for k in rng.integers(len(every), size=3)] if every else []
    found = [tuple(team) for team in local_optima(joint, starts, compiled_).tolist()]
    assert set(found) <= set(every)
    if compiled_ is not None and every:
        assert found
    if compiled_ == BundleParameters():
        for team, k, state in product(found, range(sum(joint.sizes)), range(len(joint.states))):
            other = tuple(sorted((*team[:k], state, *team[k + 1 :])))
            if other in every:
                assert joint.reduced_profit(other) <= joint.reduced_profit(team) + 1e-6


@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@examples(5)
@given(any_meeting, seeds)
def test_plain_verification_compiles_nothing_and_finds_the_same(
    problem: Problem, seed: int
) -> None:
    """Not even where the compiled search is loaded, or searches are so long that it would be."""
    rng = np.random.default_rng(seed)
    model = some_model(problem, rng)
    staged = random_staged(model, 0.5 * max(optimum(problem).value, 0.0), rng)

    from cocap_opt.formulations.certificates.staged import search_kernel

    def refuse(*_: object) -> None:
        raise AssertionError("compiled")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(search_kernel.CompiledSearch, "of", refuse)
        for is_loaded in (False, True):
            patch.setattr(compiled_search.KERNEL, "is_loaded", is_loaded)
            patch.setattr(plain_search, "PLAIN_NODES", 0)
            patch.setattr(move_searches, "PLAIN_NODES", -1)
            bound = price_staged(model, staged, plain=True).bound
    assert price_staged(model, staged).bound == pytest.approx(bound, rel=1e-12)


@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_plain_verification_says_so_in_its_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The face passes it on to each bound, and tells of it."""
    problem, file = staged_result()
    monkeypatch.setattr(compiled_search.KERNEL, "is_loaded", True)
    asked = list[bool]()

    def noted(
        joint: JointStates, least: float, most: int, stop: Stop, plain: bool
    ) -> MostProfitable:
        asked.append(plain)
        return most_profitable(joint, least, most, stop, plain)

    monkeypatch.setattr(checker, "most_profitable", noted)
    for plain in (True, False):
        verified = co.verify(problem, file, plain=plain)
        assert verified.plain is plain and set(asked) == {plain}
        assert verified.bound == file.proved
        asked.clear()


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_stages_do_not_depend_on_what_is_compiled_already() -> None:
    """The same stages, whether the compiled search was loaded before or not."""
    stages = []
    for is_loaded in (False, True):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(compiled_search.KERNEL, "is_loaded", is_loaded)
            root = Root.of(Search(compiled(load_scene("bottleneck", 1))), OPTIMALITY)
            root.solve()
        assert root.search.spare is not None
        stages.append((root.search.spare, root.search.rng.bit_generator.state))
    assert stages[0] == stages[1]


def test_joint_states_may_be_more_than_a_float_can_count() -> None:
    """Of 200 robots with 5,000 states each at a step."""
    model = compiled(load_scene("tiny-share", 0))
    narrowing = Narrowing.of(model, random_multipliers(model, np.random.default_rng(0)), 0.0)
    narrowing = replace(
        narrowing,
        model=SimpleNamespace(problem=SimpleNamespace(first_step=1), class_sizes=(200,)),
        _sweeps=narrowing._sweeps._replace(left=[np.ones((2, 5000), dtype=np.bool_)]),
    )
    assert joint_states_left(narrowing) == math.comb(5199, 200)
    assert joint_states_left(narrowing) < math.inf


@examples(20)
@given(st.one_of(meetings(), meetings(team=3)))
def test_a_flow_is_split_into_paths_with_the_same_flow(problem: Problem) -> None:
    """The flow of two plans, each by half, is that of the paths into which it is split."""
    model = compiled(problem)
    best = optimum(problem).plan
    flow: Counter[Arc] = Counter()
    starting: Counter[StartChoice] = Counter()
    for plan in (best, Plan.hovering(problem)):
        incumbent = Incumbent.of_plan(model, plan)
        if incumbent is None:
            return
        for column in incumbent.columns:
            flow.update(dict.fromkeys(column.arcs, 0.5))
            number = column.along.class_number
            for k, (starts, robots) in enumerate(model.classes[number].start_sets):
                if column.robot in robots and len(starts) > 1:
                    starting[StartChoice(number, k, column.path[0])] += 0.5
    mixture, again = mixture_of_flow(model, flow, starting=starting), Counter[Arc]()
    for column, amount in mixture.used():
        again.update(dict.fromkeys(column.arcs, amount))
    assert dict(again) == pytest.approx(dict(flow))


def test_a_flow_that_runs_dry_gives_what_paths_there_are() -> None:
    """A robot that no flow takes to the end has no path; of another there may be a part only."""
    model = compiled(tiny())
    incumbent = Incumbent.of_plan(model, Plan.hovering(model.problem))
    assert incumbent is not None
    first, second = incumbent.columns
    whole = dict.fromkeys(first.arcs, 0.75) | dict.fromkeys(second.arcs, 1e-9)
    mixture = mixture_of_flow(model, whole)
    assert [(column.key, amount) for column, amount in mixture.used()] == [(first.key, 0.75)]
    ends_early = dict.fromkeys(first.arcs[:-1], 1.0) | dict.fromkeys(second.arcs, 1.0)
    mixture = mixture_of_flow(model, ends_early)
    assert [(column.key, amount) for column, amount in mixture.used()] == [(second.key, 1.0)]
    assert mixture_of_flow(model, {}).columns == []


def test_a_search_that_is_too_long_says_so() -> None:
    """A search gives no number where it has not gone through all joint states."""
    joint = random_joint_states(np.random.default_rng(1))
    with pytest.raises(NotEndedError):
        most_profitable(joint, -np.inf, 0)


@examples(60)
@given(seeds)
def test_what_a_relaxation_drops_does_not_matter(seed: int) -> None:
    """Every joint state that obeys all conditions keeps its states at each node on its way."""
    rng = np.random.default_rng(seed)
    joint = random_joint_states(rng)
    found = [chosen for chosen in joint_by_enumeration(joint) if joint.worth(chosen) > 0]
    profits = [joint.reduced_profit(chosen) for chosen in found]
    least = float(rng.choice([-np.inf, *profits]))
    raised = rng.uniform(0, 3, len(joint.states))
    lows = [joint.worth(chosen) - float(raised[list(chosen)].sum()) for chosen in found]
    ceiling = max([0.0, *profits]) + float(rng.uniform(0, 2)), rng.uniform(-1, 1, len(raised))
    payments = np.array([joint.price, raised, ceiling[1]])
    floor = min([0.0, *lows])
    for chosen, profit in zip(found, profits, strict=True):
        low = ceiling[0] - float(ceiling[1][list(chosen)].sum())
        if profit <= least + 0.01 or low <= least + 0.01:
            continue
        ways = rng.permutation(len(chosen))
        for k in range(len(chosen)):
            taken, left = [chosen[i] for i in ways[:k]], [chosen[i] for i in ways[k:]]
            classes = joint.class_of[taken]
            counts = tuple(n - int((classes == c).sum()) for c, n in enumerate(joint.sizes))
            every = np.arange(len(raised))
            able = ~joint.conflicts.between(np.array(taken, dtype=int)[:, None], every).any(axis=0)
            states = np.flatnonzero(able & (np.array(counts)[joint.class_of] > 0))
            conditions = Conditions(
                np.array([
                    joint.worth(taken) - least - joint.price[taken].sum(),
                    joint.worth(taken) - floor + 0.01 - raised[taken].sum(),
                    ceiling[0] - least - ceiling[1][taken].sum(),
                ]), payments,
            )  # fmt: skip
            seen = joint.pixels[taken].sum(axis=0)
            relaxation = Relaxation(joint, conditions, seen, counts, states)
            relaxation.run(rng.random(len(states)) * rng.integers(2))
            assert {*left} <= {*states[relaxation.kept].tolist()}


@pytest.mark.slow
@examples(30)
@given(any_problem, seeds)
def test_joint_value_iteration_finds_the_best_plan(problem: Problem, seed: int) -> None:
    """With a low target, it is the optimum, by a plan that obeys the rules."""
    rng = np.random.default_rng(seed)
    problem = without_rewards(problem)
    best = optimum(problem)
    if best.plan is None:
        reject()
    model = some_model(problem, rng)
    assert may_be_used(model)
    narrowing = random_narrowing(model, 0.9 * best.value - 1, rng)
    found = best_plan(narrowing, 10**6)
    assert best_plan(narrowing, found.nodes) == found
    if found.nodes:
        with pytest.raises(NotEndedError):
            best_plan(narrowing, found.nodes - 1)
    plan = model.plan(found.paths)
    verdict = check(problem, plan)
    assert verdict.valid
    assert verdict.reward == pytest.approx(found.value) == pytest.approx(best.value)


@examples(20)
@given(any_problem, seeds, st.sampled_from([0.0, 0.5, 0.95, 1.05]))
def test_plans_above_a_higher_target_are_tried(problem: Problem, seed: int, share: float) -> None:
    """If there is one, the best is found; if not, the bound is the target."""
    rng = np.random.default_rng(seed)
    problem = without_rewards(problem)
    best = optimum(problem)
    if best.plan is None:
        reject()
    model = some_model(problem, rng)
    narrowing = random_narrowing(model, 0.3 * best.value - 1, rng)
    target = narrowing.target + share * (best.value - narrowing.target)
    higher = narrowing.above(target)
    assert narrowing.target == 0.3 * best.value - 1
    assert all((a <= b).all() for a, b in zip(higher.left, narrowing.left, strict=True))
    found = best_plan(higher, 10**6)
    if share < 1:
        assert found.value == pytest.approx(best.value)
    else:
        assert not found.paths
        assert found.pricing.bound == pytest.approx(target)
    with pytest.raises(CertificateError, match="not below target"):
        narrowing.above(narrowing.target - 1)
    with pytest.raises(ValueError, match="does not hold for all plans"):
        _ = best_plan(narrowing.above(target, narrowing.left), 10**6).pricing


def test_a_narrowing_never_changes() -> None:
    """What is priced, searched and closed after it is nothing to it, nor to one it came from."""
    rng, model = np.random.default_rng(0), compiled(tiny())
    narrowing = Narrowing.of(model, random_multipliers(model, rng), -1.0).closed()
    names = ("constants", "move_constants", "rewards", "left", "slack")
    before = {name: np.array(getattr(narrowing, name)) for name in names}
    bound = narrowing.bound
    stage = Stage(random_prices(model, rng), (StepConstant(1, -100.0), StepConstant(2, -100.0)))
    higher = narrowing.above(-0.5).after(
        stage, lambda _, joint: most_profitable(joint, -100.0, 10**6).profit, lambda *_: 0.0
    )
    assert higher.constants.tolist() != before["constants"].tolist()
    for name in names:
        np.testing.assert_array_equal(getattr(narrowing, name), before[name])
    assert narrowing.bound == bound
    assert not narrowing.joint_states(1).ceilings and higher.joint_states(1).ceilings


def test_a_stage_proves_no_more_than_its_constants_and_searches() -> None:
    """New prices need a constant, and no search makes it less than what the stage says."""
    rng, model = np.random.default_rng(0), compiled(tiny())
    narrowing = Narrowing.of(model, random_multipliers(model, rng), -1.0).closed()
    prices = random_prices(model, rng)
    assert {step.t for step in prices} == {1, 2}
    with pytest.raises(CertificateError, match="stage: a step has payments but no constant"):
        narrowing.after(Stage(prices, (StepConstant(1, 10.0),)), lambda *_: 10.0, lambda *_: 10.0)
    constants = (StepConstant(1, 10.0), StepConstant(2, 20.0))
    after = narrowing.after(Stage(prices, constants), lambda *_: -math.inf, lambda *_: 0.0)
    assert after.constants[1:].tolist() == pytest.approx([10.0, 20.0])
    with pytest.raises(CertificateError, match=r"constants\[0\]: .* states remain at step 1"):
        narrowing.after(Stage(prices, constants), lambda *_: 0.0, lambda *_: 0.0, most_states=0)


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@examples(20)
@given(any_problem, seeds)
def test_compiled_searches_reach_the_same(problem: Problem, seed: int) -> None:
    """The same plan after as many nodes, wherever compiled searches take over."""
    rng = np.random.default_rng(seed)
    model = some_model(without_rewards(problem), rng)
    value = optimum(problem).value
    narrowing = random_narrowing(model, 0.5 * max(value, 0.0) - 1, rng)
    found = []
    for has_numba, plain_nodes in ((False, 0), (True, 20), (True, -1)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(compiled_search.KERNEL, "is_loaded", False)
            patch.setattr(functions, "is_there", lambda there=has_numba: there)
            patch.setattr(move_searches, "PLAIN_NODES", plain_nodes)
            patch.setattr(move_searches, "_NODES_AT_ONCE", 4)
            found.append(best_plan(narrowing, 10**6))
    assert found[0] == found[1] == found[2]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(move_searches, "PLAIN_NODES", -1)
        patch.setattr(move_searches, "_NODES_AT_ONCE", 4)
        assert best_plan(narrowing, found[0].nodes) == found[0]
        if found[0].nodes:
            with pytest.raises(NotEndedError):
                best_plan(narrowing, found[0].nodes - 1)


def open_narrowing(horizon: int) -> Narrowing:
    """Six drones, each with two dozen states after a step, all of which are left."""
    model = compiled(load_scene("field", 0).replace(horizon=horizon))
    shape = (model.problem.view_sum_steps, model.n_faces)
    multipliers = Multipliers(as_rows(np.ones(shape)), as_rows(np.ones(shape)))
    return Narrowing.of(model, multipliers, -1.0).closed()


@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_one_long_search_for_what_follows_looks_at_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many nodes the first joint state takes, limits are looked at between some of them."""
    from cocap_opt.formulations.certificates.staged.search_kernel import CompiledSearch

    compiled_search.KERNEL.load()  # which follows once
    follow, nodes = CompiledSearch.follow, list[int]()

    def noted(self: CompiledSearch, *arguments: object) -> object:
        found = follow(self, *arguments)
        nodes.append(self.nodes)
        return found

    monkeypatch.setattr(CompiledSearch, "follow", noted)
    monkeypatch.setattr(move_searches, "PLAIN_NODES", -1)
    monkeypatch.setattr(move_searches, "_NODES_AT_ONCE", 500)
    with pytest.raises(LimitReached):
        best_plan(open_narrowing(1), 10**9, Calls(5))
    assert nodes and set(nodes) == {500}


@pytest.mark.parametrize("is_compiled", [False, True])
def test_a_search_that_finds_too_much_ends_there(
    is_compiled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It does not go through all of the two hundred million joint states first."""
    if is_compiled and not is_there():
        pytest.skip("needs the extra [fast]")
    for module in (move_searches, plain_search):
        monkeypatch.setattr(module, "MOST_FOUND", 1000)
    monkeypatch.setattr(compiled_search.KERNEL, "is_loaded", is_compiled)
    monkeypatch.setattr(functions, "is_there", lambda: is_compiled)
    monkeypatch.setattr(move_searches, "_NODES_AT_ONCE", 600)
    stop = Calls()
    with pytest.raises(NotEndedError):
        best_plan(open_narrowing(1), 10**9, stop)
    assert stop.asked < 20


@pytest.mark.parametrize("rows", [1, 7])
def test_tables_of_conflicts_are_made_in_parts(rows: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same table, however many rows are computed at once."""
    narrowing = open_narrowing(2)
    whole = narrowing.joint_states(1).conflicts.too_near
    monkeypatch.setattr(conflicts, "_ROWS", rows)
    assert (narrowing.joint_states(1).conflicts.too_near == whole).all() and whole.any()


@examples(30)
@given(seeds)
def test_states_of_a_clique_are_of_one_class_and_conflict(seed: int) -> None:
    """Any two of them, and no number is that of two classes."""
    joint = random_joint_states(np.random.default_rng(seed))
    cliques = joint.cliques
    for k, s in combinations(range(len(cliques)), 2):
        if cliques[k] == cliques[s]:
            assert joint.class_of[k] == joint.class_of[s] and joint.conflicts.between(k, s)


@pytest.mark.parametrize("is_compiled", [False, True])
def test_what_rounding_may_have_made_too_low_is_followed(
    monkeypatch: pytest.MonkeyPatch, is_compiled: bool
) -> None:
    """Compiled or not, a joint state that lacks less than the margin to its floor is found."""
    if is_compiled and not is_there():
        pytest.skip("needs the extra [fast]")
    monkeypatch.setattr(compiled_search.KERNEL, "is_loaded", is_compiled)
    model = compiled(tiny()).disaggregated()
    starts = np.array([[one.starts[0][0] for one in model.classes]])
    heads_of = [partial(one.graph.successors, 0) for one in model.classes]
    choices = Choices.of(starts, heads_of)
    nothing = [np.zeros(len(some)) for some in choices.states]
    apart = choices.robots.tolist()
    joint = JointStates.of(model, 1, choices.states, nothing, nothing, -np.inf, apart=apart)
    highest = max(map(joint.worth, all_that_count(joint, 10**6)[0]))
    assert highest > 0
    for lacking, is_found in ((0.5, True), (2.0, False)):
        floors = np.array([highest + lacking * joint.margin])
        moves = list(MoveSearches(10**6).found(joint, choices, floors, never))
        assert [highest == joint.worth(heads[0]) for _, heads in moves] == [True] * is_found


@cache
def staged_result(counted: bool = False) -> tuple[Problem, CertificateFile]:
    """A tiny scene with a staged certificate of all kinds of stages; its person may be counted."""
    problem, rng = tiny(), np.random.default_rng(3)
    if counted:
        problem = problem.replace(objective=Objective(views=Views(weight=40.0)))
    model = compiled(problem)
    best = optimum(problem).value
    staged = replace_stages(random_staged(model, best, rng), model, rng)
    return problem, certify(problem, model, "step-envelopes", staged)


@pytest.mark.slow
def test_step_envelopes_can_be_asked_for_few_joint_states_only() -> None:
    """As many as multisets of the states that are left; where there are more, paths are tried."""
    problem = load_scene("bottleneck", 0).replace(horizon=5)
    search = Search(compiled(problem))
    search.use_start(branch_and_price(problem).plan)
    root = Root.of(search, OPTIMALITY)
    for column in search.alone.columns:
        root.relaxation.master.add(column)
    root.relaxation.solve(root.cutoff, until_cuts=True)
    duals = root.relaxation.best.duals
    certificate = duals.certificate(search.model)
    narrowing = Narrowing.of(search.model, certificate, search.value).closed()
    (robots,) = search.model.class_sizes
    joint = sum(math.comb(int(n) + robots - 1, robots) for n in states_left(narrowing)[1:])
    assert joint_states_left(narrowing) == joint > 0
    step_envelopes(search, duals, root.gap, (), joint - 1, tries_paths=False)
    assert search.spare is None
    step_envelopes(search, duals, root.gap, (), joint, tries_paths=False)
    assert search.spare is not None and search.spare.proved < root.relaxation.best.bound
    step_envelopes(search, duals, root.gap, (), joint - 1)
    assert search.is_proved(root.cutoff())


def replace_stages(staged: Staged, model: Model, rng: np.random.Generator) -> Staged:
    """The same certificate with two stages, of prices and constants."""
    steps = range(model.problem.first_step, model.problem.horizon + 1)
    constants = tuple(StepConstant(t, -1e3) for t in steps)
    stages = (Stage(constants=constants), Stage(random_prices(model, rng), constants))
    return msgspec.structs.replace(staged, stages=stages, paths_above=staged.target)


@pytest.mark.parametrize("counted", [False, True])
def test_staged_files_are_read_back_and_verified(counted: bool) -> None:
    """What is written is read back, and proves what it claims."""
    problem, file = staged_result(counted)
    content = msgspec.json.encode(file)
    again = msgspec.json.decode(content, type=CertificateFile)
    assert again == file
    assert verify(problem, again).bound == file.bound


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"target": math.inf}, "target: must be finite"),
        ({"stages": 0, "constants": 0, "t": 99}, "t: must be"),
        ({"stages": 0, "constants": 0, "constant": math.nan}, "constant: must be finite"),
        ({"stages": 1, "payments": 0, "t": -1}, "t: must be"),
        ({"stages": 1, "payments": 0, "robot_class": 7}, "robot_class: must be"),
        ({"stages": 1, "payments": 0, "payments ": []}, "payments: must hold a number"),
        ({"stages": 1, "payments": 0, "first payment": math.inf}, "payments: must be"),
        ({"stages": 1, "payments": 0, "others": math.nan}, "others: must be finite"),
        ({"stages": 1, "payments": 0, "first state": [99, 0, 0, 0, 0]}, "state: "),
        ({"stages": 1, "constants": []}, "a step has payments but no constant"),
        ({"paths_above": -1e9}, "paths_above: must be finite, and not below"),
        ({"paths_above": math.nan}, "paths_above: must be finite, and not below"),
        ({"paths_from": 0}, r"paths_from: must be 1\.\."),
        ({"paths_from": 99}, r"paths_from: must be 1\.\."),
        ({"paths_from": 1, "paths_above": None}, "paths_from: not allowed without paths_above"),
        ({"tails": [{"t": 1, "loss": 0.1}]}, "tails: not allowed together with paths_above"),
        (
            {"paths_above": None, "paths_from": None, "tails": [{"t": 99, "loss": 0.1}]},
            r"tails\[0\].t: must be 0\.\.",
        ),
        (
            {"paths_above": None, "paths_from": None, "tails": [{"t": 1, "loss": math.inf}]},
            r"tails\[0\].loss: must be finite",
        ),
    ],
)
def test_altered_staged_files_are_refused_in_words(change: dict, words: str) -> None:
    """Each field that is out of range is named."""
    problem, file = staged_result()
    plain = msgspec.to_builtins(file)
    inner = plain["certificate"]
    for key, value in change.items():
        if key in ("stages", "constants", "payments") and isinstance(value, int):
            inner = inner[key][value]
        elif key == "first payment":
            inner["payments"] = [value, *inner["payments"][1:]]
        elif key == "first state":
            inner["states"] = [value, *inner["states"][1:]]
        else:
            inner[key.strip()] = value
    with pytest.raises(CertificateError, match=words):
        verify(problem, msgspec.convert(plain, CertificateFile))


@pytest.mark.parametrize("views", [(), ((0.5,),), ((0.5, 0.5),) * 3, ((0.5,), (-0.5,), (0.5,))])
@pytest.mark.parametrize("counted", [False, True])
def test_stages_need_prices_of_just_those_who_count(
    counted: bool, views: tuple[tuple[float, ...], ...]
) -> None:
    """A price for each person at each step, at which each drone that sees them is paid."""
    problem, file = staged_result(counted)
    staged = file.certificate
    multipliers = msgspec.structs.replace(staged.multipliers, views=views)
    forged = msgspec.structs.replace(
        file, certificate=msgspec.structs.replace(staged, multipliers=multipliers)
    )
    if not (counted or views):
        assert verify(problem, forged).bound == file.bound
        return
    with pytest.raises(CertificateError, match=r"certificate\.views: must"):
        verify(problem, forged)


def test_stages_of_pixels_over_time_are_refused() -> None:
    """Also where people are counted, at each step."""
    for views in (None, Views()):
        model = compiled(tiny().replace(objective=Objective(over_time=True, views=views)))
        multipliers = random_multipliers(model, np.random.default_rng(0))
        with pytest.raises(CertificateError, match="must not be staged"):
            price_staged(model, Staged(multipliers, -1.0, ()))


@pytest.mark.parametrize("counted", [False, True])
@examples(20)
@given(seeds)
def test_altered_staged_files_prove_nothing_false(counted: bool, seed: int) -> None:
    """Numbers changed anywhere are refused, or still prove a bound."""
    rng = np.random.default_rng(seed)
    problem, file = staged_result(counted)
    best = optimum(problem).value
    plain = json.loads(msgspec.json.encode(file))
    places = list(numbers(plain["certificate"]))
    for _ in range(int(rng.integers(1, 4))):
        inner, key = places[int(rng.integers(len(places)))]
        old = inner[key]
        new = old + int(rng.integers(-2, 3)) if isinstance(old, int) else old * rng.normal(1, 3)
        inner[key] = new
    try:
        changed = msgspec.convert(plain, CertificateFile, strict=False)
        assert price_staged(compiled(problem), changed.certificate).bound >= best
    except (CertificateError, msgspec.ValidationError):
        pass


def numbers(content: object) -> "list[tuple[dict | list, object]]":
    """Places of all numbers in plain data."""
    items = (
        content.items() if isinstance(content, dict)
        else enumerate(content) if isinstance(content, list) else ()
    )  # fmt: skip
    found = []
    for key, value in items:
        if isinstance(value, int | float) and not isinstance(value, bool):
            found.append((content, key))
        found += numbers(value)
    return found


@examples(24)
@given(any_meeting)
def test_solutions_by_step_envelopes_are_optimal_and_explained(problem: Problem) -> None:
    """Branch-and-price finds the optimum; a staged certificate verifies, and its gap adds up."""
    result, best = branch_and_price(problem), optimum(problem)
    assert (result.plan is None) == (best.plan is None)
    file = result.certificate
    if not (isinstance(file, CertificateFile) and isinstance(file.certificate, Staged)):
        return
    pricing = verify(problem, file)
    assert best.value <= pricing.bound == file.proved
    reward = check(problem, result.plan).reward
    explanation = explain(compiled(problem), result.plan, reward, file, pricing.bound)
    assert explanation.total() == pytest.approx(file.proved - reward, abs=1e-9 * file.proved)
    second = SecondOpinion.of(compiled(problem), file)
    assert second.by == "cocap-check" and second.agrees(pricing)
    assert not second.agrees(pricing._replace(bound=pricing.bound * (1 - 1e-6) - 1e-6))


def stages_of(search: Search, duals: Duals) -> None:
    """Looks for step envelopes, without trials of paths."""
    step_envelopes(search, duals, OPTIMALITY, tries_paths=False)


@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@examples(20)
@given(any_meeting, st.sampled_from([0.3, 2.0]))
def test_short_lists_of_states_make_true_envelopes(problem: Problem, slack: float) -> None:
    """Where only states of little slack are searched, what is claimed is verified and true."""
    parameters = Parameters(envelopes=ONLY_LISTS, lists=ListParameters(slack=slack, mean=0.0))
    search = Search(compiled(problem), parameters=parameters)
    search.offer(search.local_search.from_mixture(Mixture([], np.zeros(0))))
    stages_of(search, search.alone.duals)
    if search.spare is None:
        reject()
    assert any(part.others for stage in search.spare.certificate.stages
               for part in stage.prices)  # fmt: skip
    pricing = verify(problem, search.spare, model=search.model)
    assert optimum(problem).value <= pricing.bound == search.spare.proved


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_a_stage_of_lists_has_the_constants_that_its_prices_are_meant_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Not lower ones, for which states off the lists would be paid more: it proves what was meant.

    They are those of the best prices; and where a search finds lower ones, they are kept.
    """
    run, find, kept = PriceBundle.run, Heights.find, []

    def meant_higher(self: PriceBundle, *arguments: object) -> FloatArray | None:
        prices = run(self, *arguments)
        if prices is not None:
            bound = sum(self.constants.values()) + self.priced.rest
            bound += self.priced.best_paths(prices, self.constants)[0]
            assert bound == pytest.approx(self.best, rel=1e-12)
        self.constants = {t: constant + 1.0 for t, constant in self.constants.items()}
        return prices

    def noted(heights: Heights, t: int, most: int) -> bool:
        has_ended: bool = find(heights, t, most)
        found = heights.adopted | heights.waiting
        if t in found:
            kept.append((found[t], heights.bundle.constants[t]))
        return has_ended

    monkeypatch.setattr(PriceBundle, "run", meant_higher)
    monkeypatch.setattr(Heights, "find", noted)
    model = compiled(load_scene("bottleneck", 0).replace(horizon=4))
    search = Search(model, parameters=Parameters(envelopes=ONLY_LISTS))
    search.offer(search.local_search.from_mixture(Mixture([], np.zeros(0))))
    stages_of(search, search.alone.duals)
    assert kept and all(height >= meant for height, meant in kept)
    assert any(height == meant for height, meant in kept)


@examples(6)
@given(any_meeting)
def test_what_a_search_finds_is_remembered_as_it_is(problem: Problem) -> None:
    """Joint states that are remembered count, with as many robots of each class as there are."""
    add, highest = Known.add, Known.highest

    def modest(self: Known, joint: JointStates) -> float:
        return highest(self, joint) - 1.0  # so that the search finds something

    def checked(self: Known, joint: JointStates, positions: Sequence[int]) -> bool:
        if positions:
            robots = np.bincount(joint.class_of[list(positions)], minlength=len(joint.sizes))
            assert tuple(robots) == joint.sizes
            assert does_count(joint, positions)
        return add(self, joint, positions)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Known, "add", checked)
        patch.setattr(Known, "highest", modest)
        search = Search(compiled(problem))
        search.offer(Incumbent.of_plan(search.model, Plan.hovering(problem)))
        stages_of(search, search.alone.duals)


def step_by_step(problem: Problem, listed: bool) -> Search:
    """A search that makes a stage for each height that lowers the bound."""
    each = {"nodes_of_stage": 0, "least_of_stage": 0.0}
    parts = replace(ONLY_LISTS, **each) if listed else EnvelopeParameters(**each)
    search = Search(compiled(problem), parameters=Parameters(envelopes=parts))
    search.offer(search.local_search.from_mixture(Mixture([], np.zeros(0))))
    stages_of(search, search.alone.duals)
    return search


@examples(20)
@given(any_meeting, st.booleans())
def test_stages_may_be_made_step_by_step(problem: Problem, listed: bool) -> None:
    """What is claimed is verified and true, if anything is."""
    search = step_by_step(problem, listed)
    if search.spare is not None:
        pricing = verify(problem, search.spare, model=search.model)
        assert optimum(problem).value <= pricing.bound == search.spare.proved


@pytest.mark.long
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@pytest.mark.parametrize("listed", [False, True])
def test_stages_made_step_by_step_lower_the_bound(listed: bool) -> None:
    """In a scene whose multipliers leave a gap; of lists, prices of states off them are raised."""
    problem = load_scene("bottleneck", 0).replace(horizon=4)
    search = step_by_step(problem, listed)
    assert search.spare is not None
    pricing = verify(problem, search.spare, model=search.model)
    assert search.value <= pricing.bound == search.spare.proved < search.alone.bound
    stages = search.spare.certificate.stages
    assert any(part.others for stage in stages for part in stage.prices) == listed


@pytest.mark.slow
def test_a_limit_among_constants_leaves_a_true_claim(monkeypatch: pytest.MonkeyPatch) -> None:
    """Constants that were lowered before a limit are in the file that claims what they prove."""
    problem = load_scene("bottleneck", 2)
    search = Search(compiled(problem))
    root = Root.of(search, OPTIMALITY)
    root.solve_aggregated()
    root.relaxation.round_to_plans()
    calls = count()

    def limited(joint: JointStates, least: float, most_nodes: int, stop: Stop) -> MostProfitable:
        if next(calls) == 3:
            raise LimitReached(Limit.WORK)
        return most_profitable(joint, least, most_nodes, stop)

    monkeypatch.setattr(step_searches, "most_profitable", limited)
    with pytest.raises(LimitReached):
        stages_of(search, root.relaxation.best.duals)
    monkeypatch.undo()
    assert search.spare is not None
    assert search.spare.proved < root.relaxation.best.bound
    assert verify(problem, search.spare, model=compiled(problem)).bound == search.spare.proved


@pytest.mark.parametrize("paths_above", [None, 1.0])
def test_numbers_too_large_prove_nothing(paths_above: float | None) -> None:
    """Infinite constants and prices are refused, though any target is below them."""
    problem = tiny()
    model, shape = compiled(problem), (problem.view_sum_steps, len(problem.face_weights))
    start = problem.cell(0, problem.robots[0].start)
    row = Row(Cells(0, (start,)), 1.7e308)
    for multipliers in (
        Multipliers(as_rows(np.zeros(shape)), as_rows(np.full(shape, 5e-324))),
        Multipliers(as_rows(np.ones(shape)), as_rows(np.ones(shape)), rows=(row, row)),
    ):
        for stages in ((), (Stage(),)):
            with pytest.raises(CertificateError, match="infinite"):
                price_staged(model, Staged(multipliers, 1.0, stages, paths_above))


def test_sums_that_overflow_prove_nothing_without_a_warning() -> None:
    """Prices whose sums along a path are infinite are refused in the file's words alone."""
    problem = tiny()
    model, shape = compiled(problem), (problem.view_sum_steps, len(problem.face_weights))
    start = problem.cell(0, problem.robots[0].start)
    moves = [(start, start._replace(x=x)) for x in range(3)]
    rows = [Row(Moves(t, (move,)), 8e307) for t in range(problem.horizon) for move in moves] * 2
    ones = as_rows(np.ones(shape))
    multipliers = Multipliers(ones, ones, rows=tuple(rows))
    with pytest.raises(CertificateError, match="infinite"):
        priced(model, Staged(multipliers, 1.0, (Stage(),)))


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_compiled_searches_end_within_as_many_nodes_as_plain_ones() -> None:
    """Of the nodes that a search takes one less is too few, for both; and it may be interrupted."""
    from cocap_opt.formulations.certificates.staged.search_kernel import CompiledSearch

    rng = np.random.default_rng(1)
    for _ in range(30):
        joint = random_joint_states(rng)
        whole = plain_search._run_compiled(joint, 0.0, 10**6, never)
        steps = CompiledSearch.of(joint, 0.0)
        while not steps.advance(1):
            pass
        assert (steps.best, steps.positions, steps.nodes) == (
            whole.best, whole.positions, whole.nodes,
        )  # fmt: skip
        assert plain_search._run_compiled(joint, 0.0, whole.nodes, never).best == whole.best
        for plain in (False, True):
            with pytest.raises(NotEndedError):
                most_profitable(joint, 0.0, whole.nodes - 1, plain=plain)
