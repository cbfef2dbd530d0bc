"""The command `gap`: compares planners, and plans from files, on scenes and seeds, with bounds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, NamedTuple, Self

from cyclopts import Parameter

from cocap_opt.cli.options import FLAG, Budget, Json, Scene, Verbose, load, say_why_no_plan
from cocap_opt.cli.workforce import HERE, Workforce
from cocap_opt.console.exit_codes import FAILED, INTERRUPTED
from cocap_opt.experiments.sweeps.cells import BOUND
from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.sweeps.scenes import Problems, Scenes
from cocap_opt.experiments.sweeps.start_choices import CHOICES, StartChoices
from cocap_opt.experiments.sweeps.sweep import sweep
from cocap_opt.experiments.tables.gap_table import print_gap_table
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.experiments.tables.start_sets import print_start_sets
from cocap_opt.files.documents import FileError, PlanFile, problem_digest
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import PlanReader
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.named_planners import FORMS, own_planners
from cocap_opt.run.options import Option, UsageError
from cocap_opt.text import OTHERWISE, other_scene, printable


@Parameter(name="*")
@dataclass(frozen=True)
class _CellBudget(Budget):
    """The options that limit each planner and bound of a scene and seed."""

    time_limit: Annotated[
        float,
        Parameter(
            name="--time-limit", help="seconds for each plan, excluding coverage; must be finite"
        ),
    ] = 60.0


_USUAL = _CellBudget()
_TAKEN = (*SOLVERS, BOUND)  # names with another meaning in the table


class _GivenPlan(NamedTuple):
    """A plan from a file, and the digest of its problem."""

    plan: Plan | PlanFile  # only the plan, if the format is foreign
    digest: str

    @property
    def planner(self) -> str:
        """The planner as the file names it; empty if it does not."""
        return printable(self.plan.planner) if isinstance(self.plan, PlanFile) else ""


class GivenPlans(NamedTuple):
    """The plans of files, by the digest of their problem and by name.

    Attributes
    ----------
    problems : the problems of the command, or a variant if the plans are for that
    own_starts : True if drones start where the scene's file says
    """

    plans: dict[str, dict[str, Plan | PlanFile]]
    problems: Problems
    own_starts: bool

    @classmethod
    def read(cls, paths: Sequence[Path], problems: Problems) -> Self:
        """Reads plans, each for one of the problems.

        A plan is named after its planner, as given in its file, or after the file if the planner is
        unknown. If the planner is built in, or if two plans for one problem have the same planner,
        the name of the file is added.

        Raises
        ------
        FileError, UsageError
            If a plan is for none of the problems, or a file has the name of a planner.
        """
        titles = PlanReader.titles(paths)
        for title in titles:
            if title in _TAKEN:
                raise UsageError(f"--plan: {title} is the name of a planner; rename the file")
        given, fitting = (_of_one if len(problems) == 1 else _of_several)(paths, problems)
        plans: dict[str, dict[str, Plan | PlanFile]] = {}
        for name, given_plan in zip(_names(titles, given), given, strict=True):
            plans.setdefault(given_plan.digest, {})[name] = given_plan.plan
        is_variant = any(fitting[key] is not problem for key, problem in problems.items())
        return cls(plans, fitting, is_variant)

    def of(self, problem: Problem) -> dict[str, Plan | PlanFile]:
        """Returns the plans for a problem, by name."""
        return self.plans.get(problem_digest(problem), {}) if self.plans else {}


def _of_one(paths: Sequence[Path], problems: Problems) -> tuple[list[_GivenPlan], Problems]:
    """Reads plans for one problem, possibly foreign plans for a variant of it."""
    ((key, problem),) = problems.items()
    plans = PlanReader(key[0], problem).plans(paths)
    variant = plans[0].problem if plans else problem
    digest = problem_digest(variant)
    return [_GivenPlan(plan.file or plan.plan, digest) for plan in plans], {key: variant}


def _of_several(paths: Sequence[Path], problems: Problems) -> tuple[list[_GivenPlan], Problems]:
    """Reads plan files, each for the problem whose digest it contains."""
    readers = {
        problem_digest(problem): PlanReader(scene, problem)
        for (scene, _), problem in problems.items()
    }
    return [_matched(path, readers) for path in paths], problems


def _matched(path: Path, readers: Mapping[str, PlanReader]) -> _GivenPlan:
    """Reads a plan file for one of the problems, whose readers are given by digest."""
    content = next(iter(readers.values())).claim(path)
    if isinstance(content, Plan):
        raise FileError(f"{path}: does not say which seed it is for; name one scene and one seed")
    if not isinstance(content, PlanFile):
        raise FileError(f"{path}: must be a plan, not a certificate")
    if content.digest not in readers:
        names = [reader.problem.name for reader in readers.values()]
        ours = content.scene if content.scene in names else " or ".join(dict.fromkeys(names))
        which = other_scene(content.scene, ours)
        raise FileError(f"{path}: digest: the plan was made for {which}; {OTHERWISE}")
    readers[content.digest].flown(path, content)
    return _GivenPlan(content, content.digest)


def _names(titles: Sequence[str], given: Sequence[_GivenPlan]) -> list[str]:
    """Returns the names of plans: those of their planners if these are free, otherwise with file
    names.
    """
    digests_of: dict[str, list[str]] = {}
    for given_plan in given:
        digests_of.setdefault(given_plan.planner, []).append(given_plan.digest)
    free = {
        planner
        for planner, digests in digests_of.items()
        if planner not in (*_TAKEN, *titles)
        and ":" not in planner
        and len(digests) == len(set(digests))
    }
    planners = [given_plan.planner for given_plan in given]
    return [
        title
        if not planner or planner == title
        else planner
        if planner in free
        else f"{planner} ({title})"
        for planner, title in zip(planners, titles, strict=True)
    ]


def _gap(
    *scene: Scene,
    planner: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            show_default=False,
            help=f"one of {', '.join(SOLVERS)}; {FORMS}; may be repeated",
        ),
    ] = None,
    seeds: Annotated[str, Parameter(help="seeds, e.g. 0-9 or 0,3,7")] = "0",
    budget: _CellBudget = _USUAL,
    bound_limit: Annotated[
        float | None, Parameter(help="seconds for each bound (default: those of --time-limit)")
    ] = None,
    out: Annotated[
        Path | None,
        Parameter(
            name=["--out", "-o"], help="folder for results.csv, scenes, plans and certificates"
        ),
    ] = None,
    rendered: Annotated[
        bool,
        Parameter(
            negative="",
            show_default=False,
            help="also show J of each plan's rendered pixels",
        ),
    ] = False,
    plan: Annotated[
        list[Path] | None,
        Parameter(
            negative="",
            show_default=False,
            help="plan file to compare, in a row with its scene and seed; may be repeated",
        ),
    ] = None,
    starts: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            show_default=False,
            help=f"where drones start: {', '.join(CHOICES)}; each choice is a separate scene, and "
            "the last table compares them; may be repeated",
        ),
    ] = None,
    workforce: Workforce = HERE,
    retry: Annotated[
        bool,
        FLAG(help="retry failed runs in the --out folder"),
    ] = False,
    json: Json = False,
    verbose: Verbose = False,
) -> int:
    """Print the gap table: every planner's J against the best certified bound.

    The gap is measured to the bound under the scene's rules, the gap without rules (gap_free in
    JSON and results.csv) to the bound for drones that may collide.
    The default planners are greedy, sequential, cocap, cocap-vs and cocap-prices, and joint for one
    or two drones.
    Results already in the --out folder are not recomputed; for each scene, seed and
    planner the table has the newest row, with the lowest proved bound.
    The exit code is 1 if a planner or a bound ended with an error, and 130 if Ctrl-C ended the
    command before all scenes and seeds were complete.

    Example: cocap-opt gap corridor bottleneck --seeds 0-99 --workers 2 --out DIR
    """
    foreign = own_planners(Option("--planner"), planner or [])
    kept = out is not None or workforce.is_elsewhere
    settings = _settings(budget, bound_limit, rendered, kept)
    if retry and out is None:
        raise UsageError(
            "--retry: name the folder with --out; without --out, results are not stored"
        )
    hired = workforce.hired(settings)
    scenes = _scenes(scene, Option("--seeds").numbers(seeds))
    if plan and starts:
        raise UsageError("--plan: requires the starts of the scene; omit --starts")
    choices = StartChoices.of(scenes.problems, starts or [])
    others = GivenPlans.read(plan or [], choices.problems)
    instances = [
        Instance(
            problem, 0 if others.own_starts else seed, planner,
            settings, others.of(problem), others.own_starts, foreign,
        )
        for (_, seed), problem in others.problems.items()
    ]  # fmt: skip
    rows = sweep(instances, out, hired, retry, scenes.is_same)
    _say_why_without_plan(rows, others.problems)
    if json:
        print_result({"rows": rows}, json)
    else:
        print_gap_table(rows, verbose)
        print_start_sets(choices.groups, rows)
    if any(row.has_error for row in rows):
        return FAILED
    return 0 if all(instance.is_finished for instance in instances) else INTERRUPTED


def _say_why_without_plan(rows: Sequence[GapRow], problems: Problems) -> None:
    """Logs why there may be no plan in scenes for which a planner has found none."""
    failed = {
        (row.scene, row.seed) for row in rows if row.reason in (Reason.FAILED, Reason.INFEASIBLE)
    }
    for (scene, seed), problem in problems.items():
        if (problem.name, seed) in failed:
            say_why_no_plan(scene, seed, problem)


def _settings(budget: Budget, bound_limit: float | None, rendered: bool, kept: bool) -> Settings:
    Option("--time-limit").require_seconds(budget.time_limit)  # a cell must end
    bound_limit = budget.time_limit if bound_limit is None else bound_limit
    allowance = budget.allowance
    Option("--bound-limit").require_seconds(bound_limit)
    return Settings(
        time_limit=allowance.seconds, bound_time_limit=bound_limit, work_limit=allowance.work,
        rendered=rendered, kept=kept,
    )  # fmt: skip


def _scenes(names: Sequence[str], seeds: Sequence[int]) -> Scenes:
    if not names:
        raise UsageError("SCENE: name at least one scene; `cocap-opt scenes` lists them")
    return Scenes(names, seeds, load)


COMMANDS = {"gap": _gap}
