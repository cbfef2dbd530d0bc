"""Options that commands share: what they are called, and what is allowed."""

import logging
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from cocap_opt.experiments.console.numbers import LARGEST
from cocap_opt.experiments.results.rows import Row
from cocap_opt.problem.plausibility import doubts
from cocap_opt.problem.problem import Problem
from cocap_opt.scenarios import NOTHING, load_scene
from cocap_opt.vision.coverage import usable_cores

log = logging.getLogger(__name__)

DEFAULT_SECONDS = 60.0
# What rows say of plans that begin elsewhere than the seed does.
OWN_STARTS: Row = {"seed": None, "starts": "those in the scene's own file"}
Seed = Annotated[int, Parameter(help="seed of the scene, >= 0")]
Seconds = Annotated[float, Parameter(name="--time-limit", help="seconds for each computation")]
Json = Annotated[bool, Parameter(name="--json", negative="", help="print one JSON object")]
Output = Annotated[Path | None, Parameter(name=["-o", "--output"], help="file to write")]
OfScenes = Annotated[
    list[str] | None,
    Parameter(name="--scene", negative="", help="may be repeated; all of the results if not given"),
]
OfPlanners = Annotated[
    list[str] | None,
    Parameter(
        name="--planner", negative="", help="may be repeated; all of the results if not given"
    ),
]


class UsageError(ValueError):
    """An option has a value that is not allowed; the message names it."""


def load(scene: str, seed: int, options: Mapping[str, str] = NOTHING) -> Problem:
    """A scene by its name or file; what is doubtful in it is said."""
    if not 0 <= seed <= LARGEST:
        raise UsageError(f"--seed: must be 0..{LARGEST}, not {seed}")
    problem = load_scene(scene, seed, options)
    for doubt in doubts(problem):
        log.warning("%s: %s", scene, doubt)
    return problem


def choose(option: str, value: str, allowed: Any) -> None:
    """Refuse what is not among the allowed values."""
    if value not in allowed:
        raise UsageError(f"{option}: must be one of {', '.join(allowed)}, not {value!r}")


def chosen(
    rows: Sequence[Row], scenes: Sequence[str] | None, planners: Sequence[str] | None
) -> list[Row]:
    """Results of some scenes and planners, of all if none is named; at least one."""
    kept = list(rows)
    for key, names in (("scene", scenes), ("planner", planners)):
        for name in names or []:
            choose(f"--{key}", name, dict.fromkeys(row[key] for row in rows))
        kept = [row for row in kept if not names or row[key] in names]
    if not kept:
        raise UsageError("--planner: has no results on the scenes of --scene")
    return kept


def positive(option: str, value: float) -> None:
    """Refuse what is no number of seconds; 0 is one, after which there is what needs no search."""
    if not (value >= 0 and math.isfinite(value)):
        raise UsageError(f"{option}: must be a finite number of seconds >= 0, not {value}")


def check_workers(option: str, count: int | None) -> None:
    """Refuse a number of processes unless there is one, and a core for each."""
    if count is not None and not 1 <= count <= usable_cores():
        raise UsageError(f"{option}: must be 1..{usable_cores()}, a core each, not {count}")


def angles(option: str, text: str) -> tuple[float, ...]:
    """Numbers in a list."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"{option}: must be numbers such as 10,30,60, not {text!r}") from None


def file_type(path: Path | None, allowed: tuple[str, ...]) -> str:
    """The ending of a file to be written, which says what kind it is to be."""
    suffix = "" if path is None else path.suffix.lower()
    if suffix not in allowed:
        words = " or ".join(filter(None, (", ".join(allowed[:-1]), allowed[-1])))
        raise UsageError(f"-o: name a file that ends in {words}")
    return suffix
