import math

import msgspec
import numpy as np
import pytest
from brute_force import objective_from_scratch, optimum
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples, problems, tiny

from cocap_opt.check import check
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import NO_RULES, Cell, Problem
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.reward import no_pixels
from cocap_opt.stop import Limit, TimeLimit, never
from formulations import BOUNDS, EXACT
from formulations.certificate import (
    CellsRow,
    CertificateError,
    CertificateFile,
    Multipliers,
    ReferencePixels,
    SwapRow,
    certify,
    price,
    verify,
)

TOLERANCE = 1e-9


@pytest.mark.parametrize("method", BOUNDS)
@examples(25)
@given(problem=problems())
def test_no_certified_bound_is_below_the_optimum(method: str, problem: Problem) -> None:
    """plan <= optimum <= bound, for every method, rule, class of robots and goal."""
    best = optimum(problem)
    result = BOUNDS[method](problem, never, best.plan)
    assert result.bound >= best.value
    if result.reason is Reason.INFEASIBLE:
        assert best.plan is None
    assert verify(problem, result.certificate).bound == result.bound


@examples(25)
@given(problem=problems(robots=st.just(1)))
def test_single_view_cuts_are_exact_for_one_robot(problem: Problem) -> None:
    """For one robot the relaxation with single-view cuts is the shortest-path polytope."""
    best = optimum(problem).value
    bound = BOUNDS["column-generation"](problem, never, None).bound
    if math.isfinite(best):
        assert bound == pytest.approx(best, rel=1e-5, abs=1e-4)
    else:
        assert bound < 0


@examples(20)
@given(problem=problems())
def test_cone_program_and_column_generation_agree(problem: Problem) -> None:
    """Both solve the relaxation with single-view cuts; only rows between robots may differ.

    Column generation adds cliques where the rules ask for a separation, which may be
    tighter than the cone program's pairs; otherwise the two values are the same.
    """
    cone = BOUNDS["relaxation"](problem, never, None)
    columns = BOUNDS["column-generation"](problem, never, None)
    if Reason.INFEASIBLE in (cone.reason, columns.reason):
        return
    if not problem.rules.separation:
        assert columns.bound == pytest.approx(cone.bound, rel=2e-4, abs=1e-2)


@examples(25)
@given(problem=problems())
def test_brute_force_equals_the_independent_oracle(problem: Problem) -> None:
    """The product's brute force and the tests' own, which shares no code with it, agree."""
    best, result = optimum(problem), EXACT["brute-force"](problem, never)
    assert result.value == pytest.approx(best.value, rel=TOLERANCE, abs=TOLERANCE)
    assert result.reason is (Reason.OPTIMAL if best.plan else Reason.INFEASIBLE)
    if result.plan:
        assert objective_from_scratch(problem, result.plan) == pytest.approx(result.value)
        assert check(problem, result.plan).valid


def test_brute_force_refuses_what_it_cannot_enumerate() -> None:
    """Too many plans is misuse, said in words, not an endless run."""
    problem = tiny()
    poses = problem.actors[0].poses
    longer = problem.actors[0].replace(poses=np.concatenate([poses] * 5))
    with pytest.raises(UnsupportedError, match="at most"):
        EXACT["brute-force"](problem.replace(actors=(longer,), horizon=12), never)


@examples(40)
@given(problem=problems(), seed=st.integers(0, 1000))
def test_any_multipliers_give_a_bound(problem: Problem, seed: int) -> None:
    """However badly a solver converged: non-negative multipliers are a valid certificate."""
    rng = np.random.default_rng(seed)
    shape = (problem.horizon + 1, len(problem.face_weights))
    alpha = rng.choice([0.0, 0.3, 1.0, 2.0], size=shape)
    beta = rng.choice([1e-4, 0.01, 1.0], size=shape)
    rows = random_rows(problem, rng)
    certificate = Multipliers(as_rows(alpha), as_rows(beta), tuple(rows))
    assert price(compiled(problem), certificate).bound >= optimum(problem).value
    reference = ReferencePixels(as_rows(rng.choice([0.0, 10.0, 1e4], size=shape)))
    assert price(compiled(problem), reference).bound >= optimum(problem).value


def as_rows(array: np.ndarray) -> tuple[tuple[float, ...], ...]:
    """Nested tuples of a 2-D array."""
    return tuple(map(tuple, array.tolist()))


def random_rows(problem: Problem, rng: np.random.Generator) -> list[CellsRow | SwapRow]:
    """Valid conflict rows with random multipliers."""
    if problem.rules.none:
        return []
    width, depth = problem.height_map.shape
    cells = [Cell(x, y, layer) for x in range(width) for y in range(depth)
             for layer in range(len(problem.layers))]  # fmt: skip
    rows: list[CellsRow | SwapRow] = []
    for cell in cells:
        clique = [cell]
        for other in cells:
            if other not in clique and all(problem.too_close(other, c) for c in clique):
                clique.append(other)
        t = int(rng.integers(problem.horizon + 1))
        rows.append(CellsRow(t, tuple(clique), float(rng.choice([0.0, 1.0, 50.0]))))
        if problem.rules.swap and len(cells) > 1:
            other = cells[(cells.index(cell) + 1) % len(cells)]
            t = int(rng.integers(problem.horizon))
            rows.append(SwapRow(t, (cell, other), float(rng.choice([0.5, 20.0]))))
    return rows


def small_certificate() -> tuple[Problem, CertificateFile]:
    """A certificate with all its parts, of the tiny instance."""
    problem = tiny()
    rng = np.random.default_rng(1)
    shape = (problem.horizon + 1, len(problem.face_weights))
    certificate = Multipliers(
        as_rows(rng.uniform(0.2, 0.9, shape)),
        as_rows(rng.uniform(0.01, 0.1, shape)),
        tuple(random_rows(problem, rng)),
    )
    return problem, certify(problem, compiled(problem), "test", certificate)


def numbers(content: object, path: tuple = ()) -> list[tuple]:
    """Paths to all numbers in plain data."""
    if isinstance(content, dict):
        return [p for key, value in content.items() for p in numbers(value, (*path, key))]
    if isinstance(content, list):
        return [p for k, value in enumerate(content) for p in numbers(value, (*path, k))]
    return [path] if isinstance(content, (int, float)) else []


@pytest.mark.parametrize("change", [-1.0, -1e-3, 1e-3, 1.0, 1e6, 1e300])
def test_an_altered_number_is_refused_or_the_claim_still_holds(change: float) -> None:
    """Whatever single number of a certificate is changed, verify never accepts a false bound."""
    problem, file = small_certificate()
    best = optimum(problem).value
    plain = msgspec.to_builtins(file)
    for path in numbers(plain):
        altered = msgspec.json.decode(msgspec.json.encode(plain))
        inner = altered
        for key in path[:-1]:
            inner = inner[key]
        old = inner[path[-1]]
        inner[path[-1]] = int(old + change) if isinstance(old, int) else old + change
        try:
            claim = msgspec.convert(altered, CertificateFile)
            verify(problem, claim)
        except (CertificateError, msgspec.ValidationError):
            continue
        assert claim.bound >= best, path


def test_a_certificate_that_claims_too_much_is_refused() -> None:
    """The claimed bound may be weaker than what the multipliers prove, never stronger."""
    problem, file = small_certificate()
    verify(problem, msgspec.structs.replace(file, bound=file.bound * 1.01))
    with pytest.raises(CertificateError, match="bound"):
        verify(problem, msgspec.structs.replace(file, bound=file.bound * (1 - 1e-9)))
    with pytest.raises(CertificateError, match="bound"):
        verify(problem, msgspec.structs.replace(file, bound=math.nan))


def test_a_certificate_of_another_scene_is_refused() -> None:
    """A certificate belongs to one problem, its rules included."""
    problem, file = small_certificate()
    for other in (problem.replace(rules=NO_RULES), problem.replace(face_samples=3)):
        with pytest.raises(CertificateError, match="another scene"):
            verify(other, file)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        (CellsRow(0, (Cell(0, 0), Cell(0, 1)), 1.0), "at once"),
        (CellsRow(3, (Cell(0, 0),), 1.0), "t: must be"),
        (CellsRow(-1, (Cell(0, 0),), 1.0), "t: must be"),
        (CellsRow(1, (Cell(0, 9),), 1.0), "outside"),
        (CellsRow(1, (Cell(0, 0), Cell(0, 0)), 1.0), "differ"),
        (CellsRow(1, (Cell(0, 0),), -1.0), "multiplier"),
        (CellsRow(1, (Cell(0, 0),), math.nan), "multiplier"),
        (SwapRow(2, (Cell(0, 0), Cell(0, 1)), 1.0), "t: must be"),
        (SwapRow(0, (Cell(0, 0), Cell(0, 0)), 1.0), "differ"),
    ],
)
def test_rows_that_a_plan_may_break_are_refused(row: CellsRow | SwapRow, words: str) -> None:
    """Only rows that every allowed plan obeys may carry a multiplier."""
    problem, file = small_certificate()
    assert isinstance(file.certificate, Multipliers)
    certificate = msgspec.structs.replace(file.certificate, rows=(row,))
    with pytest.raises(CertificateError, match=words):
        price(compiled(problem), certificate)


def test_rows_need_their_rule() -> None:
    """Without collision rules no conflict row is valid."""
    problem, file = small_certificate()
    free = problem.replace(rules=NO_RULES)
    with pytest.raises(CertificateError, match="rows"):
        price(compiled(free), file.certificate)


@pytest.mark.parametrize("method", BOUNDS)
def test_a_time_limit_still_gives_a_certified_bound(method: str) -> None:
    """With no time at all a method returns a valid bound and says what stopped it."""
    problem = tiny()
    result = BOUNDS[method](problem, TimeLimit(0), None)
    assert result.bound >= optimum(problem).value
    if method in ("column-generation", "relaxation"):
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)


def test_no_actors_means_a_bound_of_zero() -> None:
    """Where there is nothing to see, every bound is 0."""
    problem = tiny().replace(actors=())
    for method in BOUNDS.values():
        assert method(problem, never, None).bound == pytest.approx(0.0, abs=1e-6)


@examples(10)
@given(problem=problems())
def test_bounds_are_deterministic(problem: Problem) -> None:
    """The same problem gives the same certificate, number for number."""
    first, second = (BOUNDS["column-generation"](problem, never, None) for _ in range(2))
    assert first.certificate == second.certificate


def test_online_bound_is_tight_where_nothing_can_be_gained() -> None:
    """The online bound of a plan that sees all there is to see equals its J."""
    problem = tiny().replace(horizon=1)
    greedy = PLANNERS["greedy-rounds"](problem, never)
    bound = BOUNDS["online"](problem, never, greedy.plan).bound
    assert bound >= greedy.value
    alone = BOUNDS["alone"](problem, never, None).bound
    assert price(compiled(problem), ReferencePixels(
        as_rows(no_pixels(problem).reshape(2, -1)))).bound == alone  # fmt: skip


def test_a_robot_that_cannot_reach_its_goal_is_a_proof() -> None:
    """Where one robot of a class has no path, every bound says that there is no plan."""
    problem = tiny().replace(horizon=1)
    robots = tuple(robot.replace(goal=(0, 0)) for robot in problem.robots)
    for method in BOUNDS.values():
        result = method(problem.replace(robots=robots), never, None)
        assert result.bound == -math.inf
