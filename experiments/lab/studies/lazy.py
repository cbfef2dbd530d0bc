"""The views and the time that lazy value iteration saves, with cheap and with expensive views.

Times are CPU times, so other load on the machine matters little, and all times that are compared
are measured in one process. Only the coverage for the reference plan comes from the disk cache; the
time to compute it is measured separately.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import fmean, median
from typing import Any, TypeVar

import numpy as np

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import Results, markdown, stored_rows
from cocap_opt.experiments.lab.studies.coverage.coverage import ACTORS, SCENES
from cocap_opt.experiments.lab.studies.options import Out, Scenes, Seeds
from cocap_opt.experiments.lab.studies.runs import TimedRun, processor_seconds
from cocap_opt.model import Model, compiled
from cocap_opt.output.printing import Listing, Record
from cocap_opt.problem import Problem
from cocap_opt.run.judged import Judged
from cocap_opt.run.options import Option
from cocap_opt.scenarios import load_scene
from cocap_opt.world.workspace import Mesh

T = TypeVar("T")
_TABLE = "lazy.csv"

_LAYERS, _TILTS = tuple(np.arange(2.0, 16.0, 2.0).tolist()), (-0.3, 0.2, 0.6, 1.0)  # m, rad
_PIER, _FROM_EDGE = 0.2, 0.5  # m: half of its width, and how far it is from the deck's edges
_QUICK, _REPEATS = 1.0, 3  # s; shorter times are measured _REPEATS times
_TEAM, _STEPS = 2, 30  # drones and steps on maps of 120 x 120 cells
_ONE_BY_ONE = "sequential"  # CoCap's tree grows too large for 64 drones


def _bridge(seed: int, is_pierced: bool = False, has_many_states: bool = False) -> Problem:
    """Builds the bridge with seven layers and four pitches, or on piers, or both."""
    problem = load_scene("bridge", seed)
    if is_pierced:
        problem = problem.replace(meshes=(_on_piers(problem.meshes[0]),))
    if not has_many_states:
        return problem
    return problem.replace(
        robots=tuple(
            robot.replace(
                motion=robot.motion.replace(layers=_LAYERS),
                camera=robot.camera.replace(tilts=_TILTS),
            )
            for robot in problem.robots
        )
    )


def _on_piers(deck: Mesh) -> Mesh:
    """Makes one mesh, which is not convex, of a deck and the piers below its corners."""
    low, high = deck.vertices.min(axis=0), deck.vertices.max(axis=0)
    parts = [deck]
    for x in (low[0] + _FROM_EDGE, high[0] - _FROM_EDGE):
        for y in (low[1] + _FROM_EDGE, high[1] - _FROM_EDGE):
            foot, top = (x - _PIER, y - _PIER, 0.0), (x + _PIER, y + _PIER, float(low[2]))
            parts.append(Mesh.box(foot, top))
    return Mesh.joined(parts)


def _wide(name: str, seed: int) -> Problem:
    """Builds a map of 120 x 120 cells from the study of coverage."""
    make, change = SCENES[name]
    return change(make(seed=seed, robots=_TEAM, actors=ACTORS, steps=_STEPS))


_MORE: dict[str, Callable[[int], Problem]] = {
    "bridge, 7 layers, 4 pitches": partial(_bridge, has_many_states=True),
    "bridge on piers": partial(_bridge, is_pierced=True),
    "bridge on piers, 7 layers, 4 pitches": partial(_bridge, is_pierced=True, has_many_states=True),
    "field of 120 x 120 cells": partial(_wide, "field, 1 m"),
    "town of 120 x 120 cells": partial(_wide, "town, 1 m"),
    "town on hills": partial(_wide, "town, 1 m, on hills"),
}
ALL = ["corridor", "bottleneck", "passage", "field", "bridge", *_MORE, "field-large"]


def lazy(*, scene: Scenes = None, seeds: Seeds = "0", out: Out = None) -> None:
    """Measures, prints means over the seeds, and writes all runs (lazy.csv).

    Scenes are built-in ones, files, or names of `_MORE`.
    """
    results, numbers = Results.into(out), Option("--seeds").numbers(seeds)
    rows: list[Record] = []
    for name in scene or ALL:
        for seed in numbers:
            rows.append(measured_lazily(name, seed))
            say(f"{name} seed {seed}: {rows[-1]['views']:.1%} of the views")
            results.save(_TABLE, rows)
    Listing(
        "lazy value iteration: views evaluated, J and CPU time, as shares of those of value "
        "iteration with the coverage of all states",
        means(rows),
    ).print()


def lazy_in_markdown() -> str:
    """Returns the stored means in Markdown: views, J and time, scene by scene."""
    return markdown(means(stored_rows(_TABLE)))


def means(rows: Sequence[Mapping[str, Any]]) -> list[Record]:
    """Returns a row for each scene, with means over its seeds for display."""
    scenes: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        scenes.setdefault(row["scene"], []).append(row)
    return [
        {"scene": scene, "planner": runs[0]["planner"], **_shown(runs)}
        for scene, runs in scenes.items()
    ]


def _shown(runs: Sequence[Mapping[str, Any]]) -> Record:
    """Returns the means over the seeds of a scene."""

    def mean(name: str) -> float:
        return fmean(float(row[name]) for row in runs)

    return {
        "states": f"{mean('states'):,.0f}",
        "µs per view": f"{mean('view_us'):.1f}",
        "views": f"{100 * mean('views'):.2g} %",
        "J": f"{mean('reward'):.3f}",
        "time": f"{mean('seconds') / (mean('coverage_seconds') + mean('plan_seconds')):.2f}",
    }


def measured_lazily(scene: str, seed: int) -> Record:
    """Plans a scene with all coverage, and lazily."""
    problem = _MORE[scene](seed) if scene in _MORE else load_scene(scene, seed)
    planner = _ONE_BY_ONE if scene == "field-large" else "cocap"
    states = _reachable(Model(problem, use_cache=False))  # also compiles the graph
    _, coverage = _repeated(lambda: _covered(problem))
    found, seconds = _repeated(lambda: _anew(problem, f"{planner}-lazy"))
    compiled(problem).prepare_all()
    expected, plan = _repeated(lambda: _planned(problem, planner))
    return {
        "scene": scene, "seed": seed, "planner": planner, "states": states,
        "view_us": 1e6 * coverage / states, "views": found.result.statistics["evaluated"] / states,
        "reward": found.reward / expected.reward, "seconds": seconds, "coverage_seconds": coverage,
        "plan_seconds": plan,
    }  # fmt: skip


def _repeated(measure: Callable[[], tuple[T, float]]) -> tuple[T, float]:
    """Returns the last outcome of a measurement, and the median of its seconds."""
    seconds: list[float] = []
    while not seconds or (seconds[0] < _QUICK and len(seconds) < _REPEATS):
        outcome, taken = measure()
        seconds.append(taken)
    return outcome, median(seconds)


def _covered(problem: Problem) -> tuple[Model, float]:
    """Computes all coverage, and returns its model and the seconds of both."""
    begin, model = processor_seconds(), Model(problem, use_cache=False)
    model.prepare_all()
    return model, processor_seconds() - begin


def _anew(problem: Problem, planner: str) -> tuple[Judged[Any], float]:
    """Plans a problem whose views are all unknown."""
    compiled.cache_clear()
    return _planned(problem, planner)


def _planned(problem: Problem, planner: str) -> tuple[Judged[Any], float]:
    timed = TimedRun.of(problem, planner)
    return timed.judged, timed.seconds


def _reachable(model: Model) -> int:
    """Returns the number of states that robots can reach, summed over all steps that count."""
    first = model.problem.first_step
    sights = {c.sight: c for c in model.classes}
    return sum(int(np.count_nonzero(model.reachable(c)[first:])) for c in sights.values())
