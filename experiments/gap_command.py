"""The command `gap`: planners' plans on scenes and seeds, and what bounds them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter

from cocap_opt.io import problem_digest
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from experiments.files import read_plans
from experiments.gap_table import told_apart
from experiments.numbers import numbers
from experiments.options import (
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
from experiments.printing import print_gap_table, print_json, print_table, titles
from experiments.rows import SOLVERS, Row, default_planners, mean_table
from experiments.streams import say
from experiments.sweeps.cells import BOUND
from experiments.sweeps.earlier import seeds_known
from experiments.sweeps.run import Group, Settings
from experiments.sweeps.sweep import Hired, has_error, sweep

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
    known = seeds_known(out)
    groups = {
        (name, seed): Group(
            problem,
            known.get((problem.name, problem_digest(problem)), seed),
            planner or default_planners(problem),
            settings,
            others.plans,
        )
        for (name, seed), problem in (problems | others.problems).items()
    }
    rows = sweep(_each_once(groups), settings, out, hired, retry, others.about)
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
    """The scenes that the words name, told apart by their names."""
    cells = list(dict.fromkeys((name, seed) for name in scenes for seed in seeds))
    if plans and len(cells) > 1:
        raise UsageError("--plan: the plans must be for one scene and one seed")
    return told_apart({(name, seed): load(name, seed) for name, seed in cells})


def _each_once(groups: Mapping[tuple[str, int], Group]) -> list[Group]:
    """The groups without those that make the same scene as a seed before them."""
    kept: list[Group] = []
    for scene in dict.fromkeys(scene for scene, _ in groups):
        some = [group for (name, _), group in groups.items() if name == scene]
        first: dict[str, Group] = {}
        for group in some:
            first.setdefault(group.digest, group)
        if len(first) < len(some):
            words = f"{len(some)} seeds make {len(first)} different scenes"
            say(f"{scene}: {words}; only the first seed of each is taken")
        kept += first.values()
    return kept


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
