"""A new format is one file and one line in a dict: of scenes, of meshes, and of tracks."""

import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from cocap_opt import scenarios
from cocap_opt.files.documents import problem_digest
from cocap_opt.problem import Problem
from cocap_opt.scenarios import meshes, tracks
from cocap_opt.scenarios.earth.place import MapProjection
from cocap_opt.scenarios.meshes.faces import MeshFaces
from cocap_opt.scenarios.recipe import read
from cocap_opt.scenarios.tracks.table import Form, TrackTable

RECIPE = """
steps = 3
map = {{ size = [20, 20] }}
{part}
[[drones]]
starts = [{{ x = 1.5, y = 1.5 }}]
"""


def recipe(folder: Path, part: str) -> Problem:
    """The scene of a recipe with this part."""
    path = folder / "scene.toml"
    path.write_text(RECIPE.format(part=part))
    return read(path)


def test_a_scene_format_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A module with `read`, and one entry in `FORMATS`, make a file a scene."""

    def read_named(path: Path, seed: int) -> Problem:
        return scenarios.SCENES[path.read_text().strip()](seed)

    module: Any = ModuleType("cocap_opt.scenarios.formats.named")
    module.read = read_named
    monkeypatch.setitem(sys.modules, module.__name__, module)
    line = scenarios.FORMATS["movingai"]._replace(
        description="*.named, the name of a built-in scene",
        scenes=scenarios.FORMATS["movingai"].scenes._replace(suffixes=(".named",)),
        reader="formats.named",
        options=scenarios.FORMATS["recipe"].options,
    )
    path = tmp_path / "corridor.named"
    path.write_text("corridor")
    with pytest.raises(ValueError, match="unknown kind of file"):
        scenarios.load_scene(str(path))
    monkeypatch.setattr(scenarios, "FORMATS", {**scenarios.FORMATS, "named": line})
    found = scenarios.load_scene(str(path), 1)
    assert problem_digest(found) == problem_digest(scenarios.SCENES["corridor"](1))
    assert scenarios.has_seed(str(path))


def test_a_mesh_format_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A function that returns `MeshFaces`, and one entry in `FORMATS`, make a file a mesh."""

    def read_corners(path: Path) -> MeshFaces:
        sides = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        return MeshFaces.of_triangles(np.loadtxt(path), sides)

    (tmp_path / "tent.corners").write_text("5 5 0\n8 5 0\n5 8 0\n5 5 3\n")
    part = '[[mesh]]\nfile = "tent.corners"\n'
    with pytest.raises(ValueError, match=r"must be named \.obj"):
        recipe(tmp_path, part)
    monkeypatch.setitem(meshes.FORMATS, ".corners", (read_corners, "z", None))
    (mesh,) = recipe(tmp_path, part).meshes
    assert (len(mesh.triangles), mesh.is_solid) == (4, True)


def test_a_track_format_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A function that returns a `TrackTable`, and one entry in `READERS`, make a file tracks."""

    def read_points(path: Path, form: Form, projection: MapProjection) -> TrackTable:
        form.require_left_out("points", "fps")
        x, y = np.loadtxt(path).T
        seconds = np.arange(len(x), dtype=float)
        values = {"id": np.ones(len(x)), "time": seconds, "x": x, "y": y}
        return TrackTable.of(values, None, lambda row: f"line {row + 1}", "m", None)

    (tmp_path / "walk.points").write_text("5 5\n6 5\n7 5\n8 6\n")
    part = '[[tracks]]\nfile = "walk.points"\ncount = 1\n'
    with pytest.raises(ValueError, match="columns: must be given"):
        recipe(tmp_path, part)
    monkeypatch.setitem(tracks.READERS, ".points", read_points)
    (actor,) = recipe(tmp_path, part).actors
    assert actor.poses[:, :2].tolist() == [[5, 5], [6, 5], [7, 5], [8, 6]]
    with pytest.raises(ValueError, match="fps: must be left out for points"):
        recipe(tmp_path, part + "fps = 2\n")
