"""Formation planning: the robots keep evenly spaced places on circles around the actors.

From Greedy Perspectives (Suresh et al. 2024, arXiv 2310.10863) and its program are: robots
shared out evenly between the actors, 5 m around theirs and 5 m high, looking at it; at each step
a circle is turned to where its robots see most. Where there are fewer robots than actors, a
circle is around the centroid of several, and wider by the farthest of them, as that of Hughes et
al. 2024 (arXiv 2404.03103) is around all.

Both put their robots into their places and ask no more: they begin in formation, are as fast as
need be, and fly through walls and each other. Ours is our reading of what of that can be flown:
who goes where is decided by where the robots start, a circle turns no faster than they fly, each
robot flies as near to its place as obstacles and the robots before it let it, and looks where it
sees most on the way. (Two robots on a circle face each other; their program sets them at a right
angle.)
"""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Path, compiled
from cocap_opt.objective import marginal_gain
from cocap_opt.planners.circles import Circle
from cocap_opt.planners.low_level import LazyCoverage, SingleRobotPath, SingleRobotTask
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed
from cocap_opt.world.workspace import HeightMap

STANDOFF = 5.0  # m, from the outermost actor (Greedy Perspectives)
HEIGHT = 5.0  # m, of flight (Greedy Perspectives)
# Ways to turn a circle. Theirs has 8; one of 5 m must turn by 1 m to be followed cell by cell.
_ORIENTATIONS = 32


@timed
def formation(
    problem: Problem,
    stop: Stop = never,
    standoff: float = STANDOFF,
    height: float = HEIGHT,
    orientations: int = _ORIENTATIONS,
) -> Result:
    """Fly in circles around the actors, each robot clear of the earlier ones' paths.

    Parameters
    ----------
    standoff : distance (m) from the outermost actor; nearer or farther where the camera would
        look past the actors' middle
    height : the flight height (m) nearest to it is flown where that is possible
    orientations : in how many ways a circle can be turned

    Returns
    -------
    Result
        As `sequential` has it; `statistics` holds the number of states `evaluated`. Without
        actors all robots stay where they are, or go to their goals.
    """
    model = compiled(problem)
    views = LazyCoverage.of_robots(model)
    places = [_starts(problem, robot) for robot in range(len(problem.robots))]
    with suppress(LimitReached):  # sequential planning hears of it, too
        for circle in Circle.share_out(problem):
            around = circle.places(problem, standoff, height, orientations)
            rewards = circle.rewards(model, around, views, stop)
            turns = circle.best_turns(problem, around, rewards)
            for seat, robot in enumerate(circle.robots):
                at = around.at[seat, np.arange(len(turns)), turns]
                places[robot] = _flown(problem.height_map, at, around.height[seat])

    result = sequential(problem, stop, _Formation(places, views))
    evaluated = sum(source.evaluated for source in set(views))
    statistics = {**result.statistics, "evaluated": evaluated}
    return replace(result, statistics=statistics)


def _starts(problem: Problem, robot: int) -> FloatArray:
    """Where a robot is that stays at its start [T+1, 3]: x, y and altitude in m."""
    spec = problem.robots[robot]
    return np.repeat(problem.where(spec, [spec.start]), problem.horizon + 1, axis=0)


def _flown(height_map: HeightMap, at: FloatArray, height: float) -> FloatArray:
    """Returns points [n, 3] (m) at a flight height over [n, 2]; off the map over its edge."""
    x, y = height_map.cells_of(at).T
    width, depth = height_map.shape
    altitudes = height_map.altitudes((height,))[0]
    return np.column_stack([at, altitudes[x.clip(0, width - 1), y.clip(0, depth - 1)]])


@dataclass(frozen=True)
class _Formation:
    """A low level: the path that keeps a robot near its places in the formation.

    It is the path that is least far from them in all, and looks where it sees most. Both by value
    iteration: over all states, then over those along the way, for the marginal view reward.
    """

    places: list[FloatArray]  # [T+1, 3] m of each robot
    views: list[LazyCoverage]  # of each robot
    is_lazy: Literal[True] = field(default=True, init=False)

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Find the path; raises LimitReached."""
        task.stop.check()
        places, views = self.places[task.robot], self.views[task.robot]
        pixels = task.model.problem.no_pixels()
        before, way = views.evaluated, _nearest(task, places)
        if way is None:
            return SingleRobotPath(None, pixels, 0)
        path = _look(task, way, views)
        for t in range(task.model.problem.first_step, len(path)):
            pixels[task.model.problem.view_sums_at(t)] += views(t, np.array(path[t : t + 1]))[0]
        return SingleRobotPath(path, pixels, views.evaluated - before)


def _nearest(task: SingleRobotTask, places: FloatArray) -> Path | None:
    """Path of least distance from the places [T+1, 3] (m), summed over the steps."""
    problem, robot_class = task.model.problem, task.model.class_of[task.robot]
    graph, start, height_map = robot_class.graph, task.model.start(task.robot), problem.height_map
    layer, *cell = graph.coordinates(np.arange(graph.n_places))
    ground = height_map.origin + height_map.resolution * (np.column_stack(cell) + 0.5)
    at = np.zeros((graph.n_places, 3))
    for k, height in enumerate(graph.motion.layers):  # the border has none, and is closed anyway
        at[layer == k] = _flown(height_map, ground[layer == k], height)
    reward = graph.no_reward(problem.horizon)
    for row, place in zip(reward, places, strict=True):
        row -= np.tile(np.linalg.norm(at - place, axis=1), graph.n_orientations)
    value = backward_sweep(graph, reward, charges=task.charges, goal=robot_class.goal)
    path = best_path(graph, value, start, charges=task.charges)
    return None if path is None else tuple(path)


def _look(task: SingleRobotTask, way: Path, views: LazyCoverage) -> Path:
    """Path through the same places that looks where the marginal reward is greatest in all."""
    problem, robot_class = task.model.problem, task.model.class_of[task.robot]
    graph, bonuses = robot_class.graph, Bonuses.of(problem.objective)
    everywhere = np.arange(graph.n_orientations) * graph.n_places
    reward = np.full((len(way), graph.n_states), CLOSED)
    for t, state in enumerate(way):
        states = everywhere + state % graph.n_places
        reward[t, states] = 0.0
        if t >= problem.first_step:
            view_sums = problem.view_sums_at(t)
            gain = marginal_gain(task.pixels[view_sums], views(t, states))
            reward[t, states] = (gain * problem.view_sum_weights[view_sums]).sum(axis=1)
    value = backward_sweep(graph, reward, bonuses)
    # A way that can be flown can be flown without turning.
    return tuple(best_path(graph, value, way[0], bonuses) or way)
