"""The scene in which a plan is flown: the length of a step, and the allowed distance from
people.
"""

from typing import NamedTuple, Self

from cocap_opt.data import FieldError, ProblemError
from cocap_opt.flight.flights import Flight
from cocap_opt.problem import Airspace, Plan, Problem


class FlightScene(NamedTuple):
    """A scene with a step length, in which drones may be allowed closer to people.

    Attributes
    ----------
    problem : the problem with the length of a step, and with the distances from people for flights
    asked : the scene's own airspace, if flights may be closer to people than it says; else None
    """

    problem: Problem
    asked: Airspace | None = None

    @classmethod
    def of(cls, problem: Problem, step: float | None, margin: float | None) -> Self:
        """Returns the scene in which plans of a problem are flown.

        Parameters
        ----------
        step : length of a step in s; None: as defined by the problem
        margin : distance in m by which drones may be closer to people than the problem says,
            horizontally (`people_aside`) and over heads (`people_above`); None: they may not

        Raises
        ------
        FieldError
            If the step length is given twice or not at all, or if drones would keep no distance
            from people.
        ProblemError
            If the step length is out of range, or drones cannot make their moves within a step; the
            message is one line.
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
        """Returns the flights of a plan; raises the same errors as `Flight.of`."""
        return Flight.of(self.problem, plan, smooth)._replace(asked=self.asked)


def _timed(problem: Problem, step: float | None) -> Problem:
    """Returns the problem with the length of a step, which must be given exactly once."""
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
        raise FieldError("margin", "the scene requires no distance from people; leave it out")
    aside, over = airspace.people_aside - margin, airspace.people_above
    try:
        if margin >= 0 and aside > 0:
            above = None if over is None else max(over - margin, 0.0)
            return airspace.replace(people_aside=aside, people_above=above)
    except ProblemError:  # the remaining distance is no more than rounding
        pass
    raise FieldError(
        "margin",
        "must be at least 0 m and less than the scene's distance from people, "
        f"{airspace.people_aside:g} m",
    ) from None
