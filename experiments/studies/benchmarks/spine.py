"""What the spine promises about speed: coverage, planners, the command line.

Each figure is a median over repeated runs, printed with its target. Ratios compare two
things done in the same process, so they hold on slow and busy machines; seconds do not.
"""

import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from cocap_opt.model import Model, compiled
from cocap_opt.objective import marginal_reward, no_pixels
from cocap_opt.planners import PLANNERS
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never

SEEDS = range(10)

Figure = tuple[str, float, str, str]  # what, measured, unit, target


def median_seconds(run: Callable[[], object], repeats: int) -> float:
    """Median wall time of a call, after one call that is not counted."""
    run()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def in_new_process(code: str, repeats: int) -> tuple[float, float]:
    """Median wall seconds of a Python program, and of starting Python alone."""

    def run(program: str) -> Callable[[], object]:
        return lambda: subprocess.run(
            [sys.executable, "-c", program], check=True, capture_output=True
        )

    return median_seconds(run(code), repeats), median_seconds(run("pass"), repeats)


def value_iteration_ratio() -> list[Figure]:
    """A backward sweep on the corridor against copying its reward array."""
    model = compiled(load_scene("corridor", 0))
    robot_class = model.classes[0]
    reward = marginal_reward(model, robot_class, no_pixels(model.problem))
    # In turns, so that both meet the same noise.
    ratios = [
        median_seconds(lambda: robot_class.graph.backward_sweep(reward), 50)
        / median_seconds(reward.copy, 50)
        for _ in range(11)
    ]
    ratio = statistics.median(ratios)
    return [("value iteration / copying the reward array", ratio, "x", "< 20")]


def coverage_seconds() -> list[Figure]:
    """Coverage of all reachable states of the corridor, without the cache."""
    problem = load_scene("corridor", 0)

    def run() -> None:
        model = Model(problem, use_cache=False)
        model.coverage(model.classes[0])

    return [("coverage of the corridor", median_seconds(run, 5), "s", "< 3")]


def joint_figures() -> list[Figure]:
    """Joint value iteration on the corridor in a process of its own, for its memory."""
    code = (
        "import json, resource, time\n"
        "from cocap_opt.model import compiled\n"
        "from cocap_opt.planners import PLANNERS\n"
        "from cocap_opt.stop import never\n"
        "from cocap_opt.scenarios import load_scene\n"
        "problem = load_scene('corridor', 0)\n"
        "model = compiled(problem)\n"
        "model.coverage(model.classes[0])\n"
        "begin = time.perf_counter()\n"
        "result = PLANNERS['joint'](problem, never)\n"
        "assert result.reason == 'optimal'\n"
        "print(json.dumps([time.perf_counter() - begin,"
        " resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6]))\n"
    )
    runs = [
        json.loads(subprocess.run([sys.executable, "-c", code], check=True,
                                  capture_output=True).stdout)
        for _ in range(3)
    ]  # fmt: skip
    seconds, gigabytes = (statistics.median(column) for column in zip(*runs, strict=True))
    return [
        ("joint value iteration, corridor, both rules", seconds, "s", "< 5"),
        ("... its memory", gigabytes, "GB", "< 2"),
    ]


def cocap_ratio() -> list[Figure]:
    """CoCap with value iteration against sequential planning on the bottleneck."""
    ratios = []
    for seed in SEEDS:
        problem = load_scene("bottleneck", seed)
        model = compiled(problem)
        for robot_class in model.classes:
            model.coverage(robot_class)
        cocap = median_seconds(lambda p=problem: PLANNERS["cocap"](p, never), 3)  # type: ignore[misc]
        sequential = median_seconds(lambda p=problem: PLANNERS["sequential"](p, never), 3)  # type: ignore[misc]
        ratios.append(cocap / sequential)
    return [
        ("CoCap / sequential, bottleneck, median of 10 seeds", statistics.median(ratios), "x",
         "< 3 (paper: 8.3)"),
        ("... the slowest seed", max(ratios), "x", ""),
    ]  # fmt: skip


def command_seconds() -> list[Figure]:
    """The command line: importing it, and the corridor's gap table."""
    imports, bare = in_new_process("import cocap_opt.experiments.cli.commands", 5)
    gap = (
        "from cocap_opt.experiments.cli.main import main; main(['gap', 'corridor', '--seeds', '0'])"
    )
    warm, _ = in_new_process(gap, 3)
    with tempfile.TemporaryDirectory() as empty:
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-c", gap], check=True, capture_output=True,
                       env=os.environ | {"COCAP_OPT_CACHE": empty})  # fmt: skip
        cold = time.perf_counter() - begin
    return [
        ("importing the command line", imports - bare, "s", "< 2"),
        ("gap corridor --seeds 0", warm, "s", "< 10"),
        ("... with an empty coverage cache", cold, "s", "< 10"),
    ]


BENCHMARKS = [
    value_iteration_ratio,
    coverage_seconds,
    joint_figures,
    cocap_ratio,
    command_seconds,
]


def print_figures() -> None:
    """Run all benchmarks and print their figures."""
    os.chdir(Path(__file__).parents[2])  # for the programs that are started
    table = Table("figure", "measured", "target", title="benchmarks (medians; one thread)")
    for benchmark in BENCHMARKS:
        for what, value, unit, target in benchmark():
            table.add_row(what, f"{value:.3g} {unit}", target)
    Console(soft_wrap=True).print(table)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e6
    Console().print(f"largest process started: {peak:.2f} GB; Python {sys.version.split()[0]}")
