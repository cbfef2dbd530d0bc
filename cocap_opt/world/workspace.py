"""Solid matter: a height map, and meshes for bridges and other overhangs."""

import math
from collections.abc import Sequence
from functools import cached_property, lru_cache
from itertools import product
from typing import NamedTuple

import msgspec
import numpy as np

from cocap_opt.data import (
    LARGEST,
    SMALLEST,
    BoolArray,
    Data,
    FloatArray,
    IntArray,
    frozen,
    require,
    within,
)
from cocap_opt.world.columns import Columns, Spans
from cocap_opt.world.triangles import close, closed_parts, counting, enclosing

MOST_TRIANGLES = 1_000_000

Place = tuple[int, int, float]  # cell x, y and flight height (m)


_FLAT = 0.05  # smallest share of cells at the lowest height on flat ground with obstacles
_ROUNDING = 1e-6  # m
OBSTACLE = 0.25  # m above the ground; a higher cell stands out


class HeightMap(Data, frozen=True, eq=False, dict=True):
    """A 2.5D map: `heights[x, y]` is the top of the solid column in a cell, in metres.

    Cell (i, j) covers `origin + resolution * ([i, i+1) x [j, j+1))`.

    Attributes
    ----------
    heights : [X, Y] m
    resolution : m, edge of a cell
    origin : m, corner of cell (0, 0)
    datum : [X, Y] m, zero of flight heights; None: 0 everywhere
    lift : [X, Y] m, by which flight heights are raised where the datum is too steep to be followed;
        None: nowhere. The ceiling is still measured from the datum itself
    bare : [X, Y] m, altitudes of the bare ground without anything on it, if they differ from the
        datum; None: given by the datum or the heights. They affect only warnings, not plans

    Raises
    ------
    ProblemError
        If an array is not 2-D, empty or not finite, or a number is out of range.
    """

    heights: FloatArray
    resolution: float = 1.0
    origin: tuple[float, float] = (0.0, 0.0)
    datum: FloatArray | None = None
    lift: FloatArray | None = None
    bare: FloatArray | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        msgspec.structs.force_setattr(self, "heights", frozen(self.heights, "heights", 2))
        within(self.resolution, SMALLEST, LARGEST, "resolution", "m")
        for value in self.origin:
            within(value, -LARGEST, LARGEST, "origin", "m")
        for field in ("datum", "lift", "bare"):
            if getattr(self, field) is not None:
                values = frozen(getattr(self, field), field, 2)
                msgspec.structs.force_setattr(self, field, values)
                sizes = self.shape
                same = values.shape == sizes
                require(same, field, f"must have {sizes[0]} x {sizes[1]} cells like the heights")
        if self.lift is not None:
            least = f"must be at least 0 m, not {self.lift.min():g}"
            require(bool((self.lift >= 0).all()), "lift", least)

    @property
    def shape(self) -> tuple[int, int]:
        """Number of cells along x and y."""
        x, y = self.heights.shape
        return x, y

    @property
    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Lower left and upper right corner [2] of the map, m."""
        first = np.array(self.origin)
        return first, first + np.array(self.shape) * self.resolution

    def centre(self, x: int, y: int) -> tuple[float, float]:
        """Returns the world coordinates (m) of the middle of cell (x, y)."""
        ox, oy = self.origin
        return ox + (x + 0.5) * self.resolution, oy + (y + 0.5) * self.resolution

    def cell_of(self, x: float, y: float) -> tuple[int, int]:
        """Returns the cell that contains the point (x, y) in m; it may lie outside the map."""
        ox, oy = self.origin
        return math.floor((x - ox) / self.resolution), math.floor((y - oy) / self.resolution)

    def cells_of(self, points: FloatArray) -> IntArray:
        """Returns the cells [.., 2] that contain points [.., 2 or 3] (m), even off the map."""
        found = np.floor((points[..., :2] - self.origin) / self.resolution)
        return found.astype(np.int64)

    def cells_below(self, points: FloatArray) -> tuple[IntArray, IntArray]:
        """Returns the cells x [n], y [n] below points [n, 2 or 3] (m); off the map, the nearest."""
        i, j = np.clip(self.cells_of(points), 0, np.array(self.shape) - 1).T
        return i, j

    def inside(self, x: int, y: int) -> bool:
        """Returns True if the map has this cell."""
        width, depth = self.shape
        return 0 <= x < width and 0 <= y < depth

    def altitude(self, x: int, y: int, height: float) -> float:
        """Returns the altitude (m) of flight height `height` in cell (x, y)."""
        zero = self.flight_datum
        return height if zero is None else height + float(zero[x, y])

    def way(self, tail: Place, head: Place) -> tuple[float, float, float]:
        """Returns the vector (m) between two places, each a cell x, y and a flight height."""
        (ax, ay, low), (bx, by, high) = tail, head
        up = self.altitude(bx, by, high) - self.altitude(ax, ay, low)
        return (bx - ax) * self.resolution, (by - ay) * self.resolution, up

    def altitudes(self, heights: tuple[float, ...]) -> FloatArray:
        """Returns the altitudes [layer, X, Y] (m) of flight heights in all cells."""
        zero = np.zeros(self.shape) if self.flight_datum is None else self.flight_datum
        result: FloatArray = np.array(heights)[:, None, None] + zero
        return result

    def ceilings(self, height: float) -> FloatArray:
        """Returns the altitudes [X, Y] (m) of a ceiling in all cells."""
        return height + (np.zeros(self.shape) if self.datum is None else self.datum)

    @cached_property
    def flight_datum(self) -> FloatArray | None:
        """The altitudes [X, Y] (m) of flight height 0: the datum plus the lift; None: 0."""
        if self.lift is None:
            return self.datum
        return self.lift if self.datum is None else self.datum + self.lift

    @property
    def is_uneven(self) -> bool:
        """True if flight heights may differ in altitude from cell to cell."""
        return self.flight_datum is not None

    @property
    def ground(self) -> FloatArray:
        """Altitudes [X, Y] of the ground: bare, the datum, or the lowest height if it is common.

        On other maps ground and obstacles cannot be distinguished, so everything is ground.
        """
        told = self.datum if self.bare is None else self.bare
        if told is not None:
            return np.minimum(told, self.heights)
        return np.full_like(self.heights, self.heights.min()) if self._is_flat else self.heights

    @property
    def knows_ground(self) -> bool:
        """True if ground and obstacles can be distinguished everywhere.

        Water is flat, too, but the ground beside it rises gently, unlike an obstacle.
        """
        if self.bare is not None or self.datum is not None:
            return True
        above = self.heights - self.heights.min()
        rises = bool(((above > _ROUNDING) & (above < OBSTACLE)).any())
        return self._is_flat and not rises

    @property
    def _is_flat(self) -> bool:
        return bool((self.heights == self.heights.min()).mean() >= _FLAT)

    @property
    def stands_out(self) -> BoolArray:
        """True for cells [X, Y] that are higher than the ground."""
        return np.asarray(self.heights > self.ground + OBSTACLE)

    @property
    def corners(self) -> FloatArray:
        """Corners of the triangles [n, 3, 3] (m) of the surface of its columns."""
        return _surface(self)


class Mesh(Data, frozen=True, eq=False, dict=True):
    """A solid or a surface made of triangles, for shapes that a height map cannot represent.

    It blocks motion and hides actors. If its triangles form a closed surface, its inside is solid,
    too; otherwise the triangles are thin plates. Duplicates, and triangles with two corners at the
    same place, are ignored.

    Attributes
    ----------
    vertices : [V, 3] m
    triangles : [M, 3] numbers of vertices, counter-clockwise seen from outside

    Raises
    ------
    ProblemError
        If vertices are not [V, 3] finite numbers, or triangles not [M, 3] numbers 0..V-1.
    """

    vertices: FloatArray
    triangles: IntArray

    def __post_init__(self) -> None:
        super().__post_init__()
        msgspec.structs.force_setattr(self, "vertices", frozen(self.vertices, "vertices", 2))
        columns = self.vertices.shape[1]
        require(columns == 3, "vertices", f"must have 3 columns x, y, z, not {columns}")
        given = frozen(self.triangles, "triangles", 2)
        columns = given.shape[1]
        require(columns == 3, "triangles", f"must have 3 columns, not {columns}")
        most = f"must be at most {MOST_TRIANGLES}, not {len(given)}"
        require(len(given) <= MOST_TRIANGLES, "triangles", most)
        last = len(self.vertices) - 1
        others = given[(given < 0) | (given > last) | (given != np.floor(given))]
        if others.size:
            require(
                False, "triangles", f"must be numbers of vertices, 0..{last}, not {others[0]:g}"
            )
        triangles = given.astype(np.int64)
        triangles.setflags(write=False)
        msgspec.structs.force_setattr(self, "triangles", triangles)

    @classmethod
    def box(cls, low: tuple[float, float, float], high: tuple[float, float, float]) -> "Mesh":
        """Returns the box from one corner to the opposite one (m)."""
        corners = np.array(list(product(*zip(low, high, strict=True))))
        sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        triangles = [side[k] for side in sides for k in (0, 1, 2, 0, 2, 3)]
        return cls(vertices=corners, triangles=np.reshape(triangles, (-1, 3)))

    @classmethod
    def joined(cls, parts: Sequence["Mesh"]) -> "Mesh":
        """Returns several meshes as one mesh, without merging them where they meet."""
        firsts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
        triangles = [part.triangles + first for part, first in zip(parts, firsts, strict=True)]
        vertices = np.concatenate([part.vertices for part in parts])
        return cls(vertices=vertices, triangles=np.concatenate(triangles))

    @cached_property
    def surface(self) -> IntArray:
        """The triangles [n, 3] that count, see `cocap_opt.world.triangles.counting`."""
        return counting(self.vertices, self.triangles)

    @cached_property
    def is_solid(self) -> bool:
        """True if the surface is closed around a volume: each edge is passed equally both ways."""
        return close(self.surface) and bool(enclosing(self.vertices, self.surface).all())

    @property
    def parts(self) -> tuple["Mesh", ...]:
        """The mesh; if only a part of it is closed, that part, which is solid, and the rest."""
        closed = closed_parts(self.surface) & enclosing(self.vertices, self.surface)
        if self.is_solid or not closed.any():
            return (self,)
        solid, rest = self.surface[closed], self.surface[~closed]
        return self.replace(triangles=solid), self.replace(triangles=rest)

    @property
    def corners(self) -> FloatArray:
        """Corners of the triangles [n, 3, 3] (m) of its surface."""
        result: FloatArray = self.vertices[self.surface]
        return result


class Workspace(NamedTuple):
    """All solid matter, the grid in which robots move, and the airspace that is closed to them."""

    height_map: HeightMap
    meshes: tuple[Mesh, ...] = ()
    no_fly: tuple[Mesh, ...] = ()  # solids that robots do not enter; they hide nobody
    ceiling: float | None = None  # m above the datum

    @property
    def columns(self) -> Columns:
        """Solid matter above every cell."""
        return _columns(self.height_map, self.meshes)

    def surfaces_below(self, points: FloatArray) -> FloatArray:
        """Returns the altitudes [n] (m) of the highest matter below points [n, 3] (m)."""
        i, j = self.height_map.cells_below(points)
        tops = self.columns.high[:, i, j]
        below = np.where(tops <= points[:, 2], tops, -np.inf)
        return np.asarray(np.maximum(below.max(axis=0), self.height_map.heights[i, j]))

    @property
    def forbidden(self) -> Columns:
        """The altitudes above every cell that no-fly zones and the ceiling close."""
        return _forbidden(self)


@lru_cache(maxsize=16)
def _columns(height_map: HeightMap, meshes: tuple[Mesh, ...]) -> Columns:
    return Columns.of(height_map.heights, _joined(meshes, height_map))


@lru_cache(maxsize=16)
def _forbidden(workspace: Workspace) -> Columns:
    height_map, zones = workspace.height_map, workspace.no_fly
    columns = Columns.of(np.full(height_map.shape, -np.inf), _joined(zones, height_map))
    if workspace.ceiling is None:
        return columns
    top = height_map.ceilings(workspace.ceiling)
    above = Columns(np.nextafter(top, np.inf)[None], np.full((1, *top.shape), np.inf))
    return Columns(*(np.concatenate(parts) for parts in zip(columns, above, strict=True)))


def _joined(meshes: tuple[Mesh, ...], height_map: HeightMap) -> Spans:
    return Spans.joined(_spans(mesh, height_map) for mesh in meshes)


def _spans(mesh: Mesh, height_map: HeightMap) -> Spans:
    # Coordinates x and y are counted in cells from the corner of the map.
    corner = np.array([*height_map.origin, 0.0])
    scale = np.array([height_map.resolution, height_map.resolution, 1.0])
    vertices = (mesh.vertices - corner) / scale
    return Spans.of_mesh(vertices, mesh.surface, height_map.shape, mesh.is_solid)


def _surface(height_map: HeightMap) -> FloatArray:
    """Returns the surface of a height map's columns as triangles [n, 3, 3] in m.

    Every cell has a flat top; if two cells (or a cell and the outside) differ in height, a vertical
    wall joins them. The outside is as low as the lowest cell.
    """
    heights, resolution = height_map.heights, height_map.resolution
    ox, oy = height_map.origin
    width, depth = heights.shape
    x = ox + resolution * np.arange(width + 1)
    y = oy + resolution * np.arange(depth + 1)
    i, j = (index.ravel() for index in np.indices(heights.shape))
    quads = [_quads((x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j + 1]), (x[i], y[j + 1]),
                    heights.ravel(), heights.ravel())]  # fmt: skip
    outside = float(heights.min())
    framed = np.pad(heights, 1, constant_values=outside)
    step_x = framed[:-1, 1:-1], framed[1:, 1:-1]
    i, j = np.nonzero(step_x[0] != step_x[1])
    low, high = np.minimum(*step_x)[i, j], np.maximum(*step_x)[i, j]
    quads.append(_quads((x[i], y[j]), (x[i], y[j + 1]), (x[i], y[j + 1]), (x[i], y[j]), low, high))
    step_y = framed[1:-1, :-1], framed[1:-1, 1:]
    i, j = np.nonzero(step_y[0] != step_y[1])
    low, high = np.minimum(*step_y)[i, j], np.maximum(*step_y)[i, j]
    quads.append(_quads((x[i], y[j]), (x[i + 1], y[j]), (x[i + 1], y[j]), (x[i], y[j]), low, high))
    corners = np.concatenate(quads)
    return corners[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)


def _quads(
    a: tuple[FloatArray, FloatArray],
    b: tuple[FloatArray, FloatArray],
    c: tuple[FloatArray, FloatArray],
    d: tuple[FloatArray, FloatArray],
    first: FloatArray,
    second: FloatArray,
) -> FloatArray:
    """Returns quads [n, 4, 3] over four corners (x, y), the last two at the second height."""
    corners = [
        np.column_stack([*corner, z])
        for corner, z in zip((a, b, c, d), (first, first, second, second), strict=True)
    ]
    return np.stack(corners, axis=1)
