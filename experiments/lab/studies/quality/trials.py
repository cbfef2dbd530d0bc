"""Joints of walkers in the pictures of a plan, repeatedly triangulated with noise."""

from collections.abc import Iterator
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.experiments.lab.studies.quality.cameras import Cameras
from cocap_opt.experiments.lab.studies.quality.hiding import Hiding
from cocap_opt.experiments.lab.studies.quality.plans import PlannedQuality
from cocap_opt.experiments.lab.studies.quality.rows import PersonStep, rounded
from cocap_opt.experiments.lab.studies.quality.triangulation import by_library, least_squares
from cocap_opt.experiments.lab.studies.quality.walker import joints_of
from cocap_opt.footage.accuracy import information, jacobians, pixel_covariances, rms_errors
from cocap_opt.footage.poses import Poses
from cocap_opt.footage.quality import Assumptions
from cocap_opt.problem import Camera, Problem

_NEAREST = 0.05  # m, that a joint must be ahead of a camera


class Trials(NamedTuple):
    """The size of the experiment.

    Attributes
    ----------
    draws : number of noise samples for each joint
    most : largest number of person-steps of a plan, drawn from all that can be triangulated
    exact : assumptions by which plans are judged, and noise is drawn
    posed : the same, with errors of the drones' poses
    library : True if the library triangulates, too
    """

    draws: int
    most: int
    exact: Assumptions
    posed: Assumptions
    library: bool


class _Films(NamedTuple):
    """Person-steps [S] that are seen by the same number of drones C, and their cameras."""

    steps: IntArray
    people: IntArray
    drones: IntArray  # [S, C]
    cameras: Cameras  # [S, 1, C]
    joints: FloatArray  # [S, J, 3] m
    middles: FloatArray  # [S, 3] m

    @classmethod
    def all_of(
        cls, problem: Problem, planned: PlannedQuality, most: int, rng: np.random.Generator
    ) -> Iterator[Self]:
        """Yields the films of a plan, by the number of drones."""
        poses = Poses.of(problem, planned.plan)
        corner = np.array([*problem.height_map.origin, 0.0])
        focal = np.array([r.camera.focal if isinstance(r.camera, Camera) else np.nan
                          for r in problem.robots])  # fmt: skip
        walkers = [joints_of(actor, problem.horizon + 1) - corner for actor in problem.actors]
        joints = np.stack(walkers, axis=1)  # [T+1, A, J, 3]
        quality = planned.quality
        t, j = np.nonzero(
            quality.counts & np.isfinite(quality.errors) & _all_ahead(poses, joints, quality.seen)
        )
        chosen = np.sort(rng.permutation(len(t))[:most])
        t, j = t[chosen], j[chosen]
        counts = quality.views[t, j]
        for count in np.unique(counts).tolist():
            at, who = t[counts == count], j[counts == count]
            drones = np.nonzero(quality.seen[at, :, who])[1].reshape(-1, count)
            which = at[:, None], drones
            cameras = Cameras(poses.places[which], poses.axes[which], focal[drones])
            yield cls(at, who, drones, _with_joints(cameras), joints[at, who],
                      poses.people[at, who])  # fmt: skip

    def predicted(self, given: Assumptions, sees: BoolArray | None = None) -> FloatArray:
        """Returns the errors [S, J] (mm) that quality's model predicts for the joints.

        Parameters
        ----------
        sees : [S, J, C] True if a camera sees the joint (default: all of them)
        """
        seen = self.cameras.seen(self.joints)
        by_point = jacobians(seen, np.broadcast_to(self.cameras.focal, seen.shape[:-1]))
        parts = information(self.cameras.axes, by_point, _covariances(seen, by_point, given))
        if sees is not None:
            parts = parts * sees[..., None, None]
        result: FloatArray = 1000 * rms_errors(parts.sum(axis=-3))
        return result

    def found(
        self, given: Assumptions, draws: int, rng: np.random.Generator, library: bool
    ) -> tuple[FloatArray, FloatArray]:
        """Returns errors [S] (mm, RMS over joints and draws) by least squares and by the library.

        The library's errors are nan if `library` is False.
        """
        images = self._images(given, draws, rng)  # [S, J, N, C, 2]
        shape = images.shape[:3]
        seen = self.cameras.seen(self.joints)
        by_point = jacobians(seen, np.broadcast_to(self.cameras.focal, seen.shape[:-1]))
        whitening = np.linalg.inv(np.linalg.cholesky(_covariances(seen, by_point, given)))
        by_draw = Cameras(*(part[:, :, None] for part in self.cameras))
        flat = (-1, *images.shape[3:])
        points = least_squares(
            by_draw.for_points(shape),
            images.reshape(flat),
            np.broadcast_to(whitening[:, :, None], (*images.shape, 2)).reshape(*flat, 2),
            np.broadcast_to(self.middles[:, None, None], (*shape, 3)).reshape(-1, 3),
        ).reshape(*shape, 3)
        by_other = np.full_like(points, np.nan)
        for k in range(len(self.steps) if library else 0):
            cameras = Cameras(*(part[k, 0] for part in self.cameras))
            by_other[k] = by_library(cameras, images[k].reshape(flat)).reshape(*shape[1:], 3)
        return self._rms(points), self._rms(by_other)

    def _images(self, given: Assumptions, draws: int, rng: np.random.Generator) -> FloatArray:
        """Returns images [S, J, N, C, 2] (px) with noise, by slightly displaced cameras."""
        count, drones = self.drones.shape
        cameras = Cameras(*(part[:, :, None] for part in self.cameras))
        if given.position_error or given.attitude_error:
            astray = rng.normal(size=(2, count, 1, draws, drones, 3))
            cameras = cameras.moved(
                given.position_error * astray[0], given.attitude_error * astray[1]
            )
        exact = cameras.images(cameras.seen(self.joints[:, :, None]))
        shape = (count, self.joints.shape[1], draws, drones, 2)
        result: FloatArray = exact + given.pixel_error * rng.normal(size=shape)
        return result

    def _rms(self, points: FloatArray) -> FloatArray:
        """Returns the errors [S] (mm) of points [S, J, N, 3]."""
        squares = ((points - self.joints[:, :, None]) ** 2).sum(axis=-1)
        result: FloatArray = 1000 * np.sqrt(squares.mean(axis=(1, 2)))
        return result


def person_steps(
    problem: Problem, seed: int, planned: PlannedQuality, trials: Trials
) -> Iterator[PersonStep]:
    """Yields person-steps of a plan that two drones or more see, with errors of their joints."""
    rng = np.random.default_rng([seed, *problem.name.encode(), *planned.planner.encode()])
    hiding = Hiding(problem)
    for films in _Films.all_of(problem, planned, trials.most, rng):
        exact, posed = (_over_joints(films.predicted(a)) for a in (trials.exact, trials.posed))
        found, library = films.found(trials.exact, trials.draws, rng, trials.library)
        found_posed, _ = films.found(trials.posed, trials.draws, rng, False)
        sees = hiding.sees(films.steps, films.people, films.drones, films.cameras, films.joints)
        left = films.predicted(trials.exact, sees)
        for k, (t, j) in enumerate(zip(films.steps.tolist(), films.people.tolist(), strict=True)):
            known = np.isfinite(left[k])
            numbers = (
                planned.quality.angles[t, j], planned.quality.errors[t, j], exact[k], found[k],
                library[k], posed[k], found_posed[k], known.mean(),
                _over_joints(left[k][known]) if known.any() else np.nan,
            )  # fmt: skip
            yield PersonStep(
                problem.name, seed, planned.planner, t, j, films.drones.shape[1],
                *(rounded(float(number), 4) for number in numbers),
            )  # fmt: skip


def _with_joints(cameras: Cameras) -> Cameras:
    """Returns cameras [S, C] with an axis for joints [S, 1, C]."""
    return Cameras(*(part[:, None] for part in cameras))


def _covariances(seen: FloatArray, by_point: FloatArray, given: Assumptions) -> FloatArray:
    """Returns the covariances [.., 2, 2] (px2) of images of points [.., 3] in cameras' axes."""
    return pixel_covariances(
        seen, by_point, given.pixel_error, given.position_error, given.attitude_error
    ) * np.ones((*seen.shape[:-1], 1, 1))


def _all_ahead(poses: Poses, joints: FloatArray, seen: BoolArray) -> BoolArray:
    """Returns an array [T+1, A], True if all drones that see a person have all joints ahead."""
    steps, people, count, _ = joints.shape
    ways = joints.reshape(steps, 1, people * count, 3) - poses.places[:, :, None]
    ahead = poses.seen_by_cameras(ways)[..., 2].reshape(*seen.shape, count) > _NEAREST
    return np.asarray((ahead.all(axis=-1) | ~seen).all(axis=1))


def _over_joints(errors: FloatArray) -> FloatArray:
    """Returns the root mean square over the last axis."""
    result: FloatArray = np.sqrt((errors**2).mean(axis=-1))
    return result
