import html
import math
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from players import EVIL, ROOT, crossing, hills, planned, run, seen_by, shut_in, told
from players import plans as plans
from strategies import examples, tiny

from cocap_opt.files.documents import PlanFile
from cocap_opt.footage.quality import Quality
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.pictures.figures import robot_colour
from cocap_opt.player import player_scene
from cocap_opt.player.player import Player
from cocap_opt.player.player_plan import PlayerPlan
from cocap_opt.player.player_scene import PlayerScene
from cocap_opt.player.player_tasks import MOST_GROUPS, groups_of_people
from cocap_opt.problem import (
    Airspace,
    CollisionRules,
    Cone,
    Objective,
    Plan,
    State,
)
from cocap_opt.referee import check
from cocap_opt.run.explained import gaps_of
from cocap_opt.scenarios import load_scene
from cocap_opt.vision.default_weights import with_views

SCENES = ["bottleneck", "bridge", "tiny-give-way", "tiny-hover"]
# -- data ---------------------------------------------------------------------------------


@pytest.mark.slow
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


@pytest.mark.parametrize("cameras", [0, 2])
@pytest.mark.parametrize("scene", ["bottleneck", "bridge", "tiny-give-way"])
def test_what_a_drone_adds_is_what_the_referee_misses_without_it(scene: str, cameras: int) -> None:
    """Each step's reward less that of the other drones alone, by `check`."""
    problem = load_scene(scene, 0)
    if cameras:
        problem = with_views(problem, cameras)
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


def test_close_approaches_are_told_and_conflicts_are_not_told_twice() -> None:
    """Drones that cross come to 0 m in the middle of the step; a swap is a conflict only."""
    problem, plan = crossing()
    (shown,) = Player(problem, [("", plan)]).data()["plans"]
    words = "drones 0 and 1 collide"
    assert shown["near"] == [{"time": 0.5, "robots": [0, 1], "apart": 0, "words": words}]
    assert shown["closest"]["apart"] == 0
    (one, other) = plan.paths
    (shown,) = Player(problem, [("", Plan(paths=((one[0], other[0]), (other[0], one[0]))))]).data()[
        "plans"
    ]
    assert shown["near"] == [] and len(shown["conflicts"]) == 1


def test_who_keeps_the_separation_comes_not_close() -> None:
    """At exactly the distance that is allowed, and beyond it, nothing is marked.

    Without such a rule, or where it lets drones touch, 2 m are asked for, as of scenes that are to
    be flown; if no drones touch, the nearest moment of all is marked.
    """
    problem, plan = crossing()
    problem = problem.replace(horizon=1)
    apart = tuple((path[0],) * 2 for path in plan.paths)
    for separation, vertical, kept, above in (
        (0.0, 0.0, 2.0, 0.0), (0.4, 0.0, 2.0, 0.0), (1.0, 0.5, 2.0, 0.0),
        (1.0, 0.0, 1.0, 0.0), (1.0, 0.8, 1.0, 0.8),
    ):  # fmt: skip
        ruled = problem.replace(rules=CollisionRules(separation=separation, vertical=vertical))
        (shown,) = Player(ruled, [("", Plan(paths=apart))]).data()["plans"]
        assert shown["conflicts"] == []
        assert [near["apart"] for near in shown["near"]] == ([] if separation else [1])
        closest = shown["closest"]
        assert (closest["apart"], closest["kept"], closest["above"]) == (1, kept, above)
        assert closest["isKept"] == (kept == 1)
    far = apart[0], (State(3, 0, 0, 0, 0),) * 2
    robots = tuple(
        robot.replace(start=path[0]) for robot, path in zip(problem.robots, far, strict=True)
    )
    (shown,) = Player(problem.replace(robots=robots), [("", Plan(paths=far))]).data()["plans"]
    assert shown["near"] == [] and shown["closest"]["isKept"]
    alone = ruled.replace(robots=ruled.robots[:1])
    (shown,) = Player(alone, [("", Plan(paths=apart[:1]))]).data()["plans"]
    assert shown["closest"] is None


def test_a_drone_near_a_person_is_told_where_no_rule_asks_for_a_distance() -> None:
    """Nearer than drones should fly, seen from above; a scene with a rule is judged by that."""
    problem, plan = crossing()
    near, far = ((x, 1.2, 0, 0) for x in (0.5, 3.5))
    for place, airspace, is_told in (
        (near, Airspace(), True), (near, Airspace(people_aside=0.1), False),
        (far, Airspace(), False),
    ):  # fmt: skip
        people = tuple(
            actor.replace(poses=np.tile(place, (len(actor.poses), 1)))
            for actor in problem.actors[:1]
        )
        changed = problem.replace(actors=people, airspace=airspace)
        (shown,) = Player(changed, [("", plan)]).data()["plans"]
        beside = [moment for moment in shown["near"] if "person" in moment]
        assert len(beside) == is_told
        for moment in beside:
            assert (moment["robots"], moment["person"]) == ([1], 0)
            assert moment["apart"] == pytest.approx(0.3 * math.sqrt(0.5), abs=1e-4)
            assert moment["words"].startswith("drone 1 comes within 0.21 m of ")


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


def test_the_task_of_a_drone_is_whom_it_films_most() -> None:
    """The person, or the group of people, of whom it has most coverage over the steps that count.

    Up to eight people are groups of their own; more are at most eight groups.
    """
    problem = load_scene("bottleneck", 0)
    ((_, plan),) = planned(problem, "greedy")
    data = Player(problem, [("", plan)]).data()
    assert [task["people"] for task in data["tasks"]] == [[0], [1], [2], [3]]
    assert [task["words"] for task in data["tasks"]] == ["0", "1", "2", "3"]
    pixels = PlayerPlan(PlayerScene(problem), problem, plan, None).own_pixels
    brought = pixels[:, problem.first_step :].sum(axis=1).reshape(len(plan.paths), 4, -1)
    assert data["plans"][0]["tasks"] == brought.sum(axis=2).argmax(axis=1).tolist()
    nobody = Player(problem.replace(actors=()), [("", plan)]).data()
    assert nobody["tasks"] == [] and nobody["plans"][0]["tasks"] == [None] * 4
    many = problem.replace(actors=problem.actors * 3)
    groups = groups_of_people(many)
    assert len(groups) == 4  # who walk in each other's place are together
    assert sorted(j for group in groups for j in group) == list(range(12))
    named = problem.replace(actors=[actor.replace(name="Ada") for actor in problem.actors])
    assert PlayerScene(named).tasks()[1]["words"] == "Ada (1)"
    assert len(groups_of_people(load_scene("field-large", 0))) == MOST_GROUPS


def test_it_is_told_whom_each_drone_films() -> None:
    """The person of whom its camera has most pixels, and nobody where it sees none."""
    problem = load_scene("bottleneck", 0)
    ((_, plan),) = planned(problem, "greedy")
    (shown,) = Player(problem, [("", plan)]).data()["plans"]
    films: set[int | None] = set()
    for i in range(len(problem.robots)):
        pixels = PlayerPlan(PlayerScene(problem), problem, plan, None).own_pixels[i]
        by_person = pixels.reshape(problem.horizon + 1, len(problem.actors), -1).sum(axis=2)
        for t, whom in enumerate(shown["films"][i]):
            films.add(whom)
            if whom is None:
                assert not by_person[t].any()
            else:
                assert by_person[t, whom] == by_person[t].max() > 0
    assert None in films and len(films) > 2


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
    """A cell blocks if no drone may be in it at the lowest height; one of them may go closer."""
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


def test_who_is_seen_by_how_many_cameras_is_in_the_data() -> None:
    """A row per person who counts, as the plan's quality has it; infinite errors are null."""
    problem = load_scene("bottleneck", 0)
    hidden = problem.actors[1].replace(importance=(0.0,) * len(problem.actors[1].poses))
    problem = problem.replace(actors=(problem.actors[0], hidden, *problem.actors[2:]))
    ((name, plan),) = planned(problem, "greedy")
    (shown,) = Player(problem, [(name, plan)]).data()["plans"]
    found, told = Quality.of(problem, plan), shown["filmed"]
    assert [row["person"] for row in told["rows"]] == [0, 2, 3]
    for row in told["rows"]:
        j = row["person"]
        assert row["name"] == found.people[j]
        assert row["views"] == found.views[:, j].tolist()
        assert row["counts"] == found.counts[:, j].tolist()
        # What the best camera sees is told where none sees enough.
        enough = [share >= told["atLeast"] for share in row["most"]]
        assert enough == [views > 0 for views in row["views"]]
        assert all(
            found.seen[step, best, j] for step, best in enumerate(row["best"]) if enough[step]
        )
        for key, values in (("angles", found.angles), ("errors", found.errors)):
            finite = np.isfinite(values[:, j])
            assert [value is not None for value in row[key]] == finite.tolist()
            known = [value for value in row[key] if value is not None]
            assert known == pytest.approx(values[finite, j].tolist(), abs=0.051)
    assert told["line"] == found.summary.line
    assert Player(problem).data()["plans"][0]["filmed"] is None
    nobody = problem.replace(actors=(hidden,))
    assert Player(nobody, planned(nobody, "greedy")).data()["plans"][0]["filmed"] is None


def test_the_page_asks_nobody() -> None:
    """There is no address in it, nothing is loaded, and the browser is told to refuse to."""
    problem = load_scene("tiny-share", 0)
    page = Player(problem, planned(problem, "greedy")).page()
    assert not re.search(r"https?:|\bsrc\s*=|url\(|@import|\bimport\b|fetch\(|XMLHttp|WebSocket",
                         page)  # fmt: skip
    assert re.findall(r'href="([^"]*)"', page) == ["data:,"]
    assert "default-src 'none'" in page
    assert len(page) < 181_000


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
    frame = re.fullmatch(r"<iframe srcdoc='([^'<>]*)' [^<>]*></iframe>", player._repr_html_())
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
    """Starts are shown, with their rewards, also where staying there comes too close to people."""
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
        (
            ["greedy.json"],
            "x.jpg",
            "-o: name a file that ends in .html, .png, .pdf, .svg, .gif, .webm",
        ),
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


@pytest.mark.long
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
