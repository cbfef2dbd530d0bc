"""Views place by place: the parts visible from a place are the same for all orientations there."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import BoolArray, IntArray


class Viewpoints(NamedTuple):
    """Places at steps, each with the orientations of its views."""

    steps: IntArray  # [e] not decreasing
    places: IntArray  # [e]
    counts: IntArray  # [e] number of views of each
    looks: IntArray  # [n] orientations of the views, place by place

    @classmethod
    def reachable(cls, step: int, states: BoolArray, n_places: int) -> Self:
        """Returns the states [S] at a step for which the array is True; state o P + p is at place
        p.
        """
        by_place = states.reshape(-1, n_places)
        is_used, n = by_place.any(axis=0), len(by_place)
        places = np.flatnonzero(is_used)
        if (by_place.all(axis=0) == is_used).all():  # usual after a few steps, and fast
            looks, counts = np.tile(np.arange(n), len(places)), np.full(len(places), n)
        else:
            wanted = np.ascontiguousarray(by_place[:, places].T)
            looks, counts = np.flatnonzero(wanted) % n, np.count_nonzero(wanted, axis=1)
        return cls(np.full(len(places), step), places, counts, looks)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Returns the viewpoints of several parts, one after the other."""
        return cls._make(np.concatenate(column) for column in zip(*parts, strict=True))

    def split(self, most: int) -> Iterator[Self]:
        """Yields parts with about the given number of views, each with all views of its places."""
        ends = np.cumsum(self.counts)
        total = len(self.looks)
        cuts = np.unique(np.searchsorted(ends, range(most, total, most), side="left") + 1)
        for first, last in zip([0, *cuts.tolist()], [*cuts.tolist(), len(ends)], strict=True):
            if first < last:
                begin = int(ends[first] - self.counts[first])
                yield type(self)(
                    self.steps[first:last], self.places[first:last], self.counts[first:last],
                    self.looks[begin : int(ends[last - 1])],
                )  # fmt: skip

    @property
    def which(self) -> IntArray:
        """The number [n] of each view's place."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    def nodes(self, views: IntArray, n_places: int, n_states: int) -> IntArray:
        """Returns the nodes of some views; node t S + s is state s at step t."""
        which = self.which[views]
        first = self.steps * n_states + self.places
        return np.asarray(self.looks[views] * n_places + first[which])
