"""An audit finds in a scene's file what its instance has, and notices what is otherwise."""

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from counting import either
from goals import with_areas
from hypothesis import assume, given, reject
from pool import meetings, problems
from sources import imports
from strategies import WALL, examples, standing, tiny
from takes import InTakes, in_takes

from cocap_opt.cli.commands import run
from cocap_opt.files.documents import PlanFile, SceneFile, encode
from cocap_opt.formulations.independent import instance_of
from cocap_opt.formulations.independent.audit import Auditor, CoverageAudit
from cocap_opt.formulations.independent.instance_facts import FormatError, read_instance
from cocap_opt.formulations.independent.scene_facts import UnknownError, facts_of_scene
from cocap_opt.model import Model, compiled
from cocap_opt.planners.greedy import greedy
from cocap_opt.problem import (
    Actor,
    Airspace,
    Camera,
    Cuboid,
    Motion,
    Objective,
    Plan,
    Problem,
    Robot,
    StartArea,
    State,
    Views,
)
from cocap_opt.problem.motion import Stride
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.world.workspace import HeightMap, Mesh

SMALL = [
    "tiny-approach", "tiny-hover", "tiny-share", "tiny-queue", "tiny-doorway", "tiny-turn",
    "tiny-trap", "tiny-hidden", "tiny-give-way", "tiny-head-on",
]  # fmt: skip
AUDIT = ["scene_facts", "instance_facts", "differences", "enclosures", "audit"]
LARGER = ["corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage", "bridge"]


def with_flint() -> None:
    """Skip a test where there is nothing to make enclosures with."""
    pytest.importorskip("flint", reason="python-flint, of the extra audit, is not installed")


def document(problem: Problem) -> dict[str, Any]:
    """What the JSON file of a scene holds."""
    found: dict[str, Any] = json.loads(encode(SceneFile.of(problem)))["problem"]
    return found


def exported(problem: Problem) -> str:
    """The instance of a scene, with all of its coverage."""
    model = compiled(problem)
    model.prepare_all()
    return instance_of(model)


def differences(problem: Problem, text: str) -> list[str]:
    """The lines that tell how an instance parts from its scene, coverage aside."""
    scene = document(problem)
    return Auditor(scene, facts_of_scene(scene), read_instance(text)).facts().differences


def enclosed(problem: Problem, text: str, views: float = math.inf) -> CoverageAudit:
    """The audit of an instance's coverage."""
    scene = document(problem)
    return Auditor(scene, facts_of_scene(scene), read_instance(text)).coverage([], views, 0)


def require_agreement(problem: Problem, views: float = math.inf) -> None:
    """A scene and its instance agree, and nothing is left undecided."""
    text = exported(problem)
    assert differences(problem, text) == []
    found = enclosed(problem, text, views)
    assert (found.differences, found.undecided) == ([], 0)


def test_an_audit_shares_nothing_with_what_it_checks() -> None:
    """Its modules import each other, networkx, python-flint and Python's own, and nothing more."""
    room = "cocap_opt.formulations.independent"
    parts = {f"{room}.{name}" for name in AUDIT}
    used = {name for part in parts for name in imports(part)} - parts
    foreign = {name.split(".")[0] for name in used - {room}} - sys.stdlib_module_names
    assert foreign == {"networkx", "flint"}


@pytest.mark.parametrize("name", SMALL)
def test_small_instances_are_their_scenes(name: str) -> None:
    """Nothing differs, and each number that any state sees is inside of its enclosure."""
    with_flint()
    require_agreement(load_scene(name))


@pytest.mark.long(seconds=8)
@pytest.mark.parametrize("name", LARGER)
def test_larger_instances_are_their_scenes(name: str) -> None:
    """The same, for some of the states."""
    with_flint()
    require_agreement(load_scene(name), 300)


@pytest.mark.slow
@given(either(problems()))
@examples(60)
def test_random_instances_are_their_scenes(problem: Problem) -> None:
    """All that strategies draw is known, but for meshes that are not upright prisms."""
    with_flint()
    assume(not problem.meshes)
    require_agreement(problem, 30)


@pytest.mark.slow
@given(either(problems(over_time=True)))
@examples(40)
def test_the_referees_rewards_are_enclosed(problem: Problem) -> None:
    """J of a plan, by the scene alone, is the referee's up to the rounding of a sum."""
    with_flint()
    stays = Plan(paths=tuple((state,) * (problem.horizon + 1) for state in problem.first_starts))
    found = stays if problem.objective.over_time else greedy(problem).plan
    if found is None or problem.meshes or not check(problem, found).face_reward:
        reject()
    scene = document(problem)
    auditor = Auditor(scene, facts_of_scene(scene), read_instance(exported(problem)))
    low, high = auditor.reward(found.paths)
    reward = check(problem, found).reward
    assert low * (1 - 1e-12) <= reward <= high * (1 + 1e-12)
    assert high - low <= 1e-6 * max(high, 1.0)


@pytest.mark.slow
@given(meetings())
@examples(20)
def test_instances_of_meetings_are_their_scenes(problem: Problem) -> None:
    """Rules of all kinds, goals and several starts are known."""
    with_flint()
    require_agreement(problem, 20)


@pytest.mark.slow
@given(with_areas())
@examples(20)
def test_instances_have_all_cells_of_a_goal(problem: Problem) -> None:
    """Of goals of several cells, as of a single one."""
    assume(not problem.meshes)
    assert differences(problem, exported(problem)) == []


@pytest.mark.slow
@given(in_takes(problems()))
@examples(20)
def test_instances_with_takes_are_their_scenes(drawn: InTakes) -> None:
    """People of one take hide only each other, and count by its probability."""
    with_flint()
    assume(not drawn.problem.meshes)
    require_agreement(drawn.problem, 20)


def airy() -> Problem:
    """A scene with nearly all that is to be known: on a slope, with a ceiling and people near."""
    heights = np.zeros((9, 7))
    heights[4, 2:5] = 3.5
    ramp = np.linspace(0.0, 1.6, 9)[:, None] * np.ones(7)
    motion = Motion(
        radius=2,
        headings=4,
        layers=(4.0, 6.0, 9.0),
        clearance=0.4,
        spacing=1,
        stride=Stride(aside=4.0, upright=2.5, space=4.3),
    )
    walk = np.array([[33.0 + 2.0 * t, 2.1, 0.4, 0.3 * t] for t in range(4)])
    return Problem(
        name="airy",
        height_map=HeightMap(
            heights=heights + ramp, resolution=2.0, origin=(30.0, -4.0), datum=ramp, lift=0.1 * ramp
        ),
        robots=(
            Robot(start=StartArea(cells=((0, 1), (1, 1), (0, 2)), headings=(0, 1)), motion=motion),
            Robot(start=State(8, 5, 1, 2), motion=motion.replace(layers=(5.0, 6.0), spacing=2)),
        ),
        actors=(
            Actor(poses=walk, importance=(1.0, 2.0, 0.5, 0.25), swerve=0.4),
            standing(43.0, 3.0, 1.0, 0.4, steps=4),
        ),
        horizon=3,
        meshes=(Mesh.box((36.0, -4.0, 5.0), (38.0, 0.0, 5.5)),),
        airspace=Airspace(
            no_fly=(Mesh.box((33.3, 5.2, 3.0), (35.1, 9.0, 8.0)),),
            ceiling=6.5,
            people_aside=2.5,
            people_above=2.0,
            people_stray=0.1,
        ),
        objective=Objective(views=Views(weight=3.0), keep_cell=0.5),
    )


@pytest.mark.long
def test_airspace_slopes_strides_and_areas_are_known() -> None:
    """A scene with all of these agrees, and parts of each are found missing."""
    with_flint()
    problem = airy()
    text = exported(problem)
    scene = document(problem)
    facts = facts_of_scene(scene)
    assert any(kind.closed_places and kind.closed_moves for kind in facts.kinds)
    require_agreement(problem)
    for name, changed in (
        ("no_fly", []), ("ceiling", 7.5), ("people_aside", 0.0), ("people_above", 0.5),
        ("people_stray", 0.0),
    ):  # fmt: skip
        other = {**scene, "airspace": {**scene["airspace"], name: changed}}
        auditor = Auditor(other, facts_of_scene(other), read_instance(text))
        assert auditor.facts().differences, name
    walker, *others = scene["actors"]
    other = {**scene, "actors": [{**walker, "swerve": 0.0}, *others]}
    assert Auditor(other, facts_of_scene(other), read_instance(text)).facts().differences


def replaced(word: str, change: Callable[[str], str]) -> Callable[[str], str]:
    """A change of the first line that begins with a word."""

    def changed(text: str) -> str:
        lines = text.splitlines()
        at = next(k for k, line in enumerate(lines) if line.startswith(f"{word} "))
        new = change(lines[at])
        assert new != lines[at]
        lines[at : at + 1] = [new] if new else []
        return "\n".join(lines) + "\n"

    return changed


def test_changed_facts_are_found() -> None:
    """A dropped move, another weight, rule, reward or start: one line says both values."""
    problem = load_scene("tiny-doorway")
    text = exported(problem)
    assert differences(problem, text) == []
    for change, told in (
        (replaced("place", lambda line: line.rsplit(" ", 1)[0]),
         "drones 0, 1: move from, to, balanced ((0, 0, 0), (1, 1, 0), False): "
         "scene yes, instance no"),
        (replaced("orientation", lambda line: line.removesuffix(" 0")),
         "drones 0, 1: turn from, to heading, tilt ((0, 0), (0, 0)): scene yes, instance no"),
        (replaced("weight", lambda line: line.replace("0x1.0", "0x1.8")),
         "group 5: weight, and cap of drones that count: scene (1.0, 0), instance (1.5, 0)"),
        (replaced("rewards", lambda line: line.replace("0x0.0p+0", "0x1.0p+0", 1)),
         "rewards for moves: scene (0.0, 0.0, 0.0, 0.0), instance (1.0, 0.0, 0.0, 0.0)"),
        (replaced("rules", lambda line: line.replace("1 1", "1 0")),
         "rules: scene (1.0, 1.0, 0.0, 0.0), instance (1.0, 0.0, 0.0, 0.0)"),
        (replaced("drone 1", lambda line: line.replace(": 2,0", ": 1,0")),
         "drone 1: start in state x, y, layer, heading, tilt"),
        (replaced("horizon", lambda _: "horizon 2"), "horizon: scene 3, instance 2"),
        (replaced("class", lambda _: "class 0 : 1"), "drone 0: goal: scene none, instance {"),
        (replaced("sees", lambda line: line.replace("sees 1", "sees 0")),
         "step whose views count: scene no, instance yes"),
    ):  # fmt: skip
        assert any(told in line for line in differences(problem, change(text))), told


def test_states_that_are_closed_or_made_reachable_are_found() -> None:
    """A place that is closed at a step, and a state that sees though no drone gets there."""
    problem = load_scene("corridor")
    text = exported(problem)
    first = text.index("sees ")
    closed = text[:first] + "closed 3 0\n" + text[first:]
    place = "drones 0, 1: closed place, from step (3, (0, 4, 0))"
    assert any(f"{place}: scene no, instance yes" in x for x in differences(problem, closed))
    end = problem.horizon
    last = [line for line in text.splitlines() if line.startswith(f"sees {end} ")][-1]
    head, _, tail = last.partition(" : ")
    back = (end - 1) * len(problem.face_owner)
    pairs = (entry.split(":") for entry in tail.split())
    groups = " ".join(f"{int(group) - back}:{amount}" for group, amount in pairs)
    early = f"{head.replace(f'sees {end} ', 'sees 1 ')} : {groups}"
    found = differences(problem, text.replace(last, f"{last}\n{early}"))
    assert any("reached by drones 0, 1: scene no, instance yes" in line for line in found)


def test_changed_numbers_are_found() -> None:
    """A number that is off by a millionth, one that is missing, and one that is made up."""
    with_flint()
    problem = load_scene("tiny-trap")
    text = exported(problem)
    line = next(line for line in text.splitlines() if line.startswith("sees "))
    head, _, tail = line.partition(" : ")
    group, _, number = tail.split()[0].partition(":")
    off = f"{head} : {tail.replace(number, (float.fromhex(number) * (1 + 1e-6)).hex(), 1)}"
    made_up = f"{line} {int(group) + 3}:0x1.0p+3"
    for changed in (off, made_up):
        found = enclosed(problem, text.replace(line, changed)).differences
        assert len(found) == 1
        assert found[0].startswith("step 1, state x, y, layer, heading, tilt (")
    missing = enclosed(problem, text.replace(f"{line}\n", "")).differences
    assert len(missing) == len(tail.split())
    assert all(line.endswith("instance 0.0") for line in missing)


def behind_a_wall(height: float) -> Problem:
    """A drone that looks squarely at a person from 6 m, past a wall that begins 2.5 m away."""
    heights = np.zeros((9, 3))
    heights[3] = height
    camera = Camera(width=60, height=60, focal=60.0, tilts=(0.0,))
    robot = Robot(start=State(0, 1), motion=Motion(layers=(0.9,)), camera=camera)
    return tiny().replace(
        height_map=HeightMap(heights=heights, resolution=1.0),
        robots=(robot,), actors=(standing(7.0, 1.5, 0.0, math.pi),),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("wall", "pixels"),
    [(0.0, 100.0), (0.9, 50.0), (0.45, (0.9 + 0.45 * 6 / 3.5) / 1.8 * 100), (2.0, 0.0)],
)
def test_enclosures_hold_what_is_known_by_hand(wall: float, pixels: float) -> None:
    """A front seen squarely from 6 m has 60^2 / 6^2 px/m2; a wall in the way hides what it must.

    The eye is at 0.9 m, and the far edge of the wall's top 3.5 m away. At 0.9 m the top is neither
    turned to the eye nor away from it.
    """
    with_flint()
    from cocap_opt.formulations.independent.enclosures import Enclosures

    problem = behind_a_wall(wall)
    scene = document(problem)
    seen = Enclosures(scene).seen(scene["robots"][0], 0, (0, 1, 0, 0, 0))
    low, high = seen.faces.get(0, (0.0, 0.0))
    assert low <= pixels <= high
    assert high - low < 1e-6


@pytest.mark.parametrize(("name", "value"), [("OVERLAP", 1e-8), ("GRAZED", 1.0), ("FLUSH", 2.0)])
def test_flaws_of_coverage_are_found(
    name: str, value: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shadows that are too wide by 1e-8 m, or that cut too little: all of it is told."""
    with_flint()
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    monkeypatch.setattr(f"cocap_opt.vision.shadows.{name}", value)
    problem = behind_a_wall(0.45 if name == "OVERLAP" else 0.9 - 1e-3)
    model = Model(problem, plain=True)
    model.prepare_all()
    assert enclosed(problem, instance_of(model)).differences


def test_what_is_not_decided_is_counted() -> None:
    """One person's top lies as deep below another's as coverage calls flush: nobody decides it."""
    with_flint()
    camera = Camera(width=400, height=300, focal=200.0, tilts=(0.8,))
    problem = tiny().replace(
        robots=(Robot(start=State(0, 0, heading=0), motion=Motion(headings=4), camera=camera),),
        actors=(
            standing(7.0, 2.0, 0.0, 0.0),
            standing(7.0, 2.0, 0.0, 0.0).replace(shape=Cuboid(height=1.8 - 1e-6 + 1e-11)),
        ),
        height_map=HeightMap(heights=np.zeros((4, 3)), resolution=4.0),
    )
    found = enclosed(problem, exported(problem))
    assert found.undecided > 0
    assert found.differences == []


def test_what_is_not_known_is_refused() -> None:
    """A slanting mesh is refused in words, and enclosures refuse a plan that is not convex."""
    scene = document(tiny())
    slanting = {"vertices": [[0, 0, 0], [4, 0, 0], [0, 4, 3]], "triangles": [[0, 1, 2]]}
    with pytest.raises(UnknownError, match="meshes that are not upright prisms"):
        facts_of_scene({**scene, "meshes": [slanting]})
    with_flint()
    two = Mesh.joined([
        Mesh.box((4.0, 0.0, 0.0), (5.0, 8.0, WALL)), Mesh.box((5.0, 0.0, 0.0), (8.0, 1.0, WALL))
    ])  # fmt: skip
    bent = tiny().replace(meshes=(two,))
    text = exported(bent)
    assert differences(bent, text) == []
    with pytest.raises(UnknownError, match="not convex"):
        enclosed(bent, text)


def test_damaged_instances_are_refused() -> None:
    """What is no instance is refused with the number of its line."""
    text = exported(load_scene("tiny-doorway"))
    with pytest.raises(FormatError, match="line 5 "):
        read_instance(replaced("horizon", lambda _: "horizon x")(text))
    with pytest.raises(FormatError, match="line `end` is missing"):
        read_instance(text.removesuffix("end\n"))
    with pytest.raises(FormatError, match="given twice"):
        read_instance(replaced("drone", lambda line: f"{line}\n{line}")(text))


def test_the_command_says_what_agrees(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Exit code 0, 1 or 2: it agrees, it differs, or the call is wrong."""
    problem = load_scene("tiny-doorway")
    plan, instance = tmp_path / "plan.json", tmp_path / "x.instance"
    paths = greedy(problem.without_rules()).plan
    assert paths is not None
    scene = tmp_path / "scene.json"
    scene.write_bytes(encode(SceneFile.of(problem.without_rules())))
    plan.write_bytes(encode(PlanFile.of(problem.without_rules(), paths, 0.0, "greedy")))
    assert run(["audit", str(scene), str(plan), "--views", "0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["message"] == "coverage was left out"
    plan.write_bytes(encode(PlanFile.of(problem, paths, 0.0, "greedy")))
    assert run(["audit", "tiny-doorway", str(plan), "--views", "0", "--json"]) == 0
    assert (
        "breaks a rule; run `verify` for details" in json.loads(capsys.readouterr().out)["message"]
    )
    assert run(["export", "tiny-doorway", "-o", str(instance)]) == 0
    instance.write_text(instance.read_text().replace("rules 1 1", "rules 1 0"))
    capsys.readouterr()
    assert run(["audit", "tiny-doorway", "--instance", str(instance), "--views", "0"]) == 1
    assert "rules: scene (1.0, 1.0, 0.0, 0.0), instance" in capsys.readouterr().out
    assert run(["audit", "tiny-doorway", "--views", "1.5"]) == 2
    monkeypatch.setitem(sys.modules, "flint", None)
    monkeypatch.delitem(sys.modules, "cocap_opt.formulations.independent.enclosures", raising=False)
    assert run(["audit", "tiny-doorway"]) == 2
    assert "pip install 'cocap-opt[audit]'" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("coverage 2", "coverage 99"), "coverage: must be 2, which the audit supports"),
        (("cocap-instance 1", "cocap-instance 7"), "line 1: must be cocap-instance 1"),
        (("sees 1 0 0 :", "sees 1 99 0 :"), "sees: must name places below "),
        (
            ("weight ", "weight 0 "),
            "weight, 2nd number: must be hexadecimal, such as 0x1.0p+0, not",
        ),
    ],
)
def test_what_is_no_instance_is_refused_in_a_line(
    change: tuple[str, str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Exit code 2 and not 1: nothing was compared."""
    path = tmp_path / "x.instance"
    text = exported(load_scene("tiny-doorway"))
    assert change[0] in text
    path.write_text(text.replace(change[0], change[1], 1))
    assert run(["audit", "tiny-doorway", "--instance", str(path), "--views", "0"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


def test_what_is_drawn_cannot_be_foreseen(capsys: pytest.CaptureFixture[str]) -> None:
    """Unless it is asked for, the seed of the draw is another each time, and told."""
    seeds = []
    for option in ([], [], ["--draw", "5"]):
        assert run(["audit", "tiny-hover", "--views", "0", "--json", *option]) == 0
        seeds.append(json.loads(capsys.readouterr().out)["draw"])
    assert seeds[0] != seeds[1]
    assert seeds[2] == 5


def test_the_command_encloses_the_states_of_a_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A plan's states are looked at, and numbers that are off give exit code 1."""
    with_flint()
    problem = load_scene("tiny-hover")
    found = greedy(problem).plan
    assert found is not None
    plan = tmp_path / "plan.json"
    reward = check(problem, found).reward
    plan.write_bytes(encode(PlanFile.of(problem, found, reward, "greedy")))
    assert run(["audit", "tiny-hover", str(plan), "--views", "1", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["agrees"]
    ((low, high),) = answer["rewards_enclosed"]
    assert low <= reward <= high <= low + 1e-6
    assert answer["views_enclosed"] >= problem.horizon
    assert answer["differences"] == []
    plan.write_bytes(encode(PlanFile.of(problem, found, reward + 1e-5, "greedy")))
    assert run(["audit", "tiny-hover", str(plan), "--views", "1"]) == 1
    assert ": J: scene " in capsys.readouterr().out


def test_a_time_limit_leaves_coverage_undecided(capsys: pytest.CaptureFixture[str]) -> None:
    """Exit code 3, and how many states were not looked at."""
    with_flint()
    assert run(["audit", "tiny-hover", "--json"]) == 0
    whole = json.loads(capsys.readouterr().out)
    assert whole["views_left"] is None
    assert run(["audit", "tiny-hover", "--time-limit", "0", "--json"]) == 3
    answer = json.loads(capsys.readouterr().out)
    assert answer["agrees"]
    assert (answer["views_enclosed"], answer["views_left"]) == (0, whole["views_enclosed"])
    assert run(["audit", "tiny-hover", "--time-limit", "0"]) == 3
    assert "for lack of time" in capsys.readouterr().out
    assert run(["audit", "tiny-hover", "--time-limit", "-1"]) == 2
