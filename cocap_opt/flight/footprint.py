"""Footprints: the parts of the ground that are in the images of cameras.

The ground is that of the map (`HeightMap.ground`), level in each cell; beyond the map it is as low
as the lowest cell. Obstacles and people do not reduce a footprint, although they may hide parts of
it.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Camera
from cocap_opt.vision.projection import Projection
from cocap_opt.world import HeightMap

REACH = 10.0  # multiple of the height above the ground
_HALVINGS = 30
_MOST = 2_000_000  # pieces of rays at once, which limits memory


class Footprints(NamedTuple):
    """Footprints of images: quadrilaterals, counter-clockwise seen from above.

    Attributes
    ----------
    corners : [n, 4, 3] m, points at which the image's lower left, lower right, upper right and
        upper left corners meet the ground; nan if its lower corners do not do so within the reach
    reach : [n] horizontal distance from the drone at which the footprint ends, m
    cut : [n] True if an upper corner looks farther than the reach, or above the horizon: it is
        replaced by the point on the same side of the image that meets the ground at the reach
    """

    corners: FloatArray
    reach: FloatArray
    cut: BoolArray

    @classmethod
    def of(
        cls, height_map: HeightMap, camera: Camera, place: FloatArray, yaw: FloatArray,
        pitch: FloatArray,
    ) -> Self:  # fmt: skip
        """Returns the footprints of images.

        Parameters
        ----------
        place : [n, 3] positions of cameras above the ground of the map, m
        yaw : [n] rad, 0 along +x, counter-clockwise
        pitch : [n] rad, below the horizon is negative
        """
        ground = _Ground(height_map)
        reach = REACH * (place[:, 2] - ground.below(place))
        axes = Projection.axes_towards(yaw, -pitch)
        found = [_side(ground, camera, place, axes, reach, side) for side in (-1, 1)]
        (left, left_cut), (right, right_cut) = found
        corners = np.stack([left[:, 0], right[:, 0], right[:, 1], left[:, 1]], axis=1)
        corners[np.isnan(corners).any(axis=(1, 2))] = np.nan
        return cls(corners, reach, left_cut | right_cut)


def _side(
    ground: "_Ground", camera: Camera, place: FloatArray, axes: FloatArray, reach: FloatArray,
    side: int,
) -> tuple[FloatArray, BoolArray]:  # fmt: skip
    """Returns the lower and the upper end [n, 2, 3] of a side of images on the ground.

    Parameters
    ----------
    side : -1 for the left side, 1 for the right side
    """

    def meets(row: FloatArray, through: BoolArray) -> FloatArray:
        """Returns the points at which rays through rows of some images (-1 lowest, 1 uppermost)
        end.
        """
        right, up, forward = np.moveaxis(axes[through], 1, 0)
        aside, above = side * camera.width / 2, row[:, None] * camera.height / 2
        rays = camera.focal * forward + aside * right + above * up
        return ground.met(place[through], rays, reach[through])

    every = np.ones(len(place), dtype=np.bool_)
    low, high = meets(np.full(len(place), -1.0), every), meets(np.ones(len(place)), every)
    cut = np.asarray(np.isnan(high).any(axis=1))
    seen = cut & ~np.isnan(low).any(axis=1)
    high[seen] = low[seen]
    bottom, top = np.full(seen.sum(), -1.0), np.ones(seen.sum())
    for _ in range(_HALVINGS if seen.any() else 0):
        middle = (bottom + top) / 2
        points = meets(middle, seen)
        hit = ~np.isnan(points).any(axis=1)
        high[np.flatnonzero(seen)[hit]] = points[hit]
        bottom, top = np.where(hit, middle, bottom), np.where(hit, top, middle)
    return np.stack([low, high], axis=1), cut


class _Ground:
    """The ground of a map, met by rays."""

    def __init__(self, height_map: HeightMap) -> None:
        self._map, self._size = height_map, height_map.resolution
        self._corner = np.array(height_map.origin)
        # A frame around the map represents everything beyond it.
        ground = height_map.ground
        self._heights = np.pad(ground, 1, constant_values=float(ground.min()))

    def below(self, points: FloatArray) -> FloatArray:
        """Returns the altitudes [..] (m) of the ground at points [.., 2 or 3]."""
        return self._at(self._map.cells_of(points))

    def _at(self, cells: FloatArray | IntArray) -> FloatArray:
        last = np.array(self._heights.shape) - 1
        i, j = np.moveaxis(np.clip(np.floor(cells) + 1, 0, last).astype(np.int64), -1, 0)
        result: FloatArray = self._heights[i, j]
        return result

    def met(self, eyes: FloatArray, rays: FloatArray, reach: FloatArray) -> FloatArray:
        """Returns the points at which rays [n, 3] from eyes [n, 3] meet the ground; nan if not
        within reach [n].
        """
        lines = self._lines(reach)
        size = max(1, _MOST // sum(lines))
        parts = [
            self._met(eyes[k : k + size], rays[k : k + size], reach[k : k + size], lines)
            for k in range(0, len(eyes), size)
        ]
        return np.concatenate(parts) if parts else np.zeros((0, 3))

    def _lines(self, reach: FloatArray) -> tuple[int, int]:
        """Returns the largest number of lines between cells along x and y that a ray crosses."""
        most = float(reach.max(initial=0.0)) / self._size + 2
        x, y = (math.ceil(min(most, float(count))) for count in self._heights.shape)
        return x, y

    def _met(
        self, eyes: FloatArray, rays: FloatArray, reach: FloatArray, lines: tuple[int, int]
    ) -> FloatArray:
        aside = np.hypot(rays[:, 0], rays[:, 1])
        ways, slope = rays[:, :2] / aside[:, None], rays[:, 2] / aside
        at = (eyes[:, :2] - self._corner) / self._size
        crossed = [self._crossings(at[:, k], ways[:, k], lines[k]) for k in (0, 1)]
        ends = np.column_stack([np.zeros(len(eyes)), *crossed, reach])
        ends = np.sort(np.minimum(ends, reach[:, None]), axis=1)
        middles = (ends[:, :-1] + ends[:, 1:]) / 2
        ground = self._at(at[:, None] + middles[..., None] * (ways / self._size)[:, None])
        altitudes = eyes[:, 2, None] + slope[:, None] * ends
        wall = altitudes[:, :-1] <= ground
        met = wall | (altitudes[:, 1:] <= ground)
        numbers, first = np.arange(len(eyes)), met.argmax(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            level = (ground[numbers, first] - eyes[:, 2]) / slope
        far = np.where(wall[numbers, first], ends[numbers, first], level)
        z = np.where(wall[numbers, first], altitudes[numbers, first], ground[numbers, first])
        points = np.column_stack([eyes[:, :2] + far[:, None] * ways, z])
        points[~met.any(axis=1)] = np.nan
        return points

    def _crossings(self, at: FloatArray, way: FloatArray, count: int) -> FloatArray:
        """Returns the distances [n, count] (m) at which rays cross lines between cells.

        Parameters
        ----------
        at, way : [n] starts of the rays, in cells, and their directions, along one axis
        """
        ahead = np.where(way > 0, np.floor(at) + 1 - at, at - np.ceil(at) + 1)
        with np.errstate(divide="ignore"):
            return (ahead[:, None] + np.arange(count)) * (self._size / np.abs(way))[:, None]
