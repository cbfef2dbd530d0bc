"""The price of keeping drones apart: certified J, and time, by separation."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results
from cocap_opt.experiments.lab.studies.options import Out, Scenes, Seeds, positive_seconds
from cocap_opt.experiments.lab.studies.runs import Run
from cocap_opt.experiments.lab.studies.separation.points import SeparationPoint
from cocap_opt.experiments.lab.studies.separation.tables import separation_in_markdown
from cocap_opt.files.documents import FileError
from cocap_opt.output.printing import Listing, print_texts
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import CollisionRules, Problem, Robot, State
from cocap_opt.run.engine import BOUND_METHOD
from cocap_opt.run.options import Option, UsageError
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit

_TABLE, _FIGURE = "separation.csv", "separation.png"
_SCENES = ("corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage", "field")


def separation(
    *,
    scene: Scenes = None,
    seeds: Seeds = "0-2",
    metres: Annotated[
        list[float] | None,
        Parameter(negative="", consume_multiple=True, help="separations, m (default: 0.5 1 2 3)"),
    ] = None,
    limit: Annotated[float, positive_seconds(help="seconds for each plan and each proof")] = 60.0,
    out: Out = None,
    stored: Annotated[
        bool, Parameter(negative="", help="only print tables and figure of the stored runs")
    ] = False,
) -> int:
    """Measures, prints, and writes the table (separation.csv) and the figure (separation.png).

    The reference has no separation, only the scene's rules: `vertex+swap` in built-in scenes,
    `vertex` in scenes of Greedy Perspectives.
    """
    if stored:
        points = SeparationPoint.read(STORED / _TABLE)
        print_texts([separation_in_markdown(points)], [])
        _draw(points, Results.into(out))
        return 0
    wanted = metres or [0.5, 1.0, 2.0, 3.0]
    if not all(apart > 0 and math.isfinite(apart) for apart in wanted):
        raise UsageError("--metres: must be positive numbers")
    instances = [
        (name, seed) for name in scene or _SCENES for seed in Option("--seeds").numbers(seeds)
    ]
    separations = sorted({0.0, *wanted})
    for instance in instances:
        built(*instance, 0.0, separations[-1])  # fails before hours of work if there is no room
    results, points, is_whole = Results.into(out), list[SeparationPoint](), True
    try:
        for instance in instances:
            measured = _measured(*instance, separations, limit)
            points += measured
            is_whole = is_whole and len(measured) == len(separations)
            results.save(_TABLE, points)
    finally:
        Listing(
            f"price of a separation (* stopped at {limit:g} s; price in % of the J "
            "without one, certified)",
            SeparationPoint.listed(points),
        ).print()
    if points:
        _draw(points, results)
    return 0 if is_whole else 1


def _draw(points: Sequence[SeparationPoint], results: Results) -> None:
    # Imported here, as measuring processes load this module, and their memory is reported.
    from cocap_opt.experiments.lab.studies.separation.figure import separation_figure

    results.draw(_FIGURE, partial(separation_figure, points))


def _measured(
    scene: str, seed: int, separations: Sequence[float], limit: float
) -> "list[SeparationPoint]":
    """Plans and proves at each separation; separations that fail are reported and omitted.

    If it fails without a separation, there is no reference, so all are omitted.
    """
    builds = [partial(built, scene, seed, apart, max(separations)) for apart in separations]
    methods = ("cocap", RECOMMENDED, BOUND_METHOD)
    runs = {method: list(Run.each(builds, method, limit)) for method in methods}
    points = []
    for k, apart in enumerate(separations):
        outcomes = {name: of_method[k] for name, of_method in runs.items()}
        for name, outcome in outcomes.items():
            if isinstance(outcome, Run.Error):
                say(f"{scene} seed {seed}, {apart:g} m, {name}: {outcome}")
            else:
                outcome.told(f"{scene}, {apart:g} m, {name}", seed)
        done = {name: outcome for name, outcome in outcomes.items() if isinstance(outcome, Run)}
        if len(done) == len(outcomes):
            points.append(_point(builds[0]().name, seed, apart, done))
    return points if points and not points[0].separation else []


def _point(scene: str, seed: int, apart: float, done: dict[str, Run]) -> SeparationPoint:
    """Returns the measurements at one separation."""
    plan, lns, proof = done["cocap"], done[RECOMMENDED], done[BOUND_METHOD]
    return SeparationPoint(
        scene=scene, seed=seed, separation=apart,
        cocap=plan.value, cocap_seconds=plan.seconds, cocap_limit=Limit.written(plan.limit),
        lns=lns.value, lns_seconds=lns.seconds, lns_limit=Limit.written(lns.limit),
        best=max(plan.value, lns.value, proof.value), bound=proof.bound,
        proof_seconds=proof.seconds, proof_limit=Limit.written(proof.limit),
    )  # fmt: skip


def built(scene: str, seed: int, apart: float, widest: float) -> Problem:
    """Builds a scene with a separation, and with starts that allow the widest one.

    Starts are the same at all separations, so that only the rules differ: each robot starts in the
    free cell nearest to its own start that keeps the widest separation from earlier robots.

    Raises
    ------
    FileError
        If there is no such cell.
    """
    problem = load_scene(scene, seed)
    rules = problem.rules if problem.rules.vertex else CollisionRules()
    return problem.replace(
        robots=_spread(problem, widest),
        rules=rules if not apart else rules.replace(separation=apart),
    )


def _spread(problem: Problem, apart: float) -> tuple[Robot, ...]:
    """Returns the robots with starts that are so far apart (m)."""
    rules, placed = CollisionRules(separation=apart), list[tuple[Robot, State]]()
    for number, (robot, start) in enumerate(zip(problem.robots, problem.first_starts, strict=True)):
        free = robot.motion.free_places(problem.workspace)[start.layer]
        cells = np.argwhere(free)
        far = np.hypot(*(cells - [start.x, start.y]).T)
        for x, y in cells[np.argsort(far, kind="stable")].tolist():
            moved = start._replace(x=x, y=y)
            here = x, y, robot.motion.layers[start.layer]
            ways = [
                problem.height_map.way(here, (at.x, at.y, other.motion.layers[at.layer]))
                for other, at in placed
            ]
            if not any(bool(rules.too_near(np.array(way))) for way in ways):
                placed.append((robot.replace(start=moved), moved))
                break
        else:
            raise FileError(
                f"{problem.name}: no free cell for drone {number} to start in that is {apart:g} m "
                "from the drones before it; use smaller separations"
            )
    return tuple(robot for robot, _ in placed)
