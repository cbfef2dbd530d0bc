"""Views as if hardly anything hid anybody: an upper bound on coverage that costs little.

Nobody is seen whom a single column is known to hide (`screens`); nothing else hides anybody.

The image of a triangle that is before the camera, with corners e1, e2, e3 relative to the eye, has

    focal^2 |det(e1, e2, e3)| / (2 d1 d2 d3) = focal^2 area ahead / (d1 d2 d3)

pixels, where d are the corners' depths and the eye is `ahead` metres before the triangle's plane.
All but the depths is the same for all orientations of a camera. Of a face that the border of the
image may cut, no more is seen than the rectangle around its image has in the image.
"""

from weakref import WeakKeyDictionary

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Camera
from cocap_opt.vision.faces import FaceGeometry, Planes
from cocap_opt.vision.projection import dot
from cocap_opt.vision.screens import Screens
from cocap_opt.vision.views import NOTHING, PinholeViews, Seen, Views

_SLACK = 1e-7  # m, much more than the rounding of coordinates
_ROUNDING = 1e-9  # relative, much more than that of areas
_AT_ONCE = 20_000  # orientations times eyes times actors, for the processor's cache


class UnhiddenViews:
    """Views of states as if hardly anything hid anybody: an upper bound on coverage.

    Several threads may use it.
    """

    def __init__(self, views: Views) -> None:
        self._views = views
        self._screens = _screens_of(views.geometry) if isinstance(views, PinholeViews) else None

    def at(self, t: int, reachable: BoolArray) -> Seen:
        """Returns the most that the reachable states [S] may see of each face at step t.

        Its rows are the states, increasing. A camera that sees past obstacles sees what it sees.
        """
        views = self._views
        if self._screens is None or not isinstance(views, PinholeViews):
            states = np.flatnonzero(reachable)
            seen = views.seen(t * views.n_states + states)
            return seen._replace(rows=states[seen.rows])
        wanted = reachable.reshape(len(views.axes), -1)
        places = np.flatnonzero(wanted.any(axis=0))
        if not views.n_faces or not len(places):
            return NOTHING
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
        return Seen(states.take(rows), faces, pixels)


_SCREENS: WeakKeyDictionary[FaceGeometry, Screens] = WeakKeyDictionary()


def _screens_of(geometry: FaceGeometry) -> Screens:
    """Returns the squares of the map well inside of a column, made once for each geometry."""
    if geometry not in _SCREENS:
        resolution = geometry.problem.height_map.resolution
        _SCREENS[geometry] = Screens.of(geometry.columns, resolution, geometry.radius)
    return _SCREENS[geometry]


class _FacesFrom:
    """The faces at one step, as they are from some eyes [n]."""

    def __init__(
        self, camera: Camera, planes: Planes, owners: IntArray, eyes: FloatArray, open_to: BoolArray
    ) -> None:
        self._planes, self._eyes, self._focal = planes, eyes, camera.focal
        self._open = open_to
        self._slopes = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
        ahead = _dots(eyes, planes.normals) - dot(planes.normals, planes.centres)  # [n, F]
        eye, self._faces = np.nonzero((ahead > -_SLACK) & open_to[:, owners])  # turned to the eye
        # px m per square metre of a triangle, before the division by its depths.
        self._density = np.maximum(ahead[eye, self._faces] + _SLACK, 0.0)
        self._density *= camera.focal**2 * (1 + _ROUNDING) / planes.areas[self._faces]
        # Those of one actor from one eye stand one after the other.
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
            """Returns how far each corner [n] of faces is to the right, up or ahead (0, 1, 2)."""
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
        """Returns the actors, of those wanted [O, n, A], that may be in the image of states.

        Parameters
        ----------
        ways : [3, O, 3] right, up and forward
        eyes : [O, n] m along each of them

        Returns
        -------
        orientations, eyes, actors : [m] numbers, in the order of the states
        whole : [m] true if all of the actor is in the image
        """
        right, up, depth = (
            _dots(way, self._planes.middles)[:, None] - eye[..., None]  # [O, n, A] m
            for way, eye in zip(ways, eyes, strict=True)
        )
        # From the nearest side of the image, inwards, m.
        room = np.minimum(*(
            (slope * depth - np.abs(off)) / np.hypot(1.0, slope)
            for slope, off in zip(self._slopes, (right, up), strict=True)
        ))  # fmt: skip
        reach = self._planes.reaches + _SLACK
        found = np.nonzero((room >= -reach) & wanted)
        return *found, room[found] >= reach[found[2]]

    def _of_whole(self, depth: list[FloatArray], face: IntArray) -> FloatArray:
        """Returns the coverage [n] of faces that the border does not cut, per density.

        Parameters
        ----------
        depth : of each corner [n] m
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
        beside, depth : to the right, up, and ahead of the camera [n] m, of each corner
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
