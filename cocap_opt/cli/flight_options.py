"""Options of commands that fly a plan, and the words in which they refuse one."""

import logging
import math
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import FLAG
from cocap_opt.data import FieldError, ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.flight.flight_scene import FlightScene
from cocap_opt.flight.flights import Flight, LimitError
from cocap_opt.missions import FORMATS
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.options import Option, UsageError

_log = logging.getLogger(__name__)

_OF_FLIGHTS = "every", "smooth", "start"
_PLACES = "earth.crs", "earth.origin"
_MARGINS = 0.25, 0.5, 1.0  # m, which are tried for a plan that cannot be flown

Start = Annotated[
    str | None,
    Parameter(help="time of step 0, such as 2026-05-01T10:00:00Z; for formats with dates"),
]
Every = Annotated[
    float | None,
    Parameter(help="seconds between rows (default: one row per step, ten with --smooth)"),
]
Local = Annotated[bool, FLAG(name="--local", help="leave out latitudes and longitudes")]
Hovering = Annotated[bool, FLAG(name="--hovering", help="also write plans in which no drone moves")]
Smooth = Annotated[bool, FLAG(name="--smooth", help="fly with continuous speed and acceleration")]
StepSeconds = Annotated[
    float | None,
    Parameter(name="--step", help="seconds of a step, if the scene defines none"),
]
Margin = Annotated[
    float | None,
    Parameter(
        help="metres by which drones may come nearer to people than the scene's `people` and "
        "`over_people`"
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class FlightOptions:
    """The options of commands that fly a plan."""

    step: StepSeconds = None
    smooth: Smooth = False
    margin: Margin = None

    def flight(self, problem: Problem, plan: Plan, is_local: bool) -> Flight:
        """Returns the flight of a plan as the options ask for it.

        Parameters
        ----------
        is_local : nobody asks where it is on the Earth

        Raises
        ------
        ProblemError
            If it breaks a rule or cannot be flown; one line, with what would do.
        """
        flown_in = self._scene(problem)
        try:
            return (flown_in.without_earth if is_local else flown_in).flight(plan, self.smooth)
        except LimitError as error:
            ways = [
                f"set {_longer(problem, error.any_plan)} in the scene's recipe and plan again"
                if self.step is None
                else f"--step {error.step:g} would do"
            ]
            if self.smooth and self.margin is None:
                ways += _margins_that_do(flown_in.problem, plan)
            before = f"{error.way_out}, or " if error.way_out else "; "
            raise ProblemError(f"{error.words}{before}{', or '.join(ways)}") from error

    def _scene(self, problem: Problem) -> FlightScene:
        """Returns the scene that plans of a problem are flown in."""
        if self.step is not None and not Option("--step").require_seconds(self.step) > 0:
            raise UsageError("--step: must be more than 0 seconds")
        try:
            return FlightScene.of(problem, self.step, self.margin)
        except FieldError as error:
            raise UsageError(f"--{error}") from error
        except ProblemError as error:  # it is out of range, or too short for the drones' limits
            raise UsageError(f"--step: {error}") from error


AS_PLANNED = FlightOptions()


def _longer(problem: Problem, step: float) -> str:
    """Says which step a recipe must have, and how many of them last as long as those of before."""
    steps = math.floor(problem.horizon * (problem.step or 0.0) / step)
    return f"step = {step:g}" + (f" and steps = {steps}" if steps > 1 else "")


def _margins_that_do(problem: Problem, plan: Plan) -> Iterator[str]:
    """Yields the least margin with which drones can fly a plan smoothly, if there is one."""
    asked = problem.airspace.people_aside
    for margin in _MARGINS:
        if margin > asked / 2:
            return
        nearer = FlightScene.of(problem, None, margin)
        try:
            nearer.flight(plan, smooth=True)
        except ProblemError:
            continue
        kept = nearer.problem.airspace.people_aside
        yield f"fly with --margin {margin:g}, {kept:g} m from people in place of {asked:g} m"
        return


def in_words(
    error: ProblemError, scene: str, plan: Path, suffix: str, by_option: bool
) -> Exception:
    """Returns the error that names the option or the file that is to be changed.

    Parameters
    ----------
    suffix : of the file that is asked for
    by_option : True: `--step` says how long a step lasts, not the scene
    """
    field = error.field if isinstance(error, FieldError) else None
    if field in _OF_FLIGHTS or (field == "step" and by_option):
        return UsageError(f"--{error}")
    if field in ("earth", "step") or (field or "").startswith("robots["):
        return FileError(f"{scene}: {error}")
    if field == "crs":  # something of the scene is where its system is not defined
        return FileError(f"{scene}: earth.{error}")
    if field in _PLACES:
        way_out = (
            "" if FORMATS[suffix].on_earth else "; --local leaves latitudes and longitudes out"
        )
        return FileError(f"{scene}: {error}{way_out}")
    return FileError(f"{plan}: {error}")


def start_of(text: str, suffix: str, is_dated: bool) -> datetime:
    """Returns the time at which a flight starts, for a file of some ending."""
    if not is_dated:
        raise UsageError(f"--start: must be left out for {suffix}, whose times are seconds")
    try:
        found = datetime.fromisoformat(text)
        if found.tzinfo is not None:
            found.astimezone(UTC)  # which may be out of range
            return found
    except (ValueError, OverflowError):
        pass
    raise UsageError(
        f"--start: must be a date and a time with its offset from UTC, such as "
        f"2026-05-01T10:00:00+02:00 or 2026-05-01T08:00:00Z, not {text[:40]!r}"
    )


def require_motion(path: Path, plan: Plan, cut_short: str, hovering: bool) -> None:
    """Refuses a plan in which no drone moves, unless that is asked for; warns of one cut short."""
    if plan.stays and not hovering:
        why, longer = cut_short or "all drones stay at their starts", ""
        if cut_short:
            longer = "a longer --time-limit of `plan` may give one that moves, "
        raise FileError(f"{path}: no drone moves ({why}); {longer}--hovering flies it as it is")
    if cut_short:
        _log.warning(
            "%s: %s; a longer --time-limit of `plan` may give a better one", path, cut_short
        )


def require_spacing(every: float | None) -> None:
    """Refuses rows that are no seconds apart."""
    if every is not None and not Option("--every").require_seconds(every) > 0:
        raise UsageError("--every: must be more than 0 seconds")
