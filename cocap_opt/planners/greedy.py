"""Greedy planning over robots, ignoring collisions: the "unconstrained" reference.

Each robot in turn gets its best path given what the earlier ones see. Without collision
rules the plan has at least half the optimal J, if the low level is exact.
"""

import time

from cocap_opt.model import compiled
from cocap_opt.planners.single import LowLevel, SingleRobotTask
from cocap_opt.planners.team import Team, no_path, no_plan, plan_or_hover, team_result
from cocap_opt.planners.value_iteration import value_iteration
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Limit, Stop, never


def greedy(
    problem: Problem,
    stop: Stop = never,
    low_level: LowLevel = value_iteration,
    rounds: int = 1,
) -> Result:
    """Plan the robots in order, each best given the earlier ones; collisions are ignored.

    With `rounds` > 1 each robot is planned again in turn against all others, until that
    gains nothing or the rounds are over; only gains are kept.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    team = Team(model, [])
    limit = Limit.NONE
    for robot in range(len(problem.robots)):
        task = SingleRobotTask(model, robot, team.others(robot), stop=stop)
        single, limit = plan_or_hover(low_level, task, limit)
        if single.path is None:
            return no_plan(limit, begin, no_path(robot))
        team.found.append(single)
    for _ in range(rounds - 1):
        before = team.value
        limit = _improve(team, low_level, stop) if limit is Limit.NONE else limit
        if team.value <= before:
            break
    return team_result(team, limit, begin)


def _improve(team: Team, low_level: LowLevel, stop: Stop) -> Limit:
    """Plan each robot again against all others and keep what makes J grow."""
    for robot in range(len(team.found)):
        single = low_level(SingleRobotTask(team.model, robot, team.others(robot), stop=stop))
        if single.limit is not Limit.NONE:
            return single.limit
        changed = team.with_path(robot, single)
        if changed.value > team.value:
            team.found[robot] = single
    return Limit.NONE
