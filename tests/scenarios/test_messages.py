"""Damaged files of every kind are refused in this project's words, never in those of a library."""

import json
from pathlib import Path

import numpy as np
import pytest
from scene_files import SEQUENCE

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.text import naming

FLAT = "steps = 4\n[map]\nsize = [9, 9]\n[[drones]]\nstarts = [{ x = 1.5, y = 1.5 }]\n"
WALLS = FLAT + '[[walls]]\nfile = "{}"\nheight = 2.0\npolygons = "obstacles"\n'
MESH = FLAT + '[[mesh]]\nfile = "{}"\n'
POLYGON = json.dumps({"type": "Polygon", "coordinates": [[[1, 1], [2, 1], [2, 2], [1, 1]]]})
PLY = "ply\nformat ascii 1.0\nelement vertex 1\nproperty nothing x\nend_header\n1\n"


@pytest.mark.parametrize(
    ("scene", "name", "content", "words"),
    [
        (FLAT.replace("[9, 9]", "[9, 9"), "", "", "line 4, column 1: must be TOML; a bracket"),
        (FLAT.replace("9]", "9]\nsize = [1, 1]"), "", "", "line 4.* each key and each table must"),
        (FLAT + "[map]\n", "", "", "line 6, column 5: each key and each table must be given once"),
        (FLAT + "x = [", "", "", "ends before its TOML is complete"),
        ("\udcff\udcfe", "", "", "must be a text file in UTF-8; it has only a byte order mark"),
        (FLAT + "# \udcff", "", "", "must be a text file in UTF-8, but byte 76, in line 6, is not"),
        (WALLS, "a.geojson", POLYGON[:-1] + ",}", r"line 1, byte \d+: must be JSON; a bracket"),
        (WALLS, "a.geojson", POLYGON.replace("[1, 1]]", "[1, 3]]"), r"GeoJSON: .*0\]: must end at"),
        (WALLS, "a.geojson", POLYGON.replace("[1, 1]", "[1]"), r"GeoJSON: .* list of length >= 2"),
        (WALLS, "a.geojson",
         '{"type": "Feature", "properties": {"height": 1e400}, "geometry": null}',
         r"GeoJSON: properties\[...\]: must be a number within \+-1.8e308"),
        (WALLS, "a.geojson", "[" * 1_000_000, "must not be nested so deeply"),
        (WALLS, "a.wkt", "POLYGON ((0 0, a 0))", r"cannot be read as WKT, such as POLYG"),
        (WALLS.replace('polygons = "obstacles"', ""), "a.json", '{"a": {"walkable": [[0, 1e999]]}}',
         r"walkable\[0\]\[1\]: must be a number within \+-1.8e308; ground plans are"),
        (MESH, "a.ply", PLY, "line 4: must be a line of PLY's header"),
        (MESH, "a.obj", "v 1 2 3\nf 1 2 x\n", "line 2: a corner must be written like 3"),
        (MESH, "a.glb", "glTF", "ends within the header of its GLB"),
    ],
)  # fmt: skip
def test_damage_is_told_in_plain_words(
    tmp_path: Path, scene: str, name: str, content: str, words: str
) -> None:
    """The message names the file, the place where it is known, and what is allowed."""
    recipe = tmp_path / "scene.toml"
    text = scene.replace("{}", name)
    recipe.write_bytes(text.encode(errors="surrogateescape"))
    if name:
        (tmp_path / name).write_text(content)
    with pytest.raises((ProblemError, FileError), match=rf"{name or 'scene.toml'}: .*{words}"):
        load_scene(str(recipe))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("{horizon: 3", "{horizon: 3]", r"seq.yaml: line 3, column \d+: must be YAML; a bracket"),
        ("horizon: 3", "horizon: !!set 3", "seq.yaml: line 3, column .*: must be a plain value"),
        ("world:", "\x07world:", "seq.yaml: must be YAML, without control characters"),
        ("world:", "1:", r"seq.yaml: planner: its keys must be text"),
        ("", "", r"map.npy: must be a .npy array of numbers, as numpy.save writes it; it is damag"),
    ],
)
def test_damaged_sequences_are_told_in_plain_words(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    """PyYAML's and NumPy's own words are not for those who have the file."""
    (tmp_path / "seq.yaml").write_text(SEQUENCE.replace(old, new, 1))
    np.save(tmp_path / "map.npy", np.zeros((6, 4)))
    content = (tmp_path / "map.npy").read_bytes()
    (tmp_path / "map.npy").write_bytes(content[:-9])
    with pytest.raises((ProblemError, FileError), match=words):
        load_scene(str(tmp_path))


def test_a_field_within_a_field_is_a_path(tmp_path: Path) -> None:
    """Fields are joined by points; the name of a file is none, though it has one."""
    words = r"^drones\[0\]\.starts\[1\]\.x: must be above 0$"
    with pytest.raises(ProblemError, match=words), naming("drones[0]"), naming("starts[1]"):
        raise ProblemError("x: must be above 0")
    words, path = r"^tracks\[0\]: .*people\.csv: fps: must be given$", tmp_path / "people.csv"
    with pytest.raises(ProblemError, match=words), naming("tracks[0]"), naming(path):
        raise ProblemError("fps: must be given")
    words = "^map: the system beside it: crs: must be known$"
    with pytest.raises(ProblemError, match=words), naming("map"), naming("the system beside it"):
        raise ProblemError("crs: must be known")
