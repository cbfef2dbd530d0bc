"""Planners, bounds and exact methods by name, run and judged by the referee."""

import logging
import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Generic, NamedTuple, TypeVar

from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    proved_reason,
    silent,
)
from cocap_opt.method import Method
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS, Planner
from cocap_opt.problem import COVERAGE_VERSION, Plan, Problem
from cocap_opt.referee import Verdict, check
from cocap_opt.result import Reason, Result, UnsupportedError, relative_gap
from cocap_opt.stop import Clock, FirstOf, Stop, TimeLimit, WorkLimit, never
from cocap_opt.timing import timed

_log = logging.getLogger(__name__)

R = TypeVar("R", bound=Result)
_R_co = TypeVar("_R_co", bound=Result, covariant=True)

BOUND_METHOD = "branch-and-price"  # of the gap table; at any limit it has a bound
ROUNDING = 1e-9  # relative, of J and of bounds: both are rounded sums

SOLVERS: Mapping[str, Method[Any]] = {**PLANNERS, **EXACT}


def is_lazy(name: str) -> bool:
    """Returns True for a method of ours that needs no coverage of all states."""
    return name in PLANNERS and PLANNERS[name].lazy


class RefereeError(RuntimeError):
    """A method returned a plan or a bound that the referee refuses: a bug, never a result."""

    @classmethod
    def unless_bound(cls, name: str, reward: float, bound: float) -> None:
        """Raises it if a bound is below the J of a plan that it covers, but for rounding.

        Parameters
        ----------
        name : of what made the bound, for the message
        """
        if reward > bound + ROUNDING * abs(bound):
            raise cls(f"{name}: bound {bound!r} is below J = {reward!r}")


class Allowance(NamedTuple):
    """The limits of one computation, which begin to count with it."""

    seconds: float
    work: int | None = None  # units of `WorkLimit`; any number if None

    def begin(self, stop: Stop = never) -> Stop:
        """Returns a stop that is reached with `stop`, or once this allowance is spent."""
        criteria = [stop, TimeLimit(self.seconds)]
        if self.work is not None:
            criteria.append(WorkLimit(self.work))
        return FirstOf(*criteria)


class Awaiting(FirstOf):
    """Reached with another stop and, from `begin` on, once an allowance is spent.

    What comes before `begin`, as coverage does, is charged to nobody.
    """

    def __init__(self, stop: Stop, allowance: Allowance) -> None:
        super().__init__(stop)
        self._allowance = allowance

    def begin(self) -> None:
        """Lets the allowance begin to count."""
        self._criteria = (self._allowance.begin(*self._criteria),)


def with_coverage_told(problem: Problem, result: R) -> R:
    """Returns the result of a method that needs all coverage; says if a limit came before that."""
    missing = compiled(problem).covered_steps <= problem.horizon
    return replace(result, in_coverage=True) if result.limit is not None and missing else result


def finite(value: float) -> float | None:
    """Returns a number, or None for what JSON cannot hold."""
    return value if math.isfinite(value) else None


class Judged(NamedTuple, Generic[_R_co]):
    """A result with the referee's verdict; there is no verdict where there is no plan."""

    result: _R_co
    verdict: Verdict | None
    coverage_seconds: float | None = None  # of the problem in this process, if its plan needs it
    checking_seconds: float | None = None  # of the referee
    views: int | None = None  # states at steps whose coverage the plan was made with

    @classmethod
    def of(cls, name: str, problem: Problem, result: R) -> "Judged[R]":
        """Has the referee judge a method's plan, and compares that with what the result claims.

        Raises
        ------
        RefereeError
            If the plan cannot be flown, has another J than claimed, or is better than the bound.
        """
        if result.plan is None:
            return Judged(result, None)
        clock = Clock()
        verdict = check(problem, result.plan)
        if verdict.violations:
            raise RefereeError(f"{name}: {verdict.violations[0]}")
        if not math.isclose(verdict.reward, result.value, rel_tol=1e-9, abs_tol=1e-9):
            raise RefereeError(f"{name}: claims J = {result.value!r}, it is {verdict.reward!r}")
        if verdict.valid:
            RefereeError.unless_bound(name, verdict.reward, result.bound)
        return Judged(result, verdict, checking_seconds=clock.seconds)

    @classmethod
    def of_plan(cls, problem: Problem, given: Plan | PlanFile) -> "Judged[Result]":
        """Returns a plan of others, judged, with what its file says of its search."""
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

    @classmethod
    def planned(
        cls, problem: Problem, name: str, stop: Stop, own: Planner | None = None
    ) -> "Judged[Result]":
        """Runs a planner or an exact method, and has its plan judged.

        Parameters
        ----------
        own : a planner that is none of ours, which returns results; `name` is what it is called
        """
        try:
            result = timed(own)(problem, stop) if own else SOLVERS[name](problem, stop)
        except UnsupportedError as error:
            return Judged(Result(None, -math.inf, Reason.UNSUPPORTED, message=str(error)), None)
        judged = Judged.of(name, problem, result)
        if is_lazy(name):
            views = result.statistics.get("evaluated")
            return judged._replace(
                coverage_seconds=0.0, views=None if views is None else int(views)
            )
        model = compiled(problem)
        return judged._replace(coverage_seconds=model.tables.seconds, views=model.covered_views)

    @classmethod
    def certified(
        cls,
        problem: Problem,
        name: str,
        stop: Stop,
        start: Plan | None = None,
        report: Report = silent,
        gap: float = OPTIMALITY,
    ) -> "Judged[CertifiedResult]":
        """Runs a bound or an exact method, and has its plan judged.

        Raises
        ------
        UnsupportedError
            If the method does not take such problems.
        """
        if name in EXACT:
            result = EXACT[name](problem, stop, start, report, gap)
        else:
            result = BOUNDS[name](problem, stop, start, report)
        judged = Judged.of(name, problem, with_coverage_told(problem, result))
        return judged._replace(coverage_seconds=compiled(problem).tables.seconds)

    @property
    def reward(self) -> float:
        """The referee's J; -inf where there is no plan."""
        return self.verdict.reward if self.verdict else -math.inf

    @property
    def valid(self) -> bool:
        """There is a plan, and it obeys the rules."""
        return self.verdict is not None and self.verdict.valid

    @property
    def conflicts(self) -> int:
        """Number of broken collision rules."""
        return len(self.verdict.conflicts) if self.verdict else 0

    @property
    def reason(self) -> Reason:
        """Why the method stopped; not "optimal" where its certificate leaves something open."""
        return proved_reason(self.result.reason, self.result.bound, self.gap)

    def remarks(self, problem: Problem) -> list[str]:
        """Returns what is to be said of the result and its plan, each in a few words."""
        result = self.result
        found = [words for words in (result.message, self.blind(problem)) if words]
        if self.reason is not result.reason and not found:
            found.append("what is open is within the accuracy of the computation")
        return found

    def blind(self, problem: Problem) -> str:
        """Returns at how many steps no drone of the plan sees anybody, if those are most."""
        if self.verdict is None or not problem.actors:
            return ""
        if not any(self.verdict.face_reward):
            return "no drone sees anybody at any step"
        steps = self.verdict.reward_per_step
        blind = sum(reward <= 0 for reward in steps)
        if 2 * blind <= len(steps):
            return ""
        return f"no drone sees anybody at {blind} of {len(steps)} steps"

    def warn(self, problem: Problem, seed: int | None, name: str) -> None:
        """Warns of a plan that sees nobody at most steps, once for each scene.

        Parameters
        ----------
        name : of the planner
        """
        if words := self.blind(problem):
            once = {"once": f"{problem.name}, blind"}
            _log.warning("%s, seed %s, %s: %s", problem.name, seed, name, words, extra=once)

    def colliding(self, problem: Problem) -> int | None:
        """Returns the number of robots that take part in a conflict; None without a plan."""
        if self.result.plan is None:
            return None
        found = self.result.plan.conflicts(problem)
        return len({robot for conflict in found for robot in conflict.robots})

    @property
    def gap(self) -> float:
        """Gap of a plan that obeys the rules to its own result's bound; infinite otherwise."""
        return relative_gap(self.reward, self.result.bound) if self.valid else math.inf

    @property
    def reward_parts(self) -> dict[str, Any]:
        """The parts of J by their names; rewards for moves only where the plan has some."""
        return {} if self.verdict is None else self.parts_of(self.verdict)

    @staticmethod
    def parts_of(verdict: Verdict) -> dict[str, Any]:
        """Returns the parts of J; rewards for moves only where the plan has some."""
        parts: dict[str, Any] = {
            "reward_at_start": verdict.reward_at_start,
            "reward_per_step": verdict.reward_per_step,
        }
        if verdict.reward_moves:
            parts["reward_moves"] = verdict.reward_moves
        return parts

    def plan_file(
        self, problem: Problem, planner: str, allowance: Allowance | None = None
    ) -> PlanFile | None:
        """Returns the plan as a file with the referee's J; None where there is no plan.

        Parameters
        ----------
        allowance : that the planner had; None where that is not known
        """
        if self.result.plan is None:
            return None
        return PlanFile(
            scene=problem.name,
            digest=problem_digest(problem),
            planner=planner,
            limit=self.result.limit,
            cut_short=self.result.cut_short,
            reason=self.reason,
            seconds=finite(self.result.seconds),
            time_limit=None if allowance is None else finite(allowance.seconds),
            work_limit=None if allowance is None else allowance.work,
            coverage_version=COVERAGE_VERSION,
            reward=self.reward,
            plan=self.result.plan,
        )
