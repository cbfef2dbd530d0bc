"""Cutting convex polygons, many at once."""

import numpy as np

from cocap_opt.data import FloatArray


def clip(polygons: FloatArray, inside: FloatArray) -> FloatArray:
    """Keeps the part of each polygon [n, V, 3] where `inside` [n, V] >= 0.

    Returns [n, V+1, 3]; unused vertices repeat the last used one. If nothing is left of a polygon,
    all its vertices are the origin.
    """
    result: FloatArray = np.concatenate([polygons, polygons[:, -1:]], axis=1)
    cut = np.flatnonzero(~(inside >= 0).all(axis=1))  # few, mostly
    if len(cut):
        result[cut] = _cut(polygons[cut], inside[cut])
    return result


def _cut(polygons: FloatArray, inside: FloatArray) -> FloatArray:
    """Clips polygons that all reach outside, by the algorithm of Sutherland and Hodgman."""
    n, size = inside.shape
    kept = inside >= 0
    following, ahead, kept_ahead = (
        np.concatenate([part[:, 1:], part[:, :1]], axis=1) for part in (polygons, inside, kept)
    )
    crossing = kept != kept_ahead
    share = np.where(crossing, inside, 0.0) / np.where(crossing, inside - ahead, 1.0)
    # Each edge offers its first vertex and its cut, in order.
    vertices = np.empty((n, 2 * size, 3))
    vertices[:, ::2], vertices[:, 1::2] = (
        polygons,
        polygons + share[..., None] * (following - polygons),
    )
    used = np.empty((n, 2 * size), dtype=bool)
    used[:, ::2], used[:, 1::2] = kept, crossing
    rank = used.cumsum(axis=1) - 1
    used &= rank <= size  # rounding may offer more than a convex polygon has
    row, vertex = np.nonzero(used)
    clipped = np.zeros((n, size + 1, 3))
    clipped[row, rank[row, vertex]] = vertices[row, vertex]
    last = np.maximum(used.sum(axis=1) - 1, 0)
    repeated = np.minimum(np.arange(size + 1), last[:, None])
    result: FloatArray = clipped[np.arange(n)[:, None], repeated]
    return result


def split(polygons: FloatArray, beyond: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Cuts convex polygons [n, V, 3] in two: where `beyond` [n, V] >= 0, and where it is <= 0.

    Both have as few vertices as can be; unused ones repeat the last used one.
    """
    return _trimmed(_cut(polygons, beyond)), _trimmed(_cut(polygons, -beyond))


def centres(polygons: FloatArray) -> FloatArray:
    """Returns points [n, 3] inside convex polygons [n, V, 3]: their centroids.

    They do not depend, to the last bit, on how often the last vertex is repeated.
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


def _trimmed(polygons: FloatArray) -> FloatArray:
    """Returns the polygons without the vertices that all of them only repeat."""
    size = polygons.shape[1]
    while size > 3 and (polygons[:, size - 1] == polygons[:, size - 2]).all():
        size -= 1
    return polygons[:, :size]
