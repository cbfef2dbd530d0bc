"""Measures what it costs that drones keep apart: J and time by their separation, certified."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.stored_results import STORED
from cocap_opt.experiments.lab.studies.runs import Run
from cocap_opt.experiments.lab.studies.separation.points import Point
from cocap_opt.experiments.lab.studies.separation.tables import separation_in_markdown
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.result import CertifiedResult, Report, silent
from cocap_opt.output.files import (
    make_folder,
    save_bytes,
    save_csv,
)
from cocap_opt.output.printing import Listing, print_texts
from cocap_opt.pictures.figures import picture
from cocap_opt.planners import RECOMMENDED
from cocap_opt.planners.cocap import cocap
from cocap_opt.problem import CollisionRules, Plan, Problem, Robot
from cocap_opt.result import Result
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, Stop, never

TABLE = "separation.csv"


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
    separations : m; 0 stands for the scene's own rules (`vertex+swap` of built-in scenes, `vertex`
        of Greedy Perspectives'), with which the others are compared
    limit : s, of each plan and of each proof

    Returns
    -------
    bool
        True if no run failed.

    Raises
    ------
    FileError
        If a scene has no room for the widest separation.
    """
    metres = sorted({0.0, *separations})
    for scene in scenes:
        for seed in seeds:
            built(scene, seed, 0.0, metres[-1])  # what has no room is told before hours of work
    make_folder(out)
    points: list[Point] = []
    whole = True
    try:
        for scene in scenes:
            for seed in seeds:
                own = _measured(scene, seed, metres, limit)
                points += own
                whole = whole and len(own) == len(metres)
                if out is not None and points:
                    save_csv(out / TABLE, [one._asdict() for one in points])
    finally:
        Listing(
            f"price of a separation (* stopped at {limit:g} s; price in % of the J "
            "without one, certified)",
            Point.listed(points),
        ).print()
    if out is not None and points:
        _draw(points, out)
    return whole


def tell_stored(out: Path | None = None) -> None:
    """Prints the tables of the stored results, and draws the figure into a folder."""
    points = Point.read(STORED / TABLE)
    print_texts([separation_in_markdown(points)], [])
    if out is not None:
        make_folder(out)
        _draw(points, out)


def _draw(points: Sequence[Point], out: Path) -> None:
    from cocap_opt.experiments.lab.studies.separation.figure import separation_figure

    save_bytes(out / "separation.png", picture(separation_figure(points), ".png"))


def _measured(scene: str, seed: int, separations: Sequence[float], limit: float) -> "list[Point]":
    """Plans and proves at each separation; those that fail are told, and left out.

    Where it fails without a separation, there is nothing to compare with: all are left out.
    """
    builds = [partial(built, scene, seed, apart, max(separations)) for apart in separations]
    runs = {
        name: list(Run.each(builds, method, limit))
        for name, method in (
            ("cocap", _cocap),
            (RECOMMENDED, _cocap_lns),
            ("proof", branch_and_price),
        )
    }
    points = []
    for k, apart in enumerate(separations):
        outcomes = {name: own[k] for name, own in runs.items()}
        for name, outcome in outcomes.items():
            if isinstance(outcome, Run.Error):
                say(f"{scene} seed {seed}, {apart:g} m, {name}: {outcome}")
            else:
                outcome.told(f"{scene}, {apart:g} m, {name}", seed)
        done = {name: one for name, one in outcomes.items() if isinstance(one, Run)}
        if len(done) == len(outcomes):
            points.append(_point(builds[0]().name, seed, apart, done))
    return points if points and not points[0].separation else []


def _point(scene: str, seed: int, apart: float, done: dict[str, Run]) -> Point:
    """Returns the measurements at one separation."""
    plan, lns, proof = done["cocap"], done[RECOMMENDED], done["proof"]
    return Point(
        scene=scene, seed=seed, separation=apart,
        cocap=plan.value, cocap_seconds=plan.seconds, cocap_limit=Limit.written(plan.limit),
        lns=lns.value, lns_seconds=lns.seconds, lns_limit=Limit.written(lns.limit),
        best=max(plan.value, lns.value, proof.value), bound=proof.bound,
        proof_seconds=proof.seconds, proof_limit=Limit.written(proof.limit),
    )  # fmt: skip


def _cocap(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """CoCap in the form of a method of bounds, of which it has none."""
    return _without_bound(cocap(problem, stop))


def _cocap_lns(
    problem: Problem, stop: Stop = never, start: Plan | None = None, report: Report = silent
) -> CertifiedResult:
    """The recommended planner in the same form."""
    return _without_bound(run(problem, RECOMMENDED, stop).result)


def _without_bound(result: Result) -> CertifiedResult:
    return CertifiedResult(
        result.plan, result.value, result.reason, result.limit, seconds=result.seconds
    )


def built(scene: str, seed: int, apart: float, widest: float) -> Problem:
    """Builds a scene with a separation, and with starts that allow the widest one.

    Starts are the same at all separations, so that only the rules differ: each robot begins in
    the free cell nearest to its own start that keeps the widest separation to the earlier ones.

    Raises
    ------
    FileError
        If no cell does.
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
    for number, robot in enumerate(problem.robots):
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
            raise FileError(
                f"{problem.name}: no free cell for drone {number} to start in that is {apart:g} m "
                "from the drones before it; take smaller separations"
            )
    return tuple(placed)
