"""The command `front`: a folder that is gone on with, and what is refused."""

import json
from pathlib import Path

import msgspec
import pytest
from trade_offs import crossroads

import cocap_opt as co
from cocap_opt.cli.main import main
from cocap_opt.files.documents import SceneFile, encode


def said(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[object, str, str]:
    """Exit code and output of the command."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as caught:
        main(["front", *map(str, words)])
    return caught.value.code, *capsys.readouterr()


def test_a_folder_is_gone_on_with(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Bounds are read back and checked; calls add directions until plans and proofs meet."""
    folder, scene, found = tmp_path / "front", tmp_path / "crossroads.json", []
    scene.write_bytes(encode(SceneFile.of(crossroads())))
    for bounds in (2, 3, 3):
        code, out, _ = said(
            capsys, scene, "--directions", 2, "--seconds", 2, "-o", folder, "--share", 0, "--json"
        )
        answer = json.loads(out)
        assert code == 0 and answer["front"]
        assert len([*folder.glob("direction-*.bound.json")]) == bounds
        assert len([*folder.glob("plan-*.json")]) == len(answer["front"])
        found.append((answer["gap"], answer["settled"]))
    (first, was), (second, done), last = found
    assert first > second == pytest.approx(0.0, abs=1e-6)
    assert not was and done and last[1]
    assert (folder / "front.csv").read_text().startswith("kind,")
    code, out, _ = said(capsys, scene, "--directions", 0, "-o", folder)
    assert code == 0 and "the trade-off is settled: no weighting" in " ".join(out.split())


def test_one_plan_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing else is tried where it is the best of both."""
    code, out, _ = said(capsys, "tiny-share", "--seconds", 2)
    assert code == 0 and "one plan is best in both" in out


def test_a_lower_bound_than_is_proved_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line, exit code 2; so are folders of another scene, or of other cameras."""
    code, *_ = said(capsys, "tiny-share", "--directions", 1, "--seconds", 2, "-o", tmp_path)
    assert code == 0
    for words, told in (
        (("tiny-queue",), "made for tiny-share"),
        (("tiny-share", "--cameras", 1), "another scene"),
    ):
        code, _, err = said(capsys, *words, "--directions", 0, "-o", tmp_path)
        assert code == 2 and told in err and err.count("\n") == 1
    path = tmp_path / "direction-1.bound.json"
    content = msgspec.json.decode(path.read_bytes())
    content["bound"] *= 0.5
    path.write_bytes(msgspec.json.encode(content))
    code, _, err = said(capsys, "tiny-share", "--directions", 0)
    assert code == 2 and "--directions: must be 1 or more without -o" in err
    code, _, err = said(capsys, "tiny-share", "--directions", 0, "-o", tmp_path)
    assert code == 2 and "direction-1.bound.json" in err and err.count("\n") == 1


def test_a_folder_holds_plans_that_obey_the_rules(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan that breaks one is no plan of the trade-off, and is not removed in silence."""
    asked = co.with_views(co.load("tiny-share"), cameras=2)
    co.save(tmp_path / "scene.json", asked)
    folder, scene = tmp_path / "front", tmp_path / "scene.json"
    code, *_ = said(capsys, scene, "--directions", 1, "--seconds", 2, "-o", folder)
    assert code == 0
    plan = folder / "plan-1.json"
    verified = co.verify(asked, co.read(plan))
    assert not verified.violations  # it is for the scene as it was given, and has its J
    content = msgspec.json.decode(plan.read_bytes())
    content["plan"]["paths"][1] = content["plan"]["paths"][0]
    plan.write_bytes(msgspec.json.encode(content))
    code, _, err = said(capsys, scene, "--directions", 0, "-o", folder)
    assert code == 2 and "plan-1.json" in err and "breaks a rule" in err and plan.exists()


@pytest.mark.long
def test_a_scene_asks_for_a_share(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`plan` says that it is missed; `front` goes for it without being told."""
    path, plan = tmp_path / "scene.json", tmp_path / "plan.json"
    asked = co.with_views(co.load("tiny-doorway"), cameras=2, weight=1.0, share=1.0)
    co.save(path, asked)
    with pytest.raises(SystemExit) as caught:
        main(["plan", str(path), "-o", str(plan), "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert caught.value.code == 0 and "5 of 6 views are kept, fewer than 100 %" in answer["message"]
    code, out, _ = said(capsys, path, "--directions", 2, "--seconds", 2, "--json")
    answer = json.loads(out)
    assert code == 0 and answer["cameras"] == 2
    assert "proved: no plan of these drones keeps 100 %" in answer["notes"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--cameras", "0"), "--cameras: must be 1..64"),
        (("--at-least", "0"), "--at-least: must be > 0"),
        (("--share", "1.5"), "--share: must be 0..1"),
        (("--seconds", "0"), "--seconds: must be more than 0"),
    ],
)
def test_wrong_options_are_one_line(
    words: tuple[str, str], expected: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """With what is allowed."""
    code, _, err = said(capsys, "tiny-share", *words)
    assert code == 2 and expected in err and err.count("\n") == 1
