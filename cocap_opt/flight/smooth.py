"""Smooth flights: those of a plan with continuous speed and acceleration.

At each step a drone is exactly where the plan says, and looks as it says. It passes with the mean
of the speeds before and after, and with the acceleration from the one to the other, or with a
share of both: with 0 it stops there. A drone begins and ends at rest.

Stopping is as safe as the plan against walls, zones and other drones: drones that stop at the steps
before and after a move fly the straight line of the plan, all at the same pace. So where smooth
flights come too near to each other or to anything else (`safety`), the drones concerned pass more
slowly, and at last stop. Beside people, who walk evenly, that may not be enough, and the flight is
refused.
"""

from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, read_only
from cocap_opt.flight.safety import Danger, dangers
from cocap_opt.flight.trajectory import Trajectory, waypoints
from cocap_opt.problem import Plan, Problem

_SLOWER = 0.5
_LEAST = 0.2  # below which a drone stops
_STEADY = 1.25  # times the slower rate on either side: no angle goes beyond those at the steps


class Smooth(NamedTuple):
    """Smooth flights, and what could not be made safe."""

    trajectory: Trajectory
    dangers: tuple[Danger, ...]
    slowed: int  # steps of drones at which they pass more slowly than they could


def smooth(problem: Problem, plan: Plan) -> Smooth:
    """Returns the smooth flights of a plan that can be flown and breaks no rule."""
    straight = Trajectory.straight(problem, plan)
    shares = np.ones((len(problem.robots), problem.horizon + 1))
    shares[:, [0, -1]] = 0.0
    while True:
        flown = straight.with_pieces(_pieces(waypoints(problem, plan), shares))
        found = dangers(flown)
        before = shares.copy()
        for danger in found:
            for drone in danger.drones:
                shares[drone, danger.step : danger.step + 2] *= _SLOWER
        shares[shares < _LEAST] = 0.0
        # A drone that passes two dangers at once is slowed for each.
        if (shares == before).all():
            return Smooth(flown, tuple(found), int((shares[:, 1:-1] < 1).sum()))


def _pieces(points: FloatArray, shares: FloatArray) -> FloatArray:
    """Returns the coefficients [R, T, 5, 6] of flights through points [R, T+1, 5].

    Parameters
    ----------
    shares : [R, T+1] of the speed at each step
    """
    before, after = points[:, 1:-1] - points[:, :-2], points[:, 2:] - points[:, 1:-1]
    speed, bend = np.zeros_like(points), np.zeros_like(points)  # per step, and per step squared
    share = shares[:, 1:-1, None]
    speed[:, 1:-1, :3] = (share * (before + after) / 2)[..., :3]
    bend[:, 1:-1, :3] = (share * (after - before))[..., :3]
    speed[:, 1:-1, 3:] = _steady(before[..., 3:], after[..., 3:])
    a, b = points[:, :-1], points[:, 1:]
    return read_only(
        np.stack(
            [
                a,
                a + speed[:, :-1] / 5,
                a + 2 * speed[:, :-1] / 5 + bend[:, :-1] / 20,
                b - 2 * speed[:, 1:] / 5 + bend[:, 1:] / 20,
                b - speed[:, 1:] / 5,
                b,
            ],
            axis=-1,
        )
    )


def _steady(before: FloatArray, after: FloatArray) -> FloatArray:
    """Returns rates between those before and after; 0 where one of them is, or they differ in sign.

    The coefficients then go one way only, so that nothing between the steps exceeds the steps.
    """
    same = before * after > 0
    total = np.where(same, before + after, 1.0)
    mean = np.where(same, 2 * before * after / total, 0.0)
    most = _STEADY * np.minimum(np.abs(before), np.abs(after))
    result: FloatArray = np.clip(mean, -most, most)
    return result
