"""Digests: strangers recompute them by the page's recipe, and all files name the same one."""

import csv
import hashlib
import json
import struct
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cocap_opt as co
from cocap_opt.cli.commands import run
from cocap_opt.files.documents import PlanFile, other_coverage, problem_digest

GOLDEN = Path(__file__).parent / "golden" / "coverage.json"
SCENES = ("tiny-queue", "tiny-share", "tiny-doorway", "tiny-turn", "corridor")
# A change of coverage beyond rounding has to move the version, and then to store this file again.
MOVED = (
    "pixels have changed. If that is meant: add 1 to COVERAGE_VERSION in "
    "cocap_opt/problem/objective.py, tell it in the changelog, and store "
    "tests/golden/coverage.json again: `python tests/test_digests.py`"
)


class Number(str):
    """A number as its file writes it."""


def written(value: Any) -> str:
    """Returns JSON without blanks, in which numbers are as they were read."""
    if isinstance(value, Number):
        return str(value)
    if isinstance(value, list):
        return "[" + ",".join(map(written, value)) + "]"
    if isinstance(value, dict):
        return "{" + ",".join(f"{json.dumps(k)}:{written(v)}" for k, v in value.items()) + "}"
    return json.dumps(value, ensure_ascii=False)


def recipe(path: Path) -> str:
    """Returns a scene's digest as the page on file formats says, by code of its own."""
    text = path.read_text(encoding="utf-8")
    problem = json.loads(text, parse_float=Number, parse_int=Number)["problem"]
    problem["name"] = ""
    del problem["earth"], problem["land_cover"]
    numbers = {take["name"]: str(k) for k, take in enumerate(problem["takes"])}
    for take in problem["takes"]:
        take["name"] = numbers[take["name"]]
    if not problem["takes"]:
        del problem["takes"]
    for actor in problem["actors"]:
        del actor["name"], actor["begin"]
        if actor["take"] is None:
            del actor["take"]
        else:
            actor["take"] = numbers[actor["take"]]
    del problem["height_map"]["bare"]
    for robot in problem["robots"]:
        del robot["home"], robot["number"]
    for holder, field in [(problem, "step"), *((robot, "limits") for robot in problem["robots"])]:
        if holder[field] is None:
            del holder[field]
    for holder, field in [
        (problem["height_map"], "lift"),
        *((robot["motion"], "stride") for robot in problem["robots"]),
    ]:
        if holder[field] is None:
            del holder[field]
    for robot in problem["robots"]:
        if int(robot["motion"]["spacing"]) == 1:
            del robot["motion"]["spacing"]
    if float(problem["airspace"]["people_stray"]) == 0:
        del problem["airspace"]["people_stray"]
    for actor in problem["actors"]:
        if float(actor["swerve"]) == 0:
            del actor["swerve"]
    objective = problem["objective"]
    if objective["views"] is None:
        del objective["views"]
    else:
        del objective["views"]["share"]
    if float(objective["pixels"]) == 1:
        del objective["pixels"]
    return hashlib.sha256(written(problem).encode()).hexdigest()


def own_scene() -> co.Problem:
    """Returns a scene of odd numbers, some of them whole, some in need of an exponent."""
    heights = np.full((5, 7), -0.0)
    heights[2, 3] = 1e-7
    walk = np.column_stack([[6, 7.5, 16 / 3], [1e8 + 4] * 3, [0, 0, 0], [0, 1e-5, 3]])
    return co.Problem(
        name="Kö\u2028nig \U0001f600",
        height_map=co.HeightMap(heights=heights, resolution=1, origin=(5, 1e8)),
        robots=(
            co.Robot(start=co.State(1, 1), limits=co.Limits(speed=9)),
            co.Robot(start=co.State(3, 1)),
        ),
        actors=(co.Actor(poses=walk, name="Ada", weights=(1, 2, 3, 4, 1e-9)),),
        horizon=2,
        step=2,
    )


@pytest.mark.parametrize("scene", [*SCENES, "bottleneck", "own", "views", "takes", "goals"])
def test_the_recipe_of_a_scenes_digest(scene: str, tmp_path: Path) -> None:
    """By the page, and the file alone, anybody computes the digest that plans name."""
    problem = co.load(scene) if scene in (*SCENES, "bottleneck") else own_scene()
    if scene == "views":
        problem = co.with_views(problem, weight=[0.5], share=0.9)
        problem = problem.replace(objective=problem.objective.replace(pixels=0))
    if scene == "takes":
        likely, rare = co.Take(name="usual", probability=0.9), co.Take(name="rare", probability=0.1)
        late = problem.actors[0].replace(take="rare")
        problem = problem.replace(takes=(likely, rare), actors=(*problem.actors, late))
    if scene == "goals":
        bare = problem.height_map.replace(bare=problem.height_map.heights - 1)
        goals = co.GoalArea(cells=((3, 1), (1, 1), (2, 2))), (2, 1)
        robots = tuple(r.replace(goal=g) for r, g in zip(problem.robots, goals, strict=True))
        problem = problem.replace(height_map=bare, robots=robots)
    co.save(tmp_path / "scene.json", problem)
    assert recipe(tmp_path / "scene.json") == problem_digest(problem)
    assert problem_digest(co.read(tmp_path / "scene.json", co.Problem)) == problem_digest(problem)


def coverage_recipe(problem: co.Problem) -> str:
    """Returns the digest of coverage as the page says, of the tables that `co.coverage` gives."""
    import pandas as pd

    kinds: dict[Any, list[pd.DataFrame]] = {}
    for number, robot in enumerate(problem.robots):
        kinds.setdefault((robot.motion, robot.camera), []).append(co.coverage(problem, number))
    order = ["step", "heading", "pitch", "layer", "x", "y", "actor", "face"]
    digest = hashlib.sha256()
    for tables in kinds.values():
        table = pd.concat(tables).drop(columns="weight").drop_duplicates().sort_values(order)
        for row in table.itertuples(index=False):
            whole = (row.step, row.x, row.y, row.layer, row.heading, row.pitch, row.actor, row.face)
            digest.update(struct.pack("<8qd", *whole, row.pixels))
    return digest.hexdigest()


@pytest.mark.parametrize("scene", ["tiny-queue", "tiny-turn", "corridor"])
def test_the_recipe_of_the_digest_of_coverage(scene: str) -> None:
    """By the page anybody computes it from the table; drones of two kinds have two tables."""
    problem = co.load(scene)
    assert co.coverage_digest(problem) == coverage_recipe(problem)
    first, *others = problem.robots
    wider = first.replace(camera=co.Camera(focal=80.0))
    mixed = problem.replace(robots=(wider, *others))
    assert co.coverage_digest(mixed) == coverage_recipe(mixed)
    assert co.coverage_digest(mixed) != co.coverage_digest(problem)
    assert co.coverage_digest(problem.without_rules()) == co.coverage_digest(problem)


def coverage_now() -> dict[str, Any]:
    """Returns version and numbers of the coverage of some scenes, as they are stored."""
    scenes = {}
    for name in SCENES:
        problem = co.load(name)
        pixels = [co.coverage(problem, n).pixels for n in range(len(problem.robots))]
        scenes[name] = {
            "digest": co.coverage_digest(problem),
            "rows": sum(map(len, pixels)),
            "pixels": float(sum(some.sum() for some in pixels)),
        }
    return {"version": co.COVERAGE_VERSION, "numpy": version("numpy"), "scenes": scenes}


def test_the_version_of_coverage_moves_with_pixels() -> None:
    """Pixels are those stored for this version; to the last bit where NumPy is the same release."""
    stored, now = json.loads(GOLDEN.read_text(encoding="utf-8")), coverage_now()
    assert stored["version"] == now["version"], "store coverage.json again: " + MOVED
    for name, known in stored["scenes"].items():
        found = now["scenes"][name]
        assert found["rows"] == known["rows"], f"{name}: {MOVED}"
        assert found["pixels"] == pytest.approx(known["pixels"], rel=1e-12), f"{name}: {MOVED}"
        if stored["numpy"] == now["numpy"]:
            assert found["digest"] == known["digest"], f"{name}: {MOVED}"


def answer(capsys: pytest.CaptureFixture[str], *words: object) -> dict[str, Any]:
    """Returns what a command prints as JSON."""
    capsys.readouterr()
    assert run([str(word) for word in (*words, "--json")]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


@pytest.mark.slow
def test_all_name_the_same_digest(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Scene, plan, certificate, proof, table and answers of commands name one digest."""
    scene, plan, bound, best, proof = (
        tmp_path / f"{name}.json" for name in ("scene", "plan", "bound", "best", "proof")
    )
    answers = [
        answer(capsys, "export", "tiny-queue", "-o", scene),
        answer(capsys, "plan", "tiny-queue", "-o", plan),
        answer(capsys, "bound", scene, "-o", bound),
        answer(capsys, "solve", "tiny-queue", "-o", best, "--certificate", proof),
        answer(capsys, "verify", scene, plan, bound),
        answer(capsys, "show", "tiny-queue", plan, "-o", tmp_path / "show.html"),
    ]
    files = [json.loads(path.read_text()) for path in (plan, bound, best, proof)]
    assert run(["gap", "tiny-queue", "--planner", "greedy", "--out", str(tmp_path / "out")]) == 0
    with (tmp_path / "out" / "results.csv").open() as table:
        rows = list(csv.DictReader(table))
    assert {one["digest"] for one in (*answers, *files, *rows)} == {recipe(scene)}
    assert {one["coverage_version"] for one in files} == {co.COVERAGE_VERSION}


@pytest.mark.slow
def test_verify_says_where_coverage_was_another(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan and a certificate of another version are judged by this one, and it is said."""
    plan, bound = tmp_path / "plan.json", tmp_path / "bound.json"
    answer(capsys, "plan", "tiny-queue", "-o", plan)
    answer(capsys, "bound", "tiny-queue", "-o", bound)
    assert "message" not in answer(capsys, "verify", "tiny-queue", plan, bound)
    for path in (plan, bound):
        content = json.loads(path.read_text()) | {"coverage_version": 1}
        path.write_text(json.dumps(content))
    words = other_coverage(1)
    assert words.startswith("it was made with version 1 of coverage, but this is version ")
    found = answer(capsys, "verify", "tiny-queue", plan, bound)
    assert found["message"] == f"the plan: {words}; the bound: {words}"
    plan.write_text(json.dumps(json.loads(plan.read_text()) | {"reward": 39.0}))
    bound.write_text(json.dumps(json.loads(bound.read_text()) | {"bound": 38.0}))
    assert run(["verify", "tiny-queue", str(plan), str(bound)]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert said.count("it was made with version 1 of coverage") >= 2


def test_files_of_before_name_no_version_of_coverage(tmp_path: Path) -> None:
    """Plans, certificates and proofs of the version before are read, and nothing is said."""
    problem = co.load("tiny-queue")
    for content, older in ((co.plan(problem, "greedy"), 3), (co.bound(problem).certificate, 4)):
        co.save(tmp_path / "file.json", content)
        text = json.loads((tmp_path / "file.json").read_text()) | {"version": older}
        del text["coverage_version"]
        (tmp_path / "file.json").write_text(json.dumps(text))
        if isinstance(content, co.Result):
            assert PlanFile.read(tmp_path / "file.json").coverage_version is None
        else:
            file = co.read(tmp_path / "file.json", co.CertificateFile)
            assert file.coverage_version is None
            assert co.verify(problem, file).other_coverage == ""
    assert other_coverage(None) == other_coverage(co.COVERAGE_VERSION) == ""


if __name__ == "__main__":
    known = json.loads(GOLDEN.read_text(encoding="utf-8")) if GOLDEN.exists() else {"version": 0}
    found = coverage_now()
    if known["version"] == found["version"] and known["scenes"] != found["scenes"]:
        raise SystemExit(MOVED)
    GOLDEN.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
