"""Estimates of the cost of coverage before it begins: a sample is timed and extrapolated."""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, IntArray
from cocap_opt.stop import Clock
from cocap_opt.vision.coverage import group_sizes, usable_cores
from cocap_opt.vision.views import StateViews

_PARTS = 8  # of the sample, evenly spread over all views in the order of their steps
_SPREAD = [0, 4, 2, 6, 7, 3, 5, 1]  # an order of them of which any beginning is spread, too
_SHARE = 0.02  # of all views, that are sampled
_LEAST = 1_024  # views of a part, at least where a batch has as many
_FEW = 64  # views of a small part, whose time is mostly what every batch takes
_AT_ONCE = 4  # parts in a pool of threads, between looks at the clock
_SECONDS = 0.7  # after which a sample of large parts is large enough
_BYTES_PER_ENTRY = 90  # of a face seen from a state, while the table is made: measured


class CoverageEstimate(NamedTuple):
    """The cost of the coverage that is not there yet.

    Attributes
    ----------
    views : number of states at steps whose views are to be evaluated
    seconds : s, wall-clock time on all usable cores
    memory : bytes, at the most, planning included
    """

    views: int = 0
    seconds: float = 0.0
    memory: float = 0.0

    @classmethod
    def of(
        cls, views: StateViews, n_places: int, reachable: BoolArray, threads: int | None = None
    ) -> "CoverageEstimate":
        """Estimates the coverage of all reachable states.

        Which views are sampled depends on the scene alone, but for an end after a second. It is
        some 2 % of all, spread over steps and places; each place has all its orientations, as in
        the table's own batches.

        Parameters
        ----------
        n_places : number of places, each of which has all orientations
        reachable : [T+1, S] true where a state can be reached and its view is to be evaluated
        threads : number of threads, all usable cores if not given
        """
        sizes = np.count_nonzero(reachable, axis=1)
        total = int(sizes.sum())
        if not total:
            return cls()
        views.prepare(total)  # by compiled code, if that is kept and soon repaid
        most = min(int(max(_SHARE * total / _PARTS, _LEAST)), views.batch)
        large = _parts(n_places, reachable, most)
        views.seen(large[0][:1])  # what is made once, and kept, is no part of the rate
        threads = threads or usable_cores()
        with ThreadPoolExecutor(threads) as pool:
            of_large = _Timed.of(pool, views, large)
            of_small = _Timed.of(pool, views, [part[:_FEW] for part in large])
        batches = sum(-(-n // views.batch) for n in group_sizes(sizes, 0, views.batch, threads))
        entries = of_large.entries * total / of_large.views
        seconds = views.expected(of_large.extrapolated(of_small, total, batches))
        return cls(total, seconds, entries * _BYTES_PER_ENTRY)

    def __add__(self, other: object) -> "CoverageEstimate":
        """Returns the estimate of both, one after the other."""
        assert isinstance(other, CoverageEstimate)
        return CoverageEstimate(
            self.views + other.views, self.seconds + other.seconds, self.memory + other.memory
        )


class _Timed(NamedTuple):
    """Views that were evaluated, in parts."""

    parts: int
    views: int
    entries: int  # faces that they see
    seconds: float

    @classmethod
    def of(cls, pool: ThreadPoolExecutor, views: StateViews, parts: list[IntArray]) -> "_Timed":
        """Evaluates parts of a sample until that has taken long enough."""
        clock, done, found, entries = Clock(), 0, 0, 0
        for first in range(0, len(parts), _AT_ONCE):
            group = parts[first : first + _AT_ONCE]
            entries += sum(len(seen.rows) for seen in pool.map(views.seen, group))
            done, found = done + len(group), found + sum(map(len, group))
            if clock.seconds > _SECONDS:
                break
        return cls(done, found, entries, clock.seconds)

    def extrapolated(self, small: "_Timed", views: int, batches: int) -> float:
        """Returns the seconds of all views in batches, by those of larger and of smaller parts.

        A part takes a time of its own, and one for each of its views.
        """
        fixed, each = 0.0, self.seconds / self.views
        n, few = self.views / self.parts, small.views / small.parts
        if n > 2 * few:
            slope = (self.seconds / self.parts - small.seconds / small.parts) / (n - few)
            each = min(max(slope, 0.0), each)
            fixed = self.seconds / self.parts - each * n
        return batches * fixed + views * each


def _parts(n_places: int, reachable: BoolArray, size: int) -> list[IntArray]:
    """Returns the nodes of a sample in parts of about `size` views of one step each.

    Parts are in an order in which the first few are spread over all steps, too.
    """
    rng, n_states = np.random.default_rng(0), reachable.shape[1]
    ends = np.cumsum(np.count_nonzero(reachable, axis=1))
    middles = (np.arange(_PARTS) + 0.5) / _PARTS * ends[-1]
    found = []
    for t in np.searchsorted(ends, middles, side="right")[_SPREAD].tolist():
        here = reachable[t].reshape(-1, n_places)  # [O, P]
        places = np.flatnonzero(here.any(axis=0))
        count = min(max(round(size * len(places) / np.count_nonzero(here)), 1), len(places))
        chosen = np.sort(rng.choice(places, count, replace=False))
        which, orientation = np.nonzero(here[:, chosen].T)
        found.append(t * n_states + orientation * n_places + chosen[which])
    return found
