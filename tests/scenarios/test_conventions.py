"""Conventions of Greedy Perspectives' scenes, theirs and ours, one by one and by name."""

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from others import data
from scene_files import SEQUENCE, STARTS

from cocap_opt.cli.main import main
from cocap_opt.data import ProblemError
from cocap_opt.experiments.lab.studies.others.stored_values import rendered_coverage
from cocap_opt.files.documents import FileError, SceneFile, problem_digest
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import CollisionRules, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.formats import greedy_perspectives
from cocap_opt.scenarios.formats.conventions import OPTIONS, OURS, THEIRS, Conventions
from cocap_opt.stop import never


@pytest.fixture
def sequence(tmp_path: Path) -> Path:
    """Two robots with tilts of their own, one actor between them, and two start sets."""
    folder = tmp_path / "tiny"
    folder.mkdir()
    np.save(folder / "map.npy", np.zeros((6, 8)))
    (folder / "seq.yaml").write_text(SEQUENCE)
    (folder / "starts.csv").write_text(STARTS)
    return folder / "seq.yaml"


def hovering(problem: Problem) -> Plan:
    """All robots stay where they are."""
    steps = problem.horizon + 1
    return Plan(paths=tuple((robot.start,) * steps for robot in problem.robots))


def facts(problem: Problem) -> dict[str, Any]:
    """The parts of a problem that an option may change."""
    return {
        "triangles": problem.actors[0].shape,
        "count-start": problem.objective.count_start,
        "bonus": problem.objective.replace(count_start=True),
        "tilt": [robot.camera for robot in problem.robots],
        "rules": problem.rules,
        "corner-cutting": [robot.motion.corner_cutting for robot in problem.robots],
        "start-set": [robot.start for robot in problem.robots],
    }


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("triangles", "no"),
        ("count-start", "no"),
        ("tilt", "first"),
        ("rules", "vertex+swap"),
        ("corner-cutting", "no"),
        ("start-set", "yaml"),
        ("bonus", "yes"),
    ],
)
def test_an_option_changes_what_it_says_and_nothing_else(
    sequence: Path, name: str, value: str
) -> None:
    """Every convention is one choice; the first value of each is the faithful one."""
    before, after = (facts(load_scene(str(sequence), 1, o)) for o in ({}, {name: value}))
    assert [key for key in before if before[key] != after[key]] == [name]
    theirs = {key: words[0] for key, words in OPTIONS.allowed.items()}
    assert facts(load_scene(str(sequence), 1, theirs)) == before


def test_the_tilt_of_the_first_robot_is_all_that_is_shared(sequence: Path) -> None:
    """Their quirk is about tilts: focal lengths and image sizes stay each robot's own."""
    own, first = (load_scene(str(sequence), 0, {"tilt": t}).robots for t in ("own", "first"))
    assert first[0].camera == own[0].camera != first[1].camera
    assert first[1].camera == own[1].camera.replace(tilts=own[0].camera.tilts)


def test_the_start_that_does_not_count_is_a_constant(sequence: Path) -> None:
    """Without `count_start` J of any plan is less by its views at step 0."""
    counted = greedy_perspectives.read(sequence)
    verdict = check(counted, hovering(counted))
    left_out = greedy_perspectives.read(sequence, 0, {"count-start": "no"})
    assert verdict.reward_at_start > 0
    rest = check(left_out, hovering(left_out)).reward
    assert rest == pytest.approx(verdict.reward - verdict.reward_at_start)


def test_triangles_count_for_more_than_their_rectangle(sequence: Path) -> None:
    """sqrt(a) + sqrt(b) of two halves is at least sqrt of their mean, at most twice that.

    Pixels per m2 of a rectangle are the mean of those of its triangles, which are equal in size.
    """
    triangles = greedy_perspectives.read(sequence)
    rectangles = greedy_perspectives.read(sequence, 0, {"triangles": "no"})
    many, few = (check(p, hovering(p)).face_reward for p in (triangles, rectangles))
    assert (len(many), len(few)) == (10, 5)
    assert sum(few) > 0
    for k, whole in enumerate(few):
        halves = many[2 * k] + many[2 * k + 1]
        assert math.sqrt(2) * whole <= halves * (1 + 1e-9)
        assert halves <= 2 * whole * (1 + 1e-9)


def test_conventions_by_name() -> None:
    """`conventions` names those from which the other options differ, in any order."""
    assert Conventions.of({}) == Conventions.of({"conventions": "theirs"}) == THEIRS
    assert Conventions.of({"start-set": "yaml"}) == THEIRS._replace(start_set="yaml")
    assert Conventions.of({"conventions": "ours"}) == OURS
    assert OURS.rules == CollisionRules() and not OURS.corner_cutting
    mixed = Conventions.of({"triangles": "yes", "conventions": "ours"})
    assert mixed == OURS._replace(triangles=True)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"triangle": "no"}, ("'triangle'", "triangles, count-start, tilt")),
        ({"triangles": "false"}, ("triangles", "yes, no", "'false'")),
        ({"rules": "swap"}, ("rules", "vertex, vertex+swap", "'swap'")),
        ({"tilt": ""}, ("tilt", "own, first", "''")),
        ({"conventions": "mine"}, ("conventions", "theirs, ours", "'mine'")),
    ],
)
def test_wrong_options_are_one_line(options: dict[str, str], words: tuple[str, ...]) -> None:
    """An option that is not allowed is refused in one line, with the allowed ones."""
    with pytest.raises(ProblemError) as caught:
        Conventions.of(options)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


def test_scenes_without_options_refuse_them(tmp_path: Path) -> None:
    """Nothing that a user asks for is left aside without a word."""
    (tmp_path / "a.toml").write_text("steps = 1\n")
    for scene in ("corridor", str(tmp_path / "a.toml")):
        with pytest.raises(FileError, match=r"'triangles': .* has no options"):
            load_scene(scene, 0, {"triangles": "no"})


def test_export_writes_the_scene_as_the_options_say(sequence: Path) -> None:
    """Options reach the reader from the command line; the file is the same problem."""
    file = sequence.with_name("scene.json")
    words = ["--option", "conventions=ours", "--option", "start-set=yaml"]
    with pytest.raises(SystemExit) as caught:
        main(["export", str(sequence), *words, "-o", str(file)])
    assert caught.value.code == 0
    expected = greedy_perspectives.read(sequence, 0, {"conventions": "ours", "start-set": "yaml"})
    assert problem_digest(SceneFile.read(file).problem) == problem_digest(expected)


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["--option", "triangles"], "NAME=VALUE"),
        (["--option", "tilt=own", "--option", "tilt=first"], "only once"),
        (["--option", "tilt=mine"], "own, first"),
    ],
)
def test_wrong_options_of_export_are_named(
    sequence: Path, words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2, one line, and no file."""
    file = sequence.with_name("scene.json")
    with pytest.raises(SystemExit) as caught:
        main(["export", str(sequence), *words, "-o", str(file)])
    error = capsys.readouterr().err
    assert caught.value.code == 2
    assert named in error and error.count("\n") == 1
    assert not file.exists()


def test_the_bonus_is_that_of_their_planner(sequence: Path) -> None:
    """100 for each move with dx + dy = 0, such as staying; nobody gets it unasked."""
    plain, paid = (load_scene(str(sequence), 0, {"bonus": b}) for b in ("no", "yes"))
    assert plain.objective == load_scene(str(sequence)).objective
    verdict = check(paid, hovering(paid))
    assert verdict.reward_moves == 100.0 * len(paid.robots) * paid.horizon
    assert check(plain, hovering(plain)).reward_moves == 0.0


def their_case(name: str) -> tuple[Problem, Plan]:
    """The scene that their planner solved, and the paths that it found."""
    folder = data(f"greedy_perspectives/{name}/peer_coverage.csv").parent
    problem = load_scene(str(folder), 0, {"start-set": "yaml", "bonus": "yes"})
    return problem, Plan(paths=greedy_perspectives.read_plan(folder / "peer_paths.csv", problem))


@pytest.mark.parametrize("name", [pytest.param("corridor", marks=pytest.mark.slow), "split"])
def test_their_first_path_is_an_optimum_of_their_pixels(name: str) -> None:
    """Robot 0's path is the best for the pixels that their program rendered, and its bonus.

    Their cache has robot 0's tilt wherever it can be, so these pixels are what it planned with.
    """
    problem, plan = their_case(name)
    model = compiled(problem)
    graph, path = model.class_of[0].graph, model.paths(plan)[0]
    seen = rendered_coverage(problem, data(f"greedy_perspectives/{name}/peer_coverage.csv"))
    reward = graph.no_reward(problem.horizon)
    for (t, state), pixels in seen.items():
        if graph.window.covers(state.x, state.y):  # it can be reached
            reward[t, graph.index(state)] = np.sqrt(pixels).sum()
    bonuses = Bonuses.of(problem.objective)
    best = backward_sweep(graph, reward, bonuses)[0, path[0]]
    theirs = sum(reward[t, state] for t, state in enumerate(path))
    assert theirs + bonuses.of_path(graph.shape, path) == pytest.approx(best, rel=1e-12)


@pytest.mark.parametrize("name", [pytest.param("corridor", marks=pytest.mark.slow), "split"])
def test_their_first_path_is_nearly_an_optimum_of_ours(name: str) -> None:
    """With our pixels it is one but for their rounding to whole pixels of 400 x 300."""
    problem, plan = their_case(name)
    alone = problem.replace(robots=problem.robots[:1])
    theirs = check(alone, Plan(paths=plan.paths[:1]))
    best = PLANNERS["greedy"](alone, never).value
    assert theirs.valid and theirs.reward_moves > 0
    assert best * (1 - 1e-3) <= theirs.reward <= best * (1 + 1e-9)


@pytest.mark.parametrize("name", [pytest.param("corridor", marks=pytest.mark.slow), "split"])
def test_what_they_report_is_between_both_tilts(name: str) -> None:
    """Their cache mixes the robots' tilts, so their J is between that of own and of one tilt."""
    folder = data(f"greedy_perspectives/{name}/peer_reward.csv").parent
    rewards = []
    for tilt in ("own", "first"):
        options = {"tilt": tilt, "start-set": "yaml"}
        problem = load_scene(str(folder), 0, options)
        paths = greedy_perspectives.read_plan(folder / "peer_paths.csv", problem)
        rewards.append(check(problem, Plan(paths=paths)).reward)
    with (folder / "peer_reward.csv").open() as file:
        reported = sum(float(row["reported_view_reward"]) for row in csv.DictReader(file))
    assert min(rewards) < reported < max(rewards)
