"""All of the paper's experiments, computed by sweeps and written as one page with figures."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Annotated

from cyclopts import Parameter
from matplotlib.figure import Figure

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results
from cocap_opt.experiments.lab.studies.options import Workers, positive_seconds
from cocap_opt.experiments.lab.studies.paper.ablation import CONTRASTS, Effect
from cocap_opt.experiments.lab.studies.paper.conditions import CorridorSearch, Trial, read_trials
from cocap_opt.experiments.lab.studies.paper.figures import (
    CURVES,
    StepReward,
    ablation_figure,
    conditions_figure,
    curves_figure,
    curves_of,
    encounter_figure,
    scaling_figure,
)
from cocap_opt.experiments.lab.studies.paper.giving_way import Encounter
from cocap_opt.experiments.lab.studies.paper.measured import completed, read_rows
from cocap_opt.experiments.lab.studies.paper.page import Page
from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.sweeps.sweep import Hired, sweep
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.experiments.tables.tables import Table
from cocap_opt.output.files import make_folder, save_bytes, save_csv
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem
from cocap_opt.run.options import Option, UsageError
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.built_in.field import field

SCENES = ("corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage")
_ENCOUNTERS = ("corridor", "bottleneck")  # scenes in which encounters are examined
DRAWN_AS_CURVES = ("greedy", "sequential", "cocap", "cocap-vs", "cocap-lns")
_SCALING = ("greedy", "sequential", "cocap", "cocap-vs", "cocap-lns")
CONDITIONS = "conditions.csv"
_PAGE = "paper.md"
_AT_A_TIME = 3600.0  # s that a worker may take for a cell
FIELD = {"actors": 6, "cells": 30, "steps": 8}  # field of the scaling experiment


def paper(
    *,
    out: Annotated[Path, Parameter(help="folder for tables, figures, plans and certificates")],
    seeds: Annotated[str, Parameter(help="seeds of each scene")] = "0-29",
    robots: Annotated[str, Parameter(help="team sizes of the scaling experiment")] = "2,4,6,8,12",
    scaling_seeds: Annotated[str, Parameter(help="seeds of each team size")] = "0-4",
    time_limit: Annotated[float, positive_seconds(help="seconds for each plan")] = 60.0,
    bound_limit: Annotated[float, positive_seconds(help="seconds for each bound")] = 60.0,
    corridors: Annotated[
        int, Parameter(help="random corridors in the search for CoCap's largest gain")
    ] = 200,
    workers: Workers = None,
    stored: Annotated[
        bool, Parameter(negative="", help="only write the page of the stored results")
    ] = False,
) -> int:
    """Computes missing results, and writes paper.md and its figures."""
    if stored:
        make_folder(out)
        page = Page(read_rows(STORED / "paper.csv"), read_trials(STORED / "paper-conditions.csv"))
        save_bytes(out / _PAGE, page.text().encode())
        return 0
    sizes = Option("--robots").numbers(robots)
    if min(sizes) < 1:
        raise UsageError(f"--robots: must be at least 1, not {min(sizes)}")
    search = CorridorSearch.of(Option("--corridors").require_whole(corridors))
    settings = Settings(time_limit=time_limit, bound_time_limit=bound_limit)
    main = _scenes(Option("--seeds").numbers(seeds), settings)
    teams = _teams(sizes, Option("--scaling-seeds").numbers(scaling_seeds), settings)
    rows = _swept(out / "scenes", main, workers)
    whole = [instance for instance in main if instance.is_whole]
    is_interrupted = len(whole) < len(main)
    team_rows = [] if is_interrupted else _swept(out / "scaling", teams, workers)
    if whole:
        measured = completed(whole, time_limit, out)
        trials = [] if is_interrupted else _searched(out / CONDITIONS, search)
        missing = sum(not instance.is_whole for instance in (*main, *teams))
        _write(out, whole, measured, team_rows, sizes, trials, missing)
    return int(any(row.has_error for row in (*rows, *team_rows)))


def _scenes(seeds: Sequence[int], settings: Settings) -> list[Instance]:
    problems = [(load_scene(scene, seed), seed) for scene in SCENES for seed in seeds]
    return [Instance(problem, seed, _planners_of(problem), settings) for problem, seed in problems]


def _teams(sizes: Sequence[int], seeds: Sequence[int], settings: Settings) -> list[Instance]:
    """Returns the instances of the scaling experiment."""
    return [
        Instance(
            field(seed, robots=n, **FIELD).replace(name=f"field, {n} drones"), seed,
            _SCALING, settings,
        )
        for n in sizes
        for seed in seeds
    ]  # fmt: skip


def _searched(path: Path, search: CorridorSearch) -> list[Trial]:
    """Returns the trials in the file; without a file, searches for where CoCap gains most."""
    if search.drawn and not path.exists():
        save_csv(path, [trial.record for trial in search.trials(0, say)])
    return read_trials(path) if path.exists() else []


def _planners_of(problem: Problem) -> tuple[str, ...]:
    """Returns all planners that support so many drones."""
    return tuple(name for name in PLANNERS if name != "joint" or len(problem.robots) <= 2)


def _write(
    out: Path,
    instances: Sequence[Instance],
    rows: Sequence[GapRow],
    team_rows: Sequence[GapRow],
    sizes: Sequence[int],
    trials: Sequence[Trial],
    missing: int,
) -> None:
    """Writes the page and its figures from the complete instances."""
    results = Results(out)
    searched = [i for i in instances if i.problem.name in _ENCOUNTERS]
    giving, found = _giving_way(searched)
    example = Encounter.most_generous(found["cocap"])
    rewards = _curves(instances)
    results.save(CURVES, rewards)
    figures: dict[str, Callable[[], Figure]] = {
        "curves.png": lambda: curves_figure(curves_of(rewards)),
        "ablation.png": lambda: ablation_figure(effects_of(rows)),
    }
    if example is not None:
        figures["giving-way.png"] = partial(_example, searched, example)
    if trials:
        figures["conditions.png"] = partial(conditions_figure, trials)
    if team_rows:
        figures["scaling.png"] = lambda: scaling_figure(_points(team_rows, sizes))
    for name, figure in figures.items():
        results.draw(name, figure)
    page = Page(rows, trials, team_rows, giving, example, missing, figures)
    save_bytes(out / _PAGE, page.text().encode())


def effects_of(rows: Sequence[GapRow]) -> dict[str, list[tuple[str, Mean]]]:
    """Returns, by part, what the part adds on each scene, and on all scenes."""
    return {
        f"{contrast.part}\n{contrast.words}": [
            (effect.scene, effect.mean) for effect in Effect.all_of(rows, contrast) if effect.mean
        ]
        for contrast in CONTRASTS
    }


def _swept(folder: Path, instances: Sequence[Instance], workers: int | None) -> list[GapRow]:
    return sweep(instances, folder, Hired(workers, None, _AT_A_TIME))


def _curves(instances: Sequence[Instance]) -> list[StepReward]:
    """Returns the rewards per step of the planners whose curves are drawn."""
    return [
        reward
        for planner in DRAWN_AS_CURVES
        for instance in instances
        if (plan := instance.plan(planner)) is not None
        for reward in StepReward.all_of(instance.problem, instance.seed, planner, plan)
    ]


def _giving_way(instances: Sequence[Instance]) -> tuple[Table, dict[str, list[Encounter]]]:
    """Returns the encounters by planner, over all scenes, and their table."""
    found: dict[str, list[Encounter]] = {"sequential": [], "cocap": []}
    for instance in instances:
        unconstrained = instance.plan("greedy")
        for planner, encounters in found.items():
            plan = instance.plan(planner)
            if unconstrained is not None and plan is not None:
                encounters += Encounter.all_of(instance.problem, instance.seed, unconstrained, plan)
    return [Encounter.counted(*planned) for planned in found.items()], found


def _example(instances: Sequence[Instance], example: Encounter) -> Figure:
    """Draws an encounter in the plans of three planners."""
    where = (example.scene, example.seed)
    instance = next(instance for instance in instances if instance.key == where)
    plans = {name: instance.plan(name) for name in ("greedy", "sequential", "cocap")}
    shown = {name: plan for name, plan in plans.items() if plan is not None}
    return encounter_figure(instance.problem, example, shown)


def _points(
    rows: Sequence[GapRow], sizes: Sequence[int]
) -> dict[str, list[tuple[int, float, float]]]:
    """Returns median seconds and mean reward per planner and team size.

    Rewards are in % of the bound without rules, which also holds for plans with conflicts. So all
    seeds count for each planner that has a plan for every seed.
    """
    points: dict[str, list[tuple[int, float, float]]] = {}
    for planner in _SCALING:
        for n in sizes:
            of_size = [r for r in rows if (r.planner, r.robots) == (planner, n)]
            shares = [
                100 * r.reward / r.bound_free
                for r in of_size
                if r.reward is not None and r.bound_free is not None
            ]
            if of_size and len(shares) == len(of_size):
                seconds = median(GapRow.values(of_size, "seconds"))
                points.setdefault(planner, []).append((n, seconds, Mean.of(shares).value))
    return points
