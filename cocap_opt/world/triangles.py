"""Triangles as boundaries of matter: which count, which form closed solids; polygon clipping."""

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray

SAME = 1e-6  # m; vertices that are closer to each other are at the same place
_NOTHING = 1e-9  # share of the bounding box; a smaller volume is a rounding error


def firsts(vertices: FloatArray) -> IntArray:
    """Returns for each vertex [V, 3] the number of the first vertex at the same place [V].

    Places are the same if they are within `SAME`, or connected by a chain of such vertices.
    """
    from scipy.spatial import cKDTree  # slow to import, as SciPy's graphs are

    first, number = equal_rows(vertices)
    near = cKDTree(vertices[first]).query_pairs(SAME, output_type="ndarray")
    if len(near):
        number = _connected(near[:, 0], near[:, 1], len(first))[number]
    _, least, place = np.unique(number, return_index=True, return_inverse=True)
    result: IntArray = least[place].astype(np.int64)
    return result


def equal_rows(rows: FloatArray | IntArray) -> tuple[IntArray, IntArray]:
    """Returns the first of each set of equal rows [k] of [n, m], and the set of each row [n].

    This is `numpy.unique` along an axis, but ten times as fast.
    """
    order = np.lexsort(rows.T[::-1])  # lexsort keeps the order of equal rows
    sorted_rows = rows[order]
    new = np.ones(len(rows), dtype=bool)
    new[1:] = (sorted_rows[1:] != sorted_rows[:-1]).any(axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.cumsum(new) - 1
    return order[new], number


def counting(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Returns the triangles [n, 3] of a mesh that count, by the first vertex at each place.

    A triangle with two corners at the same place has no area and does not count. Duplicates count
    once. If the rest then forms a closed surface, two more kinds are left out: the second of two
    triangles with the same corners that face in opposite directions, as some programs draw every
    wall from both sides; and triangles whose corners are collinear. If the surface has no hole but
    neighbours face in different directions, the minority is turned.
    """
    named = firsts(vertices)[triangles]
    a, b, c = named.T
    flat = named[(a != b) & (b != c) & (c != a)]
    distinct = _first_of_each(flat, _turned(flat))
    from_one_side = _first_of_each(distinct, np.sort(distinct, axis=1))
    for part in (from_one_side, distinct):
        if close(part):
            return part
    for part in (from_one_side, distinct):
        if close(wide := _wide(vertices, part)):
            return wide
    oriented = _oriented(from_one_side)
    return distinct if oriented is None else oriented


def _oriented(triangles: IntArray) -> IntArray | None:
    """Returns triangles [n, 3], turned to form a closed surface; None if they have a hole.

    Each edge must have two triangles. The graph has two nodes for each triangle, one as given and
    one turned, and joins nodes that pass their common edge in opposite directions. So each
    component is one way to orient a part of the surface.
    """
    n = len(triangles)
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, number = equal_rows(np.sort(edges, axis=1))
    if not n or (np.bincount(number) != 2).any():
        return None
    a, b = np.argsort(number, kind="stable").reshape(-1, 2).T
    turned = n * (edges[a, 0] == edges[b, 0])  # one of two triangles that pass an edge alike
    first, second = a // 3, b // 3
    start, end = (
        np.concatenate([first, first + n]),
        np.concatenate([second + turned, second + n - turned]),
    )
    part = _connected(start, end, 2 * n)
    count = int(part.max()) + 1
    as_is, other = part[:n], part[n:]
    if (as_is == other).any():
        return None  # a surface with only one side, like a Moebius strip
    kept = np.bincount(as_is, minlength=count)
    turn = (kept[as_is] < kept[other]) | ((kept[as_is] == kept[other]) & (as_is > other))
    return np.where(turn[:, None], triangles[:, ::-1], triangles)


def _wide(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Returns the triangles whose corners are not collinear, within `SAME`."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    doubled = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.max([np.linalg.norm(way, axis=1) for way in (b - a, c - b, a - c)], axis=0)
    result: IntArray = triangles[doubled > SAME * longest]
    return result


def close(triangles: IntArray) -> bool:
    """Returns True if triangles form a closed surface: each edge is passed equally both ways."""
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    low, high = edges.min(axis=1), edges.max(axis=1)
    _, number = np.unique(low * (triangles.max(initial=0) + 1) + high, return_inverse=True)
    return not np.bincount(number, weights=np.sign(edges[:, 1] - edges[:, 0])).any()


def closed_parts(triangles: IntArray) -> BoolArray:
    """Returns an array [n], true for triangles of parts that are closed surfaces.

    A part is a set of triangles that are connected by corners. Flaps may touch a part but do not
    belong to it: no other triangle passes an edge of a flap in the opposite direction.
    """
    signs, balance = _edges(triangles)
    closed: BoolArray = (np.sign(balance) != signs).any(axis=1)
    firm = triangles[closed]
    size = int(triangles.max(initial=0)) + 1
    a, b, c = firm.T
    part = _connected(np.concatenate([a, b]), np.concatenate([b, c]), size)
    _, balance = _edges(firm)
    closed[closed] = ~np.isin(part[a], part[a[balance.any(axis=1)]])
    return closed


def enclosing(vertices: FloatArray, triangles: IntArray) -> BoolArray:
    """Returns an array [n], true for triangles of parts that enclose a volume, if they are closed.

    A part is a set of triangles that are connected by corners. If walls are drawn from both sides
    with different diagonals, they are closed but enclose nothing, as the two sides cancel.
    """
    part, volume, low, high = _measured(vertices, triangles)
    box = np.prod(high - low, axis=1)
    holds: BoolArray = (np.abs(volume) > _NOTHING * box) | (box == 0)
    return holds[part]


def outward(vertices: FloatArray, triangles: IntArray) -> IntArray:
    """Returns the triangles [n, 3] of solids, with those of inside-out solids turned.

    If an inside-out solid overlaps another one, their matter would cancel. A solid that faces the
    other way than the largest one is a cavity, and is not turned, if it lies within the bounds of a
    solid that faces the same way as the largest one.
    """
    part, volume, low, high = _measured(vertices, triangles)
    ways = np.sign(volume)
    if len(ways) < 2 or (ways == ways[0]).all():
        return triangles
    usual = ways == ways[np.abs(volume).argmax()]
    turned = np.zeros(len(ways), dtype=bool)
    for k in np.flatnonzero(~usual).tolist():
        within = (low[usual] <= low[k]).all(axis=1) & (high[usual] >= high[k]).all(axis=1)
        turned[k] = not within.any()
    return np.where(turned[part][:, None], triangles[:, ::-1], triangles)


def _measured(
    vertices: FloatArray, triangles: IntArray
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Returns the part of each triangle [n], and volumes [k] (m3) and bounds [k, 3] (m) of parts.

    A part is a set of triangles that are connected by corners; its volume is negative if it is
    inside out.
    """
    a, b, c = triangles.T
    of_vertex = _connected(np.concatenate([a, b]), np.concatenate([b, c]), len(vertices))
    names, part = np.unique(of_vertex[a], return_inverse=True)
    origin = vertices[a[:1]].sum(axis=0)  # a vertex, so that large coordinates cost no digits
    first, second, third = (vertices[corner] - origin for corner in (a, b, c))
    sixth = np.einsum("ij,ij->i", first, np.cross(second, third)) / 6.0
    volume = np.bincount(part, weights=sixth, minlength=len(names))
    low, high = np.full((len(names), 3), np.inf), np.full((len(names), 3), -np.inf)
    np.minimum.at(low, part, np.minimum(np.minimum(first, second), third))
    np.maximum.at(high, part, np.maximum(np.maximum(first, second), third))
    return part.astype(np.int64), volume.astype(np.float64), low, high


def _connected(start: IntArray, end: IntArray, n: int) -> IntArray:
    """Returns the component [n] of each node of a graph whose edges are start [m] - end [m]."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(len(start)), (start, end)), shape=(n, n))
    _, component = connected_components(links, directed=False)
    result: IntArray = component.astype(np.int64)
    return result


def _edges(triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Returns the direction in which each triangle passes its edges, -1 or 1, and the sums over
    all triangles; both [n, 3].
    """
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, number = equal_rows(np.sort(edges, axis=1))
    signs = np.sign(edges[:, 1] - edges[:, 0]).astype(np.float64)
    balance = np.bincount(number, weights=signs)[number].astype(np.float64)
    return signs.reshape(-1, 3), balance.reshape(-1, 3)


def _turned(triangles: IntArray) -> IntArray:
    """Returns the triangles with unchanged orientation, each starting at its smallest number."""
    begin = triangles.argmin(axis=1)[:, None]
    result: IntArray = np.take_along_axis(triangles, (begin + np.arange(3)) % 3, axis=1)
    return result


def _first_of_each(triangles: IntArray, keys: IntArray) -> IntArray:
    """Returns the first triangle of each key, in the order in which they are given."""
    first, _ = equal_rows(keys)
    result: IntArray = triangles[np.sort(first)]
    return result


def clip(polygons: FloatArray, inside: FloatArray) -> FloatArray:
    """Keeps the part of each polygon [n, V, 3] where `inside` [n, V] >= 0.

    Returns [n, V+1, 3]; unused vertices repeat the last used one. If nothing is left of a polygon,
    all its vertices are the origin.
    """
    result: FloatArray = np.concatenate([polygons, polygons[:, -1:]], axis=1)
    cut = np.flatnonzero(~(inside >= 0).all(axis=1))  # usually few
    if len(cut):
        result[cut] = _cut(polygons[cut], inside[cut])
    return result


def _cut(polygons: FloatArray, inside: FloatArray) -> FloatArray:
    """Clips polygons that all reach outside, with the algorithm of Sutherland and Hodgman."""
    n, size = inside.shape
    kept = inside >= 0
    following, ahead, kept_ahead = (
        np.concatenate([part[:, 1:], part[:, :1]], axis=1) for part in (polygons, inside, kept)
    )
    crossing = kept != kept_ahead
    share = np.where(crossing, inside, 0.0) / np.where(crossing, inside - ahead, 1.0)
    # Each edge contributes its first vertex and its intersection, in this order.
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
