"""Default weights for a drone that sees a person, used if no number is given.

By default the weight is half the reward of a single view of the person from where the person fills
a third of the image's height, so users need not know the meaning of px/m2. It depends only on
shapes, weights of faces and cameras: it is the same wherever drones start, whatever hides people,
and for a part of the steps. If seeing people has priority, the weight is so large that one drone
that sees a person is worth more than all pixels.
"""

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from cocap_opt.data import MOST_WEIGHT, FloatArray, ProblemError, read_only, require
from cocap_opt.problem import Actor, Camera, Objective, Problem, Robot, Shape, Views
from cocap_opt.problem.takes import least_chance
from cocap_opt.vision.faces import local_faces
from cocap_opt.vision.projection import Projection, dot

_DIRECTIONS = 8  # directions around the person, one of them ahead
_IMAGES = 3.0  # height of the image relative to the person in it
_SHARE_OF_A_VIEW = 0.5
_DIGITS = 9  # digits of a weight, so that it does not depend on the last bits of sines
_KEPT = 256  # cached pairs of shape and camera

FIRST: Literal["first"] = "first"
# A number for all people or one for each; None: the default; "first": more than everything else.
Weight = float | tuple[float, ...] | Literal["first"] | None


def default_weights(actors: Sequence[Actor], robots: Sequence[Robot]) -> tuple[float, ...]:
    """Returns the weight [A] in px^0.5/m of a drone that sees each person.

    The person is alone on flat ground. The camera is level with the person's middle, looks at it,
    and is at the distance at which the image is three times as high as the person, or farther, so
    that the whole person is in the image. The view's reward is the sum of the faces' weights, each
    times the root of its px/m2. The weight is half of the mean over eight directions and all
    robots' cameras; a `Cone` is left out, as it has no image.

    Raises
    ------
    ProblemError
        If no robot has a camera that makes images; it names the field `weight`.
    """
    cameras = [_level(robot.camera) for robot in robots if isinstance(robot.camera, Camera)]
    if not cameras:
        raise ProblemError(
            "weight: must be given if no drone has a pinhole camera, whose images define a default"
        )
    return tuple(_default_weight(actor, cameras) for actor in actors)


def with_views(
    problem: Problem,
    cameras: int = 2,
    weight: Weight = None,
    at_least: float = 0.3,
    share: float | None = None,
) -> Problem:
    """Returns the problem with an objective that counts the drones that see each person.

    Parameters
    ----------
    problem : the problem; its previous count is replaced
    cameras, weight, at_least, share : as in `Views`; weight None: each person's default; "first":
        more than all pixels and moves together

    Raises
    ------
    ProblemError
        If a number is out of range, or there is no default; it names the field.
    """
    actors, robots = problem.actors, problem.robots
    if isinstance(weight, str):
        require(weight == FIRST, "weight", f'must be a number or "{FIRST}", not {weight!r:.40}')
        weight = weight_before_all(
            actors, robots, problem.horizon, problem.objective, least_chance(problem.takes)
        )
    elif weight is None:
        weight = default_weights(actors, robots)
    views = Views(cameras=cameras, weight=weight, at_least=at_least, share=share)
    return problem.replace(objective=problem.objective.replace(views=views))


def weight_before_all(
    actors: Sequence[Actor], robots: Sequence[Robot], horizon: int, objective: Objective,
    chance: float = 1.0,
) -> float:  # fmt: skip
    """Returns a weight with which a drone that sees a person outweighs all pixels and moves.

    A face of area A and weight w that has p pixels, in all images together, is worth
    w sqrt(p / A). No pixel shows two faces. So all faces together are worth at most
    sqrt(P sum w^2 / A) at a step, by Cauchy and Schwarz, where P is the number of pixels of all
    images.

    A plan with more views is better than others if all importances are 0 or the same number, and so
    are the probabilities of takes. If they differ, the views of two plans may differ by less than
    the smallest of them, and pixels may decide.

    Parameters
    ----------
    actors, robots : actors and robots of the problem
    horizon : T
    objective : the objective without views
    chance : smallest probability of a take, a factor on the worth of its views

    Raises
    ------
    ProblemError
        If a robot has a camera without an image, or an importance is so small that the weight would
        be too large; it names the field `weight`.
    """
    cameras = [robot.camera for robot in robots if isinstance(robot.camera, Camera)]
    if len(cameras) < len(robots):
        raise ProblemError(
            "weight: must be a number if a drone has no pinhole camera, whose images bound the "
            "reward of pixels"
        )
    images = sum(camera.width * camera.height for camera in cameras)
    per_area = 0.0  # squared weights per area
    for actor in actors:
        weights = np.array(actor.face_weights) * max(actor.importance or (1.0,))
        per_area += float((weights**2 / local_faces(actor.shape).areas).sum())
    moves = (
        objective.stationarity + objective.keep_cell + objective.keep_heading + objective.balanced
    )
    at_a_step = objective.pixels * math.sqrt(images * per_area) + len(robots) * moves
    least = min((x for actor in actors for x in actor.importance or () if x > 0), default=1.0)
    weight = float(math.ceil((horizon + 1) * at_a_step / (min(least, 1.0) * chance) + 1))
    require(
        weight <= MOST_WEIGHT,
        "weight",
        f'"{FIRST}" would be above {MOST_WEIGHT:g} if an importance is {least:g}; give a number',
    )
    return weight


def _level(camera: Camera) -> Camera:
    """Returns a camera without its tilts, which do not affect the weight."""
    return camera.replace(tilts=(0.0,))


def _default_weight(actor: Actor, cameras: Sequence[Camera]) -> float:
    """Returns the weight of one person, the mean over the cameras."""
    paid = [
        w * root
        for camera in cameras
        for w, root in zip(actor.face_weights, _mean_roots(actor.shape, camera), strict=True)
    ]
    return float(f"{_SHARE_OF_A_VIEW * math.fsum(paid) / len(cameras):.{_DIGITS}g}")


@lru_cache(maxsize=_KEPT)
def _mean_roots(shape: Shape, camera: Camera) -> FloatArray:
    """Returns the roots [F] of the px/m2 of each face, averaged over all directions."""
    faces, projection = local_faces(shape), Projection(camera)
    around = 2 * math.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    axes = projection.axes_towards(around, np.zeros(_DIRECTIONS))
    roots = np.zeros(len(faces.areas))
    middle, distance = np.array([0.0, 0.0, shape.height / 2]), _distance(shape, camera)
    for right_up_forward in axes:
        eye = middle - distance * right_up_forward[2]
        seen = np.flatnonzero(dot(faces.normals, faces.centres - eye) < 0)  # no face hides another
        ways = faces.polygons[seen] - eye
        pixels = projection.area(dot(ways[:, :, None], right_up_forward))
        roots[seen] += np.sqrt(pixels / faces.areas[seen])
    return read_only(roots / _DIRECTIONS)


def _distance(shape: Shape, camera: Camera) -> float:
    """Returns the distance (m) of the camera from the person's middle."""
    # radius of an upright cylinder
    radius = float(np.hypot(*local_faces(shape).corners[:, :2].T).max())
    # distance at which the person is as high as the image
    as_high = shape.height * camera.focal / camera.height
    return max(_IMAGES * as_high, radius + as_high, radius / math.sin(camera.half_angle))
