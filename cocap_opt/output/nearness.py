"""Distances of a plan's drones from each other and from people that no rule limits."""

from collections.abc import Iterator

from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.trajectory import Trajectory, in_steps
from cocap_opt.problem import Plan, Problem


def nearness(problem: Problem, plan: Plan) -> dict[str, str]:
    """Returns distances that are smaller than the default for flown scenes, by key.

    The distances are those of the straight flight. They can occur in a plan that breaks no rule, if
    the scene has no such rule; if drones may even share a cell, distances between drones are left
    out.

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
    """Returns words for a distance that no rule limits."""
    return f"the scene has no rule {of}"
