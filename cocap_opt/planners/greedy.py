"""Greedy planning over robots, ignoring collisions: the "unconstrained" reference.

Each robot in turn gets its best path given what the earlier ones see. Without collision
rules the plan has at least half the optimal J, if the low level is exact.
"""

from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.low_level import LowLevel, value_iteration
from cocap_opt.planners.responses import Responses, followed, in_rounds, one_by_one
from cocap_opt.planners.team import Team
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop, never
from cocap_opt.timing import timed


@timed
def greedy(
    problem: Problem,
    stop: Stop = never,
    low_level: LowLevel = value_iteration,
    *,
    rounds: bool = False,
) -> Result:
    """Plan the robots in order, each best given the earlier ones; collisions are ignored.

    Parameters
    ----------
    low_level : plans one robot
    rounds : then each robot is planned again in turn against all others, until nobody gains;
        only gains are kept

    Returns
    -------
    Result
        At a limit, robots that are not planned yet stay at their starts.
    """
    responses = Responses(low_level, stop)
    team = Team.of(problem, low_level, stop)
    team, limit = followed(team, one_by_one(team, responses, rules=False))
    if limit is None and not team.is_whole:
        return Team.no_path(team.found.index(None))
    if limit is None and rounds:
        team, limit = followed(team, in_rounds(team, responses, rules=False))
    return team.hovering().result(limit)


def greedy_rounds(problem: Problem, stop: Stop = never) -> Result:
    """Plan greedily, then in rounds of best responses until nobody gains; ignore collisions."""
    return greedy(problem, stop, rounds=True)


def greedy_lazy(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `greedy` does, the same plan, and evaluate only the views that decide it."""
    return greedy(problem, stop, low_level=LazyValueIteration())
