"""The quality of a plan: how many drones see people, how accurately and how sharply."""

import html
import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self, overload

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.footage.accuracy import information, jacobians, pixel_covariances, rms_errors
from cocap_opt.footage.assumptions import Assumptions as Assumptions
from cocap_opt.footage.blur import blur
from cocap_opt.footage.intruders import drones_in_pictures
from cocap_opt.footage.moments import worst_moments
from cocap_opt.footage.poses import Poses
from cocap_opt.footage.rays import widest_angle
from cocap_opt.footage.shares import visible_shares
from cocap_opt.footage.strip import draw_strip
from cocap_opt.footage.summary import OfPerson, Summary
from cocap_opt.footage.words import USUAL_WIDTH, quality_words
from cocap_opt.problem import Camera, Plan, Problem, Take
from cocap_opt.vision.seen import are_seen

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

    from cocap_opt.problem.pictures import WholeAxes

_ROUNDING = 1e-9  # tolerance for shares above 1
_MOST_MOMENTS = 5  # number of moments that are named


@dataclass(frozen=True, eq=False, repr=False)
class Quality:
    """The quality of a plan, person by person and step by step.

    Attributes
    ----------
    people : [A] names
    counts : [T+1, A] True for the person-steps that count: the person's weight and importance are
        above 0, and the step is not 0, unless the start counts
    first_step : first step that counts, 0 or 1
    seen : [T+1, R, A] True if a drone sees a person
    angles : [T+1, A] largest angle between two rays, as lines, 0 to 90 degrees; nan if fewer than
        two drones see the person
    errors : [T+1, A] mm, root mean square error of a point at the person's middle. It is infinite
        if fewer than two drones see the person, or all of them along one line; a drone adds nothing
        if that middle is beside or behind its camera. Sensors without images add nothing, either:
        the error is nan if two drones see the person only with their help, or if no drone has
        images
    blur : [T+1, R, A] px of each person in each image; nan if the drone does not see the person or
        has no image. None if the scene defines no step length
    drones_seen : [T+1, R, R] True if the second drone is in the first one's image, and large
    has_pictures : [R] True for drones with a pinhole camera
    assumptions : the assumptions of the measurement
    times : [T+1] s since step 0; None if the scene defines no step length
    takes : the takes; empty if people walk in one way only
    take_of : [A] number of each person's take; 0 without takes
    chances : [A] probability of that take; 1 without takes
    """

    people: tuple[str, ...]
    counts: BoolArray
    first_step: int
    seen: BoolArray
    angles: FloatArray
    errors: FloatArray
    blur: FloatArray | None
    drones_seen: BoolArray
    has_pictures: BoolArray
    assumptions: Assumptions
    times: FloatArray | None
    takes: tuple[Take, ...]
    take_of: IntArray
    chances: FloatArray

    @classmethod
    def of(
        cls,
        problem: Problem,
        plan: Plan,
        shares: FloatArray | None = None,
        assumptions: Assumptions | None = None,
    ) -> Self:
        """Returns the quality of a plan.

        Parameters
        ----------
        shares : [T+1, R, A] share of each person's unobstructed solid angle that is visible in each
            drone's image, 0 to 1 (default: computed)
        assumptions : errors and thresholds (default: the default assumptions, with the scene's
            share of a person)

        Raises
        ------
        ValueError
            If the plan or the shares do not have the size of the problem, or a share is not 0 to 1.
        """
        assumptions = assumptions or Assumptions.of(problem)
        poses = Poses.of(problem, plan)
        if shares is None:
            shares = visible_shares(problem, plan)
        seen = _seen(shares, poses.rays.shape[:3], assumptions.at_least)
        focal = np.array([_focal(robot.camera) for robot in problem.robots])
        return cls(
            people=_names(problem),
            counts=person_steps(problem),
            first_step=problem.first_step,
            seen=seen,
            angles=widest_angle(poses.rays, seen),
            errors=_errors(poses, seen, focal, assumptions),
            blur=_blur(problem, poses, seen, focal, assumptions),
            drones_seen=drones_in_pictures(
                problem, poses, assumptions.drone_size, assumptions.drone_pixels
            ),
            has_pictures=~np.isnan(focal),
            assumptions=assumptions,
            times=None if problem.step is None else np.arange(float(len(seen))) * problem.step,
            takes=problem.takes,
            take_of=problem.take_of,
            chances=problem.chances,
        )

    @property
    def views(self) -> IntArray:
        """Number of drones that see each person at each step [T+1, A]."""
        return np.asarray(self.seen.sum(axis=1, dtype=np.int64))

    @property
    def intruders(self) -> IntArray:
        """Number of drones in the images of others at each step [T+1]."""
        return np.asarray(self.drones_seen.sum(axis=(1, 2), dtype=np.int64))

    @property
    def worst_blur(self) -> FloatArray | None:
        """Blur [T+1, A] (px) in the image with the largest blur; nan if there is no image."""
        if self.blur is None:
            return None
        found = np.where(np.isnan(self.blur), -1.0, self.blur).max(axis=1)
        return np.where(found < 0, np.nan, found)

    @property
    def summary(self) -> Summary:
        """The shares, errors and counts of all person-steps that count, on average over takes."""
        return self._summarized(np.arange(len(self.people)))

    @property
    def by_take(self) -> list[Summary]:
        """The same numbers for each take alone, as if people were certain to walk that way."""
        return [self._summarized(np.flatnonzero(self.take_of == k)) for k in range(len(self.takes))]

    @property
    def by_person(self) -> list[OfPerson]:
        """The same numbers for each person with a step that counts, with their worst moments."""
        moments = worst_moments(self.views, self.angles, self.counts)
        worst = {m.person: m.words(self.times) for m in reversed(moments)}
        return [
            OfPerson.of(name, j, self._summarized(np.array([j])), worst.get(j, ""))
            for j, name in enumerate(self.people)
            if self.counts[:, j].any()
        ]

    @property
    def worst(self) -> list[str]:
        """A few of the worst moments in words, e.g. "Ada: one camera from 1.25 to 1.5 s"."""
        moments = worst_moments(self.views, self.angles, self.counts)[:_MOST_MOMENTS]
        return [f"{self.people[m.person]}: {m.words(self.times)}" for m in moments]

    @property
    def table(self) -> "pd.DataFrame":
        """The quality as a table, with a row per person and step.

        Its columns are `person`, `actor` (number of the person), `step`, `time` (s), `counts`,
        `views`, `angle` (degrees), `error` (mm) and `blur` (px, in the image with the largest
        blur). `time` and `blur` are omitted if the scene defines no step length.
        """
        from pandas import DataFrame  # takes long to import

        steps, people = self.counts.shape
        columns: dict[str, object] = {
            "person": np.repeat(np.array(self.people, dtype=object), steps),
            "actor": np.repeat(np.arange(people), steps),
            "step": np.tile(np.arange(steps), people),
        }
        if self.times is not None:
            columns["time"] = np.tile(self.times, people)
        columns |= {
            "counts": self.counts.T.ravel(),
            "views": self.views.T.ravel(),
            "angle": self.angles.T.ravel(),
            "error": self.errors.T.ravel(),
        }
        if (blurred := self.worst_blur) is not None:
            columns["blur"] = blurred.T.ravel()
        return DataFrame(columns)

    @overload
    def plot(self, ax: None = None) -> "WholeAxes": ...

    @overload
    def plot(self, ax: "Axes | None") -> "Axes": ...

    def plot(self, ax: "Axes | None" = None) -> "Axes":
        """Draw a strip for each person, coloured and hatched by the number of drones that see them.

        Steps that do not count are pale; people without steps that count are left out.

        Parameters
        ----------
        ax : matplotlib axes (default: those of a new figure)

        Examples
        --------
        >>> co.quality(problem, result).plot().figure.savefig("cameras.pdf")
        """
        share = self.assumptions.at_least
        return draw_strip(ax, self.people, self.views, self.counts, self.times, share)

    def __str__(self) -> str:
        return self.words(USUAL_WIDTH)

    def words(self, width: int) -> str:
        """Returns the summary, the worst moments and the assumptions, in lines of a given width."""
        blurred = None if self.blur is None else self.blur.swapaxes(1, 2)[self.counts]
        takes = [(take.name, found) for take, found in zip(self.takes, self.by_take, strict=True)]
        return quality_words(
            self.summary, self.worst, blurred, self.has_pictures, self.assumptions, takes, width
        )

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        """Describes the quality in a notebook."""
        return f"<pre>{html.escape(str(self))}</pre>"

    def _summarized(self, people: IntArray) -> Summary:
        """Returns the summary over the person-steps of some people."""
        counts, chances = self.counts[:, people], None
        if self.takes:
            chances = np.broadcast_to(self.chances[people], counts.shape)[counts]
        pictures = self.drones_seen[self.first_step :, self.has_pictures]
        return Summary.of(
            self.views[:, people][counts],
            self.angles[:, people][counts],
            self.errors[:, people][counts],
            pictures.reshape(-1, pictures.shape[2]),
            chances,
        )


def person_steps(problem: Problem) -> BoolArray:
    """Returns an array [T+1, A], True for the person-steps that count.

    These are steps 1 to T, and 0 if the start counts, of people with a weight above 0 for some
    face, at an importance above 0; also if the objective counts no pixels.
    """
    steps = problem.horizon + 1
    found = np.zeros((steps, len(problem.actors)), dtype=np.bool_)
    weights = problem.importance[:, problem.face_owner] * problem.face_weights
    t, faces = np.nonzero(weights > 0)
    found[t, problem.face_owner[faces]] = True
    found[: problem.first_step] = False
    return found


def _seen(shares: FloatArray, shape: tuple[int, ...], at_least: float) -> BoolArray:
    """Returns an array [T+1, R, A], True if a drone sees a person; raises an error for wrong
    shares.
    """
    if np.shape(shares) != shape:
        raise ValueError(f"shares: must have the shape {shape}, not {np.shape(shares)}")
    if not ((shares >= 0) & (shares <= 1 + _ROUNDING)).all():  # False for nan, too
        raise ValueError(f"shares: must be 0..1, not {np.min(shares):g}..{np.max(shares):g}")
    return are_seen(shares, at_least)


def _errors(
    poses: Poses, seen: BoolArray, focal: FloatArray, assumptions: Assumptions
) -> FloatArray:
    """Returns the errors [T+1, A] in mm; `focal` [R] is nan for drones without images."""
    points = poses.seen_by_cameras(poses.rays)
    # A person whose middle is beside or behind a near camera may still reach into its image.
    measured = seen & ~np.isnan(focal)[:, None] & (points[..., 2] > 0)
    t, i, j = np.nonzero(measured)
    by_point = jacobians(points[t, i, j], focal[i])
    covariances = pixel_covariances(
        points[t, i, j], by_point, assumptions.pixel_error, assumptions.position_error,
        assumptions.attitude_error,
    )  # fmt: skip
    total = np.zeros((*seen.shape[::2], 3, 3))
    np.add.at(total, (t, j), information(poses.axes[t, i], by_point, covariances))
    errors = 1000 * rms_errors(total)
    without = (seen & np.isnan(focal)[:, None]).any(axis=1)
    unknown = np.isinf(errors) & without & (seen.sum(axis=1) >= 2)
    errors[unknown | np.isnan(focal).all()] = np.nan
    return errors


def _blur(
    problem: Problem, poses: Poses, seen: BoolArray, focal: FloatArray, assumptions: Assumptions
) -> FloatArray | None:
    """Returns the blur [T+1, R, A] in px for people seen by drones, otherwise nan; or None."""
    if problem.step is None:
        return None
    found = blur(poses.rays, poses.angles, focal, problem.step, assumptions.exposure)
    return np.where(seen, found, np.nan)


def _focal(camera: object) -> float:
    """Returns the focal length (px) of a camera; nan for a sensor without images."""
    return camera.focal if isinstance(camera, Camera) else math.nan


def _names(problem: Problem) -> tuple[str, ...]:
    """Returns the names of people; people without a name are called by number."""
    met = Counter(actor.name for actor in problem.actors)
    return tuple(
        actor.name if actor.name and met[actor.name] == 1 else problem.person(j)
        for j, actor in enumerate(problem.actors)
    )
