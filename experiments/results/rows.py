"""Rows of results: what the command line prints, in the keys that do not change.

Every plan has passed the referee before it gets here, and every bound comes from a
certificate priced by its own plain sweep; no number is a solver's word.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Generic, NamedTuple, TypeVar

from cocap_opt.check import Verdict, check
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.planners import PLANNERS
from cocap_opt.problem.plan import Plan, conflicts
from cocap_opt.problem.problem import NO_RULES, Problem
from cocap_opt.result import Reason, Result, UnsupportedError, relative_gap
from cocap_opt.stop import Stop

log = logging.getLogger(__name__)

Row = dict[str, Any]
R = TypeVar("R", bound=Result)
R_co = TypeVar("R_co", bound=Result, covariant=True)

BOUND_METHOD = "branch-and-price"  # of the gap table; at any limit it has a bound
ROUNDING = 1e-9  # relative, of J and of bounds: both are rounded sums
GAP_KEYS = (
    "scene", "seed", "planner", "method", "reward", "bound", "gap", "reason", "limit", "seconds",
    "conflicts", "message", "gap_free", "colliding", "robots", "actors", "steps", "bound_method",
    "bound_reason", "bound_limit", "bound_seconds", "certificate", "optimum", "optimum_free",
    "bound_free", "bound_free_reason", "bound_free_limit", "bound_free_seconds", "certificate_free",
)  # fmt: skip
MEANS = ("reward", "bound", "gap", "gap_free", "seconds")

SOLVERS: Mapping[str, Callable[[Problem, Stop], Result]] = {**PLANNERS, **EXACT}


class Judged(NamedTuple, Generic[R_co]):
    """A result with the referee's verdict; no verdict where there is no plan."""

    result: R_co
    verdict: Verdict | None

    @property
    def reward(self) -> float:
        """The referee's J; -inf where there is no plan."""
        return self.verdict.reward if self.verdict else -math.inf

    @property
    def valid(self) -> bool:
        """Whether there is a plan that obeys the rules."""
        return self.verdict is not None and self.verdict.valid

    @property
    def conflicts(self) -> int:
        """Number of broken collision rules."""
        return len(self.verdict.conflicts) if self.verdict else 0

    @property
    def gap(self) -> float:
        """Gap of a plan that obeys the rules to its own result's bound; infinite otherwise."""
        return relative_gap(self.reward, self.result.bound) if self.valid else math.inf


class RefereeError(RuntimeError):
    """A method returned a plan or a bound that the referee refuses: a bug, never a result."""


def judge(name: str, problem: Problem, result: R) -> Judged[R]:
    """Have a plan judged, and held against its result's claims."""
    if result.plan is None:
        return Judged(result, None)
    verdict = check(problem, result.plan)
    if verdict.violations:
        raise RefereeError(f"{name}: {verdict.violations[0]}")
    if not math.isclose(verdict.reward, result.value, rel_tol=1e-9, abs_tol=1e-9):
        raise RefereeError(f"{name}: claims J = {result.value!r}, it is {verdict.reward!r}")
    if verdict.valid:
        hold_against(name, verdict.reward, result.bound)
    return Judged(result, verdict)


def of_others(problem: Problem, plan: Plan) -> Judged[Result]:
    """A plan by others, judged; how long it took them, nobody says."""
    verdict = check(problem, plan)
    return Judged(Result(plan, verdict.reward, Reason.FINISHED, seconds=math.nan), verdict)


def hold_against(name: str, reward: float, bound: float) -> None:
    """Refuse a bound that is below the J of a plan that obeys the rules, but for rounding."""
    if reward > bound + ROUNDING * abs(bound):
        raise RefereeError(f"{name}: bound {bound!r} is below J = {reward!r}")


def without_rules(problem: Problem) -> Problem:
    """The problem without inter-robot collisions; the same one if it has no rules."""
    return problem if problem.rules.none else problem.replace(rules=NO_RULES)


def run_planner(problem: Problem, name: str, stop: Stop) -> Judged[Result]:
    """Plan, and have the plan judged."""
    try:
        result = SOLVERS[name](problem, stop)
    except UnsupportedError as error:
        return Judged(Result(None, -math.inf, Reason.UNSUPPORTED, message=str(error)), None)
    return judge(name, problem, result)


def run_certified(
    problem: Problem,
    name: str,
    stop: Stop,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
) -> Judged[CertifiedResult]:
    """Run a bound or an exact method, and have its plan judged; its certificate is priced.

    Raises
    ------
    UnsupportedError
        If the method does not take such problems.
    """
    if name in EXACT:
        result = EXACT[name](problem, stop, start, report, gap)
    else:
        result = BOUNDS[name](problem, stop, start, report)
    return judge(name, problem, result)


def plan_row(problem: Problem, seed: int, planner: str | None, judged: Judged[Result]) -> Row:
    """Row of a plan, without a bound: only certified bounds are printed."""
    result = judged.result
    reason, messages = result.reason, [result.message] if result.message else []
    if judged.verdict and problem.actors and not any(judged.verdict.face_reward):
        messages.append("no drone sees anybody at any step")
        log.warning("%s, %s: %s", problem.name, planner or "bound", messages[-1])
    if reason is Reason.OPTIMAL and math.isfinite(result.bound) and judged.gap > OPTIMALITY:
        # What is certified is less than what the method says.
        reason = Reason.FINISHED
        messages = messages or ["what is open is within the accuracy of the computation"]
    return {
        "scene": problem.name,
        "seed": seed,
        "planner": planner,
        "method": None,
        "reward": finite(judged.reward),
        "bound": None,
        "gap": None,
        "reason": str(reason),
        "limit": str(result.limit),
        "seconds": finite(result.seconds),
        "conflicts": judged.conflicts if judged.verdict else None,
        "message": "; ".join(messages),
    }


def certified_row(problem: Problem, seed: int, method: str, judged: Judged[CertifiedResult]) -> Row:
    """Row of a bound, with a plan if its method found one."""
    result = judged.result
    row = plan_row(problem, seed, method if result.plan else None, judged)
    messages = [row["message"]] if row["message"] else []
    if result.reason is Reason.INFEASIBLE and result.bound < 0:
        messages.append("proved: no plan obeys the rules, no J is below 0")
    if result.certificate is None and math.isfinite(result.bound):
        messages.append(f"no certificate: the bound is what {method} proves by itself")
    row |= {
        "method": method,
        "bound": finite(result.bound),
        "gap": finite(judged.gap),
        "message": "; ".join(messages),
    }
    return row


class Bounded(NamedTuple):
    """Best plan and bound of a problem, and where in the folder its certificate is."""

    judged: Judged[CertifiedResult]
    path: str = ""


def planner_part(problem: Problem, seed: int, planner: str, judged: Judged[Result]) -> Row:
    """What a row of the gap table says of a plan alone."""
    return plan_row(problem, seed, planner, judged) | {
        "colliding": colliding(problem, judged.result.plan),
        "robots": len(problem.robots),
        "actors": len(problem.actors),
        "steps": problem.horizon,
    }


def bound_part(bounded: Bounded, free: Bounded) -> Row:
    """What all rows of the gap table say of one scene and seed.

    Parameters
    ----------
    free : of the problem without rules
    """
    bound, bound_free = bounded.judged.result, free.judged.result
    return {
        "method": method_of(bound),
        "bound": finite(bound.bound),
        "bound_method": method_of(bound),
        "bound_reason": str(bound.reason),
        "bound_limit": str(bound.limit),
        "bound_seconds": bound.seconds,
        "certificate": bounded.path,
        "optimum": finite(bounded.judged.reward),
        "optimum_free": finite(free.judged.reward),
        "bound_free": finite(bound_free.bound),
        "bound_free_reason": str(bound_free.reason),
        "bound_free_limit": str(bound_free.limit),
        "bound_free_seconds": bound_free.seconds,
        "certificate_free": free.path,
    }


def gap_row(plan: Row, bound: Row) -> Row:
    """Row of the gap table from its two parts. Only a plan that obeys the rules has gaps."""
    row = plan | {"method": bound["method"], "bound": bound["bound"]}
    for gap, key in (("gap", "bound"), ("gap_free", "bound_free")):
        known = obeys(plan) and bound[key] is not None
        row[gap] = finite(relative_gap(plan["reward"], bound[key])) if known else None
    return {key: (row | bound)[key] for key in GAP_KEYS} | row


def obeys(row: Row) -> bool:
    """Whether there is a plan that obeys the rules."""
    return row["reward"] is not None and not row["conflicts"]


def bound_is_proved(row: Row) -> bool:
    """Whether the bound is proved to be the optimum."""
    return bool(row["bound_reason"] == Reason.OPTIMAL)


def colliding(problem: Problem, plan: Plan | None) -> int | None:
    """Number of robots that take part in a conflict; None where there is no plan."""
    if plan is None:
        return None
    return len({robot for conflict in conflicts(problem, plan) for robot in conflict.robots})


def method_of(result: CertifiedResult) -> str:
    """The method that made a bound of the gap table."""
    return result.certificate.method if result.certificate else BOUND_METHOD


def default_planners(problem: Problem) -> list[str]:
    """Planners of a gap table: the paper's, and the joint optimum where it can be had."""
    names = ["greedy", "sequential", "cocap", "cocap-vs"]
    return [*names, "joint"] if len(problem.robots) <= 2 else names


def finite(value: float) -> float | None:
    """None for what JSON cannot hold."""
    return value if math.isfinite(value) else None


def mean_table(rows: Sequence[Row]) -> list[Row]:
    """Per scene and planner: means over seeds, how many plans obey the rules, how many optima
    are proved.

    A mean exists only where all seeds have a value: means over different seeds mislead.
    """
    keys = list(dict.fromkeys((row["scene"], row["planner"]) for row in rows))
    table = []
    for scene, planner in keys:
        some = [row for row in rows if (row["scene"], row["planner"]) == (scene, planner)]
        table.append(
            {
                "scene": scene,
                "planner": planner,
                "seeds": len(some),
                "feasible": sum(map(obeys, some)),
                "bounds proved": sum(map(bound_is_proved, some)),
                **{key: _mean(some, key) for key in MEANS},
            }
        )
    return table


def _mean(rows: Sequence[Row], key: str) -> float | None:
    values = [row[key] for row in rows]
    return None if None in values else math.fsum(values) / len(values)
