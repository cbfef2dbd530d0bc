"""Finds reasons why a scene may have no plan: goals that are out of reach or too small, and narrow
ways.
"""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from cocap_opt.graph.value_iteration import leads_to_goal
from cocap_opt.model import Model, compiled
from cocap_opt.plausibility import narrow_way
from cocap_opt.problem import AnyGoal, Problem, goal_cells
from cocap_opt.text import in_ranges


def why_no_plan(problem: Problem) -> Iterator[str]:
    """Yields reasons, in words, why there is or may be no plan; yields nothing if none are found.

    A goal that a drone cannot reach even alone, and a goal with fewer free places than drones that
    must end there, each prove that no plan exists. No coverage is computed.
    """
    if stuck := _out_of_reach(compiled(problem)):
        several, steps = len(stuck) > 1, problem.horizon
        numbers = [problem.robots[i].number for i in stuck]
        told = [n for n in numbers if n is not None] or stuck
        of_mission = "" if told == stuck else " of the mission"
        yield (
            f"drone{'s' if several else ''} {in_ranges(told)}{of_mission} cannot reach "
            f"{'their goals' if several else 'its goal'} in {steps} step{'s' if steps > 1 else ''},"
            " even alone: allow more steps, a nearer start or another goal (in a recipe `steps`, "
            "`starts` or `land`)"
        )
    yield from _too_many(problem)
    if words := narrow_way(problem):
        yield words


def _out_of_reach(model: Model) -> list[int]:
    """Returns the drones that cannot reach their goal by the last step, even alone."""
    found, horizon = [], model.problem.horizon
    for i, robot_class in enumerate(model.class_of):
        if robot_class.goal is not None:
            leads = leads_to_goal(robot_class.graph, horizon, robot_class.goal)
            if not leads[0, model.starts(i)].any():
                found.append(i)
    return found


def _too_many(problem: Problem) -> Iterator[str]:
    """Yields messages on goals with fewer places than drones, if a place can hold only one
    drone.
    """
    if not problem.rules.vertex:
        return
    drones = defaultdict[AnyGoal, int](int)
    places = defaultdict[AnyGoal, set[tuple[float, int]]](set)  # flight heights and cells
    for robot in problem.robots:
        if robot.goal is not None:
            x, y = goal_cells(robot.goal).T
            free = robot.motion.free_places(problem.workspace)[:, x, y]  # [layer, cell]
            drones[robot.goal] += 1
            for layer, k in np.argwhere(free).tolist():
                places[robot.goal].add((robot.motion.layers[layer], k))
    for goal, number in drones.items():
        room = len(places[goal])
        if number > room:
            yield (
                f"{number} drones must end in one goal, which has room for only {room}: give "
                "some of them other goals, or use fewer drones"
            )
