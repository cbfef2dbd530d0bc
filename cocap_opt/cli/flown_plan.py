"""Reads and flies a plan for a command that writes its flight; errors are one line."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from cocap_opt.cli.flight_options import FlightOptions
from cocap_opt.cli.options import load_planned
from cocap_opt.data import FieldError, ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.flight.flights import Flight
from cocap_opt.missions import FORMATS, Export, Writer
from cocap_opt.output.files import GivenPlan, PlanReader, check_output
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.options import Option, UsageError

_log = logging.getLogger(__name__)

_OF_FLIGHTS = "every", "smooth", "start"
_PLACES = "earth.crs", "earth.origin"


class FlownPlan(NamedTuple):
    """A plan, its flight, and the content of the files that contain the flight."""

    given: GivenPlan
    flight: Flight
    export: Export


class Order(NamedTuple):
    """A plan to fly, and the output file for its flight.

    Attributes
    ----------
    suffix : ending of the output file, one of FORMATS
    start : time of step 0, as typed
    every : time between rows, s; None: the default
    local : True: without latitudes and longitudes
    hovering : True: also if no drone moves
    landed : True: drones of the rest of a mission take off again, with full batteries
    """

    scene: str
    seed: int
    plan: Path
    output: Path
    suffix: str
    flown: FlightOptions
    start: str | None = None
    every: float | None = None
    local: bool = False
    hovering: bool = False
    landed: bool = False

    def carried_out(self, write: Writer) -> FlownPlan:
        """Reads the plan, flies it, and writes the content of its files.

        Raises
        ------
        UsageError
            If an option does not fit the format; the message is one line.
        FileError
            If the plan cannot be read or flown; the message is one line, with a remedy.
        """
        form, begins = FORMATS[self.suffix], None
        if self.start is not None:
            begins = _start_of(self.start, self.suffix, form.has_dates)
        _require_spacing(self.every)
        if self.local and form.on_earth:
            raise UsageError(
                f"--local: must be left out for {self.suffix}, which contains positions on the "
                "Earth"
            )
        check_output(self.output, self.scene, self.plan)
        given = PlanReader(self.scene, load_planned(self.scene, self.seed)).plan(
            self.plan, any_objective=True
        )
        if self.landed:
            given = given._replace(problem=_on_the_ground(given.problem))
        if form.takes_off and given.problem.begins_in_the_air:
            raise UsageError(
                f"-o: must not end with {self.suffix}, as these missions take off, and the scene "
                "is the rest of a mission whose drones are in the air; .csv has their places, and "
                "--landed says that they have landed"
            )
        with self.in_words():
            flight = self.flown.flight(given.problem, given.plan, self.local)
            flight = flight._replace(start=begins, cut_short=given.cut_short)
            export = write(flight, self.every)
        _require_motion(self.plan, given.plan, given.cut_short, self.hovering)
        return FlownPlan(given, flight, export)

    @contextmanager
    def in_words(self) -> Iterator[None]:
        """Converts errors of flights into errors that name the option or the file to change."""
        try:
            yield
        except ProblemError as error:
            raise self._named(error) from error

    def _named(self, error: ProblemError) -> Exception:
        field = error.field if isinstance(error, FieldError) else None
        if field in _OF_FLIGHTS or (field == "step" and self.flown.step is not None):
            return UsageError(f"--{error}")
        if field in ("earth", "step") or (field or "").startswith("robots["):
            return FileError(f"{self.scene}: {error}")
        if field == "crs":  # a part of the scene is outside the area where its system is defined
            return FileError(f"{self.scene}: earth.{error}")
        if field in _PLACES:
            is_needed = FORMATS[self.suffix].on_earth
            way_out = "" if is_needed else "; use --local to leave latitudes and longitudes out"
            return FileError(f"{self.scene}: {error}{way_out}")
        return FileError(f"{self.plan}: {error}")


def _on_the_ground(rest: Problem) -> Problem:
    """Returns the rest of a mission with drones that take off again; how long their new batteries
    last is not known.
    """
    if not rest.begins_in_the_air:
        raise UsageError("--landed: must be left out, as the scene is not the rest of a mission")
    if any(robot.limits and robot.limits.endurance is not None for robot in rest.robots):
        _log.warning(
            "--landed: how long the batteries last is not checked, as the scene has only what was "
            "left of the old ones"
        )
    robots = []
    for i, robot in enumerate(rest.robots):
        if robot.number not in (None, i):
            _log.warning("drone %d of these files is drone %d of the mission", i, robot.number)
        limits = robot.limits and robot.limits.replace(endurance=None)
        robots.append(robot.replace(number=None, limits=limits))
    return rest.replace(robots=tuple(robots))


def _start_of(text: str, suffix: str, is_dated: bool) -> datetime:
    """Returns the time at which a flight starts, for a file with a given ending."""
    if not is_dated:
        raise UsageError(f"--start: must be left out for {suffix}, whose times are seconds")
    try:
        found = datetime.fromisoformat(text)
        if found.tzinfo is not None:
            found.astimezone(UTC)  # may be out of range
            return found
    except (ValueError, OverflowError):
        pass
    raise UsageError(
        f"--start: must be a date and a time with its offset from UTC, such as "
        f"2026-05-01T10:00:00+02:00 or 2026-05-01T08:00:00Z, not {text[:40]!r}"
    )


def _require_motion(path: Path, plan: Plan, cut_short: str, hovering: bool) -> None:
    """Rejects a plan in which no drone moves, unless requested; warns of a plan that was cut
    short.
    """
    if plan.stays and not hovering:
        why, longer = cut_short or "all drones stay at their starts", ""
        if cut_short:
            longer = "`plan` with a longer --time-limit may find a plan that moves, "
        raise FileError(
            f"{path}: no drone moves ({why}); {longer}use --hovering to fly it as it is"
        )
    if cut_short:
        _log.warning(
            "%s: %s; `plan` with a longer --time-limit may find a better one", path, cut_short
        )


def _require_spacing(every: float | None) -> None:
    """Rejects row spacings that are not a positive number of seconds."""
    if every is not None:
        Option("--every").require_duration(every)
