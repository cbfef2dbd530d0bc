"""Speed of coverage, of planners and of the command line, with the targets of the project.

Each figure is a median over repeated runs, in seconds of CPU time on one core, including programs
that are started; only the gain by several cores is measured on all of them, in wall-clock time. The
slowest seed is the largest of such medians. Ratios compare two measurements in the same process, so
they hold on slow and busy machines; seconds do not.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from functools import partial
from importlib import import_module
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from cocap_opt.experiments.lab.results import Results, in_unit, markdown, stored_rows
from cocap_opt.experiments.lab.studies.options import Out
from cocap_opt.experiments.lab.studies.runs import BYTES, TimedRun, processor_seconds
from cocap_opt.graph import value_iteration
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.model import Model, compiled
from cocap_opt.objective import marginal_reward
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never
from cocap_opt.vision import sights
from cocap_opt.vision.coverage import usable_cores

_TABLE, _WITHOUT = "speed.csv", "... without compiled code / with it"
_SEEDS = range(10)
# Approximate number of sums, products and comparisons for the coverage of field-large: operations
# in the loops of `view_kernel`, counted by hand, times their repetitions, counted with seed 0.
#   in view    33.1 M views of a person, 21 each                                       0.7e9
#   skylines   4.12 M people before an eye, 150; 6.15 M columns before them, 180       1.7e9
#   shadows    1.14 M with 6.5 planes, 70 a plane; 1.01 M people, 31 others each, 25   1.3e9
#   cutting    1.74 M pieces at 6.5 planes, 4.5 corners, 6; 1.33 M cuts, 160           0.5e9
#   images     5.86 M pieces of 4.5 corners, 36                                        1.0e9
_OPERATIONS = 5.2e9
_LARGE = "field-large"
_SPINS = 10_000_000
_SHORT_CALLS = 100  # calls of a few microseconds that are timed together
_GAP = "from cocap_opt.cli.main import main; main(['gap', 'corridor', '--seeds', '0'])"
_JOINT = f"""\
import json, resource
from time import process_time
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never
problem = load_scene('corridor', 0)
model = compiled(problem)
model.coverage(model.classes[0])
before = process_time()
result = PLANNERS['joint'](problem, never)
assert result.reason == 'optimal'
seconds = process_time() - before
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(json.dumps([seconds, peak * {BYTES} / 1e9]))
"""


class _Speed(NamedTuple):
    figure: str
    measured: float
    unit: str
    target: str = ""


def speed(*, out: Out = None) -> None:
    """Measures and prints all figures, and writes the table (speed.csv)."""
    results = Results.into(None if out is None else out.resolve())
    os.chdir(Path(__file__).parents[2])  # working folder of the child processes
    table = Table("figure", "measured", "target", title="speed (CPU time; one core)")
    figures = list[_Speed]()
    for measure in _MEASURES:
        with nullcontext() if measure is _cores else _one_core():
            figures += measure()
    for figure in figures:
        table.add_row(figure.figure, f"{figure.measured:.3g} {figure.unit}", figure.target)
    results.save(_TABLE, figures)
    Console(soft_wrap=True).print(table)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * BYTES / 1e9
    Console().print(f"largest process started: {peak:.2f} GB; Python {sys.version.split()[0]}")


def speed_in_markdown() -> str:
    """Returns stored CPU times and ratios, without the project's targets."""
    return markdown(
        [
            {"figure": row["figure"], "measured": in_unit(row["measured"], row["unit"])}
            for row in stored_rows(_TABLE)
        ]
    )


def gain_in_words() -> str:
    """Returns the smallest and largest factor by which compiled code speeds up coverage."""
    rows = stored_rows(_TABLE)
    gains = [float(row["measured"]) for row in rows if row["figure"] == _WITHOUT]
    return f"{min(gains):.0f} to {max(gains):.0f}"


def _value_iteration() -> list[_Speed]:
    """Compares a compiled backward sweep with copying its reward array."""
    value_iteration.KERNEL.load()
    return [
        _Speed("value iteration / copying the reward array, corridor", _sweep("corridor"), "x",
                "< 20"),
        _Speed("... field", _sweep("field"), "x", "< 10"),
        _Speed("... field-large", _sweep("field-large"), "x", "< 10"),
    ]  # fmt: skip


def _sweep(scene: str) -> float:
    """Returns the time of a backward sweep divided by the time to copy its rewards."""
    model = compiled(load_scene(scene, 0))
    robot_class = model.classes[0]
    reward = marginal_reward(model, robot_class, model.problem.no_pixels())

    def sweeps() -> None:
        for _ in range(_SHORT_CALLS):
            backward_sweep(robot_class.graph, reward)

    def copies() -> None:
        for _ in range(_SHORT_CALLS):
            reward.copy()

    # In turns, so that noise affects both alike.
    return median(_seconds(sweeps, 3) / _seconds(copies, 3) for _ in range(11))


def _coverage() -> list[_Speed]:
    """Measures the coverage of all reachable states, with compiled code and with NumPy."""
    sights.KERNEL.load()
    figures, taken = list[_Speed](), dict[str, float]()
    for scene, repeats, target in (
        ("bottleneck", 5, "< 0.1"), ("passage", 5, "< 0.1"), ("field", 5, "< 0.15"),
        (_LARGE, 3, "< 2.5"),
    ):  # fmt: skip
        problem = load_scene(scene, 0)
        taken[scene], plain = (
            _seconds(partial(_covered, problem, plain), repeats) for plain in (False, True)
        )
        figures += [
            _Speed(f"coverage of {scene}", taken[scene], "s", target),
            _Speed(_WITHOUT, plain / taken[scene], "x"),
        ]
    least = _OPERATIONS / _operations_per_second()
    alone = _Speed("... with it / its sums and products alone", taken[_LARGE] / least, "x")
    return [*figures, alone]


def _cores() -> list[_Speed]:
    """Compares the time for coverage on one core with the time on all cores."""
    name = f"... on one core / on {usable_cores()}, by wall-clock time"
    return [_Speed(name, _gain(load_scene(_LARGE, 0)), "x")]


def _gain(problem: Problem) -> float:
    """Returns the time for coverage on one core divided by the time on all cores."""
    covered = partial(_covered, problem, False)
    sights.KERNEL.load()
    ratios = []
    for _ in range(3):  # in turns, so that noise affects both alike
        together = _passed(covered)
        with _one_core():
            ratios.append(_passed(covered) / together)
    return median(ratios)


def _operations_per_second() -> float:
    """Returns the number of scalar sums and products per second of this processor."""
    spin = import_module("numba").njit(_spin)
    spin(1)
    return 16 * _SPINS / _seconds(partial(spin, _SPINS), 5)


def _spin(n: int) -> float:
    """Does 16 n sums and products in eight independent chains, which do not wait for each other."""
    a = b = c = d = e = f = g = h = 0.5
    for _ in range(n):
        a, b, c, d = a * 0.4 + 0.3, b * 0.5 + 0.2, c * 0.6 + 0.1, d * 0.7 + 0.1
        e, f, g, h = e * 0.3 + 0.3, f * 0.2 + 0.2, g * 0.1 + 0.1, h * 0.8 + 0.1
    return a + b + c + d + e + f + g + h


def _covered(problem: Problem, plain: bool) -> None:
    """Computes the coverage of a problem without the cache."""
    Model(problem, use_cache=False, plain=plain).prepare_all()


def _joint() -> list[_Speed]:
    """Measures joint value iteration on the corridor in its own process, for its memory."""
    runs = [json.loads(_run_python(_JOINT)) for _ in range(3)]
    seconds, gigabytes = (median(column) for column in zip(*runs, strict=True))
    return [
        _Speed("joint value iteration, corridor, both rules", seconds, "s", "< 5"),
        _Speed("... its memory", gigabytes, "GB", "< 2"),
    ]


def _cocap() -> list[_Speed]:
    """Compares CoCap with value iteration and sequential planning on the bottleneck."""
    ratios = []
    for seed in _SEEDS:
        problem = load_scene("bottleneck", seed)
        compiled(problem).prepare_all(never)
        cocap, sequential = (
            median([TimedRun.of(problem, name).seconds for _ in range(4)][1:])
            for name in ("cocap", "sequential")
        )
        ratios.append(cocap / sequential)
    return [
        _Speed("CoCap / sequential, bottleneck, median of 10 seeds", median(ratios), "x",
                "< 3 (paper: 8.3)"),
        _Speed("... the slowest seed", max(ratios), "x"),
    ]  # fmt: skip


def _command_line() -> list[_Speed]:
    """Measures importing the command line, and the corridor's gap table."""
    imports, bare, warm = (
        _seconds(partial(_run_python, program), repeats)
        for program, repeats in (
            ("import cocap_opt.cli.commands", 5),
            ("pass", 5),
            (_GAP, 3),
        )
    )
    cold = _seconds(_gap_without_cache, 3)
    return [
        _Speed("importing the command line", imports - bare, "s", "< 2"),
        _Speed("gap corridor --seeds 0", warm, "s", "< 10"),
        _Speed("... with an empty coverage cache", cold, "s", "< 10"),
    ]


def _gap_without_cache() -> None:
    """Prints the corridor's gap table in a process whose coverage cache is empty."""
    with tempfile.TemporaryDirectory() as empty:
        _run_python(_GAP, COCAP_OPT_CACHE=empty)


# Joint planning comes first, as memory of a parent process counts as memory of its child.
_MEASURES = (_joint, _value_iteration, _coverage, _cores, _cocap, _command_line)


def _seconds(run: Callable[[], object], repeats: int) -> float:
    """Returns the median CPU time of a call, after a first call that does not count."""
    run()
    times = []
    for _ in range(repeats):
        before = processor_seconds()
        run()
        times.append(processor_seconds() - before)
    return median(times)


def _passed(run: Callable[[], object]) -> float:
    """Returns the wall-clock time of a call."""
    before = perf_counter()
    run()
    return perf_counter() - before


@contextmanager
def _one_core() -> Iterator[None]:
    """Limits this process to one core, if the system supports it."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, [min(before)])
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def _run_python(code: str, **environment: str) -> bytes:
    """Runs a Python program in its own process; returns its output."""
    command = [sys.executable, "-c", code]
    variables = os.environ | environment
    return subprocess.run(command, check=True, capture_output=True, env=variables).stdout
