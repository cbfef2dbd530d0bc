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
    following, ahead = np.roll(polygons, -1, axis=1), np.roll(inside, -1, axis=1)
    crossing = (inside >= 0) != (ahead >= 0)
    share = np.where(crossing, inside, 0.0) / np.where(crossing, inside - ahead, 1.0)
    cuts = polygons + share[..., None] * (following - polygons)
    # Each edge offers its first vertex and its cut, in order; unused ones move to the end.
    vertices = np.stack([polygons, cuts], axis=2).reshape(n, 2 * size, 3)
    used = np.stack([inside >= 0, crossing], axis=2).reshape(n, 2 * size)
    order = np.argsort(~used, axis=1, kind="stable")[:, : size + 1]
    count = used.sum(axis=1)
    last = np.minimum(np.arange(size + 1)[None, :], np.maximum(count - 1, 0)[:, None])
    order = np.take_along_axis(order, last, axis=1)
    clipped = np.take_along_axis(vertices, order[..., None], axis=1)
    clipped[count == 0] = 0.0
    return clipped
