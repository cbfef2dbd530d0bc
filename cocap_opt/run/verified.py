"""Verifies plans, certificates and proofs: compares their claims with values that are
recomputed.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, Self

from cocap_opt.files.documents import PlanFile, other_coverage, problem_digest
from cocap_opt.formulations.certificates import (
    CertificateError,
    CertificateFile,
    Pricing,
    ProofFile,
    verify,
)
from cocap_opt.formulations.certificates.checking import Progress
from cocap_opt.formulations.independent import instance_digest
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.formulations.second_opinion import SecondOpinion, require_small
from cocap_opt.model import Model
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict, check
from cocap_opt.result import relative_gap
from cocap_opt.run.judged import ROUNDING
from cocap_opt.run.view_share import bound_with_share, keeps_share, proved_in
from cocap_opt.stop import Stop, never
from cocap_opt.text import other_scene


def _tell_nobody(done: int, total: int) -> None:
    pass


class ProvedBound(NamedTuple):
    """The bound of a file that proves its claim: every number was recomputed."""

    model: Model  # the model used for pricing, with newly computed coverage
    file: CertificateFile | ProofFile
    pricing: Pricing  # result of the sweep
    second_opinion: SecondOpinion | None = None  # None if it was not requested

    @property
    def problem(self) -> Problem:
        """The problem of the bound: the scene, usually with the objective in the file."""
        return self.model.problem

    @classmethod
    def of(
        cls,
        model: Model,
        file: CertificateFile | ProofFile,
        twice: bool = False,
        progress: Progress = _tell_nobody,
        second: Progress = _tell_nobody,
        stop: Stop = never,
        plain: bool = False,
    ) -> Self:
        """Prices a certificate, or all leaves of a proof, and compares the result with the claim.

        Parameters
        ----------
        model : model of the bound's problem, or of the same problem with another objective, from
            which a model is then made
        twice : True: also compute the bound with other code
        progress : called with the number of finished leaves, and the total
        second : called with the progress of the second opinion, as in `SecondOpinion.of`
        stop : stopping criterion of all computations before the second opinion
        plain : True: use no code compiled by numba; only staged certificates then take longer

        Raises
        ------
        CertificateError
            If it proves nothing, or less than it claims, or if the second opinion is a different
            bound.
        UnfinishedError
            If a limit is reached; the claim may still hold.
        TooLargeError
            If the file is too large for the requested second opinion.
        """
        problem = file.problem_of(model.problem)
        if problem.objective != model.problem.objective:
            model = Model(problem, plain=True)
        if twice:
            require_small(problem, file)
        proved = cls(model, file, verify(problem, file, progress, model, stop, plain))
        return proved.found_twice(second) if twice else proved

    def found_twice(self, progress: Progress = _tell_nobody) -> Self:
        """Returns the bound with a second opinion, for a file that `require_small` accepts.

        Parameters
        ----------
        progress : called with the progress of the second opinion, as in `SecondOpinion.of`

        Raises
        ------
        CertificateError
            If the second opinion is a different bound.
        TooLargeError
            If the file turns out to be too large for a second opinion.
        """
        opinion = SecondOpinion.of(self.model, self.file, progress)
        if not opinion.agrees(self.pricing):
            raise CertificateError(
                f"bound: `verify` finds {self.pricing.bound!r}, {opinion.by} "
                f"{opinion.bound!r}, so one of the two is wrong"
            )
        return self._replace(second_opinion=opinion)


@dataclass(frozen=True)
class Verified:
    """The outcome of checking claims.

    Attributes
    ----------
    problem : the problem that the claims are about
    plan : the plan that was checked
    verdict : the referee's verdict on the plan; None without a plan
    bounds : the proved bounds
    violations : false claims, in words
    plain : True if bounds were checked without any code compiled by numba
    """

    problem: Problem
    plan: Plan | None = None
    verdict: Verdict | None = None
    bounds: tuple[ProvedBound, ...] = ()
    violations: tuple[str, ...] = ()
    plain: bool = False

    @classmethod
    def of(
        cls,
        problem: Problem,
        plan: Plan | None = None,
        claimed: PlanFile | None = None,
        values: Sequence[float] = (),
        bounds: Sequence[ProvedBound] = (),
        failed: Sequence[str] = (),
        plain: bool = False,
    ) -> Self:
        """Has the referee evaluate a plan, and compares it with claims and bounds.

        Parameters
        ----------
        claimed : the plan's file, with its claims
        values : J of the plan as claimed elsewhere
        bounds : bounds, of which the lowest counts
        failed : the errors in further bounds, in words
        plain : True if bounds were checked without any compiled code
        """
        verdict = None if plan is None else check(problem, plan)
        found = cls(problem, plan, verdict, tuple(bounds), plain=plain)
        violations = [*found._of_plan(claimed, values), *failed]
        return replace(found, violations=tuple(violations or found._of_both()))

    @cached_property
    def proved(self) -> ProvedBound | None:
        """The lowest proved bound; None if there is none."""
        return min(
            self.bounds,
            key=lambda bound: proved_in(self.problem, bound.file, bound.pricing.bound),
            default=None,
        )

    @property
    def reward(self) -> float:
        """J of the plan; -inf if there is no plan that can be flown."""
        flown = self.verdict is not None and not self.verdict.violations
        return self.verdict.reward if self.verdict is not None and flown else -math.inf

    @property
    def is_on_other_objective(self) -> bool:
        """True if the file's bound is for another objective than the scene's, e.g. for views
        alone.
        """
        return self.proved is not None and self.proved.problem.objective != self.problem.objective

    @property
    def is_of_share(self) -> bool:
        """True if the bound holds for plans that reach the share of views that the scene
        requires.
        """
        return self.is_on_other_objective and self._share_bound < math.inf

    @cached_property
    def keeps_share(self) -> bool:
        """True if the plan reaches that share, or none is required."""
        return self.plan is not None and keeps_share(self.problem, self.plan)

    @cached_property
    def reward_there(self) -> float:
        """J of the plan with the file's objective, which is usually the scene's."""
        if not self.is_on_other_objective or self.plan is None or self.reward == -math.inf:
            return self.reward
        assert self.proved is not None
        return check(self.proved.problem, self.plan).reward

    @property
    def bound_there(self) -> float:
        """The lowest bound for that objective: the file's claim, or a clearly lower value that its
        numbers prove.
        """
        return self.proved_bound if self.understated else self.claimed_bound

    @property
    def bound(self) -> float:
        """The lowest proved bound on J, from which gaps are computed; infinite if there is none.

        If the file has another objective, with more weight of views for the share that the scene
        requires, it is the bound for plans that reach the share. With any other objective, the file
        proves nothing except, possibly, that no plan exists.
        """
        if not self.is_on_other_objective or self.bound_there < 0:
            return self.bound_there
        return self._share_bound

    @cached_property
    def _share_bound(self) -> float:
        """The bound for plans that reach the share; infinite if the file proves nothing about
        them.
        """
        if self.proved is None:
            return math.inf
        return bound_with_share(self.problem, self.proved.problem, self.bound_there)

    @property
    def claimed_bound(self) -> float:
        """The lowest bound as claimed by its file, which proves it; infinite if there is none."""
        return math.inf if self.proved is None else self.proved.file.proved

    @property
    def proved_bound(self) -> float:
        """The bound that the numbers of the lowest file prove; it may be lower than the claim."""
        return math.inf if self.proved is None else self.proved.pricing.bound

    @property
    def understated(self) -> bool:
        """True if the numbers prove a clearly lower bound than the file claims."""
        if self.proved is None:
            return False
        return self.claimed_bound - self.proved_bound > OPTIMALITY * abs(self.claimed_bound)

    @property
    def method(self) -> str | None:
        """The method that computed the bound."""
        return None if self.proved is None else self.proved.file.method

    @property
    def optimistic(self) -> bool:
        """True if the bound was computed as if nothing hid anybody, at some steps."""
        file = None if self.proved is None else self.proved.file
        return isinstance(file, CertificateFile) and bool(file.coverage)

    @property
    def other_coverage(self) -> str:
        """A message if the bound was made with another version of coverage; otherwise empty."""
        return "" if self.proved is None else other_coverage(self.proved.file.coverage_version)

    @cached_property
    def other_instance(self) -> str:
        """A message if a bound was made from an instance that is not the scene's; otherwise
        empty.
        """
        named = [bound for bound in self.bounds if isinstance(bound.file.instance, str)]
        if all(bound.file.instance == instance_digest(bound.model) for bound in named):
            return ""
        return (
            "a file names a different instance from the one computed here: the file was "
            "altered, or numbers were rounded differently"
        )

    @property
    def gap(self) -> float:
        """The relative gap, (bound - reward) / bound; infinite if one of them is missing."""
        if self.is_of_share and not self.keeps_share:
            return math.inf
        return relative_gap(self.reward, self.bound)

    @property
    def no_plan(self) -> bool:
        """True if it is proved that no plan obeys the rules: a bound is below 0 although J >= 0."""
        return self.bound < 0

    @property
    def is_optimal(self) -> bool:
        """True if all claims hold and the bound closes the gap to the plan."""
        return not self.violations and self.gap <= OPTIMALITY and self.keeps_share

    def __repr__(self) -> str:
        gap = f"{100 * self.gap:.4f} %" if math.isfinite(self.gap) else "none"
        if self.verdict is None:
            return f"Verified(bound {self.bound:,.2f}, no plan given)"
        return f"Verified(J {self.reward:,.2f}, bound {self.bound:,.2f}, gap {gap})"

    def _of_plan(self, claimed: PlanFile | None, values: Sequence[float]) -> Iterator[str]:
        """Yields the errors in the plan and in its claims."""
        if self.verdict is None:
            return
        if claimed is not None and claimed.digest != problem_digest(self.problem):
            which = other_scene(claimed.scene, self.problem.name)
            yield f"digest: the plan was made for {which}"
        yield from self.verdict.violations
        yield from self.verdict.conflicts
        if self.verdict.violations:
            return
        for value in values if claimed is None else (claimed.reward, *values):
            if not math.isclose(value, self.reward, rel_tol=ROUNDING, abs_tol=ROUNDING):
                made = None if claimed is None else claimed.coverage_version
                why = f"; {words}" if (words := other_coverage(made)) else ""
                yield f"reward: the plan claims {value!r}, but it is {self.reward!r}{why}"

    def _of_both(self) -> Iterator[str]:
        """Yields contradictions between a plan and a bound whose claims all hold."""
        if self.verdict is None:
            return
        if self.bound_there < 0:
            yield "plan: it obeys the rules, although it is proved that no plan does"
        elif self.reward_there > self.bound_there + ROUNDING * abs(self.bound_there):
            yield "reward: it is above the bound, so one of the two is wrong"
