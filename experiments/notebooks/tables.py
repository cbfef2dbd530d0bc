"""What the notebooks compute and show as tables."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from cocap_opt.check import check, view_rewards
from cocap_opt.data import FloatArray
from cocap_opt.experiments.console.progress import unseen
from cocap_opt.experiments.results.gap_table import cover, plans_of, rows_of
from cocap_opt.experiments.results.rows import Judged, Row, bound_is_proved, judge
from cocap_opt.experiments.results.tables import Table, number
from cocap_opt.experiments.results.trace import Trace
from cocap_opt.experiments.studies.paper.giving_way import Encounter
from cocap_opt.formulations.certificates.certificate import verify
from cocap_opt.formulations.certificates.proof import ProofFile, leaves, verify_proof
from cocap_opt.formulations.result import BoundMethod, CertifiedResult
from cocap_opt.model import compiled
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Cuboid, Problem
from cocap_opt.result import Result, relative_gap
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, TimeLimit, never

WARM_UP = "tiny-share"  # a scene on which methods import what they need before they are timed
SIDES = ("front", "left", "back", "right", "top")  # of a cuboid, in the order of its faces


def framed(table: Sequence[Mapping[str, Any]]) -> pd.DataFrame:
    """A table as notebooks show it, its rows named by the first column."""
    frame = pd.DataFrame(table)
    return frame.set_index(frame.columns[0])


def plan_table(plans: Mapping[str, Judged[Result]]) -> Table:
    """What the referee says of plans, by planner."""
    return [
        {
            "planner": name,
            "J": _amount(judged.reward),
            "conflicts": str(judged.conflicts),
            "obeys the rules": "yes" if judged.valid else "no",
            "seconds": f"{judged.result.seconds:.3f}",
        }
        for name, judged in plans.items()
    ]


def gap_rows(problems: Mapping[int, Problem], planners: Sequence[str], seconds: float) -> list[Row]:
    """Rows of the gap table of some problems by their seeds; no plan or bound takes longer."""
    limits, watch, rows = partial(TimeLimit, seconds), unseen(), []
    for seed, problem in problems.items():
        cover(problem, limits(), watch)
        plans = plans_of(problem, seed, planners, limits, None, watch)
        rows += rows_of(problem, seed, plans, limits, None, watch)
    return rows


def gap_table(rows: Sequence[Row]) -> Table:
    """The gap table in short."""
    return [
        {
            "seed": str(row["seed"]),
            "planner": row["planner"],
            "J": _amount(row["reward"]),
            "bound": _amount(row["bound"]),
            "gap (%)": _percent(row["gap"]),
            "gap to free (%)": _percent(row["gap_free"]),
            "conflicts": str(row["conflicts"]),
            "bound is": "the optimum" if bound_is_proved(row) else "open",
        }
        for row in rows
    ]


def outcomes(
    problem: Problem,
    methods: Mapping[str, BoundMethod],
    seconds: float,
    start: Plan | None = None,
    traces: Mapping[str, Trace] | None = None,
) -> dict[str, CertifiedResult]:
    """What each method finds within a time limit; imports and coverage are not counted.

    Parameters
    ----------
    traces : by method, what keeps its progress
    """
    compiled(problem).prepare_all(never)
    found = {}
    for name, method in methods.items():
        method(load_scene(WARM_UP), TimeLimit(seconds))
        trace = (traces or {}).get(name, Trace())
        result = method(problem, TimeLimit(seconds), start, trace.report)
        trace.end(result)
        found[name] = judge(name, problem, result).result
    return found


def above(bound: float, optimum: float) -> float:
    """How far a bound is above the optimum, in % of the optimum."""
    return 100 * (bound - optimum) / optimum


def bound_table(found: Mapping[str, CertifiedResult], optimum: float) -> Table:
    """Each method's bound beside the proved optimum."""
    return [
        {
            "method": name,
            "bound": _amount(result.bound),
            "above the optimum (%)": f"{above(result.bound, optimum):.4f}",
            "seconds": f"{result.seconds:.3f}",
            "ended": _end(result),
        }
        for name, result in found.items()
    ]


def check_table(problem: Problem, found: Mapping[str, CertifiedResult]) -> Table:
    """Each method's claim beside what its certificate proves, recomputed without a solver.

    Raises
    ------
    CertificateError
        If a certificate claims less than it proves.
    """
    return [
        {
            "method": name,
            "claimed bound": _amount(result.bound),
            "recomputed": _amount(_recomputed(problem, result)),
            "leaves": str(sum(1 for _ in leaves(file)) if isinstance(file, ProofFile) else 1),
        }
        for name, result in found.items()
        if (file := result.certificate) is not None
    ]


def _recomputed(problem: Problem, result: CertifiedResult) -> float:
    file = result.certificate
    assert file is not None
    if isinstance(file, ProofFile):
        return verify_proof(problem, file).bound
    return verify(problem, file).bound


def solver_table(found: Mapping[str, CertifiedResult]) -> Table:
    """What each method found and proved; a bound without a certificate is the solver's word."""
    return [
        {
            "method": name,
            "J": _amount(result.value),
            "bound": _amount(_best_bound(result)),
            "gap (%)": _percent(relative_gap(result.value, _best_bound(result)), 4),
            "bound is": "certified" if result.certificate else "the solver's word",
            "variables": f"{result.statistics['whole']:,}" if "whole" in result.statistics else "",
            "seconds": f"{result.seconds:.3f}",
            "ended": _end(result),
        }
        for name, result in found.items()
    ]


def _best_bound(result: CertifiedResult) -> float:
    """The certified bound; without one, what the solver says."""
    if result.certificate is not None:
        return result.bound
    return result.statistics.get("solver_bound", math.inf)


def _end(result: Result) -> str:
    return str(result.reason) if result.limit is Limit.NONE else f"limit: {result.limit}"


def differences(problem: Problem, plan: Plan, best: Plan) -> FloatArray:
    """View reward [T+1, F] of a plan minus that of a better one, by step and face."""
    less: FloatArray = np.array(view_rewards(problem, plan)) - view_rewards(problem, best)
    return less


def differences_by_person(problem: Problem, plan: Plan, best: Plan) -> FloatArray:
    """View reward [T+1, A] of a plan minus that of a better one, by step and person."""
    by_face = differences(problem, plan, best)
    people = range(len(problem.actors))
    return np.column_stack([by_face[:, problem.face_owner == j].sum(axis=1) for j in people])


def side_table(problem: Problem, plan: Plan, best: Plan) -> Table:
    """View reward of a plan minus that of a better one on each side of each person, all steps.

    In % of the better J. People must be cuboids.
    """
    assert all(isinstance(actor.shape, Cuboid) for actor in problem.actors)
    share = 100 * differences(problem, plan, best).sum(axis=0) / check(problem, best).reward
    by_person = share.reshape(-1, len(SIDES))
    named = {f"person {j}": row for j, row in enumerate(by_person)}
    return [
        {
            "in % of J": name,
            **dict(zip(SIDES, map(_signed, row), strict=True)),
            "all sides": _signed(row.sum()),
        }
        for name, row in {**named, "all": by_person.sum(axis=0)}.items()
    ]


def encounter_table(found: Mapping[str, Sequence[Encounter]]) -> Table:
    """What becomes of drones that collide where rules are ignored, by planner."""
    return [
        {
            "planner": planner,
            "drones": "{} and {}".format(*encounter.robots),
            "first conflict": f"step {encounter.step}",
            "flies elsewhere": _movers(encounter),
            "earlier gives up (%)": _signed(100 * encounter.given_up[0]),
            "later gives up (%)": _signed(100 * encounter.given_up[1]),
            "J of the team": _amount(encounter.team),
        }
        for planner, some in found.items()
        for encounter in some
    ]


def _movers(encounter: Encounter) -> str:
    words = {
        (True, True): "both", (True, False): "the earlier", (False, True): "the later",
        (False, False): "nobody",
    }  # fmt: skip
    return words[encounter.moved]


def _amount(value: float | None) -> str:
    return number(value, 2)


def _percent(share: float | None, digits: int = 3) -> str:
    return number(None if share is None else 100 * share, digits)


def _signed(percent: float) -> str:
    return f"{round(percent, 2) + 0.0:+.2f}" if abs(percent) >= 0.005 else "0"
