"""Exact methods on a scene that is cut off after more and more steps.

The generic solvers get the whole instance as one integer program, without the bound and the cuts of
column generation, from which they start elsewhere in this project.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.benchmark import Benchmark, MethodRun, RunStatus
from cocap_opt.experiments.lab.results import Results
from cocap_opt.experiments.lab.studies.options import Seconds
from cocap_opt.experiments.lab.studies.runs import Measurable, Run, scene
from cocap_opt.experiments.lab.studies.solvers.comparisons import ALONE
from cocap_opt.formulations.integer_programs.scip_nonlinear import scip_nonlinear
from cocap_opt.formulations.result import CertifiedResult, Report, silent
from cocap_opt.output.printing import Listing, Record
from cocap_opt.planners.joint import joint
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason
from cocap_opt.run.options import Option, UsageError
from cocap_opt.stop import Limit, Stop, never

_SCENE = "corridor"  # two drones, as `joint` supports no more
_PATIENCE = 20.0  # s, for a method that notices its limit late


def _joint(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """Runs joint value iteration as a method of bounds: its optimum is its bound."""
    found = joint(problem, stop)
    bound = found.value if found.reason is Reason.OPTIMAL else math.inf
    return CertifiedResult(
        found.plan, found.value, found.reason, found.limit, bound=bound, seconds=found.seconds
    )


METHODS: Mapping[str, Measurable] = {
    "branch-and-price": "branch-and-price",
    "joint": _joint,
    "brute-force": "brute-force",
    **ALONE,
    "scip-nonlinear": partial(scip_nonlinear, root=None),
}


def steps(
    *,
    steps: Annotated[str, Parameter(help="numbers of steps after which the corridor ends")] = "1-8",
    seeds: Annotated[str, Parameter(help="seeds of the corridor")] = "0-4",
    limit: Seconds = 5.0,
    out: Annotated[Path, Parameter(help="folder for solvers.csv and solvers.png")],
) -> int:
    """Measures, prints, and writes the table (solvers.csv) and the figure (solvers.png)."""
    horizons, numbers = sorted(Option("--steps").numbers(steps)), Option("--seeds").numbers(seeds)
    if horizons[0] < 1:
        raise UsageError(f"--steps: must be at least 1, not {horizons[0]}")
    results, runs = Results.into(out), list[MethodRun]()
    try:
        for seed in numbers:
            for method in METHODS:
                runs += _measured(method, horizons, seed, limit)
                results.save("solvers.csv", runs)
    finally:
        title = f"median CPU time (s) until proved, by steps (limit {limit:g} s)"
        Listing(title, _listed(runs)).print()
    results.draw("solvers.png", Benchmark(runs).plot)
    return int(any(run.outcome is RunStatus.FAILED for run in runs))


def _measured(method: str, horizons: Sequence[int], seed: int, limit: float) -> list[MethodRun]:
    """Runs a method with more and more steps, until it rejects the problem or fails."""
    builds = [partial(scene, _SCENE, seed, horizon) for horizon in horizons]
    runs: list[MethodRun] = []
    for horizon, outcome in zip(
        horizons, Run.each(builds, METHODS[method], limit, _PATIENCE), strict=False
    ):
        run = _told(method, horizon, seed, outcome)
        say(f"{method}, {horizon} steps, seed {seed}: {run.outcome}, {run.processor:.2f} s")
        runs.append(run)
        if run.outcome is RunStatus.REFUSED:
            break
    return runs


def _told(method: str, horizon: int, seed: int, found: Run | Run.Error) -> MethodRun:
    """Returns a run as a row of the table."""
    if isinstance(found, Run.Error):
        words = str(found)
        outcome = RunStatus.REFUSED if words.startswith("UnsupportedError") else RunStatus.FAILED
        nothing = (math.nan, math.nan, -math.inf, math.inf)
        return MethodRun(method, horizon, seed, outcome, *nothing, words)
    outcome = RunStatus.PROVED if found.reason is Reason.OPTIMAL else RunStatus.STOPPED
    if found.limit is Limit.MEMORY:
        outcome = RunStatus.REFUSED
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
    """Returns the median time of runs that proved the optimum, and their number if not all did."""
    times = [run.processor for run in runs if run.outcome is RunStatus.PROVED]
    if not times:
        return "none" if runs else "-"
    share = "" if len(times) == len(runs) else f" ({len(times)}/{len(runs)})"
    return f"{median(times):.2g}{share}"
