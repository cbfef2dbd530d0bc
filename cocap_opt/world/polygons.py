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
