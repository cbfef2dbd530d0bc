"""The cost of coverage of all states that drones can reach on maps of 120 x 120 cells.

Each row is measured in its own process, with compiled code and without the cache, on all cores that
the process may use (`taskset -c 0` leaves one). The last columns are the time per state if states
are requested alone or a few at a time, as in a search.
"""

import multiprocessing
import resource
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from statistics import median
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.data import BoolArray
from cocap_opt.experiments.lab.results import Results, in_unit, markdown, stored_rows
from cocap_opt.experiments.lab.studies.coverage.town import town
from cocap_opt.experiments.lab.studies.options import Out
from cocap_opt.experiments.lab.studies.runs import BYTES, Build, Run
from cocap_opt.model import Model, RobotClass
from cocap_opt.output.printing import Listing, Record
from cocap_opt.problem import Problem
from cocap_opt.run.options import Option
from cocap_opt.scenarios.built_in.field import field
from cocap_opt.stop import Clock
from cocap_opt.vision.sights import KERNEL

_TABLE = "coverage.csv"
_CELLS, ACTORS, STEPS, _SEED = 120, 6, 60, 0
_AT_ONCE = 1, 10, 100  # numbers of neighbouring states that are requested at once
_REPEATS = 200
_ABOVE_ROOFS = 25.0  # m
HILL, _WIDE, _ROUGH = 8.0, 90.0, 0.3  # m: height and width of hills, roughness of the ground


def _above_roofs(problem: Problem) -> Problem:
    """Makes the same scene with all drones above all obstacles."""
    flights = [robot.motion.replace(layers=(_ABOVE_ROOFS,)) for robot in problem.robots]
    robots = zip(problem.robots, flights, strict=True)
    return problem.replace(robots=tuple(r.replace(motion=motion) for r, motion in robots))


def _on_hills(problem: Problem) -> Problem:
    """Makes the same scene on hills: drones keep their height above the ground."""
    flat, rng = problem.height_map, np.random.default_rng(_SEED)
    x, y = np.indices(flat.shape) * (2 * np.pi * flat.resolution / _WIDE)
    ground = HILL * np.sin(x) * np.cos(y) + _ROUGH * rng.random(flat.shape)
    actors = []
    for actor in problem.actors:
        cells = np.floor(actor.poses[:, :2] / flat.resolution).astype(np.int64)
        poses = actor.poses.copy()
        poses[:, 2] = ground[tuple(np.clip(cells, 0, np.array(flat.shape) - 1).T)]
        actors.append(actor.replace(poses=poses))
    hilly = flat.replace(heights=flat.heights + ground, datum=ground)
    return problem.replace(height_map=hilly, actors=tuple(actors))


def _as_it_is(problem: Problem) -> Problem:
    return problem


SCENES: dict[str, tuple[Callable[..., Problem], Callable[[Problem], Problem]]] = {
    "town, 1 m": (partial(town, cells=_CELLS, resolution=1.0), _as_it_is),
    "town, 2.5 m": (partial(town, cells=_CELLS, resolution=2.5), _as_it_is),
    "town, 1 m, from above": (partial(town, cells=_CELLS, resolution=1.0), _above_roofs),
    "town, 1 m, on hills": (partial(town, cells=_CELLS, resolution=1.0), _on_hills),
    "field, 1 m": (partial(field, cells=_CELLS), _as_it_is),
    "field, 1 m, from above": (partial(field, cells=_CELLS), _above_roofs),
}


def coverage(
    *,
    robots: Annotated[str, Parameter(help="numbers of drones, spread over the map")] = "2,6",
    steps: Annotated[int, Parameter(help="horizon T")] = STEPS,
    out: Out = None,
) -> None:
    """Measures, prints, and writes the table (coverage.csv)."""
    teams = Option("--robots").numbers(robots)
    results, rows = Results.into(out), list[Record]()
    for scene, (make, change) in SCENES.items():
        for count in teams:
            build = partial(make, seed=_SEED, robots=count, actors=ACTORS, steps=steps)
            context = multiprocessing.get_context("spawn")
            with Run.one_thread(), ProcessPoolExecutor(1, mp_context=context) as process:
                measured = process.submit(_row, build, change).result()
            rows.append({"scene": scene, "robots": count} | measured)
            say(f"{scene}, {count} drones: {rows[-1]['seconds']:.1f} s")
            results.save(_TABLE, rows)
    Listing(f"coverage, {ACTORS} people, {steps} steps (us: of one state)", rows).print()


def coverage_in_markdown() -> str:
    """Returns the stored cost of wide maps: CPU time, memory, and number of states."""
    return markdown([
        {
            "map": row["scene"],
            "drones": row["robots"],
            "states": f"{int(row['states']):,}",
            "CPU time": in_unit(row["processor (s)"], "s"),
            "memory, the whole process": f"{float(row['peak (GB)']):.2f} GB",
            "us per state": f"{float(row['us']):.1f}",
        }
        for row in stored_rows(_TABLE)
    ])  # fmt: skip


def _row(build: Build, change: Callable[[Problem], Problem]) -> Record:
    """Computes the coverage of a problem with one robot class; returns its cost."""
    problem = change(build())
    model = Model(problem, use_cache=False)
    (robot_class,) = model.classes
    reachable = model.reachable(robot_class)
    KERNEL.load()
    first = problem.first_step
    states = int(reachable[first:].sum())
    clock, processor = Clock(), time.process_time()
    table = model.coverage(robot_class)
    seconds, processor = clock.seconds, time.process_time() - processor
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * BYTES / 1e9
    return {
        "seconds": seconds,
        "processor (s)": processor,
        "peak (GB)": peak,
        "states": states,
        "seen (%)": 100 * len(table.nodes) / states,
        "entries": len(table.pixels),
        "table (MB)": sum(part.nbytes for part in table) / 1e6,
        "us": 1e6 * processor / states,
        **{
            f"us, by {n}": _microseconds(Model(problem), robot_class, reachable, n)
            for n in _AT_ONCE
        },
    }


def _microseconds(model: Model, robot_class: RobotClass, reachable: BoolArray, n: int) -> float:
    """Returns the median time (us) per state if n neighbouring states are requested at once."""
    rng, views = np.random.default_rng(_SEED), model.views(robot_class)
    times = []
    for _ in range(_REPEATS):
        t = int(rng.integers(model.problem.first_step, len(reachable)))
        states = np.flatnonzero(reachable[t])
        place = states % robot_class.graph.n_places
        near = np.argsort(np.abs(place - rng.choice(place)), kind="stable")[:n]
        views.coverage(t, states[:0])  # the actors' faces at this step are made only once
        clock = Clock()
        views.coverage(t, states[near])
        times.append(clock.seconds / len(near))
    return 1e6 * median(times)
