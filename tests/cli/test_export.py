"""`cocap-opt export`: for other solvers, as long tables, and scenes that end earlier."""

import csv
import importlib.util
import math
import re
from collections import Counter, defaultdict
from pathlib import Path

import highspy
import pytest
from strategies import tiny
from test_cli import Run

from cocap_opt.files.documents import SceneFile, encode, problem_digest
from cocap_opt.formulations.model_files.model import ModelFile
from cocap_opt.model import compiled
from cocap_opt.output import long_tables
from cocap_opt.output.long_tables import TABLES
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Actor, Airspace, Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.vision.default_weights import with_views


def table(problem: Problem, name: str, folder: Path) -> list[dict[str, float]]:
    """The rows of a long table, written and read."""
    model = compiled(problem)
    model.prepare_all()
    path = folder / f"{name}.csv"
    with path.open("wb") as file:
        lines = TABLES[name].write(file, model)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert len(rows) == lines
    return [{key: float(value) for key, value in row.items()} for row in rows]


def varied() -> Problem:
    """Two kinds of drones, two people, of whom one keeps drones away, and views that count."""
    problem = tiny()
    first, second = problem.robots
    motion = second.motion.replace(layers=(5.0, 9.0), climb=1, headings=8)
    camera = second.camera.replace(tilts=(0.4, 0.9))
    person = problem.actors[0]
    other = Actor(poses=person.poses - [2.0, 0.0, 0.0, 0.0])
    problem = problem.replace(
        robots=(first, second.replace(motion=motion, camera=camera)), actors=(person, other),
        airspace=Airspace(people_aside=1.5), name="varied",
    )  # fmt: skip
    return with_views(problem, 2, 3.0)


SCENES = {
    "varied": varied,
    "corridor": lambda: load_scene("corridor", 0).until(3),
    "over time": lambda: tiny().replace(objective=tiny().objective.replace(over_time=True)),
}


@pytest.mark.parametrize("name", SCENES)
def test_j_can_be_added_up_from_the_tables(name: str, tmp_path: Path) -> None:
    """Coverage and views are all that J is made of besides rewards for moves, by the referee."""
    problem = SCENES[name]()
    plan = PLANNERS["sequential"](problem).plan
    assert plan is not None
    kinds = {int(row["drone"]): row["kind"] for row in table(problem, "drones", tmp_path)}
    at = {
        (kinds[i], t, *state): i
        for i, path in enumerate(plan.paths)
        for t, state in enumerate(path)
    }
    assert len(at) == sum(map(len, plan.paths))  # no two drones of a kind are in one state
    state = ("kind", "step", "x", "y", "layer", "heading", "tilt")
    pixels: dict[tuple[int, int, int], float] = defaultdict(float)
    for row in table(problem, "coverage", tmp_path):
        if tuple(row[key] for key in state) in at:
            step = 0 if problem.objective.over_time else int(row["step"])
            pixels[step, int(row["person"]), int(row["face"])] += row["px_per_m2"]
    weights, owner = problem.step_weights, problem.face_owner.tolist()
    j = sum(
        weights[t, owner.index(person) + face] * math.sqrt(seen)
        for (t, person, face), seen in pixels.items()
    )
    counts = Counter(
        (int(row["step"]), int(row["person"]))
        for row in table(problem, "views", tmp_path)
        if tuple(row[key] for key in state) in at
    )
    most = problem.objective.views.cameras if problem.objective.views else 0
    j += sum(problem.count_weights[t, p] * min(n, most) for (t, p), n in counts.items())
    verdict = check(problem, plan)
    assert verdict.reward - verdict.reward_moves == pytest.approx(j, rel=1e-12)
    assert bool(counts) is (name == "varied")


@pytest.mark.parametrize("name", SCENES)
def test_moves_and_turns_are_those_of_the_graph(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From each state that is reached they lead where the graph does; chunks do not show."""
    problem = SCENES[name]()
    turns, moves = defaultdict(set), defaultdict(set)
    whole = table(problem, "moves", tmp_path)
    monkeypatch.setattr(long_tables, "_CHUNK", 7)
    assert table(problem, "moves", tmp_path) == whole
    for row in table(problem, "turns", tmp_path):
        turns[row["kind"], row["heading"], row["tilt"]].add((row["to_heading"], row["to_tilt"]))
    for row in whole:
        moves[row["kind"], row["step"], row["x"], row["y"], row["layer"]].add(
            (row["to_x"], row["to_y"], row["to_layer"])
        )
    model, kinds = compiled(problem), list[object]()
    for robot_class in model.classes:
        if robot_class.sight in kinds:
            continue
        kind, graph = len(kinds), robot_class.graph
        kinds.append(robot_class.sight)
        reached, ways = set(robot_class.all_starts.tolist()), 0
        for t in range(problem.horizon):
            after = set[int]()
            for number in reached:
                x, y, layer, heading, tilt = graph.state(number)
                ahead = graph.successors(t, number).tolist()
                after |= set(ahead)
                assert {graph.state(head) for head in ahead} == {
                    (*place, *turn)
                    for place in moves[kind, t, x, y, layer]
                    for turn in turns[kind, heading, tilt]
                }
            ways += len({graph.state(number)[:3] for number in reached})
            reached = after
        assert ways == sum(key[0] == kind for key, ends in moves.items() if ends)


def test_moves_tell_how_far_they_are_and_which_are_balanced(tmp_path: Path) -> None:
    """m is the way in space; a move is balanced where dx + dy = 0."""
    problem = varied()
    for row in table(problem, "moves", tmp_path):
        dx, dy = row["to_x"] - row["x"], row["to_y"] - row["y"]
        dz = 4.0 * (row["to_layer"] - row["layer"])
        assert row["m"] == pytest.approx(math.hypot(4 * dx, 4 * dy, dz))
        assert row["balanced"] == (dx + dy == 0)


def test_chunks_of_coverage_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A table that is written a few states at a time is the same."""
    problem = varied()
    whole = {name: table(problem, name, tmp_path) for name in TABLES}
    monkeypatch.setattr(long_tables, "_CHUNK", 3)
    assert {name: table(problem, name, tmp_path) for name in TABLES} == whole


@pytest.mark.slow
def test_a_solvers_solution_is_a_plan_for_commands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Export, HiGHS, verify: its file stands where a plan does, and says what J is."""
    scene, program = tmp_path / "scene.json", tmp_path / "scene.mps"
    solution = tmp_path / "scene.sol"
    cut = Run(capsys, "export", "corridor", "--steps", 2, "-o", scene, "--json").json
    run = Run(capsys, "export", scene, "-o", program, "--root-error", 1e-5, "--json").json
    assert run["digest"] == cut["digest"] == problem_digest(load_scene("corridor", 0).until(2))
    file = ModelFile.with_tangents(compiled(load_scene("corridor", 0).until(2)), 1e-5)
    assert (run["variables"], run["constraints"]) == file.linear.rows.shape[::-1]
    shown = Run(capsys, "export", scene, "-o", program, "--root-error", 1e-5).out
    assert re.search(rf"variables +{run['variables']:,}\n", shown)
    assert (
        run["message"] == file.told_tangents and f"{file.n_tangents:,} tangents" in run["message"]
    )
    text = program.read_text()
    assert text.startswith("* cocap-opt: corridor-steps2\n") and file.told_tangents in text
    solver = highspy.Highs()
    solver.setOptionValue("output_flag", False)
    solver.readModel(str(program))
    solver.run()
    solver.writeSolution(str(solution), 0)
    run = Run(capsys, "verify", scene, solution, "--json")
    assert run.code == 0 and run.json["valid"]
    objective = -solver.getInfo().objective_function_value
    assert run.json["reward"] == pytest.approx(objective, rel=1.1e-5)
    run = Run(capsys, "verify", "corridor", solution)
    assert (run.code, run.err.count("\n")) == (2, 1) and "another scene" in run.err
    assert Run(capsys, "show", scene, solution, "-o", tmp_path / "plan.png").code == 0


@pytest.mark.parametrize("ending", ["json", "mps", "lp", "cbf", "instance", "graphml"])
def test_steps_end_any_file_earlier(
    ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever is written, it is the scene's first steps, named so."""
    file, given = tmp_path / f"out.{ending}", tmp_path / "given.json"
    given.write_bytes(encode(SceneFile.of(load_scene("tiny-doorway", 0))))
    run = Run(capsys, "export", given, "--steps", 2, "-o", file, "--json")
    assert (run.code, run.json["scene"]) == (0, "tiny-doorway-steps2")
    text = file.read_text()
    assert "tiny-doorway-steps2" in text
    if ending in ("mps", "lp", "cbf"):
        assert "x_d0_t2_" in text and "_t3_" not in text


REFUSED = [
    (("--steps", 0, "-o", "x.mps"), "--steps: must be 1..3, not 0"),
    (("--steps", 4, "-o", "x.json"), "--steps: must be 1..3, not 4"),
    (("--root-error", 1e-3, "-o", "x.cbf"), "--root-error: applies only to files that end in "
        ".mps or .lp"),
    (("--root-error", -1, "-o", "x.lp"), "--root-error: must be at least 0 and less than 1"),
    (("-o", "seen.csv"), "-o: name a table: drones.csv, goals.csv, coverage.csv, views.csv"),
    (("-o", "views.csv"), "-o: views.csv requires a scene with --views"),
    (("--over-time", "--root-error", 0, "-o", "x.lp"), "error above 0"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "message"), REFUSED, ids=[message for _, message in REFUSED])
def test_what_cannot_be_written_is_told_in_a_line(
    words: tuple[object, ...], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Exit code 2, one line with the option and what is allowed, and no file."""
    monkeypatch.chdir(tmp_path)
    run = Run(capsys, "export", "tiny-doorway", *words)
    assert (run.code, run.err.count("\n")) == (2, 1)
    assert message in run.err
    assert list(tmp_path.iterdir()) == []


def test_nl_needs_pyomo(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where it is missing a line names the extra, before anything is computed."""
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pyomo" else find(name)
    )
    run = Run(capsys, "export", "tiny-doorway", "-o", tmp_path / "x.nl")
    assert (run.code, run.err) == (
        2, "cocap-opt: -o: .nl needs Pyomo: pip install 'cocap-opt[nl]'\n"
    )  # fmt: skip


def test_solutions_that_are_none_are_told_in_a_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file without a variable of ours, or that is no text, is refused with its name."""
    for content, words in (
        (b"infeasible\n", "contains no variables"),
        (b"\xff\xfe", "text in UTF-8"),
    ):
        file = tmp_path / "answer.sol"
        file.write_bytes(content)
        run = Run(capsys, "verify", "tiny-doorway", file)
        assert (run.code, run.err.count("\n")) == (2, 1)
        assert str(file) in run.err and words in run.err
