"""`plan --from-step`: the rest of a mission, planned again."""

import json
from pathlib import Path

import numpy as np
import pytest
from test_cli import Run

import cocap_opt as co

SCENE = "bottleneck"
K = 3


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a plan that leaves something to gain."""
    path = tmp_path_factory.mktemp("rest") / "plan.json"
    co.save(path, co.plan(co.load(SCENE), "one-step"))
    return path


@pytest.mark.long(seconds=4)
def test_the_rest_is_planned_again_and_written(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is written can be verified, against the scene and against the scene of the rest."""
    whole, scene, rest, proof = (tmp_path / f"{name}.json" for name in "wsrc")
    run = Run(
        capsys, "plan", SCENE, "--from-step", K, "--plan", flown, "-o", whole, "--rest-scene",
        scene, "--rest-plan", rest, "--certificate", proof, "--json",
    )  # fmt: skip
    assert run.code == 0
    answer = run.json
    assert answer["old_reward"] < answer["reward"] <= answer["bound"]
    assert answer["gap"] <= 0.01 and answer["drones"] == [0, 1, 2, 3] and answer["from_step"] == K
    assert "the plan is written; computing its bound" in run.err
    verified = Run(capsys, "verify", SCENE, whole, "--json").json
    assert verified["reward"] == pytest.approx(answer["whole_reward"])
    verified = Run(capsys, "verify", scene, rest, proof, "--json").json
    assert (verified["reward"], verified["bound"]) == pytest.approx(
        (answer["reward"], answer["bound"])
    )
    old, new = co.read(flown, co.Plan), co.read(whole, co.Plan)
    assert all(a[: K + 1] == b[: K + 1] for a, b in zip(old.paths, new.paths, strict=True))
    told = Run(capsys, "plan", SCENE, "--from-step", K, "--plan", whole, "--bound-limit", 0)
    assert "drones that fly it" in told.out and "0 1 2 3" in told.out and "bound" not in told.out


@pytest.mark.slow
def test_a_drone_is_lost_and_people_walk_elsewhere(
    flown: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The rest of the others is a plan for its own scene; one of other walks is said to be so."""
    scene, rest, moved = (tmp_path / f"{name}.json" for name in "srm")
    quick = ("--from-step", K, "--plan", flown, "--bound-limit", 0, "--planner", "cocap")
    words = (*quick, "--without", 1, "--rest-scene", scene)
    run = Run(capsys, "plan", SCENE, *words, "--rest-plan", rest, "--json")
    assert run.json["drones"] == [0, 2, 3] and run.json["file"] is None
    assert run.json["scene"] == f"{SCENE}, from step {K}, without drone 1"
    assert len(json.loads(rest.read_text())["plan"]["paths"]) == 3
    assert Run(capsys, "verify", scene, rest).code == 0
    assert [robot.number for robot in co.read(scene).robots] == [0, 2, 3]
    table = Run(capsys, "fly", scene, rest, "--step", 2, "-o", tmp_path / "rest.csv")
    assert table.code == 0 and "drone 1 is 2, drone 2 is 3" in " ".join(table.out.split())
    for name in ("rest.skyc", "rest.plan"):
        run = Run(capsys, "fly", scene, rest, "--step", 2, "-o", tmp_path / name)
        assert run.code == 2 and "these missions take off" in run.err
    problem = co.load(SCENE)
    actors = []
    for actor in problem.actors:
        poses = actor.poses.copy()
        poses[K + 1 :, :2] += np.array([0.4, -0.3])
        actors.append(actor.replace(poses=poses))
    co.save(moved, problem.replace(actors=tuple(actors)))
    new = tmp_path / "new.json"
    run = Run(capsys, "plan", moved, *quick, "-o", new, "--json")
    assert run.code == 0 and run.json["old_reward"] <= run.json["reward"]
    assert "its steps 0..3 obey the rules here, too, and count as flown" in caplog.text
    assert Run(capsys, "verify", moved, new).code == 0


def test_wrong_input_is_refused_in_one_line(
    flown: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The line names option or file, the exit code is 2, and nothing is written."""
    out, proof, none = tmp_path / "o.json", tmp_path / "c.json", tmp_path / "none.json"
    proof.write_text('{"format": "cocap-opt certificate"}')
    start = ("--from-step", K, "--plan", flown)
    for words, expected in (
        (("--plan", flown), "--plan: must be left out without --from-step"),
        (("--without", 1), "--without: must be left out without --from-step"),
        (("--bound-limit", 3), "--bound-limit: must be left out without --from-step"),
        (("--rest-scene", out), "--rest-scene: must be left out without --from-step"),
        (("--from-step", K), "--plan: must name the plan that was flown up to that step"),
        (("--from-step", 0, "--plan", flown), "--from-step: must be a step from 1 to"),
        (("--from-step", 999, "--plan", flown), "--from-step: must be a step from 1 to"),
        (("--from-step", 1.5, "--plan", flown), "--from-step: must be"),
        (("--from-step", K, "--plan", none), "none.json: no such file"),
        (("--from-step", K, "--plan", proof), "c.json: "),
        ((*start, "--without", 7), "--without: must be numbers of drones, 0..3, not 7"),
        ((*start, "--without", 1, "-o", out), "-o: must be left out with --without"),
        ((*start, "--bound-limit", -1), "--bound-limit: must be a number of seconds"),
        ((*start, "--bound-limit", 0, "--certificate", out), "--certificate: must be left out"),
        ((*start, "-o", out, "--rest-plan", out), "--rest-plan: must differ from the file of -o"),
        ((*start, "-o", flown), "must not be an input file"),
        ((*start, "--seed", 1), "plan.json: the steps 0..3 cannot have been flown in"),
    ):
        run = Run(capsys, "plan", SCENE, *words)
        assert run.code == 2, words
        (line,) = [line for line in run.err.splitlines() if "seed" not in line]
        assert expected in line, line
        assert not out.exists()
    run = Run(capsys, "plan", "corridor", *start)
    assert run.code == 2 and "plan.json: paths: must be 2, one for each drone, not 4" in run.err
