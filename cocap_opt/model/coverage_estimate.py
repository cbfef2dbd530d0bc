"""Estimates of the cost of coverage before it begins: a sample is timed and extrapolated."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, IntArray
from cocap_opt.stop import Clock
from cocap_opt.vision.coverage import (
    batches_of,
    most_steps_together,
    positions_of,
    usable_cores,
)
from cocap_opt.vision.viewpoints import Viewpoints
from cocap_opt.vision.views import StateViews

_PARTS = 8  # of the sample, evenly spread over all positions in the order of their steps
_SPREAD = [0, 4, 2, 6, 7, 3, 5, 1]  # an order of them of which any beginning is spread, too
_SHARE = 0.02  # of all positions, that are sampled
_LEAST = 1_024  # views of a part, at least where a batch has as many
_FEW = 64  # views of a small part, whose time is mostly what every batch takes
_AT_ONCE = 4  # parts in a pool of threads, between looks at the clock
_SECONDS = 0.7  # after which a sample of large parts is large enough
# Bytes of a face seen from a state while drones are planned, without those of states: more than 35
# while the table is made and written to the cache. Measured, and rounded up: see `study memory`.
BYTES_PER_ENTRY = 50


class CoverageEstimate(NamedTuple):
    """The cost of the coverage that is not there yet.

    Attributes
    ----------
    views : number of states at steps whose views are to be evaluated
    seconds : s, wall-clock time on all usable cores
    memory : bytes, about: the entries that a sample lets expect, each as planning needs it, and
        lists of bodies while the table is made; arrays of value iteration are not in it
    """

    views: int = 0
    seconds: float = 0.0
    memory: float = 0.0

    @classmethod
    def of(
        cls, views: StateViews, n_places: int, reachable: BoolArray, threads: int | None = None
    ) -> "CoverageEstimate":
        """Estimates the coverage of all reachable states.

        Which positions, places at steps, are sampled depends on the scene alone, but for an end
        after a second. It is some 2 % of all, spread over steps and places; each has all its
        orientations, as in the table's own batches, and costs about as much as any other.

        Parameters
        ----------
        n_places : number of places, each of which has all orientations
        reachable : [T+1, S] true where a state can be reached and its view is to be evaluated
        threads : number of threads (default: all usable cores)
        """
        sizes, positions = np.count_nonzero(reachable, axis=1), positions_of(reachable, n_places)
        total, places = int(sizes.sum()), int(positions.sum())
        if not total:
            return cls()
        views.prepare(total)  # by compiled code, if that is kept and soon repaid
        most, each = min(max(_SHARE * total / _PARTS, _LEAST), views.batch), total / places
        large, small = (
            _parts(n_places, reachable, positions, round(size / each)) for size in (most, _FEW)
        )
        steps = int(np.count_nonzero(sizes))
        views.look(small[0])  # what is made once, and kept, is no part of the rates
        threads = threads or usable_cores()
        with ThreadPoolExecutor(threads) as pool:
            # The first look at a step makes what all others of that step need.
            first, again = (_Timed.of(pool, views, small[1:]) for _ in range(2))
            of_large = _Timed.of(pool, views, large[: 1 + first.parts])
        seconds = steps * max(first.each - again.each, 0.0)
        seconds += of_large.extrapolated(again, places, batches_of(sizes, views.batch))
        entries = of_large.entries * places / of_large.positions
        memory = entries * BYTES_PER_ENTRY + room_of(views, sizes, threads)
        return cls(total, views.expected(seconds), memory)

    def __add__(self, other: object) -> "CoverageEstimate":
        """Returns the estimate of both, one after the other."""
        assert isinstance(other, CoverageEstimate)
        return CoverageEstimate(
            self.views + other.views, self.seconds + other.seconds, self.memory + other.memory
        )


def room_of(views: StateViews, sizes: IntArray, threads: int | None = None) -> float:
    """Returns the bytes, about, that are taken beside a table while it is made.

    Parameters
    ----------
    sizes : [T+1] number of views at each step
    threads : number of threads (default: all usable cores)
    """
    together = most_steps_together(sizes, views.batch)
    return views.room(int(np.count_nonzero(sizes)), together, threads or usable_cores())


class _Timed(NamedTuple):
    """Positions of which all views were evaluated, in parts."""

    parts: int
    positions: int
    entries: int  # faces that they see
    seconds: float

    @property
    def each(self) -> float:
        """Seconds of a part."""
        return self.seconds / self.parts

    @classmethod
    def of(cls, pool: ThreadPoolExecutor, views: StateViews, parts: list[Viewpoints]) -> "_Timed":
        """Evaluates parts of a sample until that has taken long enough."""
        clock, done, found, entries = Clock(), 0, 0, 0
        for first in range(0, len(parts), _AT_ONCE):
            group = parts[first : first + _AT_ONCE]
            entries += sum(len(seen.columns) for seen in pool.map(views.look, group))
            done, found = done + len(group), found + sum(len(part.places) for part in group)
            if clock.seconds > _SECONDS:
                break
        return cls(done, found, entries, clock.seconds)

    def extrapolated(self, small: "_Timed", positions: int, batches: int) -> float:
        """Returns the seconds of all positions in batches, by those of larger and smaller parts.

        A part takes a time of its own, and one for each of its positions.
        """
        fixed, each = 0.0, self.seconds / self.positions
        n, few = self.positions / self.parts, small.positions / small.parts
        if n > 2 * few:
            each = min(max((self.each - small.each) / (n - few), 0.0), each)
            fixed = self.each - each * n
        return batches * fixed + positions * each


def _parts(n_places: int, reachable: BoolArray, positions: IntArray, size: int) -> list[Viewpoints]:
    """Returns a sample in parts of about `size` of the positions [T+1] of one step each.

    Parts are in an order in which the first few are spread over all steps, too.
    """
    rng, ends = np.random.default_rng(0), np.cumsum(positions)
    middles = (np.arange(_PARTS) + 0.5) / _PARTS * ends[-1]
    found = []
    for t in np.searchsorted(ends, middles, side="right")[_SPREAD].tolist():
        here = reachable[t].reshape(-1, n_places)  # [O, P]
        places = np.flatnonzero(here.any(axis=0))
        chosen = rng.choice(places, min(max(size, 1), len(places)), replace=False)
        sampled = np.zeros_like(here)
        sampled[:, chosen] = here[:, chosen]
        found.append(Viewpoints.reachable(t, sampled.ravel(), n_places))
    return found
