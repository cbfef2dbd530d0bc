"""Options of commands that fly a plan."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import FLAG
from cocap_opt.data import FieldError, ProblemError
from cocap_opt.flight.flight_scene import FlightScene
from cocap_opt.flight.flights import Flight, LimitError
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.options import Option, UsageError

_MARGINS = 0.25, 0.5, 1.0  # m; margins tried for a plan that cannot be flown

Start = Annotated[
    str | None,
    Parameter(help="time of step 0, e.g. 2026-05-01T10:00:00Z; for formats with dates"),
]
Every = Annotated[
    float | None,
    Parameter(help="seconds between rows (default: one row per step, ten with --smooth)"),
]
Local = Annotated[bool, FLAG(name="--local", help="leave out latitudes and longitudes")]
Hovering = Annotated[bool, FLAG(name="--hovering", help="also write plans in which no drone moves")]
Landed = Annotated[
    bool,
    FLAG(
        name="--landed",
        help="for the rest of a mission: its drones have landed, e.g. for full batteries, and take "
        "off again below their first places",
    ),
]
Smooth = Annotated[bool, FLAG(name="--smooth", help="fly with continuous speed and acceleration")]
StepSeconds = Annotated[
    float | None,
    Parameter(name="--step", help="seconds of a step, if the scene defines none"),
]
Margin = Annotated[
    float | None,
    Parameter(
        help="metres by which drones may come closer to people than the scene's `people` and "
        "`over_people` allow"
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
        """Returns the flight of a plan as the options request it.

        Parameters
        ----------
        is_local : True: positions on the Earth are not needed

        Raises
        ------
        ProblemError
            If the plan breaks a rule or cannot be flown; the message is one line, with a remedy.
        """
        flown_in = self._scene(problem)
        try:
            return (flown_in.without_earth if is_local else flown_in).flight(plan, self.smooth)
        except LimitError as error:
            ways = [
                f"set {_longer(problem, error.any_plan)} in the scene's recipe and plan again"
                if self.step is None
                else f"use --step {error.step:g}"
            ]
            if self.smooth and self.margin is None:
                ways += _margins_that_do(flown_in.problem, plan)
            before = f"{error.way_out}, or " if error.way_out else "; "
            raise ProblemError(f"{error.words}{before}{', or '.join(ways)}") from error

    def _scene(self, problem: Problem) -> FlightScene:
        """Returns the scene in which plans of a problem are flown."""
        if self.step is not None:
            Option("--step").require_duration(self.step)
        try:
            return FlightScene.of(problem, self.step, self.margin)
        except FieldError as error:
            raise UsageError(f"--{error}") from error
        except ProblemError as error:  # out of range, or too short for the drones' limits
            raise UsageError(f"--step: {error}") from error


AS_PLANNED = FlightOptions()


def _longer(problem: Problem, step: float) -> str:
    """Returns the step length that a recipe needs, and the number of steps for the same
    duration.
    """
    steps = math.floor(problem.horizon * (problem.step or 0.0) / step)
    return f"step = {step:g}" + (f" and steps = {steps}" if steps > 1 else "")


def _margins_that_do(problem: Problem, plan: Plan) -> Iterator[str]:
    """Yields the smallest margin with which drones can fly a plan smoothly, if there is one."""
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
        yield f"fly with --margin {margin:g}, {kept:g} m from people instead of {asked:g} m"
        return
