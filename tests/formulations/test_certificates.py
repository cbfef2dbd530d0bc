import codecs
import json
import math
import subprocess
import sys
from collections.abc import Iterator
from fractions import Fraction
from functools import cache
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from brute_force import all_paths, bonus_of, optimum, pixels_of, views_of, weights_of
from counting import either
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from random_certificates import (
    all_cells,
    as_rows,
    random_cuts,
    random_decisions,
    random_multipliers,
    random_proof,
    random_reference,
    random_rows,
    some_model,
)
from scipy.optimize import linprog
from strategies import SHARE, examples, number_of_plans, tiny

from cocap_opt.files.documents import FileError, decode_document, encode, read_bytes
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.certificates import (
    Branch,
    CertificateError,
    CertificateFile,
    ClassCurve,
    Decision,
    EnvelopeCut,
    Leaf,
    Multipliers,
    Pricing,
    ProofFile,
    ReferencePixels,
    Row,
    envelope,
    verify,
)
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import Cells, Move, Moves, Swap, Visit
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.relaxations.collision_rows import CliquesOfMoves
from cocap_opt.formulations.relaxations.separation import MOST_BREAKPOINTS, Seen, phi_of
from cocap_opt.formulations.result import certify
from cocap_opt.formulations.second_opinion import TooLargeError, _highest_corner
from cocap_opt.graph.networks import time_expanded_graph
from cocap_opt.model import Model, PathCells, compiled
from cocap_opt.problem import NO_RULES, Cell, Objective, Plan, Problem, State
from cocap_opt.referee import _Referee
from cocap_opt.scenarios import load_scene

CORE = "cocap_opt"
CERTIFICATES = f"{CORE}.formulations.certificates"


def optimum_under(model: Model, decisions: tuple[Decision, ...]) -> float:
    """Best J of the plans that obey the rules and the decisions, by going through all."""
    problem, best = model.problem, -math.inf
    robots = range(len(problem.robots))
    paths = [all_paths(problem, robot) for robot in robots]
    pixels = [pixels_of(problem, robot, paths[robot]) for robot in robots]
    passed = [
        [
            PathCells.of(model, i, tuple(model.class_of[i].graph.index(s) for s in path))
            for path in own
        ]
        for i, own in enumerate(paths)
    ]
    for chosen in product(*(range(len(own)) for own in paths)):
        counts = [
            sum(d.resource.used_by(model, passed[i][k]) for i, k in enumerate(chosen))
            for d in decisions
        ]
        if any(d.sign * (count - d.robots) > 0 for d, count in zip(decisions, counts, strict=True)):
            continue
        plan = Plan(paths=tuple(paths[i][k] for i, k in enumerate(chosen)))
        if not _Referee(problem).conflicts(plan):
            seen = np.sum([pixels[i][k] for i, k in enumerate(chosen)], axis=0)
            value = float(views_of(problem, seen[None])[0])
            best = max(best, value + sum(bonus_of(problem, path) for path in plan.paths))
    return best


@examples(12)
@given(problem=either(problems(over_time=True)), seed=st.integers(0, 1000))
def test_any_multipliers_give_a_bound(problem: Problem, seed: int) -> None:
    """However badly a solver converged: non-negative multipliers are a valid certificate."""
    rng = np.random.default_rng(seed)
    best, model = optimum(problem).value, some_model(problem, rng)
    assert Pricing.of(model, random_multipliers(model, rng)).bound >= best
    reference = random_reference(problem, rng)
    assert Pricing.of(compiled(problem), reference).bound >= best


@examples(20)
@given(problem=either(problems(most_plans=400, over_time=True)), seed=st.integers(0, 1000))
def test_any_multipliers_bound_the_plans_of_their_leaf(problem: Problem, seed: int) -> None:
    """Under decisions the bound holds for the plans that obey them: cells, states, moves."""
    rng = np.random.default_rng(seed)
    model = some_model(problem, rng)
    decisions = random_decisions(model, rng)
    bound = Pricing.of(model, random_multipliers(model, rng, len(decisions)), decisions).bound
    assert bound >= optimum_under(model, decisions)


@examples(8)
@given(problem=st.one_of(meetings(), meetings(team=3)), seed=st.integers(0, 1000))
def test_rows_that_two_drones_may_use_at_once_are_refused(problem: Problem, seed: int) -> None:
    """Places and moves of two drones of the best plan, alone or added to a true clique of moves.

    All else that is accepted gives a bound, however much is altered: the clique's moves, its step
    or its multiplier.
    """
    best, model, rng = optimum(problem), compiled(problem), np.random.default_rng(seed)
    assume(best.plan is not None and not problem.rules.none)
    some = msgspec.structs.replace(random_multipliers(model, rng), cuts=())
    cells = [[problem.cell(i, s) for s in path] for i, path in enumerate(best.plan.paths)]
    t = int(rng.integers(problem.horizon))
    flown = tuple(own[t : t + 2] for own in map(tuple, cells))
    clique = tuple(dict.fromkeys([*some_clique(model, rng), flown[0]]))
    for resource in (
        Moves(t, flown[:2]),
        Moves(t, tuple(dict.fromkeys([*clique, *flown]))),
        Cells(t, (cells[0][t], cells[1][t])),
    ):
        forged = msgspec.structs.replace(some, rows=(Row(resource, 50.0),))
        with pytest.raises(CertificateError, match="two drones may"):
            Pricing.of(model, forged)
    for moves in (clique, clique[1:], tuple((head, tail) for tail, head in clique)):
        row = Row(Moves(int(rng.integers(problem.horizon)), moves), float(rng.choice([1.0, 50.0])))
        try:
            bound = Pricing.of(model, msgspec.structs.replace(some, rows=(row,))).bound
        except CertificateError:
            continue
        assert bound >= best.value


def some_clique(model: Model, rng: np.random.Generator) -> tuple[tuple[Cell, Cell], ...]:
    """Moves of which any two break a rule, or one move alone."""
    cells = all_cells(model.problem)
    moves = [(a, b) for a, b in product(cells, repeat=2) if max(abs(a.x - b.x), abs(a.y - b.y)) < 2]
    near, _ = CliquesOfMoves(model).conflicts(moves)
    clique, order = list[int](), rng.permutation(len(moves)).tolist()
    for k in order:
        if near[k, clique].all():
            clique.append(k)
    return tuple(moves[k] for k in clique)


# -- envelope cuts ------------------------------------------------------------------------


@st.composite
def curves_of_classes(draw: st.DrawFn) -> tuple[dict[int, envelope.Curve], tuple[int, ...]]:
    """Curves of some classes, and how many robots each class has."""
    sizes = tuple(draw(st.lists(st.integers(1, 3), min_size=1, max_size=3)))
    curves = {}
    for number in draw(st.sets(st.sampled_from(range(len(sizes))))):
        roots = draw(st.lists(st.floats(0.1, 50.0), min_size=1, max_size=4, unique=True))
        values = draw(st.lists(st.floats(0.0, 40.0), min_size=len(roots), max_size=len(roots)))
        curves[number] = envelope.Curve(np.sort(roots), np.array(values))
    return curves, sizes


@examples(60)
@given(drawn=curves_of_classes(), seed=st.integers(0, 1000))
def test_an_envelope_cut_holds_for_all_roots(
    drawn: tuple[dict[int, envelope.Curve], tuple[int, ...]], seed: int
) -> None:
    """The constant is taken at breakpoints only, and holds between and beyond them as well."""
    curves, sizes = drawn
    cut = Cut.valid(0, curves, sizes)
    rng = np.random.default_rng(seed)
    classes = np.repeat(np.arange(len(sizes)), sizes)
    seen = rng.uniform(0.0, 60.0, (200, len(classes))) * (rng.random((200, len(classes))) < 0.7)
    nowhere = np.zeros(len(seen), dtype=np.int64)
    bound = cut.constant + sum(
        cut.phi(number, nowhere, seen[:, n]) for n, number in enumerate(classes.tolist())
    )
    assert (np.sqrt((seen**2).sum(axis=1)) <= bound * (1 + 1e-12) + 1e-12).all()


@examples(60)
@given(drawn=curves_of_classes())
def test_a_cuts_constant_is_its_largest_excess_at_breakpoints(
    drawn: tuple[dict[int, envelope.Curve], tuple[int, ...]],
) -> None:
    """What dynamic programming finds is what going through all corners finds."""
    curves, sizes = drawn
    robots = [curves[k] for k in curves for _ in range(sizes[k])]
    most = 0.0
    for corner in product(*([(0.0, 0.0), *zip(c.roots, c.values, strict=True)] for c in robots)):
        norm = math.sqrt(sum(root**2 for root, _ in corner))
        most = max(most, norm - sum(value for _, value in corner))
    constant = Cut.valid(0, curves, sizes).constant
    assert constant >= most - 1e-9
    assert constant == pytest.approx(most, rel=1e-9, abs=1e-9)


numbers = st.floats(0.05, 1.0)


@examples(80)
@given(
    st.lists(st.lists(st.tuples(numbers, numbers), min_size=1, max_size=4), min_size=1, max_size=2),
    st.integers(1, 40),
)
def test_the_constant_of_many_robots_is_that_of_plain_loops(
    drawn: list[list[tuple[float, float]]], robots: int
) -> None:
    """Breakpoint by breakpoint or class by class, it is what robot by robot gives."""
    written, curves, sizes = [], {}, (robots, 2)
    for number, points in enumerate(drawn):
        roots, shares = np.array(sorted(dict(points).items())).T
        curves[number] = envelope.Curve(roots, roots * shares**2)
        values = tuple(curves[number].values.tolist())
        written.append(ClassCurve(number, tuple(roots.tolist()), values))
    try:
        plain = _highest_corner(tuple(written), sizes)
    except TooLargeError:
        return
    for choices in (1, envelope.STAGE_CHOICES):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(envelope, "STAGE_CHOICES", choices)
            constant = Cut.valid(0, curves, sizes).constant
        assert constant == pytest.approx(plain, rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("sizes", [(1,) * 5, (4, 3)])
def test_constants_of_many_corners_are_rounded_up(
    sizes: tuple[int, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where corners are merged for there are too many, the cut stays valid."""
    monkeypatch.setattr(envelope, "STAGE_CHOICES", 1)
    rng = np.random.default_rng(3)
    curves = {}
    for number in range(len(sizes)):
        roots = np.sort(rng.uniform(0.1, 10.0, 8))
        curves[number] = envelope.Curve(roots, 0.4 * roots + 0.01 * roots**2)
    exact = Cut.valid(0, curves, sizes).constant
    monkeypatch.setattr(envelope, "MOST_CORNERS", 4)
    merged = Cut.valid(0, curves, sizes).constant
    assert exact < merged <= 4 * exact


def seen_by(number: int, roots: np.ndarray, amounts: np.ndarray) -> Seen:
    """What one class sees."""
    return Seen(np.full(len(roots), number), roots, amounts)


@examples(30)
@given(seed=st.integers(0, 10_000), robots=st.integers(2, 4))
def test_the_best_cut_is_valid_and_no_weaker_than_single_view(seed: int, robots: int) -> None:
    """It lies above every integer point, and at a mixture not above the cuts that it replaces."""
    rng = np.random.default_rng(seed)
    roots = np.sort(rng.uniform(1.0, 10.0, 4))
    amounts = rng.dirichlet(np.ones(5))[:4] * robots
    seen = seen_by(0, roots, amounts)
    cut = seen.best_cut(0, np.array([10.0]), (robots,))
    assert cut is not None
    height = seen.height(cut)
    assert height <= min(float(amounts @ roots), math.sqrt(amounts @ roots**2)) * (1 + 1e-3)
    for chosen in product([0.0, *roots], repeat=robots):
        at = np.array(chosen)
        above = cut.constant + float(cut.phi(0, np.zeros(len(at), dtype=np.int64), at).sum())
        assert math.sqrt(float((at**2).sum())) <= above * (1 + 1e-12)


def test_a_class_too_large_for_any_breakpoints_has_no_cut() -> None:
    """With 49 drones even two breakpoints are too many; the separation once failed there."""
    seen = Seen(np.zeros(2, dtype=np.int64), np.array([2.0, 8.0]), np.array([20.0, 20.0]))
    largest = np.array([10.0])
    assert seen.best_cut(0, largest, (40,)) is not None
    assert seen.best_cut(0, largest, (49,)) is None


def test_cuts_of_robots_that_are_a_class_each_have_few_breakpoints() -> None:
    """Of 36 different roots; the cut is valid and lower than what is known all the same."""
    rng = np.random.default_rng(0)
    classes, amounts = np.repeat(np.arange(3), 12), np.full(36, 0.04)
    seen = Seen(classes, rng.uniform(1.0, 10.0, 36), amounts)
    known = min(float(amounts @ seen.roots), math.sqrt(amounts @ seen.roots**2))
    cut = seen.best_cut(0, np.full(3, 10.0), (1, 1, 1), known)
    assert cut is not None and seen.height(cut) < known
    assert sum(len(curve.roots) for curve in cut.curves.values()) <= MOST_BREAKPOINTS
    for _ in range(200):
        views = rng.uniform(0.0, 12.0, 3) * (rng.random(3) < 0.5)
        assert (
            np.linalg.norm(views)
            <= cut.constant
            + phi_of(cut, np.arange(3), np.zeros(3, dtype=np.int64), views).sum()
            + 1e-9
        )


@examples(30)
@given(seed=st.integers(0, 10_000))
def test_the_best_cut_of_disaggregated_robots_is_the_best_coupling(seed: int) -> None:
    """As high as the best joint distribution of three robots with these amounts, no higher."""
    rng = np.random.default_rng(seed)
    roots = np.sort(rng.uniform(1.0, 10.0, (3, 2)), axis=1)
    assume((np.diff(roots) > 0.2).all())
    amounts = np.array([rng.dirichlet(np.ones(3))[:2] for _ in range(3)])
    seen = Seen(np.repeat(np.arange(3), 2), roots.ravel(), amounts.ravel())
    cut = seen.best_cut(0, np.full(3, 10.0), (1, 1, 1))
    assert cut is not None
    height = seen.height(cut)
    corners = list(product(range(3), repeat=3))
    values = np.column_stack([np.zeros(3), roots])
    shares = np.column_stack([1 - amounts.sum(axis=1), amounts])
    norms = [math.sqrt(sum(values[i, k] ** 2 for i, k in enumerate(c))) for c in corners]
    rows = [[float(c[i] == k) for c in corners] for i in range(3) for k in range(3)]
    best = linprog(-np.array(norms), A_eq=np.array(rows), b_eq=shares.ravel())
    assert height == pytest.approx(-best.fun, rel=1e-3)
    assert height >= -best.fun * (1 - 1e-6)


def test_for_two_robots_the_cut_is_the_antitone_coupling() -> None:
    """Two robots half here and half there: the best mixture pairs much with little."""
    seen = seen_by(0, np.array([1.0, 4.0, 9.0]), np.array([0.5, 0.75, 0.5]))
    cut = seen.best_cut(0, np.array([9.0]), (2,))
    assert cut is not None
    height = seen.height(cut)
    # Amounts 0: 0.25, 1: 0.5, 4: 0.75, 9: 0.5, most paired with least: 9-0, 9-1, 4-1, 4-4.
    pairs = [(0.25, 9, 0), (0.25, 9, 1), (0.25, 4, 1), (0.25, 4, 4)]
    best = sum(p * math.hypot(a, b) for p, a, b in pairs)
    assert height == pytest.approx(best, rel=1e-4)


def keep_all(partial: envelope.Partial) -> tuple[np.ndarray, envelope.Partial]:
    """Drop no partial corner."""
    return np.arange(len(partial.pixels)), partial


@pytest.mark.parametrize("choices", [envelope.STAGE_CHOICES, 1])
def test_all_corners_are_gone_through_and_once(
    choices: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As many multisets of breakpoints as the formula says, none twice, none too large."""
    monkeypatch.setattr(envelope, "STAGE_CHOICES", choices)
    for points, size in ((1, 4), (3, 2), (4, 5)):
        curve = envelope.Curve(np.arange(1.0, points + 1), np.ones(points))
        corners = envelope.Corners({0: curve}, (size,))
        heights, steps = corners.above(-math.inf, keep_all)
        counts = corners.counts(steps, np.arange(len(heights)))
        assert len(counts) == math.comb(size + points, points)
        assert len(np.unique(counts, axis=0)) == len(counts)
        assert counts.min() >= 0
        assert counts.sum(axis=1).max() == size


# -- exact arithmetic ---------------------------------------------------------------------

BITS = 160


def root_below(value: Fraction) -> Fraction:
    """Largest multiple of 2^-BITS whose square is at most a value."""
    return Fraction(math.isqrt(int(value * 4**BITS)), 2**BITS)


def exact_optimum(problem: Problem) -> Fraction:
    """Best J in rational arithmetic, roots rounded down by less than 2^-BITS each."""
    robots = range(len(problem.robots))
    paths = [all_paths(problem, robot) for robot in robots]
    if not all(paths):
        return Fraction(-1)
    pixels = [pixels_of(problem, robot, paths[robot]).reshape(len(paths[robot]), -1)
              for robot in robots]  # fmt: skip
    weights = [Fraction(w) for w in weights_of(problem).ravel().tolist()]
    best = Fraction(-1)
    for chosen in product(*(range(len(own)) for own in paths)):
        plan = Plan(paths=tuple(paths[i][k] for i, k in enumerate(chosen)))
        if _Referee(problem).conflicts(plan):
            continue
        seen = [sum((Fraction(pixels[i][k][g]) for i, k in enumerate(chosen)), Fraction(0))
                for g in range(len(weights))]  # fmt: skip
        value = sum((w * root_below(z) for w, z in zip(weights, seen, strict=True)), Fraction(0))
        moves = (exact_bonus(problem, a, b) for path in plan.paths for a, b in pairwise(path))
        best = max(best, value + sum(moves, Fraction(0)))
    return best


def exact_bonus(problem: Problem, a: State, b: State) -> Fraction:
    """Reward of one move, from the definition of the objective."""
    objective = problem.objective
    total = Fraction(objective.stationarity) if a == b else Fraction(0)
    total += Fraction(objective.keep_cell) if a[:3] == b[:3] else 0
    total += Fraction(objective.keep_heading) if a.heading == b.heading else 0
    return total + (Fraction(objective.balanced) if a.x + a.y == b.x + b.y else 0)


def exact_price(problem: Problem, certificate: Multipliers) -> Fraction:
    """What multipliers without cuts prove, in rational arithmetic, within 2^-BITS a root.

    Written from the formula in `certificates.pricing` alone, over the networkx graph.
    """
    weights = [[Fraction(w) for w in row] for row in weights_of(problem).tolist()]
    alpha = [[Fraction(a) for a in row] for row in certificate.alpha]
    beta = [[Fraction(b) for b in row] for row in certificate.beta]
    model = Model(problem, use_cache=False)
    seen = {int(g) for robot_class in model.classes for g in model.coverage(robot_class).view_sums}
    steps, faces = range(problem.horizon + 1), range(len(weights[0]))
    total = sum((Fraction(row.multiplier) for row in certificate.rows), Fraction(0))
    for t, f in product(steps, faces):
        if t * len(faces) + f in seen and alpha[t][f] < 1:
            total += weights[t][f] * (1 - alpha[t][f]) ** 2 / (4 * beta[t][f])
    for robot in range(len(problem.robots)):
        graph = time_expanded_graph(problem, robot)
        robot_class = model.class_of[robot]
        table = model.coverage(robot_class)

        def paid(state: State, t: int, robot_class=robot_class, table=table) -> Fraction:  # type: ignore[no-untyped-def]
            view_sums, pixels = table.row(
                t * robot_class.graph.n_states + robot_class.graph.index(state)
            )
            value = Fraction(0)
            for g, c in zip(view_sums.tolist(), pixels.tolist(), strict=True):
                f = g % len(faces)
                root = root_below(Fraction(c))
                value += weights[t][f] * (alpha[t][f] * root + beta[t][f] * Fraction(c))
            return value

        worth: dict[tuple[State, int], Fraction] = {}
        for state, t in sorted(graph, key=lambda node: -node[1]):
            cell = problem.cell(robot, state)
            charge = sum(
                (Fraction(row.multiplier) for row in certificate.rows
                 if isinstance(row.resource, Cells) and row.resource.t == t
                 and cell in row.resource.cells), Fraction(0)
            )  # fmt: skip
            ahead = []
            for head, _ in graph[state, t] if t < problem.horizon else ():
                other = problem.cell(robot, head)
                swap = sum(
                    (Fraction(row.multiplier) for row in certificate.rows
                     if isinstance(row.resource, Swap) and row.resource.t == t and other != cell
                     and {other, cell} == set(row.resource.cells)), Fraction(0)
                )  # fmt: skip
                moved = sum(
                    (Fraction(row.multiplier) for row in certificate.rows
                     if isinstance(row.resource, Moves) and row.resource.t == t
                     and (cell, other) in row.resource.moves), Fraction(0)
                )  # fmt: skip
                bonus = exact_bonus(problem, state, head)
                ahead.append(worth[head, t + 1] + bonus - swap - moved)
            worth[state, t] = paid(state, t) - charge + max(ahead, default=Fraction(0))
        total += max(worth[node] for node in graph if node[1] == 0)
    return total


@examples(12)
@given(problem=problems(most_plans=300, goals=False), seed=st.integers(0, 1000))
def test_rounding_is_bounded_against_exact_arithmetic(problem: Problem, seed: int) -> None:
    """The rounded bound is above the exact value of the same multipliers, and barely."""
    assume(number_of_plans(problem) > 0)
    rng = np.random.default_rng(seed)
    certificate = msgspec.structs.replace(
        random_multipliers(compiled(problem), rng), cuts=(), state_cuts=()
    )
    rounded, exact = Pricing.of(compiled(problem), certificate), exact_price(problem, certificate)
    slack = Fraction(2) ** (-BITS + 20)
    assert Fraction(rounded.bound) >= exact - slack
    assert Fraction(rounded.bound) - exact <= 3 * Fraction(rounded.rounding) + slack


@pytest.mark.slow
@examples(12)
@given(problem=problems(most_plans=300))
def test_proved_optima_hold_in_exact_arithmetic(problem: Problem) -> None:
    """The proved bound is at least the optimum also where nothing is rounded."""
    result = branch_and_price(problem)
    best = exact_optimum(problem)
    assume(best >= 0)
    assert Fraction(result.bound) >= best


# -- files --------------------------------------------------------------------------------


@cache
def small_certificate() -> tuple[Problem, CertificateFile]:
    """A certificate with all its parts, of the tiny instance."""
    problem = tiny()
    rng = np.random.default_rng(1)
    shape = (problem.view_sum_steps, len(problem.face_weights))
    certificate = Multipliers(
        as_rows(rng.uniform(0.2, 0.9, shape)),
        as_rows(rng.uniform(0.01, 0.1, shape)),
        tuple(random_rows(problem, rng)),
        tuple(random_cuts(compiled(problem), rng)),
    )
    return problem, certify(problem, compiled(problem), "test", certificate)


@cache
def small_proof() -> tuple[Problem, ProofFile]:
    """A proof by hand with three leaves: a cell, then a state in it."""
    problem = tiny()
    model = compiled(problem)
    rng = np.random.default_rng(2)
    result = BOUNDS["column-generation"](problem)
    assert isinstance(result.certificate, CertificateFile)
    root = result.certificate.certificate
    assert isinstance(root, Multipliers)

    def leaf(*multipliers: float) -> Leaf:
        return Leaf(msgspec.structs.replace(root, decisions=multipliers))

    nodes = (
        Branch(Cells(1, (Cell(1, 0),)), 0, 1, 2),
        leaf(0.0),
        Branch(Visit(1, State(1, 0, heading=1), 0), 0, 3, 4),
        leaf(2.0, 0.0),
        leaf(float(rng.uniform()), 5.0),
    )
    proof = ProofFile(
        scene="tiny", digest=result.certificate.digest, method="test", bound=0.0, nodes=nodes
    )
    return problem, msgspec.structs.replace(proof, bound=Pricing.of_proof(model, proof).bound)


def numbers(content: object, path: tuple = ()) -> list[tuple]:
    """Paths to all numbers in plain data."""
    if isinstance(content, dict):
        return [p for key, value in content.items() for p in numbers(value, (*path, key))]
    if isinstance(content, list):
        return [p for k, value in enumerate(content) for p in numbers(value, (*path, k))]
    return [path] if isinstance(content, (int, float)) else []


def alterations(
    plain: Any, change: float, first: int, step: int
) -> Iterator[tuple[str | int, ...]]:
    """Let plain data have one of these numbers changed after the other; yields where it stands."""
    for path in numbers(plain)[first::step]:
        inner = plain
        for key in path[:-1]:
            inner = inner[key]
        old = inner[path[-1]]
        inner[path[-1]] = int(old + change) if isinstance(old, int) else old + change
        yield path
        inner[path[-1]] = old


# Each with every third number, so that all numbers are changed, by little or by much.
OTHERS = ((1e-3, 1), (-1.0, 2), (1e6, 0), (1e300, 1))
CHANGES = [(-1e-3, 0), *(pytest.param(*change, marks=pytest.mark.slow) for change in OTHERS)]


@pytest.mark.parametrize(("change", "first"), CHANGES)
@pytest.mark.parametrize("kind", [CertificateFile, pytest.param(ProofFile, marks=pytest.mark.slow)])
def test_an_altered_number_is_refused_or_the_claim_still_holds(
    kind: type[CertificateFile | ProofFile], change: float, first: int
) -> None:
    """Whatever single number is changed, a proof's tree included, no false bound is accepted."""
    problem, file = small_certificate() if kind is CertificateFile else small_proof()
    model = Model(problem, use_cache=False)  # no change of the file changes the coverage
    verify(problem, file, model=model)
    best = optimum(problem).value
    plain = msgspec.json.decode(msgspec.json.encode(file))
    assert len(numbers(plain)) > 20
    for path in alterations(plain, change, first, 10 if SHARE < 1 else 3):
        try:
            claim = msgspec.convert(plain, kind)
            verify(problem, claim, model=model)
        except (CertificateError, msgspec.ValidationError):
            continue
        assert claim.proved >= best, path


def test_a_proof_needs_all_its_leaves() -> None:
    """A leaf removed, a child named twice, a node that nobody names: no tree, no proof."""
    problem, file = small_proof()
    nodes = file.nodes
    root, inner = nodes[0], nodes[2]
    assert isinstance(root, Branch)
    assert isinstance(inner, Branch)

    def replaced(branch: Branch, **children: int) -> Branch:
        return msgspec.structs.replace(branch, **children)

    broken = [
        nodes[:-1],
        nodes[:1],
        (),
        (nodes[0], nodes[1], nodes[3], nodes[3], nodes[4]),
        (*nodes, nodes[1]),
        (replaced(root, at_most=2), *nodes[1:]),
        (replaced(root, at_most=0), *nodes[1:]),
        (replaced(root, at_least=99), *nodes[1:]),
        (*nodes[:2], replaced(inner, at_most=1), *nodes[3:]),
    ]
    for some in broken:
        with pytest.raises(CertificateError, match=r"node|decisions"):
            verify(problem, msgspec.structs.replace(file, nodes=tuple(some)))


def test_a_proof_without_a_branching_row_is_refused() -> None:
    """A leaf may not use a decision that its branch does not make."""
    problem, file = small_proof()
    leaf = file.nodes[3]
    assert isinstance(leaf, Leaf)
    alone = msgspec.structs.replace(file, nodes=(leaf,))
    with pytest.raises(CertificateError, match="decisions"):
        verify(problem, alone)
    fewer = Leaf(msgspec.structs.replace(leaf.certificate, decisions=(0.0,)))
    nodes = (*file.nodes[:3], fewer, file.nodes[4])
    with pytest.raises(CertificateError, match="decisions"):
        verify(problem, msgspec.structs.replace(file, nodes=nodes))


@pytest.mark.parametrize("size", [1e150, 1e300, 1e304, 1e306, 3e306, 1.7e308])
def test_numbers_that_overflow_prove_nothing(size: float) -> None:
    """Infinite rewards at closed places are no numbers: such a leaf must not be passed over."""
    problem, file = small_proof()
    root = file.nodes[1]
    assert isinstance(root, Leaf)
    huge = [[size for _ in row] for row in root.certificate.alpha]
    for decisions in ((0.0,), (size,)):
        leaf = Leaf(
            msgspec.structs.replace(
                root.certificate, alpha=as_rows(np.array(huge)), decisions=decisions
            )
        )
        forged = msgspec.structs.replace(
            file, nodes=(file.nodes[0], leaf, *file.nodes[2:]), bound=None
        )
        with pytest.raises(CertificateError):
            verify(problem, forged)
        goal = problem.replace(robots=tuple(r.replace(goal=(0, 0)) for r in problem.robots))
        alone = msgspec.structs.replace(
            root.certificate, alpha=as_rows(np.array(huge)), decisions=()
        )
        try:
            assert Pricing.of(compiled(goal), alone).bound >= optimum(goal).value
        except CertificateError as error:
            assert "infinite" in str(error)


def test_the_leaves_of_a_proof_carry_their_decisions() -> None:
    """From the root down, with the right side of each branch."""
    _, file = small_proof()
    senses = {n: [(d.sense, d.robots) for d in way] for n, _, way in file.leaves()}
    assert senses == {
        1: [("at most", 0)],
        3: [("at least", 1), ("at most", 0)],
        4: [("at least", 1), ("at least", 1)],
    }


def test_a_claim_beyond_the_proof_is_refused() -> None:
    """The claimed bound may be weaker than what the numbers prove, never stronger."""
    problem, file = small_certificate()
    verify(problem, msgspec.structs.replace(file, bound=file.proved * 1.01))
    for bound in (file.proved * (1 - 1e-9), math.nan, None):
        with pytest.raises(CertificateError, match="bound"):
            verify(problem, msgspec.structs.replace(file, bound=bound))
    problem, proof = small_proof()
    verify(problem, msgspec.structs.replace(proof, bound=proof.proved * 1.01))
    for bound in (proof.proved * (1 - 1e-9), math.nan, None):
        with pytest.raises(CertificateError, match="bound"):
            verify(problem, msgspec.structs.replace(proof, bound=bound))


def test_files_of_another_scene_are_refused() -> None:
    """A certificate or proof belongs to one problem, its rules and objective included."""
    problem, file = small_certificate()
    _, proof = small_proof()
    paid = [Objective(**{rate: 1e-9}) for rate in ("keep_cell", "keep_heading", "balanced")]
    for other in (
        problem.replace(rules=NO_RULES),
        problem.replace(face_samples=3),
        *(problem.replace(objective=objective) for objective in paid),
    ):
        with pytest.raises(CertificateError, match=r"was made for .* of another seed"):
            verify(other, file)
        with pytest.raises(CertificateError, match=r"was made for .* of another seed"):
            verify(other, proof)


def test_proofs_survive_writing_and_reading() -> None:
    """What is read is what was written."""
    _, proof = small_proof()
    assert msgspec.json.decode(msgspec.json.encode(proof), type=ProofFile) == proof
    assert "at_least" in json.loads(msgspec.json.encode(proof))["nodes"][0]


def test_one_reader_takes_certificates_and_proofs(tmp_path: Path) -> None:
    """A file names what it is; any other kind, version or field is refused in one line."""
    _, file = small_certificate()
    _, proof = small_proof()

    def read(path: Path) -> CertificateFile | ProofFile:
        return decode_document(read_bytes(path), str(path), CertificateFile, ProofFile)

    for content in (file, proof):
        for mark in (b"", codecs.BOM_UTF8):  # which some programs write first
            (tmp_path / "file.json").write_bytes(mark + encode(content))
            assert read(tmp_path / "file.json") == content
    plain = json.loads(encode(file))
    for change, words in (
        ({"format": "cocap-opt plan"}, "format: must be 'cocap-opt certificate' or"),
        ({"version": 9}, "version: must be 4, 5, 6, 7, 8, not 9: it is from a newer cocap-opt"),
        (
            {"version": 3},
            "version: must be 4, 5, 6, 7, 8, not 3: it is from an older cocap-opt, whose",
        ),
        ({"coverage": "sampled"}, "coverage"),
        ({"extent": 1}, "unknown field `extent`"),
        ({"classes": "any"}, "classes"),
    ):
        (tmp_path / "file.json").write_text(json.dumps(plain | change))
        with pytest.raises(FileError, match=r"^\S*file\.json: ") as error:
            read(tmp_path / "file.json")
        assert words in str(error.value) and "\n" not in str(error.value)
    del plain["version"]
    (tmp_path / "file.json").write_text(json.dumps(plain))
    with pytest.raises(FileError, match="version: is missing; must be 4, 5, 6, 7, 8"):
        read(tmp_path / "file.json")


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (Row(Cells(0, (Cell(0, 0), Cell(0, 1))), 1.0), "at once"),
        (Row(Cells(3, (Cell(0, 0),)), 1.0), "t: must be"),
        (Row(Cells(-1, (Cell(0, 0),)), 1.0), "t: must be"),
        (Row(Cells(1, (Cell(0, 9),)), 1.0), "outside"),
        (Row(Cells(1, (Cell(0, 0), Cell(0, 0))), 1.0), "distinct"),
        (Row(Cells(1, (Cell(0, 0),)), -1.0), "multiplier"),
        (Row(Cells(1, (Cell(0, 0),)), math.nan), "multiplier"),
        (Row(Cells(1, (Cell(0, 0),), 0), 1.0), "all drones"),
        (Row(Swap(2, (Cell(0, 0), Cell(0, 1))), 1.0), "t: must be"),
        (Row(Swap(0, (Cell(0, 0), Cell(0, 0))), 1.0), "distinct"),
        (Row(Visit(1, State(0, 0), 0), 1.0), "all drones"),
        (Row(Visit(1, State(9, 0), 0), 1.0), "state"),
        (Row(Visit(1, State(0, 0), 5), 1.0), "robot_class: must be"),
        (Row(Move(1, (Cell(0, 0), Cell(0, 1)), 0), 1.0), "all drones"),
    ],
)
def test_rows_that_a_plan_may_break_are_refused(row: Row, words: str) -> None:
    """Only rows that every allowed plan obeys may carry a multiplier."""
    problem, file = small_certificate()
    assert isinstance(file.certificate, Multipliers)
    certificate = msgspec.structs.replace(file.certificate, rows=(row,))
    with pytest.raises(CertificateError, match=words):
        Pricing.of(compiled(problem), certificate)


def cut_of(
    t: int = 1,
    face: int = 0,
    share: float = 0.5,
    class_number: int = 0,
    roots: tuple[float, ...] = (1e3, 1e4),
    values: tuple[float, ...] = (1e3, 1e4),
) -> EnvelopeCut:
    """A cut with one field changed."""
    return EnvelopeCut(t, face, (ClassCurve(class_number, roots, values),), share)


@pytest.mark.parametrize(
    ("cut", "words"),
    [
        (cut_of(t=3), "no view sum"),
        (cut_of(face=99), "no view sum"),
        (cut_of(face=-1), "no view sum"),
        (cut_of(share=1.5), "share"),
        (cut_of(share=math.nan), "share"),
        (cut_of(class_number=1), "robot_class"),
        (cut_of(class_number=-1), "robot_class"),
        (EnvelopeCut(1, 0, (ClassCurve(0, (1.0,), (1.0,)),) * 2, 0.5), "robot_class"),
        (cut_of(roots=()), "roots"),
        (cut_of(roots=(2.0, 1.0)), "roots"),
        (cut_of(roots=(0.0, 1.0)), "roots"),
        (cut_of(roots=(1.0, math.inf)), "roots"),
        (cut_of(values=(1.0,)), "values"),
        (cut_of(values=(-1.0, 1.0)), "values"),
        (cut_of(values=(1.0, math.inf)), "values"),
        (cut_of(roots=tuple(range(1, 400)), values=(1.0,) * 399), "too many"),
    ],
)
def test_cuts_that_are_none_are_refused(cut: EnvelopeCut, words: str) -> None:
    """A cut must belong to a view sum, and be functions of the robots that there are."""
    problem, file = small_certificate()
    assert isinstance(file.certificate, Multipliers)
    certificate = msgspec.structs.replace(file.certificate, cuts=(cut,))
    with pytest.raises(CertificateError, match=words):
        Pricing.of(compiled(problem), certificate)


@pytest.mark.slow
def test_many_tiny_shares_do_not_get_lost_in_rounding() -> None:
    """The same cut 20 000 times with a share that vanishes beside 1: the bound still holds."""
    problem = tiny().replace(horizon=1)
    problem = problem.replace(robots=problem.robots[:1])
    best = optimum(problem).value
    largest = compiled(problem).largest_roots().reshape(2, -1)
    shape = (2, len(problem.face_weights))
    cuts = tuple(
        EnvelopeCut(1, face, (ClassCurve(0, (float(root),), (0.0,)),), 0.501 * 2.0**-53)
        for face, root in enumerate(largest[1].tolist())
        for _ in range(4000 * (root > 0))
    )
    certificate = Multipliers(as_rows(np.ones(shape)), as_rows(np.zeros(shape)), cuts=cuts)
    try:
        assert Pricing.of(compiled(problem), certificate).bound >= best
    except CertificateError as error:
        assert "beta" in str(error)


def test_over_time_no_cut_holds() -> None:
    """A robot's views add up over the steps, so that a cut for single views may be wrong."""
    problem, file = small_certificate()
    other = problem.replace(objective=Objective(over_time=True))
    assert isinstance(file.certificate, Multipliers)
    one_step = {"alpha": file.certificate.alpha[:1], "beta": file.certificate.beta[:1]}
    certificate = msgspec.structs.replace(file.certificate, **one_step)
    with pytest.raises(CertificateError, match="over time"):
        Pricing.of(compiled(other), certificate)


def test_rows_need_their_rule() -> None:
    """Without collision rules no conflict row is valid."""
    problem, file = small_certificate()
    free = problem.replace(rules=NO_RULES)
    with pytest.raises(CertificateError, match="rows"):
        Pricing.of(compiled(free), file.certificate)


def test_reference_pixels_of_nobody_are_the_bound_alone() -> None:
    """Gains over nothing are what each robot sees alone."""
    problem = tiny()
    none = as_rows(problem.no_pixels().reshape(problem.horizon + 1, -1))
    alone = BOUNDS["alone"](problem).bound
    assert Pricing.of(compiled(problem), ReferencePixels(none)).bound == alone


def loaded_by(code: str, *arguments: str) -> set[str]:
    """The modules that a new process has loaded once it has run some code."""
    code += "\nimport sys; print(*sys.modules, sep='\\n')"
    command = [sys.executable, "-c", code, *arguments]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    return set(run.stdout.split())


@pytest.mark.slow
@pytest.mark.parametrize(
    "code",
    [
        "import sys, cocap_opt as co\n"
        "co.verify(co.load('tiny-doorway'), co.read(sys.argv[1]), co.read(sys.argv[2]))",
        "import sys; from cocap_opt.cli.main import main\n"
        "try: main(['verify', 'tiny-doorway', *sys.argv[1:]])\n"
        "except SystemExit as left: assert not left.code",
    ],
    ids=["face", "command"],
)
def test_checking_plain_certificates_loads_nothing_that_searches(code: str, tmp_path: Path) -> None:
    """A plain certificate and a proof: no storey of staged ones, no numba, no caster of rays."""
    problem = load_scene("tiny-doorway")
    model, rng = compiled(problem), np.random.default_rng(0)
    plain = certify(problem, model, "by hand", random_multipliers(model, rng))
    proof = random_proof(model, rng)
    proof = msgspec.structs.replace(proof, bound=Pricing.of_proof(model, proof).bound)
    files = [tmp_path / "certificate.json", tmp_path / "proof.json"]
    for path, file in zip(files, (plain, proof), strict=True):
        file.save(path)
    loaded = loaded_by(code, *map(str, files))
    assert f"{CERTIFICATES}.checking" in loaded
    assert not {name for name in loaded if name.startswith(f"{CERTIFICATES}.staged")}
    assert f"{CORE}.vision.coverage" in loaded and f"{CORE}.vision.surfaces" not in loaded
    assert not {"numba", "llvmlite", "embreex"} & {name.split(".")[0] for name in loaded}
