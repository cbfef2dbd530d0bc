"""Shadows of convex bodies, and the parts of polygons that lie in no shadow.

A body is the intersection of half-spaces n . x <= o. Let d = n . eye - o be the eye's distance
from a plane, which is turned to the eye if d >= 0. A point p is hidden by the body if
x = eye + (p - eye) s is in the body for some s in [0, 1]. Fourier-Motzkin elimination of 1 / s
leaves exactly these half-spaces:

- n . p <= o for each plane that is turned to the eye;
- (|d_b| n_a + |d_a| n_b) . (p - eye) <= 0 for planes a, b of which one is turned to the eye and
  the other is not; those that share an edge imply the others.

From inside a body, everything is hidden.
"""

from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.vision.bodies import Bodies, widened
from cocap_opt.vision.projection import dot
from cocap_opt.world.triangles import clip

FLUSH = 1e-6  # m; a polygon nowhere deeper than this behind a plane lies in the plane
# m; a polygon that reaches less than this into the outline of a shadow is not hidden either
GRAZED = 1e-10
OVERLAP = 1e-11  # m, by which shadows are widened to close gaps between touching shadows
_Pieces = tuple[FloatArray, IntArray]  # as returned by `Shadows.outside`
_ALWAYS = 1.0  # offset of a missing half-space, whose normal is 0: all points are inside


class Shadows(NamedTuple):
    """Shadows as half-spaces normal . (p - eye) <= offset."""

    normals: FloatArray  # [n, K, 3]
    offsets: FloatArray  # [n, K] m
    depths: FloatArray  # [n, K] m; polygons nowhere deeper than this in one are not hidden

    @classmethod
    def of(cls, bodies: Bodies, which: IntArray, eyes: FloatArray) -> "Shadows":
        """Returns the shadows of bodies [n] from eyes [n, 3]."""
        normals = bodies.normals[which]
        distances = dot(normals, eyes[:, None]) - bodies.offsets[which]
        turned = distances >= 0
        first, second = np.moveaxis(bodies.neighbours[which], -1, 0)
        rows = np.arange(len(which))[:, None]
        row, pair = np.nonzero(turned[rows, first] != turned[rows, second])
        a, b = first[row, pair], second[row, pair]
        tangent = (
            np.abs(distances[row, b])[:, None] * normals[row, a]
            + np.abs(distances[row, a])[:, None] * normals[row, b]
        )
        length = np.sqrt(dot(tangent, tangent))
        sure = length > 0
        row, tangent = row[sure], tangent[sure] / length[sure, None]
        facing, plane = np.nonzero(turned)
        return cls._packed(
            len(which),
            np.concatenate([facing, row]),
            np.concatenate([normals[facing, plane], tangent]),
            np.concatenate([-distances[facing, plane], np.zeros(len(row))]) + OVERLAP,
            np.concatenate([np.full(len(facing), FLUSH), np.full(len(row), GRAZED)]),
        )

    @classmethod
    def _packed(
        cls, n: int, row: IntArray, normals: FloatArray, offsets: FloatArray, depths: FloatArray
    ) -> "Shadows":
        """Returns n shadows, given their half-spaces one by one with the row of each."""
        order = np.argsort(row, kind="stable")
        row = row[order]
        counts = np.bincount(row, minlength=n)
        rank = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
        size = int(counts.max(initial=1))
        result = cls(np.zeros((n, size, 3)), np.full((n, size), _ALWAYS), np.zeros((n, size)))
        result.normals[row, rank] = normals[order]
        result.offsets[row, rank] = offsets[order]
        result.depths[row, rank] = depths[order]
        return result

    @classmethod
    def joined(cls, parts: "list[Shadows]") -> "Shadows":
        """Returns the shadows of several parts, one after the other."""
        size = max((part.offsets.shape[1] for part in parts), default=1)
        nothing = cls(np.zeros((0, size, 3)), np.zeros((0, size)), np.zeros((0, size)))
        columns = zip(nothing, *parts, strict=True)
        wide = (
            [widened(values, size, missing) for values in column]
            for column, missing in zip(columns, (0.0, _ALWAYS, 0.0), strict=True)
        )
        return cls(*map(np.concatenate, wide))

    def taken(self, which: IntArray) -> "Shadows":
        """Returns some of the shadows."""
        return Shadows(self.normals[which], self.offsets[which], self.depths[which])

    def excess(self, points: FloatArray) -> FloatArray:
        """Returns the excess [n, K, V] over each plane of points [n, V, 3] relative to the eye."""
        return dot(self.normals[:, :, None], points[:, None]) - self.offsets[:, :, None]

    def sides(self, excess: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Returns arrays [n]: True if the hulls of points are outside, and True if they are inside.

        Parameters
        ----------
        excess : [n, K, V] excess of the points
        """
        shallow = excess > -self.depths[:, :, None]
        outside = np.asarray(shallow.all(axis=2))
        return np.asarray(outside.any(axis=1)), np.asarray(~shallow.any(axis=(1, 2)))

    def outside(
        self, polygons: FloatArray, first: IntArray, counts: IntArray
    ) -> tuple[FloatArray, IntArray]:
        """Returns the convex pieces of convex polygons that are outside all shadows.

        Parameters
        ----------
        polygons : [m, V, 3] m, relative to the eye
        first, counts : [m] first shadow that may fall on each polygon, and number of such shadows

        Returns
        -------
        pieces : [q, V, 3] m, relative to the eye; unused vertices repeat the last used one
        owners : [q] number of the polygon to which each piece belongs, increasing
        """
        owners, done, turn, whole = np.arange(len(polygons)), list[_Pieces](), 0, polygons
        while len(owners):
            more = turn < counts[owners]
            done.append((polygons[~more], owners[~more]))
            polygons, owners = polygons[more], owners[more]
            polygons, at = _outside(polygons, owners, whole, self.taken(first[owners] + turn))
            owners, turn = owners[at], turn + 1
        return _joined(done)


def _outside(
    polygons: FloatArray, owners: IntArray, whole: FloatArray, shadows: Shadows
) -> tuple[FloatArray, IntArray]:
    """Returns the pieces of polygons [n, V, 3] outside a shadow each, and the polygon of each
    piece.

    Parameters
    ----------
    owners : [n] numbers of the polygons in `whole` [m, V, 3] to which the pieces belong
    """
    excess = shadows.excess(polygons)
    deepest = excess.min(axis=2)
    beside = (deepest > -shadows.depths).any(axis=1)
    # A thin piece is only slightly behind a plane; only a whole polygon for which this is true lies
    # in it.
    thin = np.flatnonzero(beside)
    thin = thin[(deepest[thin] <= -GRAZED).all(axis=1)]
    if len(thin):
        thin_shadows = shadows.taken(thin)
        beside[thin], _ = thin_shadows.sides(thin_shadows.excess(whole[owners[thin]]))
    rest = np.flatnonzero(~beside)
    found = [(polygons[beside], np.flatnonzero(beside))]
    inside = polygons[rest]
    # The other half-spaces cut nothing off.
    for k in np.flatnonzero((excess[rest] > 0).any(axis=(0, 2))).tolist():
        normals, offsets = shadows.normals[rest, k], shadows.offsets[rest, k]
        beyond = dot(normals[:, None], inside) - offsets[:, None]
        cut = np.flatnonzero((beyond > 0).any(axis=1))
        if not len(cut):
            continue
        outer, inner = (_trimmed(clip(inside[cut], sign * beyond[cut])) for sign in (1.0, -1.0))
        found.append((outer, rest[cut]))
        inside = _widened(inside, inner.shape[1])
        inside[cut] = _widened(inner, inside.shape[1])
        left = np.ones(len(rest), dtype=bool)
        left[cut] = (beyond[cut] < 0).any(axis=1)
        rest, inside = rest[left], inside[left]
    return _joined(found)


def _joined(parts: list[_Pieces]) -> _Pieces:
    """Returns pieces ordered by owner, keeping the order of an owner's pieces."""
    if not parts:
        return np.zeros((0, 3, 3)), np.zeros(0, dtype=np.int64)
    size = max(polygons.shape[1] for polygons, _ in parts)
    owners = np.concatenate([part for _, part in parts])
    polygons = np.concatenate([_widened(part, size) for part, _ in parts])
    order = np.argsort(owners, kind="stable")
    return polygons[order], owners[order]


def _trimmed(polygons: FloatArray) -> FloatArray:
    """Returns polygons without trailing vertices that only repeat others in all of them."""
    size = polygons.shape[1]
    while size > 3 and (polygons[:, size - 1] == polygons[:, size - 2]).all():
        size -= 1
    return polygons[:, :size]


def _widened(polygons: FloatArray, size: int) -> FloatArray:
    """Returns polygons with at least the given number of vertices, repeating the last."""
    missing = size - polygons.shape[1]
    if missing <= 0:
        return polygons
    return np.concatenate([polygons, np.repeat(polygons[:, -1:], missing, axis=1)], axis=1)
