"""The worst moments of a plan, in words: who is seen by no camera or by one, and when."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray

APART = 30.0  # degrees; larger angles between two rays count as well apart
NO_CAMERA, ONE_CAMERA, NARROW, GOOD = range(4)  # worst first


class Moment(NamedTuple):
    """Consecutive steps at which something is wrong with how a person is filmed.

    Attributes
    ----------
    person : number of the person
    first, last : steps
    kind : NO_CAMERA, ONE_CAMERA or NARROW
    angle : widest angle between two rays at any of these steps, degrees; nan if there is none
    """

    person: int
    first: int
    last: int
    kind: int
    angle: float

    def words(self, times: FloatArray | None) -> str:
        """Returns the moment in words, e.g. "one camera from 1.25 to 1.5 s".

        Parameters
        ----------
        times : [T+1] times of the steps, s; None if the scene defines no step length
        """
        return f"{self.what} {self._when(times)}"

    @property
    def what(self) -> str:
        """The cameras at that moment, in words."""
        if self.kind == NARROW:
            return f"cameras at most {math.floor(self.angle)} degrees apart"
        return {NO_CAMERA: "no camera", ONE_CAMERA: "one camera"}[self.kind]

    def _when(self, times: FloatArray | None) -> str:
        """Returns the period of the moment in words."""
        if times is None:
            one_step = self.first == self.last
            return f"at step {self.first}" if one_step else f"at steps {self.first} to {self.last}"
        begin, end = (f"{float(times[t]):.6g}" for t in (self.first, self.last))
        return f"at {begin} s" if begin == end else f"from {begin} to {end} s"


def worst_moments(views: IntArray, angles: FloatArray, counts: BoolArray) -> list[Moment]:
    """Returns all moments at which somebody is not filmed well, worst first.

    Moments without a camera come before those with one camera, and these before those with several
    cameras less than 30 degrees apart; within each kind, the longest come first.

    Parameters
    ----------
    views : [T+1, A] number of drones that see each person
    angles : [T+1, A] degrees, the widest between two rays
    counts : [T+1, A] True for the person-steps that count
    """
    kinds = np.where(views >= 2, np.where(angles < APART, NARROW, GOOD), np.minimum(views, 1))
    kinds = np.where(counts, kinds, GOOD)
    found = [
        Moment(person, first, last, kind, float(angles[first : last + 1, person].max()))
        for person in range(views.shape[1])
        for first, last, kind in _runs(kinds[:, person])
        if kind != GOOD
    ]
    return sorted(found, key=lambda m: (m.kind, m.first - m.last, m.first, m.person))


def _runs(kinds: IntArray) -> Iterator[tuple[int, int, int]]:
    """Yields the first and last steps of each run of equal kinds [T+1], and the kind."""
    starts = [0, *(np.flatnonzero(np.diff(kinds)) + 1).tolist()]
    for first, following in zip(starts, [*starts[1:], len(kinds)], strict=True):
        yield first, following - 1, int(kinds[first])
