"""Estimates the cost of coverage in advance, by timing a sample and extrapolating."""

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

_PARTS = 8  # parts of the sample, evenly spread over all positions in the order of their steps
# an order of the parts in which every prefix is evenly spread, too
_SPREAD = [0, 4, 2, 6, 7, 3, 5, 1]
_SHARE = 0.02  # share of all positions that are sampled
_LEAST = 1_024  # views of a part, at least, unless a batch has fewer
_FEW = 64  # views of a small part, whose time is mostly the overhead of a batch
_AT_ONCE = 4  # parts in a pool of threads between two checks of the clock
_SECONDS = 0.7  # s after which a sample of large parts is large enough
# Bytes per face seen from a state while drones are planned, without those of states: more than the
# 35 while the table is made and written to the cache. Measured, and rounded up: see `study memory`.
BYTES_PER_ENTRY = 50


class CoverageEstimate(NamedTuple):
    """The cost of the coverage that is still missing.

    Attributes
    ----------
    views : number of views to evaluate, i.e. of states at steps
    seconds : s, wall-clock time on all usable cores
    memory : approximate bytes: the entries that the sample predicts, each as planning needs it, and
        lists of bodies while the table is made; without the arrays of value iteration
    """

    views: int = 0
    seconds: float = 0.0
    memory: float = 0.0

    @classmethod
    def of(
        cls, views: StateViews, n_places: int, reachable: BoolArray, threads: int | None = None
    ) -> "CoverageEstimate":
        """Estimates the coverage of all reachable states.

        Which positions (places at steps) are sampled depends only on the scene, except that
        sampling ends after a second. The sample has some 2 % of all positions, spread over steps
        and places; each has all its orientations, as in the table's own batches, and takes about as
        long as any other.

        Parameters
        ----------
        n_places : number of places, each of which has all orientations
        reachable : [T+1, S] True if a state can be reached and its view must be evaluated
        threads : number of threads (default: all usable cores)
        """
        sizes, positions = np.count_nonzero(reachable, axis=1), positions_of(reachable, n_places)
        total, places = int(sizes.sum()), int(positions.sum())
        if not total:
            return cls()
        views.prepare(total)  # uses compiled code, if it is cached and soon pays off
        most, each = min(max(_SHARE * total / _PARTS, _LEAST), views.batch), total / places
        large, small = (
            _parts(n_places, reachable, positions, round(size / each)) for size in (most, _FEW)
        )
        steps = int(np.count_nonzero(sizes))
        views.look(small[0])  # work that is done once and cached must not affect the rates
        threads = threads or usable_cores()
        with ThreadPoolExecutor(threads) as pool:
            # The first view at a step computes what all other views of that step need.
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
    """Returns the approximate number of bytes used in addition to a table while it is made.

    Parameters
    ----------
    sizes : [T+1] number of views at each step
    threads : number of threads (default: all usable cores)
    """
    together = most_steps_together(sizes, views.batch)
    return views.room(int(np.count_nonzero(sizes)), together, threads or usable_cores())


class _Timed(NamedTuple):
    """A sample of positions whose views were all evaluated, in parts."""

    parts: int
    positions: int
    entries: int  # number of faces that they see
    seconds: float

    @property
    def each(self) -> float:
        """Seconds per part."""
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
        """Returns the seconds for all positions in batches, extrapolated from larger and smaller
        parts.

        The time of a part is a constant plus a time per position.
        """
        fixed, each = 0.0, self.seconds / self.positions
        n, few = self.positions / self.parts, small.positions / small.parts
        if n > 2 * few:
            each = min(max((self.each - small.each) / (n - few), 0.0), each)
            fixed = self.each - each * n
        return batches * fixed + positions * each


def _parts(n_places: int, reachable: BoolArray, positions: IntArray, size: int) -> list[Viewpoints]:
    """Returns a sample in parts of about `size` of the positions [T+1], each part at one step.

    The order is such that the first few parts are spread over all steps, too.
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
