"""All of the paper's experiments, computed by sweeps and written as one page with its figures."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.stored_results import STORED
from cocap_opt.experiments.lab.studies.paper.ablation import CONTRASTS, Effect
from cocap_opt.experiments.lab.studies.paper.conditions import Search, Trial, read_trials
from cocap_opt.experiments.lab.studies.paper.curves import CURVES, StepReward, curves_of
from cocap_opt.experiments.lab.studies.paper.figures import (
    ablation_figure,
    conditions_figure,
    curves_figure,
    encounter_figure,
    scaling_figure,
)
from cocap_opt.experiments.lab.studies.paper.giving_way import Encounter
from cocap_opt.experiments.lab.studies.paper.measured import MEASURED, completed, read_rows
from cocap_opt.experiments.lab.studies.paper.page import Page
from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.sweeps.sweep import Hired, sweep
from cocap_opt.experiments.tables.rows import Row
from cocap_opt.experiments.tables.statistics import Mean
from cocap_opt.experiments.tables.tables import Table
from cocap_opt.output.files import make_folder, save_bytes, save_csv
from cocap_opt.pictures.figures import picture
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.built_in.field import field

SCENES = ("corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage")
_ENCOUNTERS = ("corridor", "bottleneck")  # scenes in which it is asked who gives way
DRAWN_AS_CURVES = ("greedy", "sequential", "cocap", "cocap-vs", "cocap-lns")
_SCALING = ("greedy", "sequential", "cocap", "cocap-vs", "cocap-lns")
CONDITIONS = "conditions.csv"
_AT_A_TIME = 3600.0  # s, that a worker may take for a cell
FIELD = {"actors": 6, "cells": 30, "steps": 8}  # of the scaling experiment


def reproduce(
    out: Path,
    seeds: Sequence[int],
    sizes: Sequence[int],
    scaling_seeds: Sequence[int],
    limit: float,
    bound_limit: float,
    search: Search,
    workers: int | None,
) -> bool:
    """Computes what is missing, and writes paper.md and its figures.

    Parameters
    ----------
    sizes : of the teams in the scaling experiment
    limit, bound_limit : s, of each plan and of each bound
    search : extent of the search for where CoCap gains most
    workers : processes; None for this one

    Returns
    -------
    bool
        True if no cell ended by an error.
    """
    settings = Settings(time_limit=limit, bound_time_limit=bound_limit)
    problems = [(load_scene(scene, seed), seed) for scene in SCENES for seed in seeds]
    main = [Instance(problem, seed, _planners_of(problem), settings) for problem, seed in problems]
    teams = [
        Instance(
            field(seed, robots=n, **FIELD).replace(name=f"field, {n} drones"), seed,
            _SCALING, settings,
        )
        for n in sizes
        for seed in scaling_seeds
    ]  # fmt: skip
    rows = _swept(out / "scenes", main, workers)
    whole = [one for one in main if one.is_whole]
    interrupted = len(whole) < len(main)
    team_rows = [] if interrupted else _swept(out / "scaling", teams, workers)
    if whole:
        measured = completed(whole, limit, out / MEASURED, say)
        trials = [] if interrupted else _searched(out / CONDITIONS, search)
        missing = sum(not one.is_whole for one in (*main, *teams))
        _write(out, whole, measured, team_rows, sizes, trials, missing)
    return not any(row.has_error for row in (*rows, *team_rows))


def write_stored_page(out: Path) -> None:
    """Writes paper.md from the results that are stored with the code."""
    make_folder(out)
    page = Page(read_rows(STORED / "paper.csv"), read_trials(STORED / "paper-conditions.csv"))
    save_bytes(out / "paper.md", page.text().encode())


def _searched(path: Path, search: Search) -> list[Trial]:
    """Returns the trials of the file, or else searches for where CoCap gains most."""
    if not (search.drawn or path.exists()):
        return []
    if not path.exists():
        records = [trial.record for trial in search.trials(0, say)]
        save_csv(path, records)
    return read_trials(path)


def _planners_of(problem: Problem) -> tuple[str, ...]:
    """Returns all planners but those that do not take so many drones."""
    return tuple(name for name in PLANNERS if name != "joint" or len(problem.robots) <= 2)


def _write(
    out: Path,
    instances: Sequence[Instance],
    rows: Sequence[Row],
    team_rows: Sequence[Row],
    sizes: Sequence[int],
    trials: Sequence[Trial],
    missing: int,
) -> None:
    """Writes the page and its figures from the instances that are whole."""
    some = [one for one in instances if one.problem.name in _ENCOUNTERS]
    giving, found = _giving_way(some)
    example = Encounter.most_generous(found["cocap"])
    rewards = _curves(instances)
    save_csv(out / CURVES, [one._asdict() for one in rewards])
    figures = {
        "curves.png": picture(curves_figure(curves_of(rewards)), ".png"),
        "ablation.png": picture(ablation_figure(effects_of(rows)), ".png"),
    }
    if example is not None:
        figures["giving-way.png"] = _example(some, example)
    if trials:
        figures["conditions.png"] = picture(conditions_figure(trials), ".png")
    if team_rows:
        figures["scaling.png"] = picture(scaling_figure(_points(team_rows, sizes)), ".png")
    for name, content in figures.items():
        save_bytes(out / name, content)
    page = Page(rows, trials, team_rows, giving, example, missing, figures)
    save_bytes(out / "paper.md", page.text().encode())


def effects_of(rows: Sequence[Row]) -> dict[str, list[tuple[str, Mean]]]:
    """Returns by part what it adds on each scene, and on all."""
    return {
        f"{one.part}\n{one.words}": [
            (effect.scene, effect.mean) for effect in Effect.all_of(rows, one) if effect.mean
        ]
        for one in CONTRASTS
    }


def _swept(folder: Path, instances: Sequence[Instance], workers: int | None) -> list[Row]:
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
        for planner, some in found.items():
            plan = instance.plan(planner)
            if unconstrained is not None and plan is not None:
                some += Encounter.all_of(instance.problem, instance.seed, unconstrained, plan)
    return [Encounter.counted(planner, some) for planner, some in found.items()], found


def _example(instances: Sequence[Instance], example: Encounter) -> bytes:
    """Returns the picture of an encounter in the plans of three planners."""
    where = (example.scene, example.seed)
    instance = next(one for one in instances if one.key == where)
    plans = {name: instance.plan(name) for name in ("greedy", "sequential", "cocap")}
    shown = {name: plan for name, plan in plans.items() if plan is not None}
    return picture(encounter_figure(instance.problem, example, shown), ".png")


def _points(rows: Sequence[Row], sizes: Sequence[int]) -> dict[str, list[tuple[int, float, float]]]:
    """Returns median seconds and mean reward (% of the free bound) per planner and team size.

    That bound holds for plans with conflicts, too, so that all seeds count for every planner
    that has a plan on each.
    """
    points: dict[str, list[tuple[int, float, float]]] = {}
    for planner in _SCALING:
        for n in sizes:
            own = [r for r in rows if (r.planner, r.robots) == (planner, n)]
            shares = [
                100 * r.reward / r.bound_free
                for r in own
                if r.reward is not None and r.bound_free is not None
            ]
            if own and len(shares) == len(own):
                seconds = median(Row.values(own, "seconds"))
                points.setdefault(planner, []).append((n, seconds, Mean.of(shares).value))
    return points
