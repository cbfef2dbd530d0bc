"""Finds the parts of faces that are visible from an eye, past the terrain and other actors.

Most actors are completely visible or completely hidden. If the shadow of a convex body falls on a
part of an actor, the pieces of its faces outside all shadows are computed exactly. Behind meshes
that are not convex, rays to points spread over a piece sample the visible share.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Problem
from cocap_opt.vision.bodies import Bodies
from cocap_opt.vision.candidates import Skyline
from cocap_opt.vision.faces import FaceGeometry, Faces
from cocap_opt.vision.projection import Projection, dot
from cocap_opt.vision.shadows import Shadows

if TYPE_CHECKING:
    from cocap_opt.vision.surfaces import Surface

IN_ITS_PLANE = 1e-9  # m; an eye in front of a face by no more than this does not see it
_AT_ONCE = 50_000  # shadows at once, which limits memory
_POINTS = 300_000  # points behind meshes at once, which limits memory
LEAST = 1e-300  # m2, for an eye in the middle of an actor


class _Veil(NamedTuple):
    """Points on pieces of faces behind meshes that are not convex, and the outcome of their
    rays.
    """

    share: FloatArray  # [q] 0 or 1 for pieces of which no point or every point is visible; else nan
    number: IntArray  # [q] row of each of the other pieces
    points: FloatArray  # [v, M, 3] m, relative to the eye
    areas: FloatArray  # [v, M] area represented by each point, up to a factor
    seen: BoolArray  # [v, M]

    def shares(
        self, pieces: IntArray, wanted: BoolArray, projection: Projection, axes: FloatArray,
        with_angles: bool,
    ) -> FloatArray:  # fmt: skip
        """Returns the visible shares [1, n] of pieces' images, or [2, n] with those of solid
        angles.

        Parameters
        ----------
        pieces, wanted : [n] numbers of the pieces, and True if they have an image
        axes : [n, 3, 3] right, up and forward of each camera
        with_angles : True: also return the shares of solid angles
        """
        shares = np.tile(self.share[pieces], (1 + with_angles, 1))
        mixed = np.flatnonzero(np.isnan(shares[0]) & wanted)
        most = max(_POINTS // max(self.points.shape[1], 1), 1)
        for first in range(0, len(mixed), most):
            batch = mixed[first : first + most]
            row = self.number[pieces[batch]]
            points = np.stack(
                [dot(self.points[row], axes[batch][:, None, k]) for k in range(3)], axis=-1
            )
            inside = (projection.frustum_distances(points) > 0).all(axis=-1)
            # For a piece of a plane, the image is proportional to the inverse cube of the depth,
            # and the solid angle to that of the distance.
            for k, share in enumerate(shares):
                away = np.sqrt(dot(points, points)) if k else points[..., 2]
                away = np.where(inside, away, 1.0)
                weights = inside * self.areas[row] / (away * away * away)
                # Added one by one, so that the result does not depend on the number of points.
                which, point = np.nonzero(weights)
                weight = weights[which, point]
                whole = np.bincount(which, weights=weight, minlength=len(row))
                arrived = weight * self.seen[row[which], point]
                seen = np.bincount(which, weights=arrived, minlength=len(row))
                share[batch] = np.where(whole > 0, seen / np.where(whole > 0, whole, 1.0), 0.0)
        return np.nan_to_num(shares)


class Sightings(NamedTuple):
    """The views from E eyes: whole faces, pieces of n other faces, and nothing of the rest."""

    whole: BoolArray  # [E, F] True if the whole face is visible, if it is in the image
    eyes: IntArray  # [n] increasing
    faces: IntArray  # [n] increasing for each eye
    first: IntArray  # [n] number of the first piece
    counts: IntArray  # [n] number of pieces
    pieces: FloatArray  # [q, V, 3] m, relative to the eye
    veil: _Veil | None  # outcome of rays to the pieces; None if there are no such meshes


# The shadows that fall on parts of n actors, from one eye each: an array [n], True if bodies are
# known to hide the whole actor; the number [n] of the first shadow; the number of shadows [n]; and
# the shadows.
_Shaded = tuple[BoolArray, IntArray, IntArray, Shadows]


class Visibility:
    """Finds the parts of a problem's faces that are visible from any eye."""

    def __init__(self, geometry: FaceGeometry, problem: Problem) -> None:
        self._mesh = geometry.mesh
        self._owners = problem.face_owner
        self._samples = problem.face_samples
        self._take_of = problem.take_of if problem.takes else None

    def of(self, faces: Faces, steps: IntArray, eyes: FloatArray, wanted: BoolArray) -> Sightings:
        """Returns the faces and parts of faces visible from eyes [E, 3], each at a step [E].

        Parameters
        ----------
        steps : steps, counted from the first step of `faces`
        wanted : [E, A] True for relevant actors
        """
        eye, actor = np.nonzero(wanted)
        hidden, first, counts, shadows = self._shaded(faces, steps[eye], eyes[eye], actor)
        veiled = np.zeros(len(eye), dtype=bool)
        if self._mesh is not None:
            rest = np.flatnonzero(~hidden)
            at = eye[rest]
            share = self._share_past_mesh(self._mesh, faces, steps[at], eyes[at], actor[rest])
            hidden[rest[share == 0]] = True
            veiled[rest] = share < 1
        pair = np.full(wanted.shape, -1)
        pair[eye, actor] = np.arange(len(eye))
        open_to = np.zeros(wanted.shape, dtype=bool)
        open_to[eye, actor] = ~hidden
        in_part = np.zeros(wanted.shape, dtype=bool)
        in_part[eye, actor] = ~hidden & ((counts > 0) | veiled)
        # Only faces that are turned to the eye are visible.
        eye, face = np.nonzero(open_to[:, self._owners])
        to_eye = eyes[eye] - faces.polygons[steps[eye], face, 0]
        ahead = dot(to_eye, faces.normals[steps[eye], face]) > IN_ITS_PLANE
        eye, face = eye[ahead], face[ahead]
        cut = in_part[eye, self._owners[face]]
        whole = np.zeros((len(eyes), len(self._owners)), dtype=bool)
        whole[eye[~cut], face[~cut]] = True
        eye, face = eye[cut], face[cut]
        number = pair[eye, self._owners[face]]
        polygons = faces.polygons[steps[eye], face] - eyes[eye, None]
        pieces, owners = shadows.outside(polygons, first[number], counts[number])
        of_face = np.bincount(owners, minlength=len(eye))
        veil = None
        if self._mesh is not None:
            behind = np.flatnonzero(veiled[number][owners])
            veil = self._veil(self._mesh, pieces, behind, eyes[eye[owners]])
        return Sightings(whole, eye, face, np.cumsum(of_face) - of_face, of_face, pieces, veil)

    def _veil(
        self, mesh: "Surface", pieces: FloatArray, behind: IntArray, eyes: FloatArray
    ) -> _Veil:
        """Casts rays to points spread over some pieces.

        Parameters
        ----------
        pieces : [q, V, 3] m, relative to the eye
        behind : [v] numbers of those pieces
        eyes : [q, 3] m, eye of each piece
        """
        share, number = np.ones(len(pieces)), np.zeros(len(pieces), dtype=np.int64)
        parts = []
        a, b = _equal_parts(self._samples)
        size = len(a) * pieces.shape[1]
        first = 0
        for part in np.array_split(behind, max(-(-len(behind) * size // _POINTS), 1)):
            polygons = pieces[part]
            middle = _centroids(polygons)[:, None]
            relative = polygons - middle
            other = np.concatenate([relative[:, 1:], relative[:, :1]], axis=1)
            points = (
                middle[:, :, None]
                + a[:, None] * relative[:, :, None]
                + b[:, None] * other[:, :, None]
            ).reshape(len(part), size, 3)
            starts = np.repeat(eyes[part], size, axis=0)
            seen = mesh.lets_pass(starts, starts + points.reshape(-1, 3)).reshape(-1, size)
            share[part] = np.where(seen.all(axis=1), 1.0, np.where(seen.any(axis=1), np.nan, 0.0))
            mixed = np.flatnonzero(np.isnan(share[part]))
            number[part[mixed]] = first + np.arange(len(mixed))
            first += len(mixed)
            areas = np.linalg.norm(np.cross(relative[mixed], other[mixed]), axis=2) / len(a)
            parts.append((points[mixed], np.repeat(areas, len(a), axis=1), seen[mixed]))
        return _Veil(
            share, number, *(np.concatenate(column) for column in zip(*parts, strict=True))
        )

    def _shaded(self, faces: Faces, steps: IntArray, eyes: FloatArray, actors: IntArray) -> _Shaded:
        """Returns the shadows that fall on actors [n] from eyes [n, 3] at steps [n]."""
        corners = faces.corners[steps, actors] - eyes[:, None]
        targets = steps * faces.corners.shape[1] + actors
        skyline = Skyline(corners, eyes)
        fixed = faces.candidates.bodies
        sifted = skyline.sift(faces.candidates.of(targets, eyes), fixed)
        casting = _Casting(corners, eyes, skyline.hidden)
        casting.cast_in_turn(fixed, *sifted)
        rest = np.flatnonzero(~casting.hidden)
        pair, body = _near_actors(faces, steps[rest], eyes[rest], actors[rest], self._take_of)
        casting.cast(faces.bodies, rest[pair], body)
        return casting.result()

    def _share_past_mesh(
        self, mesh: "Surface", faces: Faces, steps: IntArray, eyes: FloatArray, actors: IntArray
    ) -> FloatArray:
        """Returns the share [n] of points spread over actors that rays from eyes [n, 3] reach."""
        targets = faces.points[steps, actors]
        size = targets.shape[1]
        seen = mesh.lets_pass(np.repeat(eyes, size, axis=0), targets.reshape(-1, 3))
        share: FloatArray = seen.reshape(len(eyes), size).mean(axis=1)
        return share


class _Casting:
    """Shadows cast on actors, a few at a time.

    Parameters
    ----------
    corners : [n, C, 3] m, of actors, relative to the eyes
    eyes : [n, 3] m
    hidden : [n] True if the whole actor is known to be hidden

    Attributes
    ----------
    hidden : the argument, kept up to date
    """

    def __init__(self, corners: FloatArray, eyes: FloatArray, hidden: BoolArray) -> None:
        self.hidden = hidden
        self._corners, self._eyes = corners, eyes
        self._found: list[tuple[IntArray, Shadows]] = []

    def cast_in_turn(self, bodies: Bodies, counts: IntArray, which: IntArray) -> None:
        """Casts the shadows of each actor's bodies, until one shadow contains the whole actor.

        Parameters
        ----------
        counts : [n] number of bodies of each actor
        which : their numbers, actor by actor
        """
        first = np.cumsum(counts) - counts
        done, size = 0, 1
        # More and more at once: the first bodies hide most of the hidden actors.
        while len(rest := np.flatnonzero(~self.hidden & (counts > done))):
            take = np.minimum(counts[rest] - done, size)
            at = spans(first[rest] + done, take)
            self.cast(bodies, np.repeat(rest, take), which[at])
            done, size = done + size, 2 * size

    def cast(self, bodies: Bodies, actors: IntArray, which: IntArray) -> None:
        """Casts the shadows of bodies [m] on actors [m]."""
        for first in range(0, len(actors), _AT_ONCE):
            actor, body = (part[first : first + _AT_ONCE] for part in (actors, which))
            shadows = Shadows.of(bodies, body, self._eyes[actor])
            beside, inside = shadows.sides(shadows.excess(self._corners[actor]))
            self.hidden[actor[inside]] = True
            part = np.flatnonzero(~beside & ~inside)
            if len(part):
                self._found.append((actor[part], shadows.taken(part)))

    def result(self) -> _Shaded:
        """Returns the shadows on parts of each actor, in the order in which they were cast."""
        if not self._found:
            none = np.zeros(len(self.hidden), dtype=np.int64)
            return self.hidden, none, none, Shadows.joined([])
        actor = np.concatenate([part for part, _ in self._found])
        order = np.argsort(actor, kind="stable")
        order = order[~self.hidden[actor[order]]]
        counts = np.bincount(actor[order], minlength=len(self.hidden))
        shadows = Shadows.joined([part for _, part in self._found]).taken(order)
        return self.hidden, np.cumsum(counts) - counts, counts, shadows


def _near_actors(
    faces: Faces, steps: IntArray, eyes: FloatArray, actors: IntArray, take_of: IntArray | None
) -> tuple[IntArray, IntArray]:
    """Returns the actors that stand, or almost stand, between eyes [n, 3] and actors [n].

    Parameters
    ----------
    take_of : [A] take of each actor; only actors of the same take are present. None: all are
        present

    Returns
    -------
    pairs, bodies : [m] each, position among the n actors, and number of the body
    """
    numbers, n_actors = np.arange(len(eyes)), len(faces.reaches)
    others = faces.middles[steps] - eyes[:, None]
    target = others[numbers, actors][:, None]
    square = np.maximum(dot(target, target), LEAST)
    along = np.clip(dot(others, target) / square, 0.0, 1.0)
    off = others - along[..., None] * target
    near = dot(off, off) <= (faces.reaches[actors, None] + faces.reaches) ** 2
    near[numbers, actors] = False
    if take_of is not None:
        near &= take_of[actors, None] == take_of
    pair, other = np.nonzero(near)
    return pair, steps[pair] * n_actors + other


def _equal_parts(samples: int) -> tuple[FloatArray, FloatArray]:
    """Returns barycentric coordinates [n] of the centroids of equal parts of a triangle.

    There are n = `samples` squared parts.
    """
    rows = [
        (i + third, j + third)
        for third, size in ((1 / 3, samples), (2 / 3, samples - 1))
        for i in range(size)
        for j in range(size - i)
    ]
    a, b = (np.array(rows) / samples).T
    return a, b


def _centroids(polygons: FloatArray) -> FloatArray:
    """Returns the centroids [n, 3] of convex polygons [n, V, 3].

    The result does not depend, to the last bit, on how often the last vertex is repeated.
    """
    off = polygons - polygons[:, :1]
    total, sums = np.zeros(len(polygons)), np.zeros((len(polygons), 3))
    for k in range(1, polygons.shape[1] - 1):
        cross = np.cross(off[:, k], off[:, k + 1])
        area = np.sqrt((cross[:, 0] ** 2 + cross[:, 1] ** 2) + cross[:, 2] ** 2)
        total += area
        sums += area[:, None] * (off[:, k] + off[:, k + 1])
    result: FloatArray = polygons[:, 0] + sums / (3 * np.where(total > 0, total, 1.0))[:, None]
    return result
