"""The coverage objective J, its marginals and its breakdowns.

With z[t, f] the pixels (px/m2) that all robots together have on face f at step t,

    J = sum_t sum_f w[f] sqrt(z[t, f]) + rewards for moves (`bonuses`).

The view reward is monotone and submodular in the set of robot paths. Arrays over view sums
(t, f) are flat [Z], Z = (T+1) F, view sum t F + f; where pixels add up over time there is one
robot_class per face, Z = F.
"""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.problem import Problem
from cocap_opt.vision.coverage import CoverageTable


def no_pixels(problem: Problem) -> FloatArray:
    """Pixels [Z] that nobody has seen yet."""
    return np.zeros(problem.view_sum_steps * len(problem.face_weights))


def path_pixels(problem: Problem, table: CoverageTable, path: Path, n_states: int) -> FloatArray:
    """Pixels [Z] that one robot has along its path of state numbers."""
    entries = table.entries(np.arange(len(path)) * n_states + np.array(path))[1]
    pixels: FloatArray = no_pixels(problem)
    np.add.at(pixels, table.view_sums[entries], table.pixels[entries])
    return pixels


def robot_pixels(model: Model, robot: int, path: Path) -> FloatArray:
    """Pixels [Z] of robot number `robot` along its path."""
    robot_class = model.class_of[robot]
    return path_pixels(model.problem, model.coverage(robot_class), path, robot_class.graph.n_states)


def view_sum_weights(problem: Problem) -> FloatArray:
    """Weight w of every view sum [Z]; 0 for steps that do not count."""
    if problem.objective.over_time:  # pixels of steps that do not count are not added
        always: FloatArray = problem.step_weights[0]
        return always
    counts = np.arange(problem.horizon + 1) >= problem.first_step
    return (counts[:, None] * problem.step_weights).ravel()


def most_views(problem: Problem) -> int:
    """How many views, of one robot at one step, a view sum's pixels can be made of."""
    return len(problem.robots) * (problem.horizon + 1 if problem.objective.over_time else 1)


def view_reward(problem: Problem, pixels: FloatArray) -> FloatArray:
    """Reward of each view sum [view_sum_steps, F] for the pixels [Z] of all robots together."""
    reward = view_sum_weights(problem) * np.sqrt(pixels)
    return reward.reshape(problem.view_sum_steps, -1)


def move_reward(model: Model, robot: int, path: Path) -> float:
    """Reward of robot number `robot` for the moves along its path."""
    bonuses = bonuses_of(model.problem.objective)
    return bonuses.of_path(model.class_of[robot].graph.shape, path)


def objective(model: Model, pixels: FloatArray, paths: Sequence[Path]) -> float:
    """J of all robots' paths, which together have `pixels` [Z]."""
    moves = sum(move_reward(model, robot, path) for robot, path in enumerate(paths))
    return float(view_reward(model.problem, pixels).sum()) + moves


def objective_of(model: Model, paths: Sequence[Path]) -> float:
    """J of all robots' paths."""
    pixels = no_pixels(model.problem)
    for robot, path in enumerate(paths):
        pixels = pixels + robot_pixels(model, robot, path)
    return objective(model, pixels, paths)


def marginal_gain(seen: FloatArray, coverage: FloatArray) -> FloatArray:
    """Gain in square-root pixels from `coverage` on top of what others have `seen`.

    This is covm of CoCap eq. 1, before the weights: sqrt(seen + coverage) - sqrt(seen).
    """
    return np.sqrt(seen + coverage) - np.sqrt(seen)


def marginal_reward(model: Model, robot_class: RobotClass, pixels: FloatArray) -> FloatArray:
    """Reward [T+1, S] of every state of a class for one more robot.

    Parameters
    ----------
    pixels : [Z] what the other robots have seen
    """
    table = model.coverage(robot_class)
    gain = marginal_gain(pixels[table.view_sums], table.pixels)
    gain *= view_sum_weights(model.problem)[table.view_sums]
    return spread(model, robot_class, table.row_sums(gain))


def spread(model: Model, robot_class: RobotClass, values: FloatArray) -> FloatArray:
    """Reward array [T+1, S] with `values` at the nodes of the class's coverage table."""
    reward = robot_class.graph.no_reward(model.problem.horizon)
    reward.reshape(-1)[model.coverage(robot_class).nodes] = values
    return reward


def largest_roots(model: Model) -> FloatArray:
    """Largest root of the pixels of one robot, by class and view sum [C, Z], px^0.5/m."""
    largest = np.zeros((len(model.classes), len(view_sum_weights(model.problem))))
    for row, robot_class in zip(largest, model.classes, strict=True):
        table = model.coverage(robot_class)
        np.maximum.at(row, table.view_sums, table.pixels)
    return np.sqrt(largest)
