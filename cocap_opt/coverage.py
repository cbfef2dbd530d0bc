"""Coverage in px/m2: what a camera state sees of every face at a step.

`Views` evaluates states on demand (the lazy planners' source); `coverage_table` evaluates all
states that a class of robots can reach and keeps them sparsely, since most states see
nothing.

    coverage = projected area, clipped to the image / area of the face x visible share

Sample points spread over a face say whether all or none of it is visible: that depends on the
camera's place only, not on where it looks. In between, and where the image cuts a face that
is not all visible, points spread over its image say how much.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from cocap_opt.problem import BoolArray, Camera, FloatArray, IntArray, Problem
from cocap_opt.projection import (
    camera_axes,
    dot,
    frustum_distances,
    image_area,
    image_samples,
)
from cocap_opt.stop import Limit, Stop, never
from cocap_opt.timegraph import TimeGraph
from cocap_opt.visibility import (
    Occluders,
    Samples,
    fan_triangles,
    rays_arrive,
    sample_points,
    spans,
    terrain_triangles,
    visible_share,
)

# What is evaluated at once at most, so that limits are asked for every 0.3 s or more often.
BATCH_STATES = 1024
BATCH_RAYS = 400_000  # if all faces of all states were in view


class Faces(NamedTuple):
    """Geometry of all faces at one step."""

    polygons: FloatArray  # [F, V, 3] m, shorter polygons repeat their last vertex
    normals: FloatArray  # [F, 3] outward, unit length
    areas: FloatArray  # [F] m2
    samples: Samples  # where rays are sent
    terrain: Occluders
    actors: Occluders
    triangle_faces: IntArray  # [n] face of each triangle of `actors`

    @property
    def occluders(self) -> list[Occluders]:
        """All that hides faces."""
        return [self.terrain, self.actors]


class FaceGeometry:
    """Faces of a problem's actors at every step, made when first asked for.

    Attributes
    ----------
    origin : [3] m, of the coordinates in which rays are cast
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        width, depth = problem.height_map.shape
        # The local origin for the float32 rays: the middle of the map.
        x, y = problem.height_map.centre(width // 2, depth // 2)
        self.origin = np.array([x, y, float(np.median(problem.height_map.heights))])
        self._terrain = Occluders(terrain_triangles(problem.height_map), self.origin)
        self.at = lru_cache(maxsize=None)(self._at)

    def _at(self, t: int) -> Faces:
        polygons = []
        for actor in self._problem.actors:
            x, y, z, yaw = actor.poses[t].tolist()
            c, s = np.cos(yaw), np.sin(yaw)
            for face in actor.shape.faces():
                turned = [face[:, 0] * c - face[:, 1] * s, face[:, 0] * s + face[:, 1] * c]
                polygons.append(np.column_stack([*turned, face[:, 2]]) + np.array([x, y, z]))
        size = max(map(len, polygons), default=3)
        doubled = [_doubled_area(polygon) for polygon in polygons]
        lengths = [float(np.sqrt(dot(vector, vector))) for vector in doubled]
        samples = [sample_points(polygon, self._problem.face_samples) for polygon in polygons]
        fans = [fan_triangles(polygon) for polygon in polygons]
        triangle_faces = np.repeat(np.arange(len(fans)), [len(fan) for fan in fans])
        owners = self._problem.face_owner[triangle_faces]
        triangles = np.concatenate([np.empty((0, 3, 3)), *fans])
        return Faces(
            polygons=np.array(
                [np.pad(p, ((0, size - len(p)), (0, 0)), mode="edge") for p in polygons]
            ).reshape(-1, size, 3),
            normals=np.array(
                [vector / length for vector, length in zip(doubled, lengths, strict=True)]
            ).reshape(-1, 3),
            areas=np.array(lengths) / 2,
            samples=Samples(
                points=np.concatenate([np.empty((0, 3)), *(points for points, _ in samples)]),
                shares=np.concatenate([np.empty(0), *(shares for _, shares in samples)]),
                counts=np.array([len(points) for points, _ in samples], dtype=np.int64),
            ),
            terrain=self._terrain,
            actors=Occluders(triangles, self.origin, owners),
            triangle_faces=triangle_faces,
        )


def _doubled_area(polygon: FloatArray) -> FloatArray:
    """Normal of a planar polygon [V, 3] with length twice its area (Newell)."""
    moved = polygon - polygon[0]
    result: FloatArray = np.cross(moved, np.roll(moved, -1, axis=0)).sum(axis=0)
    return result


class Views:
    """Coverage of single states, evaluated on demand.

    Attributes
    ----------
    evaluated : number of states evaluated so far
    """

    def __init__(self, geometry: FaceGeometry, problem: Problem, graph: TimeGraph, camera: Camera):
        self._geometry = geometry
        self._map = problem.height_map
        self._graph = graph
        self._camera = camera
        self._image = float(camera.width * camera.height)  # px
        self._axes = camera_axes(graph.motion.headings, camera)
        self._n_faces = len(problem.face_weights)
        self._owners = problem.face_owner
        self._samples = problem.face_samples
        self.evaluated = 0

    def coverage(self, t: int, states: IntArray) -> FloatArray:
        """Coverage [n, F] in px/m2 of every face from each of the states [n] at step t."""
        self.evaluated += len(states)
        result = np.zeros((len(states), self._n_faces))
        if not self._n_faces:
            return result
        faces = self._geometry.at(t)
        orientation, place = np.divmod(states, self._graph.n_places)
        places, which = np.unique(place, return_inverse=True)
        eyes = self._eyes(places)
        # A face turned away is not seen; the rest of the work is for those that are not.
        ahead = dot(eyes[:, None, :] - faces.polygons[None, :, 0], faces.normals[None]) > 0
        state, face = np.nonzero(ahead[which])
        relative = faces.polygons[face] - eyes[which[state]][:, None, :]
        axes = self._axes[orientation[state]][:, None]
        in_camera = np.stack([dot(relative, axes[:, :, k]) for k in range(3)], axis=-1)
        # Of a face that all but touches the camera, rounding may leave more than an image, or nan.
        with np.errstate(over="ignore", invalid="ignore"):
            area = np.minimum(image_area(in_camera, self._camera), self._image)
        seen = area > 0
        state, face, area = state[seen], face[seen], area[seen]
        pairs, pair = np.unique(which[state] * self._n_faces + face, return_inverse=True)
        eye, target = np.divmod(pairs, self._n_faces)
        whole = visible_share(faces.occluders, eyes[eye], faces.samples, target, self._owners)
        share, in_camera = whole[pair], in_camera[seen]
        inside = (frustum_distances(in_camera, self._camera) >= 0).all(axis=(1, 2))
        some = np.flatnonzero((share < 1) & ((share > 0) | ~inside))
        share[some] = self._share_in_image(
            faces, in_camera[some], eyes[eye[pair[some]]], axes[seen][some, 0], face[some]
        )
        result[state, face] = area * share / faces.areas[face]
        return result

    def _share_in_image(
        self, faces: Faces, polygons: FloatArray, eyes: FloatArray, axes: FloatArray, of: IntArray
    ) -> FloatArray:
        """Visible share [n] of the images of faces, by rays through points spread over them.

        Parameters
        ----------
        polygons : [n, V, 3] m, the faces in camera coordinates
        eyes, axes : [n, 3] m and [n, 3, 3], of the camera
        of : [n] which faces they are
        """
        points, weights = image_samples(polygons, self._camera, self._samples)
        which, sample = np.nonzero(weights)
        local = points[which, sample]
        at = eyes[which]
        for k in range(3):
            at = at + local[:, k, None] * axes[which, k]
        seen = rays_arrive(faces.occluders, eyes[which], at, self._owners[of[which]])
        share = np.bincount(which, weights=weights[which, sample] * seen, minlength=len(of))
        return np.minimum(share, 1.0)

    def by_place(self, states: IntArray) -> IntArray:
        """The states in an order in which those of one place, which share rays, are together."""
        result: IntArray = states[np.argsort(states % self._graph.n_places, kind="stable")]
        return result

    def batch(self, t: int) -> int:
        """Number of states that can be evaluated at step t in a fraction of a second."""
        rays = int(self._geometry.at(t).samples.counts.sum())
        return min(max(BATCH_RAYS // max(rays, 1), 1), BATCH_STATES)

    def _eyes(self, places: IntArray) -> FloatArray:
        """Camera positions [n, 3] in m: the middle of the cell at flight height."""
        layer, x, y = self._graph.coordinates(places)
        ox, oy = self._map.origin
        return np.column_stack(
            [
                ox + (x + 0.5) * self._map.resolution,
                oy + (y + 0.5) * self._map.resolution,
                np.array(self._graph.motion.layers)[layer],
            ]
        )


class CoverageTable(NamedTuple):
    """Coverage of all reachable states that see anything, in compressed sparse rows.

    Group g = t F + f is face f at step t; a node is t S + s.
    """

    nodes: IntArray  # [n] increasing
    indptr: IntArray  # [n + 1]
    groups: IntArray  # [nnz]
    pixels: FloatArray  # [nnz] px/m2, > 0

    def row(self, node: int) -> tuple[IntArray, FloatArray]:
        """Groups and their coverage of one node; empty where it sees nothing."""
        at = int(np.searchsorted(self.nodes, node))
        if at == len(self.nodes) or self.nodes[at] != node:
            return self.groups[:0], self.pixels[:0]
        part = slice(self.indptr[at], self.indptr[at + 1])
        return self.groups[part], self.pixels[part]

    def entries(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Which of the nodes [n] see something, entry by entry, and where the entries are."""
        if not len(self.nodes):
            return nodes[:0], nodes[:0]
        at = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
        which = np.flatnonzero(self.nodes[at] == nodes)
        first = self.indptr[at[which]]
        counts = self.indptr[at[which] + 1] - first
        return np.repeat(which, counts), spans(first, counts)

    def row_sums(self, values: FloatArray) -> FloatArray:
        """Sum of `values` [nnz] over each row [n]; rows are never empty."""
        if not len(self.nodes):
            return np.zeros(0)
        return np.add.reduceat(values, self.indptr[:-1])


def coverage_table(
    views: Views,
    reachable: BoolArray,
    first_step: int,
    stop: Stop = never,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[CoverageTable | None, Limit]:
    """Evaluate all reachable states [T+1, S] from `first_step` on.

    Returns
    -------
    The table, or None and the limit that was reached before it was whole.
    """
    nodes, counts, groups, pixels = [], [], [], []
    n_steps, n_states = reachable.shape
    for t in range(first_step, n_steps):
        states, size = views.by_place(np.flatnonzero(reachable[t])), views.batch(t)
        for start in range(0, len(states), size):
            limit = stop()
            if limit is not Limit.NONE:
                return None, limit
            batch = states[start : start + size]
            coverage = views.coverage(t, batch)
            row, face = np.nonzero(coverage)
            seen, count = np.unique(row, return_counts=True)
            nodes.append(t * n_states + batch[seen])
            counts.append(count)
            groups.append(t * coverage.shape[1] + face)
            pixels.append(coverage[row, face])
        progress(t + 1, n_steps)
    none = np.zeros(0, dtype=np.int64)
    all_nodes, sizes = np.concatenate([none, *nodes]), np.concatenate([none, *counts])
    order = np.argsort(all_nodes)
    first, sizes = (np.cumsum(sizes) - sizes)[order], sizes[order]
    indptr = np.concatenate([[0], np.cumsum(sizes)])
    entries = spans(first, sizes)
    table = CoverageTable(
        nodes=all_nodes[order],
        indptr=indptr,
        groups=np.concatenate([none, *groups])[entries],
        pixels=np.concatenate([np.zeros(0), *pixels])[entries],
    )
    return table, Limit.NONE
