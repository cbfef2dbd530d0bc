"""Sequential planning with earlier robots as moving obstacles (prioritised planning).

Source: Greedy Perspectives, "sequential planning with inter-robot collision constraints".
"""

import time

from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.model import compiled
from cocap_opt.planners.single import LowLevel, SingleRobotTask
from cocap_opt.planners.team import Team, no_plan, plan_or_hover, team_result
from cocap_opt.planners.value_iteration import value_iteration
from cocap_opt.problem.problem import Problem, State
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop, never


def sequential(
    problem: Problem, stop: Stop = never, low_level: LowLevel = value_iteration
) -> Result:
    """Plan the robots in order, each clear of the earlier ones' paths.

    The start cells of robots not yet planned are kept free at all steps, as in the source,
    so that a robot for which no time is left can stay where it is. A robot for which no path
    is left ends the attempt: that is a failure of the order, not a proof.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    team = Team(model, [])
    limit = Limit.NONE
    steps = problem.horizon + 1
    others: dict[int, tuple[State, ...]] = {
        i: (robot.start,) * steps for i, robot in enumerate(problem.robots)
    }
    for robot in range(len(problem.robots)):
        del others[robot]
        charges = avoid_paths(model, model.class_of[robot], others.items())
        task = SingleRobotTask(model, robot, team.others(robot), charges, stop)
        single, limit = plan_or_hover(low_level, task, limit)
        if single.path is None:
            words = f"robot {robot} has no path left beside the robots before it"
            return no_plan(limit, begin, (Reason.FAILED, words), {"failed_robot": robot})
        team.found.append(single)
        graph = model.class_of[robot].graph
        others[robot] = tuple(graph.state(s) for s in single.path)
    return team_result(team, limit, begin)
