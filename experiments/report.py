"""Rows of results: what the command line prints, in the keys that do not change.

Every plan has passed the referee before it gets here, and every bound comes from a
certificate priced by its own plain sweep; no number is a solver's word.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from cocap_opt.check import Verdict, check
from cocap_opt.plan import Plan
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result, UnsupportedError, relative_gap
from cocap_opt.stop import FirstOf, Stop, TimeLimit
from formulations import BOUNDS, EXACT, BoundResult

Row = dict[str, Any]

SOLVERS: Mapping[str, Callable[[Problem, Stop], Result]] = {**PLANNERS, **EXACT}


class Judged(NamedTuple):
    """A result with the referee's verdict; no verdict where there is no plan."""

    result: Result
    verdict: Verdict | None

    @property
    def reward(self) -> float:
        """The referee's J; -inf where there is no plan."""
        return self.verdict.reward if self.verdict else -math.inf

    @property
    def conflicts(self) -> int:
        """Number of broken collision rules."""
        return len(self.verdict.conflicts) if self.verdict else 0


class RefereeError(RuntimeError):
    """A planner returned a plan that the referee refuses: a bug, never a result."""


def run_planner(problem: Problem, name: str, seconds: float, interrupt: Stop) -> Judged:
    """Plan within a time limit and have the plan judged."""
    try:
        result = SOLVERS[name](problem, FirstOf(interrupt, TimeLimit(seconds)))
    except UnsupportedError as error:
        return Judged(Result(None, -math.inf, Reason.UNSUPPORTED, message=str(error)), None)
    if result.plan is None:
        return Judged(result, None)
    verdict = check(problem, result.plan)
    if verdict.violations:
        raise RefereeError(f"{name}: {verdict.violations[0]}")
    if not math.isclose(verdict.reward, result.value, rel_tol=1e-9, abs_tol=1e-9):
        raise RefereeError(f"{name}: claims J = {result.value!r}, it is {verdict.reward!r}")
    return Judged(result, verdict)


def run_bound(
    problem: Problem, name: str, seconds: float, interrupt: Stop, plan: Plan | None = None
) -> BoundResult:
    """Bound within a time limit; its certificate has been priced."""
    return BOUNDS[name](problem, FirstOf(interrupt, TimeLimit(seconds)), plan)


def plan_row(problem: Problem, seed: int, planner: str, judged: Judged) -> Row:
    """Row of a plan, without a bound: only certified bounds are printed."""
    result = judged.result
    return {
        "scene": problem.name,
        "seed": seed,
        "planner": planner,
        "method": None,
        "reward": finite(judged.reward),
        "bound": None,
        "gap": None,
        "reason": str(result.reason),
        "limit": str(result.limit),
        "seconds": result.seconds,
        "conflicts": judged.conflicts,
        "message": result.message,
    }


def gap_row(
    problem: Problem, seed: int, planner: str, judged: Judged, bound: BoundResult, path: str
) -> Row:
    """Row of the gap table. Only a plan that obeys the rules has a gap to their bound."""
    feasible = judged.verdict is not None and judged.verdict.valid
    row = plan_row(problem, seed, planner, judged)
    row |= {
        "method": bound.method,
        "bound": finite(bound.bound),
        "gap": finite(relative_gap(judged.reward, bound.bound)) if feasible else None,
        "robots": len(problem.robots),
        "actors": len(problem.actors),
        "steps": problem.horizon,
        "bound_method": bound.method,
        "certificate": path,
    }
    return row


def bound_row(problem: Problem, seed: int, bound: BoundResult) -> Row:
    """Row of a bound alone."""
    return {
        "scene": problem.name,
        "seed": seed,
        "method": bound.method,
        "bound": finite(bound.bound),
        "reason": str(bound.reason),
        "limit": str(bound.limit),
        "seconds": bound.seconds,
        **bound.statistics,
    }


def default_planners(problem: Problem) -> list[str]:
    """Planners of a gap table: the paper's, and the joint optimum where it can be had."""
    names = ["greedy", "sequential", "cocap", "cocap-vs"]
    return [*names, "joint"] if len(problem.robots) <= 2 else names


def finite(value: float) -> float | None:
    """None for what JSON cannot hold."""
    return value if math.isfinite(value) else None


def mean_table(rows: Sequence[Row]) -> list[Row]:
    """Per scene and planner: means over seeds, and how many plans obey the rules.

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
                "feasible": sum(row["gap"] is not None for row in some),
                **{key: _mean(some, key) for key in ("reward", "bound", "gap", "seconds")},
            }
        )
    return table


def _mean(rows: Sequence[Row], key: str) -> float | None:
    values = [row[key] for row in rows]
    return None if None in values else math.fsum(values) / len(values)
