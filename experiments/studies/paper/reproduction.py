"""All of the paper's experiments, computed by sweeps and written as one page with its figures."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

from cocap_opt.experiments.report.figures import picture
from cocap_opt.experiments.results.files import save_bytes
from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.results.statistics import Mean
from cocap_opt.experiments.results.tables import Table, Tables
from cocap_opt.experiments.studies.paper.answers import SOURCE, SceneAnswers
from cocap_opt.experiments.studies.paper.figures import (
    curves_figure,
    encounter_figure,
    scaling_figure,
)
from cocap_opt.experiments.studies.paper.giving_way import Encounter
from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.sweeps.sweep import Hired, sweep
from cocap_opt.model import Model
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.built_in.field import field
from cocap_opt.stop import Clock, never

SCENES = ("corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage")
_ENCOUNTERS = ("corridor", "bottleneck")  # scenes in which it is asked who gives way
_CURVES = ("greedy", "sequential", "cocap", "cocap-vs", "cocap-lns")
_SCALING = ("greedy", "sequential", "cocap", "cocap-vs", "cocap-lns")
_AT_A_TIME = 3600.0  # s, that a worker may take for a cell
FIELD = {"actors": 6, "cells": 30, "steps": 8}  # of the scaling experiment


def reproduce(
    out: Path,
    seeds: Sequence[int],
    sizes: Sequence[int],
    scaling_seeds: Sequence[int],
    limit: float,
    bound_limit: float,
    workers: int | None,
) -> bool:
    """Computes what is missing, and writes paper.md and its figures.

    Parameters
    ----------
    sizes : of the teams in the scaling experiment
    limit, bound_limit : s, of each plan and of each bound
    workers : processes; None for this one

    Returns
    -------
    bool
        True if no cell ended by an error.
    """
    settings = Settings(time_limit=limit, bound_time_limit=bound_limit)
    problems = [(load_scene(scene, seed), seed) for scene in SCENES for seed in seeds]
    main = [
        Instance(problem, seed, planners_of(problem), settings) for problem, seed in problems
    ]
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
        missing = sum(not one.is_whole for one in (*main, *teams))
        _write(out, whole, rows, team_rows, sizes, limit, missing)
    return not any(row.has_error for row in (*rows, *team_rows))


def planners_of(problem: Problem) -> tuple[str, ...]:
    """Returns all planners but those that do not take so many drones."""
    return tuple(name for name in PLANNERS if name != "joint" or len(problem.robots) <= 2)


def _write(
    out: Path,
    instances: Sequence[Instance],
    rows: Sequence[Row],
    team_rows: Sequence[Row],
    sizes: Sequence[int],
    limit: float,
    missing: int,
) -> None:
    """Writes the page and its figures from the instances that are whole."""
    giving, found = _giving_way(instances)
    example = Encounter.most_generous(found["cocap"])
    figures = {"curves.png": picture(curves_figure(_curves(instances)), ".png")}
    if example is not None:
        figures["giving-way.png"] = _example(instances, example)
    if team_rows:
        figures["scaling.png"] = picture(scaling_figure(_points(team_rows, sizes)), ".png")
    for name, content in figures.items():
        save_bytes(out / name, content)
    page = _page(rows, team_rows, giving, example, limit, missing)
    save_bytes(out / "paper.md", page.encode())


def _swept(folder: Path, instances: Sequence[Instance], workers: int | None) -> list[Row]:
    return sweep(instances, folder, Hired(workers, None, _AT_A_TIME))


def _curves(instances: Sequence[Instance]) -> dict[str, dict[str, list[Sequence[float]]]]:
    """Returns the reward per step by scene and planner, a curve per seed."""
    curves: dict[str, dict[str, list[Sequence[float]]]] = {}
    for instance in instances:
        planners = curves.setdefault(instance.problem.name, {name: [] for name in _CURVES})
        for planner, seen in planners.items():
            if (plan := instance.plan(planner)) is not None:
                seen.append(check(instance.problem, plan).reward_per_step)
    return curves


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


def _coverage_seconds(problem: Problem) -> float:
    """Returns the seconds that coverage of all states takes on one thread, a median of three."""
    return median(_timed(Model(problem, use_cache=False)) for _ in range(3))


def _timed(model: Model) -> float:
    clock = Clock()
    model.prepare_all(never)
    return clock.seconds


def _page(
    rows: Sequence[Row],
    team_rows: Sequence[Row],
    giving: Table,
    example: Encounter | None,
    limit: float,
    missing: int,
) -> str:
    """Returns the page in Markdown."""
    scenes = SceneAnswers.all_of(rows)
    comparison = [row for answers in scenes for row in answers.comparison()]
    questions: Mapping[str, list[str]] = {
        "Does CoCap come close to unconstrained performance?": [a.closeness() for a in scenes],
        "Does CoCap outperform sequential planning?": [a.against_sequential() for a in scenes],
        "When does sequential planning fail?": [a.sequential_failures() for a in scenes],
        "Is view search faster?": [
            a.times(_coverage_seconds(load_scene(a.scene, a.rows[0].seed or 0))) for a in scenes
        ],
    }
    parts = ["# The CoCap paper, reproduced and answered\n"]
    if missing:
        parts.append(f"**Unfinished: {missing} of the scenes and seeds are not computed yet.**\n")
    for question, sentences in questions.items():
        parts.append(f"## {question}\n\n" + "".join(f"- {words}\n" for words in sentences))
    parts.append(Tables({"Published and measured": comparison}).markdown())
    parts.append(
        f"Published seconds: {SOURCE}, its corridor of 8 steps on the authors' machine; "
        "its rewards are of scenes that were not published. Intervals: 95 %, Student's t.\n"
    )
    parts.append("## Reward per step\n\n![Reward per step](curves.png)\n")
    parts.append(Tables({"Who gives way": giving}).markdown())
    parts.append(_story(example))
    tables = Tables.of(rows)
    shown = ("Planners", "Price of collision avoidance")
    parts.append(Tables({title: tables[title] for title in shown if title in tables}).markdown())
    if team_rows:
        parts.append("## Scaling\n\n![Time and reward against team size](scaling.png)\n")
        parts.append("".join(f"- {a.scaling(limit)}\n" for a in SceneAnswers.all_of(team_rows)))
        parts.append(Tables({"Team sizes": Tables.of(team_rows)["Planners"]}).markdown())
    return "\n".join(parts)


def _story(example: Encounter | None) -> str:
    """Returns the sentences about the encounter in which most is given up."""
    if example is None:
        return "No earlier drone gave up any of its own reward in these scenes.\n"
    i, k = example.robots
    return (
        f"Seed {example.seed}: drones {i} and {k} would collide at step {example.step}. With CoCap "
        f"drone {i}, which is planned first, gives way and has "
        f"{100 * example.given_up[0]:.2f} % less of its own reward, drone {k} "
        f"{100 * example.given_up[1]:.2f} % less; J of the team is {example.team:,.1f}.\n\n"
        "![The encounter in three plans](giving-way.png)\n"
    )
