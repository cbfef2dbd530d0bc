"""Greedy planning over robots, ignoring collisions: the "unconstrained" reference.

Each robot in turn gets its best path given what the earlier ones see. Without collision rules the
plan has at least half the optimal J, if the low level is exact. Myopic planning gives each robot
its best path as if it were alone, which shows how much coordination is worth; it is the baseline of
this name in Hughes et al. 2024 (arXiv 2404.03103).
"""

from cocap_opt.coordination.low_level import (
    LowLevel,
    SingleRobotPath,
    SingleRobotTask,
    value_iteration,
)
from cocap_opt.coordination.responses import (
    Planning,
    Responses,
    followed,
    greedily,
    greedily_in_rounds,
)
from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.results import hovering, result_of, without_a_path
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop, never
from cocap_opt.timing import timed


@timed
def greedy(problem: Problem, stop: Stop = never, low_level: LowLevel = value_iteration) -> Result:
    """Plan the robots in order, each as best given the earlier ones; collisions are ignored.

    Parameters
    ----------
    low_level : plans one robot

    Returns
    -------
    Result
        At a limit, robots not planned yet stay at their starts.
    """
    return _planned(problem, stop, low_level, greedily)


@timed
def greedy_rounds(
    problem: Problem, stop: Stop = never, low_level: LowLevel = value_iteration
) -> Result:
    """Plan greedily, then in rounds of best responses until nobody gains; ignore collisions.

    In a round, each robot in turn is replanned given all others; only improvements are kept.
    """
    return _planned(problem, stop, low_level, greedily_in_rounds)


def greedy_lazy(problem: Problem, stop: Stop = never) -> Result:
    """Find the same plan as `greedy`, but evaluate only the views that decide it."""
    return greedy(problem, stop, low_level=LazyValueIteration())


def _planned(problem: Problem, stop: Stop, low_level: LowLevel, planning: Planning) -> Result:
    """Returns the result of a team planned without rules."""
    responses = Responses(low_level, stop)
    nobody = responses.nobody(problem)
    team, limit = followed(nobody, planning(nobody, responses))
    if limit is None and not team.is_whole:
        return without_a_path(team.found.index(None))
    return result_of(hovering(team), limit)


def myopic(problem: Problem, stop: Stop = never) -> Result:
    """Plan each robot's best path regardless of the others; collisions are ignored."""
    return greedy(problem, stop, low_level=_alone)


def _alone(task: SingleRobotTask) -> SingleRobotPath:
    return value_iteration(task._replace(pixels=task.model.problem.no_pixels()))
