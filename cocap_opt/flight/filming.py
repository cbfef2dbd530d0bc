"""J of flights, evaluated between the steps, too: what is filmed at every moment of a flight."""

import math

import numpy as np

from cocap_opt.data import MOST_STEPS, FloatArray
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.problem import NO_RULES, Actor, Airspace, Problem
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.sights import pose_coverage

PARTS = 4  # moments of a step


def parts_of(problem: Problem) -> int:
    """Returns the number of moments at which each step is looked at; 1 if there are many steps."""
    return max(1, min(PARTS, MOST_STEPS // problem.horizon))


def view_reward(flown: Trajectory, parts: int) -> float:
    """Returns the part of J that views make, of a flight looked at at some moments of each step.

    Each moment of a step counts a share of the step; with one moment it is that of the step's
    end, and the result is the view reward of the plan. People walk and turn straight from step
    to step; a face's weight is that of the step's end.
    """
    dense = _dense(flown.problem, parts)
    moments = np.arange(dense.horizon + 1, dtype=np.float64) * (flown.step / parts)
    found = flown.at(moments)
    geometry = FaceGeometry(dense, lowest_eye=float(flown.pieces[:, :, 2].min()))
    coverage = np.zeros((dense.horizon + 1, len(dense.face_weights)))
    for i, robot in enumerate(dense.robots):
        own = found.drone == i
        tilt = -found.pitch[own]
        coverage += pose_coverage(
            geometry, dense, robot.camera, found.place[own], found.yaw[own], tilt
        )
    shares = np.full(dense.horizon + 1, 1 / parts)
    shares[0] = 1.0 - dense.first_step
    if dense.objective.over_time:
        return math.fsum(dense.step_weights[0] * np.sqrt(shares @ coverage))
    return math.fsum((shares[:, None] * dense.step_weights * np.sqrt(coverage)).ravel())


def _dense(problem: Problem, parts: int) -> Problem:
    """Returns the scene with so many steps in place of each, in which nothing else is checked."""
    actors = tuple(_denser(actor, problem.horizon, parts) for actor in problem.actors)
    return problem.replace(
        horizon=problem.horizon * parts, actors=actors, rules=NO_RULES, airspace=Airspace(),
        step=None,
    )  # fmt: skip


def _denser(actor: Actor, horizon: int, parts: int) -> Actor:
    """Returns a person at the moments between the steps, too."""
    poses = actor.poses[: horizon + 1].copy()
    poses[:, 3] = np.unwrap(poses[:, 3])  # the short way round
    importance = actor.importance
    if importance is not None:
        importance = (importance[0], *np.repeat(importance[1 : horizon + 1], parts).tolist())
    return actor.replace(poses=_between(poses, parts), importance=importance)


def _between(rows: FloatArray, parts: int) -> FloatArray:
    """Returns rows [T+1, n] with rows between them, [T parts + 1, n]."""
    shares = np.arange(parts)[:, None] / parts
    ways = rows[:-1, None] + shares * (rows[1:] - rows[:-1])[:, None]
    return np.concatenate([ways.reshape(-1, rows.shape[1]), rows[-1:]])
