"""Blur: how far a person moves in an image while the shutter is open."""

import numpy as np

from cocap_opt.data import FloatArray


def blur(
    rays: FloatArray, angles: FloatArray, focal: FloatArray, step: float, exposure: float
) -> FloatArray:
    """Returns the blur [T+1, R, A] (px) of each person in each drone's image.

    The blur is (transverse speed / distance + turning rate) focal exposure, with the speed of the
    person relative to the drone, so a drone that flies beside a walker causes none. The sum is an
    upper bound: a camera that turns with a person has less blur. The value is for the middle of the
    image; towards the edges of a wide image it is larger.

    Drones fly straight from step to step and turn at a constant rate, as people do. At a step, the
    larger value of the moves before and after it counts.

    Parameters
    ----------
    rays : [T+1, R, A, 3] rays from drones to people, m
    angles : [T+1, R, 2] yaw and pitch, without jumps at a full turn, rad
    focal : [R] px; nan if there is no image; blur is then nan
    step : length of a step, s
    exposure : exposure time, s
    """
    speeds = np.diff(rays, axis=0) / step
    turning = np.linalg.norm(np.diff(angles, axis=0), axis=-1)[..., None] / step
    rates = np.zeros(rays.shape[:3])  # rad/s
    np.maximum(rates[:-1], _sweep(rays[:-1], speeds) + turning, out=rates[:-1])
    np.maximum(rates[1:], _sweep(rays[1:], speeds) + turning, out=rates[1:])
    result: FloatArray = rates * (focal * exposure)[:, None]
    return result


def _sweep(rays: FloatArray, speeds: FloatArray) -> FloatArray:
    """Returns the rates [..] (rad/s) at which rays [.., 3] turn if their ends have speeds [..,
    3].
    """
    square = (rays**2).sum(axis=-1)
    crossing = np.linalg.norm(np.cross(rays, speeds), axis=-1)
    result: FloatArray = crossing / np.maximum(square, np.finfo(float).tiny)
    return result
