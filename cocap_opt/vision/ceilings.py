"""Upper bounds on the views of all states at some places, as if nothing hid anybody.

They bound coverage that a limit has left unknown; coverage itself does not use them.
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.projection import dot
from cocap_opt.vision.sights import ON_THE_EDGE
from cocap_opt.vision.views import ConeViews, PinholeViews, StateViews

_AT_ONCE = 200_000  # orientations times places times actors; fits into the processor's cache
_SLACK = 1e-7  # m; much more than the rounding of coordinates


class Ceiling(NamedTuple):
    """Upper bounds on the views of all states at places, weighted and added up."""

    roots: FloatArray  # [O, n] of all faces' roots of px/m2
    pixels: FloatArray  # [O, n] of all faces' px/m2
    people: FloatArray  # [O, n] of counted people
    visible: BoolArray  # [W] True if one of the states may see the face or person


def ceiling(views: StateViews, t: int, places: IntArray, weights: FloatArray) -> Ceiling:
    """Returns an upper bound on the views of all states at places [n] at step t.

    It takes much less time than coverage, since nothing is clipped.

    Parameters
    ----------
    weights : [W] weights of the faces and of counted people
    """
    if not views.n_faces or not len(places):
        none = np.zeros((views.graph.n_orientations, len(places)))
        return Ceiling(none, none, none, np.zeros(views.width, dtype=bool))
    if isinstance(views, PinholeViews):
        return _of_pinhole(views, t, places, weights)
    assert isinstance(views, ConeViews)
    return _of_cone(views, t, places, weights)


def _of_pinhole(views: PinholeViews, t: int, places: IntArray, weights: FloatArray) -> Ceiling:
    """Returns an upper bound on the views of all states at places [n] at step t.

    For a face of area A, with the eye at distance h in front of its plane, the image has

        (1 / A) integral over the face of focal^2 h / depth^3 <= focal^2 h / (smallest depth)^3

    pixels per square metre. Parts of an actor in the image are no closer than its middle less the
    extent of its cylinder, in depth, or, in distance, less the radius of its sphere; the angle of
    the image's corners turns this distance into a depth.
    """
    camera, planes, owners = views.camera, views.geometry.planes(t), views.problem.face_owner
    weights, of_people = np.split(weights, [views.n_faces])
    slopes = camera.width / 2 / camera.focal, camera.height / 2 / camera.focal
    cosine_at_corner = 1 / math.hypot(1.0, *slopes)
    right, up, forward = np.moveaxis(views.axes, 1, 0)  # [O, 3] each
    by_actor = partial(_by_actor, owners=owners, n_actors=len(planes.reaches))
    # Extent of an upright cylinder towards the camera, from its middle [O, 1, A] m.
    level, steep = np.hypot(forward[:, 0], forward[:, 1]), np.abs(forward[:, 2])
    reach = np.outer(level, planes.radii) + np.outer(steep, planes.halves) + _SLACK
    margins = [(planes.reaches + _SLACK) * math.hypot(1.0, slope) for slope in slopes]
    most = by_actor(camera.width * camera.height / planes.areas * weights)
    of_actors = by_actor(weights)
    parts = []
    for chunk in _chunks(places, len(views.axes) * len(planes.reaches)):
        eyes = views.eyes(chunk)
        ahead = eyes @ planes.normals.T - dot(planes.normals, planes.centres)  # m, [n, F]
        turned = ahead > -_SLACK
        ahead = np.maximum(ahead + _SLACK, 0)
        u, v, depth = (
            (axis @ planes.middles.T)[:, None] - (axis @ eyes.T)[..., None]  # [O, n, A] m
            for axis in (right, up, forward)
        )
        in_view = slopes[0] * depth - np.abs(u) >= -margins[0]
        in_view &= slopes[1] * depth - np.abs(v) >= -margins[1]
        orientation, place, actor = np.nonzero(in_view)
        ways = planes.middles - eyes[:, None]
        nearest = (np.sqrt(dot(ways, ways)) - planes.reaches) * cosine_at_corner
        nearest = np.maximum(depth[in_view] - reach[orientation, actor], nearest[place, actor])
        inverse = camera.focal**2 / np.maximum(nearest, _SLACK) ** 3
        pixels = np.minimum(inverse * by_actor(ahead * weights)[place, actor], most[actor])
        # By the Cauchy-Schwarz inequality, over the faces of an actor.
        roots = np.sqrt(pixels * of_actors[actor])
        at, size = orientation * len(chunk) + place, (len(views.axes), len(chunk))
        visible = in_view.any(axis=0)[:, owners] & turned
        parts.append(Ceiling(
            np.bincount(at, roots, math.prod(size)).reshape(size).astype(np.float64),
            np.bincount(at, pixels, math.prod(size)).reshape(size).astype(np.float64),
            *_people(in_view, of_people, visible),
        ))  # fmt: skip
    return _joined(parts)


def _of_cone(views: ConeViews, t: int, places: IntArray, weights: FloatArray) -> Ceiling:
    """Returns an upper bound on the views of all states at places [n] at step t.

    The whole horizontal distance to a face counts as straight ahead.
    """
    headings, owners = views.graph.motion.headings, views.problem.face_owner
    weights, of_people = np.split(weights, [views.n_faces])
    first = np.searchsorted(owners, np.arange(len(views.problem.actors)))
    parts = []
    for chunk in _chunks(places, headings * len(first)):
        eyes = views.eyes(chunk)
        yaw = 2 * np.pi * np.arange(headings)[:, None] / headings
        detected = np.stack(  # [O, n, A]
            [views.sight.detected(t, eyes, heading, 2 * ON_THE_EDGE) for heading in yaw]
        )
        ways, turned = views.sight.ways(t, eyes)
        seen = views.sight.law(np.hypot(ways[..., 0], ways[..., 1]), turned, ways)
        roots, pixels = (
            (detected * np.add.reduceat(values, first, axis=1)).sum(axis=-1)
            for values in (np.sqrt(seen) * weights, seen * weights)
        )
        noticed = np.asarray(detected.any(axis=0))
        visible = noticed[:, owners] & (seen > 0)
        parts.append(Ceiling(roots, pixels, *_people(detected, of_people, visible)))
    return _joined(parts)


def _people(
    in_view: BoolArray, weights: FloatArray, visible: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Returns the sums [O, n] over people in view [O, n, A], and True for columns [W] that may be
    seen.

    Parameters
    ----------
    weights : [A] weights of the people; empty if they are not counted
    visible : [n, F] True if a face may be seen from a place
    """
    faces = np.asarray(visible.any(axis=0))
    if not len(weights):
        return np.zeros(in_view.shape[:2], dtype=np.float64), faces
    sums: FloatArray = in_view @ weights
    return sums, np.concatenate([faces, in_view.any(axis=(0, 1))])


def _joined(parts: list[Ceiling]) -> Ceiling:
    """Returns the ceiling of all places, given those of parts of the places."""
    *sums, visible = zip(*parts, strict=True)
    roots, pixels, people = (np.concatenate(part, axis=1) for part in sums)
    return Ceiling(roots, pixels, people, np.any(visible, axis=0))


def _by_actor(values: FloatArray, owners: IntArray, n_actors: int) -> FloatArray:
    """Returns the sums [.., A] of values [.., F] over each actor's faces."""
    first = np.searchsorted(owners, np.arange(n_actors))
    sums: FloatArray = np.add.reduceat(values, first, axis=-1)
    return sums


def _chunks(places: IntArray, size: int) -> list[IntArray]:
    """Returns places [n] in sufficiently small parts.

    Parameters
    ----------
    size : number of orientations times actors
    """
    return np.array_split(places, -(-len(places) * size // _AT_ONCE))
