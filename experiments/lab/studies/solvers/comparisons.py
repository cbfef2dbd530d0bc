"""Rows of the table of solvers that compare our methods with generic solvers on one instance.

The instance is a scene cut off after h steps. h is the largest number of steps for which the
generic solver finishes within the limit on the first seed. The ratios are medians over all seeds.

Generic solvers get the whole instance as one integer program, made by
`integer_programs.outer_approximation`. Alone, a solver has only its own bound and cuts. With our
root, it starts with the bound and the cuts of column generation, and stops once its plan attains
that bound.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import median
from typing import NamedTuple

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.studies.runs import Build, Measurable, Run, scene
from cocap_opt.experiments.lab.studies.solvers.rows import SEEDS, Metric, RowOptions, Target
from cocap_opt.formulations.integer_programs.cp_sat import cp_sat
from cocap_opt.formulations.integer_programs.mathopt import highs, scip
from cocap_opt.formulations.integer_programs.outer_approximation import Root, certified_root
from cocap_opt.formulations.result import OPTIMALITY, BoundMethod
from cocap_opt.run.engine import BOUND_METHOD
from cocap_opt.scenarios import load_scene

_LIMIT = 300.0  # s
_BOTTLENECK_STEPS = (2, 4, 6, 8, 11)
_CORRIDOR_STEPS = range(2, 9)
_RELAXED = {"corridor": 5, "field": 3}  # scenes and steps, small enough for one program
_RELAXATIONS = ("concave", "single-view", "envelope", "column-generation")
_REPEATS = 3  # runs of our method, which takes a fraction of a second
_SAME = 1e-7  # relative difference up to which bounds count as equal


def _contenders(root: Root | None) -> dict[str, BoundMethod]:
    return {
        "highs": partial(highs, root=root),
        "scip": partial(scip, root=root),
        "cp-sat": partial(cp_sat, root=root),
    }


ALONE = _contenders(None)
_WITH_OUR_ROOT = _contenders(certified_root)


class _Duel(NamedTuple):
    """Seconds of our method and of a generic solver on one instance."""

    ours: float  # s
    theirs: float  # s; the limit if it did not finish

    @property
    def ratio(self) -> float:
        """Seconds of the generic solver over ours."""
        return self.theirs / self.ours


def _cone_program(options: RowOptions) -> list[Metric]:
    """Compares column generation with its single-view relaxation as one cone program (Clarabel)."""
    seeds, limit = options.seeds_or(SEEDS), options.limit_or(_LIMIT)
    steps, first, why = _largest_cone_program(seeds[0], limit)
    duels, tighter = [], []
    for seed in seeds:
        build = partial(scene, "bottleneck", seed, steps)
        theirs = first if seed == seeds[0] else _try(build, "single-view", limit, "cone", seed)
        if theirs is None:
            say(f"bottleneck seed {seed}, {steps} steps: not within {limit:g} s, left out")
            continue
        bound = theirs.bound * (1 + _SAME)
        ours = [Run.of(build, "column-generation", limit).told("bottleneck", seed)
                for _ in range(_REPEATS)]  # fmt: skip
        reached = median(r.seconds_to_bound(bound) for r in ours)
        duels.append(_Duel(reached, theirs.seconds))
        tighter.append(100 * (1 - ours[0].bound / theirs.bound))
    note = f"bottleneck, {steps} of {load_scene('bottleneck').horizon} steps{why}"
    if len(duels) < len(seeds):
        note += f"; {len(seeds) - len(duels)} seeds left out, whose cone program took longer"
    return [
        *_ratios("cone program / column generation to the same bound", duels, 200, note),
        Metric("column generation's end below that bound", median(tighter), "%", None, None,
               "its envelope cuts"),
    ]  # fmt: skip


def _largest_cone_program(seed: int, limit: float) -> tuple[int, Run, str]:
    """Returns the most steps that the cone program finishes, its run, and why not more."""
    best: tuple[int, Run] | None = None
    for steps in _BOTTLENECK_STEPS:
        build = partial(scene, "bottleneck", seed, steps)
        theirs = _try(build, "single-view", limit, f"cone program, {steps} steps", seed)
        if theirs is None:
            break
        best = steps, theirs
    if best is None:
        raise Run.Error(f"the cone program does not finish {steps} steps within {limit:g} s")
    why = f"; {steps} not within {limit:g} s" if steps > best[0] else ""
    return *best, why


def _relaxations(options: RowOptions) -> list[Metric]:
    """Measures relaxations' gaps to the optimum, and how much of the first one's gap they close."""
    figures = []
    for name, steps in _RELAXED.items():
        above: dict[str, list[float]] = {}
        for seed in options.seeds_or(SEEDS):
            build = partial(scene, name, seed, steps)
            best = Run.of(build, BOUND_METHOD, options.limit_or(_LIMIT)).told(name, seed)
            for method in _RELAXATIONS:
                result = _try(build, method, options.limit_or(_LIMIT), method, seed)
                bound = math.nan if result is None else result.bound
                above.setdefault(method, []).append(100 * (bound - best.value) / bound)
        worst = median(above[_RELAXATIONS[0]])
        for method, shares in above.items():
            closed = 100 * (1 - median(shares) / worst) if worst > 0 else math.nan
            note = f"closes {closed:.1f} % of the gap of {_RELAXATIONS[0]}"
            figures.append(
                Metric(f"{name}, {steps} steps: {method} above the optimum, median",
                       median(shares), "%", None, None, note)
            )  # fmt: skip
    return figures


def _milps(options: RowOptions) -> list[Metric]:
    """Compares branch-and-price with HiGHS, SCIP and CP-SAT alone."""
    return _against(ALONE, options)


def _rooted_milps(options: RowOptions) -> list[Metric]:
    """Compares branch-and-price with the same solvers, given the bound and cuts of our root."""
    return _against(_WITH_OUR_ROOT, options, asked=False)


def _against(
    contenders: Mapping[str, BoundMethod], options: RowOptions, asked: bool = True
) -> list[Metric]:
    seeds, limit = options.seeds_or(SEEDS), options.limit_or(_LIMIT)
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
        ours = [Run.of(build, BOUND_METHOD, limit).told("corridor", seed)
                for _ in range(_REPEATS)]  # fmt: skip
        for name, other in theirs.items():
            _require_same(name, other.value, ours[0].value)
        proof = median(r.seconds_to_proof for r in ours)
        duels.append(_Duel(proof, theirs[fastest].seconds) if theirs else _Duel(proof, limit))
        best.append(fastest)
    note = f"corridor, {steps} of {load_scene('corridor').horizon} steps{why}; fastest per seed: "
    name = "best of HiGHS, SCIP, CP-SAT / branch-and-price"
    return _ratios(name, duels, 500, note + ", ".join(best), asked)


def _largest_closed(
    contenders: Mapping[str, BoundMethod], seed: int, limit: float
) -> tuple[int, dict[str, Run], str]:
    """Returns the most steps for which a solver proves the optimum, its runs, and why not more.

    A solver that fails is not tried with more steps.
    """
    left = dict(contenders)
    best: tuple[int, dict[str, Run]] | None = None
    for steps in _CORRIDOR_STEPS:
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
        raise Run.Error(f"no solver proves {steps} steps within {limit:g} s")
    why = f"; {steps} not within {limit:g} s" if steps > best[0] else ""
    return *best, why


def _try(build: Build, method: Measurable, limit: float, name: str, seed: int) -> Run | None:
    """Runs a method; returns None if it failed or did not finish within the limit."""
    try:
        result = Run.of(build, method, limit).told(name, seed)
    except Run.Error as error:
        say(f"{name} seed {seed}: {error}")
        return None
    return result if result.finished else None


def _require_same(name: str, theirs: float, ours: float) -> None:
    """Raises Run.Error if two proved optima differ, as one of the methods must be wrong."""
    if abs(theirs - ours) > 2 * OPTIMALITY * abs(ours):
        raise Run.Error(f"{name}'s optimum is {theirs!r}, branch-and-price's {ours!r}")


def _ratios(
    name: str, duels: Sequence[_Duel], moonshot: float, note: str, asked: bool = True
) -> list[Metric]:
    if not duels:
        raise Run.Error("no seed could be compared")
    must, more = (Target.at_least(50), Target.at_least(moonshot)) if asked else (None, None)
    ratios = [duel.ratio for duel in duels if math.isfinite(duel.ours)]
    missed = [0.0] * (len(duels) - len(ratios))  # ours did not finish
    return [
        Metric(name, median([*ratios, *missed]), "x", must, more, note),
        Metric("smallest ratio", min([*ratios, *missed]), "x"),
        Metric("theirs, median", median(duel.theirs for duel in duels), "s"),
        Metric("ours, median", median(duel.ours for duel in duels), "s"),
    ]


COMPARISONS: Mapping[str, Callable[[RowOptions], list[Metric]]] = {
    "relaxations": _relaxations,
    "cone-program": _cone_program,
    "milp": _milps,
    "milp-with-our-root": _rooted_milps,
}
