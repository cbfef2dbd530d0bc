"""Circles of robots around actors: who is on which, where the places are, and how they turn.

The sources are named in `formation`.
"""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Model
from cocap_opt.planners.low_level import LazyCoverage
from cocap_opt.problem import Camera, Problem, Robot
from cocap_opt.stop import Stop


class Places(NamedTuple):
    """Where the n robots of a circle would be at every step, for K ways to turn it."""

    middle: FloatArray  # [T+1, 2] m, centroid of the actors
    at: FloatArray  # [n, T+1, K, 2] m
    height: tuple[float, ...]  # [n] m, at which the robots fly
    above: tuple[float, ...]  # [n] m, of these over the middle of the tallest actor


class Circle(NamedTuple):
    """Robots on a circle, counter-clockwise, and the actors inside."""

    robots: tuple[int, ...]
    actors: tuple[int, ...]

    @classmethod
    def share_out(cls, problem: Problem) -> "list[Circle]":
        """Share robots and actors out evenly: actors by number, robots for the least way in all.

        Around their circle robots are in the order in which they start around it.
        """
        from scipy.optimize import linear_sum_assignment  # a quarter of what imports take

        count = min(len(problem.robots), len(problem.actors))
        if not count:
            return []
        actors = np.array_split(np.arange(len(problem.actors)), count)
        sizes = [len(some) for some in np.array_split(np.arange(len(problem.robots)), count)]
        of_seat = np.repeat(np.arange(count), sizes)  # each robot takes a seat on some circle
        middles = np.array([_middle(problem, tuple(some.tolist()))[0] for some in actors])
        starts = np.array([problem.height_map.centre(*robot.start[:2]) for robot in problem.robots])
        ways = starts[:, None] - middles[of_seat]
        robots, seats = linear_sum_assignment(np.hypot(ways[..., 0], ways[..., 1]))
        bearings = np.arctan2(ways[robots, seats, 1], ways[robots, seats, 0])
        ordered = robots[np.lexsort([bearings, of_seat[seats]])]
        parts = np.split(ordered, np.cumsum(sizes)[:-1])
        return [
            cls(tuple(some.tolist()), tuple(inside.tolist()))
            for some, inside in zip(parts, actors, strict=True)
        ]

    def places(self, problem: Problem, standoff: float, height: float, orientations: int) -> Places:
        """Evenly spaced places around the actors, outside of the outermost of them."""
        middle = _middle(problem, self.actors)
        actors = [problem.actors[j] for j in self.actors]
        ways = np.array([actor.poses[: problem.horizon + 1, :2] for actor in actors]) - middle
        spread = np.hypot(ways[..., 0], ways[..., 1]).max(axis=0)
        heads = max(float(actor.poses[0, 2]) + actor.shape.height / 2 for actor in actors)
        turns = math.tau * np.arange(orientations) / orientations
        at, heights, above = [], [], []
        for seat, robot in enumerate(problem.robots[i] for i in self.robots):
            own = min(robot.motion.layers, key=lambda layer: abs(layer - height))
            over = problem.height_map.altitude(robot.start.x, robot.start.y, own) - heads
            bearings = turns + math.tau * seat / len(self.robots)
            radius = (spread + _distance_in_view(robot, over, standoff))[:, None, None]
            way = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)  # [K, 2]
            at.append(middle[:, None] + radius * way)
            heights.append(own)
            above.append(over)
        return Places(middle, np.array(at), tuple(heights), tuple(above))

    def rewards(
        self, model: Model, places: Places, views: list[LazyCoverage], stop: Stop
    ) -> FloatArray:
        """View reward [T+1, K] of a circle's robots if all are in their places and look inwards.

        A robot sees nothing from a place that is blocked, or that it cannot have reached yet.

        Parameters
        ----------
        views : [R] coverage of every robot's states
        """
        problem = model.problem
        reach = [_reachable(model, robot) for robot in self.robots]
        _, steps, turns, _ = places.at.shape
        rewards = np.zeros((steps, turns))
        for t in range(problem.first_step, problem.horizon + 1):
            stop.check()
            pixels = np.zeros((turns, len(problem.face_weights)))
            for seat, robot in enumerate(self.robots):
                which, states = _looking_inwards(model, robot, seat, places, t)
                there = reach[seat][t, states]
                if there.any():
                    pixels[which[there]] += views[robot](t, states[there])
            weights = problem.view_sum_weights[problem.view_sums_at(t)]
            rewards[t] = (np.sqrt(pixels) * weights).sum(axis=1)
        return rewards

    def best_turns(self, problem: Problem, places: Places, rewards: FloatArray) -> IntArray:
        """Find the turns [T+1] of greatest reward [T+1, K] in all, by value iteration.

        A circle turns only if all its robots are fast enough for it. Ties do not turn.
        """
        value, turns = rewards.copy(), np.arange(rewards.shape[1])
        apart = np.abs(turns[:, None] - turns)
        calmest = np.argsort(np.minimum(apart, len(turns) - apart), axis=1, kind="stable")
        best = np.empty((problem.horizon, len(turns)), dtype=np.int64)
        for t in range(problem.horizon - 1, -1, -1):
            ahead = np.where(_can_follow(problem, self, places, t), value[t + 1], CLOSED)
            first = np.take_along_axis(ahead, calmest, axis=1).argmax(axis=1)
            best[t] = calmest[turns, first]
            value[t] += ahead[turns, best[t]]
        chosen = [_nearest_best(problem, self, places, value[0])]
        for row in best:
            chosen.append(int(row[chosen[-1]]))
        return np.array(chosen)


def _middle(problem: Problem, actors: tuple[int, ...]) -> FloatArray:
    """Centroid [T+1, 2] (m) of actors."""
    poses = np.array([problem.actors[j].poses[: problem.horizon + 1, :2] for j in actors])
    result: FloatArray = poses.mean(axis=0)
    return result


def _distance_in_view(robot: Robot, above: float, wanted: float) -> float:
    """Distance (m), nearest to the wanted one, at which the camera sees a point `above` m below it.

    With a gimbal it is enough if one of its tilts does.
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
    """States [T+1, S] in places that a robot can have reached, however it looks there."""
    graph = model.class_of[robot].graph
    reach = graph.reachable([model.start(robot)], model.problem.horizon)
    places = reach.reshape(len(reach), graph.n_orientations, graph.n_places).any(axis=1)
    return np.tile(places, graph.n_orientations)


def _looking_inwards(
    model: Model, robot: int, seat: int, places: Places, t: int
) -> tuple[IntArray, IntArray]:
    """For which turns [m] of K a place is in reach of anybody, and states [m] that look inwards."""
    problem, graph = model.problem, model.class_of[robot].graph
    motion, tilts = graph.motion, np.array(problem.robots[robot].camera.tilts)
    at = places.at[seat, t]
    cells = [problem.height_map.cell_of(x, y) for x, y in at.tolist()]
    turns = np.flatnonzero([graph.window.covers(x, y) for x, y in cells])
    layer = motion.layers.index(places.height[seat])
    place = np.array([graph.place(layer, *cells[turn]) for turn in turns], dtype=np.int64)
    way = places.middle[t] - at[turns]
    yaw = np.arctan2(way[:, 1], way[:, 0])
    heading = np.rint(yaw / math.tau * motion.headings).astype(np.int64) % motion.headings
    down = np.arctan2(places.above[seat], np.hypot(way[:, 0], way[:, 1]))
    pitch = np.abs(tilts - down[:, None]).argmin(axis=1)
    return turns, (heading * len(tilts) + pitch) * graph.n_places + place


def _can_follow(problem: Problem, circle: Circle, places: Places, t: int) -> BoolArray:
    """Tell which turns [K] of the next step all robots can reach from each turn [K] of step t.

    Where the actors outrun a robot, it is enough that turning takes it no farther than not to.
    """
    before, after = places.at[:, t, :, None], places.at[:, t + 1, None, :]
    far = np.abs(after - before).max(axis=-1)  # [n, K, K] m
    speed = np.array([problem.robots[robot].motion.radius for robot in circle.robots])
    reach = (speed * problem.height_map.resolution)[:, None, None]
    unturned = np.diagonal(far, axis1=1, axis2=2)[:, :, None]
    result: BoolArray = (far <= np.maximum(reach, unturned)).all(axis=0)
    return result


def _nearest_best(problem: Problem, circle: Circle, places: Places, value: FloatArray) -> int:
    """Turn of greatest value [K]; of several the one that is nearest to the starts."""
    starts = [problem.height_map.centre(*problem.robots[i].start[:2]) for i in circle.robots]
    way = places.at[:, 0] - np.array(starts)[:, None]
    far = np.hypot(way[..., 0], way[..., 1]).sum(axis=0)
    return int(np.lexsort([far, -value])[0])
