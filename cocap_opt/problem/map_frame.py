"""The part of a map that pictures show: the part in which something happens."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.world.workspace import HeightMap

_AROUND, _LEAST_SIDE = 3.0, 12.0  # m; margin around the action, and shortest side of the frame
_DISC = 0.03  # relative to the longer side: half the width of a mark of a place


class MapFrame(NamedTuple):
    """The part of a map to draw, from its lower to its upper corner (m)."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def around(cls, height_map: HeightMap, places: Iterable[tuple[float, float]]) -> Self:
        """Returns the part of a map around places (m), with a margin; without places, the whole
        map.

        The frame extends beyond the map only if the mark of a place would otherwise be cut at the
        edge.
        """
        origin = np.array(height_map.origin)
        end = origin + np.array(height_map.shape) * height_map.resolution
        found = np.array(list(places)).reshape(-1, 2)
        if not len(found):
            return cls(origin, end)
        low, high = found.min(axis=0), found.max(axis=0)
        middle, size = (low + high) / 2, np.maximum(high - low + 2 * _AROUND, _LEAST_SIDE)
        low, high = np.maximum(middle - size / 2, origin), np.minimum(middle + size / 2, end)
        if not (low < high).all():  # all people may have walked off the map
            return cls(origin, end)
        marks, disc = np.clip(found, origin, end), _DISC * float((high - low).max())
        return cls(
            np.minimum(low, marks.min(axis=0) - disc), np.maximum(high, marks.max(axis=0) + disc)
        )

    @property
    def size(self) -> tuple[float, float]:
        """Width and depth (m)."""
        width, depth = (self.high - self.low).tolist()
        return width, depth
