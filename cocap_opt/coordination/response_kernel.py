"""A compiled best response over few states; tests check that it equals NumPy's to the last bit.

Most of the time is spent on reading the edges from memory: four bytes per edge, unless moves are
rewarded or charged. Imported only if numba is installed.
"""

from functools import partial

import numpy as np

from cocap_opt.compiling import compiled
from cocap_opt.data import BoolArray, FloatArray, IndexArray, IntArray
from cocap_opt.returns import return_of

# Nothing is allocated here, so references need not be counted.
_compiled = partial(compiled, nogil=True, error_model="numpy", _nrt=False)
_inlined = partial(_compiled, kept=False, forceinline=True)
_return_of = _inlined(return_of)


@_inlined
def _along(
    value: FloatArray, heads: IndexArray, rewards: FloatArray, charges: FloatArray, edge: int
) -> float:
    """Returns the value of an edge that may be rewarded or charged."""
    reward = rewards[edge] if len(rewards) else 0.0
    worth: float = value[heads[edge]] + (reward - charges[edge])
    return worth


@_compiled
def best_nodes(
    first_entry: IntArray, view_sums: IndexArray, pixels: FloatArray, seen: FloatArray,
    before: FloatArray, weights: FloatArray, n_roots: int, caps: FloatArray, first_edge: IntArray,
    heads: IndexArray, rewards: FloatArray, charges: FloatArray, is_charged: BoolArray,
    cost: FloatArray, starts: int, last: int, value: FloatArray, path: IntArray,
) -> None:  # fmt: skip
    """Finds the best path from one of the first nodes; nodes are numbered step by step.

    Parameters
    ----------
    first_entry : [N+1] first entry of each node
    view_sums, pixels : [E] view sum and pixels of each entry
    seen, before, weights, n_roots, caps : [Z] px/m2 that others see, their worth, and the weights
        and returns of view sums
    first_edge : [N+1] first edge of each node
    heads, rewards, charges : [M] of each edge; rewards are empty if all are 0
    is_charged : [N] True if a node has charged edges
    cost : [N] cost of each node
    starts, last : number of nodes of the first step, and the first node of the last one
    value, path : [N] and [T+1], outputs: the values of nodes, and the nodes of the best path
    """
    for node in range(len(cost) - 1, -1, -1):
        worth = 0.0
        for k in range(first_entry[node], first_entry[node + 1]):
            at = view_sums[k]
            now = _return_of(n_roots, caps, at, seen[at] + pixels[k])
            worth += (now - before[at]) * weights[at]
        worth -= cost[node]
        if node < last:
            most = -np.inf
            if len(rewards) or is_charged[node]:
                for m in range(first_edge[node], first_edge[node + 1]):
                    along = _along(value, heads, rewards, charges, m)
                    most = along if along > most else most
            else:
                for m in range(first_edge[node], first_edge[node + 1]):
                    along = value[heads[m]]
                    most = along if along > most else most
            worth += most
        value[node] = worth
    node = 0
    for start in range(1, starts):
        if value[start] > value[node]:
            node = start
    path[0] = node
    for t in range(1, len(path)):
        best = first_edge[node]
        most = _along(value, heads, rewards, charges, best)
        for m in range(best + 1, first_edge[node + 1]):
            along = _along(value, heads, rewards, charges, m)
            if along > most:
                best, most = m, along
        node = heads[best]
        path[t] = node


def call_once() -> None:
    """Calls the kernel for one node, so that it is loaded, or compiled and stored."""
    first, numbers = np.zeros(2, dtype=np.int64), np.zeros(0, dtype=np.uint32)
    none, zero = np.zeros(0), np.zeros(1)
    views = first, numbers, none, none, none, none, 0, none
    edges = first, numbers, none, none, np.zeros(1, dtype=np.bool_)
    best_nodes(*views, *edges, zero, 1, 0, zero.copy(), first[:1])
