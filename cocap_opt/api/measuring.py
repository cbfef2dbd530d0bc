"""Public function for the gap table."""

import logging
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cocap_opt.api.arguments import name_of, require, require_number, require_path
from cocap_opt.planners import Planner
from cocap_opt.problem import Problem
from cocap_opt.scenarios import SCENES, load_scene
from cocap_opt.text import on_a_line

if TYPE_CHECKING:
    import pandas as pd

    from cocap_opt.run.own_planners import OwnPlanner

_log = logging.getLogger(__name__)

_Build = Callable[[int], Problem]  # makes the problem of a seed
_Scene = str | Path | Problem | _Build  # a name, a file, a problem, or a function that makes one


def gap(
    scenes: _Scene | Sequence[_Scene],
    planners: Sequence[str | Planner] | None = None,
    seeds: Iterable[int] | str = (0,),
    *,
    time_limit: float = 60.0,
    work_limit: int | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
) -> "pd.DataFrame":
    """Measure planners against certified bounds: the gap table that `cocap-opt gap` prints.

    `planners` may include your own planner, a function of a problem and a stop; its rows have the
    function's name. If the function has a parameter `seed`, it gets the scene's seed. With `out`,
    define the function at the top level of a module or script: the folder identifies its results by
    the digest of that file and of all files that it imports from its own folder.

    Parameters
    ----------
    scenes : names, files, problems, or functions that make the problem of a seed; one, or several
    planners : names in `PLANNERS` or `EXACT`, "module:function", names that installed packages
        offer, or callables that take a problem and a stop and return a `Result`, as for `plan`
        (default: greedy, sequential, cocap, cocap-vs, cocap-prices, and joint for one or two
        drones)
    seeds : of the scenes, as numbers or as text such as "0-3"; a scene that is the same for several
        seeds is used once, and so is a problem, whose seed is 0
    time_limit : seconds for each plan, and for each of the two bounds of a scene and seed, counted
        from when coverage is ready
    work_limit : units of work for each of them: pricing rounds, or nodes of CoCap's tree. With a
        work limit, the table is the same on every machine that stays within the time limit, except
        for the times in it
    out : folder for plans, certificates and results; those that it already has are not computed
        again
    workers : processes, each on a core of its own (default: this process)

    Returns
    -------
    DataFrame
        A row per scene, seed and planner, with the columns of `results.csv`, which
        `cocap-opt columns` explains. A value that does not exist is None or nan.

    Raises
    ------
    TypeError
        If the time limit is not a number.
    ValueError
        If

        - there is no such scene or planner, or no scene, planner or seed at all,
        - a limit is negative,
        - there are fewer cores than `workers`,
        - `out` cannot be used,
        - `out` is given, and a planner is a function whose code cannot be recognised later, or
        - a script that uses `workers` has no line ``if __name__ == "__main__":``.
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet; otherwise the rows so far are returned.

    Examples
    --------
    >>> co.gap(["corridor", "bottleneck"], ["sequential", "cocap"], seeds=range(3))
    >>> co.gap("bottleneck", ["cocap", my_planner])
    >>> co.gap(my_scene, ["sequential", "cocap"], seeds=range(10))
    """
    from pandas import DataFrame

    from cocap_opt.experiments.sweeps.instances import Instance, Settings
    from cocap_opt.experiments.sweeps.scenes import Scenes
    from cocap_opt.experiments.sweeps.sweep import Hired, sweep
    from cocap_opt.experiments.tables.rows import GapRow
    from cocap_opt.run.options import Option

    # Before anything is computed; numbers of NumPy become plain ones.
    require_number(time_limit, "time_limit")
    folder = None if out is None else require_path(out, "out")
    kept = out is not None or workers is not None
    settings = Settings(
        time_limit=time_limit, bound_time_limit=time_limit, work_limit=work_limit, kept=kept
    )
    if isinstance(planners, Iterable) and not isinstance(planners, str):
        planners = list(planners)  # arrays have no truth value, and iterators can be read only once
    foreign = _foreign(() if planners is None else planners, out is not None, workers is not None)
    names = None if planners is None else [name_of(planner) for planner in planners]
    hired = Hired(Option("workers").require_cores(workers), None, settings.cell_limit)
    if hired.workers is not None:
        _require_guard()
    whole, given = _whole_seeds(seeds), _several_scenes(scenes)
    for name, several in (("scenes", given), ("planners", names), ("seeds", whole)):
        if several is not None and not several:
            raise ValueError(f"{name}: must not be empty")
    words, load = _words_of_scenes(given)
    named = Scenes(words, whole, load, tell=_nobody)
    problems = [(problem, seed) for (_, seed), problem in named.problems.items()]
    problems += [(scene, 0) for scene in given if isinstance(scene, Problem)]
    _require_told_apart([(problem.name, seed) for problem, seed in problems])
    instances = [
        Instance(problem, seed, names, settings, foreign=foreign) for problem, seed in problems
    ]
    rows = sweep(instances, folder, hired, is_same=named.is_same, quiet=True)
    for row in rows:
        if row.has_error:
            _log.warning("%s, seed %s, %s: %s", row.scene, row.seed, row.planner, row.message)
    return DataFrame(GapRow.records(rows))


def _foreign(planners: Sequence[str | Planner], kept: bool, sent: bool) -> "dict[str, OwnPlanner]":
    """Returns the planners that do not belong to this project, by their names.

    Parameters
    ----------
    kept : True if results are kept in a folder
    sent : True if other processes compute
    """
    from cocap_opt.run.named_planners import own_planners
    from cocap_opt.run.options import Option
    from cocap_opt.run.own_planners import OwnPlanner, OwnPlannerError

    if isinstance(planners, str) or callable(planners):
        name = repr(planners) if isinstance(planners, str) else name_of(planners)
        raise TypeError(f"planners: must be a list, such as [{name}]")
    if not isinstance(planners, Iterable):
        raise TypeError(f"planners: must be names or functions, not {on_a_line(planners)}")
    functions = [planner for planner in planners if not isinstance(planner, str)]
    for planner in functions:
        if not callable(planner):
            raise TypeError(f"planners: must be names or functions, not {on_a_line(planner)}")
    _require_free([name_of(planner) for planner in planners], functions)
    names = [planner for planner in planners if isinstance(planner, str)]
    foreign = own_planners(Option("planners"), names)
    try:
        for call in functions:
            foreign[name_of(call)] = OwnPlanner.of_function(call, name_of(call), kept)
        return {name: each.to_be_sent() if sent else each for name, each in foreign.items()}
    except OwnPlannerError as error:
        raise ValueError(f"planners: {error}") from error


def _require_free(names: Sequence[str], functions: Sequence[Planner]) -> None:
    """Refuses functions with the name of another planner."""
    from cocap_opt.run.engine import BOUND, SOLVERS

    for name in map(name_of, functions):
        if names.count(name) > 1 or name in SOLVERS or name == BOUND:
            raise ValueError(f"planners: two are called {name}; give the function another name")


def _whole_seeds(seeds: Iterable[int] | str) -> tuple[int, ...]:
    """Returns seeds as plain numbers; refuses anything that is not a seed."""
    from cocap_opt.run.options import Option

    if isinstance(seeds, str):
        return Option("seeds").numbers(seeds)
    if not isinstance(seeds, Iterable):
        words = f"must be a list or a range, such as range(3), not {on_a_line(seeds)}"
        raise TypeError(f"seeds: {words}")
    return tuple(Option("seeds").require_whole(seed) for seed in seeds)


def _several_scenes(scenes: _Scene | Sequence[_Scene]) -> list[_Scene]:
    """Returns one scene or several as a list."""
    given = [scenes] if isinstance(scenes, str | Path | Problem) or callable(scenes) else scenes
    if not isinstance(given, Iterable):
        words = f"must be names, files, problems or functions, not {on_a_line(scenes)}"
        raise TypeError(f"scenes: {words}")
    return list(given)


def _words_of_scenes(scenes: Sequence[_Scene]) -> tuple[list[str], Callable[[str, int], Problem]]:
    """Returns names of scenes other than problems, and a function from name and seed to problem."""
    functions = {name_of(scene): scene for scene in scenes if callable(scene)}
    seeded = [scene for scene in scenes if not isinstance(scene, Problem)]
    words = [name_of(scene) if callable(scene) else str(scene) for scene in seeded]
    for word in functions:
        if words.count(word) > 1 or word in SCENES:
            raise ValueError(f"scenes: two are called {word}; give the function another name")

    def load(word: str, seed: int) -> Problem:
        if word not in functions:
            return load_scene(word, seed)
        problem = functions[word](seed)
        require(problem, word, "a function that returns a Problem", Problem)
        return problem

    return words, load


def _require_told_apart(names: Sequence[tuple[str, int]]) -> None:
    """Refuses two problems with the same name and seed, since their rows would look alike."""
    if len(set(names)) < len(names):
        raise ValueError("scenes: two have the same name; give them different names")


def _require_guard() -> None:
    """Refuses a script that each worker process would run from its first line on."""
    script = Path(str(getattr(sys.modules["__main__"], "__file__", "")))
    if script.suffix == ".py" and script.is_file() and "__main__" not in script.read_text():
        words = 'each worker imports your script; put its work under `if __name__ == "__main__":`'
        raise ValueError(f"workers: {words}")


def _nobody(message: str) -> None:
    """Discards the note on seeds that give the same scene; the table shows which were kept."""
