"""Small glTF files, made part by part, so that each test can spoil one of them."""

import base64
import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np

CODES = {"b": 5120, "B": 5121, "h": 5122, "H": 5123, "I": 5125, "f": 5126}
TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}


class Model:
    """A glTF file: its JSON, which tests may change, and its bytes."""

    def __init__(self) -> None:
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}], "meshes": [{"primitives": []}],
            "accessors": [], "bufferViews": [], "buffers": [{"byteLength": 0}],
        }  # fmt: skip
        self.bytes = b""

    def view(self, data: bytes, **fields: Any) -> int:
        """The number of a new view of bytes."""
        self.bytes += b"\0" * (-len(self.bytes) % 4)
        part = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(data), **fields}
        self.json["bufferViews"].append(part)
        self.bytes += data
        self.json["buffers"][0]["byteLength"] = len(self.bytes)
        return len(self.json["bufferViews"]) - 1

    def accessor(self, values: Sequence[Any], code: str = "f", **fields: Any) -> int:
        """The number of a new accessor of values with a view of their own."""
        array = np.asarray(values, dtype=f"<{np.dtype(code).str[1:]}")
        width = 1 if array.ndim == 1 else array.shape[1]
        part = {
            "bufferView": self.view(array.tobytes()), "componentType": CODES[code],
            "count": len(array), "type": TYPES[width], **fields,
        }  # fmt: skip
        self.json["accessors"].append(part)
        return len(self.json["accessors"]) - 1

    def primitive(self, position: int, indices: int | None = None, **fields: Any) -> dict[str, Any]:
        """A new primitive of the first mesh."""
        part: dict[str, Any] = {"attributes": {"POSITION": position}, **fields}
        if indices is not None:
            part["indices"] = indices
        self.json["meshes"][0]["primitives"].append(part)
        return part

    def glb(self) -> bytes:
        """The file as GLB."""
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        rest = self.bytes + b"\0" * (-len(self.bytes) % 4)
        chunks = struct.pack("<I4s", len(text), b"JSON") + text
        chunks += struct.pack("<I4s", len(rest), b"BIN\0") + rest
        return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks

    def gltf(self, uri: str | None = None) -> str:
        """The file as text, whose bytes are elsewhere or in it."""
        held = f"data:application/octet-stream;base64,{base64.b64encode(self.bytes).decode()}"
        self.json["buffers"][0]["uri"] = held if uri is None else uri
        return json.dumps(self.json)


def model(vertices: Sequence[Any], triangles: Sequence[Sequence[int]], variant: str = "") -> Model:
    """A mesh of triangles, its numbers kept in one of several ways."""
    made = Model()
    indices = np.ravel(triangles)
    points = np.asarray(vertices, dtype="<f4")
    if variant == "not indexed":
        made.primitive(made.accessor(points[indices]))
    elif variant == "interleaved":
        mixed = np.hstack([np.full_like(points, 7), points, np.full_like(points, 9)])
        view = made.view(mixed.astype("<f4").tobytes(), byteStride=36)
        for offset in (0, 12):
            made.json["accessors"].append({
                "bufferView": view, "byteOffset": offset, "componentType": 5126,
                "count": len(points), "type": "VEC3",
            })  # fmt: skip
        made.primitive(1, made.accessor(indices, "I"))["attributes"]["NORMAL"] = 0
    elif variant == "sparse":
        changed = np.flatnonzero(points[:, 2] > 0)
        low = np.where(points > 0, 1, points)
        position = made.accessor(np.where((points[:, 2] > 0)[:, None], low, points))
        made.json["accessors"][position]["sparse"] = {
            "count": len(changed),
            "indices": {
                "bufferView": made.view(changed.astype("<u2").tobytes()), "componentType": 5123,
            },
            "values": {"bufferView": made.view(points[changed].tobytes())},
        }  # fmt: skip
        made.primitive(position, made.accessor(indices, "H"))
    else:
        made.primitive(made.accessor(points), made.accessor(indices, "H"))
    return made


def glb(vertices: Sequence[Any], triangles: Sequence[Sequence[int]], variant: str = "") -> bytes:
    """A mesh of triangles as GLB."""
    return model(vertices, triangles, variant).glb()
