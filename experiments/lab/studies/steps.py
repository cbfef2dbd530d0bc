"""Measures exact methods on a scene that is cut off after more and more steps.

The generic solvers are given one integer program of the whole instance, alone: without the bound
and the cuts of column generation, with which they begin elsewhere in this project.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.benchmark import Benchmark, MethodRun, Outcome
from cocap_opt.experiments.lab.studies.runs import Run, scene
from cocap_opt.experiments.lab.studies.solvers.contenders import ALONE
from cocap_opt.formulations.brute_force import brute_force
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.integer_programs.scip_nonlinear import scip_nonlinear
from cocap_opt.formulations.result import BoundMethod, CertifiedResult, Report, silent
from cocap_opt.output.files import make_folder, save_bytes, save_csv
from cocap_opt.output.printing import Listing, Record
from cocap_opt.pictures.figures import picture
from cocap_opt.planners.joint import joint
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason
from cocap_opt.stop import Limit, Stop, never

_SCENE = "corridor"  # two drones: `joint` takes no more
_PATIENCE = 20.0  # s, for a method that is slow to notice its limit


def _joint(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Joint value iteration in the form of a method of bounds: its optimum is its bound."""
    found = joint(problem, stop)
    bound = found.value if found.reason is Reason.OPTIMAL else math.inf
    return CertifiedResult(
        found.plan, found.value, found.reason, found.limit, bound=bound, seconds=found.seconds
    )


METHODS: Mapping[str, BoundMethod] = {
    "branch-and-price": branch_and_price,
    "joint": _joint,
    "brute-force": brute_force,
    **ALONE,
    "scip-nonlinear": partial(scip_nonlinear, root=None),
}


def steps(horizons: Sequence[int], seeds: Sequence[int], limit: float, out: Path) -> bool:
    """Measures, prints, and writes the table (solvers.csv) and the figure (solvers.png).

    Parameters
    ----------
    limit : s, of each run

    Returns
    -------
    bool
        True if no run failed.
    """
    make_folder(out)
    runs: list[MethodRun] = []
    try:
        for seed in seeds:
            for method in METHODS:
                runs += _measured(method, horizons, seed, limit)
                save_csv(out / "solvers.csv", [run._asdict() for run in runs])
    finally:
        title = f"median seconds of processor until proved, by steps (limit {limit:g} s)"
        Listing(title, _listed(runs)).print()
    save_bytes(out / "solvers.png", picture(Benchmark(runs).plot(), ".png"))
    return all(run.outcome is not Outcome.FAILED for run in runs)


def _measured(method: str, horizons: Sequence[int], seed: int, limit: float) -> list[MethodRun]:
    """Runs a method with more and more steps, until it refuses or fails."""
    builds = [partial(scene, _SCENE, seed, horizon) for horizon in horizons]
    runs: list[MethodRun] = []
    for horizon, outcome in zip(
        horizons, Run.each(builds, METHODS[method], limit, _PATIENCE), strict=False
    ):
        run = _told(method, horizon, seed, outcome)
        say(f"{method}, {horizon} steps, seed {seed}: {run.outcome}, {run.processor:.2f} s")
        runs.append(run)
        if run.outcome is Outcome.REFUSED:
            break
    return runs


def _told(method: str, horizon: int, seed: int, found: Run | Run.Error) -> MethodRun:
    """Returns a run as the table has it."""
    if isinstance(found, Run.Error):
        words = str(found)
        outcome = Outcome.REFUSED if words.startswith("UnsupportedError") else Outcome.FAILED
        nothing = (math.nan, math.nan, -math.inf, math.inf)
        return MethodRun(method, horizon, seed, outcome, *nothing, words)
    outcome = Outcome.PROVED if found.reason is Reason.OPTIMAL else Outcome.STOPPED
    if found.limit is Limit.MEMORY:
        outcome = Outcome.REFUSED
    return MethodRun(
        method, horizon, seed, outcome, found.elapsed, found.seconds, found.value,
        min(found.bound, found.solver_bound), found.message,
    )  # fmt: skip


def _listed(runs: Sequence[MethodRun]) -> list[Record]:
    """Returns a row for each method with a column for each number of steps."""
    horizons = sorted({run.steps for run in runs})
    return [
        {"method": method}
        | {str(h): _words([r for r in runs if (r.method, r.steps) == (method, h)])
           for h in horizons}
        for method in dict.fromkeys(run.method for run in runs)
    ]  # fmt: skip


def _words(runs: Sequence[MethodRun]) -> str:
    """Returns the median time of the runs that proved the optimum, and how many of all did."""
    times = [run.processor for run in runs if run.outcome is Outcome.PROVED]
    if not times:
        return "none" if runs else "-"
    share = "" if len(times) == len(runs) else f" ({len(times)}/{len(runs)})"
    return f"{median(times):.2g}{share}"
