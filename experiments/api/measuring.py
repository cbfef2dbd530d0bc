"""The face's measurements: the gap table, and the stored runs of exact methods."""

import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cocap_opt.experiments.results.stored import STORED
from cocap_opt.formulations import EXACT
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem

if TYPE_CHECKING:
    import pandas as pd

    from cocap_opt.experiments.report.benchmark import Benchmark

_Scene = str | Path | Problem  # a name, a file, or the problem itself


def gap(
    scenes: _Scene | Sequence[_Scene],
    planners: Sequence[str] | None = None,
    seeds: Iterable[int] = (0,),
    *,
    time_limit: float = 60.0,
    work_limit: int | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
) -> "pd.DataFrame":
    """Measure planners against certified bounds: the gap table, as `cocap-opt gap` makes it.

    Planners are named, not called: a result is kept under its planner's name and the digest of this
    project's code, which says nothing of a function of one's own. `plan` and `bound` measure such
    a function on one problem.

    Parameters
    ----------
    scenes : names, files or problems; one, or several
    planners : names in `PLANNERS` or `EXACT`; if not given greedy, sequential, cocap, cocap-vs,
        cocap-lns, and with one or two drones joint
    seeds : of the scenes; a scene that is the same for several seeds is taken once, and so is a
        problem, whose seed is 0
    time_limit : seconds for each plan, and for each of the two bounds of a scene and seed
    work_limit : units of work for each of them: pricing rounds, or nodes of CoCap's tree. With it
        the table, but for its seconds, is the same on every machine that needs less than the time
        limit
    out : folder that keeps plans, certificates and results; what is there is not computed again
    workers : processes, each on a core of its own; this process if not given

    Returns
    -------
    DataFrame
        A row per scene, seed and planner, with the columns of `results.csv`, which
        `cocap-opt columns` explains. A value that does not exist is None or nan.

    Raises
    ------
    ValueError
        If there is no such scene or planner, a limit is negative, there are not so many cores,
        `out` cannot be used, or a script that takes `workers` has no line
        ``if __name__ == "__main__":``.
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet; else the rows so far are returned.

    Examples
    --------
    >>> co.gap(["corridor", "bottleneck"], ["sequential", "cocap"], seeds=range(3))
    """
    from pandas import DataFrame

    from cocap_opt.experiments.console.options import Option
    from cocap_opt.experiments.results.rows import Row
    from cocap_opt.experiments.sweeps.instances import Instance, Settings
    from cocap_opt.experiments.sweeps.scenes import Scenes
    from cocap_opt.experiments.sweeps.sweep import Hired, sweep

    # Before anything is computed; numbers of NumPy become plain ones.
    kept = out is not None or workers is not None
    settings = Settings(
        time_limit=time_limit, bound_time_limit=time_limit, work_limit=work_limit, kept=kept
    )
    _require_sweep(planners or ())
    hired = Hired(Option("workers").require_cores(workers), None, settings.cell_limit)
    if hired.workers is not None:
        _require_guard()
    whole, given = _whole_seeds(seeds), _several_scenes(scenes)
    words = [str(scene) for scene in given if not isinstance(scene, Problem)]
    named = Scenes(words, whole, tell=_nobody)
    problems = [(problem, seed) for (_, seed), problem in named.problems.items()]
    problems += [(scene, 0) for scene in given if isinstance(scene, Problem)]
    _require_told_apart([(problem.name, seed) for problem, seed in problems])
    instances = [Instance(problem, seed, planners, settings) for problem, seed in problems]
    folder = None if out is None else Path(out)
    rows = sweep(instances, folder, hired, is_same=named.is_same, quiet=True)
    return DataFrame(Row.records(rows))


def benchmark(path: str | Path | None = None) -> "Benchmark":
    """Read how long exact methods take, and how good their bounds are, step by step.

    Parameters
    ----------
    path : file `solvers.csv` that `cocap-opt study steps --out DIR` has written; the one that is
        stored with this project if not given

    Returns
    -------
    Benchmark
        `table` has a row a run, `plot()` draws time and bound against the number of steps.

    Raises
    ------
    ValueError
        If the file cannot be read, or is no such table.

    Examples
    --------
    >>> co.benchmark().plot()
    """
    from cocap_opt.experiments.report.benchmark import Benchmark

    return Benchmark.read(STORED / "solvers.csv" if path is None else Path(path))


def _require_sweep(planners: Sequence[str]) -> None:
    from cocap_opt.experiments.console.options import Option

    if isinstance(planners, str):
        raise ValueError(f"planners: must be several names, such as [{planners!r}]")
    if not all(isinstance(name, str) for name in planners):
        raise ValueError("planners: must be names; measure a function by co.plan and co.bound")
    for name in planners:
        Option("planners").require_one_of(name, {**PLANNERS, **EXACT})


def _whole_seeds(seeds: Iterable[int]) -> tuple[int, ...]:
    """Returns seeds as plain numbers; refuses what is no seed."""
    from cocap_opt.experiments.console.options import Option

    if not isinstance(seeds, Iterable):
        raise ValueError(f"seeds: must be several, such as range(3), not {seeds!r}")
    return tuple(Option("seeds").require_whole(seed) for seed in seeds)


def _several_scenes(scenes: _Scene | Sequence[_Scene]) -> list[_Scene]:
    """Returns one scene or several as a list."""
    given = [scenes] if isinstance(scenes, str | Path | Problem) else scenes
    if not isinstance(given, Iterable):
        raise ValueError(f"scenes: must be names, files or problems, not {scenes!r}")
    return list(given)


def _require_told_apart(names: Sequence[tuple[str, int]]) -> None:
    """Refuses two problems of one name and seed, whose rows nobody could tell apart."""
    if len(set(names)) < len(names):
        raise ValueError("scenes: two are called the same; give them other names")


def _require_guard() -> None:
    """Refuses a script that each worker process would run from its first line on."""
    script = Path(str(getattr(sys.modules["__main__"], "__file__", "")))
    if script.suffix == ".py" and script.is_file() and "__main__" not in script.read_text():
        words = 'each worker imports your script; put its work under `if __name__ == "__main__":`'
        raise ValueError(f"workers: {words}")


def _nobody(message: str) -> None:
    """Discards the note on seeds that make the same scene; the table shows which were kept."""
