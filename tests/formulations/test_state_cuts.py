"""State cuts: what makes them valid, and what is refused."""

import math
from collections import defaultdict
from itertools import product

import msgspec
import numpy as np
import pytest
from brute_force import optimum
from hypothesis import given, reject
from hypothesis import strategies as st
from pool import meetings, problems
from random_certificates import as_rows, random_multipliers, random_state_cuts
from strategies import examples, tiny

from cocap_opt.formulations.certificates import (
    CertificateError,
    ClassCurve,
    ClassPayments,
    EnvelopeCut,
    Multipliers,
    Pricing,
    StateCut,
)
from cocap_opt.formulations.certificates.pricing import UNIT_ROUNDOFF, CertificatePrices
from cocap_opt.formulations.certificates.state_cuts import CutByStates, pixels_of
from cocap_opt.formulations.result import certify
from cocap_opt.formulations.second_opinion import SecondOpinion, _highest_of
from cocap_opt.model import Model, compiled
from cocap_opt.problem import NO_RULES, Objective, Problem, State
from cocap_opt.stop import LimitReached, WorkLimit

SEEDS = st.integers(0, 1000)
some_problems = st.one_of(meetings(), meetings(team=3), problems(robots=[1, 2, 3]))


def line_or_root(pixels: float, slope: float) -> float:
    """The root, or left of where it touches the line of a slope, the line."""
    if pixels < 1 / (4 * slope**2):
        return 1 / (4 * slope) + slope * pixels
    return math.sqrt(pixels)


def choices_of(model: Model, cut: CutByStates) -> list[list[tuple[float, float]]]:
    """For each cell, the pixels and phi of its listed states, and of nobody there."""
    by_cell = defaultdict(lambda: [(0.0, 0.0)])
    for number, (states, _, values) in cut.listed.items():
        graph = model.classes[number].graph
        seen = pixels_of(model, number, cut.view_sum, states)
        for state, pixels, value in zip(states.tolist(), seen, values, strict=True):
            cell = model.places.cells[number][state % graph.n_places]
            by_cell[cell].append((float(pixels), float(value)))
    return [*by_cell.values()]


@examples(30)
@given(some_problems, SEEDS)
def test_the_constant_is_that_of_the_highest_set_of_listed_states(
    problem: Problem, seed: int
) -> None:
    """Of all sets of listed states in different cells; sets that are too many are left out."""
    model, judged = compiled(problem), 0
    for spec in random_state_cuts(model, np.random.default_rng(seed)):
        cut = spec.valid(model)
        choices = choices_of(model, cut)
        if math.prod(map(len, choices)) > 20_000:
            continue
        highest = max(
            line_or_root(sum(pixels for pixels, _ in chosen), cut.slope)
            - sum(value for _, value in chosen)
            for chosen in product(*choices)
        )
        assert cut.constant == pytest.approx(max(highest, 0.25 / cut.slope), rel=1e-9, abs=1e-9)
        assert _highest_of(choices, cut.slope) == pytest.approx(highest, rel=1e-9, abs=1e-9)
        judged += 1
    if not judged:
        reject()


@examples(30)
@given(some_problems, SEEDS)
def test_a_state_cut_holds_wherever_robots_are(problem: Problem, seed: int) -> None:
    """In any states in different cells, reachable or not, each robot of any class."""
    model, rng = compiled(problem), np.random.default_rng(seed)
    cuts = [spec.valid(model) for spec in random_state_cuts(model, rng)]
    if not cuts:
        reject()
    for _ in range(30):
        cells, team = set(), []
        for robot in rng.permutation(len(problem.robots)).tolist():
            robot_class = model.class_of[robot]
            graph = robot_class.graph
            free = np.flatnonzero(np.tile(graph.free, graph.n_orientations))
            state = int(rng.choice(free))
            cell = model.places.cells[robot_class.number][state % graph.n_places]
            if cell not in cells:
                cells.add(cell)
                team.append((robot_class.number, state))
        for cut in cuts:
            seen, paid = 0.0, 0.0
            for number, state in team:
                pixels = pixels_of(model, number, cut.view_sum, np.array([state]))
                seen += float(pixels[0])
                paid += float(cut.phi(number, np.array([state]), np.sqrt(pixels))[0])
            assert math.sqrt(seen) <= (cut.constant + paid) * (1 + 1e-12) + 1e-9


@examples(30)
@given(some_problems, SEEDS)
def test_bounds_with_state_cuts_hold(problem: Problem, seed: int) -> None:
    """Whatever the numbers are, no plan has more."""
    model, rng = compiled(problem), np.random.default_rng(seed)
    multipliers = random_multipliers(model, rng)
    if not multipliers.state_cuts:
        reject()
    assert Pricing.of(model, multipliers).bound >= optimum(problem).value * (1 - 1e-9) - 1e-9


def multipliers_with(problem: Problem, cut: StateCut) -> Multipliers:
    """Multipliers that pay roots, and one state cut."""
    shape = problem.view_sum_steps, len(problem.face_weights)
    ones, zeros = as_rows(np.ones(shape)), as_rows(np.zeros(shape))
    return Multipliers(ones, zeros, state_cuts=(cut,))


GOOD = StateCut(1, 0, (ClassPayments(0, (State(1, 0), State(2, 0)), (1.0, 2.0)),), 0.1, 0.5)


def part(**changes: object) -> StateCut:
    """The good cut with other payments of its class."""
    return msgspec.structs.replace(
        GOOD, payments=(msgspec.structs.replace(GOOD.payments[0], **changes),)
    )


def test_rounding_of_a_constant_grows_with_its_listed_states() -> None:
    """It may add up numbers of all of them, though there are far fewer robots."""
    problem = tiny()
    model = compiled(problem)
    graph = model.classes[0].graph
    free = np.flatnonzero(np.tile(graph.free, graph.n_orientations))
    states = tuple(map(graph.state, free.tolist()))
    many = part(states=states, values=(1.0,) * len(states))
    few, all_of_them = (
        CertificatePrices.of(model, multipliers_with(problem, cut)).rounding_factor
        for cut in (GOOD, many)
    )
    assert len(states) > 10
    assert all_of_them - few >= 2 * (len(states) - 2) * UNIT_ROUNDOFF


@pytest.mark.parametrize(
    ("cut", "words"),
    [
        (msgspec.structs.replace(GOOD, t=3), "no view sum"),
        (msgspec.structs.replace(GOOD, face=-1), "no view sum"),
        (msgspec.structs.replace(GOOD, share=1.5), "share"),
        (msgspec.structs.replace(GOOD, share=math.nan), "share"),
        (msgspec.structs.replace(GOOD, slope=0.0), "slope"),
        (msgspec.structs.replace(GOOD, slope=-1.0), "slope"),
        (msgspec.structs.replace(GOOD, slope=math.inf), "slope"),
        (msgspec.structs.replace(GOOD, slope=math.nan), "slope"),
        (msgspec.structs.replace(GOOD, payments=GOOD.payments * 2), "robot_class"),
        (part(class_number=1), "robot_class"),
        (part(class_number=-1), "robot_class"),
        (part(states=()), "states"),
        (part(states=(State(1, 0), State(1, 0))), "distinct"),
        (part(states=(State(1, 0), State(99, 0))), "not a state"),
        (part(states=(State(1, 0), State(1, 0, heading=99))), "not a state"),
        (part(values=(1.0,)), "values"),
        (part(values=(1.0, -1.0)), "values"),
        (part(values=(1.0, math.nan)), "values"),
    ],
)
def test_state_cuts_that_are_none_are_refused(cut: StateCut, words: str) -> None:
    """A cut must belong to a view sum, and have numbers of states that there are."""
    problem = tiny()
    assert math.isfinite(Pricing.of(compiled(problem), multipliers_with(problem, GOOD)).bound)
    with pytest.raises(CertificateError, match=words):
        Pricing.of(compiled(problem), multipliers_with(problem, cut))


def test_where_robots_may_share_a_cell_there_are_no_state_cuts() -> None:
    """Nor where pixels add up over time."""
    problem = tiny()
    shared = problem.replace(rules=NO_RULES)
    with pytest.raises(CertificateError, match="share a cell"):
        Pricing.of(compiled(shared), multipliers_with(shared, GOOD))
    summed = problem.replace(objective=Objective(over_time=True))
    with pytest.raises(CertificateError, match="over time"):
        Pricing.of(compiled(summed), multipliers_with(summed, GOOD))


def test_what_cuts_of_no_share_leave_is_all_of_the_root() -> None:
    """Exactly: alpha of 1 needs no beta. What is less, by however little, does."""
    problem = tiny()
    model = compiled(problem)
    multipliers = multipliers_with(problem, msgspec.structs.replace(GOOD, share=0.0))
    without = Pricing.of(model, msgspec.structs.replace(multipliers, state_cuts=())).bound
    assert Pricing.of(model, multipliers).bound == pytest.approx(without, rel=1e-12)
    less = as_rows(np.full(np.shape(multipliers.alpha), 1 - 1e-16))
    with pytest.raises(CertificateError, match="less than the share of the root that cuts leave"):
        Pricing.of(model, msgspec.structs.replace(multipliers, alpha=less))


def test_cuts_of_faces_that_nobody_can_see_add_nothing() -> None:
    """Nor does anybody pay less for them."""
    problem = tiny()
    model = compiled(problem)
    seen = {*model.coverage(model.classes[0]).view_sums.tolist()}
    unseen = next(z for z in range(len(problem.view_sum_weights)) if z not in seen)
    t, face = divmod(unseen, model.n_faces)
    multipliers = multipliers_with(problem, msgspec.structs.replace(GOOD, t=t, face=face))
    curve = ClassCurve(0, (1.0,), (0.5,))
    both = msgspec.structs.replace(multipliers, cuts=(EnvelopeCut(t, face, (curve,), 0.5),))
    without = Pricing.of(model, msgspec.structs.replace(multipliers, state_cuts=())).bound
    for more in (multipliers, both):
        pricing = Pricing.of(model, more)
        assert pricing.bound == pytest.approx(without, rel=1e-12)
        file = certify(problem, model, "test", more)
        assert SecondOpinion.of(model, file).agrees(pricing)


def test_a_cut_of_many_states_honours_a_limit() -> None:
    """Its constant may take long."""
    problem = tiny()
    limit = WorkLimit(1)
    limit.count_work()
    limit.count_work()
    with pytest.raises(LimitReached):
        GOOD.valid(compiled(problem), limit)
