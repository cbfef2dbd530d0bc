"""Binary glTF 2.0 files (.glb): a JSON document and its numbers in one file."""

import struct
from collections.abc import Iterable
from typing import Any

import msgspec
import numpy as np
import numpy.typing as npt
from matplotlib.colors import to_rgb

from cocap_opt.data import FloatArray, IntArray

_MAGIC, _VERSION, _JSON, _BINARY = 0x46546C67, 2, 0x4E4F534A, 0x004E4942
_FLOAT, _UNSIGNED = 5126, 5125  # types of components
_VERTICES, _INDICES = 34962, 34963  # targets of buffer views
_KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
LINES, LINE_STRIP, TRIANGLES = 1, 3, 4  # modes of primitives

Primitive = dict[str, Any]


class Glb:
    """A glTF document under construction: objects are numbered, and refer to each other by
    number.
    """

    def __init__(self) -> None:
        self._binary = bytearray()
        self._parts: dict[str, list[dict[str, Any]]] = {}
        self._roots: list[int] = []

    def _add(self, part: str, value: dict[str, Any]) -> int:
        row = self._parts.setdefault(part, [])
        row.append(value)
        return len(row) - 1

    def node(self, name: str, parent: int | None = None, **fields: Any) -> int:
        """Adds a node; without a parent, it is at the top level of the scene."""
        number = self._add("nodes", {"name": name, **fields})
        if parent is None:
            self._roots.append(number)
        else:
            self._parts["nodes"][parent].setdefault("children", []).append(number)
        return number

    def place(self, node: int, path: str, value: FloatArray) -> None:
        """Sets a node's translation or rotation."""
        self._parts["nodes"][node][path] = value.tolist()

    def mesh(self, name: str, *primitives: Primitive) -> int:
        """Adds a mesh."""
        return self._add("meshes", {"name": name, "primitives": list(primitives)})

    def camera(self, name: str, rise: float, aspect: float, near: float) -> int:
        """Adds a perspective camera with a vertical angle of view (rad)."""
        lens = {"yfov": rise, "aspectRatio": aspect, "znear": near}
        return self._add("cameras", {"name": name, "type": "perspective", "perspective": lens})

    def material(self, name: str, colour: str, opacity: float = 1.0) -> int:
        """Adds a matt material, visible from both sides."""
        base = [*(_linear(share) for share in to_rgb(colour)), opacity]
        surface = {"baseColorFactor": base, "metallicFactor": 0.0, "roughnessFactor": 1.0}
        value = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}
        return self._add("materials", value if opacity == 1 else {**value, "alphaMode": "BLEND"})

    def primitive(
        self, points: FloatArray, material: int, indices: IntArray | None = None,
        mode: int = TRIANGLES,
    ) -> Primitive:  # fmt: skip
        """Returns a part of a mesh.

        Parameters
        ----------
        points : [n, 3] m, y is up
        indices : numbers of points, three per triangle or two per line; None: the points in order
        """
        found: Primitive = {
            "attributes": {"POSITION": self.accessor(points, _VERTICES)}, "material": material,
            "mode": mode,
        }  # fmt: skip
        if indices is not None:
            found["indices"] = self._numbers(indices)
        return found

    def animation(self, name: str, channels: Iterable[tuple[int, str, int, int]]) -> None:
        """Adds an animation whose values change linearly.

        Parameters
        ----------
        channels : numbers of a node, its property, and accessors of times and values
        """
        rows = list(channels)
        samplers = [{"input": i, "output": o, "interpolation": "LINEAR"} for _, _, i, o in rows]
        targets = [
            {"sampler": k, "target": {"node": node, "path": path}}
            for k, (node, path, _, _) in enumerate(rows)
        ]
        self._add("animations", {"name": name, "samplers": samplers, "channels": targets})

    def accessor(self, values: FloatArray, target: int | None = None) -> int:
        """Adds numbers [n], or vectors [n, 3] or [n, 4], as 32-bit floats."""
        rows = np.ascontiguousarray(values, dtype="<f4").reshape(len(values), -1)
        return self._add("accessors", {
            "bufferView": self._view(rows, target), "componentType": _FLOAT, "count": len(rows),
            "type": _KINDS[rows.shape[1]],
            "min": rows.min(axis=0).tolist(), "max": rows.max(axis=0).tolist(),
        })  # fmt: skip

    def _numbers(self, values: IntArray) -> int:
        row = np.ascontiguousarray(values.ravel(), dtype="<u4")
        return self._add("accessors", {
            "bufferView": self._view(row, _INDICES), "componentType": _UNSIGNED,
            "count": len(row), "type": "SCALAR",
        })  # fmt: skip

    def _view(self, values: npt.NDArray[Any], target: int | None) -> int:
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": values.nbytes}
        self._binary += values.tobytes()
        return self._add("bufferViews", view if target is None else {**view, "target": target})

    def content(self, name: str, extras: dict[str, Any]) -> bytes:
        """Returns the file, with a single named scene and extra data that readers ignore."""
        document = {
            "asset": {"version": "2.0", "generator": "cocap-opt"},
            "scene": 0,
            "scenes": [{"name": name, "nodes": self._roots, "extras": extras}],
            **self._parts,
            "buffers": [{"byteLength": len(self._binary)}],
        }
        text = msgspec.json.encode(document)
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(self._binary)
        return b"".join((
            struct.pack("<III", _MAGIC, _VERSION, size),
            struct.pack("<II", len(text), _JSON), text,
            struct.pack("<II", len(self._binary), _BINARY), bytes(self._binary),
        ))  # fmt: skip


def _linear(share: float) -> float:
    """Returns the linear value of an sRGB colour component, as glTF requires."""
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4
