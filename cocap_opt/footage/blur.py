"""Blur: the way that a person goes in a picture while the shutter is open."""

import numpy as np

from cocap_opt.data import FloatArray


def blur(
    rays: FloatArray, angles: FloatArray, focal: FloatArray, step: float, exposure: float
) -> FloatArray:
    """Returns the blur [T+1, R, A] (px) of each person in each drone's picture.

    It is (sideways speed / distance + rate of turning) focal exposure, where the speed is that of
    the person as the drone has it, so that who flies beside a walker has none. The sum is the most
    that both can do together: a camera that turns with a person has less. It is that of the middle
    of the picture; towards the edges of a wide one it is more.

    Drones fly straight from step to step and turn evenly, as people do. At a step the greater of
    the moves before and after counts.

    Parameters
    ----------
    rays : [T+1, R, A, 3] m, from drones to people
    angles : [T+1, R, 2] rad, yaw and pitch, which do not jump at a full turn
    focal : [R] px; nan where there is no picture, and then blur is nan
    step : s from a step to the next
    exposure : s
    """
    speeds = np.diff(rays, axis=0) / step
    turning = np.linalg.norm(np.diff(angles, axis=0), axis=-1)[..., None] / step
    rates = np.zeros(rays.shape[:3])  # rad/s
    np.maximum(rates[:-1], _sweep(rays[:-1], speeds) + turning, out=rates[:-1])
    np.maximum(rates[1:], _sweep(rays[1:], speeds) + turning, out=rates[1:])
    result: FloatArray = rates * (focal * exposure)[:, None]
    return result


def _sweep(rays: FloatArray, speeds: FloatArray) -> FloatArray:
    """Returns the rates [..] (rad/s) at which rays [.., 3] turn whose ends have speeds [.., 3]."""
    square = (rays**2).sum(axis=-1)
    crossing = np.linalg.norm(np.cross(rays, speeds), axis=-1)
    result: FloatArray = crossing / np.maximum(square, np.finfo(float).tiny)
    return result
