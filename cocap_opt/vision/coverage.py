"""Coverage of all states that a class of robots can reach, in a sparse table.

Most states see nothing.
"""

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from cocap_opt.arithmetic import entries_of, spans
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.stop import Clock, Stop, never
from cocap_opt.vision.viewpoints import Viewpoints
from cocap_opt.vision.views import StateViews

_NONE = np.zeros(0, dtype=np.int64)

# Called with the number of finished positions (places at steps), and the total.
Progress = Callable[[int, int], None]


class CoverageTable(NamedTuple):
    """The coverage of all reachable states that see anything, as compressed sparse rows.

    Node t S + s is state s at step t. View sums are numbered as in `Problem.step_view_sums`; in a
    table that is being made, t W + c is column c at step t.
    """

    nodes: IntArray  # [n] increasing
    indptr: IntArray  # [n + 1]
    view_sums: IntArray  # [nnz]
    pixels: FloatArray  # [nnz] px/m2, > 0; 1 for a counted person who is seen
    counts: IntArray = _NONE  # numbers of the entries that count people, increasing

    def row(self, node: int) -> tuple[IntArray, FloatArray]:
        """Returns the view sums that a node sees, and their coverage; empty if it sees nothing."""
        at = int(np.searchsorted(self.nodes, node))
        if at == len(self.nodes) or self.nodes[at] != node:
            return self.view_sums[:0], self.pixels[:0]
        part = slice(self.indptr[at], self.indptr[at + 1])
        return self.view_sums[part], self.pixels[part]

    def entries(self, nodes: IntArray) -> tuple[IntArray, IntArray]:
        """Returns all entries of nodes [n]: the node's position and the entry's position, for each
        entry.

        A node that sees nothing has no entries.
        """
        if not len(self.nodes):
            return nodes[:0], nodes[:0]
        at = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
        which = np.flatnonzero(self.nodes[at] == nodes)
        first = self.indptr[at[which]]
        counts = self.indptr[at[which] + 1] - first
        return np.repeat(which, counts), spans(first, counts)

    def row_sums(self, values: FloatArray) -> FloatArray:
        """Returns the sums [n] of `values` [nnz] over the rows, none of which is empty."""
        if not len(self.nodes):
            return np.zeros(0)
        return np.add.reduceat(values, self.indptr[:-1])


class GrowingTable:
    """A coverage table that is computed step after step, as far as limits allow.

    It has a row for every state in `reachable` that sees anything, and each row depends on its
    state alone. So a table for some of the states has the same rows for them, to the last bit, and
    nothing is computed for other states, steps or places.

    Parameters
    ----------
    views : the source of coverage
    n_places : number of places, each with all orientations
    reachable : [T+1, S] True for reachable states, or for some of them
    first_step : first step whose views count
    threads : number of threads (default: all usable cores), which does not affect the table
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
        self._columns = [_Column(kind) for kind in (np.int64, np.int64, np.int64, np.float64)]
        self._first_step, self._whole = first_step, _Whole(first_step, [0] * len(self._columns))

    @property
    def steps(self) -> int:
        """Number of steps, from 0 on, for which the table is complete."""
        return self._whole.steps

    def grow(self, stop: Stop = never, progress: Progress = lambda done, total: None) -> None:
        """Computes the coverage of all reachable states at the remaining steps.

        Parameters
        ----------
        stop : stopping criterion, checked after every batch
        progress : called at the beginning and regularly with the number of finished positions
            (places at steps) and the total; a position takes almost the same time for any number of
            orientations

        Raises
        ------
        LimitReached
            If a limit is reached before the table is complete. A later call continues.
        """
        positions = positions_of(self._reachable, self._n_places)
        positions[: self._first_step] = 0
        done, total = int(positions[: self.steps].sum()), int(positions.sum())
        before = done
        sizes = self._sizes()
        self._views.prepare(int(sizes.sum()), stop)
        progress(done, total)
        stop.check()
        pool, clock, found = ThreadPoolExecutor(self._threads), Clock(), list[_Rows]()
        try:
            for batch, rows in _in_turn(
                pool, partial(_seen_by, self._views), self._batches(sizes), self._threads
            ):
                found.append(rows)
                done += len(batch.at.places)
                if batch.steps:
                    self._keep(found, batch.steps, total / done)
                    found.clear()
                progress(done, total)
                if done < total:
                    stop.check()
                    if (passed := clock.seconds) > _MEASURED:
                        self._views.prepare_more(passed * (total - done) / (done - before), stop)
        finally:
            pool.shutdown(cancel_futures=True)
            self._views.advise(clock.seconds)
        self._whole = self._whole._replace(steps=len(sizes))

    def _sizes(self) -> IntArray:
        """Returns the number of views at each step that is not finished."""
        sizes = np.count_nonzero(self._reachable, axis=1)
        sizes[: self.steps] = 0
        return np.asarray(sizes)

    def _batches(self, sizes: IntArray) -> "Iterator[_Batch]":
        """Yields the reachable states of the remaining steps in batches."""
        for steps in _groups(sizes, self._views.batch):
            if len(steps) == 1:  # a single step may be split; several steps are one batch
                self._views.make_ready(steps[0])
            at = Viewpoints.joined([
                Viewpoints.reachable(step, self._reachable[step], self._n_places) for step in steps
            ])  # fmt: skip
            *others, last = at.split(self._views.batch)
            for part in others:
                yield _Batch(part)
            yield _Batch(last, steps[-1] + 1)

    def _keep(self, found: "list[_Rows]", steps: int, ahead: float) -> None:
        """Adds the rows of all batches of some steps, and marks the steps as finished.

        Parameters
        ----------
        ahead : expected length of the complete table, in multiples of its current length (at least
            1)

        The steps and the lengths of the columns change together, after all columns have grown: an
        error or an interrupt before that leaves the table unchanged.
        """
        rows = _joined(found)
        order = _by_orientation(rows.nodes, self._n_places)
        entries = entries_of(order, rows.counts)
        self._cut_back()
        taken = (order, order, entries, entries)
        for column, part, numbers in zip(self._columns, rows, taken, strict=True):
            column.append(part, numbers, ahead)
        self._whole = _Whole(steps, [len(column) for column in self._columns])

    def _cut_back(self) -> None:
        """Removes entries left by an error that occurred while columns grew."""
        for column, length in zip(self._columns, self._whole.lengths, strict=True):
            column.cut(length)

    def table(self) -> CoverageTable:
        """Returns the table of the finished steps."""
        self._cut_back()
        nodes, counts, view_sums, pixels = (column.given() for column in self._columns)
        indptr = np.concatenate([[0], np.cumsum(counts)])
        return CoverageTable(nodes=nodes, indptr=indptr, view_sums=view_sums, pixels=pixels)


def positions_of(reachable: BoolArray, n_places: int) -> IntArray:
    """Returns the number [T+1] of distinct places of the states [T+1, S] at each step."""
    orientations = reachable.shape[1] // max(n_places, 1)
    return np.array(
        [
            np.count_nonzero(states.reshape(orientations, n_places).any(axis=0))
            for states in reachable
        ],
        dtype=np.int64,
    )


def batches_of(sizes: IntArray, batch: int) -> int:
    """Returns the number of batches in which the given numbers of views at each step are
    computed.
    """
    return sum(-(-int(sizes[steps].sum()) // batch) for steps in _groups(sizes, batch))


def most_steps_together(sizes: IntArray, batch: int) -> tuple[int, int]:
    """Returns the first and last step of the largest group of steps whose views are computed
    together.
    """
    steps = max(_groups(sizes, batch), key=len, default=[0])
    return steps[0], steps[-1]


def usable_cores() -> int:
    """Returns the number of processor cores that this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


_MEASURED = 1.0  # s after which the remaining time is extrapolated from the elapsed time
_SPARE = 1.1  # factor on the expected size of a column
_AHEAD = 2  # batches per thread that are started before the first of them is collected


class _Rows(NamedTuple):
    """A few rows of a table, each for a state that sees anything."""

    nodes: IntArray  # [n]
    counts: IntArray  # [n] number of entries of each
    view_sums: IntArray  # [nnz]
    pixels: FloatArray  # [nnz] px/m2


class _Batch(NamedTuple):
    """Views that are computed together."""

    at: Viewpoints
    # number of finished steps, from 0 on, after this batch; 0 if further batches of a step follow
    steps: int = 0


class _Whole(NamedTuple):
    """The complete part of a table."""

    steps: int  # number of steps, from 0 on
    lengths: list[int]  # lengths of the columns


class _Column:
    """A growing column of a table, with room for the entries expected to follow.

    Thus it is rarely copied; memory that has never been written to takes no space.
    """

    def __init__(self, kind: DTypeLike) -> None:
        self._room, self._length = np.empty(0, kind), 0

    def __len__(self) -> int:
        return self._length

    def append(self, part: NDArray[Any], numbers: IntArray, ahead: float) -> None:
        """Appends the values of a part that have the given numbers, in this order.

        Parameters
        ----------
        ahead : expected length of the complete column, in multiples of its length after this call
            (at least 1)
        """
        n, end = self._length, self._length + len(numbers)
        if end > len(self._room):
            room = np.empty(int(end * ahead * _SPARE), self._room.dtype)
            room[:n] = self._room[:n]
            self._room = room
        # mode "raise" would copy them again
        np.take(part, numbers, out=self._room[n:end], mode="clip")
        self._length = end

    def cut(self, length: int) -> None:
        """Drops all values after the first `length`."""
        self._length = min(self._length, length)

    def given(self) -> NDArray[Any]:
        """Returns the current column; values appended later follow it."""
        return self._room[: self._length]


def _groups(sizes: IntArray, batch: int) -> Iterator[list[int]]:
    """Yields groups of consecutive steps whose views fit into one batch.

    A step with more views than a batch forms its own group. At a limit, the unfinished group is
    lost.
    """
    group, n = list[int](), 0
    for step, size in enumerate(sizes.tolist()):
        if group and (n + size > batch or not size):
            yield group
            group, n = [], 0
        if size:
            group.append(step)
            n += size
    if group:
        yield group


def _in_turn(
    pool: ThreadPoolExecutor,
    find: Callable[[Viewpoints], _Rows],
    batches: Iterator[_Batch],
    threads: int,
) -> Iterator[tuple[_Batch, _Rows]]:
    """Yields batches with their rows, while the pool computes the following ones."""
    begun = deque[tuple[_Batch, Future[_Rows]]]()
    for batch in batches:
        begun.append((batch, pool.submit(find, batch.at)))
        if len(begun) > _AHEAD * threads:
            first, rows = begun.popleft()
            yield first, rows.result()
    while begun:
        first, rows = begun.popleft()
        yield first, rows.result()


def _seen_by(views: StateViews, at: Viewpoints) -> _Rows:
    """Returns the rows of the views that see anything."""
    seen = views.look(at)
    seeing = np.flatnonzero(seen.counts)
    nodes, counts = at.nodes(seeing, views.graph.n_places, views.n_states), seen.counts[seeing]
    first = nodes // views.n_states * views.width
    return _Rows(nodes, counts, seen.columns + np.repeat(first, counts), seen.amounts)


def _joined(parts: list[_Rows]) -> _Rows:
    if len(parts) == 1:
        return parts[0]
    return _Rows._make(np.concatenate(column) for column in zip(*parts, strict=True))


def _by_orientation(nodes: IntArray, n_places: int) -> IntArray:
    """Returns the order that sorts nodes, which are sorted already within each orientation."""
    looks = nodes // n_places
    looks -= looks.min(initial=np.iinfo(np.int64).max)
    if looks.max(initial=0) < 2**16:  # radix sort, in linear time
        looks = looks.astype(np.uint16)
    return np.argsort(looks, kind="stable")
