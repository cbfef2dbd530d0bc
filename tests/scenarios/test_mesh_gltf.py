"""glTF 2.0: all that a scene places is read, or the file is refused with the true reason."""

import json
import math
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from glb import Model, model

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.meshes import MeshTable
from cocap_opt.world.workspace import Mesh

Change = Callable[[Model], Any]

BOX = [(x, y, z) for z in (0, 8) for x, y in ((5, 5), (10, 5), (10, 10), (5, 10))]
SIDES = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
TRIANGLES = [[side[k] for k in ks] for side in SIDES for ks in ((0, 1, 2), (0, 2, 3))]
STRIP = [2, 3, 6, 7, 4, 3, 0, 2, 1, 6, 5, 4, 1, 0]
DRACO = "KHR_draco_mesh_compression"


def shape(folder: Path, content: str | bytes, name: str = "a.glb") -> Mesh:
    """The mesh of a file, its axes as they are in it."""
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return MeshTable(file=path.name, up="z").mesh(folder)


def volume(mesh: Mesh) -> float:
    """The volume that a surface encloses (m3), negative if it is inside out."""
    a, b, c = np.moveaxis(mesh.corners, 1, 0)
    return float((a * np.cross(b, c)).sum() / 6)


def bounds(mesh: Mesh) -> tuple[list[float], list[float]]:
    """The lowest and the highest coordinates."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return low.round(6).tolist(), high.round(6).tolist()


def require_box(mesh: Mesh) -> None:
    """Asserts that a mesh is the box of 5 x 5 x 8 m."""
    assert bounds(mesh) == ([5, 5, 0], [10, 10, 8])
    assert (len(mesh.surface), mesh.is_solid) == (12, True)
    assert volume(mesh) == pytest.approx(200)


# -- numbers ------------------------------------------------------------------------------


@pytest.mark.parametrize("variant", ["", "interleaved", "sparse", "not indexed"])
def test_numbers_are_read_however_they_are_kept(tmp_path: Path, variant: str) -> None:
    """Views with strides and sparse values, as GLB, as text with its bytes in it or beside it."""
    made = model(BOX, TRIANGLES, variant)
    require_box(shape(tmp_path, made.glb()))
    require_box(shape(tmp_path, made.gltf(), "a.gltf"))
    (tmp_path / "a b.bin").write_bytes(made.bytes)
    require_box(shape(tmp_path, made.gltf("a%20b.bin"), "b.gltf"))


def test_sparse_values_need_no_others(tmp_path: Path) -> None:
    """Without a view the rest is zero."""
    made = model(BOX, TRIANGLES)
    part = made.json["accessors"][0]
    part["sparse"] = {
        "count": 8,
        "indices": {"bufferView": made.view(bytes(range(8))), "componentType": 5121},
        "values": {"bufferView": part.pop("bufferView")},
    }
    require_box(shape(tmp_path, made.glb()))


@pytest.mark.parametrize(("code", "most"), [("b", 127), ("B", 255), ("h", 32767), ("H", 65535)])
@pytest.mark.parametrize("normalized", [True, False])
def test_quantized_positions_are_read(
    tmp_path: Path, code: str, most: int, normalized: bool
) -> None:
    """Integers, as they are or as shares of the largest, which the node scales and shifts."""
    made = Model()
    values = [[most * (x > 5), most * (y > 5), most * (z > 0)] for x, y, z in BOX]
    position = made.accessor(values, code, normalized=normalized)
    made.primitive(position, made.accessor(np.ravel(TRIANGLES), "B"))
    share = 1 if normalized else 1 / most
    made.json["nodes"][0] |= {"translation": [5, 5, 0], "scale": [5 * share, 5 * share, 8 * share]}
    with pytest.raises(ProblemError, match=r"accessors\[0\]: positions must be of floats"):
        shape(tmp_path, made.glb())
    made.json["extensionsRequired"] = made.json["extensionsUsed"] = ["KHR_mesh_quantization"]
    require_box(shape(tmp_path, made.glb()))


@pytest.mark.parametrize("code", ["B", "H", "I"])
def test_strips_and_fans_are_read(tmp_path: Path, code: str) -> None:
    """Each second triangle of a strip is turned; a fan has one corner in all."""
    made = Model()
    position = made.accessor(BOX)
    made.primitive(position, made.accessor(STRIP, code), mode=5)
    require_box(shape(tmp_path, made.glb()))
    made = Model()
    position = made.accessor(BOX)
    for side in SIDES:
        made.primitive(position, made.accessor(side, code), mode=6)
    require_box(shape(tmp_path, made.glb()))
    made = Model()
    made.primitive(made.accessor(np.array(BOX)[STRIP]), mode=5)
    require_box(shape(tmp_path, made.glb()))


def test_morph_targets_move_vertices_as_far_as_they_weigh(tmp_path: Path) -> None:
    """The weights of a node are before those of its mesh; without any nothing moves."""
    made = model([(x, y, z / 2) for x, y, z in BOX], TRIANGLES)
    target = made.accessor([(0, 0, z) for _, _, z in BOX])
    made.json["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": target}]
    assert bounds(shape(tmp_path, made.glb()))[1] == [10, 10, 4]
    made.json["meshes"][0]["weights"] = [0.5]
    require_box(shape(tmp_path, made.glb()))
    made.json["nodes"][0]["weights"] = [1]
    assert bounds(shape(tmp_path, made.glb()))[1] == [10, 10, 12]


# -- nodes --------------------------------------------------------------------------------


def test_nodes_place_a_mesh_as_often_as_they_name_it(tmp_path: Path) -> None:
    """By matrices, or by scale, rotation and translation, one below the other."""
    made = model(BOX, TRIANGLES)
    half = math.sqrt(0.5)
    made.json["scenes"] = [{"nodes": [0, 1]}]
    made.json["nodes"] = [
        {"mesh": 0},
        {"translation": [100, 0, 0], "children": [2, 3]},
        {"mesh": 0, "rotation": [0, 0, half, half]},
        {"mesh": 0, "matrix": [2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 0, 0, 50, 1]},
    ]
    mesh = shape(tmp_path, made.glb())
    assert len(mesh.triangles) == 36
    assert volume(mesh) == pytest.approx(200 * (1 + 1 + 8))
    assert bounds(mesh) == ([5, 5, 0], [120, 20, 66])
    low = mesh.vertices[:, 0].round(6)
    assert sorted(set(low.tolist())) == [5, 10, 90, 95, 110, 120]


def test_a_mirrored_node_is_not_inside_out(tmp_path: Path) -> None:
    """A negative scale turns triangles round, which are turned back."""
    made = model(BOX, TRIANGLES)
    made.json["nodes"][0]["scale"] = [-1, 1, 1]
    mesh = shape(tmp_path, made.glb())
    assert bounds(mesh) == ([-10, 5, 0], [-5, 10, 8])
    assert volume(mesh) == pytest.approx(200)


@pytest.mark.parametrize("required", [True, False])
def test_instances_are_read(tmp_path: Path, required: bool) -> None:
    """EXT_mesh_gpu_instancing places a mesh many times, required or not."""
    made = model(BOX, TRIANGLES)
    name = "EXT_mesh_gpu_instancing"
    attributes = {
        "TRANSLATION": made.accessor([(0, 0, 0), (20, 0, 0), (0, 30, 0)]),
        "ROTATION": made.accessor([(0, 0, 0, 127)] * 3, "b", normalized=True),
        "SCALE": made.accessor([(1, 1, 1), (1, 1, 1), (1, 1, 2)]),
    }
    made.json["nodes"][0]["extensions"] = {name: {"attributes": attributes}}
    made.json["extensionsUsed"] = [name]
    if required:
        made.json["extensionsRequired"] = [name]
    mesh = shape(tmp_path, made.glb())
    assert volume(mesh) == pytest.approx(800)
    assert bounds(mesh) == ([5, 5, 0], [30, 40, 16])


@pytest.mark.slow
def test_instances_without_end_are_refused(tmp_path: Path) -> None:
    """A file of a kilobyte may declare millions, of which none is made."""
    made = model(BOX, TRIANGLES)
    for count, words in (
        (1_000_001, "instances, not 1000001"),
        (90_000, "triangles .*not 1080000"),
    ):
        made.json["accessors"].append({
            "componentType": 5126, "type": "VEC3", "count": count,
            "sparse": {
                "count": 1,
                "indices": {"bufferView": made.view(bytes(1)), "componentType": 5121},
                "values": {"bufferView": made.view(bytes(12))},
            },
        })  # fmt: skip
        moves = {"attributes": {"TRANSLATION": len(made.json["accessors"]) - 1}}
        made.json["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": moves}
        with pytest.raises(ProblemError, match=f"must have at most 1000000 {words}"):
            shape(tmp_path, made.glb())


def test_a_hidden_node_stands_in_the_scene_and_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Better a house too many than one too few."""
    made = model(BOX, TRIANGLES)
    made.json["nodes"][0]["extensions"] = {"KHR_node_visibility": {"visible": False}}
    require_box(shape(tmp_path, made.glb()))
    assert "nodes[0] is hidden by KHR_node_visibility" in caplog.text


def test_the_scene_that_is_named_is_read(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """What only another scene has is left out and said; without a name there must be one scene."""
    made = model(BOX, TRIANGLES)
    made.json |= {"scene": 1, "scenes": [{"nodes": [1]}, {"nodes": [0]}]}
    made.json["nodes"].append({"mesh": 1})
    made.json["meshes"].append({"primitives": []})
    require_box(shape(tmp_path, made.glb()))
    assert "1 of 2 meshes are in no node of the scene and are left out" in caplog.text
    del made.json["scene"]
    with pytest.raises(ProblemError, match="scene: must name one of the 2 scenes"):
        shape(tmp_path, made.glb())
    del made.json["scenes"]
    require_box(shape(tmp_path, made.glb()))


def test_lines_and_points_of_gltf_are_left_out_and_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """They are no surfaces; a file of nothing else is refused."""
    made = model(BOX, TRIANGLES)
    made.primitive(0, mode=0)
    made.primitive(0, mode=3)
    require_box(shape(tmp_path, made.glb()))
    assert "1 primitives of points are not surfaces" in caplog.text
    assert "1 primitives of lines are not surfaces" in caplog.text
    del made.json["meshes"][0]["primitives"][0]
    with pytest.raises(ProblemError, match="must contain at least one triangle"):
        shape(tmp_path, made.glb())


# -- what is refused ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "name",
    ["KHR_materials_unlit", "KHR_texture_transform", "KHR_lights_punctual", "EXT_texture_webp"],
)
def test_extensions_of_materials_change_no_geometry(tmp_path: Path, name: str) -> None:
    """They are fine, required or not."""
    made = model(BOX, TRIANGLES)
    made.json["extensionsRequired"] = made.json["extensionsUsed"] = [name]
    made.json["meshes"][0]["primitives"][0]["extensions"] = {name: {}}
    require_box(shape(tmp_path, made.glb()))


@pytest.mark.parametrize(
    "name", [DRACO, "EXT_meshopt_compression", "KHR_meshopt_compression", "ACME_of_tomorrow"]
)
def test_required_extensions_that_are_not_known_are_named(tmp_path: Path, name: str) -> None:
    """Whatever a file says cannot be read without it is not read without it."""
    made = model(BOX, TRIANGLES)
    made.json["extensionsRequired"] = [name]
    with pytest.raises(ProblemError, match=f"needs {name}, .*`gltf-transform cp OLD.glb NEW.glb`"):
        shape(tmp_path, made.glb())


def test_draco_is_named_where_it_is_only_used(tmp_path: Path) -> None:
    """Numbers that only the extension has are missed; those that are there as well are read."""
    made = model(BOX, TRIANGLES)
    part = made.json["meshes"][0]["primitives"][0]
    part["extensions"] = {DRACO: {"bufferView": 0, "attributes": {"POSITION": 0}}}
    made.json["extensionsUsed"] = [DRACO]
    require_box(shape(tmp_path, made.glb()))
    del made.json["accessors"][0]["bufferView"]
    with pytest.raises(ProblemError, match=f"needs {DRACO}"):
        shape(tmp_path, made.glb())


def test_views_in_meshopt_are_named(tmp_path: Path) -> None:
    """A view may be compressed though the file does not require the extension."""
    made = model(BOX, TRIANGLES)
    made.json["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {"buffer": 0}}
    with pytest.raises(ProblemError, match="needs EXT_meshopt_compression"):
        shape(tmp_path, made.glb())


def _first(made: Model, **fields: Any) -> None:
    made.json["accessors"][0] |= fields


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: m.json.update(asset={"version": "1.0"}), r"asset\.version: must be 2\.0, not 1"),
        (lambda m: m.json.update(asset={"version": "2.0", "minVersion": "2.1"}), r"not 2\.1"),
        (lambda m: _first(m, count=9), r"accessors\[0\]: must end within the 96 bytes .* at 108"),
        (lambda m: _first(m, byteOffset=4), r"accessors\[0\]: must end within the 96 bytes"),
        (lambda m: _first(m, type="VEC4"), r"accessors\[0\]: must be VEC3 of a component type"),
        (lambda m: _first(m, componentType=5130), r"positions must be of floats"),
        (lambda m: _first(m, bufferView=7), r"bufferViews\[7\]: is used, but the file has 2"),
        (lambda m: m.json["accessors"][0].pop("bufferView"), r"must have a bufferView or sparse"),
        (lambda m: m.json["accessors"][1].update(componentType=5126), r"of unsigned integers"),
        (lambda m: m.json["bufferViews"][1].update(byteLength=99), r"bufferViews\[1\]: must end"),
        (lambda m: m.json["bufferViews"][0].update(byteStride=8), r"accessors\[0\]: must end"),
        (lambda m: m.json["buffers"][0].update(byteLength=999), r"buffers\[0\]: must have 999 byt"),
        (lambda m: m.json["buffers"][0].update(uri="no.bin"), r"no file no\.bin beside it"),
        (lambda m: m.json["buffers"][0].update(uri="../a.bin"), r"no file \.\./a\.bin beside it"),
        (lambda m: m.json["buffers"][0].update(uri="a%00b"), r"no file a%00b beside it"),
        (lambda m: m.json["buffers"][0].update(uri="a\0b"), r"no file a.b beside it"),
        (lambda m: m.json["buffers"][0].update(uri="a" * 5000), r"cannot be read"),
        (lambda m: m.json["buffers"][0].update(uri="data:x;base64,%"), r"its bytes in base64"),
        (lambda m: m.json["nodes"][0].update(skin=0), r"nodes\[0\]\.skin: bones deform this mesh"),
        (lambda m: m.json["nodes"][0].update(children=[0]), r"nodes\[0\]: must have one parent"),
        (lambda m: m.json["nodes"][0].update(children=[3]), r"nodes\[3\]: is used"),
        (lambda m: m.json["nodes"][0].update(rotation=[0] * 4), r"nodes\[0\]\.rotation: must be a"),
        (lambda m: m.json["nodes"][0].update(matrix=[1]), r"nodes\[0\]\.matrix"),
        (lambda m: m.json["nodes"][0].update(matrix=[*np.diag([1, 1, 1, 2]).ravel().tolist()]),
         r"nodes\[0\]\.matrix: must rotate, .* be 0 0 0 1, not 0 0 0 2"),
        (lambda m: m.json["nodes"][0].update(matrix=[1, 0, 0, 2, *[0, 1, 0, 0, 0] * 2, 0, 1]),
         r"nodes\[0\]\.matrix: must rotate, .* be 0 0 0 1, not 2 0 0 1"),
        (lambda m: m.json["nodes"][0].update(scale=[1e300] * 3), r"vertices: must be"),
        (lambda m: m.json["nodes"][0].pop("mesh"), r"must contain at least one triangle"),
        (lambda m: m.json["meshes"][0]["primitives"][0].update(mode=7), r"primitives\[0\]\.mode"),
        (lambda m: m.json["meshes"][0]["primitives"][0].update(attributes={}), r"POSITION"),
        (lambda m: m.json["meshes"][0]["primitives"][0].pop("indices"), r"must have whole"),
        (lambda m: m.json.update(extensions={"CESIUM_RTC": {}}), r"needs CESIUM_RTC"),
        (lambda m: m.json["nodes"][0].update(extensions={"EXT_mesh_gpu_instancing": {}}),
         r"must have attributes that name accessors"),
    ],
)  # fmt: skip
def test_a_gltf_that_cannot_be_read_whole_is_refused(
    tmp_path: Path, change: Change, words: str
) -> None:
    """Bytes, views, accessors and nodes are those that the file declares."""
    made = model(BOX, TRIANGLES)
    change(made)
    with pytest.raises(ProblemError, match=words) as error:
        shape(tmp_path, made.glb())
    assert "\n" not in str(error.value)


def test_numbers_of_vertices_that_are_not_there_are_refused(tmp_path: Path) -> None:
    """They name vertices of their own primitive, not of the next."""
    made = model(BOX, [*TRIANGLES, [0, 1, 8]])
    made.primitive(0, 1)
    with pytest.raises(ProblemError, match=r"primitives\[0\]\.indices: must name .* 0\.\.7, not 8"):
        shape(tmp_path, made.glb())


@pytest.mark.parametrize(
    ("indices", "words"),
    [([3, 3], "must increase"), ([3, 8], "and be below 8"), ([7, 3], "must increase")],
)
def test_sparse_numbers_rise_and_are_there(tmp_path: Path, indices: list[int], words: str) -> None:
    """Otherwise values would replace each other, or none."""
    made = model(BOX, TRIANGLES)
    made.json["accessors"][0]["sparse"] = {
        "count": 2,
        "indices": {"bufferView": made.view(bytes(indices)), "componentType": 5121},
        "values": {"bufferView": made.view(bytes(24))},
    }
    with pytest.raises(ProblemError, match=words):
        shape(tmp_path, made.glb())


def test_a_glb_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    """Its header declares its length, each chunk its own."""
    content = model(BOX, TRIANGLES).glb()
    for length in (6, 30, len(content) - 1):
        with pytest.raises(ProblemError, match="it is truncated"):
            shape(tmp_path, content[:length])
    shorter = content[:8] + struct.pack("<I", len(content) - 4) + content[12:]
    with pytest.raises(ProblemError, match="it is truncated"):
        shape(tmp_path, shorter)
    with pytest.raises(ProblemError, match=r"asset.version: must be 2\.0, not 1"):
        shape(tmp_path, content[:4] + struct.pack("<I", 1) + content[8:])


def test_buffers_are_regular_files_beside_the_mesh(tmp_path: Path) -> None:
    """Nobody waits for a pipe, and nothing outside the folder is read."""
    made = model(BOX, TRIANGLES)
    inner = tmp_path / "inner"
    inner.mkdir()
    os.mkfifo(inner / "pipe.bin")
    (tmp_path / "out.bin").write_bytes(made.bytes)
    for uri in ("pipe.bin", "../out.bin", (tmp_path / "out.bin").as_uri(), "%2E%2E/out.bin"):
        with pytest.raises(ProblemError, match=r"no file .* beside it"):
            shape(inner, made.gltf(uri), "a.gltf")


# -- a second opinion ---------------------------------------------------------------------


def test_another_reader_agrees(tmp_path: Path) -> None:
    """What trimesh writes and reads is read the same: nodes, several meshes, all formats."""
    scene = trimesh.Scene()
    for k, part in enumerate(
        (
            trimesh.creation.box((2, 3, 4)),
            trimesh.creation.icosphere(2),
            trimesh.creation.torus(3, 1),
        )
    ):
        place = trimesh.transformations.rotation_matrix(0.3 + k, (1, 2, 3))
        place[:3, 3] = (9 * k, 0, 2)
        scene.add_geometry(part, transform=place)
    for suffix in ("glb", "obj", "ply", "stl", "off"):
        path = tmp_path / f"a.{suffix}"
        (scene if suffix == "glb" else scene.to_mesh()).export(path)
        mesh = MeshTable(file=path.name, up="z").mesh(tmp_path)
        other = trimesh.load_mesh(path)
        assert mesh.is_solid
        assert len(mesh.triangles) == len(other.faces)
        assert volume(mesh) == pytest.approx(other.volume, rel=1e-5)
        np.testing.assert_allclose(bounds(mesh), other.bounds, atol=1e-5)


def test_json_that_is_no_gltf_is_refused(tmp_path: Path) -> None:
    """The field that is missing is named."""
    with pytest.raises(ProblemError, match="asset"):
        shape(tmp_path, json.dumps({"type": "FeatureCollection"}), "a.gltf")
