"""The quality of a plan: by how many drones people are seen, how accurately, how sharply."""

import html
import math
import textwrap
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Self

import numpy as np

from cocap_opt.data import LARGEST, MOST_PIXELS, BoolArray, Data, FloatArray, IntArray, within
from cocap_opt.footage.accuracy import information, jacobians, pixel_covariances, rms_errors
from cocap_opt.footage.blur import blur
from cocap_opt.footage.intruders import drones_in_pictures
from cocap_opt.footage.moments import APART, worst_moments
from cocap_opt.footage.poses import Poses
from cocap_opt.footage.rays import widest_angle
from cocap_opt.footage.shares import visible_shares
from cocap_opt.problem import Camera, Plan, Problem

if TYPE_CHECKING:
    import pandas as pd

_ROUNDING = 1e-9  # by which a share may be rounded below the one that is asked for
_MOST_MOMENTS = 5  # that are named
_WIDTH = 80  # characters of a line
_LABEL = 32  # characters before a number
_SHARP = 0.5  # px of blur


class Assumptions(Data, frozen=True):
    """The numbers that quality is measured with.

    Pixels are those of the scene's cameras: who films at a lower resolution than they have states
    the error in their pixels.

    Attributes
    ----------
    at_least : share of the solid angle that a person has with nothing in the way, from which on a
        drone sees them
    pixel_error : px, standard deviation with which a point is found in a picture, along each axis
    position_error : m, standard deviation of a drone's place along each axis
    attitude_error : rad, standard deviation of a camera's attitude about each axis
    exposure : s for which the shutter is open
    drone_size : m, of a drone from side to side
    drone_pixels : px across the picture, of a drone that is in the way in the picture of another;
        those that are farther away and smaller do not count

    Raises
    ------
    ProblemError
        If one of them is out of range.
    """

    at_least: float = 0.3
    pixel_error: float = 5.0
    position_error: float = 0.0
    attitude_error: float = 0.0
    exposure: float = 1 / 500
    drone_size: float = 0.4
    drone_pixels: float = 100.0

    def __post_init__(self) -> None:
        super().__post_init__()
        within(self.at_least, 1e-6, 1, "at_least")
        within(self.pixel_error, 1e-6, MOST_PIXELS, "pixel_error", "px")
        within(self.position_error, 0, LARGEST, "position_error", "m")
        within(self.attitude_error, 0, math.pi, "attitude_error", "rad")
        within(self.exposure, 0, 3600, "exposure", "s")
        within(self.drone_size, 0, LARGEST, "drone_size", "m")
        within(self.drone_pixels, 0, MOST_PIXELS, "drone_pixels", "px")


class Summary(NamedTuple):
    """The quality of a plan in a few numbers, over the person-steps that count.

    Shares are nan where nothing counts; errors are nan where no drone has pictures.

    Attributes
    ----------
    person_steps : number of them
    by_two, by_three : shares that are seen by at least so many drones
    apart : share that two drones see from at least 30 degrees apart
    infinite : share whose error is infinite
    median, most_of_them : mm, errors that half and nine tenths of them do not exceed. They are
        errors of single person-steps, not in between, so that infinite ones count as such
    in_pictures : number of drones in the pictures of others, over all steps that count; those that
        are large enough, as `Assumptions` say
    disturbed : share of these pictures, one of each drone with pictures at each step, that have
        another drone in them; nan where no drone has pictures
    """

    person_steps: int
    by_two: float
    by_three: float
    apart: float
    infinite: float
    median: float
    most_of_them: float
    in_pictures: int
    disturbed: float


@dataclass(frozen=True, eq=False, repr=False)
class Quality:
    """The quality of a plan, person by person and step by step.

    Attributes
    ----------
    people : [A] names
    counts : [T+1, A] true for the person-steps that count: the person's weight and importance are
        more than 0, and so is the step, unless the start counts
    first_step : first step that counts, 0 or 1
    seen : [T+1, R, A] true where a drone sees a person
    angles : [T+1, A] degrees between the two rays that are farthest apart, as lines: 0 to 90; nan
        where fewer than two drones see the person
    errors : [T+1, A] mm, root mean square error of a point at the person's middle. It is infinite
        where fewer than two drones see the person, or all of them along one line; a drone beside
        or behind whose camera that middle is adds nothing. Nor do sensors without pictures: it is
        nan where it takes them to see the person twice, or no drone has pictures
    blur : [T+1, R, A] px of each person in each picture; nan where the drone does not see the
        person or has no picture. None where nobody says how long a step lasts
    drones_seen : [T+1, R, R] true where the second drone is in the first one's picture, and large
    has_pictures : [R] true for the drones with a pinhole camera
    assumptions : that it was measured with
    times : [T+1] s since step 0; None where nobody says how long a step lasts
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

    @classmethod
    def of(
        cls,
        problem: Problem,
        plan: Plan,
        shares: FloatArray | None = None,
        assumptions: Assumptions = Assumptions(),  # noqa: B008  # it is frozen
    ) -> Self:
        """Returns the quality of a plan.

        Parameters
        ----------
        shares : [T+1, R, A] of the solid angle that each person has from each drone with nothing in
            the way, the part that is visible in its picture, 0 to 1; computed if not given

        Raises
        ------
        ValueError
            If the plan or the shares are of other sizes than the problem, or a share is none.
        """
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
        )

    @property
    def views(self) -> IntArray:
        """Number of drones that see each person at each step [T+1, A]."""
        return np.asarray(self.seen.sum(axis=1, dtype=np.int64))

    @property
    def intruders(self) -> IntArray:
        """Number of drones in the pictures of others at each step [T+1]."""
        return np.asarray(self.drones_seen.sum(axis=(1, 2), dtype=np.int64))

    @property
    def worst_blur(self) -> FloatArray | None:
        """Blur [T+1, A] (px) in the picture that has most of it; nan where there is no picture."""
        if self.blur is None:
            return None
        found = np.where(np.isnan(self.blur), -1.0, self.blur).max(axis=1)
        return np.where(found < 0, np.nan, found)

    @property
    def summary(self) -> Summary:
        """The shares, errors and counts of all person-steps that count."""
        views, angles = self.views[self.counts], self.angles[self.counts]
        errors = self.errors[self.counts]
        disturbed = self.drones_seen.any(axis=2)[self.first_step :, self.has_pictures]
        return Summary(
            person_steps=len(views),
            by_two=_share(views >= 2),
            by_three=_share(views >= 3),
            apart=_share(angles >= APART),
            infinite=_share(np.isinf(errors)),
            median=_not_exceeded(errors, 0.5),
            most_of_them=_not_exceeded(errors, 0.9),
            in_pictures=int(self.intruders[self.first_step :].sum()),
            disturbed=_share(disturbed.ravel()),
        )

    @property
    def worst(self) -> list[str]:
        """A few of the worst moments in words, such as "Ada: one camera from 1.25 to 1.5 s"."""
        moments = worst_moments(self.views, self.angles, self.counts)[:_MOST_MOMENTS]
        return [moment.told(self.people[moment.person], self.times) for moment in moments]

    @property
    def table(self) -> "pd.DataFrame":
        """A row per person and step.

        Its columns are `person`, `actor` (number of the person), `step`, `time` (s), `counts`,
        `views`, `angle` (degrees), `error` (mm) and `blur` (px, in the picture that has most of
        it). Without seconds there are no `time` and `blur`.
        """
        from pandas import DataFrame  # slow to import

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

    def __str__(self) -> str:
        found = self.summary
        if not found.person_steps:
            return "Quality of a plan: nobody has any weight, so that no person-step counts"
        lines = [
            f"Quality of a plan: {_counted(found.person_steps, 'person-step')} that count, "
            f"{_counted(self.seen.shape[1], 'drone')}",
            _line("seen by two drones or more", _percent(found.by_two)),
            _line("seen by three or more", _percent(found.by_three)),
            _line(f"by two, {APART:g} degrees apart", _percent(found.apart)),
            _line("error of a point, RMS", self._told_errors()),
            _line("blur", self._told_blur()),
            _line("drones in others' pictures", self._told_intruders()),
            *(_line("" if k else "worst moments", words) for k, words in enumerate(self.worst)),
            *(textwrap.fill(words, _WIDTH) for words in self._notes()),
        ]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        """Describes the quality in a notebook."""
        return f"<pre>{html.escape(str(self))}</pre>"

    def _told_errors(self) -> str:
        """Says how large errors are."""
        found = self.summary
        if math.isnan(found.median):
            return "unknown: no pictures"
        parts = [
            f"{words} within {error:,.0f} mm"
            for words, error in (("half", found.median), ("nine tenths", found.most_of_them))
            if math.isfinite(error)
        ]
        if found.infinite:
            parts.append(f"infinite at {_percent(found.infinite)}")
        return ", ".join(parts)

    def _told_blur(self) -> str:
        """Says how large blur is, over the pictures of all person-steps that count."""
        if self.blur is None:
            return "unknown: nobody says how long a step lasts"
        counted = self.blur.swapaxes(1, 2)[self.counts]
        counted = counted[~np.isnan(counted)]
        if not len(counted):
            return "none: no pictures"
        return (
            f"{np.median(counted):.2g} px median, {counted.max():.2g} at most; "
            f"above {_SHARP:g}: {_percent(_share(counted > _SHARP))}"
        )

    def _told_intruders(self) -> str:
        """Says how many drones are large in the pictures of others."""
        found = self.summary
        if not found.in_pictures:
            return "none" if self.has_pictures.any() else "none: no pictures"
        return f"{found.in_pictures}, in {_percent(found.disturbed)} of all pictures"

    def _notes(self) -> Iterator[str]:
        """Yields what the numbers assume."""
        had = self.assumptions
        pose = (
            f"poses known to {1000 * had.position_error:.3g} mm and "
            f"{math.degrees(had.attitude_error):.3g} degrees"
            if had.position_error or had.attitude_error
            else "exactly known poses"
        )
        exposure = "" if self.blur is None else f", {_told_seconds(had.exposure)} of exposure"
        yield (
            f"With {had.pixel_error:g} px of error in a picture, {pose}{exposure}. A drone sees a "
            f"person if at least {100 * had.at_least:g} % of the solid angle that they have with "
            "nothing in the way is in its picture. An error is infinite where fewer than two "
            "drones see the person, or all of them along one line. A drone is in the picture of "
            f"another if {had.drone_size:g} m of it cover {had.drone_pixels:g} px there or more."
        )
        if not self.has_pictures.all():
            yield (
                f"{int((~self.has_pictures).sum())} of {len(self.has_pictures)} drones have no "
                "pictures: their views count, but have neither errors nor blur."
            )


def person_steps(problem: Problem) -> BoolArray:
    """Returns an array [T+1, A], true for the person-steps that count.

    These are steps 1 to T, and 0 if the start counts, of people one of whose faces has a weight
    above 0, at an importance above 0.
    """
    steps = problem.horizon + 1
    found = np.zeros((steps, len(problem.actors)), dtype=np.bool_)
    t, faces = np.nonzero(problem.step_weights > 0)
    found[t, problem.face_owner[faces]] = True
    found[: problem.first_step] = False
    return found


def _seen(shares: FloatArray, shape: tuple[int, ...], at_least: float) -> BoolArray:
    """Returns an array [T+1, R, A], true where a drone sees a person; refuses other shares."""
    if np.shape(shares) != shape:
        raise ValueError(f"shares: must have the shape {shape}, not {np.shape(shares)}")
    if not ((shares >= 0) & (shares <= 1 + _ROUNDING)).all():  # false for nan, too
        raise ValueError("shares: must be 0..1")
    return np.asarray(shares >= at_least - _ROUNDING)


def _errors(
    poses: Poses, seen: BoolArray, focal: FloatArray, assumptions: Assumptions
) -> FloatArray:
    """Returns the errors [T+1, A] in mm; `focal` [R] is nan for drones without pictures."""
    points = poses.seen_by_cameras(poses.rays)
    # A person whose middle is beside a near camera, or behind it, may still reach into its picture.
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
    """Returns the blur [T+1, R, A] in px where drones see people, nan elsewhere; or None."""
    if problem.step is None:
        return None
    found = blur(poses.rays, poses.angles, focal, problem.step, assumptions.exposure)
    return np.where(seen, found, np.nan)


def _focal(camera: object) -> float:
    """Returns the focal length (px) of a camera; nan for a sensor without pictures."""
    return camera.focal if isinstance(camera, Camera) else math.nan


def _names(problem: Problem) -> tuple[str, ...]:
    """Returns the names of people; those without a name of their own have their number."""
    met = Counter(actor.name for actor in problem.actors)
    return tuple(
        actor.name if actor.name and met[actor.name] == 1 else problem.person(j)
        for j, actor in enumerate(problem.actors)
    )


def _share(held: BoolArray) -> float:
    """Returns the share of values that are true; nan of none."""
    return float(held.mean()) if len(held) else math.nan


def _not_exceeded(values: FloatArray, share: float) -> float:
    """Returns the least of some values [n] that so large a share of them does not exceed.

    It is nan if all of them are; else those that are do not count.
    """
    known = np.sort(values[~np.isnan(values)])
    return float(known[math.ceil(share * len(known)) - 1]) if len(known) else math.nan


def _line(label: str, words: str) -> str:
    """Returns a label and what it stands for, folded below each other."""
    return textwrap.fill(
        words, _WIDTH, initial_indent=f"{label:{_LABEL}}", subsequent_indent=" " * _LABEL
    )


def _counted(number: int, noun: str) -> str:
    return f"{number:,} {noun}{'' if number == 1 else 's'}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _told_seconds(exposure: float) -> str:
    """Returns an exposure as cameras write it."""
    return f"1/{1 / exposure:.0f} s" if 0 < exposure < 0.5 else f"{exposure:g} s"
