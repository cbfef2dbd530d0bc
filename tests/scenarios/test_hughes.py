"""Scenes, solutions and reward of Hughes et al."""

import csv
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from others import data
from scene_files import write_hughes
from strategies import tiny

from cocap_opt.cli.main import main
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.formulations import EXACT
from cocap_opt.graph.move_rewards import NO_BONUSES, Bonuses
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import compiled
from cocap_opt.objective import marginal_reward
from cocap_opt.planners.greedy import myopic
from cocap_opt.problem import Actor, Cone, Motion, Plan, Problem, Robot, State
from cocap_opt.referee import check
from cocap_opt.result import UnsupportedError
from cocap_opt.scenarios import FORMATS, load_scene, read_foreign_plan
from cocap_opt.scenarios.formats import hughes
from cocap_opt.stop import never
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.render import Renderer
from cocap_opt.vision.views import StateViews
from cocap_opt.world.workspace import HeightMap

# The quickest of their scenes, and the others.
THEIRS = [
    "priority_speaker",
    *(pytest.param(name, marks=pytest.mark.slow) for name in ("cross_mix", "heavy_mixing")),
]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A scene of two actors, three frames and two robots."""
    return write_hughes(tmp_path / "meeting")


def reward(problem: Problem, frames: list[list[dict[str, Any]]], plan: Plan) -> list[float]:
    """Their reward, from the text of their paper, frame by frame."""
    totals = []
    for t, frame in enumerate(frames):
        total = 0.0
        for body in frame:
            x, y, yaw = body["location"][0], body["location"][1], body["rotation"][2]
            a, side = 0.484, 2 * 0.484 * math.tan(math.pi / 6) * 1.8
            faces = [
                (x + a * math.cos(yaw + i * math.pi / 3), y + a * math.sin(yaw + i * math.pi / 3),
                 (math.cos(yaw + i * math.pi / 3), math.sin(yaw + i * math.pi / 3), 0.0), side)
                for i in range(1, 7)
            ]  # fmt: skip
            faces.append((x, y, (0.0, 0.0, 1.0), 6 * a * a * math.tan(math.pi / 6)))
            for fx, fy, n, area in faces:
                seen = 0.0
                for path in plan.paths:
                    rx, ry, look = path[t].x + 1, path[t].y + 1, path[t].heading * math.pi / 4
                    bearing = math.remainder(math.atan2(y - ry, x - rx) - look, math.tau)
                    if abs(bearing) <= math.pi / 4 + 1e-12:
                        d = (fx - rx, fy - ry, -5.0)
                        towards = abs(d[0] * math.cos(look) + d[1] * math.sin(look))
                        turned = max(0.0, -sum(p * q for p, q in zip(d, n, strict=True)))
                        seen += towards * turned / math.hypot(*d) ** 4
                total += body["weight"] * area * math.sqrt(seen)
        totals.append(total)
    return totals


def test_their_reward_is_that_of_the_referee(folder: Path) -> None:
    """Step by step, with a weight that changes from frame to frame."""
    problem = load_scene(str(folder / "scene.json"))
    assert (problem.name, problem.horizon, len(problem.robots)) == ("meeting", 2, 2)
    plan = read_foreign_plan(folder / "solution_greedy.json", problem)
    assert plan is not None
    assert plan.paths[0][1] == State(2, 1, heading=1)
    verdict = check(problem, plan)
    assert verdict.valid
    frames = json.loads((folder / "scene.json").read_text())["actor_positions"]
    mine = [verdict.reward_at_start, *verdict.reward_per_step]
    assert mine == pytest.approx(reward(problem, frames, plan), rel=1e-12)
    assert min(mine) > 0


def test_the_bonus_is_that_of_their_planner(folder: Path) -> None:
    """0.02 for each heading and 0.01 for each position that is kept, each for itself."""
    scene = str(folder / "scene.json")
    plain, paid = load_scene(scene), load_scene(scene, 0, {"bonus": "yes"})
    plan = read_foreign_plan(folder / "solution_greedy.json", paid)
    assert plan is not None
    # NE NE E at three places; W SW SW, of which the first move stays.
    assert check(paid, plan).reward_moves == pytest.approx(2 * 0.02 + 0.01)
    assert check(plain, plan).reward_moves == 0.0
    assert load_scene(scene, 0, {"bonus": "no"}).objective == plain.objective
    with pytest.raises(FileError, match="bonus: must be one of no, yes"):
        load_scene(scene, 0, {"bonus": "0.02"})


def test_their_scenes_are_solved(folder: Path) -> None:
    """Planners and bounds work with any law of the worth of a view."""
    problem = load_scene(str(folder / "scene.json"))
    plan = read_foreign_plan(folder / "solution_greedy.json", problem)
    result = EXACT["branch-and-price"](problem, never, plan)
    assert plan is not None and result.reason == "optimal"
    assert check(problem, plan).reward <= result.value <= result.bound


@pytest.mark.parametrize(
    ("file", "change", "words"),
    [
        ("scene.json", lambda scene: scene["actor_positions"][1].pop(), "actor_positions[1]"),
        ("scene.json", lambda scene: scene["scene"]["scale"].update(x=0), "x"),
        ("scene.json", lambda scene: scene["actor_positions"][0][0].update(weight=-1), "weight"),
        ("scene.json", lambda scene: scene["actor_positions"][0][0].pop("rotation"), "rotation"),
        ("solution_greedy.json", lambda solved: solved["elements"].clear(), "elements"),
        ("solution_greedy.json", lambda solved: solved["elements"][0].__setitem__(0, 99),
         "elements: must be the robots 1.."),
        ("solution_greedy.json",
         lambda solved: solved["elements"][0][1][0]["state"].update(heading="UP"), "heading"),
        ("solution_greedy.json",
         lambda solved: solved["elements"][0][1][0]["state"].update(x=99), "start.x"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(folder: Path, file: str, change: Any, words: str) -> None:
    """One line with the file and the field."""
    content = json.loads((folder / file).read_text())
    change(content)
    (folder / file).write_text(json.dumps(content))
    with pytest.raises(ProblemError) as error:
        hughes.read(folder / "scene.json")
    assert words in str(error.value) and file in str(error.value)
    assert "\n" not in str(error.value)


def test_without_a_solution_nobody_knows_the_starts(folder: Path) -> None:
    """The scene's own file does not say where the robots begin."""
    (folder / "solution_greedy.json").unlink()
    with pytest.raises(ProblemError, match="solution_"):
        hughes.read(folder / "scene.json")


def test_an_actor_on_the_edge_of_the_cone_is_detected() -> None:
    """45 degrees to the side is inside, a little more is not."""
    problem = tiny()
    robot = problem.robots[0].replace(camera=Cone(), motion=problem.robots[0].motion)
    x, y = problem.height_map.centre(0, 0)
    seen = []
    for off in (0.0, 1e-6, -1e-6):
        poses = np.array([[x + 5, y + 5 + off, 0.0, 0.0]] * 3)
        scene = problem.replace(robots=(robot,), actors=(problem.actors[0].replace(poses=poses),))
        graph = TimeGraph.of(scene.workspace, robot.motion, 1)
        views = StateViews.of(FaceGeometry(scene), scene, graph, robot.camera)
        seen.append(views.coverage(1, np.array([graph.index(State(0, 0))])).sum() > 0)
    assert seen == [True, False, True]


def test_a_cone_makes_no_picture() -> None:
    """It has no image."""
    problem = tiny()
    robots = tuple(robot.replace(camera=Cone()) for robot in problem.robots)
    with pytest.raises(UnsupportedError, match="pinhole"):
        Renderer(problem.replace(robots=robots))


@pytest.mark.parametrize("name", THEIRS)
@pytest.mark.parametrize(
    "planner", ["greedy", pytest.param("multipleroundsgreedy", marks=pytest.mark.slow)]
)
def test_their_evaluation_is_reproduced(name: str, planner: str) -> None:
    """Every step of their stored solutions, to more digits than they are read with."""
    place = data(f"hughes/{name}")
    problem = load_scene(str(place / "scene.json"))
    plan = read_foreign_plan(place / f"solution_{planner}.json", problem)
    assert plan is not None
    with (place / "ppa_evaluation.csv").open() as file:
        theirs = [float(row[planner]) for row in csv.DictReader(file)]
    verdict = check(problem, plan)
    assert verdict.valid
    assert [verdict.reward_at_start, *verdict.reward_per_step] == pytest.approx(theirs, rel=1e-12)


@pytest.mark.long
@pytest.mark.parametrize("name", ["priority_speaker", "cross_mix"])  # the third takes 6 s
def test_their_greedy_paths_are_optima_of_their_planning_reward(name: str) -> None:
    """Each is the best path given the earlier ones, to 12 digits; without the bonus it is not."""
    place = data(f"hughes/{name}")
    problem = load_scene(str(place / "scene.json"), 0, {"bonus": "yes"})
    plan = read_foreign_plan(place / "solution_greedy.json", problem)
    assert plan is not None
    model, seen = compiled(problem), problem.no_pixels()
    for robot, path in enumerate(model.paths(plan)):
        robot_class = model.class_of[robot]
        reward = marginal_reward(model, robot_class, seen)
        views = sum(float(reward[t, state]) for t, state in enumerate(path))
        for bonuses, exact in ((Bonuses.of(problem.objective), True), (NO_BONUSES, False)):
            best = backward_sweep(robot_class.graph, reward, bonuses)[0, path[0]]
            theirs = views + bonuses.of_path(robot_class.graph.shape, path)
            assert (theirs == pytest.approx(best, rel=1e-12)) == exact
        seen = seen + model.robot_pixels(robot, path)


@pytest.mark.slow
@pytest.mark.parametrize("name", THEIRS[:2])
def test_their_myopic_plans_are_found_again(name: str) -> None:
    """Our myopic planner has the reward of theirs at every step, to 12 digits."""
    place = data(f"hughes/{name}")
    problem = load_scene(str(place / "scene.json"), 0, {"bonus": "yes"})
    plan = myopic(problem).plan
    assert plan is not None
    with (place / "ppa_evaluation.csv").open() as file:
        theirs = [float(row["myopic"]) for row in csv.DictReader(file)]
    verdict = check(problem, plan)
    assert [verdict.reward_at_start, *verdict.reward_per_step] == pytest.approx(theirs, rel=1e-12)


@pytest.mark.parametrize(
    "planner", ["assignment", "formation", "greedy", "multipleroundsgreedy", "myopic"]
)
def test_the_published_layout_is_read(planner: str) -> None:
    """All five planners' solutions have their rewards, frame by frame; formation's are no path."""
    place = data("hughes/published/split_and_join")
    solution = place / planner / "solution.json"
    problem = load_scene(str(place / "split_and_join_data.json"))
    with (place / "ppa_evaluation.csv").open() as file:
        theirs = [float(row[planner]) for row in csv.DictReader(file)]
    rewards = FORMATS["hughes"].rewards_between_cells(solution, problem)
    if planner == "formation":
        assert rewards == pytest.approx(theirs, rel=1e-12)
        with pytest.raises(FileError, match="between cells"):
            read_foreign_plan(solution, problem)
        return
    assert rewards is None
    plan = read_foreign_plan(solution, problem)
    assert plan is not None
    verdict = check(load_scene(str(solution)), plan)  # a named solution suffices
    assert [verdict.reward_at_start, *verdict.reward_per_step] == pytest.approx(theirs, rel=1e-12)


def test_a_solution_between_the_cells_is_evaluated(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is read as theirs; on a cell it has the reward of the referee, elsewhere another one."""
    scene = json.loads((folder / "scene.json").read_text())
    frames = len(scene["actor_positions"])
    own = json.loads(next(folder.glob("solution_*.json")).read_text())
    problem = load_scene(str(folder / "scene.json"))
    for _, entries in own["elements"]:
        for entry in entries[:frames]:
            entry["state"]["x"] += 0.25
    (folder / "shifted.json").write_text(json.dumps(own))
    rewards = FORMATS["hughes"].rewards_between_cells(folder / "shifted.json", problem)
    assert rewards is not None and len(rewards) == frames
    with pytest.raises(SystemExit) as caught:
        main(["verify", str(folder / "scene.json"), str(folder / "shifted.json"), "--json"])
    answer = json.loads(capsys.readouterr().out)
    assert caught.value.code == 0 and answer["reward"] == pytest.approx(math.fsum(rewards))
    assert "cannot be flown" in answer["message"]
    with pytest.raises(SystemExit) as caught:  # it tells which scene it is of
        main(["verify", str(folder / "shifted.json"), "--json"])
    assert caught.value.code == 0 and json.loads(capsys.readouterr().out) == answer
    own_starts = [robot.start for robot in load_scene(str(folder / "shifted.json")).robots]
    assert own_starts == [robot.start for robot in problem.robots]  # the nearest cells


def test_a_sensor_at_a_face_sees_nothing_of_it() -> None:
    """Their law divides by the distance: where there is none, J is a number all the same."""
    problem = Problem(
        name="at the face",
        height_map=HeightMap(heights=np.zeros((4, 4)), resolution=2.0),
        robots=(Robot(start=State(1, 1), motion=Motion(layers=(5.0,)), camera=Cone()),),
        actors=(Actor(poses=np.tile([3.0, 3.0, 5.0, 0.0], (3, 1))),),
        horizon=2,
    )
    assert math.isfinite(check(problem, Plan(paths=((State(1, 1),) * 3,))).reward)
    best = EXACT["branch-and-price"](problem)
    assert best.value <= best.bound < math.inf


def test_a_solution_is_shown_without_naming_its_scene(folder: Path, tmp_path: Path) -> None:
    """As `verify` checks it, it is the plan that is played, not the scene alone."""
    shown = tmp_path / "shown.html"
    for name, has_plan in (("solution_greedy.json", True), ("scene.json", False)):
        with pytest.raises(SystemExit) as caught:
            main(["show", str(folder / name), "-o", str(shown)])
        assert caught.value.code == 0
        assert ("solution_greedy" in shown.read_text(encoding="utf-8")) == has_plan
