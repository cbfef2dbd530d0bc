"""The coverage objective J and its marginals.

With z[t, f] the pixels (px/m2) that all robots together have on face f at step t,

    J = sum_t sum_f w[f] sqrt(z[t, f]) + rewards for moves (`graph.move_rewards`),

and, if the scene counts the drones n[t, j] that see a person, the sum of w[j] min(n[t, j], k).
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
    """Returns J of all robots' paths.

    Parameters
    ----------
    pixels : [Z] of all robots together, if already known
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
    """Returns the reward [Z] of each view sum of all robots together."""
    return problem.view_sum_weights * problem.returns.values(pixels)


def marginal_gain(
    problem: Problem, view_sums: IntArray | slice, seen: FloatArray, coverage: FloatArray
) -> FloatArray:
    """Returns the gain [.., m] from `coverage` added to what others have `seen`, without weights.

    For pixels this is covm of CoCap eq. 1: sqrt(seen + coverage) - sqrt(seen).

    Parameters
    ----------
    view_sums : [m] view sums of `seen` and `coverage`
    """
    values = partial(problem.returns.values_at, view_sums)
    return values(seen + coverage) - values(seen)


def marginal_reward(model: Model, robot_class: RobotClass, pixels: FloatArray) -> FloatArray:
    """Returns the reward [T+1, S] that one more robot of a class would add in every state.

    Parameters
    ----------
    pixels : [Z] of the other robots together
    """
    table = model.coverage(robot_class)
    # This is `marginal_gain` times the weights, with few arrays of the table's size, as it takes
    # most of the planning time in large scenes. Without bounds checks, `take` is twice as fast.
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
