"""Tests of tails: what plans lose at their latest steps, its search, and files that claim it."""

import msgspec
import numpy as np
import pytest
from brute_force import optimum
from counting import either
from hypothesis import assume, given
from hypothesis import strategies as st
from joint_enumeration import joint_by_enumeration
from random_certificates import random_multipliers
from roots import solved_root
from strategies import Calls, drawn_meetings, drawn_problems, examples

from cocap_opt.compiling import is_there
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import CertificateFile, Staged, verify
from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    Tails,
    compiled_search,
    first_tail,
    may_be_used,
    move_searches,
)
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.reached import Reached
from cocap_opt.formulations.certificates.staged.tails import LeastLoss
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.column_generation.parameters import DEFAULTS
from cocap_opt.formulations.column_generation.step_envelopes.envelopes import step_envelopes
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.step_envelopes.tail_beginnings import Beginnings
from cocap_opt.formulations.column_generation.step_envelopes.tail_search import TailSearch
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.model import compiled
from cocap_opt.problem import COVERAGE_VERSION, Objective, Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import LimitReached, never

MANY = 10**6


def narrowing_of(problem: Problem, below: float, seed: int) -> Narrowing:
    """What random multipliers leave of plans above a target below the optimum."""
    best, model = optimum(problem).value, compiled(problem)
    assume(np.isfinite(best) and may_be_used(model))
    numbers = random_multipliers(model, np.random.default_rng(seed))
    return Narrowing.of(model, numbers, best - below * (1 + abs(best))).closed()


def without_rewards(problem: Problem) -> Problem:
    """The same problem, whose moves are worth nothing."""
    objective = Objective(pixels=problem.objective.pixels, views=problem.objective.views)
    return problem.replace(objective=objective)


@examples(40)
@given(
    st.one_of(either(drawn_problems()), drawn_meetings(3)),
    st.sampled_from([0.01, 0.1, 0.5]),
    st.integers(0, 10**9),
)
def test_the_least_loss_of_whole_plans_is_that_of_the_best_plan(
    problem: Problem, below: float, seed: int
) -> None:
    """Whether shorter tails are known or not; longer tails lose no less, and no plan loses less."""
    problem = without_rewards(problem)
    narrowing = narrowing_of(problem, below, seed)
    best, rounding = optimum(problem).value, 8 * narrowing.rounding + 1e-9
    lost = narrowing.bound_of_steps - best
    tails = Tails.of(narrowing)
    for t in range(problem.horizon, first_tail(narrowing.model) - 1, -1):
        alone = Tails.of(narrowing).least_loss(t, 1e6, MANY)
        found = tails.least_loss(t, 1e6, MANY)
        assert found.loss == pytest.approx(alone.loss, abs=rounding)
        assert tails.losses[t + 1] <= found.loss <= lost + rounding
        tails = tails.longer(t, found.loss)
        assert tails.pricing.bound >= best - 1e-12 * abs(best)
    if not first_tail(narrowing.model):
        assert found.loss == pytest.approx(lost, abs=rounding)
        verdict = check(problem, narrowing.model.plan(found.paths))
        assert verdict.valid and verdict.reward == pytest.approx(best)


@examples(40)
@given(st.one_of(either(drawn_problems()), drawn_meetings(3)), st.integers(0, 10**9))
def test_the_least_loss_of_the_last_step_is_that_of_its_best_joint_state(
    problem: Problem, seed: int
) -> None:
    """Whichever is found first, and whether all beginnings are known or only those needed."""
    narrowing = narrowing_of(without_rewards(problem), 0.5, seed)
    t, tails = problem.horizon, Tails.of(narrowing)
    joint = narrowing.joint_states(t)
    to_go = np.array(
        [
            narrowing.to_go[number][t, state]
            for number, state in zip(joint.class_of, joint.states, strict=True)
        ]
    )
    # Rows are a loss where no robot takes the state for which they pay.
    most = narrowing.constants[t] + sum(y for step, y in narrowing.row_multipliers if step == t)
    losses = [
        most - joint.worth(team) + to_go[list(team)].sum() for team in joint_by_enumeration(joint)
    ]
    least, rounding = min(losses, default=np.inf), 8 * narrowing.rounding + 1e-9
    known = tails.beginnings(t, 1e6, MoveSearches(MANY))
    for loss in (1e6, 2 * least, 0.5 * least):
        expected = pytest.approx(min(max(least, 0.0), loss), abs=rounding)
        assert tails.least_loss(t, loss, MANY).loss == expected
        assert tails.least_loss(t, loss, MANY, known=known).loss == expected


def assert_all_begin(problem: Problem, seed: int, share: float, nodes: int) -> None:
    """All joint states that lose less than an amount are found, however few nodes searches take;
    with enough nodes, the amount is the one asked for. States that lose just that amount may be.
    """
    narrowing = narrowing_of(without_rewards(problem), 0.5, seed)
    tails, found = Tails.of(narrowing), Beginnings()
    t, alone = problem.horizon, share * tails.most
    for most_nodes in (nodes, 2 * nodes, MANY):
        found.extend(tails, t, alone, most_nodes, DEFAULTS.tails, never)
        if found.reached is None:
            continue
        placed = {tuple(sorted(row)) for row in found.reached.placed.tolist()}
        less = found.alone - 4 * narrowing.rounding
        expected = tails.beginnings(t, less, MoveSearches(MANY)).placed.tolist()
        assert placed >= {tuple(sorted(row)) for row in expected}
    assert found.alone >= alone


beginnings = given(
    st.one_of(either(drawn_problems()), drawn_meetings(3)),
    st.integers(0, 10**9),
    st.floats(DEFAULTS.tails.first_loss, 1.0),
    st.integers(1, 200),
)


@examples(40)
@beginnings
def test_beginnings_are_all_joint_states_that_lose_less_than_an_amount(
    problem: Problem, seed: int, share: float, nodes: int
) -> None:
    """The amount that the search ended with."""
    assert_all_begin(problem, seed, share, nodes)


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@examples(40)
@beginnings
def test_compiled_searches_find_all_beginnings(
    problem: Problem, seed: int, share: float, nodes: int
) -> None:
    """Whose floor rises while they run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(compiled_search.KERNEL, "is_loaded", False)
        patch.setattr(move_searches, "PLAIN_NODES", -1)
        patch.setattr(move_searches, "_NODES_AT_ONCE", 4)
        assert_all_begin(problem, seed, share, nodes)


@examples(20)
@given(either(drawn_problems()), st.integers(0, 10**9), st.floats(0.0, 2.0))
def test_no_more_is_claimed_than_was_explored(problem: Problem, seed: int, loss: float) -> None:
    """The loss found is the one asked for, or less where a tail loses less."""
    narrowing = narrowing_of(without_rewards(problem), 0.1, seed)
    for t in range(problem.horizon, first_tail(narrowing.model) - 1, -1):
        least = Tails.of(narrowing).least_loss(t, 1e6, MANY).loss
        found = Tails.of(narrowing).least_loss(t, loss, MANY).loss
        rounding = 8 * narrowing.rounding + 1e-9
        assert found == pytest.approx(min(loss, max(least, 0.0)), abs=rounding)


def proved(root: Root) -> Stages:
    """No stages, only the states that multipliers leave."""
    narrowing = root.search.narrowing(root.relaxation.best.duals, root.search.value)
    assert narrowing is not None
    return Stages(narrowing)


def claimed(root: Root, tails: TailSearch) -> CertificateFile:
    """The file of the tails that a search has proved."""
    assert tails.best is not None
    problem = root.search.model.problem
    numbers = root.relaxation.best.duals.certificate(root.search.model)
    return CertificateFile(
        scene=problem.name, digest=problem_digest(problem), method="test", classes="alike",
        coverage_version=COVERAGE_VERSION, bound=tails.bound,
        certificate=Staged(
            numbers, root.search.value, tails.best.stages, tails=tails.best.tails
        ),
    )  # fmt: skip


def test_what_tails_prove_is_verified() -> None:
    """The bound falls from step to step, and the file proves the last one."""
    root, told = solved_root(), list[float]()
    stages, tails = proved(root), TailSearch(root.search)
    tails._explore(stages, 300_000, lambda: told.append(tails.bound))
    assert told == sorted(told, reverse=True) and told[-1] < stages.narrowing.pricing.bound
    assert told[-1] >= root.search.value
    file = claimed(root, tails)
    assert verify(root.search.model.problem, file).bound == file.proved == told[-1]
    again = msgspec.json.decode(msgspec.json.encode(file), type=CertificateFile)
    assert again == file


@pytest.mark.parametrize("more", [1.2, 1.5])
def test_claims_that_are_too_high_prove_only_what_is_true(more: float) -> None:
    """Each loss is the claim, or the least that the checker finds."""
    root = solved_root()
    tails = TailSearch(root.search)
    tails._explore(proved(root), 300_000, lambda: None)
    file = claimed(root, tails)
    higher = tuple(
        msgspec.structs.replace(tail, loss=more * tail.loss) for tail in file.certificate.tails
    )
    numbers = msgspec.structs.replace(file.certificate, tails=higher)
    found = verify(root.search.model.problem, msgspec.structs.replace(file, certificate=numbers))
    assert found.bound >= root.search.value


def test_explorations_go_on_with_more_nodes_and_end_with_the_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """What was explored with as many nodes before is not explored again."""
    root, asked = solved_root(), list[tuple[int, int]]()

    def never_ending(
        self: Tails, t: int, loss: float, most_nodes: int, stop: object, known: Reached
    ) -> LeastLoss:
        asked.append((t, most_nodes))
        raise NotEndedError

    monkeypatch.setattr(Tails, "least_loss", never_ending)
    stages, tails = proved(root), TailSearch(root.search)
    fewest = tails._fewest_nodes
    tails.at_the_end(stages, fewest, lambda: None)
    steps = root.search.model.problem.horizon + 1
    passes = [nodes for t, nodes in asked if t == 0]
    assert passes == [fewest * 2**k for k in range(len(passes))]
    assert passes[-1] <= DEFAULTS.tails.times_at_the_end * fewest < 2 * passes[-1]
    assert len(asked) == steps * len(passes) and tails.best is None
    before = len(asked)
    tails._explore(stages, passes[-1], lambda: None)
    assert len(asked) == before


@pytest.mark.parametrize("checks", [5, 30])
def test_a_limit_keeps_what_tails_have_proved(checks: int) -> None:
    """Also in the middle of an exploration."""
    root, told = solved_root(), list[float]()
    stages, tails = proved(root), TailSearch(root.search)
    root.search.stop = Calls(checks)
    with pytest.raises(LimitReached):
        tails.at_the_end(stages, MANY, lambda: told.append(tails.bound))
    assert tails.bound == (told[-1] if told else np.inf)
    assert tails.bound >= root.search.value


@pytest.mark.parametrize("gap", [0.02, 0.2])
def test_proofs_aim_at_the_gap_that_is_allowed(gap: float) -> None:
    """The bound is within the gap, and a staged file bounds plans above the cutoff only."""
    problem = load_scene("bottleneck", 0)
    result = branch_and_price(problem, gap=gap)
    assert result.gap <= gap
    assert verify(problem, result.certificate).bound == result.bound


def test_staged_files_bound_plans_above_the_cutoff_only() -> None:
    """Plans within the gap that is allowed are not excluded."""
    root = solved_root()
    gap = 0.3 * (root.relaxation.best.bound / root.search.value - 1)
    step_envelopes(root.search, root.relaxation.best.duals, gap)
    file = root.search.spare
    assert isinstance(file, CertificateFile) and isinstance(file.certificate, Staged)
    assert file.certificate.target == pytest.approx((1 + gap) * root.search.value)
    assert root.search.is_proved(root.search.cutoff(gap))
    assert verify(root.search.model.problem, file).bound == file.proved
