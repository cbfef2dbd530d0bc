"""The coverage cache: found by content, repaired when damaged, never in the way."""

import hashlib
import io
import logging
import os
import shutil
import subprocess
import sys
import threading
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest
from strategies import plate, tiny

from cocap_opt.files import code
from cocap_opt.model import Model
from cocap_opt.problem import (
    NO_RULES,
    Airspace,
    Camera,
    Cuboid,
    Motion,
    Objective,
    Prism,
    Problem,
    State,
)
from cocap_opt.vision import cache
from cocap_opt.vision.cache import TableCache
from cocap_opt.vision.coverage import CoverageTable
from cocap_opt.world.workspace import HeightMap

CODE = "cocap_opt.model.coverage_tables"  # the module that makes tables


def stored(folder: Path) -> list[Path]:
    """The files of a cache but those of digests of code."""
    return [path for path in folder.iterdir() if path.suffix != ".code"]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of the test's own."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def tables(problem: Problem) -> list[CoverageTable]:
    """Coverage tables of all classes of a fresh model."""
    model = Model(problem)
    return [model.coverage(robot_class) for robot_class in model.classes]


def same(a: list[CoverageTable], b: list[CoverageTable]) -> bool:
    """True where tables are equal to the last bit, types included."""
    pairs = [(x, y) for s, t in zip(a, b, strict=True) for x, y in zip(s, t, strict=True)]
    return all(x.dtype == y.dtype and x.tobytes() == y.tobytes() for x, y in pairs)


def with_robot(**changes: Any) -> Problem:
    """The tiny instance with both robots changed in the same way."""
    return tiny().replace(robots=tuple(robot.replace(**changes) for robot in tiny().robots))


def with_actor(**changes: Any) -> Problem:
    """The tiny instance with its actor changed."""
    return tiny().replace(actors=(tiny().actors[0].replace(**changes),))


def with_map(**changes: Any) -> Problem:
    """The tiny instance with its map changed."""
    return tiny().replace(height_map=tiny().height_map.replace(**changes))


def nudged(array: Any) -> Any:
    """The array with one number changed in its last bit."""
    result = array.copy()
    result.flat[-1] = np.nextafter(result.flat[-1], 9e9)
    return result


CAMERA, MOTION = tiny().robots[0].camera, tiny().robots[0].motion
OTHER_CONTENT: dict[str, Callable[[], Problem]] = {
    "heights": lambda: with_map(heights=nudged(tiny().height_map.heights)),
    "resolution": lambda: with_map(resolution=4.5),
    "origin": lambda: with_map(origin=(0.0, 1e-9)),
    "poses": lambda: with_actor(poses=nudged(tiny().actors[0].poses)),
    "shape size": lambda: with_actor(shape=Cuboid(height=1.7)),
    "shape kind": lambda: with_actor(shape=Prism()),
    "more actors": lambda: tiny().replace(actors=tiny().actors * 2),
    "no actors": lambda: tiny().replace(actors=()),
    "camera width": lambda: with_robot(camera=CAMERA.replace(width=401)),
    "camera height": lambda: with_robot(camera=CAMERA.replace(height=301)),
    "focal": lambda: with_robot(camera=CAMERA.replace(focal=200.5)),
    "tilts": lambda: with_robot(camera=CAMERA.replace(tilts=(0.61,))),
    "gimbal": lambda: with_robot(camera=CAMERA.replace(tilts=(0.6, 0.7))),
    "radius": lambda: with_robot(motion=MOTION.replace(radius=2)),
    "headings": lambda: with_robot(motion=MOTION.replace(headings=5)),
    "turn": lambda: with_robot(motion=MOTION.replace(turn=2)),
    "layers": lambda: with_robot(motion=MOTION.replace(layers=(5.5,))),
    "clearance": lambda: with_robot(motion=MOTION.replace(clearance=0.5)),
    "corner cutting": lambda: with_robot(motion=MOTION.replace(corner_cutting=True)),
    "start": lambda: tiny().replace(
        robots=(tiny().robots[0].replace(start=State(0, 1)), tiny().robots[1])
    ),
    "horizon": lambda: tiny().replace(horizon=1),
    "samples": lambda: tiny().replace(face_samples=3),
    "count start": lambda: tiny().replace(objective=Objective(count_start=True)),
}


@pytest.mark.parametrize("what", OTHER_CONTENT)
def test_other_content_is_another_file(what: str, folder: Path) -> None:
    """A change of anything that coverage depends on is computed anew, never found."""
    tables(tiny())
    assert len(stored(folder)) == 1
    tables(OTHER_CONTENT[what]())
    assert len(stored(folder)) == 2


SAME_CONTENT: dict[str, Callable[[], Problem]] = {
    "name": lambda: tiny().replace(name="other"),
    "rules": lambda: tiny().replace(rules=NO_RULES),
    "stationarity": lambda: tiny().replace(objective=Objective(stationarity=2.0)),
    "rewards for moves": lambda: tiny().replace(objective=Objective(keep_cell=2.0, balanced=1.0)),
    "weights": lambda: with_actor(weights=(2.0,) * 5),
    "goal": lambda: with_robot(goal=(0, 1)),
    "bare ground": lambda: tiny().replace(
        height_map=tiny().height_map.replace(bare=np.zeros(tiny().height_map.shape))
    ),
    "order": lambda: tiny().replace(robots=tiny().robots[::-1]),
    "later poses": lambda: with_actor(poses=np.vstack([tiny().actors[0].poses, np.ones(4)])),
}


@pytest.mark.parametrize("what", SAME_CONTENT)
def test_same_content_is_found(what: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What coverage does not depend on finds the table that is there, and it fits."""
    tables(tiny())
    # Nothing may be computed.
    monkeypatch.setattr("cocap_opt.vision.coverage.GrowingTable.grow", None)
    found = tables(SAME_CONTENT[what]())
    monkeypatch.undo()
    fresh = Model(SAME_CONTENT[what](), use_cache=False)
    assert same(found, [fresh.coverage(robot_class) for robot_class in fresh.classes])


def test_key_depends_on_every_part() -> None:
    """Arrays of other shape, type or content, and other order of parts, have other keys."""
    array = np.arange(6.0)
    parts: list[tuple[object, ...]] = [
        (array,),
        (array.reshape(2, 3),),
        (array.reshape(3, 2),),
        (array.astype(np.float32),),
        (array.astype(np.int64),),
        (array, array),
        (array[::-1],),
        (-array,),
        (1, 2),
        (2, 1),
        ((1, 2),),
        (Camera(),),
        (Camera(width=1),),
        (Cuboid(),),
        (None,),
        (HeightMap(heights=np.zeros((1, 1))), Motion()),
    ]
    assert len({TableCache.key(CODE, *part) for part in parts}) == len(parts)
    assert TableCache.key(CODE, array) == TableCache.key(
        CODE, np.arange(12.0)[::2] / 2
    )  # strides do not count
    with pytest.raises(TypeError):
        TableCache.key(CODE, object())


@pytest.mark.slow
def test_key_depends_on_all_code_that_makes_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whichever module runs while a table is made: once it is changed, the table is made again."""
    ran: set[str] = set()

    def note(frame: FrameType, event: str, argument: object) -> None:
        ran.add(frame.f_code.co_filename)

    problem = tiny().replace(
        meshes=(plate((5.0, 4.0), (7.0, 6.0), 4.0),),
        airspace=Airspace(people_aside=0.5, people_above=1.0),
    )
    sys.setprofile(note)
    threading.setprofile(note)
    try:
        model = Model(problem, use_cache=False)
        for robot_class in model.classes:
            model.coverage(robot_class)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    folder = Path(code._FOLDER)
    shutil.copytree(folder, tmp_path / "cocap_opt", ignore=shutil.ignore_patterns("lab"))
    monkeypatch.setattr(code, "_FOLDER", tmp_path / "cocap_opt")
    before = code.code_digest(*code.with_imports(CODE))
    used = {Path(name).relative_to(folder) for name in ran if Path(name).is_relative_to(folder)}
    assert {Path("vision/shadows.py"), Path("graph/timegraph.py"), Path("data.py")} <= used
    for path in used:
        copy = tmp_path / "cocap_opt" / path
        text = copy.read_text("utf-8")
        copy.write_text(f"{text}\nchanged = True\n", "utf-8")
        assert code.code_digest(*code.with_imports(CODE)) != before, path
        copy.write_text(text, "utf-8")
    assert code.code_digest(*code.with_imports(CODE)) == before


def damage(content: bytes, kind: str) -> bytes:
    """A damaged copy of a cache file."""
    middle = len(content) // 2
    return {
        "flipped bit": content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :],
        "flipped bit in the digest": bytes([content[0] ^ 1]) + content[1:],
        "truncated": content[:middle],
        "only the digest": content[:32],
        "shorter than the digest": content[:10],
        "empty": b"",
        "longer": content + b"\0",
        "text": b"not a table",
    }[kind]


@pytest.mark.parametrize(
    "kind",
    ["flipped bit", "flipped bit in the digest", "truncated", "only the digest",
     "shorter than the digest", "empty", "longer", "text"],
)  # fmt: skip
def test_a_damaged_file_is_noticed_and_made_again(
    kind: str, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A damaged cache file costs a warning that names it, and time, but never a wrong number."""
    expected = tables(tiny())
    (path,) = stored(folder)
    good = path.read_bytes()
    path.write_bytes(damage(good, kind))
    with caplog.at_level(logging.WARNING):
        assert same(tables(tiny()), expected)
    assert str(path) in caplog.text
    caplog.clear()
    assert cache._read(path) is not None  # mended
    assert not caplog.records


def test_what_is_found_equals_what_was_made(folder: Path) -> None:
    """A table from disk is the computed one, to the last bit."""
    made = tables(tiny())
    assert same(tables(tiny()), made)
    assert same([Model(tiny(), use_cache=False).coverage(Model(tiny()).classes[0])], made)


def test_an_unusable_folder_costs_only_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Where the cache cannot be written, planning goes on with a warning."""
    file = tmp_path / "file"
    file.write_text("in the way")
    for folder in (file, file / "below", Path("/proc/nowhere")):
        monkeypatch.setenv("COCAP_OPT_CACHE", str(folder))
        caplog.clear()
        with caplog.at_level(logging.WARNING):
            assert len(tables(tiny())) == 1
        assert "cannot write" in caplog.text


def test_a_read_only_folder_costs_only_time(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A folder that may be read but not written serves what it has and fails at nothing."""
    expected = tables(tiny())

    def refused(*_: object, **__: object) -> tuple[int, str]:
        raise PermissionError(13, "Permission denied")  # root would be allowed to write

    monkeypatch.setattr("os.open", refused)
    assert same(tables(tiny()), expected)
    assert not caplog.records
    tables(tiny().replace(horizon=1))
    assert "cannot write" in caplog.text


NO_TABLE: dict[str, Callable[[], bytes]] = {
    "text": lambda: b"not an archive",
    "nothing": lambda: b"",
    "an array": lambda: saved(np.save, np.arange(3)),
    "an archive without arrays": lambda: saved(np.savez),
    "an archive of other arrays": lambda: saved(np.savez, np.arange(3)),
    "half an archive": lambda: saved(np.savez, np.arange(300))[:999],
    "a pickle": lambda: saved(np.save, np.array([{}])),
}


def saved(save: Callable[..., None], *arrays: Any) -> bytes:
    """What a function of NumPy writes."""
    body = io.BytesIO()
    save(body, *arrays)
    return body.getvalue()


@pytest.mark.parametrize("kind", NO_TABLE)
def test_a_file_that_is_no_table_is_made_again(
    kind: str, folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """What is no table counts as absent, though its digest fits."""
    expected = tables(tiny())
    (path,) = stored(folder)
    body = NO_TABLE[kind]()
    path.write_bytes(hashlib.sha256(body).digest() + body)
    assert same(tables(tiny()), expected)
    assert str(path) in caplog.text
    assert cache._read(path) is not None  # mended


@pytest.mark.long
def test_a_pipe_in_a_files_place_is_not_waited_for(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """A pipe under a table's name is neither read, which would hang, nor replaced."""
    expected = tables(tiny())
    (path,) = stored(folder)
    path.unlink()
    os.mkfifo(path)
    code = "from strategies import tiny; from cocap_opt.model import Model; m = Model(tiny());"
    subprocess.run(
        [sys.executable, "-c", f"{code} m.coverage(m.classes[0])"], check=True, timeout=60,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )  # fmt: skip
    assert path.is_fifo()
    assert same(tables(tiny()), expected)
    assert "cannot write" in caplog.text


def test_a_file_that_cannot_be_read_is_made_again(folder: Path) -> None:
    """A folder in a file's place, or one without permission, does not stop the run."""
    expected = tables(tiny())
    (path,) = stored(folder)
    path.unlink()
    path.mkdir()
    assert same(tables(tiny()), expected)


def test_no_temporary_files_are_left(folder: Path) -> None:
    """After writing there is one file per table and nothing else."""
    tables(tiny())
    tables(tiny().replace(horizon=1))
    assert [path.suffix for path in stored(folder)] == [".coverage"] * 2


def test_plain_coverage_takes_no_table_from_the_cache(folder: Path) -> None:
    """Whoever checks bounds trusts NumPy's way alone: others' tables may be of compiled code."""
    expected = tables(tiny())
    (path,) = stored(folder)
    content = path.read_bytes()
    wrong = expected[0]._replace(pixels=2 * expected[0].pixels)
    cache._write(path, (wrong, 1.0))
    assert same(tables(tiny()), [wrong])
    model = Model(tiny(), plain=True)
    assert same([model.coverage(model.classes[0])], expected)
    assert [*stored(folder)] == [path] and path.read_bytes() != content


@pytest.mark.slow
def test_a_table_is_not_copied_to_be_written(folder: Path) -> None:
    """In memory there is a piece of it at a time, but not all of it."""
    n = 4_000_000
    (good,) = tables(tiny())
    large = good._replace(view_sums=np.arange(n), pixels=np.ones(n))
    path = folder / "key.coverage"
    tracemalloc.start()
    cache._write(path, (large, 1.0))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < large.pixels.nbytes
    assert path.stat().st_size > 16 * n
    found = cache._read(path)
    assert found is not None and same([found[0]], [large])


def test_what_cannot_be_written_whole_leaves_no_file(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Wherever memory ends, or Ctrl-C comes."""
    (good,) = tables(tiny())
    before, savez = set(stored(folder)), np.savez

    def fails(file: Any, **arrays: Any) -> None:
        savez(file, **arrays)
        raise MemoryError

    monkeypatch.setattr(np, "savez", fails)
    with pytest.raises(MemoryError):
        cache._write(folder / "key.coverage", (good, 1.0))
    assert set(stored(folder)) == before


def test_no_pickle_is_ever_loaded(folder: Path) -> None:
    """A cache file with pickled objects in it, though its digest fits, is not unpickled."""

    class Trap:
        def __reduce__(self) -> tuple[Any, ...]:
            return os.mkdir, (str(folder / "sprung"),)

    good = tables(tiny())[0]
    trap = np.array([Trap()], dtype=object)
    cache._write(folder / "key.coverage", (good._replace(nodes=trap), 1.0))
    for path in folder.glob("sprung"):
        path.rmdir()
    table, seconds = TableCache.of_user().table("key", lambda: (good, 2.0))
    assert same([table], [good]) and seconds == 2.0
    assert not (folder / "sprung").exists()


def test_where_the_cache_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """COCAP_OPT_CACHE names the folder; else it is in XDG_CACHE_HOME, else in ~/.cache."""
    monkeypatch.setenv("COCAP_OPT_CACHE", "/a/b")
    assert TableCache.of_user().folder == Path("/a/b")
    monkeypatch.setenv("COCAP_OPT_CACHE", "")
    monkeypatch.setenv("XDG_CACHE_HOME", "/c")
    assert TableCache.of_user().folder == Path("/c/cocap-opt")
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", "/home/somebody")
    assert TableCache.of_user().folder == Path("/home/somebody/.cache/cocap-opt")


def test_without_a_home_there_is_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    """A user without a home folder, as in some containers, plans without a cache."""
    for variable in ("COCAP_OPT_CACHE", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr("pwd.getpwuid", lambda _: {}["no such user"])  # a KeyError, as there
    assert TableCache.of_user().folder is None
    assert len(tables(tiny())) == 1
    monkeypatch.setenv("XDG_CACHE_HOME", "/c")
    assert TableCache.of_user().folder == Path("/c/cocap-opt")


def test_classes_that_see_alike_share_a_table(folder: Path) -> None:
    """Robots that differ in their goals only are two classes with one table."""
    first, second = tiny().robots
    problem = tiny().replace(robots=(first.replace(goal=(0, 1)), second))
    model = Model(problem)
    assert len(model.classes) == 2
    assert model.coverage(model.classes[0]) is model.coverage(model.classes[1])
    assert len(stored(folder)) == 1


def test_cache_of_the_session_is_not_the_users() -> None:
    """No test reads or fills the user's own cache."""
    assert TableCache.of_user().folder != Path.home() / ".cache" / "cocap-opt"
    assert "pytest" in str(TableCache.of_user().folder)
