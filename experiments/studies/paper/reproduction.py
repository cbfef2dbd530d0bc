"""All of the paper's experiments: computed by sweeps, written as one page with its figures."""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median

from cocap_opt.check import check
from cocap_opt.experiments.report.figures import png
from cocap_opt.experiments.results.documents import markdown
from cocap_opt.experiments.results.files import save_bytes
from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.results.statistics import mean
from cocap_opt.experiments.results.tables import Table, grouped, planner_table, price_table, values
from cocap_opt.experiments.studies.paper import answers
from cocap_opt.experiments.studies.paper.figures import (
    curves_figure,
    encounter_figure,
    scaling_figure,
)
from cocap_opt.experiments.studies.paper.giving_way import Encounter, encounters, most_generous
from cocap_opt.experiments.sweeps.run import Group, Settings
from cocap_opt.experiments.sweeps.sweep import Hired, has_error, sweep
from cocap_opt.model import Model
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.built_in.field import field
from cocap_opt.stop import never

SCENES = ("corridor", "bottleneck")
PLANNERS = ("greedy", "sequential", "cocap", "cocap-vs")
AT_A_TIME = 3600.0  # s, that a worker may have for a cell
FIELD = {"actors": 6, "cells": 30, "steps": 8}  # of the scaling experiment


def reproduce(
    out: Path,
    seeds: Sequence[int],
    sizes: Sequence[int],
    scaling_seeds: Sequence[int],
    limit: float,
    workers: int | None,
) -> bool:
    """Compute what is missing, and write paper.md and its figures; whether nothing was an error."""
    settings = Settings(limit=limit, bound_limit=limit)
    main = [
        Group(load_scene(scene, seed), seed, PLANNERS, settings, {})
        for scene in SCENES
        for seed in seeds
    ]
    teams = [
        Group(
            field(seed, robots=n, **FIELD).replace(name=f"field, {n} robots"), seed,
            PLANNERS, settings, {},
        )
        for n in sizes
        for seed in scaling_seeds
    ]  # fmt: skip
    rows = _swept(out / "scenes", main, settings, workers)
    whole = [group for group in main if group.is_whole]
    interrupted = len(whole) < len(main)
    team_rows = [] if interrupted else _swept(out / "scaling", teams, settings, workers)
    if whole:
        missing = sum(not group.is_whole for group in (*main, *teams))
        _write(out, whole, rows, team_rows, sizes, limit, missing)
    return not any(map(has_error, (*rows, *team_rows)))


def _write(
    out: Path,
    groups: Sequence[Group],
    rows: Sequence[Row],
    team_rows: Sequence[Row],
    sizes: Sequence[int],
    limit: float,
    missing: int,
) -> None:
    """Write the page and its figures, of what there is."""
    giving, found = _giving_way(groups)
    example = most_generous(found["cocap"])
    figures = {"curves.png": png(curves_figure(_curves(groups)))}
    if example is not None:
        figures["giving-way.png"] = _example(groups, example)
    if team_rows:
        figures["scaling.png"] = png(scaling_figure(_points(team_rows, sizes)))
    for name, content in figures.items():
        save_bytes(out / name, content)
    page = _page(rows, team_rows, giving, example, limit, missing)
    save_bytes(out / "paper.md", page.encode())


def _swept(
    folder: Path, groups: Sequence[Group], settings: Settings, workers: int | None
) -> list[Row]:
    return sweep(groups, settings, folder, Hired(workers, None, AT_A_TIME))


def _plan(group: Group, planner: str) -> Plan | None:
    content = group.found[group.cells[planner]].plan
    return None if content is None else content.plan


def _curves(groups: Sequence[Group]) -> dict[str, dict[str, list[Sequence[float]]]]:
    """Reward per step by scene and planner, a curve per seed."""
    curves: dict[str, dict[str, list[Sequence[float]]]] = {}
    for group in groups:
        planners = curves.setdefault(group.problem.name, {name: [] for name in PLANNERS})
        for planner, seen in planners.items():
            if (plan := _plan(group, planner)) is not None:
                seen.append(check(group.problem, plan).reward_per_step)
    return curves


def _giving_way(groups: Sequence[Group]) -> tuple[Table, dict[str, list[Encounter]]]:
    """Encounters by planner, over all scenes, and their table."""
    found: dict[str, list[Encounter]] = {"sequential": [], "cocap": []}
    for group in groups:
        unconstrained = _plan(group, "greedy")
        for planner, some in found.items():
            plan = _plan(group, planner)
            if unconstrained is not None and plan is not None:
                some += encounters(group.problem, group.seed, unconstrained, plan)
    return [answers.giving_table(planner, some) for planner, some in found.items()], found


def _example(groups: Sequence[Group], example: Encounter) -> bytes:
    """The encounter in the plans of three planners."""
    where = (example.scene, example.seed)
    group = next(group for group in groups if (group.problem.name, group.seed) == where)
    plans = {name: _plan(group, name) for name in ("greedy", "sequential", "cocap")}
    shown = {name: plan for name, plan in plans.items() if plan is not None}
    return png(encounter_figure(group.problem, example, shown))


def _points(rows: Sequence[Row], sizes: Sequence[int]) -> dict[str, list[tuple[int, float, float]]]:
    """Per planner and team size: median seconds, mean share of the free bound in %.

    That bound holds for plans with conflicts, too, so that all seeds count for every planner
    that has a plan on each.
    """
    points: dict[str, list[tuple[int, float, float]]] = {}
    for planner in PLANNERS:
        for n in sizes:
            own = [r for r in rows if (r["planner"], r["robots"]) == (planner, n)]
            shares = [100 * r["reward"] / r["bound_free"] for r in own if r["reward"] is not None]
            if own and len(shares) == len(own):
                seconds = median(values(own, "seconds"))
                points.setdefault(planner, []).append((n, seconds, mean(shares).value))
    return points


def _coverage_seconds(problem: Problem) -> float:
    """What the coverage of all states takes on one thread."""
    return median(_timed(Model(problem, use_cache=False)) for _ in range(3))


def _timed(model: Model) -> float:
    begin = time.perf_counter()
    model.prepare_all(never)
    return time.perf_counter() - begin


def _page(
    rows: Sequence[Row],
    team_rows: Sequence[Row],
    giving: Table,
    example: Encounter | None,
    limit: float,
    missing: int,
) -> str:
    """The page in Markdown."""
    by_scene = {scene: some for (scene,), some in grouped(rows, "scene").items()}
    comparison = [row for s, some in by_scene.items() for row in answers.comparison_table(s, some)]
    questions: Mapping[str, list[str]] = {
        "Does CoCap come close to unconstrained performance?": [
            answers.closeness(scene, some) for scene, some in by_scene.items()
        ],
        "Does CoCap outperform sequential planning?": [
            answers.against_sequential(scene, some) for scene, some in by_scene.items()
        ],
        "When does sequential planning fail?": [
            answers.sequential_failures(scene, some) for scene, some in by_scene.items()
        ],
        "Is view search faster?": [
            answers.time_answer(scene, some, _coverage_seconds(load_scene(scene, some[0]["seed"])))
            for scene, some in by_scene.items()
        ],
    }
    parts = ["# The CoCap paper, reproduced and answered\n"]
    if missing:
        parts.append(f"**Unfinished: {missing} of the scenes and seeds are not computed yet.**\n")
    for question, sentences in questions.items():
        parts.append(f"## {question}\n\n" + "".join(f"- {words}\n" for words in sentences))
    parts.append(markdown({"Published and measured": comparison}))
    parts.append(
        f"Published seconds: {answers.SOURCE}, its corridor of 8 steps on the authors' machine; "
        "its rewards are of scenes that were not published. Intervals: 95 %, Student's t.\n"
    )
    parts.append("## Reward per step\n\n![Reward per step](curves.png)\n")
    parts.append(markdown({"Who gives way": giving}))
    parts.append(_story(example))
    parts.append(markdown({"Planners": planner_table(rows), "Price": price_table(rows)}))
    if team_rows:
        parts.append("## Scaling\n\n![Time and reward against team size](scaling.png)\n")
        parts.append("".join(f"- {words}\n" for words in answers.scaling_answer(team_rows, limit)))
        parts.append(markdown({"Team sizes": planner_table(team_rows)}))
    return "\n".join(parts)


def _story(example: Encounter | None) -> str:
    """The encounter in which most is given up, in words."""
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
