"""Verification of plans, certificates and proofs: their claims, against what is computed anew."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

from cocap_opt.experiments.results.judging import ROUNDING
from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.formulations.certificates import (
    CertificateError,
    CertificateFile,
    Pricing,
    ProofFile,
    verify,
)
from cocap_opt.formulations.result import OPTIMALITY
from cocap_opt.formulations.second_opinion import SecondOpinion, require_small
from cocap_opt.model import Model
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict, check
from cocap_opt.result import relative_gap

Progress = Callable[[int, int], None]


def _tell_nobody(done: int, total: int) -> None:
    pass


@dataclass
class Verified:
    """Outcome of checking claims, in which every number was computed anew.

    Attributes
    ----------
    problem : that the claims are about
    by_networkx : bounds are added up a second time, with networkx
    bound : the lowest bound that is proved, as its file claims it; infinite without a certificate
    method : the method that made it
    optimistic : that bound was computed with coverage as if nothing hid anybody, at some steps
    second_opinion : what networkx finds of it; None where nobody has asked
    reward : J of the plan; -infinite without one
    verdict : of the referee on the plan; None without one
    violations : what does not hold, in words
    plan : that was checked
    file : that proves the bound
    pricing : what the sweep finds of it
    """

    problem: Problem = field(repr=False)
    by_networkx: bool = False
    bound: float = math.inf
    method: str | None = None
    optimistic: bool = False
    second_opinion: SecondOpinion | None = None
    reward: float = -math.inf
    verdict: Verdict | None = None
    violations: list[str] = field(default_factory=list)
    plan: Plan | None = field(default=None, repr=False)
    file: CertificateFile | ProofFile | None = field(default=None, repr=False)
    pricing: Pricing | None = field(default=None, repr=False)

    @cached_property
    def model(self) -> Model:
        """The compiled problem, whose coverage is computed afresh, once for all files."""
        return Model(self.problem, use_cache=False)

    @property
    def gap(self) -> float:
        """(bound - reward) / bound; infinite where one of them is missing."""
        return relative_gap(self.reward, self.bound)

    @property
    def no_plan(self) -> bool:
        """It is proved that no plan obeys the rules: J >= 0, and a bound is below 0."""
        return self.bound < 0

    @property
    def is_optimal(self) -> bool:
        """All claims hold, and the bound leaves nothing open above the plan."""
        return not self.violations and self.gap <= OPTIMALITY

    def __repr__(self) -> str:
        gap = f"{100 * self.gap:.4f} %" if math.isfinite(self.gap) else "none"
        return f"Verified(J {self.reward:,.2f}, bound {self.bound:,.2f}, gap {gap})"

    def verify_plan(self, plan: Plan, claimed: PlanFile | None = None) -> None:
        """Has the referee judge a plan, and compares that with what its file claims."""
        self.plan, self.verdict = plan, check(self.problem, plan)
        verdict = self.verdict
        self.violations += [*verdict.violations, *verdict.conflicts]
        if claimed is not None and claimed.digest != problem_digest(self.problem):
            other = "scene, seed, rules or objective"
            self.violations.append(f"digest: the plan belongs to another {other}")
        if verdict.violations:
            return
        self.reward = verdict.reward
        if claimed is not None:
            self.compare_reward(claimed.reward)

    def compare_reward(self, claimed: float) -> None:
        """Compares the J that somebody claims of the plan with that of the referee."""
        if not math.isclose(claimed, self.reward, rel_tol=ROUNDING, abs_tol=ROUNDING):
            words = f"reward: the plan claims {claimed!r}, it is {self.reward!r}"
            self.violations.append(words)

    def verify_bound(
        self,
        file: CertificateFile | ProofFile,
        progress: Progress = _tell_nobody,
        second: Progress = _tell_nobody,
    ) -> None:
        """Prices a certificate, or all leaves of a proof, and compares that with its claim.

        Parameters
        ----------
        progress : told how many leaves are done, and of how many
        second : told how many best paths networkx has found, and of how many

        Raises
        ------
        CertificateError
            If it proves nothing, or less than it claims, or networkx finds another bound.
        TooLargeError
            If it is to be priced by networkx, and is too large for that.
        """
        if self.by_networkx:
            require_small(self.problem, file)
        pricing = verify(self.problem, file, progress, self.model)
        opinion = self._ask_networkx(file, pricing, second) if self.by_networkx else None
        # What has been proved is what the file claims.
        if file.proved < self.bound:
            self.bound, self.method = file.proved, file.method
            self.file, self.pricing, self.second_opinion = file, pricing, opinion
            self.optimistic = isinstance(file, CertificateFile) and bool(file.coverage)

    def _ask_networkx(
        self, file: CertificateFile | ProofFile, pricing: Pricing, progress: Progress
    ) -> SecondOpinion:
        """Returns the second opinion on a bound; CertificateError if it is another one."""
        second = SecondOpinion.of(self.problem, file, progress)
        if not second.agrees(pricing):
            raise CertificateError(
                f"bound: the sweep finds {pricing.bound!r}, networkx {second.bound!r}, so one of "
                "the two is wrong"
            )
        return second

    def conclude(self) -> None:
        """Compares the plan with the bound."""
        if self.violations or self.verdict is None:
            return
        if self.no_plan:
            words = "plan: it obeys the rules, though it is proved that no plan does"
            self.violations.append(words)
        elif self.reward > self.bound + ROUNDING * abs(self.bound):
            self.violations.append("reward: it is above the bound, so one of the two is wrong")
