"""Myopic planning: each robot's best path as if it were alone.

What this loses is what the robots' knowledge of one another is worth. Collisions are ignored.
Source: the baseline of this name in Hughes et al. 2024 (arXiv 2404.03103).
"""

from cocap_opt.planners.greedy import greedy
from cocap_opt.planners.low_level import SingleRobotPath, SingleRobotTask, value_iteration
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import Stop, never


def myopic(problem: Problem, stop: Stop = never) -> Result:
    """Plan each robot's best path without looking at any other's; collisions are ignored."""
    return greedy(problem, stop, low_level=_alone)


def _alone(task: SingleRobotTask) -> SingleRobotPath:
    return value_iteration(task._replace(pixels=task.model.problem.no_pixels()))
