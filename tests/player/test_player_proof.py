"""The certificate that a page of `show` offers: its bytes, and commands that check it again."""

import hashlib
import json
import shlex
from pathlib import Path

import pytest
from players import EVIL, run, told

from cocap_opt.files.documents import PlanFile, SceneFile
from cocap_opt.formulations.independent import cocap_check
from cocap_opt.player import player_proof
from cocap_opt.player.player_proof import Proof

SCENE = "tiny-queue"


@pytest.fixture
def proved(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder, which is the current one, with a plan and a certificate of a small scene."""
    monkeypatch.chdir(tmp_path)
    assert run("plan", SCENE, "-o", "a plan.json") == 0
    assert run("bound", SCENE, "--start", "a plan.json", "-o", "bound.json") == 0
    return tmp_path


def test_the_certificate_is_part_of_the_page(proved: Path) -> None:
    """Its bytes are those of the file, which was verified; without one there is none."""
    assert run("show", SCENE, "a plan.json", "--certificate", "bound.json", "-o", "film.html") == 0
    proof = told(Path("film.html").read_text())["certificate"]
    content = Path("bound.json").read_bytes()
    assert proof["text"].encode() == content
    assert proof["sha256"] == hashlib.sha256(content).hexdigest()
    assert (proof["name"], proof["bytes"]) == ("bound.json", len(content))
    assert run("show", SCENE, "a plan.json", "-o", "film.html") == 0
    assert told(Path("film.html").read_text())["certificate"] is None


def test_its_commands_check_it(proved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They run as they are shown, from the folder in which `show` was called."""
    assert run("show", SCENE, "a plan.json", "--certificate", "bound.json", "-o", "film.html") == 0
    proof = told(Path("film.html").read_text())["certificate"]
    (verify,), ((export, check),) = proof["verify"], proof["check"]
    for line in (verify, export):
        name, *words = shlex.split(line)
        assert (name, run(*words)) == ("cocap-opt", 0)
    name, *words = shlex.split(check)
    capsys.readouterr()
    assert (name, cocap_check.main(words)) == ("cocap-check", 0)
    assert len(capsys.readouterr().out.splitlines()) == 3


def test_commands_name_the_scene_as_it_was_typed(proved: Path) -> None:
    """With its seed, and its file's name for the instance."""
    assert run("export", SCENE, "--seed", "3", "-o", "my scene.json") == 0
    shown = ("a plan.json", "--certificate", "bound.json", "-o", "film.html")
    assert run("show", SCENE, *shown, "--seed", "3") == 0
    proof = told(Path("film.html").read_text())["certificate"]
    assert proof["verify"] == [f"cocap-opt verify {SCENE} 'a plan.json' bound.json --seed 3"]
    assert proof["check"][0][0] == f"cocap-opt export {SCENE} --seed 3 -o {SCENE}.instance"
    assert run("show", "my scene.json", *shown) == 0
    proof = told(Path("film.html").read_text())["certificate"]
    assert proof["check"] == [[
        "cocap-opt export 'my scene.json' -o 'my scene.instance'",
        "cocap-check 'my scene.instance' 'a plan.json' bound.json",
    ]]  # fmt: skip


def test_a_plan_for_another_objective_is_not_checked_again(proved: Path) -> None:
    """Who checks would refuse it, so that commands name the certificate alone."""
    problem = SceneFile.read(_scene(proved)).problem
    file = PlanFile.read(Path("a plan.json"))
    other = problem.replace(objective=problem.objective.replace(stationarity=1.0))
    PlanFile.of(other, file.plan, 1.0, "greedy").save(Path("other.json"))
    assert run("show", SCENE, "other.json", "--certificate", "bound.json", "-o", "film.html") == 0
    proof = told(Path("film.html").read_text())["certificate"]
    assert proof["verify"] == [f"cocap-opt verify {SCENE} bound.json"]
    assert proof["check"][0][1] == f"cocap-check {SCENE}.instance bound.json"


def _scene(folder: Path) -> Path:
    path = folder / "scene.json"
    assert run("export", SCENE, "-o", path) == 0
    return path


def test_a_large_file_is_named_and_left_out() -> None:
    """A page holds no more than a megabyte of it; name, size and digest are told."""
    proof = Proof("large.json", b"{}" + b" " * player_proof.MOST_BYTES, ["verify"], [[]], None)
    data = proof.data()
    assert (data["text"], data["bytes"]) == (None, player_proof.MOST_BYTES + 2)
    assert data["sha256"] == hashlib.sha256(proof.content).hexdigest()
    assert proof._replace(content=b"{}").data()["text"] == "{}"


def test_the_page_that_checks_is_linked_where_its_address_is_known(
    monkeypatch: pytest.MonkeyPatch, proved: Path
) -> None:
    """It is that of the package's documentation; a package that names none has no link."""
    shown = ("show", SCENE, "a plan.json", "--certificate", "bound.json", "-o", "film.html")
    pages = []
    for lines in ([], ["Documentation, https://example.org/co/"]):
        monkeypatch.setattr(player_proof, "metadata", lambda name, lines=lines: _Told(lines))
        assert run(*shown) == 0
        pages.append(told(Path("film.html").read_text())["certificate"]["page"])
    assert pages == [None, "https://example.org/co/how-to/check-in-the-browser.html"]


class _Told:
    """A package's metadata, of which only addresses are asked."""

    def __init__(self, addresses: list[str]) -> None:
        self.addresses = addresses

    def get_all(self, field: str) -> list[str]:
        """Returns the addresses."""
        assert field == "Project-URL"
        return self.addresses


def test_names_of_files_are_data(proved: Path) -> None:
    """A name that looks like HTML neither ends the data nor becomes an element."""
    name = EVIL.replace("/", "_") + ".json"
    Path("bound.json").rename(name)
    assert run("show", SCENE, "a plan.json", "--certificate", name, "-o", "film.html") == 0
    page = Path("film.html").read_text()
    assert told(page)["certificate"]["name"] == name
    assert name not in page and json.dumps(name) not in page
