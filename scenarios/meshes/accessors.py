"""Numbers in glTF: buffers of bytes, views of them, and accessors that describe the content of a
view.

Source: glTF 2.0 Specification, Khronos Group, sections 3.6 and 4.4; normalised integers are defined
by KHR_mesh_quantization.
"""

import base64
import binascii
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeVar
from urllib.parse import unquote, unquote_to_bytes

import msgspec
import numpy as np
from msgspec import Meta

from cocap_opt.data import FloatArray, IntArray, ProblemError

T = TypeVar("T")

Index = Annotated[int, Meta(ge=0)]
Whole = Annotated[int, Meta(ge=0, le=2**53)]
QUANTIZED = "KHR_mesh_quantization"

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_UNSIGNED = (5121, 5123, 5125)
_FLOAT = 5126
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_MOST_VALUES = 10_000_000  # values of an accessor without bytes


class Buffer(msgspec.Struct, rename="camel"):
    """Bytes in a separate file, in the text itself, or in the remainder of a GLB."""

    byte_length: Whole
    uri: str | None = None


class BufferView(msgspec.Struct, rename="camel"):
    """A part of a buffer."""

    buffer: Index
    byte_length: Whole
    byte_offset: Whole = 0
    byte_stride: Annotated[int, Meta(ge=1, le=252)] | None = None
    extensions: dict[str, Any] = {}


class _SparseIndices(msgspec.Struct, rename="camel"):
    """The position in the file of the indices of sparse values."""

    buffer_view: Index
    component_type: int
    byte_offset: Whole = 0


class _SparseValues(msgspec.Struct, rename="camel"):
    """The values that replace others."""

    buffer_view: Index
    byte_offset: Whole = 0


class _Sparse(msgspec.Struct, rename="camel"):
    """Values that replace some of an accessor."""

    count: Whole
    indices: _SparseIndices
    values: _SparseValues


class Accessor(msgspec.Struct, rename="camel"):
    """An array in a view."""

    component_type: int
    count: Whole
    type: str
    buffer_view: Index | None = None
    byte_offset: Whole = 0
    normalized: bool = False
    sparse: _Sparse | None = None


def item(items: Sequence[T], index: int, name: str) -> T:
    """Returns the item with a given number from a list of the file."""
    if not index < len(items):
        raise ProblemError(f"{name}[{index}]: is used, but the file has {len(items)} {name}")
    return items[index]


class Accessors:
    """The arrays of a file, each checked against what the file declares.

    Parameters
    ----------
    accessors, views, buffers : as in the file
    folder : folder of the file, which may contain buffers at any depth
    rest : the bytes after the JSON in a GLB; None if there are none
    """

    def __init__(
        self,
        accessors: Sequence[Accessor],
        views: Sequence[BufferView],
        buffers: Sequence[Buffer],
        folder: Path,
        rest: bytes | None,
    ) -> None:
        self._accessors, self._views, self._buffers = accessors, views, buffers
        self._folder, self._rest = folder.resolve(), rest
        self._read: dict[int, bytes] = {}

    def places(self, index: int, quantized: bool) -> FloatArray:
        """Returns positions or displacements [n, 3]; integers are allowed if the file is
        quantized.
        """
        given = item(self._accessors, index, "accessors")
        if given.component_type != _FLOAT and not quantized:
            raise ProblemError(
                f"accessors[{index}]: positions must be of floats (5126), not "
                f"{given.component_type}, or the file must require {QUANTIZED}"
            )
        return self.numbers(index, "VEC3")

    def numbers(self, index: int, kind: str) -> FloatArray:
        """Returns an array [n, width of its kind]; normalised integers become -1..1 or 0..1."""
        values = self._array(index, kind)
        given = self._accessors[index]
        if not given.normalized or given.component_type == _FLOAT:
            return values.astype(np.float64)
        most = np.iinfo(_TYPES[given.component_type]).max
        result: FloatArray = np.maximum(values / most, -1.0)
        return result

    def indices(self, index: int) -> IntArray:
        """Returns numbers of vertices [n]."""
        if item(self._accessors, index, "accessors").component_type not in _UNSIGNED:
            raise ProblemError(f"accessors[{index}]: indices must be of unsigned integers")
        return self._array(index, "SCALAR")[:, 0].astype(np.int64)

    def _array(self, index: int, kind: str) -> np.ndarray[Any, Any]:
        given = item(self._accessors, index, "accessors")
        place = f"accessors[{index}]"
        if given.type != kind or given.component_type not in _TYPES:
            raise ProblemError(
                f"{place}: must be {kind} of a component type {', '.join(map(str, _TYPES))}, not "
                f"{given.type[:20]} of {given.component_type}"
            )
        if given.buffer_view is None and given.sparse is None:
            raise ProblemError(
                f"{place}: must have a bufferView or sparse values; its numbers are missing, or in "
                "an extension"
            )
        width, dtype = _WIDTHS[kind], _TYPES[given.component_type]
        if given.buffer_view is None:
            if given.count > _MOST_VALUES:
                raise ProblemError(f"{place}: must have at most {_MOST_VALUES} values")
            values = np.zeros((given.count, width), dtype)
        else:
            values = self._view(
                given.buffer_view, given.byte_offset, given.count, width, dtype, place
            )
        if given.sparse is not None:
            values = self._replaced(values, given.sparse, dtype, f"{place}.sparse")
        return values

    def _replaced(
        self, values: np.ndarray[Any, Any], sparse: _Sparse, dtype: str, place: str
    ) -> np.ndarray[Any, Any]:
        """Returns values [n, width], some of them replaced by sparse values."""
        if sparse.indices.component_type not in _UNSIGNED:
            raise ProblemError(f"{place}.indices: must be of unsigned integers")
        at = self._view(
            sparse.indices.buffer_view, sparse.indices.byte_offset, sparse.count, 1,
            _TYPES[sparse.indices.component_type], f"{place}.indices",
        )[:, 0].astype(np.int64)  # fmt: skip
        if len(at) and (at.max() >= len(values) or (np.diff(at) <= 0).any()):
            raise ProblemError(f"{place}.indices: must increase, and be below {len(values)}")
        new = self._view(
            sparse.values.buffer_view, sparse.values.byte_offset, sparse.count, values.shape[1],
            dtype, f"{place}.values",
        )  # fmt: skip
        result = values.copy()
        result[at] = new
        return result

    def _view(
        self, index: int, offset: int, count: int, width: int, dtype: str, place: str
    ) -> np.ndarray[Any, Any]:
        """Returns count x width numbers of a view, starting at an offset."""
        view = item(self._views, index, "bufferViews")
        if compressed := [name for name in view.extensions if "meshopt" in name]:
            raise ProblemError(needs(compressed[0]))
        data = self._buffer(view.buffer)
        if view.byte_offset + view.byte_length > len(data):
            raise ProblemError(
                f"bufferViews[{index}]: must end within the {len(data)} bytes of its buffer, not "
                f"at {view.byte_offset + view.byte_length}"
            )
        if not count:
            return np.zeros((0, width), dtype)
        size = width * np.dtype(dtype).itemsize
        stride = view.byte_stride or size
        end = offset + stride * (count - 1) + size
        if stride < size or end > view.byte_length:
            raise ProblemError(
                f"{place}: must end within the {view.byte_length} bytes of bufferViews[{index}], "
                f"not at {end}"
            )
        return np.ndarray(
            (count, width), dtype, data, view.byte_offset + offset,
            (stride, np.dtype(dtype).itemsize),
        )  # fmt: skip

    def _buffer(self, index: int) -> bytes:
        """Returns the bytes of a buffer, as many as declared."""
        if index not in self._read:
            given = item(self._buffers, index, "buffers")
            data = self._bytes(given.uri, index)
            if len(data) < given.byte_length:
                raise ProblemError(
                    f"buffers[{index}]: must have {given.byte_length} bytes, as it declares, not "
                    f"{len(data)}"
                )
            self._read[index] = data[: given.byte_length]
        return self._read[index]

    def _bytes(self, uri: str | None, index: int) -> bytes:
        if uri is None:
            if index != 0 or self._rest is None:
                raise ProblemError(
                    f"buffers[{index}]: must have a uri, as no bytes follow the JSON"
                )
            return self._rest
        if uri.startswith("data:"):
            return _of_text(uri, index)
        path = self._folder / unquote(uri)
        is_name = "\0" not in str(path)  # file systems do not allow it
        if not (is_name and path.resolve().is_relative_to(self._folder) and os.path.isfile(path)):
            raise ProblemError(f"buffers[{index}]: cannot be read: no file {uri[:60]} beside it")
        return path.read_bytes()


def needs(extension: str) -> str:
    """Returns the message for a file whose geometry needs an unsupported extension."""
    return (
        f"needs {extension}, which is not supported; write the file without it, with "
        "`gltf-transform cp OLD.glb NEW.glb` or Blender's export without compression"
    )


def _of_text(uri: str, index: int) -> bytes:
    """Returns the bytes that a URI contains."""
    head, comma, body = uri.partition(",")
    try:
        if not comma:
            raise ValueError
        if head.endswith(";base64"):
            return base64.b64decode(unquote(body), validate=True)
        return unquote_to_bytes(body)
    except (binascii.Error, ValueError) as error:
        raise ProblemError(f"buffers[{index}].uri: must contain its bytes in base64") from error
