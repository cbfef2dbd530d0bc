"""Views as if hardly anything hid anybody: an upper bound on coverage that takes little time.

A person is hidden only if a single column of the map is known to hide the whole person (`Screens`),
which is quick to find from nearly all places; nothing else hides anybody. The axis leads from the
middle of an actor to the eye. All lines of sight pass the upright plane across the axis at a point
p that is farther than the actor's radius r from its middle; there they are less than r beside p,
and no higher than the line to the actor's top at its far side. If all of that is inside of one
column, this column hides all of the actor.

The image of a triangle that is before the camera, with corners e1, e2, e3 relative to the eye, has

    focal^2 |det(e1, e2, e3)| / (2 d1 d2 d3) = focal^2 area ahead / (d1 d2 d3)

pixels, where d are the corners' depths and the eye is `ahead` metres before the triangle's plane.
Everything except the depths is the same for all orientations of a camera. If the border of the
image may cut a face, the bound is the part within the image of the rectangle around the face's
image.
"""

import math
from typing import NamedTuple, Self
from weakref import WeakKeyDictionary

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Camera
from cocap_opt.vision.bodies import Bodies
from cocap_opt.vision.faces import FaceGeometry, Planes
from cocap_opt.vision.projection import dot
from cocap_opt.vision.seen import SeenColumns, SeenFaces
from cocap_opt.vision.views import PinholeViews, StateViews

_DEPTH = 1e-3  # m, by which lines of sight must be inside a column
_PARTS = 4  # largest number of parts of a cell along x and along y
_MOST = 4_000_000  # largest number of squares, for maps with fewer cells, which limits memory
_STEP = 3  # cells from one point of an axis to the next
_FEW = 0.8  # smallest remaining share of axes at which all are kept


class Screens(NamedTuple):
    """Squares of the map, parts of its cells, that are well inside a column."""

    tops: FloatArray  # [X, Y] m, tops of the columns; -inf for squares that are not well inside one
    corner: FloatArray  # [2] m, of the first square
    size: float  # m, edge of a square
    step: float  # m, from one point of an axis to the next

    @classmethod
    def of(cls, columns: Bodies, resolution: float, radius: float) -> Self:
        """Returns the squares that are farther from the sides of their column than a radius (m).

        Parameters
        ----------
        columns : upright boxes without a bottom; the first is the whole map at its lowest height
        resolution : m, edge of a cell
        """
        corner, inwards = columns.low[0], radius + _DEPTH
        cells = float(np.prod((columns.high[0, :2] - corner) / resolution))
        size = resolution / max(min(_PARTS, math.isqrt(int(_MOST / cells))), 1)
        first = np.ceil((columns.low - corner + inwards) / size).astype(np.int64)
        ends = np.floor((columns.high[:, :2] - corner - inwards) / size).astype(np.int64)
        tops = np.full(np.rint((columns.high[0, :2] - corner) / size).astype(np.int64), -np.inf)
        for k in np.flatnonzero((first < ends).all(axis=1))[1:].tolist():
            (x0, y0), (x1, y1) = first[k].tolist(), ends[k].tolist()
            tops[x0:x1, y0:y1] = columns.high[k, 2]
        return cls(tops, corner, size, _STEP * resolution)

    def hide(
        self, middles: FloatArray, radii: FloatArray, tops: FloatArray, eyes: FloatArray
    ) -> BoolArray:
        """Returns an array [n, A], True for actors that a column is known to hide from eyes [n, 3].

        Parameters
        ----------
        middles, radii, tops : [A, 2], [A] and [A] m, of upright cylinders around the actors
        """
        hidden = np.zeros((len(eyes), len(radii)), dtype=bool)
        if np.isneginf(self.tops).all():
            return hidden
        numbers, at, left, steps = self._axes(middles, radii, tops, eyes)
        while len(numbers):
            x, y, top = at
            squares = x.astype(np.int64)
            squares *= self.tops.shape[1]
            squares += y.astype(np.int64)
            hides = top <= self.tops.take(squares, mode="clip")
            hides &= left > 0
            hidden.reshape(-1)[numbers[hides]] = True
            for values, step in zip(at, steps, strict=True):
                np.add(values, step, out=values)
            np.subtract(left, 1.0, out=left)
            kept = ~hides & (left > 0)
            if np.count_nonzero(kept) <= _FEW * len(kept):
                rows = np.flatnonzero(kept)
                numbers, left = numbers[rows], left[rows]
                at, steps = ([part[rows] for part in parts] for parts in (at, steps))
        return hidden

    def _axes(
        self, middles: FloatArray, radii: FloatArray, tops: FloatArray, eyes: FloatArray
    ) -> tuple[IntArray, list[FloatArray], FloatArray, list[FloatArray]]:
        """Returns the first point of each axis, as close to the actor as possible.

        Returns
        -------
        numbers : [n] numbers of eye and actor
        points : x and y [n] in squares from the corner, and an altitude [n] (m) above all lines
            of sight there
        left : [n] remaining steps to the eye, > 0
        steps : x, y and altitude [n] from each point to the next
        """
        at = (middles - self.corner) / self.size
        inside = ((at > 0) & (at < self.tops.shape)).all(axis=1)
        way = eyes[:, None, :2] - middles
        away = np.sqrt(way[..., 0] ** 2 + way[..., 1] ** 2)
        first = radii.max(initial=0.0) + _DEPTH
        eye, actor = np.nonzero((away > first) & inside)
        way, away = way[eye, actor], away[eye, actor]
        step = self.step / away  # share of the way
        x, y = (way.T / self.size) * step
        height, top = eyes[eye, 2], tops[actor]
        rise = np.maximum(height - top, 0.0) / (away + radii[actor])  # m per metre
        begin = first / self.step  # steps
        points = [
            at[actor, 0] + begin * x,
            at[actor, 1] + begin * y,
            np.maximum(height, top) + _DEPTH - rise * (away - first),
        ]
        steps = [x, y, rise * away * step]
        return eye * len(radii) + actor, points, 1 / step - begin, steps


_SLACK = 1e-7  # m; much more than the rounding of coordinates
_ROUNDING = 1e-9  # relative; much more than the rounding of areas
_AT_ONCE = 20_000  # orientations times eyes times actors; fits into the processor's cache


class UnhiddenViews:
    """Views of states as if hardly anything hid anybody: an upper bound on coverage.

    Several threads may use it.
    """

    def __init__(self, views: StateViews) -> None:
        self._views = views
        self._screens = _screens_of(views.geometry) if isinstance(views, PinholeViews) else None

    def at(self, t: int, reachable: BoolArray) -> SeenColumns:
        """Returns upper bounds on the coverage of each face from states [S] at step t; nothing if
        unreachable.

        For a camera that sees through obstacles, the bound is exact. All counted people of whom any
        part may be visible count as seen.
        """
        views = self._views
        if self._screens is None or not isinstance(views, PinholeViews):
            states = np.flatnonzero(reachable)
            seen = views.seen(t * views.n_states + states)
            counts = np.zeros(views.n_states, dtype=np.int64)
            counts[states] = seen.counts
            return seen._replace(counts=counts)
        wanted = reachable.reshape(len(views.axes), -1)
        places = np.flatnonzero(wanted.any(axis=0))
        if not views.n_faces or not len(places):
            return SeenColumns.nothing(views.n_states)
        eyes, planes = views.eyes(places), views.geometry.planes(t)
        hidden = self._screens.hide(
            planes.middles[:, :2], planes.radii, planes.middles[:, 2] + planes.halves, eyes
        )
        scene = _FacesFrom(views.camera, planes, views.problem.face_owner, eyes, ~hidden)
        size = max(_AT_ONCE // max(len(eyes) * len(planes.reaches), 1), 1)
        parts = [
            scene.seen(views.axes[k : k + size], wanted[k : k + size, places], k)
            for k in range(0, len(views.axes), size)
        ]
        rows, faces, pixels = (np.concatenate(column) for column in zip(*parts, strict=True))
        states = np.arange(len(views.axes))[:, None] * views.graph.n_places + places
        rows = states.take(rows)
        of_faces = SeenFaces(np.bincount(rows, minlength=views.n_states), faces, pixels)
        if views.at_least is None:
            return SeenColumns(*of_faces)
        people = len(views.problem.actors)
        pairs = np.unique(rows * people + views.problem.face_owner[faces])
        return SeenColumns.merged(of_faces, *np.divmod(pairs, people), views.n_faces)


_SCREENS: WeakKeyDictionary[FaceGeometry, Screens] = WeakKeyDictionary()


def _screens_of(geometry: FaceGeometry) -> Screens:
    """Returns the squares of the map that are well inside a column, cached for each geometry."""
    if geometry not in _SCREENS:
        resolution = geometry.problem.height_map.resolution
        _SCREENS[geometry] = Screens.of(geometry.columns, resolution, geometry.radius)
    return _SCREENS[geometry]


class _FacesFrom:
    """The faces at one step, as seen from some eyes [n]."""

    def __init__(
        self, camera: Camera, planes: Planes, owners: IntArray, eyes: FloatArray, open_to: BoolArray
    ) -> None:
        self._planes, self._eyes, self._focal = planes, eyes, camera.focal
        self._open = open_to
        self._slopes = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
        ahead = _dots(eyes, planes.normals) - dot(planes.normals, planes.centres)  # [n, F]
        eye, self._faces = np.nonzero((ahead > -_SLACK) & open_to[:, owners])  # turned to the eye
        # px m per square metre of a triangle, before division by its depths.
        self._density = np.maximum(ahead[eye, self._faces] + _SLACK, 0.0)
        self._density *= camera.focal**2 * (1 + _ROUNDING) / planes.areas[self._faces]
        # Those of one actor from one eye are contiguous.
        pairs = len(eyes) * len(planes.reaches)
        self._counts = np.bincount(eye * len(planes.reaches) + owners[self._faces], minlength=pairs)
        self._first = np.cumsum(self._counts) - self._counts
        sides = planes.polygons[:, 1:] - planes.polygons[:, :1]  # [F, V-1, 3]
        crosses = np.cross(sides[:, :-1], sides[:, 1:])
        self._triangles = np.sqrt(dot(crosses, crosses)).T / 2  # [V-2, F] m2

    def seen(
        self, axes: FloatArray, wanted: BoolArray, first: int
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Returns states, faces and coverage of some orientations [O].

        Parameters
        ----------
        first : number of the first orientation
        """
        ways = np.moveaxis(axes, 1, 0)  # [3, O, 3]
        eyes = [_dots(way, self._eyes) for way in ways]  # [O, n] m each
        orientation, eye, actor, whole = self._in_view(ways, eyes, wanted[..., None] & self._open)
        pair = eye * len(self._planes.reaches) + actor
        counts = self._counts[pair]
        entry = np.repeat(np.arange(len(counts)), counts)
        turned = spans(self._first[pair], counts)
        face = self._faces[turned]
        state = (orientation * len(self._eyes) + eye)[entry]
        faces = (orientation * len(self._planes.areas))[entry] + face
        vertices = np.moveaxis(self._planes.polygons, 1, 0)  # [V, F, 3]
        corners = [[_dots(way, vertex).ravel() for vertex in vertices] for way in ways]

        def off(k: int, states: IntArray, turned: IntArray) -> list[FloatArray]:
            """Returns each corner's offset [n] to the right, up or ahead (k = 0, 1, 2)."""
            here = eyes[k].take(states)
            return [corner.take(turned) - here for corner in corners[k]]

        depth = off(2, state, faces)
        pixels = self._of_whole(depth, face) * self._density[turned]
        cut = np.flatnonzero(~whole[entry])
        beside = [off(k, state[cut], faces[cut]) for k in (0, 1)]
        pixels[cut] = self._of_cut(beside, [d[cut] for d in depth], face[cut], pixels[cut])
        seen = np.flatnonzero(pixels)
        return state[seen] + first * len(self._eyes), face[seen], pixels[seen]

    def _in_view(
        self, ways: FloatArray, eyes: list[FloatArray], wanted: BoolArray
    ) -> tuple[IntArray, IntArray, IntArray, BoolArray]:
        """Returns the requested actors [O, n, A] that may be in the image of states.

        Parameters
        ----------
        ways : [3, O, 3] right, up and forward
        eyes : [O, n] m, coordinates along each of them

        Returns
        -------
        orientations, eyes, actors : [m] numbers, in the order of the states
        whole : [m] True if the whole actor is in the image
        """
        right, up, depth = (
            _dots(way, self._planes.middles)[:, None] - eye[..., None]  # [O, n, A] m
            for way, eye in zip(ways, eyes, strict=True)
        )
        # Distance from the nearest side of the image, inwards, m.
        room = np.minimum(*(
            (slope * depth - np.abs(off)) / np.hypot(1.0, slope)
            for slope, off in zip(self._slopes, (right, up), strict=True)
        ))  # fmt: skip
        reach = self._planes.reaches + _SLACK
        found = np.nonzero((room >= -reach) & wanted)
        return *found, room[found] >= reach[found[2]]

    def _of_whole(self, depth: list[FloatArray], face: IntArray) -> FloatArray:
        """Returns the coverage [n] of faces that the border does not cut, per unit of density.

        Parameters
        ----------
        depth : depth of each corner [n] m
        """
        first, *others = (1 / np.maximum(d, _SLACK) for d in depth)
        total = np.zeros(len(face))
        for areas, here, there in zip(self._triangles, others, others[1:], strict=False):
            total += areas.take(face) * here * there
        return total * first

    def _of_cut(
        self, beside: list[list[FloatArray]], depth: list[FloatArray], face: IntArray,
        whole: FloatArray,
    ) -> FloatArray:  # fmt: skip
        """Returns an upper bound on the coverage [n] of faces that the border may cut.

        Parameters
        ----------
        beside, depth : coordinates of each corner to the right, up and ahead of the camera [n] m
        whole : [n] coverage if the border does not cut them
        """
        behind = np.minimum.reduce(depth) <= _SLACK
        least = self._focal**2 / self._planes.areas[face]
        for off, slope in zip(beside, self._slopes, strict=True):
            with np.errstate(divide="ignore", invalid="ignore"):
                at = [a / d for a, d in zip(off, depth, strict=True)]
            low, high = np.minimum.reduce(at), np.maximum.reduce(at)
            low = np.where(behind, -slope, np.maximum(low, -slope))
            high = np.where(behind, slope, np.minimum(high, slope))
            least *= np.where(high < low - _ROUNDING, 0.0, np.maximum(high - low, 0) + _ROUNDING)
        return np.where(behind, least, np.minimum(least, whole))


def _dots(a: FloatArray, b: FloatArray) -> FloatArray:
    """Returns the inner products [n, m] of vectors [n, 3] and [m, 3], in a fixed order."""
    return dot(a[:, None], b)
