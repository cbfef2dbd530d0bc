"""J of flights, evaluated between the steps, too: the views at every moment of a flight.

People are seen from the drones' positions, whether on the grid or not. If the objective counts the
drones that see a person, a drone counts if enough of the person is visible from its pose.
"""

import math

import numpy as np

from cocap_opt.data import MOST_STEPS, FloatArray
from cocap_opt.flight.trajectory import Samples, Trajectory
from cocap_opt.problem import NO_RULES, Actor, Airspace, Cone, Problem
from cocap_opt.vision.faces import FaceGeometry
from cocap_opt.vision.projection import Projection
from cocap_opt.vision.seen import SeenColumns
from cocap_opt.vision.sights import ConeSight, PinholeSight

PARTS = 4  # moments per step
_AT_ONCE = 256  # poses at once, which limits memory


def parts_of(problem: Problem) -> int:
    """Returns the number of moments at which each step is evaluated; 1 if there are many steps."""
    return max(1, min(PARTS, MOST_STEPS // problem.horizon))


def view_reward(flown: Trajectory, parts: int) -> float:
    """Returns the part of J from views, for a flight evaluated at some moments of each step.

    Each moment counts as a share of its step; with one moment per step, at its end, the result is
    the view reward of the plan. People walk and turn straight from step to step; weights of faces
    and of people are those at the step's end.
    """
    film = Film(flown.problem, parts, float(flown.pieces[:, :, 2].min()))
    return film.reward(film.coverages(flown.at(film.moments)))


class Film:
    """The coverage of a scene's people at some moments of each step.

    Coverage has a column for each face and, if the objective counts views, one for each person,
    numbered as in `Problem.step_view_sums`: W in total.

    Parameters
    ----------
    problem : the scene, whose `step` must be given
    parts : moments per step
    lowest : lowest altitude of a camera, m
    late : delay of the people in s; negative: they are early. They stand still before and after
        their walks
    """

    def __init__(self, problem: Problem, parts: int, lowest: float, late: float = 0.0) -> None:
        assert problem.step is not None
        self._parts = parts
        self._problem = _dense(problem, parts, late / problem.step)
        self._geometry = FaceGeometry(self._problem, lowest_eye=lowest)
        count = self._problem.horizon + 1
        self.moments: FloatArray = np.arange(count, dtype=np.float64) * (problem.step / parts)

    def coverages(self, views: Samples) -> list[FloatArray]:
        """Returns the coverage [moments, W] by each drone at the moments."""
        return [self.coverage(i, views) for i in range(len(self._problem.robots))]

    def coverage(self, robot: int, views: Samples) -> FloatArray:
        """Returns the coverage [moments, W] by one drone at the moments."""
        problem, of_drone = self._problem, views.drone == robot
        camera, counted = problem.robots[robot].camera, problem.objective.views
        yaw, tilt = views.yaw[of_drone], -views.pitch[of_drone]
        eyes = views.place[of_drone] - self._geometry.origin
        steps, coverage = np.arange(len(eyes)), np.zeros((len(eyes), problem.step_width))
        if not coverage.size:
            return coverage
        faces = len(problem.face_owner)
        if isinstance(camera, Cone):
            sight = ConeSight(self._geometry, problem, camera)
            for t in steps.tolist():
                coverage[t, :faces] = sight.coverage(t, eyes[[t]], yaw[[t]])[0]
                if counted is not None:
                    coverage[t, faces:] = sight.detected(t, eyes[[t]], yaw[[t]])[0]
            return coverage
        for batch in np.split(steps, range(_AT_ONCE, len(steps), _AT_ONCE)):
            axes, looks = Projection(camera).axes_towards(yaw[batch], tilt[batch]), batch - batch[0]
            pinhole = PinholeSight(self._geometry, problem, camera, axes)
            found = pinhole.seen(
                batch, eyes[batch], np.ones_like(batch), looks, people=counted is not None
            )
            seen = SeenColumns(*found.faces)
            if counted is not None:
                seen = SeenColumns.of(found, faces, counted.at_least)
            coverage[batch[seen.rows], seen.columns] = seen.amounts
        return coverage

    def reward(self, coverages: list[FloatArray]) -> float:
        """Returns the part of J from views, given the coverage [moments, W] by each drone."""
        dense, coverage = self._problem, np.sum(coverages, axis=0)
        shares = np.full(dense.horizon + 1, 1 / self._parts)
        shares[0] = 1.0 - dense.first_step
        pixels, drones = np.split(coverage, [len(dense.face_owner)], axis=1)
        if dense.objective.over_time:
            of_faces = dense.step_weights[0] * np.sqrt(shares @ pixels)
        else:
            of_faces = shares[:, None] * dense.step_weights * np.sqrt(pixels)
        cameras = 0 if dense.objective.views is None else dense.objective.views.cameras
        of_people = shares[:, None] * dense.count_weights * np.minimum(drones, cameras)
        return math.fsum([*of_faces.ravel(), *of_people.ravel()])


def _dense(problem: Problem, parts: int, late: float) -> Problem:
    """Returns the scene with several steps in place of each, without further checks."""
    actors = tuple(_denser(actor, problem.horizon, parts, late) for actor in problem.actors)
    return problem.replace(
        horizon=problem.horizon * parts, actors=actors, rules=NO_RULES, airspace=Airspace(),
        step=None,
    )  # fmt: skip


def _denser(actor: Actor, horizon: int, parts: int, late: float) -> Actor:
    """Returns a person at the moments between the steps, too, delayed by a number of steps."""
    poses = actor.poses[: horizon + 1].copy()
    poses[:, 3] = np.unwrap(poses[:, 3])  # yaw changes by at most half a turn between steps
    steps = np.arange(horizon * parts + 1) / parts - late
    columns = [np.interp(steps, np.arange(horizon + 1), column) for column in poses.T]
    importance = actor.importance
    if importance is not None:
        importance = (importance[0], *np.repeat(importance[1 : horizon + 1], parts).tolist())
    return actor.replace(poses=np.column_stack(columns), importance=importance)
