"""Coverage of all states that a class of robots can reach, in a sparse table.

Most states see nothing.
"""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.stop import Clock, Stop, never
from cocap_opt.vision.viewpoints import Viewpoints
from cocap_opt.vision.views import StateViews

_NONE = np.zeros(0, dtype=np.int64)

Progress = Callable[[int, int], None]  # told how many views are done, and of how many


class CoverageTable(NamedTuple):
    """The coverage of all reachable states that see anything, in compressed sparse rows.

    Node t S + s is state s at step t. View sums are numbered as `Problem.step_view_sums` does; in a
    table that is made, but not yet a problem's, t W + c is column c at step t.
    """

    nodes: IntArray  # [n] increasing
    indptr: IntArray  # [n + 1]
    view_sums: IntArray  # [nnz]
    pixels: FloatArray  # [nnz] px/m2, > 0; 1 for a person who is seen, where people count
    counts: IntArray = _NONE  # those entries that count people, increasing

    def row(self, node: int) -> tuple[IntArray, FloatArray]:
        """Returns the view sums that a node sees and their coverage; empty if it sees nothing."""
        at = int(np.searchsorted(self.nodes, node))
        if at == len(self.nodes) or self.nodes[at] != node:
            return self.view_sums[:0], self.pixels[:0]
        part = slice(self.indptr[at], self.indptr[at + 1])
        return self.view_sums[part], self.pixels[part]

    def entries(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Returns all entries of nodes [n]: the position of the node, and that of the entry.

        Both are arrays with one number for each entry; a node that sees nothing has none.
        """
        if not len(self.nodes):
            return nodes[:0], nodes[:0]
        at = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
        which = np.flatnonzero(self.nodes[at] == nodes)
        first = self.indptr[at[which]]
        counts = self.indptr[at[which] + 1] - first
        return np.repeat(which, counts), spans(first, counts)

    def row_sums(self, values: FloatArray) -> FloatArray:
        """Returns the sums [n] of `values` [nnz] over the rows, which are never empty."""
        if not len(self.nodes):
            return np.zeros(0)
        return np.add.reduceat(values, self.indptr[:-1])


class GrowingTable:
    """A coverage table that is computed step after step, as far as limits allow.

    Parameters
    ----------
    views : the source of coverage
    n_places : number of places, each of which has all orientations
    reachable : [T+1, S] true where a state can be reached
    first_step : first step whose views count
    threads : number of threads, all usable cores if not given; the table does not depend on it

    Attributes
    ----------
    steps : number of steps, from 0 on, that the table is whole for
    """

    def __init__(
        self,
        views: StateViews,
        n_places: int,
        reachable: BoolArray,
        first_step: int,
        threads: int | None = None,
    ) -> None:
        self._views, self._n_places, self._reachable = views, n_places, reachable
        self._threads = threads or usable_cores()
        self._parts = [_NO_ROWS]
        self._first_step = self.steps = first_step

    def grow(self, stop: Stop = never, progress: Progress = lambda done, total: None) -> None:
        """Computes the coverage of all reachable states at the steps that are left.

        Parameters
        ----------
        stop : stopping criterion, checked after every batch
        progress : told now and then how many views, of states at steps, of how many are done

        Raises
        ------
        LimitReached
            If a limit is reached before the table is whole. It can grow further later.
        """
        sizes = np.count_nonzero(self._reachable, axis=1)
        sizes[: self._first_step] = 0
        done, total = int(sizes[: self.steps].sum()), int(sizes.sum())
        self._views.prepare(total - done, stop)
        pool, clock = ThreadPoolExecutor(self._threads), Clock()
        try:
            for first, last in _groups(sizes, self.steps, self._views.batch, self._threads):
                batches, found = self._batches(first, last), [_NO_ROWS]
                stop.check()
                sought = 0
                for batch, rows in zip(
                    batches, pool.map(partial(_seen_by, self._views), batches), strict=True
                ):
                    found.append(rows)
                    sought += len(batch.looks)
                    progress(done + sought, total)
                    if len(found) <= len(batches):  # else these steps are whole
                        stop.check()
                self._parts.append(_in_order(_joined(found)))
                self.steps, done = last, done + sought
        finally:
            pool.shutdown(cancel_futures=True)
            self._views.advise(clock.seconds)

    def _batches(self, first: int, last: int) -> list[Viewpoints]:
        """Returns the reachable states at steps first..last - 1 in batches."""
        at = Viewpoints.joined([
            Viewpoints.reachable(step, self._reachable[step], self._n_places)
            for step in range(first, last)
        ])  # fmt: skip
        return [*at.split(self._views.batch)]

    def table(self) -> CoverageTable:
        """Returns the table of the steps that are done."""
        nodes, counts, view_sums, pixels = _joined(self._parts)
        indptr = np.concatenate([[0], np.cumsum(counts)])
        return CoverageTable(nodes=nodes, indptr=indptr, view_sums=view_sums, pixels=pixels)


def group_sizes(sizes: IntArray, first_step: int, batch: int, threads: int) -> list[int]:
    """Returns the numbers of nodes that are computed together, in batches, of steps' numbers."""
    return [int(sizes[a:b].sum()) for a, b in _groups(sizes, first_step, batch, threads)]


def usable_cores() -> int:
    """Returns the number of processor cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


# A few rows of a table: nodes [n], the number of entries of each [n], and view sums and coverage
# (px/m2) of all entries [nnz].
_SeenRows = tuple[IntArray, IntArray, IntArray, FloatArray]
_AT_ONCE = 2  # batches of each thread
_NO_ROWS: _SeenRows = (_NONE, _NONE, _NONE, np.zeros(0))


def _groups(
    sizes: IntArray, first_step: int, batch: int, threads: int
) -> Iterator[tuple[int, int]]:
    """Yields spans first..last - 1 of steps that have some batches for each thread.

    A limit loses at most what these take. The last may have fewer.
    """
    first, n, most = first_step, 0, _AT_ONCE * threads * batch
    for t in range(first_step, len(sizes)):
        n += int(sizes[t])
        if n >= most or t == len(sizes) - 1:
            yield first, t + 1
            first, n = t + 1, 0


def _seen_by(views: StateViews, at: Viewpoints) -> _SeenRows:
    """Returns the rows of those views that see anything."""
    seen = views.look(at)
    counts = np.bincount(seen.rows, minlength=len(at.looks))
    seeing = np.flatnonzero(counts)
    nodes, counts = at.nodes(seeing, views.graph.n_places, views.n_states), counts[seeing]
    view_sums = np.repeat(nodes // views.n_states * views.width, counts) + seen.columns
    return nodes, counts, view_sums, seen.amounts


def _joined(parts: list[_SeenRows]) -> _SeenRows:
    nodes, counts, view_sums, pixels = (np.concatenate(x) for x in zip(*parts, strict=True))
    return nodes, counts, view_sums, pixels


def _in_order(rows: _SeenRows) -> _SeenRows:
    """Returns the same rows, sorted by node."""
    nodes, counts, view_sums, pixels = rows
    order = np.argsort(nodes)
    entries = spans((np.cumsum(counts) - counts)[order], counts[order])
    return nodes[order], counts[order], view_sums[entries], pixels[entries]
