"""Drones that are in each other's pictures."""

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.footage.poses import Poses
from cocap_opt.problem import Camera, Problem
from cocap_opt.vision.projection import Projection


def drones_in_pictures(
    problem: Problem, poses: Poses, size: float, least_pixels: float
) -> BoolArray:
    """Returns an array [T+1, R, R], true where the second drone is in the first one's picture.

    It is so if its middle is in the frustum, near enough to be large, and the ground, the columns
    and the meshes leave the line to it free. People hide no drone here. What has no picture, such
    as a `Cone`, has nobody in it.

    Parameters
    ----------
    size : m, of a drone from side to side
    least_pixels : px across the picture, of a drone that counts
    """
    inside = in_frustums(problem, poses, size, least_pixels)
    t, i, k = np.nonzero(inside)
    inside[t, i, k] = _free_lines(problem, poses.places[t, i], poses.places[t, k])
    return inside


def in_frustums(problem: Problem, poses: Poses, size: float, least_pixels: float) -> BoolArray:
    """Returns an array [T+1, R, R], true where the second is in the first one's frustum, and large.

    A drone at the depth z covers f size / z pixels of a picture, with a focal length of f.
    """
    points = poses.seen_by_cameras(poses.ways_between)
    found = np.zeros(points.shape[:3], dtype=np.bool_)
    for i, robot in enumerate(problem.robots):
        if isinstance(robot.camera, Camera):
            sides = Projection(robot.camera).frustum_distances(points[:, i])
            depth = points[:, i, :, 2]
            is_large = robot.camera.focal * size >= least_pixels * depth
            found[:, i] = (depth > 0) & is_large & (sides >= 0).all(axis=-1)
    return found


def _free_lines(problem: Problem, eyes: FloatArray, targets: FloatArray) -> BoolArray:
    """Returns an array [n], true where no solid matter is between eyes and targets, both [n, 3]."""
    from cocap_opt.vision.surfaces import Surface  # which loads Embree

    if not len(eyes):
        return np.ones(0, dtype=np.bool_)
    solid = [problem.height_map.corners, *(mesh.corners for mesh in problem.meshes)]
    corners = np.concatenate(solid) - [*problem.height_map.origin, 0.0]
    low, high = (end([end(part, axis=0) for part in (eyes, targets)], axis=0)
                 for end in (np.min, np.max))  # fmt: skip
    # Most triangles are below all drones.
    near = (corners.max(axis=1) >= low).all(axis=1) & (corners.min(axis=1) <= high).all(axis=1)
    middle = (low + high) / 2  # Embree computes in float32
    return Surface(corners[near] - middle).lets_pass(eyes - middle, targets - middle)
