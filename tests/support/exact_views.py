"""Exact coverage of single faces by slow loops: the oracle of `cocap_opt.vision`.

It shares no code with it. A body is a list of half-spaces n . x <= o. A point p is hidden by it if
for some u >= 1 all n . (p - eye) <= u (o - n . eye); eliminating u from all pairs of half-spaces
leaves half-spaces for p. What these leave of a face is brought to the image, and the area of the
union of all hidden images is found by cutting the image into slabs in which no two edges cross.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np

from cocap_opt.problem import Camera, Cuboid, Prism, Problem, State

Point = tuple[float, ...]
HalfSpace = tuple[Point, float]
IN_ITS_PLANE = 1e-9  # m; an eye that is no farther before a face sees nothing of it
FLUSH = 1e-6  # m; a face that is nowhere deeper behind a plane lies in it, and is not hidden


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Inner product."""
    return sum(x * y for x, y in zip(a, b, strict=True))


def minus(a: Sequence[float], b: Sequence[float]) -> Point:
    """Difference."""
    return tuple(x - y for x, y in zip(a, b, strict=True))


def cross(a: Sequence[float], b: Sequence[float]) -> Point:
    """Vector product."""
    return (
        a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0],
    )  # fmt: skip


def clipped(polygon: list[Point], normal: Sequence[float], offset: float) -> list[Point]:
    """The part of a convex polygon where normal . p <= offset."""
    result: list[Point] = []
    for k, p in enumerate(polygon):
        q = polygon[(k + 1) % len(polygon)]
        a, b = dot(normal, p) - offset, dot(normal, q) - offset
        if a <= 0:
            result.append(p)
        if (a < 0 < b) or (b < 0 < a):
            s = a / (a - b)
            result.append(tuple(x + s * (y - x) for x, y in zip(p, q, strict=True)))
    return result


def columns(problem: Problem) -> list[list[HalfSpace]]:
    """Every cell of the map as a body of its own."""
    heights, size = problem.height_map.heights, problem.height_map.resolution
    ox, oy = problem.height_map.origin
    return [
        [
            ((0.0, 0.0, 1.0), float(heights[i, j])),
            ((-1.0, 0.0, 0.0), -(ox + i * size)), ((1.0, 0.0, 0.0), ox + (i + 1) * size),
            ((0.0, -1.0, 0.0), -(oy + j * size)), ((0.0, 1.0, 0.0), oy + (j + 1) * size),
        ]
        for i in range(heights.shape[0])
        for j in range(heights.shape[1])
    ]  # fmt: skip


def placed(problem: Problem, actor: int, t: int, polygon: np.ndarray) -> list[Point]:
    """A polygon of an actor's shape in the world."""
    x, y, z, yaw = problem.actors[actor].poses[t].tolist()
    c, s = math.cos(yaw), math.sin(yaw)
    return [(x + c * a - s * b, y + s * a + c * b, z + h) for a, b, h in polygon.tolist()]


def body(problem: Problem, actor: int, t: int) -> list[HalfSpace]:
    """The planes of an actor."""
    shape = problem.actors[actor].shape
    if not isinstance(shape, Prism):
        shape = Cuboid(length=shape.length, width=shape.width, height=shape.height)
    planes = []
    for face in shape.faces():
        p = placed(problem, actor, t, face)
        normal = cross(minus(p[1], p[0]), minus(p[2], p[0]))
        length = math.sqrt(dot(normal, normal))
        normal = tuple(x / length for x in normal)
        planes.append((normal, dot(normal, p[0])))
    return [*planes, ((0.0, 0.0, -1.0), -float(problem.actors[actor].poses[t, 2]))]


def hidden_by(planes: list[HalfSpace], eye: Point, face: list[Point]) -> list[HalfSpace] | None:
    """Half-spaces whose common part the body hides from the eye; None if it hides no face part."""
    room = [(n, o, o - dot(n, eye)) for n, o in planes]
    turned = [(n, o, r) for n, o, r in room if r <= 0]
    away = [(n, o, r) for n, o, r in room if r > 0]
    if any(all(dot(n, p) > o - FLUSH for p in face) for n, o, _ in turned):
        return None
    result = [(n, o) for n, o, _ in turned]
    for n, _, r in turned:  # u <= n . (p - eye) / r
        for m, _, q in away:  # u >= m . (p - eye) / q
            both = tuple(q * x - r * y for x, y in zip(n, m, strict=True))
            result.append((both, dot(both, eye)))
    return result


def area(polygons: list[list[tuple[float, float]]]) -> float:
    """Area of the union of convex polygons in the plane."""
    return over_union(polygons, lambda _, low, high: high - low, 1)


def solid_angle(polygons: list[list[tuple[float, float]]], focal: float) -> float:
    """Solid angle of the union of convex polygons in an image, seen from its camera."""

    def inner(x: float, low: float, high: float) -> float:
        square = x * x + focal * focal
        ends = [y / math.sqrt(square + y * y) for y in (low, high)]
        return focal / square * (ends[1] - ends[0])

    return over_union(polygons, inner, 20)


def excess(corners: list[Point]) -> float:
    """Solid angle of a convex polygon from the origin, by its angles on the sphere (Girard)."""
    total = (2.0 - len(corners)) * math.pi
    for k, p in enumerate(corners):
        before, after = cross(corners[k - 1], p), cross(p, corners[(k + 1) % len(corners)])
        across = cross(before, after)
        total += math.atan2(math.sqrt(dot(across, across)), -dot(before, after))
    return total


def over_union(
    polygons: list[list[tuple[float, float]]],
    inner: Callable[[float, float, float], float],
    nodes: int,
) -> float:
    """Integral over the union of convex polygons in the plane.

    Parameters
    ----------
    inner : the integral over y, of x and the ends of the span
    nodes : of Gauss and Legendre, over x, in each slab
    """
    edges = []
    for polygon in polygons:
        for k, p in enumerate(polygon):
            edges.append((p, polygon[(k + 1) % len(polygon)]))
    cuts = {p[0] for p, _ in edges}
    for (a, b), (c, d) in combinations(edges, 2):
        det = (b[0] - a[0]) * (d[1] - c[1]) - (b[1] - a[1]) * (d[0] - c[0])
        if det:
            s = ((c[0] - a[0]) * (d[1] - c[1]) - (c[1] - a[1]) * (d[0] - c[0])) / det
            if 0 <= s <= 1:
                cuts.add(a[0] + s * (b[0] - a[0]))
    total, ordered = 0.0, sorted(cuts)
    places, weights = np.polynomial.legendre.leggauss(nodes)
    for left, right in pairwise(ordered):
        half = (right - left) / 2
        for place, weight in zip(places.tolist(), weights.tolist(), strict=True):
            x = left + half * (1 + place)
            total += half * weight * sum(inner(x, *span) for span in union_at(polygons, x))
    return total


def union_at(polygons: list[list[tuple[float, float]]], x: float) -> Iterator[tuple[float, float]]:
    """The spans of the union of convex polygons along an upright line."""
    spans, end = [], -math.inf
    for polygon in polygons:
        ys = []
        for k, p in enumerate(polygon):
            q = polygon[(k + 1) % len(polygon)]
            if (p[0] <= x) != (q[0] <= x):
                ys.append(p[1] + (x - p[0]) / (q[0] - p[0]) * (q[1] - p[1]))
        if len(ys) >= 2:
            spans.append((min(ys), max(ys)))
    for low, high in sorted(spans):
        if high > end:
            yield max(low, end), high
            end = high


class FaceSeen(NamedTuple):
    """One face, as one view sees it."""

    actor: int
    area: float  # m2
    pixels: float
    visible: float  # sr
    unhidden: float  # sr


def exact_coverage(problem: Problem, robot: int, t: int, state: State) -> list[float]:
    """Coverage in px/m2 of every face from a robot's state at step t."""
    return [face.pixels / face.area for face in exact_faces(problem, robot, t, state)]


def exact_faces(problem: Problem, robot: int, t: int, state: State) -> list[FaceSeen]:
    """Every face from a robot's state at step t."""
    spec = problem.robots[robot]
    camera = spec.camera
    assert isinstance(camera, Camera)
    terrain = problem.height_map
    height = terrain.altitude(state.x, state.y, spec.motion.layers[state.layer])
    eye = (*terrain.centre(state.x, state.y), height)
    yaw, tilt = math.tau * state.heading / spec.motion.headings, camera.tilts[state.pitch]
    right = (math.sin(yaw), -math.cos(yaw), 0.0)
    ahead = (math.cos(tilt) * math.cos(yaw), math.cos(tilt) * math.sin(yaw), -math.sin(tilt))
    above = cross(right, ahead)
    sides = []
    for axis, size in ((right, camera.width), (above, camera.height)):
        for sign in (1, -1):
            normal = tuple(
                sign * a - size / 2 / camera.focal * f for a, f in zip(axis, ahead, strict=True)
            )
            sides.append((normal, dot(normal, eye)))

    def image(polygon: list[Point]) -> list[tuple[float, float]]:
        rays = [minus(p, eye) for p in polygon]
        scales = [camera.focal / dot(ray, ahead) for ray in rays]
        return [(k * dot(r, right), k * dot(r, above)) for k, r in zip(scales, rays, strict=True)]

    ground = columns(problem)
    result = list[FaceSeen]()
    for actor, person in enumerate(problem.actors):
        others = [body(problem, k, t) for k in range(len(problem.actors)) if k != actor]
        foot = float(person.poses[t, 2])
        walls = [c for c in ground if c[0][1] > min(foot, eye[2])]  # no lower one is between
        for face in person.shape.faces():
            polygon = placed(problem, actor, t, face)
            normal = cross(minus(polygon[1], polygon[0]), minus(polygon[2], polygon[0]))
            whole = polygon
            for n, o in sides:
                whole = clipped(whole, n, o)
            before = dot(normal, minus(eye, polygon[0])) / math.sqrt(dot(normal, normal))
            fan = [
                cross(minus(b, polygon[0]), minus(c, polygon[0])) for b, c in pairwise(polygon[1:])
            ]
            metres = sum(math.sqrt(dot(n, n)) for n in fan) / 2
            if before <= IN_ITS_PLANE:
                result.append(FaceSeen(actor, metres, 0.0, 0.0, 0.0))
                continue
            unhidden = excess([minus(p, eye) for p in polygon])
            if len(whole) < 3:
                result.append(FaceSeen(actor, metres, 0.0, 0.0, unhidden))
                continue
            hidden = []
            for planes in [*walls, *others]:
                shadow, part = hidden_by(planes, eye, polygon), whole
                if shadow is None:
                    continue
                for n, o in shadow:
                    part = clipped(part, n, o)
                    if len(part) < 3:
                        break
                else:
                    hidden.append(image(part))
            images = [image(whole)]
            pixels = max(area(images) - area(hidden), 0.0)
            visible = solid_angle(images, camera.focal) - solid_angle(hidden, camera.focal)
            result.append(FaceSeen(actor, metres, pixels, max(visible, 0.0), unhidden))
    return result
