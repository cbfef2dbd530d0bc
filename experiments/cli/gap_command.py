"""The command `gap`: planners' plans on scenes and seeds, and what bounds them."""

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from cocap_opt.data import ProblemError
from cocap_opt.experiments.cli.options import (
    DEFAULT_SECONDS,
    OWN_STARTS,
    Json,
    Seconds,
    UsageError,
    check_workers,
    choose,
    load,
    positive,
)
from cocap_opt.experiments.console.numbers import numbers
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.results.files import read_plans
from cocap_opt.experiments.results.gap_table import told_apart
from cocap_opt.experiments.results.printing import print_gap_table, print_json, print_table, titles
from cocap_opt.experiments.results.rows import SOLVERS, Row, default_planners, mean_table
from cocap_opt.experiments.sweeps.cells import BOUND
from cocap_opt.experiments.sweeps.earlier import Key
from cocap_opt.experiments.sweeps.run import Group, Settings
from cocap_opt.experiments.sweeps.sweep import Hired, has_error, sweep
from cocap_opt.files.documents import FileError, problem_digest
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.scenarios import load_scene

Problems = dict[tuple[str, int], Problem]  # by scene as typed, and seed


def gap(
    *scene: str,
    planner: Annotated[
        list[str] | None,
        Parameter(negative="", help=f"may be repeated; one of {', '.join(SOLVERS)}"),
    ] = None,
    seeds: Annotated[str, Parameter(help="e.g. 0-9 or 0,3,7")] = "0",
    time_limit: Seconds = DEFAULT_SECONDS,
    bound_limit: Annotated[
        float | None, Parameter(help="seconds for each bound; as --time-limit if not given")
    ] = None,
    out: Annotated[
        Path | None, Parameter(help="folder for results.csv, scenes, plans and certificates")
    ] = None,
    rendered: Annotated[
        bool, Parameter(negative="", help="J of each plan's rendered pixels beside the planned J")
    ] = False,
    plan: Annotated[
        list[Path] | None,
        Parameter(negative="", help="may be repeated; a file whose plan gets a row, too"),
    ] = None,
    workers: Annotated[
        int | None, Parameter(help="processes, each on a core of its own; this one if not given")
    ] = None,
    scheduler: Annotated[
        str | None, Parameter(help="address of a dask scheduler, whose workers are used")
    ] = None,
    cell_limit: Annotated[
        float | None,
        Parameter(help="of workers: seconds after which one gives a planner or a bound up"),
    ] = None,
    retry: Annotated[
        bool, Parameter(negative="", help="try again what has failed in the folder of --out")
    ] = False,
    json: Json = False,
) -> int:
    """Print the gap table: every planner's J against the best certified bound.

    gap is to the bound under the scene's rules, gap_free to that without any rules.
    Planners, if none is named: greedy, sequential, cocap, cocap-vs, and with one or
    two drones joint.
    What is in the folder of --out already is not computed again. The exit code is
    1 if a planner or a bound has ended by an error.

    Example: cocap-opt gap corridor bottleneck --seeds 0-99 --workers 2 --out results
    """
    if not scene:
        raise UsageError("SCENE: name at least one scene; `cocap-opt scenes` lists them")
    for name in planner or []:
        choose("--planner", name, SOLVERS)
    bound_limit = time_limit if bound_limit is None else bound_limit
    positive("--time-limit", time_limit)
    positive("--bound-limit", bound_limit)
    if retry and out is None:
        raise UsageError("--retry: name the folder with --out; without one nothing is kept")
    hired = _hired(workers, scheduler, cell_limit, 10 * (time_limit + bound_limit) + 600)
    problems = _problems(scene, numbers("--seeds", seeds), plan or [])
    others = _plans_of_others(plan or [], problems)
    settings = Settings(limit=time_limit, bound_limit=bound_limit, rendered=rendered)
    groups = [
        Group(
            problem,
            0 if others.about else seed,
            planner or default_planners(problem),
            settings,
            others.plans,
        )
        for (_, seed), problem in (problems | others.problems).items()
    ]
    words = {problem.name: name for (name, _), problem in problems.items()}
    rows = sweep(groups, settings, out, hired, retry, others.about, partial(_is_same, words))
    _print(rows, json)
    return 1 if any(map(has_error, rows)) else 0


def _hired(
    workers: int | None, scheduler: str | None, cell_limit: float | None, default_limit: float
) -> Hired:
    """Who computes, as the options have it."""
    if workers is not None and scheduler is not None:
        raise UsageError("--workers: a scheduler has its own; leave one of the two options out")
    check_workers("--workers", workers)
    if cell_limit is not None and not cell_limit > 0:
        raise UsageError(f"--cell-limit: must be a number of seconds > 0, not {cell_limit}")
    if cell_limit is not None and workers is None and scheduler is None:
        raise UsageError("--cell-limit: is for --workers or --scheduler; this process has no limit")
    return Hired(workers, scheduler, cell_limit or default_limit)


def _problems(scenes: Sequence[str], seeds: Sequence[int], plans: Sequence[Path]) -> Problems:
    """The scenes that the words name, told apart by their names; each scene once."""
    scenes = list(dict.fromkeys(scenes))
    if plans and len(scenes) * len(seeds) > 1:
        raise UsageError("--plan: the plans must be for one scene and one seed")
    return told_apart({
        (name, seed): problem for name in scenes for seed, problem in _seeded(name, seeds).items()
    })  # fmt: skip


def _seeded(scene: str, seeds: Sequence[int]) -> dict[int, Problem]:
    """A scene by its seeds. What other seeds make is one sample, not many; it is that of seed 0."""
    first = {_digest(scene, 0): 0} if any(seeds) else {}
    found: dict[int, Problem] = {}
    again = []
    for seed in seeds:
        problem = load(scene, seed)
        known = first.setdefault(problem_digest(problem), seed)
        found.setdefault(known, problem)
        if known != seed:
            again.append(f"{seed} makes the scene of seed {known}")
    if again:
        more = f", and {len(again) - 1} more likewise" if again[1:] else ""
        say(f"{scene}: seed {again[0]}{more}; each scene is taken once")
    return found


def _digest(scene: str, seed: int) -> str:
    """Digest of what a seed makes; empty if it makes nothing."""
    try:
        return problem_digest(load_scene(scene, seed))
    except (FileError, ProblemError):
        return ""


def _is_same(words: Mapping[str, str], key: Key, digest: str) -> bool:
    """Whether an earlier row's scene is what the words of the command make with its seed."""
    name, seed = key
    return seed is None or name not in words or _digest(words[name], seed) == digest


class _Others(NamedTuple):
    """Plans of others by name, and the variant of the scene that they were made for."""

    plans: dict[str, Plan]
    problems: Problems
    about: Row  # keys for all rows


def _plans_of_others(paths: Sequence[Path], problems: Problems) -> _Others:
    if not paths:
        return _Others({}, {}, {})
    names = titles(paths)
    for name in names:
        if name in (*SOLVERS, BOUND):
            raise UsageError(f"--plan: {name} is what a planner is called; rename the file")
    ((cell, own),) = problems.items()
    fitting, plans = read_plans(paths, cell[0], own)
    named = dict(zip(names, plans, strict=True))
    return _Others(named, {cell: fitting}, {} if fitting is own else OWN_STARTS)


def _print(rows: Sequence[Row], json: bool) -> None:
    if json:
        print_json({"rows": rows})
        return
    print_gap_table(rows)
    if len(rows) > len(mean_table(rows)):
        print_table("means over seeds", mean_table(rows))
