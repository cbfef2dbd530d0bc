"""Scene and plan files: exact round trips, strict reading, whole or not at all."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples, tiny

from cocap_opt.data import FOCAL, LARGEST, MOST_WEIGHT, SMALLEST
from cocap_opt.files.documents import (
    FileError,
    PlanFile,
    SceneFile,
    decode_document,
    encode,
    problem_digest,
)
from cocap_opt.problem import (
    Actor,
    Camera,
    CollisionRules,
    Cuboid,
    Earth,
    Limits,
    Motion,
    Objective,
    Plan,
    Prism,
    Problem,
    Robot,
    State,
    TriangulatedCuboid,
)
from cocap_opt.result import Reason
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit
from cocap_opt.world.workspace import HeightMap

FINITE = st.floats(-LARGEST, LARGEST)
POSITIVE = st.floats(SMALLEST, LARGEST)
NOT_NEGATIVE = st.floats(0.0, LARGEST)
WEIGHTS = st.floats(0.0, MOST_WEIGHT)


def exact(problem: Problem) -> str:
    """All of a problem's data with every bit of every number."""

    def as_hex(array: Any) -> list[object]:
        return [array.shape, array.tobytes().hex()]

    return repr(msgspec.to_builtins(problem, enc_hook=as_hex))


@st.composite
def wild_problems(draw: st.DrawFn) -> Problem:
    """Valid problems with any allowed floats in them."""
    width, depth = draw(st.integers(1, 3)), draw(st.integers(1, 3))
    heights = np.array(draw(st.lists(FINITE, min_size=width * depth, max_size=width * depth)))
    heights = heights.reshape(width, depth)
    heights[0, 0] = -LARGEST
    layers = tuple(sorted(draw(st.sets(FINITE.filter(lambda h: h > -LARGEST), min_size=1))))
    shape = draw(
        st.one_of(
            st.builds(Cuboid, length=POSITIVE, width=POSITIVE, height=POSITIVE),
            st.builds(TriangulatedCuboid, length=POSITIVE, width=POSITIVE, height=POSITIVE),
            st.builds(Prism, sides=st.integers(3, 6), apothem=POSITIVE, height=POSITIVE),
        )
    )
    poses = draw(st.lists(FINITE, min_size=8, max_size=8))
    faces = len(shape.faces())
    weights = draw(st.none() | st.lists(WEIGHTS, min_size=faces, max_size=faces).map(tuple))
    robot = Robot(
        start=State(0, 0, len(layers) - 1, heading=draw(st.integers(0, 2))),
        motion=Motion(headings=3, layers=layers, corner_cutting=draw(st.booleans())),
        camera=Camera(focal=draw(st.floats(*FOCAL)), tilts=(draw(st.floats(-1.5, 1.5)),)),
        goal=draw(st.none() | st.just((0, 0))),
    )
    return Problem(
        name=draw(st.text(st.characters(exclude_categories=["Cs"]))),
        height_map=HeightMap(
            heights=heights, resolution=draw(POSITIVE), origin=(draw(FINITE), draw(FINITE))
        ),
        robots=(robot,),
        actors=(Actor(poses=np.reshape(poses, (2, 4)), shape=shape, weights=weights),),
        horizon=1,
        rules=CollisionRules(separation=draw(NOT_NEGATIVE.filter(lambda x: not 0 < x < 1e-5))),
        objective=Objective(
            stationarity=draw(WEIGHTS),
            keep_cell=draw(WEIGHTS),
            keep_heading=draw(WEIGHTS),
            balanced=draw(WEIGHTS),
            count_start=draw(st.booleans()),
        ),
        face_samples=draw(st.integers(1, 64)),
    )


@examples(35)
@given(wild_problems())
def test_scene_file_keeps_every_bit(problem: Problem) -> None:
    """A problem read back from its file is the same one, bit for bit."""
    content = encode(SceneFile(problem=problem))
    again = decode_document(content, "scene", SceneFile).problem
    assert exact(again) == exact(problem)
    assert encode(SceneFile(problem=again)) == content
    assert problem_digest(again) == problem_digest(problem)


@examples(20)
@given(problems())
def test_scene_file_keeps_problems_of_all_kinds(problem: Problem) -> None:
    """Goals, gimbals, layers, shapes, weights and rules survive the file."""
    again = decode_document(encode(SceneFile(problem=problem)), "scene", SceneFile).problem
    assert exact(again) == exact(problem)
    assert again.robots == problem.robots
    assert again.rules == problem.rules


def test_files_on_disk(tmp_path: Path) -> None:
    """Saving and loading goes through real files."""
    problem, path = tiny(), tmp_path / "scene.json"
    SceneFile(problem=problem).save(path)
    assert exact(SceneFile.read(path).problem) == exact(problem)
    plan = Plan(paths=tuple((robot.start,) * 3 for robot in problem.robots))
    content = PlanFile(scene="tiny", digest="d", planner="none", reward=0.1 + 0.2, plan=plan)
    content.save(tmp_path / "plan.json")
    again = PlanFile.read(tmp_path / "plan.json")
    assert again == content
    assert all(isinstance(state, State) for path in again.plan.paths for state in path)


def test_digest_ignores_the_name_and_the_place_only() -> None:
    """The digest names the content: all but names and the place on the Earth."""
    problem, digest = tiny(), problem_digest(tiny())
    bert = problem.actors[0].replace(name="bert")
    assert problem_digest(problem.replace(actors=(bert, *problem.actors[1:]))) == digest
    assert problem_digest(problem.replace(name="other")) == digest
    assert problem_digest(problem.replace(earth=Earth(crs="EPSG:25830"))) == digest
    poses = problem.actors[0].poses.copy()
    poses[0, 0] = np.nextafter(poses[0, 0], 99)
    variants = [
        problem.replace(horizon=1),
        problem.replace(face_samples=1),
        problem.replace(rules=CollisionRules(swap=False)),
        problem.replace(objective=Objective(stationarity=1.0)),
        problem.replace(objective=Objective(keep_cell=1.0)),
        problem.replace(objective=Objective(keep_heading=1.0)),
        problem.replace(objective=Objective(balanced=1.0)),
        problem.replace(actors=()),
        problem.replace(actors=(Actor(poses=poses),)),
        problem.replace(robots=problem.robots[:1]),
        problem.replace(robots=problem.robots[::-1]),
        problem.replace(height_map=problem.height_map.replace(origin=(0.0, 1.0))),
    ]
    assert len({digest, *map(problem_digest, variants)}) == len(variants) + 1


def test_digests_of_scenes_that_say_nothing_of_flying_hold() -> None:
    """Plans and certificates of before still fit; what a scene says of its flight is content."""
    problem = load_scene("tiny-queue")
    digest = "0f3fabc32bc07affc33f6d9e96e81900def632e5f2cced0371c852c1bbb44bad"
    assert problem_digest(problem) == digest
    limited = tuple(robot.replace(limits=Limits(speed=9.0)) for robot in problem.robots)
    variants = [
        problem.replace(step=1.0),
        problem.replace(robots=limited),
    ]
    assert len({digest, *map(problem_digest, variants)}) == 3
    for variant in variants:
        again = decode_document(encode(SceneFile(problem=variant)), "scene", SceneFile).problem
        assert problem_digest(again) == problem_digest(variant)


def test_digest_survives_the_file_where_floats_were_given_as_integers() -> None:
    """A plan's digest still fits its scene after a round trip: 5 and 5.0 m are one height."""
    problem = tiny()
    robots = tuple(
        robot.replace(motion=Motion(headings=4, layers=(5,))) for robot in problem.robots
    )
    problem = problem.replace(
        robots=robots,
        height_map=HeightMap(heights=problem.height_map.heights, resolution=4, origin=(0, 0)),
    )
    again = decode_document(encode(SceneFile(problem=problem)), "scene", SceneFile).problem
    assert problem_digest(again) == problem_digest(problem)


def scene(**changes: Any) -> dict[str, Any]:
    """Content of the tiny scene's file, with fields of the problem changed."""
    content: dict[str, Any] = json.loads(encode(SceneFile(problem=tiny())))
    content["problem"] |= changes
    return content


def at(content: dict[str, Any], *path: str | int) -> Any:
    """The value deep inside a file's content."""
    value: Any = content
    for key in path:
        value = value[key]
    return value


def without(content: dict[str, Any], *path: str | int) -> dict[str, Any]:
    """The content with one field taken out."""
    del at(content, *path[:-1])[path[-1]]
    return content


def changed(value: object, *path: str | int) -> dict[str, Any]:
    """The scene with one field set, old or new."""
    content = scene()
    at(content, *path[:-1])[path[-1]] = value
    return content


def area(cells: list[list[int]]) -> dict[str, Any]:
    """A goal of several cells, as a file has it."""
    return {"type": "area", "cells": cells}


P = "problem"
BAD_CONTENT: dict[str, tuple[str, Callable[[], dict[str, Any]]]] = {
    "unknown field": ("colour", lambda: changed("red", "colour")),
    "unknown field of the problem": ("horizn", lambda: scene(horizn=3)),
    "unknown field of a robot": ("speed", lambda: changed(1, P, "robots", 0, "speed")),
    "unknown field of a motion": ("radios", lambda: changed(1, P, "robots", 0, "motion", "radios")),
    "turn huge": ("turn", lambda: changed(10**30, P, "robots", 0, "motion", "turn")),
    "climb huge": ("climb", lambda: changed(10**30, P, "robots", 0, "motion", "climb")),
    "pitch huge": ("pitch_turn", lambda: changed(10**9, P, "robots", 0, "motion", "pitch_turn")),
    "width huge": ("width", lambda: changed(10**30, P, "robots", 0, "camera", "width")),
    "height huge": ("height", lambda: changed(10**30, P, "robots", 0, "camera", "height")),
    "focal huge": ("focal", lambda: changed(1e300, P, "robots", 0, "camera", "focal")),
    "weights huge": ("weights", lambda: changed([1e308] * 5, P, "actors", 0, "weights")),
    "stationarity huge": ("stationarity", lambda: scene(objective={"stationarity": 1e308})),
    "wrong version": ("version", lambda: changed(9, "version")),
    "version as text": ("version", lambda: changed("1", "version")),
    "wrong format": ("format", lambda: changed("cocap-opt plan", "format")),
    "no problem": ("problem", lambda: without(scene(), "problem")),
    "no horizon": ("horizon", lambda: without(scene(), P, "horizon")),
    "no heights": ("heights", lambda: without(scene(), P, "height_map", "heights")),
    "horizon as text": ("horizon", lambda: scene(horizon="2")),
    "horizon as fraction": ("horizon", lambda: scene(horizon=1.5)),
    "horizon as truth": ("horizon", lambda: scene(horizon=True)),
    "horizon missing value": ("horizon", lambda: scene(horizon=None)),
    "horizon too small": ("horizon", lambda: scene(horizon=0)),
    "horizon beyond the poses": ("poses", lambda: scene(horizon=9)),
    "horizon huge": ("horizon", lambda: scene(horizon=10**300)),
    "name as number": ("name", lambda: scene(name=3)),
    "robots as object": ("robots", lambda: scene(robots={})),
    "no robots": ("robots", lambda: scene(robots=[])),
    "start too short": ("start", lambda: changed([0], P, "robots", 0, "start")),
    "start too long": ("start", lambda: changed([0] * 6, P, "robots", 0, "start")),
    "start of text": ("start", lambda: changed(["0", "0"], P, "robots", 0, "start")),
    "start outside": ("robots[1].start.x", lambda: changed([9, 0], P, "robots", 1, "start")),
    "goal of three": ("goal", lambda: changed([0, 0, 0], P, "robots", 0, "goal")),
    "origin of one": ("origin", lambda: changed([0.0], P, "height_map", "origin")),
    "resolution as text": ("resolution", lambda: changed("1", P, "height_map", "resolution")),
    "resolution zero": ("resolution", lambda: changed(0, P, "height_map", "resolution")),
    "ragged heights": ("heights", lambda: changed([[0], [0, 1]], P, "height_map", "heights")),
    "flat heights": ("heights", lambda: changed([0, 1], P, "height_map", "heights")),
    "heights missing value": ("heights", lambda: changed([[None]], P, "height_map", "heights")),
    "heights of text": ("heights", lambda: changed([["0"] * 3] * 4, P, "height_map", "heights")),
    "heights of truths": ("heights", lambda: changed([[True] * 3] * 4, P, "height_map", "heights")),
    "heights of objects": ("heights", lambda: changed([[{}]], P, "height_map", "heights")),
    "heights as text": ("heights", lambda: changed("zeros", P, "height_map", "heights")),
    "heights huge": ("heights", lambda: changed([[10**400]], P, "height_map", "heights")),
    "heights empty": (
        "heights: must not be empty", lambda: changed([], P, "height_map", "heights")
    ),
    "poses empty": ("poses: must not be empty", lambda: changed([], P, "actors", 0, "poses")),
    "bare ground empty": (
        "bare: must not be empty", lambda: changed([], P, "height_map", "bare")
    ),
    "bare ground of other cells": (
        "bare: must have 4 x 3 cells", lambda: changed([[0.0]], P, "height_map", "bare")
    ),
    "bare ground of text": (
        "bare: row, column [0][0]", lambda: changed([["0"]], P, "height_map", "bare")
    ),
    "goal of no cells": (
        "goal: cells: must hold", lambda: changed(area([]), P, "robots", 0, "goal")
    ),
    "goal off the map": (
        "robots[0].goal.cells: must lie inside the map of 4 x 3 cells, not (0, 3)",
        lambda: changed(area([[0, 3], [1, 1], [2, 0]]), P, "robots", 0, "goal"),
    ),
    "goal far off the map": (
        "robots[0].goal.cells: must lie inside",
        lambda: changed(area([[10**19, 0], [1, 1]]), P, "robots", 0, "goal"),
    ),
    "goal of another kind": (
        'goal.type: must be "area"',
        lambda: changed({"type": "states", "cells": [[0, 0]]}, P, "robots", 0, "goal"),
    ),
    "ragged poses": ("poses", lambda: changed([[0] * 4, [0]], P, "actors", 0, "poses")),
    "unknown shape": ("cone", lambda: changed({"type": "cone"}, P, "actors", 0, "shape")),
    "shape without type": ("type", lambda: changed({"height": 1.0}, P, "actors", 0, "shape")),
    "weights too few": ("weights", lambda: changed([1.0], P, "actors", 0, "weights")),
    "no tilt": ("tilts", lambda: changed([], P, "robots", 0, "camera", "tilts")),
    "layers wrong": ("layers", lambda: changed([5, 3], P, "robots", 0, "motion", "layers")),
}  # fmt: skip


def refused(path: Path, content: bytes) -> str:
    """Message of the one-line FileError that reading the content as a scene raises."""
    path.write_bytes(content)
    with pytest.raises(FileError) as caught:
        SceneFile.read(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    return message.removeprefix(f"{path}: ")


@pytest.mark.parametrize("case", BAD_CONTENT)
def test_wrong_content_is_refused(case: str, tmp_path: Path) -> None:
    """A wrong field is one line that names the file and the field, never a traceback."""
    field, make = BAD_CONTENT[case]
    message = refused(tmp_path / "scene.json", json.dumps(make()).encode())
    assert field in message


def _damaged() -> dict[str, bytes]:
    good = encode(SceneFile(problem=tiny()))
    number = b'"resolution": 4.0'
    return {
        "empty": b"",
        "truncated": good[: len(good) // 2],
        "last brace missing": good.rstrip()[:-1],
        "not UTF-8 in text": good.replace(b'"tiny"', b'"\xff\xfe"'),
        "not UTF-8 at all": good.decode().encode("utf-16"),
        "NaN literal": good.replace(number, b'"resolution": NaN'),
        "Infinity literal": good.replace(number, b'"resolution": Infinity'),
        "number out of range": good.replace(number, b'"resolution": 1e999'),
        "NaN in heights": good.replace(b"0.0,", b"NaN,", 1),
        "out of range in heights": good.replace(b"0.0,", b"1e999,", 1),
        "two documents": good + good,
        "a list": b"[]",
        "a number": b"3",
        "null": b"null",
        "deep nesting": b"[" * 100_000,
        "deep nesting in a field": good.replace(b'"heights": [', b'"heights": ' + b"[" * 100_000),
        "forty axes": good.replace(
            b'"heights": [', b'"heights": ' + b"[" * 70 + b"1" + b"]" * 70 + b', "x": [', 1
        ),
        "lone surrogate": good.replace(b'"tiny"', b'"\\ud800"'),
        "control characters": good.replace(b'"tiny"', b'"a\nb"'),
        "digits without end": good.replace(b'"horizon": 2', b'"horizon": ' + b"9" * 5000),
        "image": bytes(range(256)),
    }


@pytest.mark.parametrize("case", _damaged())
def test_damaged_file_is_refused(case: str, tmp_path: Path) -> None:
    """Whatever is in a file, reading it ends in a problem or in one line that names the file."""
    message = refused(tmp_path / "scene.json", _damaged()[case])
    assert message
    assert len(message) < 1000


@examples(60)
@given(st.data())
def test_any_single_damage_is_survived(data: st.DataObject) -> None:
    """One byte changed anywhere gives a problem or a FileError, never another exception."""
    content = bytearray(encode(SceneFile(problem=tiny())))
    place = data.draw(st.integers(0, len(content) - 1))
    content[place] = data.draw(st.integers(0, 255))
    try:
        decode_document(bytes(content), "scene", SceneFile)
    except FileError as error:
        assert str(error).startswith("scene: ")


def test_missing_file_and_folder_are_refused(tmp_path: Path) -> None:
    """A path that is not there, or is a folder, is a FileError that names it."""
    for path in (tmp_path / "nowhere.json", tmp_path):
        with pytest.raises(FileError, match=r": \w") as caught:
            SceneFile.read(path)
        assert str(caught.value).startswith(f"{path}: ")


def test_a_plan_file_is_no_scene_file(tmp_path: Path) -> None:
    """Each kind of file is refused as the other one."""
    plan = PlanFile(scene="s", digest="d", planner="p", reward=1.0, plan=Plan(paths=()))
    refused(tmp_path / "plan.json", encode(plan))
    SceneFile(problem=tiny()).save(tmp_path / "scene.json")
    with pytest.raises(FileError, match="format"):
        PlanFile.read(tmp_path / "scene.json")


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("reward", None),
        ("reward", "1"),
        ("plan", {"paths": [[[0.5, 0]]]}),
        ("plan", {"paths": [[[0]]]}),
        ("plan", {"paths": 3}),
        ("plan", {"robots": []}),
        ("scene", 1),
        ("seconds", -1.0),
        ("reason", "done"),
    ],
)
def test_wrong_plan_file_is_refused(field: str, value: object, tmp_path: Path) -> None:
    """A plan file is read as strictly as a scene file, and the field is named."""
    plan = PlanFile(scene="s", digest="d", planner="p", reward=1.0, plan=Plan(paths=()))
    content = json.loads(encode(plan)) | {field: value}
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match=field) as caught:
        PlanFile.read(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_limits_of_plan_files_that_are_none_are_told_those_that_are(tmp_path: Path) -> None:
    """As for words of other kinds: what is allowed, and what is likely meant."""
    plan = PlanFile(scene="s", digest="d", planner="p", reward=1.0, plan=Plan(paths=()))
    path = tmp_path / "plan.json"
    path.write_text(json.dumps(json.loads(encode(plan)) | {"limit": "tme"}))
    with pytest.raises(FileError, match=r"limit: must be one of time, work, .*; did you mean time"):
        PlanFile.read(path)


def test_plan_files_of_before_say_nothing_of_the_search(tmp_path: Path) -> None:
    """Version 2 had no `limit`, version 3 neither reason nor seconds; files of both are read."""
    plan = PlanFile(
        scene="s", digest="d", planner="p", limit=Limit.TIME, reason="stopped", seconds=1.5,
        time_limit=2.0, work_limit=3, reward=1.0, plan=Plan(paths=()),
    )  # fmt: skip
    path = tmp_path / "plan.json"
    plan.save(path)
    assert PlanFile.read(path) == plan
    content = json.loads(path.read_text())
    for version, new in ((3, ("reason", "seconds", "time_limit", "work_limit")), (2, ("limit",))):
        content |= {"version": version}
        for field in new:
            del content[field]
        path.write_text(json.dumps(content))
        old = PlanFile.read(path)
        assert old.seconds is old.time_limit is old.work_limit is old.reason is None
    assert old.limit is None


def test_plan_files_have_the_reasons_of_results(tmp_path: Path) -> None:
    """All of them, and no others; seconds below nothing are refused."""
    path, plan = tmp_path / "plan.json", Plan(paths=())
    for reason in Reason:
        PlanFile(scene="s", digest="d", planner="p", reward=1.0, plan=plan, reason=reason).save(
            path
        )
        assert json.loads(path.read_text())["reason"] == str(reason)
        assert PlanFile.read(path).ending.reason is reason
    content = json.loads(path.read_text())
    for field, wrong in (("reason", "done"), ("seconds", -1.0)):
        path.write_text(json.dumps(content | {field: wrong}))
        with pytest.raises(FileError, match=f"{field}: must be"):
            PlanFile.read(path)


def test_a_killed_write_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A write that dies before its end leaves the old file whole and nothing beside it."""
    path = tmp_path / "scene.json"
    SceneFile(problem=tiny()).save(path)
    before = path.read_bytes()

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "replace", killed)
    with pytest.raises(KeyboardInterrupt):
        SceneFile(problem=tiny().replace(horizon=1)).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_files_are_as_readable_as_other_new_files(tmp_path: Path) -> None:
    """A written file has the mode that the user's umask gives any new file."""
    path, other = tmp_path / "scene.json", tmp_path / "other"
    SceneFile(problem=tiny()).save(path)
    other.write_text("")
    assert path.stat().st_mode == other.stat().st_mode
    path.chmod(0o600)
    SceneFile(problem=tiny()).save(path)
    assert path.stat().st_mode & 0o777 == 0o600


@pytest.mark.skipif(os.geteuid() == 0, reason="the superuser may write to any file")
def test_files_that_may_only_be_read_are_kept(tmp_path: Path) -> None:
    """A rename would replace them all the same."""
    path = tmp_path / "scene.json"
    path.write_text("kept")
    path.chmod(0o444)
    with pytest.raises(FileError, match="Permission denied"):
        SceneFile(problem=tiny()).save(path)
    assert path.read_text() == "kept"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            '"horizon": 2',
            '"horizon": "two"',
            "problem.horizon: must be a whole number, not the text 'two'",
        ),
        ('"horizon": 2', '"horizon": 2.5', "problem.horizon: must be a whole number, not 2.5"),
        ('"horizon": 2', '"horizon": NaN', "must hold finite numbers only, not NaN (byte "),
        ('"horizon": 2,', "", "problem: must have the field `horizon`"),
        (
            '"horizon": 2',
            '"horizont": 2',
            "problem: must have no unknown field `horizont`; did you mean horizon?; known are ",
        ),
        (
            '"poses": [',
            '"poses": [[1, null],',
            "poses: row, column [0][1]: must be a number, not n",
        ),
        (
            '"type": "',
            '"type": "x',
            "camera.type: must be one of pinhole, cone, not 'xpinhole'",
        ),
    ],
)
def test_wrong_values_are_said_as_fields(tmp_path: Path, old: str, new: str, words: str) -> None:
    """The field first, then what is allowed in it, in words."""
    path = tmp_path / "scene.json"
    SceneFile(problem=load_scene("tiny-share").replace(horizon=2)).save(path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(FileError) as error:
        SceneFile.read(path)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_what_is_no_text_is_said_with_its_place(tmp_path: Path) -> None:
    """In our words, as of all files."""
    path = tmp_path / "scene.json"
    SceneFile(problem=tiny()).save(path)
    path.write_bytes(path.read_bytes().replace(b"tiny", b"tin\xff"))
    words = r"scene.json: must be a text file in UTF-8, but byte \d+, in line \d+, is not"
    with pytest.raises(FileError, match=words):
        SceneFile.read(path)


def test_a_key_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    """Nobody knows which of the two values was meant, at the top or inside, read or not."""
    path = tmp_path / "scene.json"
    SceneFile(problem=tiny()).save(path)
    text = path.read_text()
    for old, new in (('"version"', '"format": "cocap-opt scene", "version"'),
                     ('"horizon": 2', '"horizon": 2, "horizon": 1')):  # fmt: skip
        assert old in text
        path.write_text(text.replace(old, new, 1))
        key = new.split('"')[1]
        with pytest.raises(FileError, match=rf"scene.json: {key}: must be given once in an object"):
            SceneFile.read(path)
