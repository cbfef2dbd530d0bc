"""Options of the commands that fly a plan, and the flight that they ask for."""

from collections.abc import Iterator
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.data import ProblemError
from cocap_opt.experiments.cli.options import FLAG
from cocap_opt.experiments.console.options import Option, UsageError
from cocap_opt.experiments.results.flights import Flight, LimitError
from cocap_opt.problem import Airspace, Plan, Problem

_MARGINS = 0.25, 0.5, 1.0  # m, which are tried for a plan that cannot be flown

Smooth = Annotated[bool, FLAG(name="--smooth", help="with continuous speed and acceleration")]
StepSeconds = Annotated[
    float | None,
    Parameter(name="--step", help="seconds of a step, of scenes that do not say it"),
]
Margin = Annotated[
    float | None,
    Parameter(
        help="metres by which drones may be nearer to people than the scene says, aside (`people`) "
        "and over heads (`over_people`)"
    ),
]


def flight_of(
    problem: Problem, plan: Plan, smooth: bool, margin: float | None, by_option: bool
) -> Flight:
    """Returns the flight of a plan as the options ask for it.

    Parameters
    ----------
    by_option : True: `--step` says how long a step lasts, not the scene

    Raises
    ------
    ProblemError
        If it breaks a rule or cannot be flown; one line, with what would do.
    """
    nearer, asked = _with_margin(problem, margin)
    try:
        return Flight.of(nearer, plan, smooth)._replace(asked=asked)
    except LimitError as error:
        ways = [
            f"--step {error.step:g} would do"
            if by_option
            else f"set step = {error.step:g} in the scene's recipe and plan again"
        ]
        if smooth and margin is None:
            ways += _margins_that_do(problem, plan)
        raise ProblemError(f"{error.words}; {', or '.join(ways)}") from error


def _margins_that_do(problem: Problem, plan: Plan) -> Iterator[str]:
    """Yields the least margin with which drones can fly a plan smoothly, if there is one."""
    most = problem.airspace.people_aside / 2
    for margin in _MARGINS:
        if margin > most:
            return
        nearer = _with_margin(problem, margin)[0]
        try:
            Flight.of(nearer, plan, True)
        except ProblemError:
            continue
        kept, asked = nearer.airspace.people_aside, problem.airspace.people_aside
        yield f"fly with --margin {margin:g}, {kept:g} m from people in place of {asked:g} m"
        return


def with_step(problem: Problem, step: float | None) -> Problem:
    """Returns the scene with the duration of a step, from itself or from the option."""
    if problem.step is None and step is None:
        raise UsageError(
            f"--step: must be given, for {problem.name} does not say how many seconds a step lasts"
        )
    if problem.step is not None and step is not None:
        raise UsageError(
            f"--step: must be left out, for {problem.name} says it: {problem.step:g} s"
        )
    if step is not None and not Option("--step").require_seconds(step) > 0:
        raise UsageError("--step: must be more than 0 seconds")
    try:
        return problem if step is None else problem.replace(step=step)
    except ProblemError as error:  # it is out of range, or too short for the drones' limits
        raise UsageError(f"--step: {error}") from error


def _with_margin(problem: Problem, margin: float | None) -> tuple[Problem, Airspace | None]:
    """Returns a scene in which drones may be nearer to people by a margin (m).

    Its own airspace follows, or None where nothing is changed.
    """
    if margin is None:
        return problem, None
    airspace = problem.airspace
    if not airspace.people_aside:
        raise UsageError("--margin: the scene asks for no distance to people; leave it out")
    wrong = UsageError(
        "--margin: must be from 0 m to less than what the scene's drones keep from people, "
        f"{airspace.people_aside:g} m"
    )
    aside = airspace.people_aside - margin
    if not (margin >= 0 and aside > 0):
        raise wrong
    above = None if airspace.people_above is None else max(airspace.people_above - margin, 0.0)
    try:
        kept = airspace.replace(people_aside=aside, people_above=above)
    except ProblemError:  # what is left is no more than rounding
        raise wrong from None
    return problem.replace(airspace=kept), airspace if margin else None
