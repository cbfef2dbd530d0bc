"""What views cost: coverage of all that robots can reach in a town of 120 x 120 cells.

Each row is measured in a process of its own, on one thread and without the cache. The last
columns are what a state costs that is asked for alone, or with few others, as in a search.
"""

import multiprocessing
import resource
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

from cocap_opt.data import BoolArray
from cocap_opt.model import Model, RobotClass
from experiments.benchmarks.runs import BYTES, Build, one_thread
from experiments.benchmarks.town import town
from experiments.files import make_folder, save_csv
from experiments.printing import print_table
from experiments.report import Row
from experiments.streams import say
from scenarios.field import field

CELLS, ACTORS, STEPS, SEED = 120, 6, 60, 0
AT_ONCE = 1, 10, 100  # states of near places
REPEATS = 200
SCENES = {
    "town, 1 m": partial(town, cells=CELLS, resolution=1.0),
    "town, 2.5 m": partial(town, cells=CELLS, resolution=2.5),
    "field, 1 m": partial(field, cells=CELLS),
}


def coverage(robots: Sequence[int], steps: int = STEPS, out: Path | None = None) -> None:
    """Measure, print, and write the table (coverage.csv)."""
    make_folder(out)
    rows: list[Row] = []
    for scene, make in SCENES.items():
        for count in robots:
            build = partial(make, seed=SEED, robots=count, actors=ACTORS, steps=steps)
            context = multiprocessing.get_context("spawn")
            with one_thread(), ProcessPoolExecutor(1, mp_context=context) as process:
                rows.append({"scene": scene, "robots": count} | process.submit(row, build).result())
            say(f"{scene}, {count} robots: {rows[-1]['seconds']:.1f} s")
            if out is not None:
                save_csv(out / "coverage.csv", rows)
    print_table(f"coverage, {ACTORS} actors, {steps} steps (us: of one state)", rows)


def row(build: Build) -> Row:
    """Compute the coverage of a problem with one class of robots, and say what it took."""
    problem = build()
    model = Model(problem, use_cache=False)
    (group,) = model.classes
    reachable = model.reachable(group)
    first = problem.first_step
    states = int(reachable[first:].sum())
    begin = time.process_time()
    table = model.coverage(group)
    seconds = time.process_time() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * BYTES / 1e9
    return {
        "seconds": seconds,
        "peak (GB)": peak,
        "states": states,
        "seen (%)": 100 * len(table.nodes) / states,
        "entries": len(table.pixels),
        "table (MB)": sum(part.nbytes for part in table) / 1e6,
        "us": 1e6 * seconds / states,
        **{f"us, by {n}": _microseconds(Model(problem), group, reachable, n) for n in AT_ONCE},
    }


def _microseconds(model: Model, group: RobotClass, reachable: BoolArray, n: int) -> float:
    """Median time of a state, of n of near places asked for at once, as a search does."""
    rng, views = np.random.default_rng(SEED), model.views(group)
    times = []
    for _ in range(REPEATS):
        t = int(rng.integers(model.problem.first_step, len(reachable)))
        states = np.flatnonzero(reachable[t])
        place = states % group.graph.n_places
        near = np.argsort(np.abs(place - rng.choice(place)), kind="stable")[:n]
        views.coverage(t, states[:0])  # the actors' faces at this step are made only once
        begin = time.perf_counter()
        views.coverage(t, states[near])
        times.append((time.perf_counter() - begin) / len(near))
    return 1e6 * median(times)
