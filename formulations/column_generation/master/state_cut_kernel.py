"""Compiled search for the tightest state cut; imported only if numba is installed.

The n listed states of a view sum are sorted by their cells; at most one robot is in each cell. The
cut that is lowest at amounts m is the dual of a packing problem,

    max sum_S x_S sqrt(pixels of S),  sum of x_S with state i in S <= m_i,  sum_S x_S <= 1,

over sets S of states in different cells. A primal simplex method with a dense inverse solves it;
sets are generated when they are needed. Pixels are in units of the largest number.
"""

import math
from functools import partial

import numpy as np

from cocap_opt.compiling import compiled
from cocap_opt.data import FloatArray, IntArray

_SLOPES = 12  # tangents of the root that bound completions of a set
_LEAST_PIXELS = 0.003  # of those of all cells: the steepest tangent touches the root there
_KEPT = 48  # partial sets that are kept after each cell
_ADDED = 12  # sets that are generated at once
_MOST_SETS = 1500
_LOOKED_AT = 60  # sets that are looked at before one enters the basis
_MOST_PIVOTS = 2000
_TINY = 1e-9


@partial(compiled, kept=False)
def _root(pixels: float, touching: float) -> float:
    """Returns the root of pixels, or below `touching` its tangent there."""
    if pixels >= touching:
        return math.sqrt(pixels)
    return 0.5 * (math.sqrt(touching) + pixels / math.sqrt(touching))


@partial(compiled, kept=False)
def _slopes(pixels: FloatArray, first: IntArray, touching: float) -> FloatArray:
    """Returns the slopes of tangents of the root."""
    total = 0.0
    for k in range(len(first) - 1):
        total += pixels[first[k] : first[k + 1]].max()
    slopes = np.empty(_SLOPES)
    for j in range(_SLOPES):
        least = max(_LEAST_PIXELS, touching / total)
        slopes[j] = 0.5 / np.sqrt(total * least ** (1 - j / (_SLOPES - 1)))
    return slopes


@partial(compiled, kept=False)
def _fill_completions(
    pixels: FloatArray, values: FloatArray, first: IntArray, slopes: FloatArray, rest: FloatArray
) -> None:
    """Stores the most that the cells from each one on can add to each tangent [cells+1, slopes]."""
    cells = len(first) - 1
    for j in range(len(slopes)):
        rest[cells, j] = 0.25 / slopes[j]
        for k in range(cells - 1, -1, -1):
            most = 0.0
            for i in range(first[k], first[k + 1]):
                most = max(most, slopes[j] * pixels[i] - values[i])
            rest[k, j] = rest[k + 1, j] + most


@partial(compiled, kept=False)
def _best_by_slopes(
    pixels: FloatArray, values: FloatArray, first: IntArray, slopes: FloatArray, above: float,
    touching: float, sets: IntArray, heights: FloatArray,
) -> int:  # fmt: skip
    """Stores the sets that are best for a tangent, if they are high enough; returns how many."""
    cells, found, last = len(first) - 1, 0, -np.inf
    for j in range(len(slopes)):
        seen, paid = 0.0, 0.0
        for k in range(cells):
            most, at = 0.0, -1
            for i in range(first[k], first[k + 1]):
                worth = slopes[j] * pixels[i] - values[i]
                if worth > most:
                    most, at = worth, i
            sets[found, k] = at
            if at >= 0:
                seen += pixels[at]
                paid += values[at]
        height = _root(seen, touching) - paid
        if height > above and height != last:
            heights[found], last = height, height
            found += 1
    return found


@partial(compiled, kept=False)
def _best_sets(
    pixels: FloatArray, values: FloatArray, first: IntArray, slopes: FloatArray, rest: FloatArray,
    above: float, touching: float, sets: IntArray, heights: FloatArray,
) -> int:  # fmt: skip
    """Stores the highest sets above a height, by dynamic programming; returns how many.

    After each cell, partial sets are dropped that another one dominates, or that no completion
    brings above the height; of more than _KEPT, those whose completions may be highest are kept.
    """
    cells = len(first) - 1
    seen, worth, n = np.zeros(_KEPT), np.zeros(_KEPT), 1
    parents = np.zeros((cells, _KEPT), dtype=np.int64)
    choices = np.zeros((cells, _KEPT), dtype=np.int64)
    for k in range(cells):
        size = n * (first[k + 1] - first[k] + 1)
        new_seen, new_worth, most = np.empty(size), np.empty(size), np.empty(size)
        parent, choice = np.empty(size, dtype=np.int64), np.empty(size, dtype=np.int64)
        m = 0
        for before in range(n):
            for i in range(first[k] - 1, first[k + 1]):
                z, v = seen[before], worth[before]
                if i >= first[k]:
                    z += pixels[i]
                    v -= values[i]
                reach = np.inf
                for j in range(len(slopes)):
                    reach = min(reach, slopes[j] * z + v + rest[k + 1, j])
                    if reach <= above:
                        break
                if reach > above:
                    new_seen[m], new_worth[m], most[m] = z, v, reach
                    parent[m], choice[m] = before, i if i >= first[k] else -1
                    m += 1
        order, kept, top = np.argsort(-new_seen[:m]), np.empty(m, dtype=np.int64), -np.inf
        n = 0
        for c in order:
            if new_worth[c] > top:
                top = new_worth[c]
                kept[n] = c
                n += 1
        chosen = kept[:n]
        if n > _KEPT:
            chosen = chosen[np.argsort(-most[chosen])[:_KEPT]]
            n = _KEPT
        for at in range(n):
            c = chosen[at]
            seen[at], worth[at] = new_seen[c], new_worth[c]
            parents[k, at], choices[k, at] = parent[c], choice[c]
        if n == 0:
            return 0
    reached = worth[:n].copy()
    for at in range(n):
        reached[at] += _root(seen[at], touching)
    order, found = np.argsort(-reached), 0
    for q in range(min(n, len(heights))):
        at = order[q]
        if reached[at] <= above:
            break
        heights[found] = reached[at]
        for k in range(cells - 1, -1, -1):
            sets[found, k] = choices[k, at]
            at = parents[k, at]
        found += 1
    return found


@compiled
def tightest(
    pixels: FloatArray, first: IntArray, amounts: FloatArray, touching: float, known: float,
    least: float, nearly: float, values: FloatArray,
) -> bool:  # fmt: skip
    """Stores phi [n] of the cut that is lowest at a mixture, or nearly so.

    Parameters
    ----------
    pixels, amounts : [n] pixels of a robot in each listed state, and the amount of robots there
    first : [cells+1] first state of each cell, and n
    touching : pixels at which the tangent of the root takes its place, to the left; > 0
    known : height of the known cuts at the mixture
    least : amount by which the cut must be lower
    nearly : share of the reduction that may be missed

    Returns
    -------
    False if no cut is low enough, or if the search takes too long.
    """
    n, cells = len(pixels), len(first) - 1
    m = n + 1  # rows: the states' amounts, and the total of all sets
    inverse, cost, level = np.eye(m), np.zeros(m), np.ones(m)
    level[:n] = amounts
    sets = np.zeros((_MOST_SETS, cells), dtype=np.int64)  # states of each set, and then others
    sizes, gains = np.zeros(_MOST_SETS, dtype=np.int64), np.zeros(_MOST_SETS)
    n_sets, turn = 0, 0
    found, heights = np.full((_SLOPES, cells), -1), np.zeros(_SLOPES)
    slopes, rest = _slopes(pixels, first, touching), np.empty((cells + 1, _SLOPES))
    duals, direction = np.empty(m), np.empty(m)
    for _ in range(_MOST_PIVOTS):
        duals[:] = 0.0
        for i in range(m):
            if cost[i] != 0.0:
                duals += cost[i] * inverse[i]
        entering = int(np.argmin(duals))  # the slack of a row
        gain = 0.0
        if duals[entering] < -_TINY:
            direction[:] = inverse[:, entering]
        else:
            value = (cost * level).sum()
            if known - value < least:
                return False
            entering, most = -1, _TINY
            for looked_at in range(n_sets):
                if entering >= 0 and looked_at % _LOOKED_AT == 0:
                    break
                turn = turn + 1 if turn + 1 < n_sets else 0
                reduced = gains[turn] - duals[n]
                for k in range(sizes[turn]):
                    reduced -= duals[sets[turn, k]]
                if reduced > most:
                    entering, most = turn, reduced
            if entering < 0:
                values[:] = np.maximum(duals[:n], 0.0)
                above = duals[n] + max(nearly * (known - value), 2 * _TINY)
                more = _best_by_slopes(
                    pixels, values, first, slopes, above, touching, found, heights
                )
                if more == 0:
                    _fill_completions(pixels, values, first, slopes, rest)
                    more = _best_sets(
                        pixels, values, first, slopes, rest, above, touching, found, heights
                    )
                if more == 0:
                    return True
                if n_sets + _ADDED > _MOST_SETS:
                    return False
                order = np.argsort(-heights[:more])
                for q in range(min(more, _ADDED)):
                    seen = 0.0
                    for at in found[order[q]]:
                        if at >= 0:
                            sets[n_sets, sizes[n_sets]] = at
                            sizes[n_sets] += 1
                            seen += pixels[at]
                    gains[n_sets] = _root(seen, touching)
                    n_sets += 1
                continue
            gain = gains[entering]
            direction[:] = inverse[:, n]
            for k in range(sizes[entering]):
                direction += inverse[:, sets[entering, k]]
        leaving, step = -1, np.inf
        for i in range(m):
            if direction[i] > _TINY and level[i] / direction[i] < step:
                leaving, step = i, level[i] / direction[i]
        if leaving < 0:
            return False
        level -= step * direction
        level[leaving] = step
        inverse[leaving] /= direction[leaving]
        for i in range(m):
            if i != leaving and direction[i] != 0.0:
                inverse[i] -= direction[i] * inverse[leaving]
        cost[leaving] = gain
    return False


def call_once() -> None:
    """Finds no cut of a single state, so that the kernel is loaded, or compiled and stored."""
    single = np.ones(1)
    first = np.array([0, 1])
    tightest(single, first, single, 0.5, 1.0, 1.0, 0.1, np.zeros(1))
