"""A method's result with the verdict of the referee, which has the last word."""

import logging
import math
from dataclasses import replace
from typing import Any, Generic, NamedTuple, TypeVar

from cocap_opt.files.documents import PlanFile
from cocap_opt.footage.quality import Quality
from cocap_opt.footage.summary import Summary
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict, check
from cocap_opt.result import Reason, Result, relative_gap
from cocap_opt.run.options import Allowance
from cocap_opt.run.view_share import missed_share, proved_in
from cocap_opt.stop import Clock

_log = logging.getLogger(__name__)

R = TypeVar("R", bound=Result)
_R_co = TypeVar("_R_co", bound=Result, covariant=True)

ROUNDING = 1e-9  # relative tolerance for J and bounds, which are rounded sums


class RefereeError(RuntimeError):
    """The referee rejects the plan or the bound of a method, which is a bug of the method."""

    @classmethod
    def unless_bound(cls, name: str, reward: float, bound: float) -> None:
        """Raises this error if a bound is below the J of a plan that it covers, by more than
        rounding.

        Parameters
        ----------
        name : name of the method that made the bound, for the message
        """
        if reward > bound + ROUNDING * abs(bound):
            raise cls(f"{name}: bound {bound!r} is below J = {reward!r}")


def finite(value: float) -> float | None:
    """Returns a number, or None for values that JSON cannot represent."""
    return value if math.isfinite(value) else None


def below_certificate(problem: Problem, result: Result) -> str:
    """Returns a message if a result claims a lower bound than its certificate; otherwise empty."""
    file = result.certificate if isinstance(result, CertifiedResult) else None
    if file is None:
        return ""
    proved = proved_in(problem, file)
    if result.bound == proved or result.bound >= proved - ROUNDING * abs(proved):
        return ""
    return f"bound: the result claims {result.bound!r}, its file {proved!r}"


class Judged(NamedTuple, Generic[_R_co]):
    """A result with the referee's verdict, or without one if there is no plan."""

    result: _R_co
    verdict: Verdict | None
    coverage_seconds: float | None = None  # time for coverage in this process, if the plan needs it
    checking_seconds: float | None = None  # time of the referee
    views: int | None = None  # number of views with which the plan was made

    @classmethod
    def of(cls, name: str, problem: Problem, result: R) -> "Judged[R]":
        """Has the referee evaluate a method's plan, and compares its verdict with the result's
        claims.

        Raises
        ------
        RefereeError
            If the plan cannot be flown, has another J than claimed, or is better than the bound, or
            if the bound is lower than that of the certificate.
        """
        if words := below_certificate(problem, result):
            raise RefereeError(f"{name}: {words}")
        if result.plan is None:
            return Judged(result, None)
        clock = Clock()
        verdict = check(problem, result.plan)
        if verdict.violations:
            raise RefereeError(f"{name}: {verdict.violations[0]}")
        if not math.isclose(verdict.reward, result.value, rel_tol=1e-9, abs_tol=1e-9):
            raise RefereeError(f"{name}: claims J = {result.value!r}, but it is {verdict.reward!r}")
        if verdict.valid:
            RefereeError.unless_bound(name, verdict.reward, result.bound)
        return Judged(result, verdict, checking_seconds=clock.seconds)

    @classmethod
    def of_plan(cls, problem: Problem, given: Plan | PlanFile) -> "Judged[Result]":
        """Returns a plan from a file with its verdict, and with what the file says about its
        search.
        """
        if isinstance(given, Plan):
            verdict = check(problem, given)
            return Judged(Result(given, verdict.reward, Reason.FINISHED, seconds=math.nan), verdict)
        judged = cls.of_plan(problem, given.plan)
        ending = given.ending
        return judged._replace(
            result=replace(
                judged.result,
                reason=ending.reason,
                limit=ending.limit,
                told=ending.told,
                seconds=math.nan if given.seconds is None else given.seconds,
            )
        )

    def answer(self, problem: Problem, method: str) -> _R_co:
        """Returns the result with the referee's J, and with information on how it was made."""
        return replace(
            self.result, value=self.reward, reason=self.reason, problem=problem, method=method
        )

    @property
    def reward(self) -> float:
        """The referee's J; -inf if there is no plan."""
        return self.verdict.reward if self.verdict else -math.inf

    @property
    def valid(self) -> bool:
        """True if there is a plan that obeys the rules."""
        return self.verdict is not None and self.verdict.valid

    @property
    def conflicts(self) -> int:
        """Number of broken collision rules."""
        return len(self.verdict.conflicts) if self.verdict else 0

    @property
    def reason(self) -> Reason:
        """Why the method stopped; "finished" instead of "optimal" if its bound leaves a gap.

        A generic solver, or a third-party planner, may call a plan optimal on its own authority;
        only a proved bound counts.
        """
        reason = self.result.reason
        is_open = self.gap > OPTIMALITY
        return Reason.FINISHED if reason is Reason.OPTIMAL and is_open else reason

    def remarks(self, problem: Problem) -> list[str]:
        """Returns short remarks on the result and its plan."""
        result = self.result
        missed = missed_share(problem, result.plan) if self.valid and result.plan else ""
        missed = "" if missed in result.message else missed  # if it is mentioned there already
        found = [words for words in (result.message, self.blind(problem), missed) if words]
        if self.reason is not result.reason and not found and math.isfinite(result.bound):
            found.append("the remaining gap is within the accuracy of the computation")
        return found

    def blind(self, problem: Problem) -> str:
        """Returns a message on the number of steps at which no drone sees anybody, if these are
        most.
        """
        if self.verdict is None or not problem.actors:
            return ""
        if not (problem.objective.pixels or problem.objective.views):
            return "the objective gives no reward for seeing people"
        if not any((*self.verdict.face_reward, *self.verdict.count_reward)):
            return "no drone sees anybody at any step"
        steps = self.verdict.reward_per_step
        blind = sum(reward <= 0 for reward in steps)
        if 2 * blind <= len(steps):
            return ""
        return f"no drone sees anybody at {blind} of {len(steps)} steps"

    def warn(self, problem: Problem, seed: int | None, name: str) -> None:
        """Warns of a plan that sees nobody at most steps, once per scene.

        Parameters
        ----------
        name : name of the planner
        """
        if words := self.blind(problem):
            once = {"once": f"{problem.name}, blind"}
            _log.warning("%s, seed %s, %s: %s", problem.name, seed, name, words, extra=once)

    def filmed(self, problem: Problem) -> Summary | None:
        """Returns the quality of the plan; None if there is no plan that can be flown."""
        if self.result.plan is None or self.verdict is None or self.verdict.violations:
            return None
        return Quality.of(problem, self.result.plan).summary

    def colliding(self, problem: Problem) -> int | None:
        """Returns the number of robots involved in conflicts; None if there is no plan."""
        if self.result.plan is None:
            return None
        found = self.result.plan.conflicts(problem)
        return len({robot for conflict in found for robot in conflict.robots})

    @property
    def gap(self) -> float:
        """Gap between a plan that obeys the rules and its own result's bound; infinite
        otherwise.
        """
        return relative_gap(self.reward, self.result.bound) if self.valid else math.inf

    @property
    def reward_parts(self) -> dict[str, Any]:
        """The parts of J by name; rewards for moves only if the plan has some."""
        return {} if self.verdict is None else self.parts_of(self.verdict)

    @staticmethod
    def parts_of(verdict: Verdict) -> dict[str, Any]:
        """Returns the parts of J; rewards for moves and for views only if the plan has some."""
        parts: dict[str, Any] = {
            "reward_at_start": verdict.reward_at_start,
            "reward_per_step": verdict.reward_per_step,
        }
        if verdict.reward_moves:
            parts["reward_moves"] = verdict.reward_moves
        if any(verdict.count_reward):
            parts["reward_of_views"] = math.fsum(verdict.count_reward)
        return parts

    def plan_file(
        self, problem: Problem, planner: str, allowance: Allowance | None = None
    ) -> PlanFile | None:
        """Returns the plan as a file with the referee's J; None if there is no plan.

        Parameters
        ----------
        allowance : the planner's limits; None if unknown
        """
        if self.result.plan is None:
            return None
        return PlanFile.of(
            problem,
            self.result.plan,
            self.reward,
            planner,
            limit=self.result.limit,
            cut_short=self.result.cut_short,
            reason=self.reason,
            seconds=finite(self.result.seconds),
            time_limit=None if allowance is None else finite(allowance.seconds),
            work_limit=None if allowance is None else allowance.work,
        )
