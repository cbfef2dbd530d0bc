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
    distinct, number = np.unique(vertices + 0.0, axis=0, return_inverse=True)  # -0.0 becomes 0.0
    near = cKDTree(distinct).query_pairs(SAME, output_type="ndarray")
    if len(near):
        links = coo_array((np.ones(len(near)), tuple(near.T)), shape=2 * (len(distinct),))
        _, joined = connected_components(links, directed=False)
        number = joined.astype(np.int64)[number]
    _, first, place = np.unique(number, return_index=True, return_inverse=True)
    result: IntArray = first[place].astype(np.int64)
    return result


def counting(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Returns the triangles [n, 3] of a mesh that count, of vertices that are one at each place.

    Those with two corners at the same place have no area and do not count; a triangle that is
    given several times counts once. So does one that looks both ways, given once for each, if
    the triangles close then: some programs draw every wall from both sides. Otherwise both count.
    """
    named = firsts(vertices)[triangles]
    a, b, c = named.T
    some = named[(a != b) & (b != c) & (c != a)]
    distinct = _first_of_each(some, _turned(some))
    from_one_side = _first_of_each(distinct, np.sort(distinct, axis=1))
    return from_one_side if close(from_one_side) else distinct


def close(triangles: IntArray) -> bool:
    """Returns True if triangles pass each edge as often one way as the other."""
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, number = np.unique(low * (triangles.max(initial=0) + 1) + high, return_inverse=True)
    return not np.bincount(number, weights=np.where(edges[:, 0] == low, 1, -1)).any()


def _turned(triangles: IntArray) -> IntArray:
    """Returns the triangles, each beginning with its smallest number, that look the same way."""
    begin = triangles.argmin(axis=1)[:, None]
    result: IntArray = np.take_along_axis(triangles, (begin + np.arange(3)) % 3, axis=1)
    return result


def _first_of_each(triangles: IntArray, keys: IntArray) -> IntArray:
    """Returns the first triangle of each key, in the order in which they are given."""
    _, first = np.unique(keys, axis=0, return_index=True)
    result: IntArray = triangles[np.sort(first)]
    return result
