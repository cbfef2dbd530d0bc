"""Triangles as they bound matter: which of them count, and whether they close."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from cocap_opt.data import FloatArray, IntArray

SAME = 1e-6  # m; vertices that are nearer to each other are at the same place


def firsts(vertices: FloatArray) -> IntArray:
    """Returns for each vertex [V, 3] the number of the first one that is at the same place [V].

    Places are the same within `SAME`, and where a chain of such vertices leads.
    """
    first, number = equal_rows(vertices)
    near = cKDTree(vertices[first]).query_pairs(SAME, output_type="ndarray")
    if len(near):
        links = coo_array((np.ones(len(near)), tuple(near.T)), shape=2 * (len(first),))
        _, joined = connected_components(links, directed=False)
        number = joined.astype(np.int64)[number]
    _, least, place = np.unique(number, return_index=True, return_inverse=True)
    result: IntArray = least[place].astype(np.int64)
    return result


def equal_rows(rows: FloatArray | IntArray) -> tuple[IntArray, IntArray]:
    """Returns the first of each set of equal rows [k] of [n, m], and the set of each row [n].

    It does what `numpy.unique` does along an axis, ten times as fast.
    """
    order = np.lexsort(rows.T[::-1])  # which keeps the order of equal rows
    sorted_rows = rows[order]
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (sorted_rows[1:] != sorted_rows[:-1]).any(axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    return order[new], number


def counting(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Returns the triangles [n, 3] of a mesh that count, of vertices that are one at each place.

    Those with two corners at the same place have no area and do not count, and a triangle that is
    given several times counts once. What lets the rest close is left out as well: the second of
    two triangles that look both ways, for some programs draw every wall from both sides; and
    triangles whose corners are in a line.
    """
    named = firsts(vertices)[triangles]
    a, b, c = named.T
    some = named[(a != b) & (b != c) & (c != a)]
    distinct = _first_of_each(some, _turned(some))
    from_one_side = _first_of_each(distinct, np.sort(distinct, axis=1))
    for part in (from_one_side, distinct):
        if close(part):
            return part
    for part in (from_one_side, distinct):
        if close(wide := _wide(vertices, part)):
            return wide
    return distinct


def _wide(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Returns the triangles whose corners are not in a line, within `SAME`."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(way, axis=1) for way in (b - a, c - b, a - c)], axis=0)
    result: IntArray = triangles[doubled > SAME * longest]
    return result


def close(triangles: IntArray) -> bool:
    """Returns True if triangles pass each edge as often one way as the other."""
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, number = np.unique(low * (triangles.max(initial=0) + 1) + high, return_inverse=True)
    return not np.bincount(number, weights=np.sign(edges[:, 1] - edges[:, 0])).any()


def _turned(triangles: IntArray) -> IntArray:
    """Returns the triangles, each beginning with its smallest number, that look the same way."""
    begin = triangles.argmin(axis=1)[:, None]
    result: IntArray = np.take_along_axis(triangles, (begin + np.arange(3)) % 3, axis=1)
    return result


def _first_of_each(triangles: IntArray, keys: IntArray) -> IntArray:
    """Returns the first triangle of each key, in the order in which they are given."""
    first, _ = equal_rows(keys)
    result: IntArray = triangles[np.sort(first)]
    return result
