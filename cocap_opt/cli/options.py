"""Options that several commands share: their names, help and allowed values."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, Token

from cocap_opt.console.streams import without_warnings
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.flight.strain import strains
from cocap_opt.plausibility import narrow_way, warnings, warnings_before_starts
from cocap_opt.problem import Problem, SceneData
from cocap_opt.run.no_plan import why_no_plan
from cocap_opt.run.options import Allowance, Option, UsageError
from cocap_opt.scenarios import FORMATS, NOTHING, SCENES, load_scene

_log = logging.getLogger(__name__)


def _whole(kind: object, tokens: Sequence[Token]) -> int:
    """Returns the whole number given to an option; rejects fractions."""
    return Option(tokens[0].keyword or "").whole(tokens[0].value)


FLAG = partial(Parameter, negative="", show_default=False)
Scene = Annotated[
    str, Parameter(help="name of a built-in scene, or a scene file in any supported format")
]
PlanPath = Annotated[
    Path,
    Parameter(
        help="plan for the scene: a file from `plan`, a plan of the project that the scene comes "
        "from, or a solver's solution (.sol) of a program from `export`"
    ),
]
Results = Annotated[Path, Parameter(help="results folder, written by `gap --out`")]
Whole = Annotated[int, Parameter(converter=_whole)]
Seed = Annotated[int, Parameter(converter=_whole, help="seed of the scene, >= 0")]
Seconds = Annotated[
    float,
    Parameter(
        name="--time-limit",
        help="seconds for coverage and search, excluding reading, estimating, compiling and "
        "checking; inf: no limit",
    ),
]
Work = Annotated[
    int | None,
    Parameter(
        name="--work-limit",
        converter=_whole,
        help="limit in units of work, e.g. pricing rounds or nodes of CoCap's tree; results are "
        "the same on every machine unless --time-limit is hit first",
    ),
]
Workers = Annotated[
    int | None,
    Parameter(
        converter=_whole,
        help="worker processes, one per core (default: this process only)",
    ),
]
Json = Annotated[bool, FLAG(name="--json", help="print one JSON object")]
Verbose = Annotated[
    bool, FLAG(name="--verbose", help="also print counts and times of the computation")
]
Free = Annotated[bool, FLAG(help="ignore collisions between drones")]
Output = Annotated[Path | None, Parameter(name=["-o", "--output"], help="file to write")]
PlanOutput = Annotated[
    Path | None, Parameter(name=["-o", "--output"], help="file to write the plan to")
]
OfScenes = Annotated[
    list[str] | None,
    Parameter(
        name="--scene",
        negative="",
        help="scene whose results to use; may be repeated (default: all scenes of the results)",
    ),
]
OfPlanners = Annotated[
    list[str] | None,
    Parameter(
        name="--planner",
        negative="",
        help="planner whose results to use; may be repeated (default: all planners of the results)",
    ),
]


def load(scene: str, seed: int, options: Mapping[str, str] = NOTHING) -> Problem:
    """Returns a scene, given by name or file, and logs doubtful entries of a file."""
    Option("--seed").require_whole(seed)
    problem = load_scene(scene, seed, options)
    say_doubts(scene, seed, problem)
    return problem


def say_doubts(scene: str, seed: int, problem: SceneData) -> None:
    """Logs doubtful entries of a scene from a file, whose drones may not have places yet."""
    if scene in SCENES:  # built-in scenes are intended as they are
        return
    has_places = isinstance(problem, Problem)
    for warning in warnings(problem) if has_places else warnings_before_starts(problem):
        _say_once(scene, seed, warning)


def plan_with_scene(scene: str) -> tuple[Path, ...]:
    """Returns a scene's file if it is also the file of a plan that names its scene."""
    path = Path(scene)
    both = any(kind.scenes.has(path) and kind.plans.has(path) for kind in FORMATS.values())
    return (path,) if both else ()


def load_planned(scene: str, seed: int) -> Problem:
    """Returns a scene that has a plan already: doubtful entries have been logged before."""
    Option("--seed").require_whole(seed)
    with without_warnings("cocap_opt.scenarios"):
        return load_scene(scene, seed)


def say_strains(scene: str, seed: int, problem: Problem) -> None:
    """Logs which drones' limits a smooth flight would exceed, when a scene is first loaded."""
    for words in strains(problem):
        _say_once(scene, seed, words)


def say_narrow_way(scene: str, seed: int, problem: Problem) -> None:
    """Logs where drones must queue, if anywhere, since this may be why there is no plan."""
    if words := narrow_way(problem):
        _say_once(scene, seed, words)


def say_why_no_plan(scene: str, seed: int, problem: Problem) -> None:
    """Logs why there is no plan, as far as this can be found without a search."""
    for words in why_no_plan(problem):
        _say_once(scene, seed, words)


def _say_once(scene: str, seed: int, words: str) -> None:
    _log.warning("%s, seed %d: %s", scene, seed, words, extra={"once": f"{scene}, {words}"})


@Parameter(name="*")
@dataclass(frozen=True)
class Budget:
    """The options of commands that limit a computation."""

    time_limit: Seconds = 60.0
    work_limit: Work = None

    @property
    def allowance(self) -> Allowance:
        """Returns the allowance of the options; raises UsageError if they are invalid."""
        work = self.work_limit
        if work is not None:
            work = Option("--work-limit").require_whole(work)
        return Allowance(Option("--time-limit").require_limit(self.time_limit), work)


USUAL = Budget()


def chosen(
    rows: Sequence[GapRow], scenes: Sequence[str] | None, planners: Sequence[str] | None
) -> list[GapRow]:
    """Returns results of some scenes and planners, by default of all; at least one."""
    for name in scenes or []:
        Option("--scene").require_one_of(name, dict.fromkeys(row.scene for row in rows))
    for name in planners or []:
        Option("--planner").require_one_of(name, dict.fromkeys(row.planner or "" for row in rows))
    kept = [
        row
        for row in rows
        if (not scenes or row.scene in scenes) and (not planners or row.planner in planners)
    ]
    if not kept:
        raise UsageError("--planner: has no results on the scenes of --scene")
    return kept
