"""Cliques of cells, of which at most one robot is in one at a step."""

import math
from itertools import product

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.relaxations.slots import Slots, incidence
from cocap_opt.problem import Problem
from cocap_opt.result import UnsupportedError

MOST_ENTRIES = 500_000  # of the separation rows
TOO_MANY_ENTRIES = (
    f"a flow model takes at most {MOST_ENTRIES} entries of separation rows, here there are more; "
    "column-generation adds the few that matter"
)


def cliques_of_cells(problem: Problem, slots: Slots) -> sparse.csr_array:
    """Returns sets of slots that hold all pairs that are too close, and only such pairs."""
    if not problem.rules.separation or not len(slots):
        return sparse.eye_array(len(slots), format="csr")
    if problem.height_map.datum is not None:
        return _pairs_too_close(problem, slots)
    blocks, entries = [], 0
    for shape in _shapes(problem):
        block = _laid(shape, slots)
        entries += block.nnz
        if entries > MOST_ENTRIES:
            raise UnsupportedError(TOO_MANY_ENTRIES)
        blocks.append(block)
    return _distinct(sparse.csr_array(sparse.vstack(blocks)))


def _laid(shape: "_Shape", slots: Slots) -> sparse.csr_array:
    """Returns a shape laid wherever one of its cells falls into a slot [rows, K]."""
    layer, x, y = slots.at
    laid = [np.column_stack([slots.t, x - i, y - j])[layer == k] for k, i, j in shape]
    origins = np.unique(np.concatenate(laid), axis=0)
    t, u, v = origins.T
    found = [slots.find(t, k, u + i, v + j) for k, i, j in shape]
    rows, columns = (np.concatenate(part) for part in zip(*found, strict=True))
    return incidence(rows, columns, (len(origins), len(slots)))


def _pairs_too_close(problem: Problem, slots: Slots) -> sparse.csr_array:
    """Returns the slots, and all pairs of one step that are too close: this fits any terrain."""
    layer, x, y = slots.at
    altitude = problem.height_map.altitudes(problem.layers)[layer, x, y]
    # Steps are put so far apart that no two of different steps are near.
    apart = 2 * math.hypot(problem.rules.separation, problem.rules.vertical)
    size = problem.height_map.resolution
    at = np.column_stack([x * size, y * size, altitude])
    tree = cKDTree(np.column_stack([at, slots.t * apart]))
    reach = math.hypot(problem.rules.separation, problem.rules.vertical) * (1 + 1e-9)
    if tree.count_neighbors(tree, reach) > MOST_ENTRIES:
        raise UnsupportedError(TOO_MANY_ENTRIES)
    one, other = tree.query_pairs(reach, output_type="ndarray").T
    near = np.flatnonzero(problem.rules.too_near(at[other] - at[one]))
    one, other, number = one[near], other[near], np.arange(len(near))
    rows, columns = np.concatenate([number, number]), np.concatenate([one, other])
    alone = sparse.eye_array(len(slots), format="csr")
    return sparse.csr_array(
        sparse.vstack([alone, incidence(rows, columns, (len(near), len(slots)))])
    )


_Shape = list[tuple[int, int, int]]  # (layer, cells along x, cells along y)


def _shapes(problem: Problem) -> list[_Shape]:
    """Returns cliques of cells that, laid anywhere, hold every two cells that are too close.

    The pairs that are farthest apart come first: a cell between them is too close to both and
    to most of the rest.
    """
    layers, (width, depth) = range(len(problem.layers)), problem.height_map.shape
    size, up = problem.height_map.resolution, np.array(problem.layers)
    ways = np.zeros((len(layers), len(layers), width, depth, 3))
    ways[..., 0], ways[..., 1] = np.arange(width)[:, None] * size, np.arange(depth) * size
    ways[..., 2] = (up - up[:, None])[:, :, None, None]
    near = problem.rules.too_near(ways)
    reach = (np.arange(1 - width, width), np.arange(1 - depth, depth))
    box = np.array(list(product(layers, *reach)), dtype=np.int64)  # [n, 3]
    heights = np.array(problem.layers) / problem.height_map.resolution
    covered = np.zeros((len(layers), len(layers), 2 * width - 1, 2 * depth - 1), dtype=bool)
    pairs = [
        (-float(np.hypot(np.hypot(i, j), heights[b] - heights[a])), a, b, int(i), int(j))
        for a, (b, i, j) in product(layers, box.tolist())
        if (a, 0, 0) <= (b, i, j) and near[a, b, abs(i), abs(j)]
    ]
    shapes = []
    for _, a, b, i, j in sorted(pairs):
        if covered[a, b, i + width - 1, j + depth - 1]:
            continue
        shape = _clique(near, box, heights, (a, 0, 0), (b, i, j))
        shapes.append([(int(k), int(u), int(v)) for k, u, v in shape])
        for k, u, v in shape:
            away = shape - (0, u, v)
            inside = (np.abs(away[:, 1]) < width) & (np.abs(away[:, 2]) < depth)
            level, du, dv = away[inside].T
            covered[k, level, du + width - 1, dv + depth - 1] = True
    return shapes


def _clique(
    near: BoolArray,
    box: IntArray,
    heights: FloatArray,
    one: tuple[int, int, int],
    other: tuple[int, int, int],
) -> IntArray:
    """Returns a clique of cells [n, 3] around two of them, from their middle outwards.

    Parameters
    ----------
    near : [layers, layers, width, depth] True where two cells so far apart are too close
    box : [m, 3] candidates: layer, cells along x and along y
    heights : of the layers, in cells
    """
    ends = np.array([one, other], dtype=np.int64)
    middle = ends[:, 1:].mean(axis=0)
    away = np.column_stack([box[:, 1:] - middle, heights[box[:, 0]] - heights[ends[:, 0]].mean()])
    candidates = box[np.argsort(np.linalg.norm(away, axis=1), kind="stable")]

    def close_to(cell: IntArray) -> BoolArray:
        gap = np.abs(candidates - cell)
        inside = (gap[:, 1] < near.shape[2]) & (gap[:, 2] < near.shape[3])
        found: BoolArray = (
            inside & near[cell[0], candidates[:, 0], gap[:, 1] * inside, gap[:, 2] * inside]
        )
        return found

    chosen = list(np.unique(ends, axis=0))
    open_ = np.logical_and.reduce([close_to(end) for end in chosen])
    open_ &= ~(candidates[:, None] == ends[None]).all(axis=2).any(axis=1)
    while open_.any():
        cell = candidates[np.argmax(open_)]
        chosen.append(cell)
        open_ &= close_to(cell) & (candidates != cell).any(axis=1)
    return np.array(chosen)


def _distinct(rows: sparse.csr_array) -> sparse.csr_array:
    """Returns rows of 0 and 1 without repetitions; a sum of random numbers tells sets apart."""
    marks = np.random.default_rng(0).random((rows.shape[1], 2))
    _, first = np.unique(np.round(rows @ marks, 9), axis=0, return_index=True)
    return sparse.csr_array(rows[np.sort(first)])
