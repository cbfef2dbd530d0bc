"""The part of a map in which something happens: the part that pictures show."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.world.workspace import HeightMap

_AROUND, _LEAST_SIDE = 3.0, 12.0  # m, around the action, and of the part that is drawn


class MapFrame(NamedTuple):
    """The part of a map that is drawn, from its lower to its upper corner (m)."""

    low: FloatArray
    high: FloatArray

    @classmethod
    def around(cls, height_map: HeightMap, places: Iterable[tuple[float, float]]) -> Self:
        """Returns the part of a map around places (m), with a margin; all of it without places."""
        origin = np.array(height_map.origin)
        end = origin + np.array(height_map.shape) * height_map.resolution
        found = list(places) or [tuple(origin), tuple(end)]
        low, high = np.min(found, axis=0), np.max(found, axis=0)
        middle, size = (low + high) / 2, np.maximum(high - low + 2 * _AROUND, _LEAST_SIDE)
        low, high = np.maximum(middle - size / 2, origin), np.minimum(middle + size / 2, end)
        # People may walk off the map, all of them.
        return cls(low, high) if (low < high).all() else cls(origin, end)

    @property
    def size(self) -> tuple[float, float]:
        """Width and depth (m)."""
        width, depth = (self.high - self.low).tolist()
        return width, depth
