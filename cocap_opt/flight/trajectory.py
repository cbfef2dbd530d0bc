"""The flights of a plan: the position and orientation of each drone at every moment.

Between two steps, each coordinate of a drone is a polynomial of degree five, or several, each for
an equal part of the step. A straight flight moves from step to step at a constant speed, as the
plan says; a smooth flight (`smooth`) has the same positions at the steps.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray, ProblemError, read_only
from cocap_opt.flight.bernstein import (
    Peak,
    derivative,
    parted,
    squared_length,
    values,
)
from cocap_opt.problem import Actor, Plan, Problem

DEGREE = 5
YAW, PITCH = 3, 4  # rows besides x, y and z
_PARTS = 40  # parts of a step at which distances from chords are computed
_SLACK = 1e-9  # share of a piece: tolerance for a moment beyond the last piece


class Samples(NamedTuple):
    """The positions and angles of drones at moments [n], drone by drone."""

    drone: IntArray  # [n]
    t: FloatArray  # [n] s since step 0
    place: FloatArray  # [n, 3] m, x, y and z of the map
    yaw: FloatArray  # [n] rad, 0 along +x, counter-clockwise; without jumps at a full turn
    pitch: FloatArray  # [n] rad, of the camera; 0 is level, negative is below the horizon


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The flights of all drones of a problem.

    Attributes
    ----------
    problem : the scene, whose `step` must be given
    pieces : [R, N, 5, 6] Bernstein coefficients of x, y (m from the corner of the map), z (m),
        yaw and pitch (rad) in each piece; N is T times the `parts` of a step
    """

    problem: Problem
    pieces: FloatArray

    @classmethod
    def straight(cls, problem: Problem, plan: Plan) -> "Trajectory":
        """Returns the straight flights of a plan that can be flown.

        Raises
        ------
        ProblemError
            If the problem has no step length.
        """
        if problem.step is None:
            raise ProblemError("step: must be given, as the scene defines no step length")
        return cls(problem, read_only(evenly(waypoints(problem, plan), 1)))

    def with_pieces(self, pieces: FloatArray) -> "Trajectory":
        """Returns other flights in the same scene."""
        return replace(self, pieces=read_only(pieces))

    @property
    def step(self) -> float:
        """Length of a step in seconds."""
        assert self.problem.step is not None
        return self.problem.step

    @property
    def parts(self) -> int:
        """Pieces in each step."""
        count: int = self.pieces.shape[1]
        return count // self.problem.horizon

    @property
    def piece_seconds(self) -> float:
        """Duration of each piece in seconds."""
        return self.step / self.parts

    @property
    def seconds(self) -> float:
        """Duration of the flights."""
        return float(self.problem.horizon * self.step)

    @cached_property
    def velocities(self) -> FloatArray:
        """Coefficients [R, N, 5, 5] of the velocities, per second."""
        return read_only(derivative(self.pieces) / self.piece_seconds)

    @cached_property
    def accelerations(self) -> FloatArray:
        """Coefficients [R, N, 5, 4] of the accelerations, per second squared."""
        return read_only(derivative(self.velocities) / self.piece_seconds)

    @property
    def start_surfaces(self) -> FloatArray:
        """Altitudes [R] (m) of the ground, roofs or meshes below the drones at step 0."""
        return self.problem.workspace.surfaces_below(self.at(np.zeros(1)).place)

    def at(self, times: FloatArray) -> Samples:
        """Returns the positions and angles of all drones at times [n], in s since step 0."""
        robots, count = self.pieces.shape[:2]
        place = times / self.piece_seconds
        which = np.clip(np.floor(place + _SLACK), 0, count - 1).astype(np.int64)
        shares = np.clip(place - which, 0.0, 1.0)
        found = np.stack([values(flown[which], shares) for flown in self.pieces]).reshape(-1, 5)
        return Samples(
            np.repeat(np.arange(robots), len(times)),
            np.tile(times, robots),
            found[:, :3] + [*self.problem.height_map.origin, 0.0],
            found[:, YAW],
            found[:, PITCH],
        )

    def distance_from(self, other: "Trajectory") -> float:
        """Returns the largest distance (m) at any moment from the same drone in another trajectory.

        The other trajectory has the same number of pieces per step, or one.
        """
        pieces = other.pieces if other.parts == self.parts else split(other.pieces, self.parts)
        ways = (self.pieces - pieces)[:, :, :3].reshape(-1, 3, DEGREE + 1)
        return float(np.sqrt(max(Peak.of(squared_length(ways)).value, 0.0)))

    def distance_from_chords(self, times: FloatArray) -> float:
        """Returns an upper bound on the distance (m) from straight lines between the positions at
        some times.

        Between two moments, a polynomial deviates from its chord by at most an eighth of its
        largest second derivative times the squared duration.

        Parameters
        ----------
        times : [n] s from 0 to the end
        """
        robots, count = self.pieces.shape[:2]
        cuts = max(1, _PARTS // self.parts) * count
        moments = np.union1d(times, np.linspace(0.0, self.seconds, cuts + 1))
        places, rows = (self.at(t).place.reshape(robots, -1, 3) for t in (moments, times))
        chords = np.array(
            [[np.interp(moments, times, axis) for axis in points.T] for points in rows]
        )
        off = np.sqrt(((places - chords.swapaxes(1, 2)) ** 2).sum(axis=-1))
        bends = np.sqrt((self.accelerations[:, :, :3] ** 2).sum(axis=2)).max(axis=2)
        which = ((moments[1:] + moments[:-1]) / 2 / self.piece_seconds).astype(np.int64)
        strays = bends[:, which.clip(0, count - 1)] * np.diff(moments) ** 2 / 8
        return float((np.maximum(off[:, 1:], off[:, :-1]) + strays).max())

    def least_distance(self) -> float:
        """Returns the minimum distance (m) between two drones at any moment; inf for one drone."""
        return least_length(self.between_drones)

    @property
    def between_drones(self) -> FloatArray:
        """The vectors [pairs N, 3, 6] from each drone to each later one, piece by piece."""
        first, second = np.triu_indices(len(self.pieces), 1)
        ways = self.pieces[second] - self.pieces[first]
        return np.asarray(ways[:, :, :3].reshape(-1, 3, DEGREE + 1))

    def walk_of(self, actor: Actor) -> FloatArray:
        """Returns the coefficients [T parts, 3, 6] of the walk of the middle of a person's body."""
        middles = actor.middles[: self.problem.horizon + 1]
        return evenly(middles - [*self.problem.height_map.origin, 0.0], self.parts)


def in_steps(problem: Problem) -> Problem:
    """Returns the problem with a step length, with which no drone can exceed a limit."""
    if problem.step is not None:
        return problem
    boundless = tuple(robot.replace(limits=None) for robot in problem.robots)
    return problem.replace(step=1.0, robots=boundless)


def waypoints(problem: Problem, plan: Plan) -> FloatArray:
    """Returns x, y (m from the corner of the map), z, yaw and pitch at the steps [R, T+1, 5].

    Angles change by at most half a turn from step to step; half a turn is counter-clockwise.
    """
    corner = np.array([*problem.height_map.origin, 0.0])
    rows = []
    for robot, path in zip(problem.robots, plan.paths, strict=True):
        headings = np.array([state.heading for state in path])
        count = robot.motion.headings
        turns = np.diff(headings) % count
        turns = np.where(2 * turns > count, turns - count, turns)
        yaw = np.cumsum([headings[0], *turns]) * (2 * np.pi / count)
        pitch = [-robot.camera.tilts[state.pitch] for state in path]
        rows.append(np.column_stack([problem.where(robot, path) - corner, yaw, pitch]))
    return np.array(rows)


def least_length(ways: FloatArray) -> float:
    """Returns the smallest length (m) of vectors [n, d, 6] at any moment; inf if there are none."""
    if not len(ways):
        return np.inf
    return float(np.sqrt(max(-Peak.of(-squared_length(ways)).value, 0.0)))


def evenly(places: FloatArray, parts: int) -> FloatArray:
    """Returns the pieces [.., T parts, d, 6] of motions at constant speed between places [.., T+1,
    d].

    They begin and end exactly at the places; a drone that stays has constant coefficients.
    """
    a, b = places[..., :-1, None, :, None], places[..., 1:, None, :, None]
    shares = (np.arange(parts)[:, None, None] + np.linspace(0.0, 1.0, DEGREE + 1)) / parts
    way = np.where(shares < 0.5, a + (b - a) * shares, b - (b - a) * (1 - shares))
    result: FloatArray = way.reshape(*places.shape[:-2], -1, places.shape[-1], DEGREE + 1)
    return result


def split(pieces: FloatArray, parts: int) -> FloatArray:
    """Returns pieces [.., T parts, d, n] made by cutting pieces [.., T, d, n] into equal parts."""
    rest, cut = pieces, []
    for k in range(parts, 1, -1):
        first, rest = parted(rest, 1 / k)
        cut.append(first)
    joined = np.stack([*cut, rest], axis=-3)
    result: FloatArray = joined.reshape(*pieces.shape[:-3], -1, *pieces.shape[-2:])
    return result
