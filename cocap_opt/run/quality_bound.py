"""Bounds on quality: the most person-steps that m or more drones can see in any plan.

Let n be the number of drones that see a person at a step, and B a bound, over all plans, on the sum
of w min(k, n) over all person-steps, where w is the weight of a person-step. As m [n >= m] <=
min(k, n) for m <= k,

    the total weight of the person-steps that m or more drones see is at most B / m.

If all weights are equal, this bounds the number of person-steps, which is whole; with different
weights, it bounds only the weight. Person-steps seen by m drones are also seen by m - 1. So the
bound on each share is the smallest that any k >= m, or any smaller number of drones, proves.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.console.progress import Watch
from cocap_opt.data import FloatArray
from cocap_opt.footage.quality import Quality
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.model import share_coverage
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.engine import BOUND_METHOD, run
from cocap_opt.run.options import Allowance
from cocap_opt.run.view_share import counted_weights, counting_gap, views_alone, views_asked
from cocap_opt.stop import Stop, never
from cocap_opt.text import number_in_words, rounded_up

_ROUNDING = 1e-9  # relative tolerance for a bound that is too small by rounding


class MostSeen(NamedTuple):
    """The most person-steps that m or more drones can see in any plan.

    Attributes
    ----------
    drones : m, the smallest number of drones that see the person
    share : share of all person-steps, by weight, that no plan exceeds; 0 to 1
    person_steps : number of person-steps; None if weights differ, as the share then does not bound
        it
    """

    drones: int
    share: float
    person_steps: int | None


@dataclass(frozen=True, eq=False, repr=False)
class QualityBound:
    """Bounds, over all plans of a scene, on the person-steps that several drones see.

    The plans are those of the scene's drones that obey its rules. A person-step is weighted with
    the person's importance at the step, if the person has any weight.

    Attributes
    ----------
    problem : the scene
    cameras : the largest number of drones for which there is a bound
    at_least : share of a person, by solid angle, that a drone must see
    weights : [T+1, A] weight of each person-step; 0 if it does not count
    results : for each sum of min(1, n), of min(2, n) and so on, where n drones see a person: its
        bound with the certificate, and the plan with the largest sum found
    """

    problem: Problem
    cameras: int
    at_least: float
    weights: FloatArray
    results: tuple[CertifiedResult, ...] = ()

    @classmethod
    def of(
        cls, problem: Problem, cameras: int | None = None, at_least: float | None = None
    ) -> Self:
        """Returns an object for which nothing is proved yet.

        Parameters
        ----------
        cameras, at_least : None: as in the problem's objective, or two and 0.3

        Raises
        ------
        ProblemError
            If a value is out of range.
        """
        views = views_asked(problem, cameras, at_least)
        return cls(problem, views.cameras, views.at_least, counted_weights(problem))

    def proved(
        self,
        stop: Stop = never,
        seconds: float = 10.0,
        start: Plan | None = None,
        bound: str = BOUND_METHOD,
        watch: Watch | None = None,
    ) -> Self:
        """Returns the object with a bound for each number of drones.

        Parameters
        ----------
        stop : ends the search; bounds proved so far are kept
        seconds : time for each number of drones, excluding coverage
        start : a plan to start from; ignored if it breaks a rule
        bound : name of the method
        """
        watch, results = watch or Watch(), []
        begin = start if start is not None and check(self.problem, start).valid else None
        first = self.scene(1)  # one object, whose coverage is reused
        for scene in self._scenes():
            share_coverage(scene, first)
            result = run(
                scene, bound, stop, allowance=Allowance(seconds), watch=watch, start=begin,
                gap=counting_gap(scene),
            ).result  # fmt: skip
            results.append(replace(result, problem=scene, method=bound))
        return replace(self, results=tuple(results))

    def scene(self, cameras: int) -> Problem:
        """Returns the problem whose J is the weighted sum of min(cameras, n)."""
        return views_alone(self.problem, views_asked(self.problem, cameras, self.at_least))

    @property
    def person_steps(self) -> int:
        """Number of the person-steps that count."""
        return int(np.count_nonzero(self.weights))

    @property
    def is_weighted(self) -> bool:
        """True if the person-steps that count have different weights."""
        return len(np.unique(self.weights[self.weights > 0])) > 1

    @property
    def no_plan(self) -> bool:
        """True if it is proved that no plan obeys the rules."""
        return any(result.bound < 0 for result in self.results)

    def most(self, drones: int) -> MostSeen:
        """Returns a bound on the person-steps that at least this many drones see in any plan."""
        if drones < 1:
            raise ValueError(f"drones: must be at least 1, not {drones}")
        if drones > len(self.problem.robots) or self.no_plan or not self.person_steps:
            return MostSeen(drones, 0.0, None if self.is_weighted else 0)
        weight = min(self._proved(fewer) for fewer in range(1, drones + 1))
        if self.is_weighted:
            return MostSeen(drones, weight / self._total, None)
        number = math.floor(weight)
        return MostSeen(drones, number / self.person_steps, number)

    def share(self, found: Quality, drones: int) -> float:
        """Returns the share of person-steps, by weight, that at least this many drones see in a
        plan.

        Raises
        ------
        ValueError
            If the quality was measured with another visible share of a person.
        TypeError
            If it is no `Quality`.
        """
        if not isinstance(found, Quality):
            raise TypeError(f"found: must be a Quality, not {found!r}")
        if found.assumptions.at_least != self.at_least:
            raise ValueError(
                f"at_least: the bound uses {self.at_least:g}, but the plan's quality "
                f"{found.assumptions.at_least:g}"
            )
        seen = self.weights[found.counts & (found.views >= drones)]
        return self._sum(seen) / self._total if self.person_steps else math.nan

    def sentences(self, found: Quality | None = None, obeys_rules: bool = True) -> Iterator[str]:
        """Yields a sentence for each number of drones, or one sentence for all of them.

        Parameters
        ----------
        found : the quality of a plan, to compare with the bound
        obeys_rules : True if the plan obeys all rules
        """
        if not self.person_steps:
            yield "No person has a weight, so no person-step counts."
            return
        if self.no_plan:
            yield "Proved: no plan of these drones obeys the rules."
            return
        for drones in range(1, min(self.cameras, len(self.problem.robots)) + 1):
            most = self.most(drones)
            told, share = self._told(most), self.share(found, drones) if found else math.nan
            if found and obeys_rules and share >= 1:
                told = f"In this plan, every person-step is seen by {_or_more(drones)}."
            elif found:
                told += f" {self._beside(most, share, obeys_rules)}"
            yield told

    def __str__(self) -> str:
        return "\n".join(self.sentences())

    def __repr__(self) -> str:
        return str(self)

    def _scenes(self) -> Iterator[Problem]:
        """Yields the problem for each number of drones that counts and that the scene has."""
        if self.person_steps:
            for cameras in range(1, min(self.cameras, len(self.problem.robots)) + 1):
                yield self.scene(cameras)

    def _sum(self, weights: FloatArray) -> float:
        """Returns the sum of weights, or their number if all are equal."""
        positive = weights[weights > 0]
        return math.fsum(positive.tolist()) if self.is_weighted else float(len(positive))

    @property
    def _total(self) -> float:
        return self._sum(self.weights)

    def _proved(self, drones: int) -> float:
        """Returns a bound on the total weight of person-steps that this many drones see, from
        single bounds.
        """
        unit = 1.0 if self.is_weighted else float(self.weights.max())
        sums = (result.bound / unit for result in self.results[drones - 1 :])
        return min([self._total, *(most * (1 + _ROUNDING) / drones for most in sums)])

    def _told(self, most: MostSeen) -> str:
        """Returns the sentence on what no plan can achieve."""
        seen_by = f"seen by {_or_more(most.drones)}"
        if most.share >= 1:
            return f"Not ruled out: a plan in which every person-step is {seen_by}."
        if most.person_steps is None:
            told = f"{rounded_up(100 * most.share, 1)} % of person-steps, by their importance,"
        else:
            told = (
                f"{most.person_steps:,} of {self.person_steps:,} person-steps "
                f"({_percent(most.share)})"
            )
        return f"Proved: no plan of these drones has more than {told} {seen_by}."

    def _beside(self, most: MostSeen, share: float, obeys_rules: bool) -> str:
        """Returns the sentence on the given plan."""
        told = _percent(share)
        if most.person_steps is not None:
            told = f"{round(share * self.person_steps):,} ({told})"
        if not obeys_rules:
            return f"This plan, which breaks rules: {told}."
        attained = share >= most.share - _ROUNDING
        return f"This plan: {told}{', and no plan has more' if attained else ''}."


def _percent(share: float) -> str:
    """Returns a share with one decimal; only exactly 1 gives 100 %."""
    return f"{min(100 * share, 99.9):.1f} %" if share < 1 else "100 %"


def _or_more(drones: int) -> str:
    return f"{number_in_words(drones)} drone{'' if drones == 1 else 's'} or more"
