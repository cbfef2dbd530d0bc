"""Constants of moves of the team between two steps: their searches, and the bundle that finds good
ones.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations, product

import numpy as np
import pytest
from brute_force import optimum
from hypothesis import given
from hypothesis import strategies as st
from pool import meetings
from random_certificates import random_multipliers, random_narrowing, random_stage, some_model
from strategies import examples, tiny

import cocap_opt.formulations.certificates.staged.stages as checker
from cocap_opt.compiling import is_there
from cocap_opt.formulations.certificates import (
    CertificateError,
    Staged,
    UnfinishedError,
    verify,
)
from cocap_opt.formulations.certificates.format import MoveConstant, Stage, StepConstant
from cocap_opt.formulations.certificates.staged import (
    JointStates,
    Narrowing,
    compiled_search,
    most_profitable,
    price_staged,
)
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.profitable_moves import (
    high_joint_states,
    most_profitable_move,
)
from cocap_opt.formulations.column_generation.parameters import (
    EnvelopeParameters,
    MoveParameters,
    Parameters,
)
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes import envelopes
from cocap_opt.formulations.column_generation.step_envelopes.envelopes import step_envelopes
from cocap_opt.formulations.column_generation.step_envelopes.local_moves import LocalMoves
from cocap_opt.formulations.column_generation.step_envelopes.move_bundle import MoveBundle
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, LimitReached, never

seeds = st.integers(0, 10**9)
MOST_PAIRS = 4_000  # combinations of moves of single robots that a test enumerates


def at_new_prices(model: Model, rng: np.random.Generator) -> Narrowing:
    """A narrowing at random prices, with the constants that searches find."""
    stage = random_stage(model, rng, priced=True)
    steps = range(model.problem.first_step, model.problem.horizon + 1)
    stage = Stage(stage.prices, tuple(StepConstant(t, -1e3) for t in steps))

    def highest(_: int, joint: JointStates) -> float:
        return most_profitable(joint, -1e3, 10**6).profit

    return random_narrowing(model, -1.0, rng).after(stage, highest, lambda *_: 0.0)


def profits_of_moves(narrowing: Narrowing, t: int) -> Iterator[float]:
    """The profits of all moves between joint states that count, limited by what is known."""
    model, ends = narrowing.model, [narrowing.joint_states(at) for at in (t, t + 1)]
    at = [
        {place: k for k, place in enumerate(zip(*named, strict=True))}
        for named in ((joint.class_of.tolist(), joint.states.tolist()) for joint in ends)
    ]
    ways = []
    for number, robot_class in enumerate(model.classes):
        of_class = [
            (number, tail, head)
            for (of, tail) in at[0]
            if of == number
            for head in robot_class.graph.successors(t, tail).tolist()
            if (number, head) in at[1]
        ]
        ways += [of_class] * len(robot_class.robots)
    if np.prod([float(len(way)) for way in ways]) > MOST_PAIRS:
        return
    rules, where = model.problem.rules, model.places.positions
    for team in product(*ways):
        moves = []
        for number, tail, head in team:
            n = model.classes[number].graph.n_places
            moves.append((where[number][tail % n], where[number][head % n]))
        if any(
            rules.conflict_between(first, second) or rules.too_near(first[1] - second[1])
            for first, second in combinations(moves, 2)
        ) or any(rules.too_near(a[0] - b[0]) for a, b in combinations(moves, 2)):
            continue
        total, counts = 0.0, True
        for k, joint in enumerate(ends):
            chosen = [at[k][number, (tail, head)[k]] for number, tail, head in team]
            low = joint.worth(chosen) - float(joint.charge[chosen].sum())
            counts &= low >= joint.floor - joint.margin
            known = [joint.reduced_profit(chosen), narrowing.ceiling(t + k)]
            known += [most - float(raised[chosen].sum()) for most, raised in joint.ceilings]
            total += min(known)
        if counts:
            yield total


@pytest.mark.slow
@examples(20)
@given(st.one_of(meetings(), meetings(team=3)), seeds)
def test_the_search_finds_the_highest_of_all_moves(problem: Problem, seed: int) -> None:
    """It agrees with enumeration, in plain and in compiled code."""
    rng = np.random.default_rng(seed)
    narrowing = at_new_prices(some_model(problem, rng), rng)
    for t in range(problem.first_step, problem.horizon):
        highest = max(profits_of_moves(narrowing, t), default=None)
        if highest is None:
            continue
        for plain in (True, False):
            searches = MoveSearches(10**6, plain)
            found = most_profitable_move(narrowing, t, highest - 1.0, searches, never)
            assert found == pytest.approx(highest, abs=1e-9)
            found = most_profitable_move(narrowing, t, highest + 1.0, searches, never)
            assert found == highest + 1.0


@pytest.mark.parametrize("above", [-1e6, -1e17])
def test_a_claim_far_too_low_hides_no_joint_state(above: float) -> None:
    """Limits on slacks are not lost in the rounding of the claim, which a file may choose."""
    model = compiled(tiny())
    narrowing = Narrowing.of(model, random_multipliers(model, np.random.default_rng(0)), -1.0)
    joint, robots = narrowing.joint_states(1), len(model.problem.robots)
    slack = np.full(len(joint.states), 11.0)
    joint = replace(
        joint, charge=np.zeros_like(joint.charge), floor=0.0, limits=((robots * 11.0 + 1.0, slack),)
    )

    def n_found(joint: JointStates, above: float) -> int:
        searches = MoveSearches(10**6, plain=True)
        return len(high_joint_states(model, joint, above, searches, never).placed)

    assert n_found(joint, above) == n_found(replace(joint, limits=()), -1e6) > 0


@pytest.mark.slow
@examples(20)
@given(st.one_of(meetings(), meetings(team=3)), seeds)
def test_local_search_finds_only_moves_without_conflicts(problem: Problem, seed: int) -> None:
    """Its random starts may have conflicts, also where no robot alone can end them."""
    rng = np.random.default_rng(seed)
    narrowing = at_new_prices(some_model(problem, rng), rng)
    rules, where = problem.rules, narrowing.model.places.positions
    for t in range(problem.first_step, problem.horizon):
        ends = [narrowing.joint_states(at) for at in (t, t + 1)]
        local = LocalMoves(narrowing, *ends)
        if not local.are_possible:
            continue
        starts = [local.random(rng) for _ in range(8)]
        found = local.ascended(starts, (ends[0].price, ends[1].price))
        highest = max(profits_of_moves(narrowing, t), default=np.inf)
        assert found.profits.max(initial=-np.inf) <= highest + 1e-9
        for team in zip(found.tails, found.heads, strict=True):
            tails, heads = (
                [
                    where[number][state % narrowing.model.classes[number].graph.n_places]
                    for number, state in zip(local.numbers, states, strict=True)
                ]
                for states in team
            )
            for (a, b), (c, d) in combinations(zip(tails, heads, strict=True), 2):
                assert not rules.too_near(a - c) and not rules.too_near(b - d)
                assert not rules.conflict_between((a, b), (c, d))


def test_a_move_saves_what_its_steps_have_above_it() -> None:
    """Until one of them has new prices, or a move that shares a step with it has a constant."""
    model, rng = compiled(tiny()), np.random.default_rng(0)
    narrowing = Narrowing.of(model, random_multipliers(model, rng), -1.0).closed()
    both = float(narrowing.constants[1] + narrowing.constants[2])

    def after(stage: Stage, before: Narrowing = narrowing) -> Narrowing:
        constants = {claim.t: claim.constant for claim in stage.constants}
        return before.after(
            stage, lambda _, joint: constants[joint.t], lambda k, _: stage.moves[k].constant
        )

    lower = after(Stage(moves=(MoveConstant(1, both - 5.0),)))
    assert lower.saved.tolist() == pytest.approx([0.0, 5.0, 0.0], abs=1e-9)
    assert lower.bound == pytest.approx(narrowing.bound - 5.0)
    assert lower.constants.tolist() == narrowing.constants.tolist()
    higher = after(Stage(moves=(MoveConstant(1, both + 5.0),)))
    assert higher.bound == narrowing.bound and not higher.saved.any()
    kept = after(Stage(moves=(MoveConstant(1, both),)), lower)  # its own constant was lower
    assert kept.saved.tolist() == lower.saved.tolist()
    prices = random_stage(model, rng, priced=True).prices
    for t in (1, 2):
        again = Stage(tuple(step for step in prices if step.t == t), (StepConstant(t, 1e3),))
        assert not after(again, lower).saved.any()


@pytest.mark.parametrize(
    ("move", "words"),
    [
        (MoveConstant(0, 1.0), r"stages\[0\].moves\[0\].t: must be 1\.\.1, not 0"),
        (MoveConstant(2, 1.0), r"moves\[0\].t: must be 1\.\.1, not 2"),
        (MoveConstant(1, np.nan), r"moves\[0\].constant: must be finite"),
        (MoveConstant(1, -np.inf), r"moves\[0\].constant: must be finite"),
    ],
)
def test_constants_of_moves_out_of_range_are_refused_in_words(
    move: MoveConstant, words: str
) -> None:
    """There is no move from the last step on."""
    model = compiled(tiny())
    multipliers = random_multipliers(model, np.random.default_rng(0))
    with pytest.raises(CertificateError, match=words):
        price_staged(model, Staged(multipliers, -1.0, (Stage(moves=(move,)),)))


def test_searches_for_moves_share_the_work_of_a_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that needs more is not verified; steps with too many states are refused."""
    model = compiled(tiny())
    multipliers = random_multipliers(model, np.random.default_rng(0))
    file = Staged(multipliers, -1.0, (Stage(moves=(MoveConstant(1, -1e3),)),))
    told = list[tuple[int, int]]()
    needed = price_staged(model, file, progress=lambda *of: told.append(of)).nodes
    assert told == [(1, 1)] and needed > 1
    monkeypatch.setattr(checker, "MOST_NODES", needed - 1)
    with pytest.raises(UnfinishedError, match=r"stages\[0\].moves\[0\]: not verified"):
        price_staged(model, file)
    monkeypatch.setattr(checker, "MOST_STATES", 1)
    with pytest.raises(CertificateError, match=r"moves\[0\]: .* states remain at step 1"):
        price_staged(model, file)


@pytest.mark.parametrize("plain", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize("claim", [-1e12, -1e18, -1e50])
def test_constants_far_too_low_find_the_same_moves(claim: float, plain: bool) -> None:
    """Next to their magnitude, limits on joint states lose digits, but no move."""
    model = compiled(load_scene("tiny-share", 0))
    narrowing = at_new_prices(model, np.random.default_rng(0))
    narrowing = narrowing.above(optimum(model.problem).value * 0.8)
    t = model.problem.first_step
    highest = max(profits_of_moves(narrowing, t))
    searches = MoveSearches(10**6, plain)
    found = most_profitable_move(narrowing, t, claim, searches, never)
    assert found == pytest.approx(highest, abs=1e-9)


# -- the bundle -----------------------------------------------------------------------------------


def before_envelopes(problem: Problem, moves: MoveParameters) -> tuple[Search, Callable[[], None]]:
    """A search with a plan, and what makes its step envelopes, without trials of paths; after two
    rounds, stages of single steps leave a gap.
    """
    few = EnvelopeParameters(most_rounds=2)
    search = Search(compiled(problem), parameters=Parameters(moves=moves, envelopes=few))
    search.offer(search.local_search.from_mixture(Mixture([], np.zeros(0))))
    return search, lambda: step_envelopes(search, search.alone.duals, OPTIMALITY, tries_paths=False)


def staged_search(problem: Problem, moves: MoveParameters) -> Search:
    """A search after its step envelopes."""
    search, run = before_envelopes(problem, moves)
    run()
    return search


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@pytest.mark.parametrize("steps", [3, pytest.param(4, marks=pytest.mark.long(seconds=8))])
def test_moves_lower_the_bound_of_steps(steps: int) -> None:
    """In a scene with a gap that single steps leave; also if a step is left over."""
    problem = load_scene("bottleneck", 0).replace(horizon=steps)
    without = staged_search(problem, MoveParameters(most_iterations=0)).spare
    search = staged_search(problem, MoveParameters())
    assert without is not None and search.spare is not None
    assert search.value <= search.spare.proved < without.proved
    assert any(stage.moves for stage in search.spare.certificate.stages)
    assert not any(stage.moves for stage in without.certificate.stages)
    assert verify(problem, search.spare, model=search.model).bound == search.spare.proved


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
@examples(12)
@given(st.one_of(meetings(), meetings(team=3)), st.sampled_from([0, 1, 10**6]))
def test_what_moves_claim_is_verified_and_true(problem: Problem, most_nodes: int) -> None:
    """Also if searches for moves take too many nodes."""
    search = staged_search(problem, MoveParameters(most_nodes=most_nodes))
    if search.spare is not None:
        pricing = verify(problem, search.spare, model=search.model)
        assert optimum(problem).value <= pricing.bound == search.spare.proved


@pytest.mark.long(seconds=10)
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_stages_of_moves_are_no_longer_than_a_checker_allows(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Their searches end within a number of nodes; steps with too many states have no moves."""
    problem, most = load_scene("bottleneck", 0).replace(horizon=3), 500
    compiled_search.KERNEL.takes_over(never)  # otherwise only the later searches are compiled

    def nodes(moves: MoveParameters) -> int:
        search = staged_search(problem, moves)
        assert search.spare is not None
        return verify(problem, search.spare, model=search.model).nodes

    before, after = nodes(MoveParameters(most_iterations=0)), nodes(MoveParameters())
    assert before + most < after
    assert before <= nodes(MoveParameters(most_total_nodes=most)) <= before + most
    monkeypatch.setattr(envelopes, "MOST_STATES", 1)
    assert nodes(MoveParameters()) == before


@pytest.mark.slow
@pytest.mark.skipif(not is_there(), reason="needs the extra [fast]")
def test_a_limit_leaves_the_best_stage_of_moves(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a bundle has proved before a limit is in the file."""
    problem, found = load_scene("bottleneck", 0).replace(horizon=4), list[MoveBundle]()
    run: Callable = MoveBundle.run

    def limited(self: MoveBundle, *of: object) -> None:
        run(self, *of)
        found.append(self)
        raise LimitReached(Limit.WORK)

    monkeypatch.setattr(MoveBundle, "run", limited)
    search, begin = before_envelopes(problem, MoveParameters())
    with pytest.raises(LimitReached):
        begin()
    assert search.spare is not None and len(found) == 1
    assert search.spare.proved == pytest.approx(found[0].best)
    assert verify(problem, search.spare, model=search.model).bound == search.spare.proved
