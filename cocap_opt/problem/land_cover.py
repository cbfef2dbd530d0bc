"""The land of a scene, as a map shows it: water, green, streets and the like."""

from collections.abc import Sequence
from typing import Literal, get_args

import msgspec
import numpy as np

from cocap_opt.data import BoolArray, Data, FloatArray, IntArray, frozen, require
from cocap_opt.text import printable, shortened
from cocap_opt.world.workspace import HeightMap

Land = Literal["water", "green", "street", "footway", "paved", "yard", "building", "other"]
LANDS: tuple[Land, ...] = get_args(Land)
_TRIED = 40  # candidate points along the longer side of an area, for a point far from its rim


class LandCover(Data, frozen=True, eq=False):
    """An area of the ground, and the kind of land that covers it.

    Pictures show it, and warnings name it if drones land there; no plan depends on it.

    Attributes
    ----------
    kind : "water", "green", "street", "footway", "paved", "yard", "building" or "other"
    outline : [n, 2] m, corners x, y along the rim
    holes : rims of excluded parts, each in the form of the outline
    name : name written on the ground; None if it has none

    Raises
    ------
    ProblemError
        If the kind is none of these, or a rim has fewer than three corners.
    """

    kind: Land
    outline: FloatArray
    holes: tuple[FloatArray, ...] = ()
    name: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        known = ", ".join(LANDS)
        require(self.kind in LANDS, "kind", f"must be one of {known}, not {self.kind!r}")
        msgspec.structs.force_setattr(self, "outline", _rim(self.outline, "outline"))
        wide = bool((np.ptp(self.outline, axis=0) > 0).all())
        require(wide, "outline", "must have corners that do not coincide or lie on one line")
        holes = tuple(_rim(hole, f"holes[{k}]") for k, hole in enumerate(self.holes))
        msgspec.structs.force_setattr(self, "holes", holes)
        if self.name is not None:
            msgspec.structs.force_setattr(self, "name", shortened(printable(self.name)))

    @property
    def box(self) -> tuple[FloatArray, FloatArray]:
        """The lower and the upper corner x, y (m) of a rectangle around the area."""
        return self.outline.min(axis=0), self.outline.max(axis=0)

    def holds(self, points: FloatArray) -> BoolArray:
        """Returns an array [n], True for points [n, 2] (m) in the area.

        The rim belongs to the area, and holes do not.
        """
        import shapely  # imported here, as few scenes have land

        area = shapely.Polygon(self.outline, self.holes)
        shapely.prepare(area)  # an index of its sides; a map may have 100,000
        return np.asarray(shapely.intersects_xy(area, *points.T), dtype=np.bool_)

    @property
    def label(self) -> tuple[float, float]:
        """A point x, y (m) inside the area, far from all rims, at which the name is written."""
        inside = self._tried(*self.box)
        x, y = self._farthest(inside if len(inside) else self.outline)
        return x, y

    def label_in(self, low: FloatArray, high: FloatArray) -> tuple[float, float] | None:
        """Returns a point x, y (m) for the name in the part of the area inside a rectangle.

        The point is far from all rims and from the rectangle's sides.

        Parameters
        ----------
        low, high : lower and upper corner x, y (m) of the rectangle

        Returns
        -------
        None if the rectangle shows nothing of the area, or next to nothing.
        """
        first, last = self.box
        inside = self._tried(np.maximum(first, low), np.minimum(last, high))
        if not len(inside):
            return None
        x, y = self._farthest(inside, np.minimum(inside - low, high - inside).min(axis=1))
        return x, y

    def _tried(self, low: FloatArray, high: FloatArray) -> FloatArray:
        """Returns the points [n, 2] (m) of a grid in a rectangle that are in the area."""
        apart = float((high - low).max()) / _TRIED
        if not (low < high).all():
            return np.empty((0, 2))
        axes = [np.arange(a + apart / 2, b, apart) for a, b in zip(low, high, strict=True)]
        tried = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        return tried[self.holds(tried)]

    def _farthest(self, points: FloatArray, most: FloatArray | float = np.inf) -> list[float]:
        """Returns the point x, y (m), of points [n, 2], that is farthest from all rims.

        `most` [n] (m) is an upper limit of each point's distance.
        """
        best: list[float] = points[np.minimum(self._to_rims(points), most).argmax()].tolist()
        return best

    def _to_rims(self, points: FloatArray) -> FloatArray:
        """Returns the distances [n] (m) of points [n, 2] to the nearest rim."""
        import shapely

        sides = [
            np.stack([rim, np.roll(rim, -1, axis=0)], axis=1) for rim in (self.outline, *self.holes)
        ]
        tree = shapely.STRtree(np.asarray(shapely.linestrings(np.concatenate(sides))))
        (of, _), apart = tree.query_nearest(
            shapely.points(points), return_distance=True, all_matches=False
        )
        return np.asarray(apart[of.argsort()])


def _rim(rim: FloatArray, field: str) -> FloatArray:
    found = frozen(rim, field, 2)
    fits = found.shape[1] == 2 and len(found) >= 3
    require(fits, field, "must hold three or more corners x, y")
    return found


def lands_at(areas: Sequence[LandCover], points: FloatArray) -> list[Land | None]:
    """Returns the kind of land at points [n, 2] (m); None if it is unknown.

    Where areas overlap, the last one counts.
    """
    found: list[Land | None] = [None] * len(points)
    for area in areas:
        for k in np.flatnonzero(area.holds(points)).tolist():
            found[k] = area.kind
    return found


def in_cells(areas: Sequence[LandCover], height_map: HeightMap) -> IntArray:
    """Returns the number in LANDS of the land at the middle of each cell [X, Y]; -1 if it is
    unknown.

    Where areas overlap, the last one counts.
    """
    found = np.full(height_map.shape, -1)
    for area in areas:
        (x0, y0), (x1, y1) = (height_map.cell_of(*corner.tolist()) for corner in area.box)
        x, y = (
            np.arange(max(low, 0), min(high + 1, count))
            for low, high, count in zip((x0, y0), (x1, y1), height_map.shape, strict=True)
        )
        cells = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        middles = np.array(height_map.origin) + height_map.resolution * (cells + 0.5)
        found[tuple(cells[area.holds(middles)].T)] = LANDS.index(area.kind)
    return found
