"""The coverage objective J and its marginals.

With z[t, f] the pixels (px/m2) that all robots together have on face f at step t,

    J = sum_t sum_f w[f] sqrt(z[t, f]) + rewards for moves (`graph.move_rewards`).

The view reward is monotone and submodular in the set of robot paths. Arrays over view sums
(t, f) are flat [Z], Z = (T+1) F, view sum t F + f; where pixels add up over time there is one
view sum per face, Z = F.
"""

from collections.abc import Sequence

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.problem import Problem


def objective(model: Model, paths: Sequence[Path], pixels: FloatArray | None = None) -> float:
    """J of all robots' paths.

    Parameters
    ----------
    pixels : [Z] that they have together, if it is known
    """
    if pixels is None:
        pixels = model.problem.no_pixels()
        for robot, path in enumerate(paths):
            pixels = pixels + model.robot_pixels(robot, path)
    bonuses = Bonuses.of(model.problem.objective)
    shapes = (robot_class.graph.shape for robot_class in model.class_of)
    moves = exact_sum(bonuses.of_path(*both) for both in zip(shapes, paths, strict=True))
    return float(view_reward(model.problem, pixels).sum()) + moves


def view_reward(problem: Problem, pixels: FloatArray) -> FloatArray:
    """Reward of each view sum [Z] of all robots together, as an array [view_sum_steps, F]."""
    reward = problem.view_sum_weights * np.sqrt(pixels)
    return reward.reshape(problem.view_sum_steps, -1)


def marginal_gain(seen: FloatArray, coverage: FloatArray) -> FloatArray:
    """Gain in square-root pixels from `coverage` on top of what others have `seen`.

    This is covm of CoCap eq. 1, before the weights: sqrt(seen + coverage) - sqrt(seen).
    """
    return np.sqrt(seen + coverage) - np.sqrt(seen)


def marginal_reward(model: Model, robot_class: RobotClass, pixels: FloatArray) -> FloatArray:
    """Reward [T+1, S] of every state of a class for one more robot.

    Parameters
    ----------
    pixels : [Z] that the other robots have
    """
    table = model.coverage(robot_class)
    # As `marginal_gain`, times the weights, in few arrays of the table's size: it takes most of
    # the time of planning in large scenes. Without the check of bounds `take` is twice as quick.
    gain = np.take(pixels, table.view_sums, mode="clip")
    gain += table.pixels
    np.sqrt(gain, out=gain)
    other = np.take(np.sqrt(pixels), table.view_sums, mode="clip")
    gain -= other
    gain *= np.take(model.problem.view_sum_weights, table.view_sums, mode="clip", out=other)
    return model.spread(robot_class, table.row_sums(gain))
