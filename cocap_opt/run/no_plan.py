"""Finds reasons why a scene may have no plan: goals that are out of reach or too small, and narrow
ways.
"""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from cocap_opt.graph.value_iteration import leads_to_goal
from cocap_opt.model import compiled
from cocap_opt.plausibility import narrow_way
from cocap_opt.problem import AnyGoal, Problem, goal_cells
from cocap_opt.text import counted, in_ranges


def why_no_plan(problem: Problem) -> Iterator[str]:
    """Yields reasons, in words, why there is or may be no plan; yields nothing if none are found.

    A drone without any path, a goal that a drone cannot reach even alone, and a goal with fewer
    free places than drones that must end there, each prove that no plan exists. No
    coverage is computed.
    """
    airspace, stuck = problem.airspace, _without_path(problem)
    far = stuck
    if stuck and airspace.people_aside:
        nearer = airspace.replace(people_aside=0.0, people_above=None, people_stray=0.0)
        far = _without_path(problem.replace(airspace=nearer))
    if far:
        yield (
            f"{_told(problem, far)}: allow more steps, a nearer start or another goal (in a recipe "
            "`steps`, `starts` or `land`)"
        )
    if crowded := [i for i in stuck if i not in far]:
        yield (
            f"{_told(problem, crowded)}: {'they have' if len(crowded) > 1 else 'it has'} to keep "
            f"{airspace.told_people}; allow a smaller distance (in a recipe `people` under "
            "[airspace]), or start elsewhere"
        )
    yield from _too_many(problem)
    if words := narrow_way(problem):
        yield words


def _without_path(problem: Problem) -> list[int]:
    """Returns the drones that have no path to the last step, or to a goal there, even alone."""
    model, found = compiled(problem), []
    for i, robot_class in enumerate(model.class_of):
        leads = leads_to_goal(robot_class.graph, problem.horizon, robot_class.goal)
        if not leads[0, model.starts(i)].any():
            found.append(i)
    return found


def _told(problem: Problem, stuck: list[int]) -> str:
    """Returns words for drones that have no path."""
    several, at_goals = len(stuck) > 1, any(problem.robots[i].goal for i in stuck)
    told = [n for i in stuck if (n := problem.robots[i].number) is not None] or stuck
    of_mission = "" if told == stuck else " of the mission"
    goals = f"reach {'their goals' if several else 'its goal'} in" if at_goals else "fly for"
    return (
        f"drone{'s' if several else ''} {in_ranges(told)}{of_mission} cannot {goals} "
        f"{counted(problem.horizon, 'step')}, even alone"
    )


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
