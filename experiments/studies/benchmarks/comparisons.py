"""Rows of the table of solvers that compare ours with the generic way on the same instance.

The instance is a scene cut off after h steps. The first seed says how large h may be: as long
as the generic way comes to its end within the limit. The ratios are medians over all seeds.
"""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from statistics import median
from typing import NamedTuple

from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.studies.benchmarks.contenders import ALONE, WITH_OUR_ROOT
from cocap_opt.experiments.studies.benchmarks.figures import Figure, at_least
from cocap_opt.experiments.studies.benchmarks.rows import SEEDS, Options, told
from cocap_opt.experiments.studies.benchmarks.runs import Build, Run, RunError, run, scene
from cocap_opt.formulations import BOUNDS
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.column_generation.root_bound import column_generation
from cocap_opt.formulations.relaxations.cone_program import single_view
from cocap_opt.formulations.result import OPTIMALITY, BoundMethod
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit

LIMIT = 300.0  # s
BOTTLENECK_STEPS = (2, 4, 6, 8, 11)
CORRIDOR_STEPS = range(2, 9)
RELAXED = {"corridor": 5, "field": 3}  # scenes and steps, small enough for one program
RELAXATIONS = ("concave", "single-view", "envelope", "column-generation")
REPEATS = 3  # of ours, which takes a fraction of a second
SAME = 1e-7  # relative, by which bounds differ that are the same


class Duel(NamedTuple):
    """Ours against theirs on one instance."""

    ours: float  # s
    theirs: float  # s; at the limit where they did not get to the end
    busy: float = math.nan  # theirs / ours in seconds of processor, of the whole runs

    @property
    def ratio(self) -> float:
        """How many times as long theirs takes."""
        return self.theirs / self.ours


def cone_program(options: Options) -> list[Figure]:
    """Column generation against its single-view relaxation as one cone program (Clarabel)."""
    seeds, limit = options.seeds_or(SEEDS), options.limit_or(LIMIT)
    steps, first, why = _largest_cone_program(seeds[0], limit)
    duels, tighter = [], []
    for seed in seeds:
        build = partial(scene, "bottleneck", seed, steps)
        theirs = first if seed == seeds[0] else _try(build, single_view, limit, "cone", seed)
        if theirs is None:
            say(f"bottleneck seed {seed}, {steps} steps: not within {limit:g} s, left out")
            continue
        bound = theirs.bound * (1 + SAME)
        ours = [told("bottleneck", seed, run(build, column_generation, limit))
                for _ in range(REPEATS)]  # fmt: skip
        reached = median(r.seconds_to_bound(bound) for r in ours)
        duels.append(Duel(reached, theirs.seconds, _busy(theirs, ours)))
        tighter.append(100 * (1 - ours[0].bound / theirs.bound))
    note = f"bottleneck, {steps} of {load_scene('bottleneck').horizon} steps{why}"
    if len(duels) < len(seeds):
        note += f"; {len(seeds) - len(duels)} seeds left out, whose cone program took longer"
    return [
        *_ratios("cone program / column generation to the same bound", duels, 200, note),
        Figure("column generation's end below that bound", median(tighter), "%", None, None,
               "its envelope cuts"),
    ]  # fmt: skip


def _largest_cone_program(seed: int, limit: float) -> tuple[int, Run, str]:
    """Most steps for which it comes to its end, with that run, and what stopped it after."""
    best: tuple[int, Run] | None = None
    for steps in BOTTLENECK_STEPS:
        build = partial(scene, "bottleneck", seed, steps)
        theirs = _try(build, single_view, limit, f"cone program, {steps} steps", seed)
        if theirs is None:
            break
        best = steps, theirs
    if best is None:
        raise RunError(f"the cone program takes not even {steps} steps within {limit:g} s")
    why = f"; {steps} not within {limit:g} s" if steps > best[0] else ""
    return *best, why


def relaxations(options: Options) -> list[Figure]:
    """How far each relaxation is above the proved optimum, and how much it closes of the worst."""
    figures = []
    for name, steps in RELAXED.items():
        above: dict[str, list[float]] = {}
        for seed in options.seeds_or(SEEDS):
            build = partial(scene, name, seed, steps)
            best = told(name, seed, run(build, branch_and_price, options.limit_or(LIMIT)))
            for method in RELAXATIONS:
                result = _try(build, BOUNDS[method], options.limit_or(LIMIT), method, seed)
                bound = math.nan if result is None else result.bound
                above.setdefault(method, []).append(100 * (bound - best.value) / bound)
        worst = median(above[RELAXATIONS[0]])
        for method, shares in above.items():
            closed = 100 * (1 - median(shares) / worst) if worst > 0 else math.nan
            note = f"closes {closed:.1f} % of what {RELAXATIONS[0]} leaves"
            figures.append(
                Figure(f"{name}, {steps} steps: {method} above the optimum, median",
                       median(shares), "%", None, None, note)
            )  # fmt: skip
    return figures


def milps(options: Options) -> list[Figure]:
    """Branch-and-price against HiGHS, SCIP and CP-SAT alone."""
    return _against(ALONE, options)


def rooted_milps(options: Options) -> list[Figure]:
    """Branch-and-price against the same with the bound and cuts of our column generation."""
    return _against(WITH_OUR_ROOT, options, asked=False)


def _against(
    contenders: Mapping[str, BoundMethod], options: Options, asked: bool = True
) -> list[Figure]:
    seeds, limit = options.seeds_or(SEEDS), options.limit_or(LIMIT)
    steps, first, why = _largest_closed(contenders, seeds[0], limit)
    duels, best = [], []
    for seed in seeds:
        build = partial(scene, "corridor", seed, steps)
        theirs = first if seed == seeds[0] else {
            name: found
            for name in first
            if (found := _try(build, contenders[name], limit, f"{name}, {steps} steps", seed))
        }  # fmt: skip
        fastest = min(theirs, key=lambda name: theirs[name].seconds, default="none")
        ours = [told("corridor", seed, run(build, branch_and_price, limit))
                for _ in range(REPEATS)]  # fmt: skip
        for name, other in theirs.items():
            _require_same(name, other.value, ours[0].value)
        proof = median(r.seconds_to_proof for r in ours)
        duels.append(
            Duel(proof, theirs[fastest].seconds, _busy(theirs[fastest], ours))
            if theirs
            else Duel(proof, limit)
        )
        best.append(fastest)
    note = f"corridor, {steps} of {load_scene('corridor').horizon} steps{why}; fastest per seed: "
    name = "best of HiGHS, SCIP, CP-SAT / branch-and-price"
    return _ratios(name, duels, 500, note + ", ".join(best), asked)


def _largest_closed(
    contenders: Mapping[str, BoundMethod], seed: int, limit: float
) -> tuple[int, dict[str, Run], str]:
    """Most steps for which one of them proves the optimum, with the runs of those that do.

    Who fails is not tried with more steps.
    """
    left = dict(contenders)
    best: tuple[int, dict[str, Run]] | None = None
    for steps in CORRIDOR_STEPS:
        build = partial(scene, "corridor", seed, steps)
        done = {
            name: found
            for name, method in left.items()
            if (found := _try(build, method, limit, f"{name}, {steps} steps", seed))
        }
        if not done:
            break
        left = {name: contenders[name] for name in done}
        best = steps, done
    if best is None:
        raise RunError(f"none of them closes {steps} steps within {limit:g} s")
    why = f"; {steps} not within {limit:g} s" if steps > best[0] else ""
    return *best, why


def _try(build: Build, method: BoundMethod, limit: float, name: str, seed: int) -> Run | None:
    """A run that came to its end; None where it did not, or failed."""
    try:
        result = told(name, seed, run(build, method, limit))
    except RunError as error:
        say(f"{name} seed {seed}: {error}")
        return None
    return result if result.limit is Limit.NONE else None


def _busy(theirs: Run, ours: Sequence[Run]) -> float:
    return theirs.processor / median(r.processor for r in ours)


def _require_same(name: str, theirs: float, ours: float) -> None:
    """Both say that they have proved the optimum: then one of them is wrong."""
    if abs(theirs - ours) > 2 * OPTIMALITY * abs(ours):
        raise RunError(f"{name}'s optimum is {theirs!r}, branch-and-price's {ours!r}")


def _ratios(
    name: str, duels: Sequence[Duel], moonshot: float, note: str, asked: bool = True
) -> list[Figure]:
    if not duels:
        raise RunError("no seed could be compared")
    must, more = (at_least(50), at_least(moonshot)) if asked else (None, None)
    ratios = [duel.ratio for duel in duels if math.isfinite(duel.ours)]
    missed = [0.0] * (len(duels) - len(ratios))  # ours did not get there
    return [
        Figure(name, median([*ratios, *missed]), "x", must, more, note),
        Figure("smallest ratio", min([*ratios, *missed]), "x"),
        Figure("median ratio in seconds of processor, whole runs", _median_busy(duels), "x"),
        Figure("theirs, median", median(duel.theirs for duel in duels), "s"),
        Figure("ours, median", median(duel.ours for duel in duels), "s"),
    ]


def _median_busy(duels: Sequence[Duel]) -> float:
    known = [duel.busy for duel in duels if not math.isnan(duel.busy)]
    return median(known) if known else math.nan
