"""Drones that are visible in each other's images."""

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.footage.poses import Poses
from cocap_opt.problem import Camera, Problem
from cocap_opt.vision.projection import Projection


def drones_in_pictures(
    problem: Problem, poses: Poses, size: float, least_pixels: float
) -> BoolArray:
    """Returns an array [T+1, R, R], True if the second drone is visible in the first one's image.

    A drone is visible if its middle is in the frustum, close enough to appear large, and if the
    line to it is free of ground, columns and meshes. People hide no drones here. Sensors without
    images, such as a `Cone`, show no drones.

    Parameters
    ----------
    size : width of a drone, m
    least_pixels : smallest width in the image of a drone that counts, px
    """
    inside = in_frustums(problem, poses, size, least_pixels)
    t, i, k = np.nonzero(inside)
    inside[t, i, k] = _free_lines(problem, poses.places[t, i], poses.places[t, k])
    return inside


def in_frustums(problem: Problem, poses: Poses, size: float, least_pixels: float) -> BoolArray:
    """Returns an array [T+1, R, R], True if the second drone is in the first one's frustum, and
    large.

    A drone at depth z covers f size / z pixels of an image, with focal length f.
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
    """Returns an array [n], True if no solid matter is between eyes and targets, both [n, 3]."""
    from cocap_opt.vision.surfaces import Surface  # loads Embree

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
