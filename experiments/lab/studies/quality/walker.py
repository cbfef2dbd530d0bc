"""A walking figure of fifteen joints, which stays inside the shape of its person.

Lengths are shares of the height: Drillis and Contini, Body Segment Parameters, 1966, as quoted by
Winter, Biomechanics and Motor Control of Human Movement, 4th ed. 2009, figure 4.1. Arms and legs
swing like pendulums with the distance walked, arms against legs.
"""

import math

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.problem import Actor
from cocap_opt.problem.shapes import Prism, Shape

JOINTS = (
    "head", "neck", "pelvis",
    "left shoulder", "left elbow", "left wrist", "left hip", "left knee", "left ankle",
    "right shoulder", "right elbow", "right wrist", "right hip", "right knee", "right ankle",
)  # fmt: skip
_MIDDLE = {"head": 0.936, "neck": 0.870, "pelvis": 0.530}  # heights
_SHOULDER, _HIP = (0.129, 0.818), (0.0955, 0.530)  # aside, and height
_ARM, _LEG = (0.186, 0.146), (0.245, 0.246)  # upper and lower part
_SWING = math.radians(25)  # swing of thigh and upper arm, to both sides
_STRIDE = 0.83  # length of two steps, as a share of the height


def joints_of(actor: Actor, steps: int) -> FloatArray:
    """Returns the places [steps, J, 3] (m) of a person's joints at the steps 0, 1, .."""
    poses, height = actor.poses[:steps], actor.shape.height
    walked = np.hypot(*np.diff(poses[:, :2], axis=0).T).cumsum()
    phases = math.tau * np.concatenate([[0.0], walked]) / (_STRIDE * height)
    forward, left, up = np.moveaxis(_standing(phases) * height, -1, 0)
    farthest = math.hypot(*(np.abs(part).max() for part in (forward, left)))
    narrower = min(1.0, _inner_radius(actor.shape) / farthest)
    cos, sin = np.cos(poses[:, 3:]), np.sin(poses[:, 3:])
    turned = [narrower * (cos * forward - sin * left), narrower * (sin * forward + cos * left), up]
    result: FloatArray = poses[:, None, :3] + np.stack(turned, axis=-1)
    return result


def _standing(phases: FloatArray) -> FloatArray:
    """Returns places [n, J, 3], forward, left and up, of a figure of height 1 at the origin."""
    nowhere = np.zeros_like(phases)
    middle = [np.stack([nowhere, nowhere, nowhere + high], axis=-1) for high in _MIDDLE.values()]
    limbs = [
        joint
        for side, late in ((1, 0.0), (-1, math.pi))
        for (aside, high), parts, phase, bent in (
            (_SHOULDER, _ARM, phases + late + math.pi, 0.5),
            (_HIP, _LEG, phases + late, -0.4),
        )
        for joint in _limb(np.sin(phase) * _SWING, bent, (side * aside, high), parts)
    ]
    return np.stack([*middle, *limbs], axis=1)


def _limb(
    angle: FloatArray, bent: float, root: tuple[float, float], parts: tuple[float, float]
) -> list[FloatArray]:
    """Returns the root of a limb and the ends of its two parts, each [n, 3].

    The lower part is bent by a share of the swing unless the limb hangs straight down.
    """
    lower = angle + bent * np.abs(angle)
    places = [np.stack([0 * angle, 0 * angle + root[0], 0 * angle + root[1]], axis=-1)]
    for length, part in zip(parts, (angle, lower), strict=True):
        way = [length * np.sin(part), 0 * part, -length * np.cos(part)]
        places.append(places[-1] + np.stack(way, axis=-1))
    return places


def _inner_radius(shape: Shape) -> float:
    """Returns the radius (m) of the largest circle inside a shape, seen from above."""
    if isinstance(shape, Prism):
        return shape.apothem
    return min(shape.length, shape.width) / 2
