"""Reader of glTF 2.0: nodes place meshes, whose primitives are triangles, strips or fans.

Source: glTF 2.0 Specification, Khronos Group, sections 3.5 to 3.7; EXT_mesh_gpu_instancing and
KHR_mesh_quantization of its registry of extensions.
"""

import logging
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np
from msgspec import Meta

from cocap_opt.data import FloatArray, IntArray, ProblemError, require
from cocap_opt.files.messages import in_words
from cocap_opt.files.strict_json import decode_json
from cocap_opt.scenarios.meshes.accessors import (
    QUANTIZED,
    Accessor,
    Accessors,
    Buffer,
    BufferView,
    Index,
    item,
    needs,
)
from cocap_opt.scenarios.meshes.faces import MeshFaces, fan, strip
from cocap_opt.world.workspace import MOST_TRIANGLES

INSTANCED = "EXT_mesh_gpu_instancing"
_HIDDEN = "KHR_node_visibility"
# Prefixes of required extensions that do not affect the triangles and their places.
_NO_GEOMETRY = (
    "KHR_materials_", "KHR_texture_", "KHR_lights_", "KHR_xmp", "KHR_techniques_", "KHR_animation_",
    "KHR_audio", "EXT_materials_", "EXT_texture_", "EXT_lights_", "EXT_structural_metadata",
    "EXT_mesh_features", "EXT_instance_features", "MSFT_texture_", "MSFT_packing_",
    "ADOBE_materials_", "CESIUM_primitive_outline", "FB_geometry_metadata", "GODOT_single_root",
)  # fmt: skip
_PLACING = ("CESIUM_RTC",)  # these move everything, although files rarely declare them as required

_POINTS, _LINES, _TRIANGLES, _STRIP, _FAN = 0, (1, 2, 3), 4, 5, 6

_log = logging.getLogger(__name__)


class _Asset(msgspec.Struct, rename="camel"):
    version: str
    min_version: str | None = None


class _Versioned(msgspec.Struct, rename="camel"):
    asset: _Asset


class _Roots(msgspec.Struct, rename="camel"):
    nodes: list[Index] = []


class _GltfNode(msgspec.Struct, rename="camel"):
    mesh: Index | None = None
    children: list[Index] = []
    matrix: Annotated[list[float], Meta(min_length=16, max_length=16)] | None = None
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    skin: Index | None = None
    weights: list[float] | None = None
    extensions: dict[str, Any] = {}


class _Primitive(msgspec.Struct, rename="camel"):
    attributes: dict[str, Index]
    indices: Index | None = None
    mode: Annotated[int, Meta(ge=0, le=6)] = _TRIANGLES
    targets: list[dict[str, Index]] = []
    extensions: dict[str, Any] = {}


class _Mesh(msgspec.Struct, rename="camel"):
    primitives: list[_Primitive]
    weights: list[float] = []


class _Model(msgspec.Struct, rename="camel"):
    scene: Index | None = None
    scenes: list[_Roots] = []
    nodes: list[_GltfNode] = []
    meshes: list[_Mesh] = []
    accessors: list[Accessor] = []
    buffer_views: list[BufferView] = []
    buffers: list[Buffer] = []
    extensions_used: list[str] = []
    extensions_required: list[str] = []
    extensions: dict[str, Any] = {}


class _Instancing(msgspec.Struct, rename="camel"):
    attributes: dict[str, Index]


def read_gltf(path: Path) -> MeshFaces:
    """Reads all triangles that the scene of a file places, whether it is JSON or GLB.

    Raises
    ------
    ProblemError
        If geometry is in an unsupported extension, if bones deform a mesh, or if buffers, views and
        accessors do not have the declared sizes.
    """
    text, rest = _parts(path.read_bytes())
    model = _decoded(text)
    _require_readable(model)
    reader = _Reader(path, model, rest)
    vertices: list[FloatArray] = [np.zeros((0, 3))]
    triangles: list[IntArray] = [np.zeros((0, 3), dtype=np.int64)]
    count = size = 0
    for node, transform in _placed(model):
        for places, given in reader.meshes(node, transform):
            vertices.append(places)
            triangles.append(given + count)
            count += len(places)
            size += len(given)
            most = f"must be at most {MOST_TRIANGLES:,}, not {size:,} or more"
            require(size <= MOST_TRIANGLES, "triangles", most)
    reader.say_left_out()
    return MeshFaces.of_triangles(np.concatenate(vertices), np.concatenate(triangles))


def _parts(content: bytes) -> tuple[bytes, bytes | None]:
    """Returns the JSON of a file, and the bytes that follow it in a GLB."""
    if content[:4] != b"glTF":
        return content.removeprefix(b"\xef\xbb\xbf"), None
    if len(content) < 20:
        raise ProblemError("ends within the header of its GLB: it is truncated")
    version, length = struct.unpack_from("<II", content, 4)
    if version != 2:
        raise ProblemError(_old(f"{version}.0"))
    if length > len(content):
        raise ProblemError(
            f"must have {length} bytes, as its header says, not {len(content)}: it is truncated"
        )
    chunks: list[tuple[bytes, bytes]] = []
    at = 12
    while at + 8 <= length:
        (size,) = struct.unpack_from("<I", content, at)
        if at + 8 + size > length:
            raise ProblemError("ends within a chunk of its GLB: it is truncated")
        chunks.append((content[at + 4 : at + 8], content[at + 8 : at + 8 + size]))
        at += 8 + size
    if not chunks or chunks[0][0] != b"JSON":
        raise ProblemError("must be a GLB whose first chunk is JSON")
    rest = chunks[1][1] if len(chunks) > 1 and chunks[1][0] == b"BIN\0" else None
    return chunks[0][1], rest


def _decoded(text: bytes) -> _Model:
    try:
        asset = decode_json(text, _Versioned).asset
        for version in (asset.version, asset.min_version or "2.0"):
            if version != "2.0":
                raise ProblemError(_old(version))
        return decode_json(text, _Model)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ProblemError(in_words(error, text, _Model)) from error


def _old(version: str) -> str:
    return (
        f"asset.version: must be 2.0, not {version[:20]}; `gltf-pipeline -i OLD.gltf -o NEW.gltf` "
        "converts version 1.0"
    )


def _require_readable(model: _Model) -> None:
    """Raises ProblemError if the file requires an extension that may change its geometry."""
    placing = [name for name in _PLACING if name in model.extensions]
    for name in (*model.extensions_required, *placing):
        if name not in (QUANTIZED, INSTANCED) and not name.startswith(_NO_GEOMETRY):
            raise ProblemError(needs(name))


def _placed(model: _Model) -> Iterator[tuple[int, FloatArray]]:
    """Yields the nodes of the scene, each with the matrix [4, 4] of its placement."""
    met: set[int] = set()
    ahead = [(index, np.eye(4)) for index in _roots(model)]
    while ahead:
        index, above = ahead.pop()
        node = item(model.nodes, index, "nodes")
        if index in met:
            raise ProblemError(f"nodes[{index}]: must have one parent, and not be below itself")
        met.add(index)
        transform = above @ _own_place(node, index)
        yield index, transform
        ahead += [(child, transform) for child in reversed(node.children)]


def _roots(model: _Model) -> list[int]:
    if model.scene is not None:
        return item(model.scenes, model.scene, "scenes").nodes
    if len(model.scenes) > 1:
        raise ProblemError(
            f"scene: must name one of the {len(model.scenes)} scenes; Blender exports only one"
        )
    if model.scenes:
        return model.scenes[0].nodes
    children = {child for node in model.nodes for child in node.children}
    return [index for index in range(len(model.nodes)) if index not in children]


def _own_place(node: _GltfNode, index: int) -> FloatArray:
    """Returns the matrix [4, 4] of a node relative to its parent."""
    if node.matrix is not None:
        matrix: FloatArray = np.reshape(node.matrix, (4, 4)).T  # stored by columns
        if not np.allclose(matrix[3], (0, 0, 0, 1), rtol=0, atol=1e-6):  # float32 accuracy
            raise ProblemError(
                f"nodes[{index}].matrix: must rotate, scale and translate: its last row must be "
                f"0 0 0 1, not {' '.join(f'{part:g}' for part in matrix[3])}"
            )
        return matrix
    return _transform(node.translation, node.rotation, node.scale, f"nodes[{index}]")


def _transform(translation: Any, rotation: Any, scale: Any, place: str) -> FloatArray:
    """Returns the matrix [4, 4] that scales, rotates by a quaternion x, y, z, w, and translates."""
    length = float(np.linalg.norm(rotation))
    if not length > 0:
        raise ProblemError(f"{place}.rotation: must be a quaternion x, y, z, w, not all 0")
    x, y, z, w = (float(part) / length for part in rotation)
    turned = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    result = np.eye(4)
    result[:3, :3] = turned * np.asarray(scale)
    result[:3, 3] = translation
    return result


class _Reader:
    """Reads the meshes of nodes, and counts drawn primitives that are not surfaces."""

    def __init__(self, path: Path, model: _Model, rest: bytes | None) -> None:
        self._path, self._model = path, model
        self._quantized = QUANTIZED in (*model.extensions_used, *model.extensions_required)
        self._arrays = Accessors(
            model.accessors, model.buffer_views, model.buffers, path.parent, rest
        )
        self._points = self._lines = 0
        self._met: set[int] = set()

    def meshes(self, index: int, transform: FloatArray) -> Iterator[tuple[FloatArray, IntArray]]:
        """Yields vertices [n, 3] and triangles [m, 3] of a node, for each of its instances."""
        node = self._model.nodes[index]
        if node.mesh is None:
            return
        if node.skin is not None:
            raise ProblemError(
                f"nodes[{index}].skin: bones deform this mesh, which is not supported; in Blender, "
                "apply the armature modifier, then export"
            )
        if node.extensions.get(_HIDDEN) == {"visible": False}:
            _log.warning(
                "%s: nodes[%d] is hidden by %s, but is still part of the scene",
                self._path, index, _HIDDEN,
            )  # fmt: skip
        mesh = item(self._model.meshes, node.mesh, "meshes")
        self._met.add(node.mesh)
        weights = mesh.weights if node.weights is None else node.weights
        instances = [transform @ place for place in self._instances(node, index)]
        for k, primitive in enumerate(mesh.primitives):
            place = f"meshes[{node.mesh}].primitives[{k}]"
            if not self._is_surface(primitive):
                continue
            points = self._points_of(primitive, weights, place)
            triangles = self._triangles(primitive, len(points), place)
            if len(triangles) * len(instances) > MOST_TRIANGLES:
                raise ProblemError(
                    f"{place}: must have at most {MOST_TRIANGLES} triangles over all instances, "
                    f"not {len(triangles) * len(instances)}"
                )
            for matrix in instances:
                mirrored = np.linalg.det(matrix[:3, :3]) < 0  # this reverses the triangles
                yield (
                    points @ matrix[:3, :3].T + matrix[:3, 3],
                    triangles[:, ::-1] if mirrored else triangles,
                )

    def say_left_out(self) -> None:
        """Logs what is left out: points and lines, and meshes in no node of the scene."""
        for count, name in ((self._points, "points"), (self._lines, "lines")):
            if count:
                _log.warning(
                    "%s: %d primitives of %s are not surfaces and are left out",
                    self._path, count, name,
                )  # fmt: skip
        if left := len(self._model.meshes) - len(self._met):
            _log.warning(
                "%s: %d of %d meshes are in no node of the scene and are left out",
                self._path, left, len(self._model.meshes),
            )  # fmt: skip

    def _is_surface(self, primitive: _Primitive) -> bool:
        self._points += primitive.mode == _POINTS
        self._lines += primitive.mode in _LINES
        return primitive.mode in (_TRIANGLES, _STRIP, _FAN)

    def _instances(self, node: _GltfNode, index: int) -> list[FloatArray]:
        """Returns the matrices [4, 4] of the places at which a node's mesh is placed."""
        if INSTANCED not in node.extensions:
            return [np.eye(4)]
        place = f"nodes[{index}].extensions.{INSTANCED}"
        try:
            given = msgspec.convert(node.extensions[INSTANCED], _Instancing).attributes
        except msgspec.ValidationError as error:
            raise ProblemError(f"{place}: must have attributes that name accessors") from error
        kinds = {"TRANSLATION": "VEC3", "ROTATION": "VEC4", "SCALE": "VEC3"}
        found = {
            name: self._arrays.numbers(given[name], kind)
            for name, kind in kinds.items()
            if name in given
        }
        counts = {len(values) for values in found.values()}
        if len(counts) != 1:
            raise ProblemError(
                f"{place}: must have equally many translations, rotations and scales"
            )
        (count,) = counts
        if count > MOST_TRIANGLES:
            raise ProblemError(
                f"{place}: must have at most {MOST_TRIANGLES} instances, not {count}"
            )
        parts = (
            found.get("TRANSLATION", np.zeros((count, 3))),
            found.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1))),
            found.get("SCALE", np.ones((count, 3))),
        )
        return [_transform(*part, place) for part in zip(*parts, strict=True)]

    def _points_of(self, primitive: _Primitive, weights: list[float], place: str) -> FloatArray:
        """Returns the vertices [n, 3] of a primitive, moved by its weighted morph targets."""
        if "POSITION" not in primitive.attributes:
            compressed = next(iter(primitive.extensions), None)
            raise ProblemError(
                needs(compressed) if compressed else f"{place}: must have an attribute POSITION"
            )
        self._require_own_numbers(primitive)
        points = self._arrays.places(primitive.attributes["POSITION"], self._quantized)
        for target, weight in zip(primitive.targets, weights, strict=False):
            if weight and "POSITION" in target:
                moves = self._arrays.places(target["POSITION"], self._quantized)
                if len(moves) != len(points):
                    raise ProblemError(f"{place}.targets: must move {len(points)} vertices each")
                points = points + weight * moves
        return points

    def _require_own_numbers(self, primitive: _Primitive) -> None:
        """Raises ProblemError if only an extension of a primitive contains its numbers."""
        for index in (primitive.attributes["POSITION"], primitive.indices):
            if index is None or not primitive.extensions:
                continue
            accessor = item(self._model.accessors, index, "accessors")
            if accessor.buffer_view is None and accessor.sparse is None:
                raise ProblemError(needs(next(iter(primitive.extensions))))

    def _triangles(self, primitive: _Primitive, points: int, place: str) -> IntArray:
        """Returns the triangles [m, 3] of a primitive that is not a line."""
        if primitive.indices is None:
            numbers = np.arange(points)
        else:
            numbers = self._arrays.indices(primitive.indices)
        if len(numbers) and numbers.max() >= points:
            raise ProblemError(
                f"{place}.indices: must name vertices 0..{points - 1}, not {numbers.max()}"
            )
        whole = len(numbers) % 3 == 0 if primitive.mode == _TRIANGLES else len(numbers) != 1
        if not whole or len(numbers) == 2:
            raise ProblemError(f"{place}: must have whole triangles, not {len(numbers)} corners")
        if primitive.mode == _TRIANGLES:
            return numbers.reshape(-1, 3)
        return fan(numbers) if primitive.mode == _FAN else strip(numbers)
