"""Distances of a plan's drones from each other and from people, where no rule asks for any."""

from collections.abc import Iterator

from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.trajectory import Trajectory, in_steps
from cocap_opt.problem import Plan, Problem


def nearness(problem: Problem, plan: Plan) -> dict[str, str]:
    """Returns distances that are less than scenes that are to be flown ask for, by their keys.

    They are those of the straight flight. A plan that breaks no rule may have them where there is
    no such rule; where drones may even share a cell, nothing is said of drones.

    Parameters
    ----------
    plan : a plan that can be flown
    """
    return dict(_nearness(problem, Trajectory.straight(in_steps(problem), plan)))


def _nearness(problem: Problem, flown: Trajectory) -> Iterator[tuple[str, str]]:
    rules = problem.rules
    drones = None if rules.none or rules.separation else Nearest.of_drones(flown)
    if drones is not None and drones.is_too_near:
        words = no_rule("between the steps")
        yield "near_drones", f"{drones.distance:.2f} m at least; {words}"
    if people := Nearest.of_people_without_rule(flown, problem.airspace):
        yield "near_people", f"{people.distance:.2f} m at least, from above; {no_rule('on people')}"


def no_rule(of: str) -> str:
    """Returns words for a distance for which there is no rule."""
    return f"the scene has no rule {of}"
