"""The checker that is proved in Coq: its proof has no hole, its program refuses what is false."""

import itertools
import json
import math
import random
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import staged_hunt
from brute_force import optimum
from counting import either
from damaged_files import document
from goals import with_areas
from hypothesis import assume, given
from hypothesis import strategies as st
from random_certificates import random_staged, some_model
from strategies import drawn_meetings, drawn_problems, examples

from cocap_opt.cli.commands import run
from cocap_opt.experiments.lab.studies.verified import WITHOUT_PATHS
from cocap_opt.experiments.library.entries import DATA
from cocap_opt.experiments.library.records import Library
from cocap_opt.files.documents import FileError, decode_document, problem_digest
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.certificates import CertificateFile, Staged
from cocap_opt.formulations.certificates.staged import price_staged
from cocap_opt.formulations.column_generation.branch_and_price import column_generation, searchless
from cocap_opt.formulations.column_generation.parameters import DEFAULTS
from cocap_opt.formulations.independent import cocap_check, instance_of
from cocap_opt.model import compiled
from cocap_opt.problem import COVERAGE_VERSION, Objective, Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.scenarios import load_scene

FOLDER = Path(__file__).parents[2] / "formulations" / "certificates" / "coq"
PROGRAM = "cocap-check-verified"
AXIOMS = {"sig_not_dec", "sig_forall_dec", "functional_extensionality_dep"}  # of Coq's reals
MISSING = [name for name in ("coqc", "ocamlfind") if shutil.which(name) is None]

pytestmark = [
    pytest.mark.long(seconds=30),  # proving and building alone
    pytest.mark.skipif(bool(MISSING), reason=f"{' and '.join(MISSING)} not installed"),
]

problems = st.one_of(
    either(drawn_problems(over_time=True)), either(drawn_meetings(2)), drawn_meetings(3),
    either(with_areas((1, 2, 3))),
)  # fmt: skip

# Lowers a file and asks the program; returns its exit code and words. The last argument changes
# what was lowered.
Ask = Callable[..., tuple[int, str]]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The program, and what building it printed."""
    folder = tmp_path_factory.mktemp("coq")
    done = subprocess.run(
        [FOLDER / "build.sh", folder], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder / PROGRAM, done.stdout


@pytest.fixture(scope="module")
def ask(built: tuple[Path, str], tmp_path_factory: pytest.TempPathFactory) -> Ask:
    """Lowers files and runs the program on them."""
    return _asks(built[0], tmp_path_factory.mktemp("lowered"))


def test_it_judges_bounds_of_the_library(
    built: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It accepts what `cocap-check` accepted, to a unit of rounding, and refuses a lower claim."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path / "cache"))
    known = Library(Path(shutil.copytree(DATA, tmp_path / "library")))
    (bound,) = [row for row in known.records("corridor-0") if row.kind == "bound"][-1:]
    assert known.recheck(bound, verified=built[0]).value == pytest.approx(bound.value, abs=1e-6)
    file = json.loads(known.content(bound))
    file["bound"] = 0.999 * bound.value
    (tmp_path / "low.json").write_text(json.dumps(file))
    with pytest.raises(FileError, match="refused: "):
        known.submit(tmp_path / "low.json", verified=built[0])


# Advice in place of advice.ml: as many numbers as it likes, of any size and sign, at every node.
NONSENSE = """
module Big = Z
open Checker
module Z = Big
type memory = int
let nothing = 1
let advise ~coarse ~alone specs seen constants pool round =
  let random = Random.State.make [| round; List.length pool; Hashtbl.hash seen |] in
  let number () =
    let bits = Random.State.int random 90 in
    let z = Z.of_int (Random.State.bits random) in
    let z = Z.add (Z.shift_left z (bits / 2)) (Z.of_int (Random.State.int random 3)) in
    let z = if bits < 30 then Z.shift_right z 25 else z in
    if Random.State.int random 4 = 0 then Z.neg z else z in
  let share () =
    if Random.State.bool random then Z.of_int (Random.State.bits random) else number () in
  let some item = List.init (Random.State.int random 9) (fun _ -> item ()) in
  if Random.State.int random 5 = 0 then (None, round + 1)
  else
    let touches = some (fun () -> (share (), number ())) in
    (Some { shares = some share; touches; levels = some number }, round + 1)
"""


@pytest.fixture(scope="module")
def ask_misled(built: tuple[Path, str], tmp_path_factory: pytest.TempPathFactory) -> Ask:
    """The same, with advice that is nonsense."""
    folder = tmp_path_factory.mktemp("misled")
    modules = ["checker.mli", "checker.ml", "instance_lines.ml", "advice.ml", "driver.ml"]
    for name in modules:
        shutil.copy(built[0].parent / name, folder)
    (folder / "advice.ml").write_text(NONSENSE)
    command = ["ocamlfind", "ocamlopt", "-w", "-a", "-package", "unix,zarith", "-linkpkg"]
    done = subprocess.run(
        [*command, *modules, "-o", "misled"],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return _asks(folder / "misled", folder)


def _asks(program: Path, folder: Path) -> Ask:
    def answer(
        instance: str, file: dict[str, Any], change: Callable[[str], str] = str, *options: str
    ) -> tuple[int, str]:
        paths = [folder / name for name in ("x.instance", "certificate.json", "lowered.txt")]
        paths[0].write_text(instance)
        paths[1].write_text(json.dumps(file))
        command = [sys.executable, FOLDER / "lower.py", *paths[:2], "-o", paths[2]]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            return 1, done.stderr
        paths[2].write_text(change(paths[2].read_text()))
        done = subprocess.run(
            [program, *options, paths[0], paths[2]], capture_output=True, text=True, check=False
        )
        return done.returncode, done.stdout

    return answer


def exported(name: str, folder: Path) -> tuple[str, dict[str, Any]]:
    """A scene's instance, and a proof without a search."""
    paths = [folder / file for file in ("x.instance", "plan.json", "proof.json")]
    run(["export", name, "-o", str(paths[0])])
    method = ["--method", "searchless"]
    run(["solve", name, *method, "-o", str(paths[1]), "--certificate", str(paths[2])])
    return paths[0].read_text(), json.loads(paths[2].read_text())


def test_a_full_stack_is_no_refusal(built: tuple[Path, str], ask: Ask, tmp_path: Path) -> None:
    """It takes the largest stack that is allowed, and says so where that is too small."""
    text, file = exported("tiny-doorway", tmp_path)
    sees = next(line for line in text.splitlines() if line.startswith("sees"))
    deep = text.replace("\nend", "\n" + "\n".join([sees] * 200_000) + "\nend")
    assert ask(text, file)[0] == 0 and ask(deep, file)[0] == 1
    files = [tmp_path / name for name in ("deep.instance", "lowered.txt")]
    files[0].write_text(deep)
    files[1].write_text("cocap-lowered 5")
    command = ["sh", "-c", 'ulimit -s 64; exec "$@"', "sh", built[0], *files]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout[:30]) == (3, "not decided: the stack is full")


def first_leaf(file: dict[str, Any]) -> dict[str, Any]:
    """The multipliers of a certificate, or of the first leaf of a proof."""
    if "certificate" in file:
        found = file["certificate"]
    else:
        found = next(n["certificate"] for n in file["nodes"] if n["type"] == "leaf")
    return dict(found)


def test_the_proof_has_no_hole(built: tuple[Path, str]) -> None:
    """No source assumes a thing, and the theorems rest on the axioms of the reals alone."""
    sources = sorted(FOLDER.glob("*.v"))
    assert len(sources) > 5
    for source in sources:
        words = re.sub(r"\(\*.*?\*\)", "", source.read_text(), flags=re.DOTALL)
        holes = r"\b(Admitted|admit|Axioms?|Parameters?|Conjecture|Abort|bypass_check|Unset)\b"
        assert not re.search(holes, words), source.name
    named = re.findall(r"^([\w.]+)\s*:", built[1].replace("Axioms:", ""), flags=re.MULTILINE)
    assert {name.split(".")[-1] for name in named} == AXIOMS
    assert built[1].count("Axioms:") == len(re.findall("Print Assumptions", _text("Extract.v")))


def _text(name: str) -> str:
    return (FOLDER / name).read_text()


@pytest.mark.parametrize("name", ["tiny-doorway", "corridor"])
def test_a_true_certificate_is_accepted_and_false_ones_are_not(
    name: str, ask: Ask, tmp_path: Path
) -> None:
    """A bound that is lowered, a price that is changed and a row that is no rule are refused."""
    instance, file = exported(name, tmp_path)
    code, words = ask(instance, file)
    assert code == 0, words
    told = float(words.split("that is ")[1].split()[0])
    assert file["bound"] <= told <= file["bound"] + 2e-6

    assert ask(instance, file | {"bound": file["bound"] * (1 - 1e-6)})[0] == 1

    alphas = [g for g in _groups(ask, instance, file) if 0 < int(g[1]) < cocap_check.ONE]
    group = max(alphas, key=lambda g: int(g[1]))
    old, new = " ".join(group), " ".join([group[0], "0", *group[2:]])
    code, words = ask(instance, file, lambda text: text.replace(f" {old} ", f" {new} ", 1))
    assert code == 1
    assert "refused" in words

    numbers = first_leaf(file)
    row = next(row for row in numbers["rows"] if row["resource"]["type"] == "cells")
    plain = {key: value for key, value in file.items() if key != "nodes"} | {
        "format": "cocap-opt certificate", "bound": 1e9, "certificate": numbers | {"rows": [row]},
    }  # fmt: skip
    assert ask(instance, plain)[0] == 0
    here = row["resource"]["cells"][0][:2]
    places = (line.split()[1:3] for line in instance.splitlines() if line.startswith("place"))
    elsewhere = next(place for place in ([int(x), int(y)] for x, y in places) if place != here)
    row["resource"]["cells"].append(elsewhere)  # two drones may be at these two places
    code, words = ask(instance, plain)
    assert code == 1
    assert "refused" in words


def _groups(ask: Ask, instance: str, file: dict[str, Any]) -> list[list[str]]:
    """The first words of the groups of a file's first leaf: number, prices, constant and step."""
    kept: list[str] = []

    def keep(text: str) -> str:
        kept.append(text)
        return text

    ask(instance, file, keep)
    words = kept[0].split("leaf", 1)[1].split()
    place, found = 4, []
    for _ in range(int(words[3])):
        found.append(words[place : place + 5])
        place += 5
        cuts = int(words[place])
        place += 1
        for _ in range(cuts):
            curves = int(words[place + 2])
            place += 3
            for _ in range(curves):
                place += 2 + 2 * int(words[place + 1])
        assert words[place] == "0"  # state cuts
        place += 1
    return found


@examples(40)
@given(problems)
def test_proofs_of_small_problems_are_accepted(
    ask: Ask, tmp_path_factory: pytest.TempPathFactory, problem: Problem
) -> None:
    """It agrees with cocap-check on proofs, whatever the rules, and none goes below the optimum."""
    file = document(searchless(problem).certificate, tmp_path_factory.mktemp("proof"))
    text = instance_of(compiled(problem))
    bound, _ = cocap_check.bound_of_file(cocap_check.Instance(text), file)
    code, words = ask(text, file)
    assert code == 0, (words, bound)
    best = optimum(problem).value
    if best > 0:
        assert ask(text, file | {"bound": best * (1 - 1e-6)})[0] == 1


@examples(30)
@given(problems, st.sampled_from(["envelope", "column-generation"]))
def test_certificates_of_small_problems_are_accepted(
    ask: Ask, tmp_path_factory: pytest.TempPathFactory, problem: Problem, method: str
) -> None:
    """Certificates are, too, by multipliers, and those that are staged."""
    try:
        file = BOUNDS[method](problem).certificate
    except UnsupportedError:
        assume(False)
    assume(file is not None)
    found = document(file, tmp_path_factory.mktemp("certificate"))
    text = instance_of(compiled(problem))
    code, words = ask(text, found)
    assert code == 0, words
    best = optimum(problem).value
    if best > 0:
        assert ask(text, found | {"bound": best * (1 - 1e-6)})[0] == 1


def test_cuts_of_many_drones_are_checked(ask: Ask) -> None:
    """Of sixteen drones with three breakpoints each not all 4^16 corners are looked at."""
    library = Library()
    bound = next(row for row in library.records("crowd-16-0") if row.kind == "bound")
    text = library.instance(library.entry("crowd-16-0")).read_text()
    file = json.loads(library.content(bound))
    code, words = ask(text, file)
    assert code == 0 and "84544.75" in words, words

    scale = 1 << 64
    cut = max(file["certificate"]["multipliers"]["cuts"], key=lambda cut: len(cut["curves"]))
    numbers = [zip(curve["roots"], curve["values"], strict=True) for curve in cut["curves"]]
    drones = [
        [(round(Fraction(r) * scale) ** 2, round(Fraction(v) * scale)) for r, v in points]
        for points in numbers
    ]
    assert len(drones) == 16
    constant = cocap_check.highest_corner(drones, lambda q: math.isqrt(q) + 1)

    def lower(lowered: str) -> str:
        """A constant that one corner exceeds."""
        words = lowered.split(" ")
        high = [k for k, word in enumerate(words) if word in (str(constant), str(constant - 1))]
        assert high
        return " ".join(str(int(w) - 4) if k in high else w for k, w in enumerate(words))

    assert ask(text, file, lower)[0] == 1


# The class, state (x, y, layer, heading, pitch) and value of each state that a state cut lists; and
# the cut's step, face, share and slope before these.
Listed = list[tuple[int, tuple[int, ...], float]]
DrawnCut = tuple[int, int, float, float, Listed]


def _rooted(slope: float, pixels: float) -> float:
    """The root, or the line of a slope that touches it, where it touches further right."""
    touches = 1 / (4 * slope * slope)
    return 1 / (4 * slope) + slope * pixels if pixels < touches else math.sqrt(pixels)


def _seen(
    instance: cocap_check.Instance, kinds: list[int], t: int, face: int
) -> dict[tuple[int, tuple[int, ...]], tuple[tuple[int, ...], float]]:
    """Of each class and state that sees a face at a step: its cell and its pixels."""
    found = {}
    for number, k in enumerate(kinds):
        kind = instance.kinds[k]
        for name, (place, turn) in kind.states.items():
            views = dict(kind.sees.get((t, place, turn), ()))
            if t * instance.faces + face in views:
                cell, pixels = kind.cells[place], views[t * instance.faces + face]
                found[number, name] = (cell, float(pixels))
    return found


def _classes(instance: cocap_check.Instance, file: dict[str, Any]) -> list[int]:
    """The kind of each class of a file."""
    if file.get("classes") != "single":
        return list(instance.classes)
    of = {d: k for k, ds in zip(instance.classes, instance.members, strict=True) for d in ds}
    return [of[d] for d in range(len(of))]


def _plain(file: dict[str, Any], instance: cocap_check.Instance) -> dict[str, Any]:
    """A certificate by the rows of a file's first leaf, each root paid by its drones' roots."""
    numbers = {k: v for k, v in first_leaf(file).items() if k not in ("cuts", "decisions")}
    ones = [[1.0] * instance.faces for _ in range(instance.rows)]
    numbers |= {"alpha": ones, "beta": [[0.0] * instance.faces for _ in ones]}
    kept = {key: value for key, value in file.items() if key != "nodes"}
    return kept | {"format": "cocap-opt certificate", "certificate": numbers}


def _with_state_cuts(
    file: dict[str, Any], instance: cocap_check.Instance, cuts: list[DrawnCut]
) -> tuple[dict[str, Any], float]:
    """The same certificate with state cuts, and the bound that it proves by the definition: the
    constant is the largest of all sets of listed states in different cells, and where no state is
    listed a drone is paid its root or by the slope, whichever is less."""
    kinds = _classes(instance, file)
    bound = cocap_check.Bound(instance, file.get("classes") == "single")
    bound.take(file["certificate"])
    constants, written = 0.0, []
    alpha = [list(row) for row in file["certificate"]["alpha"]]
    for t, face, share, slope, listed in cuts:
        weight = float(instance.weights[t * instance.faces + face])
        seen = _seen(instance, kinds, t, face)
        cells: dict[tuple[int, ...], list[tuple[float, float]]] = {}
        values_of = {(number, state): value for number, state, value in listed}
        for (number, state), (cell, pixels) in seen.items():
            value = min(math.sqrt(pixels), slope * pixels)
            if (number, state) in values_of:
                value = values_of[number, state]
                cells.setdefault(cell, []).append((pixels, value))
            visit = {"type": "visit", "t": t, "state": list(state), "robot_class": number}
            less = weight * share * (math.sqrt(pixels) - value)
            bound._charge(visit, round(less * cocap_check.ONE))
        constants += weight * share * max(
            _rooted(slope, sum(p for p, _ in chosen)) - sum(v for _, v in chosen)
            for chosen in itertools.product(*([(0.0, 0.0), *of_cell] for of_cell in cells.values()))
        )  # fmt: skip
        alpha[t][face] -= share
        payments = []
        for number in sorted({k for k, _, _ in listed}):
            of_class = [(list(state), value) for k, state, value in listed if k == number]
            states, values = zip(*of_class, strict=True)
            payments.append({"robot_class": number, "states": states, "values": values})
        cut = {"t": t, "face": face, "share": share, "slope": slope, "payments": payments}
        written.append(cut)
    total = sum(bound.constants.values()) + sum(value for _, value in bound.row_constants)
    paths = bound._with_paths(total)
    assert paths is not None
    numbers = file["certificate"] | {"alpha": alpha, "state_cuts": written}
    return file | {"certificate": numbers}, paths / cocap_check.ONE + constants


@examples(40)
@given(problems, st.integers(0, 10**9))
def test_state_cuts_prove_what_their_definition_says(
    ask: Ask, tmp_path_factory: pytest.TempPathFactory, problem: Problem, seed: int
) -> None:
    """Whatever is listed, with any values: that bound is accepted, and none below it, so that none
    is below the best J; without the vertex rule, and over time, there are no state cuts."""
    best = optimum(problem).value
    assume(math.isfinite(best))  # there is a plan
    found = document(searchless(problem).certificate, tmp_path_factory.mktemp("state"))
    text, draw = instance_of(compiled(problem)), random.Random(seed)
    instance = cocap_check.Instance(text)
    found |= {"classes": draw.choice(["alike", "single"])}  # its rows and roots hold for both
    file, kinds = _plain(found, instance), _classes(instance, found)
    groups = sorted(g for g in instance.weights if g < instance.n_roots)
    seen = {g: _seen(instance, kinds, *divmod(g, instance.faces)) for g in groups}
    seen = {g: of_group for g, of_group in seen.items() if of_group}
    assume(seen)
    cuts: list[DrawnCut] = []
    for g in draw.sample(sorted(seen), min(len(seen), 3)):
        for _ in range(draw.randint(1, 2)):
            some = draw.sample(sorted(seen[g]), draw.randint(1, min(len(seen[g]), 7)))
            factor = draw.choice([0.0, 0.3, 0.7, 0.8, 1.0, 2.0])
            values = [
                factor * draw.choice([1.0, draw.random()]) * math.sqrt(seen[g][x][1]) for x in some
            ]
            listed = [(*x, value) for x, value in zip(some, values, strict=True)]
            touches = draw.choice([0.1, 0.5, 1.0, 3.0, 1e-6, 1e3]) * math.sqrt(seen[g][some[0]][1])
            cut = (draw.choice([0.25, 0.5]), 1 / (2 * touches), listed)
            cuts.append((*divmod(g, instance.faces), *cut))
    if instance.rows == 1 or not instance.vertex:
        empty = {"t": 0, "face": 0, "share": 0.5, "slope": 1.0, "payments": []}
        numbers = file["certificate"] | {"state_cuts": [empty]}
        code, words = ask(text, file | {"certificate": numbers})
        assert code == 1 and "state_cuts: " in words
        return
    file, bound = _with_state_cuts(file, instance, cuts)
    allowance = ALIKE * (1 + abs(bound))
    assert bound >= best - allowance
    code, words = ask(text, file | {"bound": bound + allowance})
    assert code == 0, words
    assert ask(text, file | {"bound": bound - allowance})[0] == 1
    if best > 0:
        for target, expected in ((bound + allowance, 0), (best * (1 - 1e-6), 1)):
            staged = _staged(file, target=target, stages=[])
            assert ask(text, staged | {"bound": target})[0] == expected


def _changed_words(at: int, *new: object, instead: int = 1) -> Callable[[str], str]:
    """Puts other words into the only state cut of what was lowered, from its word `at` on."""

    def change(text: str) -> str:
        words, here = text.split(), 0
        here = words.index("leaf") + 4
        n_groups = int(words[here])
        here += 1
        for _ in range(n_groups):
            assert words[here + 5] == "0"  # cuts
            here += 7
            if words[here - 1] == "1":
                break
        return " ".join([*words[: here + at], *map(str, new), *words[here + at + instead :]])

    return change


@pytest.fixture
def state_cut(tmp_path: Path) -> tuple[str, dict[str, Any], DrawnCut]:
    """An instance, a certificate without state cuts, and one to add: two states of a cell from
    which a face is seen much alike, and one of another cell, which is paid its root. The line of
    its slope is above the root of all their pixels."""
    text, found = exported("corridor", tmp_path)
    instance = cocap_check.Instance(text)
    file, kinds = _plain(found, instance), _classes(instance, found)
    for g in sorted(instance.weights):
        t, face = divmod(g, instance.faces)
        of_cells: dict[tuple[int, ...], Listed] = {}
        for (number, state), (cell, pixels) in _seen(instance, kinds, t, face).items():
            of_cells.setdefault(cell, []).append((number, state, math.sqrt(pixels)))
        for cell, listed in of_cells.items():
            a, b, *_ = *sorted(listed, key=lambda x: -x[2]), (0, (), 0.0)
            if len(of_cells) > 1 and a[2] > 0 and b[2] > 0.9 * a[2]:
                third = next(others[0] for other, others in of_cells.items() if other != cell)
                two = [(number, state, 0.2 * root) for number, state, root in (a, b)]
                highest = max(a[2], *(root for of in of_cells.values() for *_, root in of))
                return text, file, (t, face, 0.5, 1 / (4 * highest), [*two, third])
    raise AssertionError("no such face")


@pytest.mark.parametrize("steeper", [1.0, 4.0])
def test_false_state_cuts_are_refused(
    state_cut: tuple[str, dict[str, Any], DrawnCut], steeper: float, ask: Ask
) -> None:
    """A value, share or constant that is lowered, and states of different cells in one set, as if
    one drone at most could be there; states of one cell in two sets need a higher constant. So it
    is by the line, and where it touches the root left of the highest corner."""
    text, file, (t, face, share, slope, drawn) = state_cut
    cut = (t, face, share, steeper * slope, drawn)
    file, bound = _with_state_cuts(file, cocap_check.Instance(text), [cut])
    file |= {"bound": bound * (1 + ALIKE)}
    kept: list[str] = []

    def keep(words: str) -> str:
        kept.append(words)
        return words

    assert ask(text, file, keep)[0] == 0
    # Share, constant, knee, number of sets, size of the first; class, state, value of each state.
    part, constant, _, *words = map(int, _cut_words(kept[0]))
    assert words[:2] == [2, 2] and words[8] == 1
    first, second, third = words[2:5], words[5:8], words[9:12]
    low = [int(0.5 * value) for *_, value in (first, second)]
    sets = (2, 2, *first, *second, 1, *third)
    assert ask(text, file, _changed_words(3, *sets, instead=12))[0] == 0
    split = (3, 1, *first, 1, *second, 1, *third)
    joined = (1, 3, *first, *second, *third)
    lower = (2, 2, *first[:2], low[0], *second[:2], low[1], 1, *third)
    for wrong in (split, joined, lower):
        code, told = ask(text, file, _changed_words(3, *wrong, instead=12))
        assert code == 1 and "refused" in told, wrong
    for at, word in ((0, part - 1), (1, constant - 2), (1, -1)):
        assert ask(text, file, _changed_words(at, word))[0] == 1
    # However high the bound is: the set is none.
    high = file | {"bound": 1e12}
    assert ask(text, high, _changed_words(3, *joined, instead=12))[0] == 1


def test_a_slope_that_is_lowered_needs_a_higher_constant(
    state_cut: tuple[str, dict[str, Any], DrawnCut], ask: Ask
) -> None:
    """Drones in other states are paid less by it, but a constant that was enough is not any more,
    however high the bound is; nor is there a line without a place where it touches the root."""
    text, plain, (t, face, share, slope, listed) = state_cut
    instance = cocap_check.Instance(text)
    kept: list[str] = []

    def keep(words: str) -> str:
        kept.append(words)
        return words

    # The highest corner by the line: two drones, and none at all.
    for states in (listed, []):
        knees = []
        for lower in (slope, slope / 2):
            file, bound = _with_state_cuts(plain, instance, [(t, face, share, lower, states)])
            assert ask(text, file | {"bound": bound * (1 + ALIKE)}, keep)[0] == 0
            assert ask(text, file | {"bound": bound * (1 - ALIKE)})[0] == 1
            knees.append(int(_cut_words(kept[-1])[2]))
            assert knees[-1] == pytest.approx(cocap_check.ONE / (2 * lower))
        file, _ = _with_state_cuts(plain, instance, [(t, face, share, slope, states)])
        high = file | {"bound": 1e12}
        assert ask(text, high, _changed_words(2, knees[0]))[0] == 0
        for wrong in (knees[0] + knees[0] // 10**9, knees[1], 0, -1, -knees[0]):
            code, told = ask(text, high, _changed_words(2, wrong))
            assert code == 1 and "refused" in told, wrong


def _cut_words(text: str) -> list[str]:
    """The words of the only state cut of what was lowered, from its share on, as many as 15."""
    marked = _changed_words(0, "here")(text).split()
    place = marked.index("here")
    return text.split()[place : place + 15]


Change = Callable[[dict[str, Any]], object]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda cut: cut.update(share=1.5), "state_cuts: share must be 0..1"),
        (lambda cut: cut.update(slope=0.0), "state_cuts: slope must be > 0"),
        (lambda cut: cut.update(slope=-1.0), "state_cuts: slope must be > 0"),
        (lambda cut: cut.pop("slope"), "must have the field 'slope'"),
        (lambda cut: cut.update(t=-1), "state_cuts: t must be 0.."),
        (lambda cut: cut.update(face=1000), "state_cuts: face must be 0.."),
        (lambda cut: cut.update(constant=0.0), "must have no field ['constant']"),
        (lambda cut: cut["payments"][0].update(roots=[]), "must have no field ['roots']"),
        (lambda cut: cut["payments"][0].update(robot_class=99), "robot_class: does not exist"),
        (lambda cut: cut["payments"].append(cut["payments"][0]), "robot_class must be increasing"),
        (lambda cut: cut["payments"][0]["values"].append(1.0), "must hold a number for each state"),
        (lambda cut: cut["payments"][0]["values"].__setitem__(0, -1.0), "values must be >= 0"),
        (
            lambda cut: cut["payments"][0]["states"].__setitem__(
                0, cut["payments"][0]["states"][1]
            ),
            "states must be distinct",
        ),
    ],
)
def test_wrong_fields_of_state_cuts_are_told(
    state_cut: tuple[str, dict[str, Any], DrawnCut], change: Change, message: str, ask: Ask
) -> None:
    """They are refused before the program is asked."""
    text, file, drawn = state_cut
    file, _ = _with_state_cuts(file, cocap_check.Instance(text), [drawn])
    file = json.loads(json.dumps(file))
    change(file["certificate"]["state_cuts"][0])
    code, words = ask(text, file)
    assert code == 1
    assert message in words


def test_states_that_no_drone_takes_pay_nobody(
    state_cut: tuple[str, dict[str, Any], DrawnCut], ask: Ask
) -> None:
    """A listed state that the instance lacks is skipped, and one that it stands for is not listed:
    the bound is that of the other states."""
    text, plain, (*cut, listed) = state_cut
    instance = cocap_check.Instance(text)
    file, whole = _with_state_cuts(plain, instance, [(*cut, listed)])
    _, partial = _with_state_cuts(plain, instance, [(*cut, listed[1:])])
    file = json.loads(json.dumps(file))
    paid = file["certificate"]["state_cuts"][0]["payments"][0]
    paid["states"].append([99, 0, 0, 0, 0])
    paid["values"].append(3.0)
    for bound in (whole, partial):
        assert ask(text, file | {"bound": bound * (1 + ALIKE)})[0] == 0
        assert ask(text, file | {"bound": bound * (1 - ALIKE)})[0] == 1
        paid["states"][0] = [98, 0, 0, 0, 0]


# Step envelopes have several stages here, and paths of all drones prove as much without them.
staged_scenes = pytest.mark.parametrize("name", ["corridor-tight", "bottleneck"])


@staged_scenes
def test_stages_are_searched_again(name: str, ask: Ask, tmp_path: Path) -> None:
    """Step envelopes prove what they claim, and no less; paths prove what they leave open."""
    problem = load_scene(name, 0)
    text = instance_of(compiled(problem))
    file = document(column_generation(problem, parameters=WITHOUT_PATHS).certificate, tmp_path)
    assert len(file["certificate"]["stages"]) > 1
    code, words = ask(text, file)
    assert code == 0, words
    assert "stages" in words
    assert ask(text, file | {"bound": file["bound"] * (1 - 1e-9)})[0] == 1

    explored = document(column_generation(problem).certificate, tmp_path)
    assert explored["certificate"]["paths_above"] is not None
    code, words = ask(text, explored)
    assert code == 0, words
    assert "paths of all drones" in words
    alone = explored["certificate"] | {"paths_above": None}
    assert ask(text, explored | {"certificate": alone})[0] == 1


def _staged(file: dict[str, Any], **fields: Any) -> dict[str, Any]:
    """A certificate as a staged one, without stages if it has none, with other fields."""
    numbers = file["certificate"]
    if numbers["type"] == "multipliers":
        numbers = {"type": "staged", "multipliers": numbers, "stages": []}
    return file | {"certificate": numbers | {"paths_above": None} | fields}


def _without_paths(problem: Problem, folder: Path) -> dict[str, Any]:
    """The certificate of column generation without paths; the example ends if there is none."""
    try:
        certificate = column_generation(problem, parameters=WITHOUT_PATHS).certificate
    except UnsupportedError:
        assume(False)
    assume(certificate is not None)
    file = document(certificate, folder)
    assume(file["certificate"]["type"] in ("multipliers", "staged"))
    return file


@examples(30)
@given(st.one_of(either(drawn_meetings(2)), drawn_meetings(3), drawn_meetings(4)))
def test_no_advice_makes_a_false_claim_pass(
    ask: Ask, ask_misled: Ask, tmp_path_factory: pytest.TempPathFactory, problem: Problem
) -> None:
    """Constants that are far too low are found to be so, whatever multipliers searches are told."""
    file = _without_paths(problem, tmp_path_factory.mktemp("staged"))
    best = optimum(problem).value
    assume(best > 0)
    text = instance_of(compiled(problem))
    steps = [{"t": t, "constant": -1e6} for t in range(problem.horizon + 1)]
    stages = [*_staged(file)["certificate"]["stages"], {"payments": [], "constants": steps}]
    low = {"target": best * 0.9, "stages": stages}
    for above in (None, best * 0.9):
        found = _staged(file, **low, paths_above=above)
        for asked in (ask, ask_misled):
            assert asked(text, found | {"bound": best * (1 - 1e-6)})[0] == 1
    # A lower target than the file's would leave its stages more states and a weaker bound.
    own = {"target": file["certificate"].get("target", low["target"]), "stages": stages}
    highest = _staged(file, **own) | {"bound": file["bound"] * (1 + 1e-9)}
    assert ask(text, highest)[0] == ask_misled(text, highest)[0] == 0


def test_paths_through_any_step_prove_as_much(ask: Ask, tmp_path: Path) -> None:
    """Explored from a later step on and back, paths prove what they prove from step 0 on."""
    problem = load_scene("corridor-tight", 0)
    text = instance_of(compiled(problem))
    file = document(column_generation(problem).certificate, tmp_path)
    above = file["certificate"]["paths_above"]
    assert above < file["bound"] * (1 - 1e-4)
    for step in (None, 1, problem.horizon // 2, problem.horizon):
        found = _staged(file, paths_above=above, paths_from=step)
        code, words = ask(text, found | {"bound": file["bound"] * (1 + 1e-9)})
        assert code == 0, words
        assert ("together, from step" in words) == (step is not None)
        assert ask(text, found | {"bound": file["bound"] * (1 - 1e-9)})[0] == 1
    assert ask(text, _staged(file))[0] == 1


@examples(20)
@given(st.one_of(either(drawn_meetings(2)), drawn_meetings(3), either(drawn_problems())))
def test_paths_through_steps_of_small_problems(
    ask: Ask, ask_misled: Ask, tmp_path_factory: pytest.TempPathFactory, problem: Problem
) -> None:
    """No claim below the optimum passes, whatever the advice; where starts are fixed, all pass that
    whole paths prove."""
    file = _without_paths(problem, tmp_path_factory.mktemp("staged"))
    best = optimum(problem).value
    assume(best > 0)
    text, target = instance_of(compiled(problem)), best * 0.9
    for step in range(1, problem.horizon + 1):
        found = _staged(file, target=target, paths_above=target, paths_from=step)
        for asked in (ask, ask_misled):
            assert asked(text, found | {"bound": best * (1 - 1e-6)})[0] == 1
            if not problem.has_free_starts:
                assert asked(text, found | {"bound": best * (1 + 1e-6)})[0] == 0


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"paths_from": 0}, "paths_from: must be 1.."),
        ({"paths_from": 99}, "paths_from: must be 1.."),
        ({"paths_from": 1.0}, "paths_from: must be a whole number"),
        ({"paths_from": 1, "paths_above": None}, "paths_from: not allowed without paths_above"),
        (
            {"paths_from": None, "paths_above": None, "tails": [{"t": 1, "loss": 0.1}]},
            "tails: only the other checkers can verify them",
        ),
    ],
)
def test_paths_begin_at_a_step_of_the_scene(
    fields: dict[str, Any], message: str, ask: Ask, tmp_path: Path
) -> None:
    """Other values are refused before the program is asked, and by the program, too."""
    instance, proof = exported("tiny-doorway", tmp_path)
    file = {k: v for k, v in proof.items() if k != "nodes"} | {
        "format": "cocap-opt certificate", "certificate": first_leaf(proof),
    }  # fmt: skip
    good = _staged(file, target=file["bound"] * 0.9, paths_above=file["bound"] * 0.95)
    assert ask(instance, good)[0] == 0
    code, words = ask(instance, _staged(good, **good["certificate"] | fields))
    assert code == 1
    assert message in words
    good["certificate"]["paths_from"] = 1
    assert ask(instance, good)[0] == 0
    for word in ("-1", "99", "soon", "1 1", ""):
        code, words = ask(instance, good, lambda text, word=word: text.rstrip()[:-1] + word)
        assert code == 1
        assert "refused" in words


def test_prices_of_states_that_no_drone_takes_change_nothing(ask: Ask, tmp_path: Path) -> None:
    """An instance need not list all states of a kind; the other checkers skip their prices, too."""
    instance, proof = exported("tiny-doorway", tmp_path)
    file = {k: v for k, v in proof.items() if k != "nodes"} | {
        "format": "cocap-opt certificate", "certificate": first_leaf(proof),
    }  # fmt: skip
    nowhere = {"t": 1, "robot_class": 0, "states": [[99, 0, 0, 0, 0]], "payments": [3.0]}
    stage = {"payments": [nowhere], "constants": [{"t": 1, "constant": 1e6}]}
    above = file["bound"] * 0.95
    good = _staged(file, target=above, paths_above=above, stages=[stage])
    code, words = ask(instance, good)
    assert code == 0, words
    assert ask(instance, good | {"bound": above})[0] == 1
    nowhere["payments"].append(1.0)
    assert "payments: must hold a number for each state" in ask(instance, good)[1]


ALIKE = 1e-9  # of 1 + |bound|: by how much the bounds of the checkers may differ


@examples(60)
@given(
    st.one_of(either(drawn_problems()), either(drawn_meetings(2)), drawn_meetings(3),
              drawn_meetings(4)),
    st.integers(0, 10**9),
)  # fmt: skip
def test_checkers_prove_the_same_by_random_stages(
    ask: Ask, tmp_path_factory: pytest.TempPathFactory, problem: Problem, seed: int
) -> None:
    """`cocap-check` and this program accept the same claims, and `verify` no lower ones.

    No target is the value of a plan: rounding then decides whether states on its path are closed.
    """
    rng = np.random.default_rng(seed)
    if rng.integers(2):  # moves without rewards, so that paths can be explored
        objective = Objective(pixels=problem.objective.pixels, views=problem.objective.views)
        problem = problem.replace(objective=objective)
    model, best = some_model(problem, rng), optimum(problem).value
    value = best if math.isfinite(best) else 0.0
    target = value - (1 + abs(value)) * 10.0 ** rng.uniform(-4, 0)
    staged = msgspec.structs.replace(random_staged(model, target, rng, moves=True), tails=())
    verified = price_staged(model, staged).bound
    file = CertificateFile(
        scene=problem.name, digest=problem_digest(problem), method="test",
        classes="single" if model.is_disaggregated else "alike",
        coverage_version=COVERAGE_VERSION, bound=max(verified, 0.0), certificate=staged,
    )  # fmt: skip
    found, text = document(file, tmp_path_factory.mktemp("random")), instance_of(compiled(problem))
    checked, is_part = cocap_check.bound_of_file(cocap_check.Instance(text), found)
    assert checked is not None and not is_part
    bound = checked / cocap_check.ONE
    allowance = ALIKE * (1 + abs(bound))
    assert best - allowance <= bound <= verified + allowance
    assert ask(text, found | {"bound": bound + allowance})[0] == 0
    assert ask(text, found | {"bound": bound - allowance})[0] == 1


@pytest.mark.parametrize(
    ("claims", "expected"),
    [
        ([], 20.0),
        ([(1, 18.0)], 18.0),
        ([(1, 16.0)], 16.0),
        ([(1, -5.0)], 16.0),
        ([(1, 25.0)], 20.0),
        ([(1, 16.0), (1, 18.0)], 16.0),
        ([(1, 16.0), (0, 25.0)], 20.0),
        ([(0, 25.0), (1, 16.0)], 16.0),
    ],
)
def test_moves_of_the_team_save_what_their_search_finds(
    claims: list[tuple[int, float]], expected: float, ask: Ask, ask_misled: Ask
) -> None:
    """A claim may be too high, and is raised if it is too low; it ends those that share a step."""
    file = staged_hunt.exchange_file({"moves": [_of_step(*claim) for claim in claims]})
    for asked in (ask, ask_misled):
        assert asked(staged_hunt.EXCHANGE, file | {"bound": expected * (1 + ALIKE)})[0] == 0
        assert asked(staged_hunt.EXCHANGE, file | {"bound": expected * (1 - ALIKE)})[0] == 1


@pytest.mark.parametrize("stage", [0, 1])
@pytest.mark.parametrize("t", [1, 2])
def test_new_prices_end_moves_of_the_team(stage: int, t: int, ask: Ask) -> None:
    """Moves to a step and from it end if it has new prices later, not in the same stage."""
    file = staged_hunt.exchange_file({"moves": [_of_step(1, 16.0)]}, {})
    new = {"payments": [_rising(t, 0.0)], "constants": [_of_step(t, 10.0)]}
    file["certificate"]["stages"][1 + stage] |= new
    expected = 20.0 if stage else 16.0
    assert ask(staged_hunt.EXCHANGE, file | {"bound": expected * (1 + ALIKE)})[0] == 0
    assert ask(staged_hunt.EXCHANGE, file | {"bound": expected * (1 - ALIKE)})[0] == 1


def test_no_move_begins_at_the_last_step(ask: Ask) -> None:
    """Such claims are refused before the program is asked, and by the program, too."""
    file = staged_hunt.exchange_file({"moves": [_of_step(2, 16.0)]})
    code, words = ask(staged_hunt.EXCHANGE, file)
    assert code == 1 and "moves: no move begins at the last step" in words
    file = staged_hunt.exchange_file({"moves": [_of_step(1, 16.0)]})
    assert ask(staged_hunt.EXCHANGE, file)[0] == 0

    def of_last_step(text: str) -> str:
        *words, t, claim, above, begun = text.split()
        assert t == "1"
        return " ".join([*words, "2", claim, above, begun]) + "\n"

    code, words = ask(staged_hunt.EXCHANGE, file, of_last_step)
    assert code == 1 and "stage: no move begins at this step" in words


def test_checkers_prove_the_same_by_moves_of_the_team(ask: Ask, ask_misled: Ask) -> None:
    """Whatever the advice, it proves what `cocap-check` proves, and never less than the best J."""
    draw, lower = random.Random(0), 0
    for _ in range(20):
        text = staged_hunt.draw_instance(draw)
        instance = cocap_check.Instance(text)
        best = staged_hunt.best_plan(instance)
        numbers = staged_hunt.draw_staged(instance, best, draw)
        numbers.pop("tails", None)  # which the theorem does not know
        file = staged_hunt.exchange_file() | {"digest": "drawn", "bound": 1e9}
        moving, plain = (
            cocap_check.bound_of_file(instance, file | {"certificate": certificate})[0]
            for certificate in (numbers, staged_hunt.without_moves(numbers))
        )
        assert moving is not None and plain is not None
        bound = moving / cocap_check.ONE
        allowance = ALIKE * (1 + abs(bound))
        assert bound >= best - allowance
        file["certificate"] = numbers
        assert ask(text, file | {"bound": bound + allowance})[0] == 0
        for asked in (ask, ask_misled):
            assert asked(text, file | {"bound": bound - allowance})[0] == 1
        lower += bound < plain / cocap_check.ONE - allowance
    assert lower > 2


def _rising(t: int, others: float) -> dict[str, Any]:
    return {"t": t, "robot_class": 0, "states": [], "payments": [], "others": others}


def _of_step(t: int, constant: float) -> dict[str, Any]:
    return {"t": t, "constant": constant}


@pytest.mark.parametrize(
    ("stage", "above"),
    [
        ({"constants": [_of_step(1, 1e3)]}, None),
        (
            {"payments": [_rising(1, 5.0)], "constants": [_of_step(1, -1e3), _of_step(1, -1e3)]},
            None,
        ),
        ({"payments": [_rising(1, 5.0), _rising(1, 2.0)], "constants": [_of_step(1, -1e3)]}, None),
        ({"constants": [_of_step(1, -1e3)]}, 1.5),
    ],
    ids=["a constant that is higher", "two of a step", "a class twice", "paths far above"],
)
def test_stages_are_read_as_the_other_checkers_read_them(
    stage: dict[str, Any], above: float | None, ask: Ask, tmp_path: Path
) -> None:
    """A constant at the same prices can only fall, prices rise once, and stages may prove more than
    paths."""
    problem = load_scene("tiny-doorway", 0)
    instance, proof = exported("tiny-doorway", tmp_path)
    file = {k: v for k, v in proof.items() if k != "nodes"} | {
        "format": "cocap-opt certificate", "certificate": first_leaf(proof),
    }  # fmt: skip
    target, best = 0.5 * file["bound"], optimum(problem).value
    found = _staged(
        file, target=target, stages=[stage], paths_above=above and above * file["bound"]
    )
    checked, _ = cocap_check.bound_of_file(cocap_check.Instance(instance), found)
    assert checked is not None
    bound = checked / cocap_check.ONE
    assert target < best <= bound
    read = decode_document(json.dumps(found).encode(), "", CertificateFile)
    assert isinstance(read.certificate, Staged)
    verified = price_staged(compiled(problem), read.certificate).bound
    assert bound == pytest.approx(verified, rel=ALIKE)
    assert ask(instance, found | {"bound": bound * (1 + ALIKE)})[0] == 0
    assert ask(instance, found | {"bound": bound * (1 - ALIKE)})[0] == 1


@pytest.mark.parametrize(
    ("instance", "file", "message"),
    [
        (None, '{"bound": NaN}', "file.json: not lowered: must hold finite numbers only, not NaN"),
        (None, '{"bound": 01}', "file.json: not lowered: line 1, column 12: must be JSON"),
        (None, "{}", "file.json: not lowered: "),
        ("nothing", "{}", "x.instance: not read: line 1: must be cocap-instance 1"),
        ("", None, "no such file"),
    ],
)
def test_files_that_cannot_be_lowered_have_a_message_of_one_line(
    instance: str | None, file: str | None, message: str, tmp_path: Path
) -> None:
    """It names the file and what is wrong."""
    paths = [tmp_path / "x.instance", tmp_path / "file.json"]
    text = instance_of(compiled(load_scene("tiny-doorway", 0))) if instance is None else instance
    paths[0].write_text(text)
    if file is not None:
        paths[1].write_text(file)
    command = [sys.executable, str(FOLDER / "lower.py"), *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert message in done.stderr and done.stderr.count("\n") == 1


def test_files_that_cannot_be_read_or_written_are_no_refusals(
    built: tuple[Path, str], tmp_path: Path
) -> None:
    """The program has exit code 2 then, as a refusal is 1, and `lower.py` says so in a line."""
    instance, proof = exported("tiny-doorway", tmp_path)
    paths = [tmp_path / name for name in ("x.instance", "proof.json", "no", "no/lowered.txt")]
    paths[0].write_text(instance)
    paths[1].write_text(json.dumps(proof))
    command = [sys.executable, FOLDER / "lower.py", *paths[:2], "-o", paths[3]]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == f"{paths[3]}: cannot be written: No such file or directory\n"
    for names in ((paths[0], paths[2]), (paths[2], paths[0]), (tmp_path, paths[0])):
        done = subprocess.run([built[0], *names], capture_output=True, text=True, check=False)
        assert done.returncode == 2, done.stdout


@staged_scenes
def test_misled_searches_prove_the_same(name: str, ask_misled: Ask, tmp_path: Path) -> None:
    """Stages and paths of a scene hold with nonsense for advice, and no less than they claim."""
    problem = load_scene(name, 0)
    text = instance_of(compiled(problem))
    for parameters in (WITHOUT_PATHS, DEFAULTS):
        file = document(column_generation(problem, parameters=parameters).certificate, tmp_path)
        code, words = ask_misled(text, file)
        assert code == 0, words
        assert ask_misled(text, file | {"bound": file["bound"] * (1 - 1e-7)})[0] == 1


def test_limits_end_a_check(ask: Ask, tmp_path: Path) -> None:
    """At a limit of nodes or time it says so in a line, and claims nothing: exit code 3."""
    problem = load_scene("corridor-tight", 0)
    text = instance_of(compiled(problem))
    file = document(column_generation(problem, parameters=WITHOUT_PATHS).certificate, tmp_path)
    for options in (("--most-nodes", "2"), ("--time-limit", "1e-3")):
        code, words = ask(text, file, str, *options)
        assert code == 3
        assert re.fullmatch("not decided: .* more than .*\n", words)
    assert ask(text, file, str, "--most-nodes", "100000", "--time-limit", "100")[0] == 0
    for options in (("--most-nodes", "-1"), ("--time-limit", "soon"), ("--most", "1")):
        assert ask(text, file, str, *options)[0] == 2


# Of lines of an instance: the first that fits a pattern, and what stands there instead.
UNKNOWN = {
    "an unknown word": (r"(?m)^kind$", "kind\nsort 1"),
    "a word twice": (r"(?m)^(horizon .*)$", r"\1\n\1"),
    "no digest": (r"(?m)^digest .*\n", ""),
    "two digests in a line": (r"(?m)^(digest .*)$", r"\1 0"),
    "rules of a number": (r"(?m)^rules 1", "rules 2"),
    "swaps without a vertex rule": (r"(?m)^rules 1 \S+", "rules 0 1"),
    "a weight twice": (r"(?m)^(weight .*)$", r"\1\n\1"),
    "k of a root": (r"(?m)^(weight \S+ \S+)$", r"\1 3"),
    "a group that is not there": (r"(?m)^weight \d+", "weight 1000000"),
    "a drone twice": (r"(?m)^(drone .*)$", r"\1\n\1"),
    "a drone that is left out": (r"(?m)^drone 0", "drone 9"),
    "a start that is not there": (r"(?m)^(drone \d+ :).*$", r"\1 99999,0"),
    "a class of no kind": (r"(?m)^class 0", "class 7"),
    "a move twice": (r"(?m)^(place .* )(\S+)$", r"\1\2 \2"),
    "a move to nowhere": (r"(?m)^(place .*)$", r"\1 99999"),
    "a cell twice": (r"(?m)^(place .*)$", r"\1\n\1"),
    "an orientation twice": (r"(?m)^(orientation .*)$", r"\1\n\1"),
    "a turn to nowhere": (r"(?m)^(orientation .*)$", r"\1 99"),
    "a closed place that is not there": (r"(?m)^kind$", "kind\nclosed 0 99999"),
    "a view twice": (r"(?m)^(sees .*)$", r"\1\n\1"),
    "a group twice": (r"(?m)^(sees .* : )(\S+)", r"\1\2 \2"),
    "a view of another step": (r"(?m)^(sees )(\d+)( .* : )(\d+)", r"\g<1>1\g<3>0"),
    "nothing seen of a group": (r"(?m)^(sees .* : \d+):\S+", r"\1:0x0p+0"),
    "a number below 0": (r"(?m)^(sees .* : \d+):", r"\1:-"),
    "a decimal number": (r"(?m)^(weight \d+) \S+", r"\1 1.5"),
    "no end": (r"end\s*$", ""),
    "words after the end": (r"end\s*$", "end\nkind\n"),
}


@pytest.mark.parametrize("what", UNKNOWN)
def test_it_reads_instances_as_strictly_as_cocap_check(
    what: str, built: tuple[Path, str], tmp_path: Path
) -> None:
    """What cocap-check does not know of an instance, the program does not know either."""
    instance, _ = exported("tiny-doorway", tmp_path)
    changed, count = re.subn(*UNKNOWN[what], instance, count=1)
    assert count == 1
    assert changed != instance
    with pytest.raises((cocap_check.Refused, *cocap_check.DAMAGED)):
        cocap_check.Instance(changed)
    paths = [tmp_path / name for name in ("x.instance", "proof.json", "lowered.txt")]
    lower = [sys.executable, FOLDER / "lower.py", *paths[:2], "-o", paths[2]]
    subprocess.run(lower, check=True)
    paths[0].write_text(changed)
    done = subprocess.run(
        [built[0], paths[0], paths[2]], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1, done.stdout
    assert done.stdout.startswith("refused")
