"""The gap table as a function, made by the same machinery as that of `cocap-opt gap`."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cocap_opt.problem import Problem

if TYPE_CHECKING:
    from pandas import DataFrame


def gap(
    scenes: str | Path | Problem | Sequence[str | Path | Problem],
    planners: Sequence[str] | None = None,
    seeds: Sequence[int] = (0,),
    time_limit: float = 60.0,
    work_limit: int | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
) -> "DataFrame":
    """Computes the gap table: every planner's J against the best certified bound.

    Parameters
    ----------
    scenes
        Names of built-in scenes, files of scenes, or problems; one, or several.
    planners
        Names from `PLANNERS` or `EXACT`. If None: greedy, sequential, cocap, cocap-vs, and with
        one or two drones joint.
    seeds
        Seeds of the scenes. A scene that is the same for several seeds is taken once, and so is a
        problem, whose seed is 0.
    time_limit
        Seconds for each planner and for each of the two bounds of a scene and seed.
    work_limit
        Units of work for each of them: pricing rounds, or nodes of CoCap's tree. With it the
        table, but for its seconds, is the same on every machine that needs less than the time
        limit.
    out
        A folder that keeps results: what is in it already is not computed again.
    workers
        Processes, each on a core of its own; None computes in this process.

    Returns
    -------
    pandas.DataFrame
        A row per scene, seed and planner, with the columns of
        `cocap_opt.experiments.results.rows.COLUMNS`. A value that does not exist is None or nan.

    Raises
    ------
    ValueError
        If there is no such scene or planner, a limit is negative, or there are not so many cores.
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet; else the rows so far are returned.

    Examples
    --------
    >>> gap(["corridor", "bottleneck"], ["sequential", "cocap"], seeds=range(5))
    """
    from pandas import DataFrame

    from cocap_opt.experiments.console.options import Option
    from cocap_opt.experiments.results.judging import SOLVERS
    from cocap_opt.experiments.results.rows import Row
    from cocap_opt.experiments.sweeps.instances import Instance, Settings
    from cocap_opt.experiments.sweeps.scenes import Scenes
    from cocap_opt.experiments.sweeps.sweep import Hired, sweep

    for name in planners or ():
        Option("planners").require_one_of(name, SOLVERS)
    Option("time_limit").require_seconds(time_limit)
    Option("workers").require_cores(workers)
    if work_limit is not None and work_limit < 0:
        raise ValueError(f"work_limit: must be at least 0, not {work_limit}")
    given = [scenes] if isinstance(scenes, str | Path | Problem) else list(scenes)
    named = Scenes(
        [str(scene) for scene in given if not isinstance(scene, Problem)], seeds, tell=_nobody
    )
    problems = [(problem, seed) for (_, seed), problem in named.problems.items()]
    problems += [(scene, 0) for scene in given if isinstance(scene, Problem)]
    names = [(problem.name, seed) for problem, seed in problems]
    if len(set(names)) < len(names):
        raise ValueError("scenes: two are called the same; give them other names")
    settings = Settings(time_limit=time_limit, bound_time_limit=time_limit, work_limit=work_limit)
    instances = [Instance(problem, seed, planners, settings) for problem, seed in problems]
    hired = Hired(workers, None, settings.cell_limit)
    folder = None if out is None else Path(out)
    rows = sweep(instances, folder, hired, is_same=named.is_same, quiet=True)
    return DataFrame(Row.records(rows))


def _nobody(message: str) -> None:
    """Says nothing: the table says it."""
