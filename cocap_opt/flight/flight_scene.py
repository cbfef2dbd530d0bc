"""The scene that a plan is flown in: how long a step lasts, how close to people drones may come."""

from typing import NamedTuple, Self

from cocap_opt.data import FieldError, ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.problem import Airspace, Plan, Problem


class FlightScene(NamedTuple):
    """A scene whose steps have a duration, and in which drones may be closer to people.

    Attributes
    ----------
    problem : with the duration of a step, and with the distances to people that flights keep
    asked : the scene's own airspace, where flights may be closer to people than it says; else None
    """

    problem: Problem
    asked: Airspace | None = None

    @classmethod
    def of(cls, problem: Problem, step: float | None, margin: float | None) -> Self:
        """Returns the scene that plans of a problem are flown in.

        Parameters
        ----------
        step : s, how long a step lasts; None: the problem says it
        margin : m, by which drones may be closer to people than the problem says, aside
            (`people_aside`) and over heads (`people_above`); None: they may not

        Raises
        ------
        FieldError
            If nobody or two say how long a step lasts, or drones would keep no distance to people.
        ProblemError
            If no step may last so long, or drones cannot make their moves in it; one line.
        """
        timed = _timed(problem, step)
        if margin is None:
            return cls(timed)
        nearer = timed.replace(airspace=_nearer(problem.airspace, margin))
        return cls(nearer, problem.airspace if margin else None)

    @property
    def without_earth(self) -> Self:
        """The same scene, without its position on the Earth."""
        return self._replace(problem=self.problem.replace(earth=None))

    def flight(self, plan: Plan, smooth: bool) -> Flight:
        """Returns the flights of a plan; raises what `Flight.of` does."""
        return Flight.of(self.problem, plan, smooth)._replace(asked=self.asked)


def _timed(problem: Problem, step: float | None) -> Problem:
    """Returns the problem with the duration of a step, which comes once."""
    if problem.step is None and step is None:
        words = f"must be given, as {problem.name} defines no step length"
        raise FieldError("step", words)
    if problem.step is not None and step is not None:
        words = f"must be left out, as {problem.name} defines it: {problem.step:g} s"
        raise FieldError("step", words)
    return problem if step is None else problem.replace(step=step)


def _nearer(airspace: Airspace, margin: float) -> Airspace:
    """Returns the airspace in which drones may be closer to people by a margin (m)."""
    if not airspace.people_aside:
        raise FieldError("margin", "the scene requires no distance to people; leave it out")
    aside, over = airspace.people_aside - margin, airspace.people_above
    try:
        if margin >= 0 and aside > 0:
            above = None if over is None else max(over - margin, 0.0)
            return airspace.replace(people_aside=aside, people_above=above)
    except ProblemError:  # what is left is no more than rounding
        pass
    raise FieldError(
        "margin",
        "must be at least 0 m and less than the scene's distance to people, "
        f"{airspace.people_aside:g} m",
    ) from None
