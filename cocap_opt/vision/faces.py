"""Geometry of all actors' faces at every step, and the bodies that can hide them.

All coordinates are relative to a nearby point, as required for rays (`surfaces`); rays are used
only if a mesh is not convex.
"""

from collections import OrderedDict
from functools import cached_property, lru_cache
from threading import Lock
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from cocap_opt.arithmetic import cosines, sines
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import SceneData, Shape
from cocap_opt.vision.bodies import Bodies
from cocap_opt.vision.candidates import Candidates
from cocap_opt.vision.projection import dot

if TYPE_CHECKING:
    from cocap_opt.vision.surfaces import Surface

ROUNDING = 1e-6  # m; much more than the rounding of coordinates
_DRAWN_IN = 0.01  # relative shift towards the middle, so that no ray grazes the ground
_KEPT = 64  # spans of steps, and shapes, whose geometry is cached
_KEPT_BYTES = 256e6  # bytes of lists of bodies; above this, only a few spans are cached
_LEAST_KEPT = 4  # spans, in use by threads
_MOST_BOXES = 16  # boxes around starts; further ones are merged


class Faces(NamedTuple):
    """Geometry of all faces and actors at L steps; coordinates are relative to an origin."""

    first: int  # number of the first step
    polygons: FloatArray  # [L, F, V, 3] m; shorter polygons repeat their last vertex
    normals: FloatArray  # [L, F, 3] outward, unit length
    areas: FloatArray  # [F] m2
    centres: FloatArray  # [L, F, 3] m, centroids
    corners: FloatArray  # [L, A, C, 3] m for each actor; if there are fewer, the last is repeated
    middles: FloatArray  # [L, A, 3] m, of spheres around the actors
    reaches: FloatArray  # [A] m, radii of these spheres, including rounding
    points: FloatArray  # [L, A, N, 3] m, spread over each actor, shifted slightly inwards
    n_vertices: IntArray  # [F] number of vertices of each polygon, without repetitions
    n_corners: IntArray  # [A] number of corners of each actor
    bodies: Bodies  # L A bodies, step by step
    candidates: Candidates  # fixed bodies that can hide target l A + a


class Planes(NamedTuple):
    """All faces at one step with their planes, and spheres around the actors."""

    polygons: FloatArray  # [F, V, 3] m, shorter polygons repeat their last vertex
    normals: FloatArray  # [F, 3] outward, unit length
    centres: FloatArray  # [F, 3] m
    middles: FloatArray  # [A, 3] m
    areas: FloatArray  # [F] m2
    reaches: FloatArray  # [A] m, radii, including rounding
    radii: FloatArray  # [A] m, of upright cylinders around the same middles
    halves: FloatArray  # [A] m, half the heights of these cylinders


class Reach(NamedTuple):
    """The places that cameras can reach by each step: growing rectangles, seen from above."""

    boxes: tuple[tuple[float, ...], ...]  # m, smallest and largest x and y at step 0
    growth: float  # m per step, on each side

    @classmethod
    def around(cls, starts: FloatArray, growth: float) -> Self:
        """Returns the reach of cameras that start at places [k, 2] m."""
        starts = np.unique(starts, axis=0)
        ends = (starts, starts)
        if len(starts) > _MOST_BOXES:
            ends = starts.min(axis=0, keepdims=True), starts.max(axis=0, keepdims=True)
        return cls(tuple(map(tuple, np.hstack(ends).tolist())), growth)

    def at(self, step: int) -> FloatArray:
        """Returns the boxes [K, 4] m at a step, which contain those of the steps before."""
        wider = (self.growth * step + ROUNDING) * np.array([-1.0, -1.0, 1.0, 1.0])
        return np.asarray(np.array(self.boxes) + wider)

    def has(self, step: int, eyes: FloatArray) -> bool:
        """Returns True if places [n, 3] m are in the boxes of a step."""
        x, y = np.ascontiguousarray(eyes[:, :2].T)
        inside = np.zeros(len(eyes), dtype=bool)
        for left, low, right, high in self.at(step):
            inside |= (x >= left) & (x <= right) & (y >= low) & (y <= high)
        return bool(inside.all())


class FaceGeometry:
    """The faces of a problem's actors, computed on first use.

    Parameters
    ----------
    lowest_eye : lowest altitude of an eye, m; None: that of the lowest state

    Attributes
    ----------
    origin : [3] m, a point near the middle of the map, to which all coordinates are relative
    columns : upright boxes of the map; the first is the whole map at its lowest height
    fixed : these columns, and the convex meshes
    mesh : the meshes that are not convex, which need rays; None if there are none
    """

    def __init__(self, problem: SceneData, lowest_eye: float | None = None) -> None:
        self.problem = problem
        width, depth = problem.height_map.shape
        x, y = problem.height_map.centre(width // 2, depth // 2)
        self.origin = np.array([x, y, float(np.median(problem.height_map.heights))])
        solids = [Bodies.of_mesh(mesh, self.origin) for mesh in problem.meshes]
        rough = [
            m.corners - self.origin
            for m, solid in zip(problem.meshes, solids, strict=True)
            if solid is None
        ]
        self.mesh = _surface(np.concatenate(rough)) if rough else None
        convex = [solid for solid in solids if solid is not None]
        self.columns = Bodies.of_columns(problem.height_map, self.origin)
        self.fixed = Bodies.joined([self.columns, *convex])
        self._shapes = [local_faces(actor.shape) for actor in problem.actors]
        layers = sorted({height for robot in problem.robots for height in robot.motion.layers})
        lowest = problem.height_map.altitudes((layers[0],)).min()
        lowest = float(lowest) if lowest_eye is None else min(float(lowest), lowest_eye)
        self._lowest_eye = lowest - self.origin[2]
        self._kept, self._lock = OrderedDict[tuple[int, int, Reach | None], Faces](), Lock()

    @staticmethod
    def is_sampled(problem: SceneData) -> bool:
        """Returns True if rays sample part of the coverage, i.e. past meshes that are not
        convex.
        """
        return any(Bodies.of_mesh(mesh, np.zeros(3)) is None for mesh in problem.meshes)

    @property
    def radius(self) -> float:
        """Radius (m) of upright cylinders that contain any of the actors, including rounding."""
        return max((shape.radius for shape in self._shapes), default=0.0) + ROUNDING

    def at(self, t: int) -> Faces:
        """Returns the geometry at one step."""
        return self.between(t, t)

    def between(self, first: int, last: int, reach: Reach | None = None) -> Faces:
        """Returns the geometry at steps first..last; the most recent ones are cached.

        Parameters
        ----------
        reach : the region of all eyes, so that fewer bodies are listed (default: anywhere)
        """
        key = first, last, reach
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        faces = self._between(first, last, reach)
        with self._lock:
            self._kept[key] = faces
            total = sum(kept.candidates.nbytes for kept in self._kept.values())
            while len(self._kept) > _LEAST_KEPT and (
                total > _KEPT_BYTES or len(self._kept) > _KEPT
            ):
                _, oldest = self._kept.popitem(last=False)
                total -= oldest.candidates.nbytes
        return faces

    def room(
        self, steps: int, together: tuple[int, int], threads: int, reach: Reach | None
    ) -> float:
        """Returns the approximate bytes for lists of bodies while a table is made.

        Parameters
        ----------
        steps : number of steps of the table
        together : first and last step of the largest group that is requested together
        threads : number of threads, each of which may make a list in addition to the cached ones
        reach : the region of the table's eyes
        """
        last = self.problem.horizon
        of_step = self.between(last, last, reach).candidates.nbytes
        most = max(of_step, self.between(*together, reach).candidates.nbytes)
        kept = min(steps * of_step, max(_KEPT_BYTES, _LEAST_KEPT * most))
        return float(kept + 2 * threads * most)  # the parts, and all of them joined

    def planes(self, t: int) -> Planes:
        """Returns the planes of the faces at one step, without the bodies that can hide them."""
        moving, fixed = self._planes
        return Planes(*(part[t] for part in moving), *fixed)

    @cached_property
    def _planes(self) -> tuple[list[FloatArray], list[FloatArray]]:
        """Planes at all steps: moving parts, with steps as the first axis, and constant parts."""
        size = max((s.polygons.shape[1] for s in self._shapes), default=3)
        steps = self.problem.horizon + 1
        ways, none = np.zeros((steps, 0, 3)), np.zeros(0)
        moving = [(np.zeros((steps, 0, size, 3)), ways, ways, ways)]
        fixed = [(none, none, none, none)]
        for actor, shape in zip(self.problem.actors, self._shapes, strict=True):
            turned = _Turned(actor.poses[:steps] - [*self.origin, 0])
            moving.append((
                turned.points(_padded(shape.polygons, size)), turned.ways(shape.normals),
                turned.points(shape.centres), turned.points(shape.middle[None]),
            ))  # fmt: skip
            reach, radius, half = (
                np.array([x + ROUNDING]) for x in (shape.reach, shape.radius, shape.half)
            )
            fixed.append((shape.areas, reach, radius, half))
        return (
            [np.concatenate(column, axis=1) for column in zip(*moving, strict=True)],
            [np.concatenate(column) for column in zip(*fixed, strict=True)],
        )

    def _between(self, first: int, last: int, reach: Reach | None) -> Faces:
        """Returns the geometry at steps first..last for eyes within reach."""
        steps = last - first + 1
        poses = [actor.poses[first : last + 1] - [*self.origin, 0] for actor in self.problem.actors]
        size = max((s.polygons.shape[1] for s in self._shapes), default=3)
        spread = max((len(s.points) for s in self._shapes), default=1)
        most = max((len(s.corners) for s in self._shapes), default=1)
        polygons, normals, centres, corners = [], [], [], []
        middles, points, bodies = [], [], []
        for shape, pose in zip(self._shapes, poses, strict=True):
            turned = _Turned(pose)
            polygons.append(turned.points(_padded(shape.polygons, size)))
            normals.append(turned.ways(shape.normals))
            centres.append(turned.points(shape.centres))
            corners.append(turned.points(_padded(shape.corners[None], most)[0]))
            points.append(turned.points(_padded(shape.points[None], spread)[0]))
            middles.append(turned.points(shape.middle))
            bodies.append(turned.body(shape.body, corners[-1]))
        n = len(self._shapes)
        middle = np.stack(middles, axis=1) if n else np.zeros((steps, 0, 3))
        reaches = np.array([shape.reach for shape in self._shapes]) + ROUNDING
        feet = np.stack([pose[:, 2] for pose in poses], axis=1) if n else np.zeros((steps, 0))
        radii = np.array([shape.radius for shape in self._shapes]) + ROUNDING
        targets = middle[..., :2].reshape(-1, 2), np.tile(radii, steps), feet.ravel()
        within = None if reach is None else reach.at(last)
        candidates = Candidates(self.fixed, *targets, self._lowest_eye, within)
        by_step = np.arange(n * steps).reshape(n, steps).T.ravel()  # bodies are ordered by actor
        return Faces(
            first,
            np.concatenate(polygons, axis=1) if n else np.zeros((steps, 0, 3, 3)),
            np.concatenate(normals, axis=1) if n else np.zeros((steps, 0, 3)),
            np.concatenate([shape.areas for shape in self._shapes]) if n else np.zeros(0),
            np.concatenate(centres, axis=1) if n else np.zeros((steps, 0, 3)),
            np.stack(corners, axis=1) if n else np.zeros((steps, 0, 1, 3)),
            middle,
            reaches,
            np.stack(points, axis=1) if n else np.zeros((steps, 0, 1, 3)),
            np.concatenate([shape.n_vertices for shape in self._shapes] or [np.zeros(0, int)]),
            np.array([len(shape.corners) for shape in self._shapes], dtype=np.int64),
            Bodies.joined([Bodies.none(), *bodies]).taken(by_step),
            candidates,
        )


def _surface(triangles: FloatArray) -> "Surface":
    """Returns a surface of triangles [n, 3, 3], in m."""
    from cocap_opt.vision.surfaces import Surface  # loads Embree, which few scenes need

    return Surface(triangles)


class LocalFaces(NamedTuple):
    """One actor's shape around its foot point."""

    polygons: FloatArray  # [F, V, 3] m
    normals: FloatArray  # [F, 3]
    n_vertices: IntArray  # [F]
    areas: FloatArray  # [F] m2
    centres: FloatArray  # [F, 3] m
    corners: FloatArray  # [C, 3] m
    points: FloatArray  # [N, 3] m, corners and centroids of faces, shifted slightly inwards
    middle: FloatArray  # [3] m
    reach: float  # m, of a sphere around the middle
    radius: float  # m, of an upright cylinder around it
    half: float  # m, half of that cylinder's height
    body: Bodies


@lru_cache(maxsize=_KEPT)
def local_faces(shape: Shape) -> LocalFaces:
    """Returns a shape around its foot point, cached for all actors with this shape."""
    faces = shape.faces()
    doubled = np.array([_doubled_area(face) for face in faces])
    lengths = np.sqrt(dot(doubled, doubled))
    corners = np.unique(np.concatenate(faces), axis=0)
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = (low + high) / 2
    ways = corners - middle
    centres = np.array([_centroid(face) for face in faces])
    points = np.concatenate([corners, centres])
    size = max(map(len, faces))
    return LocalFaces(
        np.array([_padded(face[None], size)[0] for face in faces]),
        doubled / lengths[:, None],
        np.array([len(face) for face in faces]),
        lengths / 2,
        centres,
        corners,
        points + _DRAWN_IN * (middle - points),
        middle,
        float(np.sqrt(dot(ways, ways)).max()),
        float(np.hypot(ways[:, 0], ways[:, 1]).max()),
        float(high[2] - low[2]) / 2,
        Bodies.of_shape(shape),
    )


class _Turned:
    """Poses [L, 4] to which points are transformed."""

    def __init__(self, poses: FloatArray) -> None:
        self._places = poses[:, :3]
        self._cosines, self._sines = cosines(poses[:, 3]), sines(poses[:, 3])

    def ways(self, ways: FloatArray) -> FloatArray:
        """Returns vectors [.., 3], rotated [L, .., 3]."""
        shape = (-1,) + (1,) * (ways.ndim - 1)
        c, s = self._cosines.reshape(shape), self._sines.reshape(shape)
        x, y, z = ways[..., 0], ways[..., 1], ways[..., 2]
        return np.stack([x * c - y * s, x * s + y * c, np.broadcast_to(z, (c * x).shape)], axis=-1)

    def points(self, points: FloatArray) -> FloatArray:
        """Returns points [.., 3], rotated and moved [L, .., 3]."""
        moved = self._places.reshape((-1,) + (1,) * (points.ndim - 1) + (3,))
        result: FloatArray = self.ways(points) + moved
        return result

    def body(self, body: Bodies, corners: FloatArray) -> Bodies:
        """Returns one body [L] for each pose.

        Parameters
        ----------
        body : a body around its foot point
        corners : [L, C, 3] m, transformed corners
        """
        normals = self.ways(body.normals[0])
        pairs = body.neighbours[0]
        return Bodies(
            normals,
            body.offsets[0] + dot(normals, self._places[:, None]),
            np.broadcast_to(pairs, (len(normals), *pairs.shape)),
            corners[..., :2].min(axis=1),
            corners.max(axis=1),
            np.zeros(len(normals), dtype=bool),
        )


def _doubled_area(polygon: FloatArray) -> FloatArray:
    """Returns the normal of a planar polygon [V, 3], twice its area long (Newell's method)."""
    moved = polygon - polygon[0]
    result: FloatArray = np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0)
    return result


def _centroid(polygon: FloatArray) -> FloatArray:
    """Returns the centroid [3] of a convex polygon [V, 3]."""
    middle = polygon.mean(axis=0)
    first = polygon - middle
    second = np.roll(first, -1, axis=0)
    areas = np.linalg.norm(np.cross(first, second), axis=1)
    result: FloatArray = middle + areas @ (first + second) / (3 * areas.sum())
    return result


def _padded(polygons: FloatArray, size: int) -> FloatArray:
    """Returns polygons [n, V, 3] with the given number of vertices, repeating the last."""
    return polygons[:, np.minimum(np.arange(size), polygons.shape[1] - 1)]
