"""Formation planning: the robots keep evenly spaced positions on circles around the actors.

These ideas come from Greedy Perspectives (Suresh et al. 2024, arXiv 2310.10863) and its program:
the robots are divided evenly among the actors, fly on a circle with a radius of 5 m around their
actor, 5 m high, and look at it; at each step a circle is turned so that its robots see most. If
there are fewer robots than actors, a circle surrounds the centroid of several actors, and its
radius is larger by the distance of the farthest actor, as in Hughes et al. 2024 (arXiv 2404.03103),
where one circle surrounds all actors.

Both sources simply place their robots: the robots begin in formation, are as fast as necessary, and
fly through walls and each other. This version is our interpretation of the part that can be flown:
the starts of the robots determine which positions they take, a circle turns no faster than they
fly, and each robot flies as close to its position as obstacles and the earlier robots allow, and
looks where it sees most on the way. (Two robots on a circle face each other here; the program
places them at a right angle.)
"""

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np

from cocap_opt.coordination.low_level import SingleRobotPath, SingleRobotTask
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import marginal_gain
from cocap_opt.planners.lazy_coverage import LazyCoverage
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import Camera, Problem, Robot
from cocap_opt.result import Result
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed
from cocap_opt.world.workspace import HeightMap


class Circle(NamedTuple):
    """The n robots of a circle, counter-clockwise, their intended positions, and the actors
    inside.
    """

    robots: tuple[int, ...]
    actors: tuple[int, ...]
    middle: FloatArray  # [T+1, 2] m, centroid of the actors
    # [n, T+1, K, 2] m, positions of the robots at every step, for K turns of the circle
    at: FloatArray
    height: tuple[float, ...]  # [n] m, flight heights of the robots
    above: tuple[float, ...]  # [n] m, heights of the robots above the middle of the tallest actor

    @classmethod
    def share_out(
        cls, problem: Problem, standoff: float, height: float, orientations: int
    ) -> "list[Circle]":
        """Divides the actors evenly by number, and the robots such that their total distance is
        shortest.

        Around a circle, robots keep the order of their starts. The parameters are those of
        `formation`.
        """
        # takes a quarter of the time of all imports
        from scipy.optimize import linear_sum_assignment

        # a person who walks differently in another take is the same person
        of_take = problem.numbers_in_take
        people = int(of_take.max(initial=-1)) + 1
        count = min(len(problem.robots), people)
        if not count:
            return []
        groups = np.array_split(np.arange(people), count)
        actors = [np.flatnonzero(np.isin(of_take, group)) for group in groups]
        sizes = [len(group) for group in np.array_split(np.arange(len(problem.robots)), count)]
        of_seat = np.repeat(np.arange(count), sizes)  # each robot is assigned a seat on some circle
        middles = np.array([_middle(problem, tuple(group.tolist()))[0] for group in actors])
        starts = np.array([problem.height_map.centre(s.x, s.y) for s in problem.first_starts])
        ways = starts[:, None] - middles[of_seat]
        robots, seats = linear_sum_assignment(np.hypot(ways[..., 0], ways[..., 1]))
        bearings = np.arctan2(ways[robots, seats, 1], ways[robots, seats, 0])
        ordered = robots[np.lexsort([bearings, of_seat[seats]])]
        parts = np.split(ordered, np.cumsum(sizes)[:-1])
        turns = math.tau * np.arange(orientations) / orientations
        return [
            cls._around(
                problem, tuple(inside.tolist()), tuple(group.tolist()), standoff, height, turns
            )
            for group, inside in zip(parts, actors, strict=True)
        ]

    @classmethod
    def _around(
        cls,
        problem: Problem,
        inside: tuple[int, ...],
        robots: tuple[int, ...],
        standoff: float,
        height: float,
        turns: FloatArray,
    ) -> "Circle":
        """Returns evenly spaced positions around the actors, outside the outermost of them."""
        middle = _middle(problem, inside)
        actors = [problem.actors[j] for j in inside]
        ways = np.array([actor.poses[: problem.horizon + 1, :2] for actor in actors]) - middle
        spread = np.hypot(ways[..., 0], ways[..., 1]).max(axis=0)
        heads = max(float(actor.poses[0, 2]) + actor.shape.height / 2 for actor in actors)
        at, heights, above = [], [], []
        for seat, i in enumerate(robots):
            robot, start = problem.robots[i], problem.first_starts[i]
            nearest = min(robot.motion.layers, key=lambda layer: abs(layer - height))
            over = problem.height_map.altitude(start.x, start.y, nearest) - heads
            bearings = turns + math.tau * seat / len(robots)
            radius = (spread + _distance_in_view(robot, over, standoff))[:, None, None]
            way = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)  # [K, 2]
            at.append(middle[:, None] + radius * way)
            heights.append(nearest)
            above.append(over)
        return cls(robots, inside, middle, np.array(at), tuple(heights), tuple(above))

    def rewards(self, model: Model, views: list[LazyCoverage], stop: Stop) -> FloatArray:
        """Returns the view reward [T+1, K] of a circle's robots if all are in position and look
        inwards.

        A robot sees nothing from a position that is blocked or that it cannot have reached yet.

        Parameters
        ----------
        views : [R] coverage of each robot's states
        """
        problem = model.problem
        reach = [_reachable(model, robot) for robot in self.robots]
        _, steps, turns, _ = self.at.shape
        rewards = np.zeros((steps, turns))
        for t in range(problem.first_step, problem.horizon + 1):
            stop.check()
            view_sums, pixels = problem.view_sums_at(t), np.zeros((turns, problem.step_width))
            for seat, robot in enumerate(self.robots):
                which, states = self._looking_inwards(model, seat, t)
                there = reach[seat][t, states]
                if there.any():
                    pixels[which[there]] += views[robot](t, states[there])
            values = problem.returns.values_at(view_sums, pixels)
            rewards[t] = (values * problem.view_sum_weights[view_sums]).sum(axis=1)
        return rewards

    def best_turns(self, problem: Problem, rewards: FloatArray) -> IntArray:
        """Finds the turns [T+1] with the greatest total reward [T+1, K], by value iteration.

        A circle turns only if all its robots are fast enough. In a tie it does not turn.
        """
        value, turns = rewards.copy(), np.arange(rewards.shape[1])
        apart = np.abs(turns[:, None] - turns)
        calmest = np.argsort(np.minimum(apart, len(turns) - apart), axis=1, kind="stable")
        best = np.empty((problem.horizon, len(turns)), dtype=np.int64)
        for t in range(problem.horizon - 1, -1, -1):
            ahead = np.where(self._can_follow(problem, t), value[t + 1], CLOSED)
            first = np.take_along_axis(ahead, calmest, axis=1).argmax(axis=1)
            best[t] = calmest[turns, first]
            value[t] += ahead[turns, best[t]]
        chosen = [self._nearest_best(problem, value[0])]
        for row in best:
            chosen.append(int(row[chosen[-1]]))
        return np.array(chosen)

    def _looking_inwards(self, model: Model, seat: int, t: int) -> tuple[IntArray, IntArray]:
        """Returns the turns [m] of K whose positions a robot can reach, and states [m] that look
        inwards.
        """
        problem, robot = model.problem, self.robots[seat]
        graph = model.class_of[robot].graph
        motion, tilts = graph.motion, np.array(problem.robots[robot].camera.tilts)
        at = self.at[seat, t]
        cells = [problem.height_map.cell_of(x, y) for x, y in at.tolist()]
        turns = np.flatnonzero([graph.window.covers(x, y) for x, y in cells])
        layer = motion.layers.index(self.height[seat])
        place = np.array([graph.place(layer, *cells[turn]) for turn in turns], dtype=np.int64)
        way = self.middle[t] - at[turns]
        yaw = np.arctan2(way[:, 1], way[:, 0])
        heading = np.rint(yaw / math.tau * motion.headings).astype(np.int64) % motion.headings
        down = np.arctan2(self.above[seat], np.hypot(way[:, 0], way[:, 1]))
        pitch = np.abs(tilts - down[:, None]).argmin(axis=1)
        return turns, (heading * len(tilts) + pitch) * graph.n_places + place

    def _can_follow(self, problem: Problem, t: int) -> BoolArray:
        """Returns, for each turn of step t, the turns [K] of the next step that all robots can
        reach.

        If the actors outrun a robot, a turn is also allowed if it takes the robot no farther away
        than not turning.
        """
        before, after = self.at[:, t, :, None], self.at[:, t + 1, None, :]
        far = np.abs(after - before).max(axis=-1)  # [n, K, K] m
        speed = np.array([problem.robots[robot].motion.radius for robot in self.robots])
        reach = (speed * problem.height_map.resolution)[:, None, None]
        unturned = np.diagonal(far, axis1=1, axis2=2)[:, :, None]
        result: BoolArray = (far <= np.maximum(reach, unturned)).all(axis=0)
        return result

    def _nearest_best(self, problem: Problem, value: FloatArray) -> int:
        """Returns the turn with the greatest value [K]; among several, the one nearest to the
        starts.
        """
        starts = [problem.height_map.centre(*problem.first_starts[i][:2]) for i in self.robots]
        way = self.at[:, 0] - np.array(starts)[:, None]
        far = np.hypot(way[..., 0], way[..., 1]).sum(axis=0)
        return int(np.lexsort([far, -value])[0])


def _middle(problem: Problem, actors: tuple[int, ...]) -> FloatArray:
    """Returns the centroid [T+1, 2] (m) of actors."""
    poses = np.array([problem.actors[j].poses[: problem.horizon + 1, :2] for j in actors])
    result: FloatArray = poses.mean(axis=0)
    return result


def _distance_in_view(robot: Robot, above: float, wanted: float) -> float:
    """Returns the distance (m) nearest to the requested one at which the camera sees a point
    `above` m below it.

    With a gimbal, one suitable tilt is enough.
    """
    camera = robot.camera
    if not isinstance(camera, Camera) or above <= 0:
        return wanted
    half = math.atan(camera.height / 2 / camera.focal)
    lowest, highest = max(camera.tilts) + half, min(camera.tilts) - half
    near = above / math.tan(lowest) if 0 < lowest < math.pi / 2 else 0.0
    far = above / math.tan(highest) if highest > 0 else math.inf
    return min(max(wanted, near), far)


def _reachable(model: Model, robot: int) -> BoolArray:
    """Returns True for states [T+1, S] in places that a robot can have reached, in any
    orientation.
    """
    graph = model.class_of[robot].graph
    reach = graph.reachable(model.starts(robot), model.problem.horizon)
    places = reach.reshape(len(reach), graph.n_orientations, graph.n_places).any(axis=1)
    return np.tile(places, graph.n_orientations)


STANDOFF = 5.0  # m, from the outermost actor (Greedy Perspectives)
HEIGHT = 5.0  # m, of flight (Greedy Perspectives)
# Number of turns of a circle. The source has 8; a circle with a radius of 5 m must turn by 1 m at a
# time to be followed cell by cell.
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
    standoff : distance (m) from the outermost actor; changed if the camera would miss the actors'
        middle
    height : m; robots fly at the nearest possible flight height
    orientations : number of turns of a circle

    Returns
    -------
    Result
        As for `sequential`; `statistics` holds the number of states `evaluated`. Without actors,
        all robots stay where they are or go to their goals.
    """
    model = compiled(problem)
    views = LazyCoverage.of_robots(model)
    places = [_starts(problem, robot) for robot in range(len(problem.robots))]
    with suppress(LimitReached):  # sequential planning notices the limit, too
        for circle in Circle.share_out(problem, standoff, height, orientations):
            turns = circle.best_turns(problem, circle.rewards(model, views, stop))
            for seat, robot in enumerate(circle.robots):
                at = circle.at[seat, np.arange(len(turns)), turns]
                places[robot] = _flown(problem.height_map, at, circle.height[seat])

    result = sequential(problem, stop, _Formation(places, views))
    evaluated = sum(source.evaluated for source in set(views))
    statistics = {**result.statistics, "evaluated": evaluated}
    return replace(result, statistics=statistics)


def _starts(problem: Problem, robot: int) -> FloatArray:
    """Returns the positions [T+1, 3] (m) of a robot that stays at its start: x, y and altitude."""
    spec = problem.robots[robot]
    start = problem.first_starts[robot]
    return np.repeat(problem.where(spec, [start]), problem.horizon + 1, axis=0)


def _flown(height_map: HeightMap, at: FloatArray, height: float) -> FloatArray:
    """Returns points [n, 3] (m) at a flight height over [n, 2]; outside the map, over its edge."""
    x, y = height_map.cells_of(at).T
    width, depth = height_map.shape
    altitudes = height_map.altitudes((height,))[0]
    return np.column_stack([at, altitudes[x.clip(0, width - 1), y.clip(0, depth - 1)]])


@dataclass(frozen=True)
class _Formation:
    """A low level that finds the path that keeps a robot near its positions in the formation.

    The path has the least total distance from these positions, and looks where it sees most. Both
    are found by value iteration: first over all states, then over the states along the way, for the
    marginal view reward.
    """

    places: list[FloatArray]  # [T+1, 3] m, positions of each robot
    views: list[LazyCoverage]  # coverage of each robot's states
    is_lazy: ClassVar = True

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Finds the path, or raises LimitReached."""
        task.stop.check()
        places, views = self.places[task.robot], self.views[task.robot]
        before, way = views.evaluated, _nearest(task, places)
        if way is None:
            return SingleRobotPath(None, task.model.problem.no_pixels(), 0)
        path = _look(task, way, views)
        pixels = views.along(task.model.problem, path)
        return SingleRobotPath(path, pixels, views.evaluated - before)


def _nearest(task: SingleRobotTask, places: FloatArray) -> Path | None:
    """Returns the path of least total distance from the positions [T+1, 3] (m)."""
    problem, robot_class = task.model.problem, task.model.class_of[task.robot]
    graph, height_map = robot_class.graph, problem.height_map
    layer, *cell = graph.coordinates(np.arange(graph.n_places))
    ground = height_map.origin + height_map.resolution * (np.column_stack(cell) + 0.5)
    at = np.zeros((graph.n_places, 3))
    # the border has no height, and is closed anyway
    for k, height in enumerate(graph.motion.layers):
        at[layer == k] = _flown(height_map, ground[layer == k], height)
    reward = graph.no_reward(problem.horizon)
    for row, place in zip(reward, places, strict=True):
        row -= np.tile(np.linalg.norm(at - place, axis=1), graph.n_orientations)
    value = backward_sweep(graph, reward, charges=task.charges, goal=robot_class.goal)
    path = best_path(graph, value, task.model.starts(task.robot), charges=task.charges)
    return None if path is None else tuple(path)


def _look(task: SingleRobotTask, way: Path, views: LazyCoverage) -> Path:
    """Returns the path through the same places, with the orientations of greatest total marginal
    reward.
    """
    problem, robot_class = task.model.problem, task.model.class_of[task.robot]
    graph, bonuses = robot_class.graph, Bonuses.of(problem.objective)
    everywhere = np.arange(graph.n_orientations) * graph.n_places
    reward = np.full((len(way), graph.n_states), CLOSED)
    for t, state in enumerate(way):
        states = everywhere + state % graph.n_places
        reward[t, states] = 0.0
        if t >= problem.first_step:
            view_sums = problem.view_sums_at(t)
            gain = marginal_gain(problem, view_sums, task.pixels[view_sums], views(t, states))
            reward[t, states] = (gain * problem.view_sum_weights[view_sums]).sum(axis=1)
    value = backward_sweep(graph, reward, bonuses)
    # Every path that can be flown can be flown without turning.
    return tuple(best_path(graph, value, way[0], bonuses) or way)
