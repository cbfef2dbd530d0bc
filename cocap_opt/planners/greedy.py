"""Greedy planning over robots, ignoring collisions: the "unconstrained" reference.

Each robot in turn gets its best path given what the earlier ones see. Without collision
rules the plan has at least half the optimal J, if the low level is exact.
"""

from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.low_level import (
    LowLevel,
    SingleRobotTask,
    value_iteration,
)
from cocap_opt.planners.team import Team
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed

ROUNDS = 10  # of `greedy_rounds`


@timed
def greedy(
    problem: Problem, stop: Stop = never, low_level: LowLevel = value_iteration, rounds: int = 1
) -> Result:
    """Plan the robots in order, each best given the earlier ones; collisions are ignored.

    Parameters
    ----------
    low_level : plans one robot
    rounds : with more than 1, each robot is planned again in turn against all others, until a
        round gains nothing; only gains are kept

    Returns
    -------
    Result
        At a limit, robots that are not planned yet stay at their starts.
    """
    team, limit = Team.of(problem, low_level, stop), None
    try:
        for robot in range(len(problem.robots)):
            single = low_level(_task(team, robot, stop))
            if single.path is None:
                return Team.no_path(robot)
            team = team.with_path(robot, single)
        for _ in range(rounds - 1):
            before = team.value
            for robot in range(len(problem.robots)):
                team = _better(team, robot, low_level, stop)
            if team.value <= before:
                break
    except LimitReached as reached:
        team, limit = team.hovering(), reached.limit
    return team.result(limit)


def greedy_rounds(problem: Problem, stop: Stop = never) -> Result:
    """Plan greedily, then in rounds of best responses until nobody gains; ignore collisions."""
    return greedy(problem, stop, rounds=ROUNDS)


def greedy_lazy(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `greedy` does, the same plan, and evaluate only the views that decide it."""
    return greedy(problem, stop, low_level=LazyValueIteration())


def _task(team: Team, robot: int, stop: Stop) -> SingleRobotTask:
    return SingleRobotTask(team.model, robot, team.others(robot), stop=stop)


def _better(team: Team, robot: int, low_level: LowLevel, stop: Stop) -> Team:
    """The team with one robot planned again against all others, if that makes J grow."""
    changed = team.with_path(robot, low_level(_task(team, robot, stop)))
    return changed if changed.value > team.value else team
