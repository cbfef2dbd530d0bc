"""Sequential planning with earlier robots as moving obstacles (prioritised planning).

Source: Greedy Perspectives, "sequential planning with inter-robot collision constraints".
"""

from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.low_level import (
    LowLevel,
    SingleRobotTask,
    value_iteration,
)
from cocap_opt.planners.team import Team
from cocap_opt.problem import Problem, State
from cocap_opt.result import Reason, Result
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed


@timed
def sequential(
    problem: Problem, stop: Stop = never, low_level: LowLevel = value_iteration
) -> Result:
    """Plan the robots in order, each clear of the earlier ones' paths.

    The start cells of robots not yet planned are kept free at all steps, as in the source,
    so that a robot for which no time is left can stay there. A robot for which no path is left
    ends the attempt: that is a failure of the order, and proves nothing.
    """
    team, limit = Team.of(problem, low_level, stop), None
    model = team.model
    others: dict[int, tuple[State, ...]] = {
        i: (robot.start,) * (problem.horizon + 1) for i, robot in enumerate(problem.robots)
    }
    try:
        for robot in range(len(problem.robots)):
            del others[robot]
            charges = avoid_paths(model, model.class_of[robot], others.items())
            single = low_level(SingleRobotTask(model, robot, team.others(robot), charges, stop))
            if single.path is None:
                words = f"drone {robot} has no path left beside the drones before it"
                return Result.without_plan(Reason.FAILED, words, {"failed_robot": robot})
            team = team.with_path(robot, single)
            others[robot] = tuple(map(model.class_of[robot].graph.state, single.path))
    except LimitReached as reached:
        first, team, limit = len(team.found), team.hovering(), reached.limit
        for robot in range(first, len(team.found)):
            if team.found[robot].path is None:
                return Result.stopped_without_plan(limit, {"failed_robot": robot})
    return team.result(limit)


def sequential_lazy(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `sequential` does, the same plan, and evaluate only the views that decide it."""
    return sequential(problem, stop, low_level=LazyValueIteration())
