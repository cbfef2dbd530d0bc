"""The quality of a plan in a few numbers, over all people and for each."""

import math
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.footage.moments import APART

_ROUNDING = 1e-9  # relative rounding error of sums of probabilities


class Summary(NamedTuple):
    """The quality of a plan in a few numbers, over the person-steps that count.

    Shares are nan if nothing counts; errors are nan if no drone has images. If there are takes,
    person-steps are weighted by the probability of their take.

    Attributes
    ----------
    person_steps : number of person-steps that count
    by_two, by_three : shares seen by at least two and at least three drones
    apart : share seen by two drones at least 30 degrees apart
    infinite : share whose error is infinite
    median, most_of_them : errors that half and nine tenths of the person-steps do not exceed, mm.
        They are not interpolated, so infinite errors count as such
    in_pictures : number of drones that are large enough (see `Assumptions`) in the images of
        others, over all steps that count
    disturbed : share of images (one per step for each drone with images) that contain another
        drone; nan if no drone has images
    """

    person_steps: int
    by_two: float
    by_three: float
    apart: float
    infinite: float
    median: float
    most_of_them: float
    in_pictures: int
    disturbed: float

    @classmethod
    def of(
        cls, views: IntArray, angles: FloatArray, errors: FloatArray, drones_seen: BoolArray,
        chances: FloatArray | None = None,
    ) -> Self:  # fmt: skip
        """Returns the summary of n person-steps.

        Parameters
        ----------
        views : [n] number of drones that see the person
        angles : [n] widest angles between two rays, degrees; nan if there is none
        errors : [n] mm
        drones_seen : [m, R] True if a drone is in one of m images
        chances : [n] probability of each person-step, used as its weight; None: equal weights
        """
        return cls(
            person_steps=len(views),
            by_two=share(views >= 2, chances),
            by_three=share(views >= 3, chances),
            apart=share(angles >= APART, chances),
            infinite=share(np.isinf(errors), chances),
            median=_not_exceeded(errors, 0.5, chances),
            most_of_them=_not_exceeded(errors, 0.9, chances),
            in_pictures=int(drones_seen.sum()),
            disturbed=share(np.asarray(drones_seen.any(axis=1))),
        )

    @property
    def line(self) -> str:
        """The summary in a line; empty if nothing counts."""
        return cameras_line(self.by_two, self.by_three, self.median)


class OfPerson(NamedTuple):
    """The quality of a plan for one person over the steps that count, as in `Summary`.

    Attributes
    ----------
    person : name
    actor : number of the person
    steps : number of steps that count
    by_two, by_three : shares of these steps at which at least two or three drones see the person
    apart : share at which two drones at least 30 degrees apart see the person
    median, most_of_them : errors that half and nine tenths of these steps do not exceed, mm
    worst : the worst moment in words, e.g. "one camera from 1.25 to 1.5 s"; empty if there is none
    """

    person: str
    actor: int
    steps: int
    by_two: float
    by_three: float
    apart: float
    median: float
    most_of_them: float
    worst: str

    @classmethod
    def of(cls, person: str, actor: int, summary: Summary, worst: str) -> Self:
        """Returns the quality for one person, from the summary of the person's steps and the worst
        moment.
        """
        same = {name: getattr(summary, name) for name in cls._fields if name in Summary._fields}
        return cls(person=person, actor=actor, steps=summary.person_steps, worst=worst, **same)


def cameras_line(by_two: float | None, by_three: float | None, median: float | None) -> str:
    """Returns words for the shares seen by two drones and by three; empty if nothing counts.

    Parameters
    ----------
    median : error that half of all person-steps do not exceed, mm; left out if it is None, infinite
        or unknown
    """
    if by_two is None or by_three is None or math.isnan(by_two):
        return ""
    words = f"two see {whole_percent(by_two)} of person-steps, three {whole_percent(by_three)}"
    known = median is not None and math.isfinite(median)
    return f"{words}; median error {median:,.0f} mm" if known else words


def whole_percent(part: float) -> str:
    """Returns a share in whole per cent; only exact values give 0 or 100 %."""
    if 0 < part < 0.01:
        return "under 1 %"
    return "over 99 %" if 0.99 < part < 1 else f"{100 * part:.0f} %"


def share(held: BoolArray, weights: FloatArray | None = None) -> float:
    """Returns the share of True values, weighted if weights are given; nan if there are no
    values.
    """
    if weights is not None and len(held):
        return min(math.fsum(weights[held]) / math.fsum(weights), 1.0)
    return float(held.mean()) if len(held) else math.nan


def _not_exceeded(values: FloatArray, part: float, weights: FloatArray | None = None) -> float:
    """Returns the smallest of some values [n] that the given share of them does not exceed.

    nan values are ignored; if all values are nan, so is the result.
    """
    is_known = ~np.isnan(values)
    if weights is not None and is_known.any():
        order = np.argsort(values[is_known], kind="stable")
        up_to = np.cumsum(weights[is_known][order])
        first = int(np.searchsorted(up_to, part * up_to[-1] * (1 - _ROUNDING)))
        return float(values[is_known][order][first])
    known = np.sort(values[is_known])
    return float(known[math.ceil(part * len(known)) - 1]) if len(known) else math.nan
