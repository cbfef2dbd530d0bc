"""Measures what it costs that drones keep apart: J and time by their separation, certified."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.report.figures import picture
from cocap_opt.experiments.results.files import make_folder, save_bytes, save_csv
from cocap_opt.experiments.results.printing import Listing
from cocap_opt.experiments.studies.runs import Run
from cocap_opt.experiments.studies.separation.points import Point
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.result import CertifiedResult, Report, silent
from cocap_opt.planners.cocap import cocap
from cocap_opt.problem import CollisionRules, Plan, Problem, Robot
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Stop, never


def separation(
    scenes: Sequence[str],
    seeds: Sequence[int],
    separations: Sequence[float],
    limit: float,
    out: Path | None = None,
) -> bool:
    """Measures, prints, and writes the table (separation.csv) and the figure (separation.png).

    Parameters
    ----------
    separations : m; 0 stands for the papers' rules, with which the others are compared
    limit : s, of each plan and of each proof

    Returns
    -------
    bool
        True if no run failed.
    """
    make_folder(out)
    points: list[Point] = []
    whole = True
    try:
        for scene in scenes:
            for seed in seeds:
                for apart in sorted({0.0, *separations}):
                    point = _measured(scene, seed, apart, max(separations), limit)
                    points += [] if point is None else [point]
                    whole = whole and point is not None
                    if out is not None and points:
                        save_csv(out / "separation.csv", [one._asdict() for one in points])
    finally:
        Listing(
            f"price of a separation (* stopped at {limit:g} s; price in % of the J under the "
            "papers' rules, certified)",
            Point.listed(points),
        ).print()
    if out is not None and points:
        from cocap_opt.experiments.studies.separation.figure import separation_figure

        save_bytes(out / "separation.png", picture(separation_figure(points), ".png"))
    return whole


def _measured(scene: str, seed: int, apart: float, widest: float, limit: float) -> Point | None:
    """Plans with CoCap and proves; returns None if that failed."""
    build = partial(built, scene, seed, apart, widest)
    try:
        plan = Run.of(build, _cocap, limit).told(f"{scene}, {apart:g} m, cocap", seed)
        proof = Run.of(build, branch_and_price, limit).told(f"{scene}, {apart:g} m, proof", seed)
    except Run.Error as error:
        say(f"{scene} seed {seed}, {apart:g} m: {error}")
        return None
    return Point(
        scene=build().name, seed=seed, separation=apart,
        cocap=plan.value, cocap_seconds=plan.processor, cocap_limit=str(plan.limit),
        best=max(plan.value, proof.value), bound=proof.bound,
        proof_seconds=proof.processor, proof_limit=str(proof.limit),
    )  # fmt: skip


def _cocap(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """CoCap in the form of a method of bounds, of which it has none."""
    result = cocap(problem, stop)
    return CertifiedResult(
        result.plan, result.value, result.reason, result.limit, seconds=result.seconds
    )


def built(scene: str, seed: int, apart: float, widest: float) -> Problem:
    """Builds a scene with a separation, and with starts that allow the widest one.

    Starts are the same at all separations, so that only the rules differ: each robot begins in
    the free cell nearest to its own start that keeps the widest separation to the earlier ones.
    """
    problem = load_scene(scene, seed)
    own = problem.rules if problem.rules.vertex else CollisionRules()
    return problem.replace(
        robots=_spread(problem, widest),
        rules=own if not apart else own.replace(separation=apart),
    )


def _spread(problem: Problem, apart: float) -> tuple[Robot, ...]:
    """Returns the robots with starts that are so far apart (m)."""
    rules, placed = CollisionRules(separation=apart), list[Robot]()
    for robot in problem.robots:
        start, free = robot.start, robot.motion.free_places(problem.workspace)[robot.start.layer]
        cells = np.argwhere(free)
        far = np.hypot(*(cells - [start.x, start.y]).T)
        for x, y in cells[np.argsort(far, kind="stable")].tolist():
            own = start._replace(x=x, y=y)
            taken = ((one, one.motion.layers[one.start.layer]) for one in placed)
            ways = [
                problem.height_map.way(
                    (x, y, robot.motion.layers[start.layer]), (one.start.x, one.start.y, height)
                )
                for one, height in taken
            ]
            if not any(bool(rules.too_near(np.array(way))) for way in ways):
                placed.append(robot.replace(start=own))
                break
        else:
            placed.append(robot)
    return tuple(placed)
