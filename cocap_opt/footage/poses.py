"""Positions and axes of a plan's cameras at all steps, and the positions of people."""

from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.flight.trajectory import waypoints
from cocap_opt.problem import Plan, Problem
from cocap_opt.vision.projection import Projection


class Poses(NamedTuple):
    """The poses of all cameras at all steps, and the middles of people.

    Coordinates are relative to the corner of the map, so that projections lose no digits.

    Attributes
    ----------
    places : [T+1, R, 3] positions of the cameras, m
    angles : [T+1, R, 2] rad, yaw and pitch; yaw changes by at most half a turn between steps
    axes : [T+1, R, 3, 3] right, up and forward unit vectors of the cameras
    people : [T+1, A, 3] middles of bodies, m
    """

    places: FloatArray
    angles: FloatArray
    axes: FloatArray
    people: FloatArray

    @classmethod
    def of(cls, problem: Problem, plan: Plan) -> Self:
        """Returns the poses of a plan.

        Raises
        ------
        ValueError
            If the plan does not have a path of T+1 states for each robot.
        """
        require_paths(problem, plan)
        steps = problem.horizon + 1
        points = waypoints(problem, plan).swapaxes(0, 1)
        yaw, pitch = points[..., 3], points[..., 4]
        axes = Projection.axes_towards(yaw.ravel(), -pitch.ravel())
        corner = np.array([*problem.height_map.origin, 0.0])
        people = [actor.middles[:steps] - corner for actor in problem.actors]
        return cls(
            places=points[..., :3],
            angles=points[..., 3:],
            axes=axes.reshape(*yaw.shape, 3, 3),
            people=np.stack(people, axis=1) if people else np.zeros((steps, 0, 3)),
        )

    @property
    def rays(self) -> FloatArray:
        """The vectors [T+1, R, A, 3] (m) from each camera to each person's middle."""
        result: FloatArray = self.people[:, None] - self.places[:, :, None]
        return result

    @property
    def ways_between(self) -> FloatArray:
        """The vectors [T+1, R, R, 3] (m) from each camera to each other drone; 0 to itself."""
        result: FloatArray = self.places[:, None] - self.places[:, :, None]
        return result

    def seen_by_cameras(self, ways: FloatArray) -> FloatArray:
        """Returns vectors [T+1, R, n, 3] from the cameras in camera coordinates: right, up, forward
        (m).
        """
        result: FloatArray = np.einsum("trkx,trnx->trnk", self.axes, ways)
        return result


def require_paths(problem: Problem, plan: Plan) -> None:
    """Raises an error unless a plan has a path of T+1 states for each robot."""
    lengths, steps = [len(path) for path in plan.paths], problem.horizon + 1
    if lengths != [steps] * len(problem.robots):
        words = f"plan: must have {len(problem.robots)} paths of {steps} states, not {lengths}"
        raise ValueError(words)
