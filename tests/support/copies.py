"""Rotated, mirrored and shifted copies of problems and plans."""

import math
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.problem import Actor, Plan, Problem, Robot, State
from cocap_opt.world.workspace import HeightMap, Mesh


class Copy(NamedTuple):
    """x, y -> mirrored along x if so wanted, then turned by quarters, then shifted (m)."""

    quarters: int = 0
    mirror: bool = False
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def points(self, points: FloatArray) -> FloatArray:
        """Points [n, 3]."""
        x, y, z = np.asarray(points, dtype=float).T
        x = -x if self.mirror else x
        for _ in range(self.quarters % 4):
            x, y = -y, x
        return np.column_stack([x, y, z]) + np.array(self.shift)

    def yaw(self, yaw: FloatArray) -> FloatArray:
        """Angles [n] in rad."""
        return (math.pi - yaw if self.mirror else yaw) + self.quarters * math.pi / 2

    def cells(self, values: FloatArray) -> FloatArray:
        """An array over cells [X, Y]."""
        values = values[::-1] if self.mirror else values
        return np.rot90(values, self.quarters)

    def height_map(self, given: HeightMap) -> HeightMap:
        """A map."""
        far = np.array(given.shape) * given.resolution
        corners = np.array([given.origin, np.array(given.origin) + far])
        moved = self.points(np.column_stack([corners, [0.0, 0.0]]))
        heights, datum = self.cells(given.heights), given.datum
        lift = self.shift[2]
        return HeightMap(
            heights=heights + lift,
            resolution=given.resolution,
            origin=(float(moved[:, 0].min()), float(moved[:, 1].min())),
            datum=(np.zeros(heights.shape) if datum is None else self.cells(datum)) + lift
            if lift or datum is not None
            else None,
            bare=None if given.bare is None else self.cells(given.bare) + lift,
        )

    def state(self, state: State, robot: Robot, shape: tuple[int, int]) -> State:
        """A robot's state on a map of this shape."""
        (width, depth), (x, y) = shape, (state.x, state.y)
        headings, heading = robot.motion.headings, state.heading
        if self.mirror:
            x, heading = width - 1 - x, headings // 2 - heading
        for _ in range(self.quarters % 4):
            x, y, width, depth = depth - 1 - y, x, depth, width
        heading = (heading + self.quarters * headings // 4) % headings
        return state._replace(x=x, y=y, heading=heading)

    def problem(self, problem: Problem) -> Problem:
        """A whole problem; headings must be a multiple of four."""
        shape = problem.height_map.shape
        return problem.replace(
            height_map=self.height_map(problem.height_map),
            meshes=tuple(self.mesh(mesh) for mesh in problem.meshes),
            robots=tuple(
                robot.replace(start=self.state(robot.start, robot, shape))
                for robot in problem.robots
            ),
            actors=tuple(self.actor(actor) for actor in problem.actors),
        )

    def mesh(self, mesh: Mesh) -> Mesh:
        """A mesh; a mirrored one is turned inside out."""
        triangles = mesh.triangles[:, ::-1] if self.mirror else mesh.triangles
        return Mesh(vertices=self.points(mesh.vertices), triangles=triangles)

    def actor(self, actor: Actor) -> Actor:
        """An actor; its own left and right are not exchanged, and have equal weights."""
        poses = np.column_stack([self.points(actor.poses[:, :3]), self.yaw(actor.poses[:, 3])])
        return actor.replace(poses=poses)

    def plan(self, plan: Plan, problem: Problem) -> Plan:
        """A plan of the problem that is copied."""
        shape = problem.height_map.shape
        return Plan(
            paths=tuple(
                tuple(self.state(state, robot, shape) for state in path)
                for robot, path in zip(problem.robots, plan.paths, strict=True)
            )
        )
