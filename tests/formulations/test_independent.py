"""The checker of one file agrees with the referee, brute force and certificates, and refuses."""

import contextlib
import io
import itertools
import json
import math
import os
import random
import re
import subprocess
import sys
from collections import Counter
from fractions import Fraction
from hashlib import sha256
from pathlib import Path
from typing import Any

import damaged_files
import numpy as np
import pytest
import staged_hunt
from brute_force import optimum
from counting import either
from damaged_files import document
from goals import with_areas
from hypothesis import assume, given
from hypothesis import strategies as st
from msgspec.structs import replace
from random_certificates import random_multipliers, random_staged, some_model
from strategies import drawn_meetings, drawn_problems, examples, tiny

from cocap_opt.cli.commands import run
from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.certificates import CertificateFile, Pricing, Staged
from cocap_opt.formulations.certificates.format import Tail
from cocap_opt.formulations.certificates.staged import (
    first_tail,
    may_be_used,
    may_begin_later,
    price_staged,
)
from cocap_opt.formulations.column_generation.branch_and_price import searchless
from cocap_opt.formulations.independent import cocap_check, instance_of
from cocap_opt.formulations.independent.cocap_check import ONE, Instance, Refused
from cocap_opt.formulations.result import certify
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import COVERAGE_VERSION, NO_RULES, Objective, Plan, Problem, State
from cocap_opt.referee import check
from cocap_opt.result import UnsupportedError
from cocap_opt.scenarios import load_scene

problems = st.one_of(
    either(drawn_problems(over_time=True)), either(drawn_meetings(2)), drawn_meetings(3),
    either(with_areas((1, 2, 3))),
)  # fmt: skip


def instance(problem: Problem) -> Instance:
    """The instance of a problem, written and read."""
    return Instance(instance_of(compiled(problem)))


def plan_document(problem: Problem, plan: Plan, folder: Path) -> dict[str, Any]:
    """The file of a plan as the checker reads it."""
    return document(PlanFile.of(problem, plan, 0.0, "test"), folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for files."""
    return tmp_path_factory.mktemp("independent")


@examples(60)
@given(problems, st.randoms(use_true_random=False))
def test_j_of_a_plan_is_the_referees(folder: Path, problem: Problem, random: Any) -> None:
    """Valid plans have the referee's J, rounded down; all others are refused."""
    model = compiled(problem)
    known = instance(problem)
    paths = []
    for robot, robot_class in enumerate(model.class_of):
        states = [random.choice(model.starts(robot).tolist())]
        for t in range(problem.horizon):
            after = robot_class.graph.successors(t, states[-1]).tolist()
            assume(after)
            states.append(random.choice(after))
        paths.append(tuple(robot_class.graph.state(state) for state in states))
    if random.random() < 0.2:  # anywhere, which is hardly ever allowed
        paths[0] = (*paths[0][:-1], State(0, 0))
    plan = Plan(paths=tuple(paths))
    verdict = check(problem, plan)
    if not verdict.valid:
        with pytest.raises((Refused, ValueError)):
            cocap_check.value_of_plan(known, plan_document(problem, plan, folder))
        return
    value = cocap_check.value_of_plan(known, plan_document(problem, plan, folder)) / ONE
    assert value == pytest.approx(verdict.reward, rel=1e-12, abs=1e-9)


@examples(60)
@given(problems, st.sampled_from(["alone", "online", "envelope", "column-generation"]))
def test_bounds_are_those_of_certificates(folder: Path, problem: Problem, method: str) -> None:
    """Optimum <= exact bound <= the claim; by the multipliers alone where the rest is searched."""
    try:
        file = BOUNDS[method](problem).certificate
    except UnsupportedError:
        assume(False)
    assume(file is not None)
    bound, is_part = cocap_check.bound_of_file(instance(problem), document(file, folder))
    best = optimum(problem).value
    if bound is None:
        assert best == -np.inf
        return
    assert bound / ONE >= best - 1e-12 * abs(best)
    assert is_part or bound / ONE <= file.proved


@examples(40)
@given(problems)
def test_proofs_without_a_search(folder: Path, problem: Problem) -> None:
    """A tree of decisions proves what it claims, by exact numbers."""
    result = searchless(problem)
    best = optimum(problem).value
    bound, is_part = cocap_check.bound_of_file(
        instance(problem), document(result.certificate, folder)
    )
    assert not is_part
    if bound is None or bound < 0:
        assert best == -np.inf
    else:
        assert best - 1e-12 * abs(best) <= bound / ONE <= result.certificate.proved


def staged_bound(problem: Problem, staged: Staged, bound: float, folder: Path) -> float:
    """What the checker finds that a staged certificate proves."""
    file = CertificateFile(
        scene=problem.name, digest=problem_digest(problem), method="test", classes="alike",
        coverage_version=COVERAGE_VERSION, bound=max(bound, 0.0), certificate=staged,
    )  # fmt: skip
    found, is_part = cocap_check.bound_of_file(instance(problem), document(file, folder))
    assert found is not None and not is_part
    return found / ONE


@examples(60)
@given(problems, st.integers(0, 10**9))
def test_staged_certificates(folder: Path, problem: Problem, seed: int) -> None:
    """Optimum <= the bound of stages and paths, which is no more than `verify` finds."""
    assume(not problem.objective.over_time)
    rng, best = np.random.default_rng(seed), optimum(problem).value
    model = compiled(problem)
    value = best if np.isfinite(best) else 0.0
    target = float(rng.choice([value * 0.999 - 1e-3, value, rng.uniform(0, 1.2) * value, -1.0]))
    staged = random_staged(model, target, rng, moves=True)
    pricing = price_staged(model, staged)
    bound = staged_bound(problem, staged, pricing.bound, folder)
    assert bound >= max(target, best) - 1e-12 * abs(best)
    assert bound <= pricing.bound + 1e-9 * (1 + abs(pricing.bound))


@examples(20)
@given(st.one_of(either(drawn_problems()), drawn_meetings(3)), st.integers(0, 10**9))
def test_paths_from_any_step_prove_what_whole_paths_prove(
    folder: Path, problem: Problem, seed: int
) -> None:
    """The best plan above the target, wherever the exploration begins; `verify` agrees."""
    objective = Objective(pixels=problem.objective.pixels, views=problem.objective.views)
    problem = problem.replace(objective=objective)
    rng, best = np.random.default_rng(seed), optimum(problem).value
    model = compiled(problem)
    assume(np.isfinite(best) and may_begin_later(model))
    target = best - float(rng.choice([0.0, 0.1])) * (1 + abs(best))
    staged = random_staged(model, target, rng, moves=True)
    whole = replace(staged, paths_above=staged.target, paths_from=None, tails=())
    expected = staged_bound(problem, whole, best, folder)
    for middle in range(1, problem.horizon + 1):
        part = replace(whole, paths_from=middle)
        bound = staged_bound(problem, part, best, folder)
        assert bound == pytest.approx(expected, rel=1e-9, abs=1e-9)
        assert bound <= price_staged(model, part).bound + 1e-9 * (1 + abs(best))


@examples(60)
@given(
    st.one_of(either(drawn_problems()), drawn_meetings(3)),
    st.integers(0, 10**9),
    st.sampled_from([1e4, 1e4, 2.0, 0.1]),
)
def test_both_checkers_find_the_same_losses_of_tails(
    folder: Path, problem: Problem, seed: int, loss: float
) -> None:
    """Of tails of any length alone, and of those after them."""
    objective = Objective(pixels=problem.objective.pixels, views=problem.objective.views)
    problem = problem.replace(objective=objective)
    rng, best = np.random.default_rng(seed), optimum(problem).value
    model = compiled(problem)
    assume(np.isfinite(best) and may_be_used(model))
    staged = random_staged(model, best - 0.3 * (1 + abs(best)), rng, moves=True)
    whole = replace(staged, paths_above=None, paths_from=None, tails=())
    first = first_tail(model)
    alone = [(Tail(t, loss),) for t in range(problem.horizon, first - 1, -1)]
    longer = [(*tails, Tail(tails[0].t - 1, 1e4)) for tails in alone if tails[0].t > first]
    for tails in alone + longer:
        part = replace(whole, tails=tails)
        bound = price_staged(model, part).bound
        assert bound == pytest.approx(staged_bound(problem, part, best, folder), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(
    ("middle", "above", "has_free_starts", "message"),
    [
        (0, 0.0, False, "paths_from: must be 1..2, not 0"),
        (3, 0.0, False, "paths_from: must be 1..2, not 3"),
        (1, None, False, "paths_from: not allowed without paths_above"),
        (1, 0.0, True, "paths_from: not allowed if starts are free"),
    ],
)
def test_paths_begin_at_a_step_after_fixed_starts(
    middle: int, above: float | None, has_free_starts: bool, message: str, folder: Path
) -> None:
    """Files with any other `paths_from` are refused."""
    problem = tiny()
    if has_free_starts:
        first, second = problem.robots
        starts = [first.start, first.start._replace(heading=1)]
        problem = problem.replace(robots=(first.replace(start=starts), second))
    numbers = random_multipliers(compiled(problem), np.random.default_rng(0))
    with pytest.raises(Refused, match=re.escape(message)):
        staged_bound(problem, Staged(numbers, 0.0, (), above, middle), 1.0, folder)


@pytest.mark.slow
def test_no_bound_is_false_with_constants_of_moves() -> None:
    """Of instances of up to six steps: the best J <= the bound, and without moves it is no less."""
    counts = staged_hunt.hunt(60, 1)
    assert counts["lower because of moves"] > 20
    assert counts["from the middle"] > 30
    assert counts["tails"] > 30


def proved_of_exchange(*stages: dict[str, Any]) -> float:
    """What stages prove of the two drones that may not exchange their places."""
    known = Instance(staged_hunt.EXCHANGE)
    bound, is_part = cocap_check.bound_of_file(known, staged_hunt.exchange_file(*stages))
    assert bound is not None and not is_part
    return bound / ONE


def of_step(t: int, constant: float) -> dict[str, Any]:
    """A claim of a stage."""
    return {"t": t, "constant": constant}


def zero_prices(t: int) -> dict[str, Any]:
    """Prices that are 0 as before, and the constant that they need."""
    prices = {"t": t, "robot_class": 0, "states": [], "payments": []}
    return {"payments": [prices], "constants": [of_step(t, 10.0)]}


@pytest.mark.parametrize(
    ("stages", "expected"),
    [
        ([], 20.0),
        ([{"moves": [of_step(1, 16.0)]}], 16.0),
        ([{"moves": [of_step(1, -5.0)]}], 16.0),
        ([{"moves": [of_step(1, 18.0)]}], 18.0),
        ([{"moves": [of_step(1, 18.0), of_step(1, 16.0)]}], 16.0),
        ([{"moves": [of_step(1, 16.0), of_step(1, 18.0)]}], 16.0),
        ([{"moves": [of_step(1, 25.0)]}], 20.0),
        ([{"moves": [of_step(1, 16.0), of_step(0, 25.0)]}], 20.0),
        ([{"moves": [of_step(0, 25.0), of_step(1, 16.0)]}], 16.0),
        ([{"moves": [of_step(1, 16.0)]}, zero_prices(1)], 20.0),
        ([{"moves": [of_step(1, 16.0)]}, zero_prices(2)], 20.0),
        ([{"moves": [of_step(1, 16.0)]}, {"constants": [of_step(1, 9.0)]}], 16.0),
        ([{"moves": [of_step(1, 16.0)]}, zero_prices(1) | {"moves": [of_step(1, 16.0)]}], 16.0),
    ],
)  # fmt: skip
def test_a_move_of_the_team_has_less_than_its_two_steps(
    stages: list[dict[str, Any]], expected: float
) -> None:
    """Its constant holds until one of its steps has new prices or is part of another move."""
    assert staged_hunt.best_plan(Instance(staged_hunt.EXCHANGE)) == 16.0
    assert proved_of_exchange(*stages) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(
    ("stage", "message"),
    [
        ({"moves": [of_step(-1, 16.0)]}, "t is not a step of the scene"),
        ({"moves": [of_step(2, 16.0)]}, "t is not a step of the scene"),
        ({"moves": [{"t": 1}]}, "must have the field 'constant'"),
        ({"moves": [of_step(1, 16.0) | {"until": 2}]}, "must have no field ['until']"),
        ({"moves": [of_step(1, math.inf)]}, "constant: must be a finite number"),
        (
            {"payments": zero_prices(1)["payments"], "moves": [of_step(1, 16.0)]},
            "a step with payments has no constant",
        ),
    ],
)
def test_claims_of_moves_that_are_wrong_are_refused(stage: dict[str, Any], message: str) -> None:
    """A move begins before the last step; both of its steps have constants for their prices."""
    with pytest.raises(Refused, match=re.escape(message)):
        proved_of_exchange(stage)


def test_searches_for_moves_are_within_the_limit_of_the_file() -> None:
    """If they take too many branches, only the multipliers are checked."""
    known = Instance(staged_hunt.EXCHANGE)
    file = staged_hunt.exchange_file({"moves": [of_step(1, 16.0)]})
    needed = next(n for n in range(1, 100) if not cocap_check.bound_of_file(known, file, n)[1])
    without = staged_hunt.exchange_file()
    assert not cocap_check.bound_of_file(known, without, needed - 1)[1]
    bound, is_part = cocap_check.bound_of_file(known, file, needed - 1)
    assert is_part and bound is not None and bound / ONE == pytest.approx(20)


@pytest.mark.slow
def test_damaged_claims_of_moves_prove_nothing_false() -> None:
    """Of files with constants of moves, damaged at random, none proves less than the best J."""
    draw, counts = random.Random(1), Counter[str]()
    for _ in range(40):
        known = Instance(staged_hunt.draw_instance(draw))
        best = staged_hunt.best_plan(known)
        numbers = staged_hunt.draw_staged(known, best, draw)
        bound = max(0.0, best, numbers["target"])
        file = {"format": "cocap-opt certificate", "version": 8, "digest": "drawn", "bound": bound}
        base = damaged_files.Base(known, best, file | {"certificate": numbers})
        for _ in range(10):
            damaged = damaged_files.damage(base.file, draw)
            counts[damaged_files.judge(base, damaged, harmless=False)] += 1
    assert counts["refused"] > 40 and counts["accepted, as it proves no less"] > 5


@pytest.mark.long
def test_harmless_changes_are_accepted_and_damaged_files_prove_nothing_false() -> None:
    """Of files damaged at random none is accepted that claims less than the optimum."""
    counts = damaged_files.hunt(300, 1)
    assert counts["refused"] > 100
    assert counts["harmless: accepted, as it proves no less"] > 10


def run_alone(*arguments: Path | str) -> subprocess.CompletedProcess[str]:
    """Runs the checker's file by itself, without anything that is installed."""
    command = [sys.executable, "-I", "-S", str(cocap_check.__file__), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_the_file_alone_checks_what_commands_write(tmp_path: Path) -> None:
    """It needs nothing that is installed; a claim that is too low has exit code 1."""
    names = ["x.instance", "plan.json", "proof.json"]
    instance_file, plan_file, proof_file = (tmp_path / name for name in names)
    run(["export", "corridor-tight", "-o", str(instance_file)])
    run([
        "solve", "corridor-tight", "--method", "searchless", "-o", str(plan_file),
        "--certificate", str(proof_file),
    ])  # fmt: skip
    done = run_alone(instance_file, plan_file, proof_file)
    assert done.returncode == 0, done.stdout
    told = done.stdout.splitlines()
    assert told[0] == f"instance of sha256 {sha256(instance_file.read_bytes()).hexdigest()}"
    assert told[1] == f"{plan_file}: J of this plan is at least 11383.059339"
    assert told[2].startswith(f"{proof_file}: no plan has more than 11383.06")
    proof = json.loads(proof_file.read_text())
    proof["bound"] -= 1e-5
    proof_file.write_text(json.dumps(proof))
    done = run_alone(instance_file, proof_file)
    assert done.returncode == 1
    assert done.stdout.endswith("refused: bound: claims less than its numbers prove\n")


@pytest.mark.parametrize("arguments", [["x.instance"], ["--help"], ["no.instance"]])
@pytest.mark.parametrize("output", ["/dev/full", "|"])
def test_an_answer_that_cannot_be_written_is_no_refusal(
    folder: Path, arguments: list[str], output: str
) -> None:
    """Exit code 1 would say that a claim does not hold; a closed pipe is as bad as a full disk."""
    if output == "/dev/full" and not Path(output).exists():
        pytest.skip("no /dev/full")
    (folder / "x.instance").write_text(instance_of(compiled(load_scene("tiny-doorway", 0))))
    if output == "|":
        reading, writing = os.pipe()
        os.close(reading)
    else:
        writing = os.open(output, os.O_WRONLY)
    command = [sys.executable, "-I", "-S", str(cocap_check.__file__), *arguments]
    done = subprocess.run(
        command, stdout=writing, stderr=subprocess.PIPE, text=True, cwd=folder, check=False
    )
    os.close(writing)
    assert done.returncode == 2
    assert re.fullmatch("standard output: cannot be written: .*\n", done.stderr)


def answered(instance_text: str, document: object, folder: Path) -> tuple[int, str]:
    """The checker's exit code, and its last line without the file's name."""
    paths = folder / "a.instance", folder / "a.json"
    paths[0].write_text(instance_text)
    paths[1].write_text(document if isinstance(document, str) else json.dumps(document))
    with contextlib.redirect_stdout(io.StringIO()) as told:
        code = cocap_check.main([*map(str, paths)])
    return code, told.getvalue().splitlines()[-1].partition(": ")[2]


@pytest.mark.long
def test_claims_that_are_not_checked_are_told_apart(folder: Path) -> None:
    """A claim whose search takes too long has an exit code of its own, whatever it is."""
    problem = load_scene("bottleneck", 0)
    result = BOUNDS["column-generation"](problem, start=PLANNERS["cocap-lns"](problem).plan)
    text, file = instance_of(compiled(problem)), document(result.certificate, folder)
    assert file["certificate"]["type"] == "staged"
    code, told = answered(text, file, folder)
    assert (code, told) == (0, "no plan has more than 54899.771721")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cocap_check, "MOST_BRANCHES", 100)
        code, told = answered(text, file, folder)
        assert code == 3
        assert told.endswith("multipliers; its claim rests on a search that takes too long here")
        paths = [str(folder / name) for name in ("a.instance", "a.json")]
        assert cocap_check.main(["--branches", "100000", *paths]) == 0


@pytest.mark.slow
def test_what_is_refused_in_a_certificate_is_named_by_its_place(folder: Path) -> None:
    """Of lists of numbers and objects the place is told, counted from 0, and the field."""
    problem = load_scene("corridor-tight", 0)
    result = BOUNDS["column-generation"](problem, start=PLANNERS["cocap-lns"](problem).plan)
    text, file = instance_of(compiled(problem)), document(result.certificate, folder)
    numbers = file["certificate"]
    curve_0 = {"robot_class": 0, "roots": [1.0, 2.0], "values": [1.0, 1.5]}
    numbers["multipliers"]["cuts"] = [{"t": 0, "face": 0, "share": 0.0, "curves": [curve_0]}]
    good = json.dumps(numbers)
    assert answered(text, file, folder)[0] == 0
    table = numbers["multipliers"]["beta"]

    def told(*place: str | int, value: object) -> str:
        """The answer when a value stands at a place."""
        changed = holder = json.loads(good)
        for name in place[:-1]:
            holder = holder[name]
        holder[place[-1]] = value
        code, words = answered(text, file | {"certificate": changed}, folder)
        assert code == 1
        return words.removeprefix("refused: ")

    inside = ("multipliers", "cuts", 0)
    size = f"{len(table)} rows of {len(table[0])} numbers"
    assert told("target", value="5") == "target: must be a finite number, not '5'"
    assert told("multipliers", "beta", value=5) == f"beta: must have {size}"
    assert told("multipliers", "alpha", 0, 0, value=-1) == "alpha: must be >= 0"
    assert told(*inside, "share", value=2) == "cuts[0]: share: must be 0..1"
    assert told(*inside, "shares", value=2).startswith("cuts[0]: must have no field ['shares']")
    curve = (*inside, "curves", 0)
    where = "cuts[0]: curves[0]: "
    assert (
        told(*curve, "roots", value=[2, 1]) == f"{where}roots: must be > 0, <= 1e+50 and increasing"
    )
    assert told(*curve, "values", value=[1] * 9).startswith(f"{where}values: must contain ")
    assert told(*inside, "curves", value=[{}]) == f"{where}must have the field 'roots'"
    stages = [{"payments": [], "constants": [{"t": "0", "constant": 1}]}]
    assert told("stages", value=stages) == "stages[0]: t: must be a whole number, not '0'"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"bound": "50"}, "bound: must be a finite number, not '50'"),
        ({"bound": True}, "bound: must be a finite number, not True"),
        ({"bound": None}, "bound: claims less than its numbers prove"),
        ({"format": "cocap-opt scene"}, "format: must be one of cocap-opt certificate, "),
        ({"version": 99}, "version: must be one of 3, 4, 5, 6, not 99"),
        ({"coverage_version": 99}, f"coverage_version: must be the instance's {COVERAGE_VERSION}"),
        ({"digest": "0"}, "digest: the file belongs to another scene"),
        ({"instance": "0"}, "instance: the file belongs to the instance with sha256 '0'"),
        ({"more": 1}, "must have no field ['more']; allowed: bound, certificate, "),
        ({"classes": "some"}, "classes: must be alike or single"),
    ],
)
def test_files_are_read_whole_or_refused(
    change: dict[str, object], told: str, folder: Path
) -> None:
    """Whatever the checker does not know it refuses, with exit code 1."""
    problem = load_scene("tiny-doorway", 0)
    file = document(searchless(problem).certificate, folder)
    text = instance_of(compiled(problem))
    assert answered(text, file, folder)[0] == 0
    code, line = answered(text, file | change, folder)
    assert code == 1
    assert line.startswith(f"refused: {told}")
    twice = json.dumps(file)[:-1] + ', "bound": 1.0}'
    assert answered(text, twice, folder) == (1, "refused: a field is given twice")


def test_what_is_unknown_in_a_plan_is_refused(folder: Path) -> None:
    """Versions, fields and states of plans, too; names of scenes may be any."""
    problem = load_scene("tiny-doorway", 0).replace(name="a : b : c")
    plan = PLANNERS["cocap"](problem).plan
    assert plan is not None
    text, file = instance_of(compiled(problem)), plan_document(problem, plan, folder)
    assert answered(text, file, folder)[0] == 0
    for change in ({"version": 1}, {"more": 1}, {"reward": "1"}, {"reward": 1e9}):
        assert answered(text, file | change, folder)[0] == 1
    file["plan"]["paths"][0][0][0] = True
    assert answered(text, file, folder) == (1, "refused: must be a whole number, not True")


@st.composite
def drawn_curves(draw: st.DrawFn) -> dict[int, list[tuple[int, int]]]:
    """Roots and values of some classes, with values that fit the roots more or less."""
    curves = {}
    for number in range(draw(st.integers(1, 3))):
        roots = sorted(draw(st.sets(st.integers(1, 30), min_size=1, max_size=3)))
        curves[number] = [(root, draw(st.integers(0, root))) for root in roots]
    return curves


@examples(200)
@given(drawn_curves(), st.lists(st.integers(0, 3), min_size=3, max_size=3))
def test_the_constant_of_a_cut_is_that_of_its_highest_corner(
    curves: dict[int, list[tuple[int, int]]], sizes: list[int]
) -> None:
    """Corners that are passed over hide none that is higher."""
    assume(max(sizes[k] for k in curves))
    known = instance(load_scene("tiny-approach", 0))
    drawn = [
        {"robot_class": k, "roots": [r for r, _ in curve], "values": [v for _, v in curve]}
        for k, curve in curves.items()
    ]
    members = [[*range(size)] for size in sizes]
    spec = {"t": 0, "face": 0, "share": 1.0, "curves": drawn}
    cut = cocap_check.Cut(known, spec, members)
    drones = [[(0, 0), *curve] for k, curve in curves.items() for _ in range(sizes[k])]
    highest = max(
        cocap_check.root_up(sum(r * r for r, _ in corner) << cocap_check.BITS)
        - (sum(v for _, v in corner) << cocap_check.BITS)
        for corner in itertools.product(*drones)
    )
    assert cut.constant == highest


def test_a_cut_that_takes_too_long_is_refused() -> None:
    """There is an end to the corners of a cut that are looked at."""
    instance = Instance(instance_of(compiled(load_scene("passage", 0))))
    draw = np.random.default_rng(4)
    roots = np.arange(1.0, 17.0)
    values = 0.25 * roots * draw.uniform(0.9, 1.1, 16)
    curve = {"robot_class": 0, "roots": roots.tolist(), "values": values.tolist()}
    spec = {"t": 1, "face": 0, "curves": [curve], "share": 1.0}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cocap_check, "MOST_CORNERS", 100)
        with pytest.raises(Refused, match="computing its constant takes too long"):
            cocap_check.Cut(instance, spec, instance.members)


@examples(200)
@given(st.integers(0, 10**9))
def test_the_constant_of_a_state_cut_is_that_of_its_highest_set(seed: int) -> None:
    """Of at most one state in each cell, in fractions: rounded up, by less than two units.

    Values are about as high as gains, so that many sets are nearly the highest.
    """
    draw, cut = random.Random(seed), object.__new__(cocap_check.StateCut)
    cut.slope = Fraction(draw.choice([1e-3, 0.02, 0.1, 0.3, 1.0, 50.0]))
    cells = [
        [(p := draw.randint(0, 400), p * draw.randint(20, 50) // 1000) for _ in range(states)]
        for states in draw.choices((1, 2, 3), k=draw.randint(0, 5))
    ]
    in_units = [[(p * ONE, v * ONE) for p, v in of_cell] for of_cell in cells]
    constant = Fraction(cocap_check.highest_corner(in_units, cut._root), ONE)
    highest = Fraction(0)
    for chosen in itertools.product(*([(0, 0), *of_cell] for of_cell in cells)):
        pixels, paid = (sum(part) for part in zip((0, 0), *chosen, strict=True))
        root = Fraction(math.isqrt(pixels << 400), 1 << 200)
        if 4 * cut.slope**2 * pixels < 1:
            root = 1 / (4 * cut.slope) + cut.slope * pixels
        highest = max(highest, root - paid)
    assert highest <= constant < highest + Fraction(2, ONE)


def state_cut_of(known: Instance, **changes: Any) -> dict[str, Any]:
    """A state cut of the first weighted face, of two states that see it, with other fields."""
    group = min(known.weights)
    seeing = [
        (t, *known.kinds[0].cells[p], *known.kinds[0].headings[o])
        for (t, p, o), views in known.kinds[0].sees.items() if group in dict(views)
    ]  # fmt: skip
    t, face = divmod(group, known.faces)
    listed = {"robot_class": 0, "states": [list(s[1:]) for s in seeing[:2]], "values": [1.0, 2.0]}
    cut = {"t": t, "face": face, "payments": [listed], "slope": 0.1, "share": 0.5}
    for name, value in changes.items():
        holder = listed if name in listed else cut
        if value is None:
            del holder[name]
        else:
            holder[name] = value
    return cut


SHORT, LONG = [[0]], [[0, 0, 0, 0, 0]] * 2


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"t": 99}, "t: must be 0.."),
        ({"t": True}, "t: must be a whole number, not True"),
        ({"face": -1}, "face: must be 0.."),
        ({"face": 99}, "face: must be 0.."),
        ({"share": 1.5}, "share: must be 0..1"),
        ({"share": -0.1}, "share: must be 0..1"),
        ({"share": math.nan}, "share: must be a finite number"),
        ({"share": None}, "must have the field 'share'"),
        ({"slope": 0}, "slope: must be 1e-50..1e+50"),
        ({"slope": -1.0}, "slope: must be 1e-50..1e+50"),
        ({"slope": 1e51}, "slope: must be 1e-50..1e+50"),
        ({"slope": math.inf}, "slope: must be a finite number"),
        ({"slope": None}, "must have the field 'slope'"),
        ({"constant": 1.0}, "must have no field ['constant']"),
        ({"payments": 5}, "payments: must be an array, not 5"),
        ({"payments": {}}, "payments: must be an array, not {}"),
        ({"type": "cut"}, "must have no field ['type']"),
        ({"payments": [{"curve": 1}]}, "payments[0]: must have no field ['curve']"),
        ({"robot_class": 1}, "payments[0]: robot_class: must exist and increase"),
        ({"robot_class": -1}, "payments[0]: robot_class: must exist and increase"),
        ({"states": []}, "payments[0]: states: must be 1..1000 states"),
        ({"states": LONG}, "payments[0]: states: must be distinct"),
        ({"states": SHORT, "values": [1.0]}, "payments[0]: states: must be a state (x, y, layer"),
        ({"states": [[0.5] * 5]}, "payments[0]: states: must be a whole number, not 0.5"),
        ({"states": ["12345"]}, "payments[0]: states: must be a state (x, y, layer"),
        ({"values": [1.0]}, "payments[0]: values: must contain 2 numbers"),
        ({"values": [1.0, -1.0]}, "payments[0]: values: must be 0..1e+50"),
        ({"values": [1.0, 1e51]}, "payments[0]: values: must be 0..1e+50"),
        ({"values": [1.0, math.nan]}, "payments[0]: values: must be a finite number"),
        ({"values": None}, "payments[0]: must have the field 'values'"),
    ],
)
def test_state_cuts_that_are_none_are_refused(changes: dict[str, Any], told: str) -> None:
    """In one line that names the field."""
    known = instance(load_scene("tiny-doorway", 0))
    bound = cocap_check.Bound(known, single=False)
    zeros = [[0.0] * known.faces] * known.rows
    numbers = {"alpha": [[1.0] * known.faces] * known.rows, "beta": zeros}
    bound.take(numbers | {"state_cuts": [state_cut_of(known)]})
    assert len(known.classes) == 1 and bound.prices[min(known.weights)][2]
    with pytest.raises(Refused) as error:
        bound.take(numbers | {"state_cuts": [state_cut_of(known, **changes)]})
    assert str(error.value).startswith(f"state_cuts[0]: {told}")
    assert "\n" not in str(error.value)


def test_state_cuts_need_the_vertex_rule_and_steps_of_their_own() -> None:
    """And classes that are given once."""
    problem = load_scene("tiny-doorway", 0)
    cut, classes = state_cut_of(instance(problem)), [0]
    shared = instance(problem.replace(rules=NO_RULES))
    with pytest.raises(Refused, match="if drones may share a cell"):
        cocap_check.StateCut(shared, cut, classes)
    summed = instance(problem.replace(objective=Objective(over_time=True)))
    with pytest.raises(Refused, match="if pixels add up over time"):
        cocap_check.StateCut(summed, cut | {"t": 0}, classes)
    with pytest.raises(Refused, match="robot_class: must exist and increase"):
        cocap_check.StateCut(instance(problem), cut | {"payments": cut["payments"] * 2}, classes)


@examples(60)
@given(st.one_of(drawn_meetings(3), either(drawn_problems())), st.integers(0, 10**9))
def test_multipliers_with_state_cuts(folder: Path, problem: Problem, seed: int) -> None:
    """Optimum <= exact bound <= the bound of `verify`, whose rounding is thus allowed for."""
    model = some_model(problem, rng := np.random.default_rng(seed))
    numbers = random_multipliers(model, rng)
    assume(numbers.state_cuts)
    pricing = Pricing.of(model, numbers)
    file = document(certify(problem, model, "test", numbers), folder)
    bound, _ = cocap_check.bound_of_file(instance(problem), file)
    if bound is None:
        assert pricing.bound == -math.inf
        return
    best = optimum(problem).value
    assert bound / ONE >= best - 1e-12 * abs(best)
    exact, units = Fraction(bound, ONE), Fraction(10**6, ONE)
    assert exact - units <= Fraction(pricing.bound)
    assert Fraction(pricing.bound) - exact <= 3 * Fraction(pricing.rounding) + units


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ("horizon 2", "horizon 3", "line 6: groups: must have 1 row or {more}, not {rows}"),
        ("rules 1 1", "rules 0 1", "line 8: rules: must begin with 1"),
        ("\nend\n", "\n", "line {last}: the last line must be `end`"),
        ("\nkind\n", "\nkinds\n", "line {kind}: must begin with a known word, not 'kinds'"),
        ("\nkind\n", "\n\nkind\n", "line {kind}: must not be empty"),
        ("\nkind\n", "\nkind 5\n", "line {kind}: kind: must have nothing after it, not 1"),
        ("\nkind\n", "\nsees 0 0 0 : 0:0x1p0\n", "line {kind}: sees: must follow a line kind"),
        ("rules 1 1", "rules 1 yes", "line 8: rules, 2nd number: must be 0 or 1, not 'yes'"),
        ("\nkind\n", "\nkind\nclosed 9999 0\n", "closed: must be at a step up to {horizon}"),
        ("\nkind\n", "\nkind\norientation 0 0 : 0\n", "orientation: must be given once in a kind"),
        ("horizon 2", "horizon 2 7", "line 5: horizon: must have 1 number, not 2"),
        (
            "horizon 2",
            "horizon -2",
            "line 5: horizon, 1st number: must be a whole number >= 0, not",
        ),
        (
            "0x0.0p+0 0x0.0p+0\nweight",
            "0 0x0.0p+0\nweight",
            "line 8: rules, 3rd number: must be hexadecimal, such as 0x1.0p+0, not '0'",
        ),
        ("rewards 0x0.0p+0", "rewards -0x1.0p+0", "line 7: rewards: must be numbers >= 0"),
        ("rewards 0x0.0p+0", "rewards nan", "line 7: rewards, 1st number: must be hexadecimal, "),
        ("drone 0 :", "drone 1 :", "drone: must be given once for drone 1"),
        ("cocap-instance 1", "cocap-instance 2", "line 1: must be cocap-instance 1"),
    ],
)
def test_instances_are_read_whole_or_refused(before: str, after: str, told: str) -> None:
    """One line says what is wrong with an instance."""
    text = instance_of(compiled(load_scene("tiny-doorway", 0)))
    horizon = load_scene("tiny-doorway", 0).horizon
    before = before.replace("horizon 2", f"horizon {horizon}")
    after = after.replace("horizon 3", f"horizon {horizon + 1}")
    after = after.replace("horizon 2", f"horizon {horizon}")
    assert before in text
    lines = text.splitlines()
    told = told.format(
        horizon=horizon, rows=horizon + 1, more=horizon + 2, last=len(lines) - 1,
        kind=lines.index("kind") + 1,
    )  # fmt: skip
    with pytest.raises(Refused, match=re.escape(told)):
        Instance(text.replace(before, after, 1))


def test_lines_that_do_not_fit_are_named() -> None:
    """Of each kind it is the nth line of a word, whatever is between them."""
    problem = load_scene("tiny-doorway", 0)
    first, *others = problem.robots
    other = first.replace(motion=first.motion.replace(turn=0))
    text = instance_of(compiled(problem.replace(robots=(other, *others))))
    lines = text.splitlines()
    kinds = [n for n, line in enumerate(lines) if line == "kind"]
    assert len(kinds) > 1
    sees = next(n for n in range(kinds[1], len(lines)) if lines[n].startswith("sees"))
    lines[sees + 1] = lines[sees + 1].replace("sees ", "sees 9", 1)
    with pytest.raises(Refused, match=rf"^line {sees + 2}: sees: must be at a step up to "):
        Instance("\n".join(lines))


@pytest.mark.parametrize(
    ("names", "told"),
    [
        ([], "INSTANCE: name a file; "),
        (["--best"], "--best: no such option"),
        (["--branches"], "--branches: must be a whole number > 0, not nothing"),
        (["x.instance", "--branches", "-5"], "--branches: must be a whole number > 0, not -5"),
        (["--branches", "9" * 5000, "x.instance"], "--branches: must be a whole number > 0, not"),
        (["x.instance", "none.json"], "none.json: no such file"),
        (["proof.json", "x.instance"], "proof.json: is a proof; name the .instance first"),
        (
            ["text.sol", "proof.json"],
            "text.sol: is not an instance; write one with cocap-opt export",
        ),
        (
            ["x.instance", "x.instance"],
            "x.instance: is an instance; name only one, as the first file",
        ),
        (["x.instance", "proof.json", "text.sol"], "text.sol: is not JSON; name plans, "),
        (["x.instance", "empty.json"], "empty.json: is empty"),
        (["x.instance", "."], ".: cannot be read: Is a directory"),
    ],
)
def test_wrong_calls_check_nothing(
    names: list[str],
    told: str,
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """They have an exit code of their own and a line, which says what to name."""
    problem = load_scene("tiny-doorway", 0)
    (folder / "x.instance").write_text(instance_of(compiled(problem)))
    (folder / "proof.json").write_text(
        json.dumps(document(searchless(problem).certificate, folder))
    )
    (folder / "text.sol").write_text("=obj= 3\n")
    (folder / "empty.json").write_text(" \n")
    monkeypatch.chdir(folder)
    assert cocap_check.main(names) == 2
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith(told)


def test_a_bound_below_0_says_that_no_plan_exists(folder: Path) -> None:
    """Instances have no weight or reward below 0, so that no J is."""
    problem = load_scene("tiny-head-on", 0)
    file = document(searchless(problem).certificate, folder)
    text = instance_of(compiled(problem))
    code, told = answered(text, file, folder)
    assert (code, file["bound"] < 0) == (0, True)
    assert re.fullmatch(
        r"no plan exists: J would be at most -\d+\.\d{6}, but no J is below 0", told
    )
    assert answered(text, file | {"bound": None}, folder) == (0, told)


def test_help_says_what_exit_codes_mean(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It names the command as it was called, and each code."""
    monkeypatch.setattr(sys, "argv", ["cocap-check"])
    assert cocap_check.main(["x.instance", "--help"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("usage: cocap-check [--branches N] INSTANCE [FILE]...")
    assert all(f"\n  {code}  " in text for code in range(4))


def test_the_instance_worked_by_hand_has_the_numbers_of_its_page() -> None:
    """The files beside the page are accepted, with the lines that the page quotes."""
    pages = Path(__file__).parents[2] / "docs" / "reference"
    folder = pages / "three-places"
    text = (folder / "three-places.instance").read_text()
    known = Instance(text)
    page = (pages / "instance-by-hand.md").read_text()
    for name in ("plan.json", "multipliers.json", "cuts.json", "stages.json"):
        words, is_part = cocap_check.answer(known, json.loads((folder / name).read_text()))
        assert not is_part
        assert f"\n{name}: {words}\n" in page
    best = 10 * (2 + 2**0.5)
    for name in ("cuts.json", "stages.json"):
        assert best <= json.loads((folder / name).read_text())["bound"] <= best + 1e-4
