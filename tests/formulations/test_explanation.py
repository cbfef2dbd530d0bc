import math
import re

import msgspec
import numpy as np
import pytest
from brute_force import all_paths
from counting import either
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from random_certificates import (
    as_rows,
    random_multipliers,
    random_proof,
    random_reference,
    some_model,
)
from strategies import WALL, examples, standing, tiny

from cocap_opt.coordination.best_response import replans
from cocap_opt.formulations.certificates import (
    CertificateFile,
    Multipliers,
    Pricing,
    ProofFile,
    Row,
)
from cocap_opt.formulations.certificates.resources import Cells, Swap
from cocap_opt.formulations.explanation import explain
from cocap_opt.formulations.result import certify
from cocap_opt.model import Model, compiled
from cocap_opt.problem import Cell, Plan, Problem, State
from cocap_opt.referee import check
from cocap_opt.run.explained import Explained
from cocap_opt.run.explained_words import explained_sentences
from cocap_opt.world.workspace import HeightMap

ROUNDING = 1e-9  # relative to the bound


def random_plan(problem: Problem, rng: np.random.Generator) -> Plan:
    """A path for each robot, whatever the rules between them."""
    paths = []
    for robot in range(len(problem.robots)):
        own = all_paths(problem, robot)
        assume(own)
        paths.append(own[int(rng.integers(len(own)))])
    return Plan(paths=tuple(paths))


def random_file(model: Model, rng: np.random.Generator) -> CertificateFile | ProofFile:
    """A certificate or a proof with random numbers, which claims what they prove or more."""
    kind = rng.integers(5)
    file: CertificateFile | ProofFile
    if kind < 2:
        file = random_proof(model, rng)
        file = msgspec.structs.replace(file, bound=Pricing.of_proof(model, file).bound)
    elif kind == 2:
        file = certify(model.problem, model, "random", random_reference(model.problem, rng))
    else:
        file = certify(model.problem, model, "random", random_multipliers(model, rng))
    more = float(rng.choice([0.0, 0.0, 2.5]))
    return msgspec.structs.replace(file, bound=file.bound + more) if file.bound else file


any_problem = either(st.one_of(problems(most_plans=300, over_time=True), meetings()))


@examples(12)
@given(problem=any_problem, seed=st.integers(0, 100_000))
def test_the_terms_add_up_and_show_what_is_broken(problem: Problem, seed: int) -> None:
    """Whatever the numbers, plan and rules: the sum is bound - J, and below 0 is a broken rule."""
    rng = np.random.default_rng(seed)
    plan, model = random_plan(problem, rng), some_model(problem, rng)
    file, verdict = random_file(model, rng), check(problem, plan)
    assume(file.bound is not None and math.isfinite(file.bound))
    found = explain(compiled(problem), plan, verdict.reward, file)
    size = max(found.bound, verdict.reward, 1.0)
    assert found.total() == pytest.approx(found.bound - verdict.reward, abs=ROUNDING * size)
    below = [term for term in found.terms if term.amount < -ROUNDING * size]
    assert all(term.kind == "row" and term.is_broken for term in below)
    for term in found.of_kind("decision"):
        more = len(term.users or ()) - (term.robots or 0)
        assert more <= 0 if term.sense == "at most" else more >= 0
    if verdict.valid:
        assert not below
        assert not any(term.is_broken for term in found.terms)
    assert found.losses().shape == (len(problem.robots), problem.horizon)
    assert found.losses().sum() == pytest.approx(found.total("path"))


def test_terms_of_a_proof_tell_its_leaves_from_its_claim() -> None:
    """The claim is what the file says above its leaves; what nobody may use has no price."""
    model = compiled(tiny())
    one = (State(0, 0), State(1, 0), State(0, 0))
    plan = Plan(paths=(one, tuple(State(3, 2, heading=2) for _ in one)))
    reward, closed, above = check(model.problem, plan).reward, 0, 0.0
    for seed in (0, 1):
        proof = random_proof(model, np.random.default_rng(seed))
        pricing = Pricing.of_proof(model, proof)
        file = msgspec.structs.replace(proof, bound=pricing.bound + 2.5)
        found = explain(model, plan, reward, file, pricing.bound)
        assert found.leaf is not None
        assert found.leaf.bound == pricing.leaves[found.leaf.position]
        assert found.total("claim") == pytest.approx(2.5)
        assert found.total("leaves") == pricing.bound - found.leaf.bound
        assert found.total() == pytest.approx(found.gap, abs=ROUNDING * found.bound)
        alone = explain(model, plan, reward, file)
        assert alone.total("leaves") == file.bound - found.leaf.bound
        assert alone.total("claim") == 0.0
        some = [t for t in found.of_kind("decision") if (t.sense, t.robots) == ("at most", 0)]
        assert all(term.price == 0.0 for term in some)
        closed, above = closed + len(some), max(above, found.total("leaves"))
    assert closed
    assert above > 0


def test_a_broken_rule_is_a_negative_term() -> None:
    """Two drones in a cell that costs 5 are worth 5 more than the rule allows."""
    problem = tiny()
    robots = (problem.robots[0], problem.robots[1].replace(start=State(2, 0, heading=2)))
    problem = problem.replace(robots=robots)
    model, shape = compiled(problem), (problem.horizon + 1, len(problem.face_weights))
    meeting = Row(Cells(1, (Cell(1, 0),)), 5.0)
    elsewhere = Row(Cells(2, (Cell(3, 2),)), 3.0)
    numbers = Multipliers(
        as_rows(np.ones(shape)), as_rows(np.zeros(shape)), rows=(meeting, elsewhere)
    )
    file = certify(problem, model, "by hand", numbers)
    one = (State(0, 0), State(1, 0), State(0, 0))
    other = (State(2, 0, heading=2), State(1, 0, heading=2), State(2, 0, heading=2))
    verdict = check(problem, Plan(paths=(one, other)))
    assert len(verdict.conflicts) == 1
    found = explain(model, Plan(paths=(one, other)), verdict.reward, file)
    broken, unused = found.of_kind("row")
    assert (broken.amount, broken.users, broken.is_broken) == (-5.0, (0, 1), True)
    assert (unused.amount, unused.users, unused.is_broken) == (3.0, (), False)
    assert found.total() == pytest.approx(found.gap, rel=ROUNDING)
    free = certify(problem, model, "by hand", msgspec.structs.replace(numbers, rows=(elsewhere,)))
    plan = Plan(paths=(one, other))
    told = [
        " ".join(
            explained_sentences(Explained(model, plan, explain(model, plan, verdict.reward, own)))
        )
        for own in (file, free)
    ]
    assert ["without a price there" in words for words in told] == [False, True]
    assert "Drones 0 and 1 are in one cell at step 1, which breaks a rule without" in told[1]


def test_only_rules_at_the_choke_point_are_priced_there() -> None:
    """Of rules at the cell where all must pass and beyond it, the sentence adds the former."""
    heights = np.zeros((5, 3))
    heights[2, [0, 2]] = WALL
    problem = tiny().replace(
        height_map=HeightMap(heights=heights, resolution=4.0),
        robots=tuple(robot.replace(start=State(0, y)) for y, robot in enumerate(tiny().robots)),
        actors=(standing(18.0, 6.0, 0.0, 0.0, steps=5),), horizon=4,
    )  # fmt: skip
    model, shape = compiled(problem), (problem.horizon + 1, len(problem.face_weights))
    choke, door, beyond = Cell(1, 1), Cell(2, 1), Cell(3, 1)  # all drones meet before the door
    rows = (
        Row(Cells(2, (choke,)), 5.0),
        Row(Cells(2, (door,)), 30.0),
        Row(Swap(2, (Cell(0, 1), choke)), 2.0),
        Row(Swap(3, (Cell(4, 1), beyond)), 40.0),
    )
    numbers = Multipliers(as_rows(np.ones(shape)), as_rows(np.ones(shape)), rows=rows)
    file = certify(problem, model, "by hand", numbers)
    plan = Plan(paths=tuple((robot.start,) * 5 for robot in problem.robots))
    found = explain(model, plan, check(problem, plan).reward, file)
    (told,) = (
        words for words in explained_sentences(Explained(model, plan, found)) if "must" in words
    )
    assert "both drones must pass cell (1, 1) to reach" in told
    assert re.search(r"; rules there carry prices of .* % of the bound \(7\.00\)\.$", told)


@examples(6)
@given(problem=problems(most_plans=100), seed=st.integers(0, 1000))
def test_replans_gain_what_going_through_all_paths_gains(problem: Problem, seed: int) -> None:
    """Each drone's gain is the largest of any of its paths that keeps the rules with the others."""
    plan = random_plan(problem, np.random.default_rng(seed))
    value = check(problem, plan).reward
    found = {one.robot: one for one in replans(compiled(problem), plan)}
    for robot in range(len(problem.robots)):
        others = {tuple(sorted(pair)) for pair in conflicts_without(problem, plan, robot)}
        best = -math.inf
        for path in all_paths(problem, robot):
            paths = (*plan.paths[:robot], path, *plan.paths[robot + 1 :])
            changed = Plan(paths=paths)
            met = {tuple(sorted(c.robots)) for c in changed.conflicts(problem)}
            if met <= others:
                best = max(best, check(problem, changed).reward)
        assert (robot in found) == (best > -math.inf)
        if robot in found:
            assert found[robot].gain == pytest.approx(best - value, abs=1e-9 * max(value, 1.0))
            assert check(problem, found[robot].plan).reward == pytest.approx(best)


def conflicts_without(problem: Problem, plan: Plan, robot: int) -> list[tuple[int, int]]:
    """Pairs of other robots than this one that conflict."""
    return [c.robots for c in plan.conflicts(problem) if robot not in c.robots]
