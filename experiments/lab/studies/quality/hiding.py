"""The joints that a camera really sees: in its picture, with nothing in front of them."""

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.experiments.lab.studies.quality.cameras import Cameras
from cocap_opt.problem import Actor, Camera, Problem
from cocap_opt.vision.projection import Projection
from cocap_opt.vision.surfaces import Surface


class Hiding:
    """Ground, columns, meshes and other people hide joints; a body does not hide its own joints.

    Detectors of joints in pictures guess joints that are behind the body itself.
    """

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._corner = np.array([*problem.height_map.origin, 0.0])
        solid = [problem.height_map.corners, *(mesh.corners for mesh in problem.meshes)]
        triangles = np.concatenate(solid) - self._corner
        # Embree computes in float32.
        self._middle = np.array([*(np.array(problem.height_map.shape) / 2), 0.0])
        self._middle *= problem.height_map.resolution
        self._solid = Surface(triangles - self._middle)

    def sees(
        self,
        steps: IntArray,
        people: IntArray,
        drones: IntArray,
        cameras: Cameras,
        joints: FloatArray,
    ) -> BoolArray:
        """Returns an array [S, J, C], True if a camera sees a joint.

        Parameters
        ----------
        steps, people : [S]
        drones : [S, C] drones that carry the cameras
        cameras : [S, 1, C]
        joints : [S, J, 3] m, from the corner of the map
        """
        points = cameras.seen(joints)
        found = np.zeros(points.shape[:3], dtype=np.bool_)
        for k, (t, j) in enumerate(zip(steps.tolist(), people.tolist(), strict=True)):
            others = self._others(t, j)
            for n, drone in enumerate(drones[k].tolist()):
                camera = self._problem.robots[drone].camera
                assert isinstance(camera, Camera), "only pinhole cameras make images"
                sides = Projection(camera).frustum_distances(points[k, :, n])
                targets = joints[k] - self._middle
                eyes = np.tile(cameras.places[k, 0, n] - self._middle, (len(targets), 1))
                found[k, :, n] = (sides >= 0).all(axis=-1)
                for surface in (self._solid, others):
                    found[k, :, n] &= surface.lets_pass(eyes, targets)
        return found

    def _others(self, t: int, person: int) -> Surface:
        """Returns the bodies of all but one person at a step."""
        bodies = [
            _triangles(actor, t) - self._corner - self._middle
            for j, actor in enumerate(self._problem.actors)
            if j != person
        ]
        return Surface(np.concatenate([np.zeros((0, 3, 3)), *bodies]))


def _triangles(actor: Actor, t: int) -> FloatArray:
    """Returns the faces of a person at a step as triangles [n, 3, 3] (m)."""
    *foot, yaw = actor.poses[t].tolist()
    cos, sin = np.cos(yaw), np.sin(yaw)
    turn = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
    fans = [face[[0, k, k + 1]] for face in actor.shape.faces() for k in range(1, len(face) - 1)]
    result: FloatArray = np.array(fans) @ turn + foot
    return result
