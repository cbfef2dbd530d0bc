import html
import json
import re
import shutil
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import value
from hypothesis import example, given
from hypothesis import strategies as st
from strategies import examples, plate, tiny

from cocap_opt.cli.main import main
from cocap_opt.experiments.lab.studies.pictures import _Browser
from cocap_opt.files.documents import PlanFile, SceneFile, problem_digest
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.pictures.figures import robot_colour
from cocap_opt.planners import PLANNERS
from cocap_opt.player import player_scene
from cocap_opt.player.player import Player
from cocap_opt.player.player_plan import PlayerPlan
from cocap_opt.player.player_scene import PlayerScene
from cocap_opt.problem import (
    Actor,
    Airspace,
    Camera,
    CollisionRules,
    Cone,
    Motion,
    Objective,
    Plan,
    Prism,
    Problem,
    Robot,
    State,
)
from cocap_opt.referee import check
from cocap_opt.run.explained import gaps_of
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, never
from cocap_opt.vision.render import Renderer
from cocap_opt.world.workspace import HeightMap, Mesh

ROOT = Path(__file__).parents[2]
SCENES = ["bottleneck", "bridge", "tiny-give-way", "tiny-hover"]
EVIL = (
    "</script><script>document.title='x'</script><!--"
    "<img src=http://x.y onerror=alert(1)>&amp;\u2028\"'`${1}"
)


def planned(problem: Problem, *names: str) -> list[tuple[str, Any]]:
    """Plans by these planners, each called like its planner."""
    return [(name, PLANNERS[name](problem, never).plan) for name in names]


def seen_by(problem: Problem, plan: Plan) -> Any:
    """Coverage [T+1, F] that faces are coloured by."""
    return PlayerPlan(PlayerScene(problem), problem, plan, None).seen


def told(page: str) -> dict[str, Any]:
    """What a page is told."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    assert found is not None
    data: dict[str, Any] = json.loads(found.group(1))
    return data


# -- data ---------------------------------------------------------------------------------


@pytest.mark.parametrize("scene", SCENES)
def test_rewards_are_the_referees(scene: str) -> None:
    """J, the reward of each step and the number of conflicts are those of `check`."""
    problem = load_scene(scene, 0)
    plans = planned(problem, "greedy", "cocap")
    for (title, plan), shown in zip(plans, Player(problem, plans).data()["plans"], strict=True):
        verdict = check(problem, plan)
        assert shown["title"] == title
        assert shown["rewards"] == [verdict.reward_at_start, *verdict.reward_per_step]
        assert (shown["reward"], shown["moves"]) == (verdict.reward, verdict.reward_moves)
        steps = [int(words.split()[1].strip(":")) for words in verdict.conflicts]
        assert [conflict["step"] for conflict in shown["conflicts"]] == sorted(steps)


@pytest.mark.parametrize("scene", SCENES)
def test_what_is_seen_makes_the_reward(scene: str) -> None:
    """The weighted roots of the px/m2 that faces are coloured by sum up to each step's reward."""
    problem = load_scene(scene, 0)
    ((title, plan),) = planned(problem, "greedy")
    (shown,) = Player(problem, [(title, plan)]).data()["plans"]
    sums = (problem.step_weights * np.sqrt(shown["seen"])).sum(axis=1)
    assert sums[1:] == pytest.approx(shown["rewards"][1:], rel=1e-4)
    exact = (problem.step_weights * np.sqrt(seen_by(problem, plan))).sum(axis=1)
    assert exact[1:] == pytest.approx(shown["rewards"][1:], rel=1e-9)


@pytest.mark.parametrize("scene", ["bottleneck", "bridge", "tiny-give-way"])
def test_what_a_drone_adds_is_what_the_referee_misses_without_it(scene: str) -> None:
    """Each step's reward less that of the other drones alone, by `check`."""
    problem = load_scene(scene, 0)
    ((title, plan),) = planned(problem, "greedy")
    (shown,) = Player(problem, [(title, plan)]).data()["plans"]
    for i, adds in enumerate(shown["adds"]):
        others = [k for k in range(len(problem.robots)) if k != i]
        rest = problem.replace(robots=tuple(problem.robots[k] for k in others))
        left = check(rest, Plan(paths=tuple(plan.paths[k] for k in others)))
        missed = np.subtract(shown["rewards"], [left.reward_at_start, *left.reward_per_step])
        assert adds == pytest.approx(missed, rel=1e-4, abs=1e-3)


def test_pixels_that_add_up_over_time_are_nobodys() -> None:
    """Where pixels add up over time no drone's share of a step is told."""
    problem = tiny().replace(objective=Objective(over_time=True))
    (shown,) = Player(problem, planned(problem, "greedy")).data()["plans"]
    assert shown["adds"] == []


def test_means_are_over_all_faces_and_the_steps_that_count() -> None:
    """px/m2 in the head are the mean of what faces are coloured by; the start does not count."""
    problem = load_scene("tiny-share", 0)
    (shown,) = Player(problem, planned(problem, "greedy")).data()["plans"]
    assert problem.first_step == 1
    assert shown["meanPixels"] == pytest.approx(np.mean(shown["seen"][1:]), rel=1e-4)
    means = np.mean(shown["seen"], axis=1)
    assert np.sum(shown["ownPixels"], axis=0) == pytest.approx(means, rel=1e-4)


def crossing() -> tuple[Problem, Plan]:
    """Two drones that cross in the middle between four cells, which no rule of cells forbids."""
    motion, faces = Motion(layers=(5.0,), radius=1), [State(x, 0, 0, 0, 0) for x in (0, 1)]
    robots = tuple(Robot(start=start, motion=motion) for start in faces)
    problem = tiny().replace(
        height_map=HeightMap(heights=np.zeros((4, 4))), robots=robots, meshes=(), horizon=1
    )
    return problem, Plan(paths=((faces[0], State(1, 1, 0, 0, 0)), (faces[1], State(0, 1, 0, 0, 0))))


def test_close_approaches_are_told_and_conflicts_are_not_told_twice() -> None:
    """Drones that cross come to 0 m in the middle of the step; a swap is a conflict only."""
    problem, plan = crossing()
    (shown,) = Player(problem, [("", plan)]).data()["plans"]
    words = "drones 0 and 1 come within 0 m of each other"
    assert shown["near"] == [{"time": 0.5, "robots": [0, 1], "words": words}]
    (one, other) = plan.paths
    (shown,) = Player(problem, [("", Plan(paths=((one[0], other[0]), (other[0], one[0]))))]).data()[
        "plans"
    ]
    assert shown["near"] == [] and len(shown["conflicts"]) == 1


def test_who_keeps_the_separation_comes_not_close() -> None:
    """At exactly the distance that is allowed, and beyond it, nothing is marked."""
    problem, plan = crossing()
    problem = problem.replace(horizon=1)
    apart = tuple((path[0],) * 2 for path in plan.paths)
    for separation in (0.0, 0.4, 1.0):
        kept = problem.replace(rules=CollisionRules(separation=separation))
        (shown,) = Player(kept, [("", Plan(paths=apart))]).data()["plans"]
        assert shown["near"] == [] == shown["conflicts"]


def test_cones_are_no_pixels() -> None:
    """The unit goes with the cameras: cones count 1/m2."""
    problem = tiny()
    cones = tuple(robot.replace(camera=Cone()) for robot in problem.robots)
    for robots, unit in (
        (problem.robots, "px/m²"),
        (cones, "1/m²"),
        ((problem.robots[0], cones[1]), "px/m² or 1/m²"),
    ):
        varied = problem.replace(robots=robots)
        data = Player(varied, planned(varied, "greedy")).data()
        assert data["unit"] == unit
        assert [drone["rise"] is None for drone in data["drones"]] == [
            isinstance(robot.camera, Cone) for robot in robots
        ]


def hills() -> Problem:
    """Hills far from the origin with a house and a plate; two layers, a gimbal, a prism."""
    datum = 300 + 2.0 * np.arange(6)[:, None] + np.zeros((6, 5))
    heights = datum.copy()
    heights[2, 2] += 9.0
    heights[3, 1] += 1.0
    corner = (468_000.5, 5_120_000.25)
    motion = Motion(layers=(4.0, 8.0), radius=1)
    camera = Camera(tilts=(0.2, 0.7))
    x, y = corner
    return Problem(
        name="hills",
        height_map=HeightMap(heights=heights, datum=datum, origin=corner, resolution=2.0),
        meshes=(plate((x + 1, y + 1), (x + 3, y + 5), 306.5),),
        robots=(
            Robot(start=State(0, 0, 1, 3, 1), motion=motion, camera=camera),
            Robot(start=State(5, 4, 0, 0, 0), motion=motion, camera=camera),
        ),
        actors=(Actor(poses=np.array([[x + 9, y + 1 + t, 308.0, 0.1] for t in range(3)]),
                      shape=Prism(sides=5)),),
        horizon=2,
    )  # fmt: skip


def test_drones_fly_at_their_altitude() -> None:
    """Places are from the map's corner and lowest height: ground plus flight height."""
    problem = hills()
    ((title, plan),) = planned(problem, "greedy")
    (shown,) = Player(problem, [(title, plan)]).data()["plans"]
    height_map, tilts = problem.height_map, problem.robots[0].camera.tilts
    for path, states in zip(shown["paths"], plan.paths, strict=True):
        for pose, s in zip(path, states, strict=True):
            x, y = height_map.centre(s.x, s.y)
            z = height_map.altitude(s.x, s.y, (4.0, 8.0)[s.layer]) - 300
            corner = height_map.origin
            expected = [x - corner[0], y - corner[1], z, np.pi / 4 * s.heading, tilts[s.pitch]]
            assert pose == pytest.approx(expected, abs=1e-3)
    assert shown["heights"][0][0] == 8 and shown["heights"][1][0] == 4


def test_terrain_tells_ground_from_what_stands_on_it() -> None:
    """Kinds: 0 ground, 1 something low, 2 what blocks the lowest flight height."""
    data = Player(hills(), planned(hills(), "greedy")).data()
    terrain = data["terrain"]
    kinds = np.reshape([int(kind) for kind in terrain["kinds"]], (6, 5))
    assert kinds[2, 2] == 2 and kinds[3, 1] == 1 and np.count_nonzero(kinds) == 2
    grounds, heights = (np.reshape(terrain[key], (6, 5)) for key in ("grounds", "heights"))
    assert heights[2, 2] == 13 and grounds[2, 2] == 4
    assert (grounds == 2.0 * np.arange(6)[:, None]).all()
    (mesh,) = data["meshes"]
    assert mesh["vertices"][:3] == [1, 1, 6.5]
    assert (terrain["cell"], terrain["size"], terrain["cells"]) == (2.0, [12, 10], [6, 5])
    assert [drone["colour"] for drone in data["drones"]] == [
        "#" + "".join(f"{round(255 * v):02x}" for v in robot_colour(i)[:3]) for i in range(2)
    ]


def test_what_only_the_clearance_forbids_blocks() -> None:
    """A cell blocks if no drone may be in it at the lowest height; one of them may go nearer."""
    near = hills().replace(meshes=())
    wide = [
        r.replace(motion=r.motion.replace(clearance=c))
        for r, c in zip(near.robots, (3.0, 3.5), strict=True)
    ]
    for robots, kind in ((wide, "2"), ((wide[0], near.robots[1]), "1")):
        problem = near.replace(robots=tuple(robots))
        assert player_scene.PlayerScene(problem).terrain()["kinds"][3 * 5 + 1] == kind
        blocked = player_scene._blocked_cells(problem, problem.workspace)
        assert (blocked[3, 1], blocked[2, 2], blocked[5, 4]) == (kind == "2", True, False)


def test_fine_meshes_and_large_maps_are_drawn_by_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is too much to draw: what a mesh fills, the highest of some cells."""
    monkeypatch.setattr(player_scene, "MOST_TRIANGLES", 1)
    monkeypatch.setattr(player_scene, "MOST_CELLS", 3)
    data = Player(hills(), planned(hills(), "greedy")).data()
    assert data["meshes"] == []
    assert {tuple(box) for box in data["boxes"]} == {
        (0, 0, 6.5, 6.5), (0, 1, 6.5, 6.5)
    }  # fmt: skip
    terrain = data["terrain"]
    assert (terrain["cell"], terrain["cells"], terrain["size"]) == (4.0, [3, 3], [12, 10])
    assert np.reshape(terrain["heights"], (3, 3)).max(axis=1).tolist() == [2, 13, 10]


def shut_in() -> Problem:
    """The hills with a zone to the sky and far below, a ceiling, and people kept clear of."""
    x, y = hills().height_map.origin
    zone = Mesh.box((x + 6, y + 6, -1e9), (x + 8, y + 8, 1e9))
    limits = Airspace(no_fly=(zone,), ceiling=9.0, people_aside=1.0, people_above=2.0)
    return hills().replace(airspace=limits, meshes=())


def test_closed_airspace_is_in_the_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Zones from the lowest ground to 4 m above the highest flight, the ceiling over the ground."""
    problem = shut_in()
    closed = Player(problem).data()["airspace"]
    assert closed["words"] == str(problem.airspace)
    (zone,) = closed["zones"]["meshes"]
    low, high = np.reshape(zone["vertices"], (-1, 3))[[0, -1]].tolist()
    sky = 8 + 2 * 5 + 4
    assert (low, high, closed["sky"]) == ([6, 6, 0], [8, 8, sky], sky)
    assert np.reshape(closed["lid"], (6, 5))[:, 0].tolist() == [9, 11, 13, 15, 17, 19]
    assert (closed["aside"], closed["above"]) == (1, 2)
    high_lid = problem.airspace.replace(ceiling=120.0, people_aside=0.0, people_above=None)
    closed = Player(problem.replace(airspace=high_lid)).data()["airspace"]
    assert (closed["lid"], closed["aside"], closed["above"]) == ([], None, None)
    assert Player(hills()).data()["airspace"] is None
    monkeypatch.setattr(player_scene, "MOST_TRIANGLES", 1)
    drawn = Player(problem).data()["airspace"]["zones"]
    assert drawn == {"meshes": [], "boxes": [[3, 3, 0, sky]]}


def test_nothing_to_see_is_no_error() -> None:
    """A scene without people, and one in which nobody is seen, have a page, too."""
    empty = tiny().replace(actors=())
    hidden = load_scene("tiny-hidden", 0)
    for problem in (empty, hidden):
        data = Player(problem, planned(problem, "greedy")).data()
        assert data["most"] > 0 and data["mostReward"] == 0


def test_people_off_the_map_are_in_the_picture() -> None:
    """Those who are at most as far from the map as it is wide; the edge is no end for them."""
    problem = load_scene("tiny-hidden", 0)  # 3 x 3 m
    for x, right in ((2.5, 3), (5.0, 9), (3000.0, 10)):
        actor = problem.actors[0].replace(poses=np.array(3 * [[x, 1.5, 0.0, 0.0]]))
        scene = player_scene.PlayerScene(problem.replace(actors=(actor,)))
        _, high = scene.scope([])["scope"]
        assert high[:2] == [right, 3]


# -- file ---------------------------------------------------------------------------------


def test_the_page_asks_nobody() -> None:
    """There is no address in it, nothing is loaded, and the browser is told to refuse to."""
    problem = load_scene("tiny-share", 0)
    page = Player(problem, planned(problem, "greedy")).page()
    assert not re.search(r"https?:|\bsrc\s*=|url\(|@import|\bimport\b|fetch\(|XMLHttp|WebSocket",
                         page)  # fmt: skip
    assert re.findall(r'href="([^"]*)"', page) == ["data:,"]
    assert "default-src 'none'" in page
    assert len(page) < 150_000


@examples(15)
@given(name=st.text(max_size=30) | st.just(EVIL))
@example(name=EVIL)
@pytest.mark.slow
def test_names_stay_names(name: str) -> None:
    """No name of a scene or a plan ends the data, begins an element or is lost."""
    problem = tiny().replace(name=name)
    stay = Plan(paths=tuple((robot.start,) * 3 for robot in problem.robots))
    plain = Player(tiny().replace(name=""), [("", stay)]).page()
    title = problem.name  # what is no text is escaped there
    page = Player(problem, [(title, stay)]).page()
    data = told(page)
    assert (data["name"], data["plans"][0]["title"]) == (title, title)
    assert page.count("<") == plain.count("<")


# -- notebooks ----------------------------------------------------------------------------


def test_a_player_shows_itself_in_a_notebook(tmp_path: Path) -> None:
    """It is a frame that holds the page of its file, whatever the titles are."""
    problem = load_scene("tiny-give-way", 0)
    player = Player(problem, [(EVIL, plan) for _, plan in planned(problem, "greedy")])
    player.save(tmp_path / "plans.html")
    frame = re.fullmatch(r'<iframe srcdoc="([^"<>]*)" [^<>]*></iframe>', player._repr_html_())
    assert frame is not None
    assert html.unescape(frame.group(1)) == (tmp_path / "plans.html").read_text(encoding="utf-8")
    assert problem.name in repr(player)


def test_a_player_without_plans_shows_the_starts() -> None:
    """All drones stay where they begin."""
    problem = load_scene("tiny-give-way", 0)
    (plan,) = told(Player(problem).page())["plans"]
    for path in plan["paths"]:
        assert path == path[:1] * (problem.horizon + 1)


def test_drones_that_wait_at_their_starts_may_have_people_walk_by() -> None:
    """Starts are shown, with their rewards, also where staying there comes too near to people."""
    problem = hills()
    (wait,) = told(Player(problem).page())["plans"]
    close = problem.replace(airspace=Airspace(people_aside=7.5))
    starts = Plan(paths=tuple((robot.start,) * (problem.horizon + 1) for robot in problem.robots))
    (shown,) = told(Player(close).page())["plans"]
    assert check(close, starts).violations
    assert shown["rewards"] == wait["rewards"]
    assert shown["besidePeople"] and not wait["besidePeople"]
    for words in shown["besidePeople"]:
        drone, aside, person, step = re.fullmatch(
            r"drone (\d+) is ([\d.]+) m from person (\d+) at step ([\d.]+); rule 7.5 m", words
        ).groups()  # type: ignore[union-attr]
        at = close.where(close.robots[int(drone)], [close.robots[int(drone)].start])[0, :2]
        walk = close.actors[int(person)].poses[: close.horizon + 1, :2]
        there = [np.interp(float(step), range(len(walk)), axis) for axis in walk.T]
        assert float(aside) == pytest.approx(float(np.linalg.norm(at - there)), abs=0.06)
        assert float(aside) <= 7.5


# -- command ------------------------------------------------------------------------------


def run(*words: object) -> int:
    """Exit code of a command."""
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    return int(caught.value.code or 0)


@pytest.fixture(scope="module")
def plans(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a plan that has conflicts, and one that has none, of the bottleneck."""
    folder = tmp_path_factory.mktemp("plans")
    for name in ("greedy", "cocap"):
        assert run("plan", "bottleneck", "--planner", name, "-o", folder / f"{name}.json") == 0
    return folder


@pytest.mark.slow
def test_show_takes_one_plan_or_more(plans: Path, tmp_path: Path) -> None:
    """In the order given; files of one name are told apart by their folders."""
    greedy, cocap, page = plans / "greedy.json", plans / "cocap.json", tmp_path / "plans.html"
    other = tmp_path / "greedy.json"
    shutil.copy(cocap, other)
    for files, titles in (
        ([greedy], ["greedy.json"]),
        ([cocap, greedy], ["cocap.json", "greedy.json"]),
        ([greedy, other, cocap], [str(greedy), str(other), "cocap.json"]),
    ):
        assert run("show", "bottleneck", *files, "-o", page) == 0
        shown = told(page.read_text(encoding="utf-8"))["plans"]
        assert [plan["title"] for plan in shown] == titles
        assert [plan["planner"] for plan in shown] == [
            PlanFile.read(path).planner for path in files
        ]
        assert shown[-1]["reward"] == PlanFile.read(files[-1]).reward


@pytest.mark.parametrize(
    ("files", "output", "words"),
    [
        ([], "x.gif", "PLAN: name a plan"),
        (["greedy.json", "cocap.json"], "x.png", "a .png file shows one plan, not 2"),
        (["greedy.json", "cocap.json"], "x.gif", "a .gif file shows one plan, not 2"),
        (["greedy.json"], "x.jpg", "-o: name a file that ends in .html, .png, .pdf, .svg or .gif"),
        (["absent.json"], "x.html", "absent.json"),
    ],
)
def test_what_show_does_not_take_is_said(
    files: list[str], output: str, words: str, plans: Path, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """One line that names what is wrong, and no file."""
    capsys.readouterr()
    paths = [plans / name for name in files]
    assert run("show", "bottleneck", *paths, "-o", tmp_path / output) == 2
    out, err = capsys.readouterr()
    assert out == "" and words in err and len(err.splitlines()) == 1
    assert not (tmp_path / output).exists()


def test_show_without_a_plan_shows_the_starts(tmp_path: Path) -> None:
    """The page has the drones where they begin, at every step; a picture has them, too."""
    page, drawn = tmp_path / "starts.html", tmp_path / "starts.png"
    for path in (page, drawn):
        assert run("show", "tiny-give-way", "-o", path) == 0
    (plan,) = told(page.read_text(encoding="utf-8"))["plans"]
    assert all(path == path[:1] * len(path) for path in plan["paths"])
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_plans_of_other_starts_are_not_shown_together(
    plans: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan that begins elsewhere is refused."""
    other = tmp_path / "other.json"
    assert run("plan", "bottleneck", "--seed", 1, "-o", other) == 0
    capsys.readouterr()
    page = tmp_path / "x.html"
    assert run("show", "bottleneck", plans / "cocap.json", other, "-o", page) == 2
    err = capsys.readouterr().err
    assert "other.json" in err and "of another seed" in err and not page.exists()


def test_what_is_installed_has_the_page() -> None:
    """The files of the page are package data: an installed player has them all."""
    setuptools = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    package = ROOT / "cocap_opt" / "player"
    installed = {
        f for glob in setuptools["package-data"]["*"] for f in (package / "page").glob(glob)
    }
    assert installed >= set((package / "page").iterdir())
    assert {f.suffix for f in installed} == {".html", ".css", ".js"}


# -- browser ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def player(plans: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A browser with two plans of the bottleneck."""
    if not _Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    page = tmp_path_factory.mktemp("page") / "plans.html"
    files = plans / "greedy.json", plans / "cocap.json"
    assert run("show", "bottleneck", *files, "-o", page) == 0
    with _Browser.opened(page) as driver:
        yield driver


def step_of(player: Any) -> int:
    """Step that the page says it shows."""
    return int(value(player, "document.getElementById('step').textContent").split()[1])


def wait_until(player: Any, expression: str) -> None:
    """Wait until an expression holds in the page."""
    from selenium.webdriver.support.wait import WebDriverWait

    WebDriverWait(player, 20, poll_frequency=0.05).until(lambda page: value(page, expression))


# Share of the samples of a panel's picture that are not the white of the paper.
INKED = """(() => {
  const c = document.querySelectorAll('canvas.%s')[%d];
  const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', {willReadFrequently: true});
  copy.drawImage(c, 0, 0);
  const d = copy.getImageData(0, 0, c.width, c.height).data;
  let n = 0;
  for (let i = 0; i < d.length; i += 4) if (d[i + 3] && d[i] + d[i + 1] + d[i + 2] < 750) n++;
  return n / (d.length / 4);
})()"""


@pytest.mark.slow
def test_two_plans_stand_side_by_side(player: Any) -> None:
    """Each has a panel with its name, a picture and a chart, at one height."""
    player.go_to(3)
    for what, names in (("h2", ["greedy", "cocap"]), (".file", ["greedy.json", "cocap.json"])):
        named = f"[...document.querySelectorAll('.panel {what}')].map((e) => e.textContent)"
        assert value(player, named) == names
    places = "[...document.querySelectorAll('.panel')].map((p) => [p.offsetLeft, p.offsetTop])"
    boxes = value(player, places)
    assert boxes[0][1] == boxes[1][1] and boxes[0][0] + 300 < boxes[1][0]
    for panel in range(2):
        assert value(player, INKED % ("view", panel)) > 0.2
        assert value(player, INKED % ("chart", panel)) > 0.05


@pytest.mark.slow
def test_obstacles_beside_the_action_are_shown_wholly(player: Any) -> None:
    """A house that reaches in is framed with its far corners, but for those very far away."""
    house, off = (9, 2, 0, 14, 2, 7, 9, 8, 0), (21, 2, 0, 24, 2, 7)
    wide = 8, 2, 0, 80, 2, 7, 8, 9, 0
    given = json.dumps([{"vertices": vertices} for vertices in (house, off, wide)])
    folder = ROOT / "cocap_opt" / "player" / "page"
    scripts = ((folder / f"{name}.js").read_text("utf-8") for name in ("geometry", "camera"))
    call = f"return beside({given}, [0, 0, 0], [10, 10, 5])"
    found = value(player, f"(() => {{ {' '.join(scripts)}\n{call} }})()")
    assert found == [[9, 2, 0], [14, 2, 7], [9, 8, 0], [8, 2, 0], [20, 2, 7], [8, 9, 0]]


@pytest.mark.slow
def test_the_slider_sets_the_step(player: Any, plans: Path) -> None:
    """The reward shown is the referee's for that step, and so are the conflicts."""
    problem = load_scene("bottleneck", 0)
    verdicts = [
        check(problem, PlanFile.read(plans / f"{n}.json").plan) for n in ("greedy", "cocap")
    ]
    for step in (1, 6, problem.horizon):
        player.go_to(step)
        assert step_of(player) == step
        shown = value(player, "[...document.querySelectorAll('.now')].map((e) => e.dataset.value)")
        assert list(map(float, shown)) == [v.reward_per_step[step - 1] for v in verdicts]
        red = "[...document.querySelectorAll('.words')].map((e) => e.matches(':not(.mild)'))"
        said = value(player, red)
        for verdict, words in zip(verdicts, said, strict=True):
            assert any(c.startswith(f"step {step}:") for c in verdict.conflicts) == words


@pytest.mark.slow
def test_play_advances_and_stops_at_the_end(player: Any) -> None:
    """The button plays, the space key pauses; at the end it stops, and begins anew if asked."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    def at_speed(speed: str) -> None:
        player.execute_script(
            "const s = document.getElementById('speed'); s.value = arguments[0];"
            "s.dispatchEvent(new Event('change'))",
            speed,
        )

    player.go_to(0)
    button = player.find_element(By.ID, "play")
    at_speed("1")
    button.click()
    wait_until(player, "Number(document.getElementById('slider').value) >= 2")
    player.find_element(By.TAG_NAME, "body").send_keys(Keys.SPACE)
    assert button.get_attribute("aria-label") == "play"
    stopped = step_of(player)
    assert 2 <= stopped < 11
    at_speed("16")
    button.click()
    wait_until(player, "document.getElementById('play').getAttribute('aria-label') === 'play'")
    assert step_of(player) == 11
    button.click()
    wait_until(player, "Number(document.getElementById('slider').value) < 11")
    player.go_to(0)


@pytest.mark.slow
def test_keys_and_chart_lead_to_steps(player: Any) -> None:
    """Left, right, Home, End, C for the next conflict, and a press on a bar of the chart."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    player.go_to(4)
    body = player.find_element(By.TAG_NAME, "body")
    for key, step in ((Keys.RIGHT, 5), (Keys.LEFT, 4), (Keys.END, 11), (Keys.HOME, 0), ("c", 1)):
        body.send_keys(key)
        wait_until(
            player, f"document.getElementById('step').textContent.startsWith('step {step} ')"
        )
    chart = player.find_elements(By.CLASS_NAME, "chart")[1]
    ActionChains(player).move_to_element(chart).click().perform()
    wait_until(player, "!document.getElementById('step').textContent.startsWith('step 1 ')")
    assert step_of(player) in (5, 6)


@pytest.mark.slow
def test_a_focused_element_has_its_own_keys(player: Any) -> None:
    """Space works a focused check box or button and plays from the slider, which has arrows."""
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys

    before = step_of(player)
    solid, top, space, play, slider = (
        player.find_element(By.ID, name) for name in ("solid", "top", "space", "play", "slider")
    )
    for expected in (True, False):
        solid.send_keys(Keys.SPACE)
        assert solid.is_selected() is expected
    for element, pressed in ((top, ["true", "false"]), (space, ["false", "true"])):
        element.send_keys(Keys.SPACE)
        assert [e.get_attribute("aria-pressed") for e in (top, space)] == pressed
    assert play.get_attribute("aria-label") == "play" and step_of(player) == before
    slider.send_keys(Keys.HOME, Keys.RIGHT)
    wait_until(player, "document.getElementById('step').textContent.startsWith('step 1 ')")
    slider.send_keys(Keys.SPACE)
    assert play.get_attribute("aria-label") == "pause"
    slider.send_keys(Keys.SPACE)
    top.send_keys(Keys.END)  # no key of a button
    wait_until(player, "document.getElementById('step').textContent.startsWith('step 11 ')")


@pytest.mark.slow
def test_the_camera_turns_zooms_and_looks_down(player: Any) -> None:
    """A drag, the wheel and the button for the top view change both pictures."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    player.go_to(6)
    view = player.find_elements(By.CLASS_NAME, "view")[0]
    picture = "[...document.querySelectorAll('canvas.view')].map((c) => c.toDataURL())"
    seen = [value(player, picture)]

    def changed() -> None:
        player.go_to(6)
        seen.append(value(player, picture))
        assert all(a != b for a, b in zip(seen[-1], seen[-2], strict=True))

    ActionChains(player).drag_and_drop_by_offset(view, 60, 20).perform()
    changed()
    player.find_element(By.ID, "top").click()
    changed()
    player.execute_script(
        "arguments[0].dispatchEvent(new WheelEvent('wheel', {deltaY: -300, cancelable: true}))",
        view,
    )
    changed()
    player.find_element(By.ID, "space").click()
    changed()
    assert seen[-1] == seen[0]


@pytest.mark.slow
def test_numbers_of_crowded_drones_stay_near_them(player: Any) -> None:
    """They are apart, cover no name, and are left out where there is no room near the drone."""
    script = (ROOT / "cocap_opt" / "player" / "page" / "labels.js").read_text()
    crowd = "const put = []; for (let i = 0; i < 64; i++) {"
    crowd += "const place = freePlace(5, 7, put, []); if (place) put.push(place); }"
    places = player.execute_script(f"{script}; {crowd} return put")
    assert places[0] == [5, 7] and 4 < len(places) < 64
    apart = np.hypot(*(np.array(places)[:, None] - places).transpose(2, 0, 1))
    assert apart[np.triu_indices(len(places), 1)].min() >= 14 and apart[0].max() <= 40
    named = "[{ x: 5, y: 7, wide: 90, high: 13 }]"
    x, y = player.execute_script(f"{script}; return freePlace(5, 7, [], {named})")
    assert abs(x - 5) >= 52.5 or abs(y - 7) >= 14


# What the hint says at points all over the first picture.
HINTS = """(() => {
  const view = document.querySelector('canvas.view'), tip = document.querySelector('.tip');
  const said = new Set(), { left, top, width, height } = view.getBoundingClientRect();
  for (let x = 2; x < width; x += 5) for (let y = 2; y < height; y += 5) {
    const at = { clientX: left + x, clientY: top + y, pointerId: 1 };
    view.dispatchEvent(new PointerEvent('pointermove', at));
    if (tip.classList.contains('on')) said.add(tip.textContent);
  }
  return [...said];
})()"""


@pytest.mark.slow
def test_a_face_says_how_well_it_is_seen(player: Any) -> None:
    """Under the pointer: whose face it is and its px/m2; of each person some faces are there."""
    player.go_to(6)
    (seen,) = (plan["seen"][6] for plan in told(player.page_source)["plans"][:1])
    said = [re.fullmatch(r"person (\d), (\w+): (.*)", hint) for hint in value(player, HINTS)]
    said = [hint for hint in said if hint]
    assert {hint[1] for hint in said if hint} == {"0", "1", "2", "3"} and len(said) >= 8
    names = ["front", "left", "back", "right", "top"]
    for hint in said:
        assert hint is not None
        pixels = seen[5 * int(hint[1]) + names.index(hint[2])]
        assert hint[3] == (f"{pixels:,.0f} px/m²" if pixels else "not seen")


def press(player: Any, key: str) -> None:
    """Press a key anywhere on the page, and wait until it is drawn."""
    from selenium.webdriver.common.by import By

    player.find_element(By.TAG_NAME, "body").send_keys(key)
    drawn = "const done = arguments[0], next = requestAnimationFrame; next(() => next(done))"
    player.execute_async_script(drawn)


# Colour of the first picture at a share of its width and height, and so many px aside.
COLOUR = """(() => {
  const c = document.querySelector('.chosen canvas.view');
  const at = [Math.round(c.width * %g), Math.round(c.height * %g + %g), 1, 1];
  const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', {willReadFrequently: true});
  copy.drawImage(c, 0, 0);
  return [...copy.getImageData(...at).data].slice(0, 3);
})()"""


@pytest.mark.slow
def test_the_page_opens_at_the_first_step_that_counts(player: Any) -> None:
    """A start that does not count is no picture to begin with."""
    player.refresh()
    wait_until(player, "document.documentElement.dataset.ready === 'yes'")
    assert load_scene("bottleneck", 0).first_step == step_of(player) == 1


@pytest.mark.slow
def test_a_picked_drone_shows_what_it_sees_and_is_followed(player: Any) -> None:
    """By key or by its number: its own picture, what it adds, and itself in the middle."""
    from selenium.webdriver.common.by import By

    player.go_to(4)
    hidden = "[...document.querySelectorAll('.inset')].map((box) => box.hidden)"
    assert value(player, hidden) == [True, True]
    press(player, "d")
    assert value(player, hidden) == [False, False]
    eye = "document.querySelector('.inset canvas').toDataURL()"
    first = value(player, eye)
    player.find_elements(By.CLASS_NAME, "chip")[2].click()
    press(player, "f")
    assert value(player, eye) != first
    colour = player_scene.PlayerScene(load_scene("bottleneck", 0)).drone(2)["colour"]
    (plan, _) = told(player.page_source)["plans"]
    for step in (4, 9):
        player.go_to(step)
        caption = value(player, "document.querySelector('figcaption').textContent")
        assert caption.startswith(f"adds {plan['adds'][2][step]:,.2f} ")
        disc = value(player, COLOUR % (0.5, 0.5, -24))
        assert "#{:02x}{:02x}{:02x}".format(*disc) == colour
    press(player, "\ue00c")
    assert value(player, hidden) == [True, True]
    press(player, "0")


@pytest.mark.slow
def test_a_press_on_a_drone_picks_it(player: Any) -> None:
    """One that is picked already is let go; shown alone, the others have no numbers."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    for key in "df":  # drone 0 is picked, and in the middle
        press(player, key)
    player.go_to(3)
    among = value(player, INKED % ("view", 0))
    press(player, "i")
    player.go_to(3)
    assert value(player, INKED % ("view", 0)) != among
    view = player.find_elements(By.CLASS_NAME, "view")[0]
    ActionChains(player).move_to_element_with_offset(view, 0, -18).click().perform()
    pressed = "[...document.querySelectorAll('.chip')].map((c) => c.ariaPressed)"
    wait_until(player, f"{pressed}.every((one) => one === 'false')")
    press(player, "0")


# Samples of the drone's own picture that have a bright colour, which only seen faces have.
COLOURED = """(() => {
  const c = document.querySelector('.inset canvas'), found = [];
  const copy = new OffscreenCanvas(c.width, c.height).getContext('2d', {willReadFrequently: true});
  copy.drawImage(c, 0, 0);
  const d = copy.getImageData(0, 0, c.width, c.height).data;
  for (let i = 0; i < d.length; i += 4) {
    const [most, least] = [Math.max(d[i], d[i + 1], d[i + 2]), Math.min(d[i], d[i + 1], d[i + 2])];
    found.push(most - least > 0.45 * most ? 1 : 0);
  }
  return [c.width, c.height, found];
})()"""


@pytest.mark.slow
def test_a_drones_picture_is_what_the_renderer_sees(player: Any, tmp_path: Path) -> None:
    """Faces are where rays of the drone's camera meet them, and nowhere else."""
    problem = load_scene("bottleneck", 0)
    problem = problem.replace(robots=problem.robots[:1])
    ((title, plan),) = planned(problem, "greedy")
    page, before, step = tmp_path / "page.html", player.current_url, 6
    Player(problem, [(title, plan)]).save(page)
    player.get(page.as_uri())
    press(player, "d")
    player.go_to(step)
    wide, tall, coloured = value(player, COLOURED)
    player.get(before)
    every = problem.robots[0].camera.width // wide
    faces = Renderer(problem, every).picture(problem.robots[0], step, plan.paths[0][step])[0]
    seen = np.append(seen_by(problem, plan)[step] > 0, [False, False])  # no face: terrain or sky
    rows, columns = (np.linspace(0, n - 1, m).round().astype(int)
                     for n, m in zip(faces.shape, (tall, wide), strict=True))  # fmt: skip
    expected = seen[faces[np.ix_(rows, columns)]]
    shown = np.reshape(coloured, (tall, wide)) > 0
    assert expected.mean() > 0.01
    assert (expected & shown).sum() > 0.85 * (expected | shown).sum()


@pytest.mark.slow
def test_view_cones_end_where_something_stands(player: Any) -> None:
    """Rays meet ground, walls, meshes and what fine meshes fill, and go on above them."""
    folder = ROOT / "cocap_opt" / "player" / "page"
    script = "".join((folder / name).read_text() for name in ("geometry.js", "rays.js"))
    scene = {
        "terrain": {"cell": 2, "cells": [5, 1], "heights": [0, 0, 0, 5, 0]},
        "meshes": [{"vertices": [4, 0, 3, 4, 2, 3, 4, 1, 9], "triangles": [0, 1, 2]}],
        "boxes": [[1, 0, 7, 8]],
    }
    rays = [((1, 1, 1), (1, 0, 0)), ((1, 1, 4), (1, 0, 0)), ((1, 1, 7.5), (1, 0, 0)),
            ((1, 1, 12), (1, 0, 0)), ((9, 1, 4), (0.6, 0, -0.8)), ((9, 1, 1), (-1, 0, 0)),
            ((7, 1, 9), (0, 0, -1)), ((3, 1, 9), (0, 0, -1))]  # fmt: skip
    cast = f"{script}; const [scene, rays] = arguments, all = new Rays(scene);"
    cast += "return rays.map(([from, way]) => all.length(from, way, 20))"
    met = player.execute_script(cast, scene, rays)
    assert met == pytest.approx([5, 3, 1, 20, 5, 1, 4, 1])


@pytest.mark.slow
def test_marks_on_the_chart_lead_to_their_moments(player: Any) -> None:
    """A press on the first conflict's mark, and the button with their number."""
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By

    step = told(player.page_source)["plans"][0]["conflicts"][-1]["step"]
    chart = player.find_elements(By.CLASS_NAME, "chart")[0]
    wide, tall = chart.size["width"], chart.size["height"]
    middle = 46 + (step + 0.5) / 12 * (wide - 56)
    player.go_to(0)
    at = round(middle - wide / 2), round(8 - tall / 2)
    ActionChains(player).move_to_element_with_offset(chart, *at).click().perform()
    wait_until(player, f"document.getElementById('slider').value === '{step}'")
    player.go_to(0)
    player.find_element(By.CSS_SELECTOR, ".next").click()
    wait_until(player, "document.getElementById('slider').value === '1'")


@pytest.mark.slow
def test_people_are_figures_or_the_faces_that_count(player: Any) -> None:
    """A key switches, and changes the picture."""
    player.go_to(2)
    figures = value(player, "document.querySelector('canvas.view').toDataURL()")
    press(player, "b")
    assert value(player, "document.getElementById('faces').checked")
    assert value(player, "document.querySelector('canvas.view').toDataURL()") != figures
    press(player, "b")


@pytest.mark.slow
def test_help_tells_all_keys(player: Any) -> None:
    """It opens by "?" and closes by Esc."""
    press(player, "?")
    assert value(player, "document.getElementById('help').open")
    assert value(player, "document.querySelectorAll('#keys dt').length") >= 15
    press(player, "\ue00c")
    assert not value(player, "document.getElementById('help').open")


@pytest.mark.slow
def test_a_plan_that_a_limit_stopped_at_the_starts_says_so(player: Any, tmp_path: Path) -> None:
    """The head names the limit, which the plan's file has, and says that no drone moves."""
    problem, page, path = tiny(), tmp_path / "show.html", tmp_path / "plan.json"
    stay = Plan(paths=tuple((robot.start,) * (problem.horizon + 1) for robot in problem.robots))
    SceneFile(problem=problem).save(tmp_path / "scene.json")
    PlanFile(
        scene=problem.name, digest=problem_digest(problem), planner="greedy", limit=Limit.TIME,
        reward=0.0, plan=stay,
    ).save(path)  # fmt: skip
    assert run("show", tmp_path / "scene.json", path, "-o", page) == 0
    with _Browser.opened(page) as driver:
        assert value(driver, "document.querySelector('h2').textContent") == (
            "greedy, stopped by the time limit"
        )
        badge = value(driver, "document.querySelector('.badge').textContent")
        assert (
            badge
            == "no plan: the time limit came during the search; all drones stay at their starts"
        )
        assert value(driver, "document.querySelector('.badge').className") == "badge mild"
        assert value(driver, "document.querySelector('.still').textContent") == "no drone moves"
    assert value(player, "document.querySelector('.still')") is None


@pytest.mark.slow
def test_a_phone_shows_one_plan_and_a_switch(player: Any) -> None:
    """On a narrow screen nothing stands out at the side or is cut; two fingers zoom the picture."""
    from selenium.webdriver.common.by import By

    player.resize((390, 844))
    player.go_to(2)
    assert value(player, "document.documentElement.scrollWidth") <= 390
    shown = "[...document.querySelectorAll('.panel')].map((p) => p.offsetHeight > 300)"
    assert value(player, shown) == [True, False]
    assert value(player, INKED % ("view", 0)) > 0.1
    press(player, "d")
    cut = """[...document.querySelectorAll("footer *, .chosen .inset *")].filter((part) =>
        part.getBoundingClientRect().right > part.closest("footer, .inset").clientWidth
        + part.closest("footer, .inset").getBoundingClientRect().left + 2)"""
    assert value(player, f"{cut}.length") == 0
    press(player, "\ue00c")
    player.find_elements(By.CSS_SELECTOR, "#tabs button")[1].click()
    assert value(player, shown) == [False, True]
    player.go_to(2)
    before = value(player, "document.querySelector('.chosen canvas.view').toDataURL()")
    for kind, points in (("touchStart", (170, 220)), ("touchMove", (120, 270)), ("touchEnd", ())):
        fingers = [{"x": x, "y": 400, "id": k} for k, x in enumerate(points)]
        event = {"type": kind, "touchPoints": fingers}
        player.execute_cdp_cmd("Input.dispatchTouchEvent", event)
    player.go_to(2)
    assert value(player, "document.querySelector('.chosen canvas.view').toDataURL()") != before
    player.find_elements(By.CSS_SELECTOR, "#tabs button")[0].click()
    player.resize((1280, 800))
    player.go_to(2)


@pytest.mark.slow
def test_closed_airspace_is_drawn_and_can_be_switched_off(player: Any, tmp_path: Path) -> None:
    """In red, with its limits in the legend; where nothing is closed there is no entry for it."""
    dark, red = "d[i] + d[i + 1] + d[i + 2] < 750", "d[i] > 25 + Math.max(d[i + 1], d[i + 2])"
    assert dark in INKED
    red = INKED.replace(dark, red) % ("view", 0)
    wide = "['airspace', 'closing'].map((id) => document.getElementById(id).offsetWidth)"
    assert value(player, wide) == [0, 0]
    problem, page, before = shut_in(), tmp_path / "page.html", player.current_url
    Player(problem).save(page)
    player.get(page.as_uri())
    player.go_to(1)
    said = value(player, "document.getElementById('airspace').innerText")
    assert said == f"closed to drones: {problem.airspace}"
    shown = value(player, red)
    player.execute_script("document.getElementById('closed').click()")
    player.go_to(1)
    assert shown > 0.02 + 2 * value(player, red)
    assert player.get_log("browser") == []
    player.get(before)


@pytest.mark.slow
def test_no_name_is_run_and_nothing_is_asked_for(player: Any, tmp_path: Path) -> None:
    """A scene and a plan with code for names are shown by them, and nothing is loaded.

    Where nothing is seen, no scale says how well.
    The console stays empty, whatever the tests above did to the page before.
    """
    problem, page = hills().replace(name=EVIL), tmp_path / "page.html"
    stay = Plan(paths=tuple((robot.start,) * 3 for robot in problem.robots))
    assert not seen_by(problem, stay).any()
    page.write_text(Player(problem, [(EVIL, stay)]).page(), "utf-8")
    before = player.current_url
    player.get(page.as_uri())
    player.go_to(1)
    assert value(player, "document.getElementById('name').textContent") == problem.name
    assert value(player, "document.querySelector('.panel h2').textContent") == EVIL
    assert value(player, "document.querySelectorAll('img').length") == 0
    assert value(player, "document.getElementById('scale').offsetWidth") == 0
    assert value(player, "performance.getEntriesByType('resource').length") == 0
    assert player.get_log("browser") == []
    player.get(before)


def test_a_gap_is_told_as_shares_of_the_bound() -> None:
    """With its explanation a plan has what drones lose by step, faces, and the rest; it adds up."""
    problem = load_scene("tiny-share", 0)
    plans, proof = planned(problem, "cocap"), BOUNDS["alone"](problem).certificate
    assert proof is not None
    (gap,) = gaps_of(problem, [plans[0][1]], proof)
    (shown,) = Player(problem, plans, [gap]).data()["plans"]
    told = shown["gap"]
    assert told["total"] == pytest.approx(gap.gap / gap.bound)
    assert np.shape(told["losses"]) == (2, problem.horizon)
    parts = [*np.ravel(told["losses"]), *np.ravel(told["faces"]), told["rules"], told["rest"]]
    assert sum(parts) == pytest.approx(told["total"], rel=1e-4)
    assert [plan["gap"] for plan in Player(problem, plans).data()["plans"]] == [None]


def test_only_a_plan_that_obeys_the_rules_is_called_optimal() -> None:
    """What leaves no gap is; one that has conflicts may be above the bound, and is not."""
    problem = load_scene("tiny-queue", 0)
    proof = BOUNDS["column-generation"](problem).certificate
    assert proof is not None
    plans = planned(problem, "cocap-lns", "greedy")
    gaps = gaps_of(problem, [plan for _, plan in plans], proof)
    best, greedy = (plan for plan in Player(problem, plans, gaps).data()["plans"])
    assert best["gap"]["bound"] == greedy["gap"]["bound"] == proof.proved
    assert best["gap"]["optimal"] and best["gap"]["total"] <= OPTIMALITY
    assert greedy["gap"]["total"] < 0 and not greedy["gap"]["optimal"]


def test_the_costliest_moves_are_those_of_the_explanation() -> None:
    """The largest losses of drones by leaving a step, by step."""
    problem = load_scene("corridor-tight", 0)
    plans, proof = planned(problem, "greedy"), BOUNDS["alone"](problem).certificate
    assert proof is not None
    gaps = gaps_of(problem, [plans[0][1]], proof)
    gap = Player(problem, plans, gaps).data()["plans"][0]["gap"]
    shares = np.array(gap["losses"])
    marked = [shares[move["robot"], move["step"]] for move in gap["costliest"]]
    assert sorted(marked) == sorted(one for one in shares.ravel() if one >= 5e-6)[-5:]
    steps = [move["step"] for move in gap["costliest"]]
    assert steps == sorted(steps)
