"""The coverage objective J and its marginals.

With z[t, f] the pixels (px/m2) that all robots together have on face f at step t,

    J = sum_t sum_f w[f] sqrt(z[t, f]) + rewards for moves (`graph.move_rewards`),

and, where the scene counts the drones n[t, j] that see a person, the sum of w[j] min(n[t, j], k).
The view reward is monotone and submodular in the set of robot paths. Arrays over view sums
are flat [Z], as `Problem.step_view_sums` numbers them: faces at steps, then people at steps.
"""

from collections.abc import Sequence
from functools import partial

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray, IntArray
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
    """Reward [Z] of each view sum of all robots together."""
    return problem.view_sum_weights * problem.returns.values(pixels)


def marginal_gain(
    problem: Problem, view_sums: IntArray | slice, seen: FloatArray, coverage: FloatArray
) -> FloatArray:
    """Gain [.., m] from `coverage` on top of what others have `seen`, before the weights.

    Of pixels this is covm of CoCap eq. 1: sqrt(seen + coverage) - sqrt(seen).

    Parameters
    ----------
    view_sums : [m] that both are of
    """
    values = partial(problem.returns.values_at, view_sums)
    return values(seen + coverage) - values(seen)


def marginal_reward(model: Model, robot_class: RobotClass, pixels: FloatArray) -> FloatArray:
    """Reward [T+1, S] of every state of a class for one more robot.

    Parameters
    ----------
    pixels : [Z] that the other robots have
    """
    table = model.coverage(robot_class)
    # As `marginal_gain`, times the weights, in few arrays of the table's size: it takes most of
    # the time of planning in large scenes. Without the check of bounds `take` is twice as quick.
    returns, counts = model.problem.returns, table.counts
    gain = np.take(pixels, table.view_sums, mode="clip")
    gain += table.pixels
    together = np.minimum(gain[counts], returns.caps[table.view_sums[counts] - returns.n_roots])
    np.sqrt(gain, out=gain)
    gain[counts] = together
    other = np.take(returns.values(pixels), table.view_sums, mode="clip")
    gain -= other
    gain *= np.take(model.problem.view_sum_weights, table.view_sums, mode="clip", out=other)
    return model.spread(robot_class, table.row_sums(gain))
