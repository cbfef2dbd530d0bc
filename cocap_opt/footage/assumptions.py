"""The assumptions with which the quality of a plan is measured."""

import math
from typing import Self

from cocap_opt.data import LARGEST, MOST_PIXELS, Data, within
from cocap_opt.problem import Problem, require_visible_share


class Assumptions(Data, frozen=True):
    """The assumptions with which quality is measured.

    Pixels are those of the scene's cameras: if you film at a lower resolution, convert the error to
    these pixels.

    Attributes
    ----------
    at_least : smallest visible share of a person's unobstructed solid angle with which a drone
        counts as seeing the person
    pixel_error : standard deviation of a point's position in an image along each axis, px
    position_error : standard deviation of a drone's position along each axis, m
    attitude_error : standard deviation of a camera's attitude about each axis, rad
    exposure : exposure time, s
    drone_size : width of a drone, m
    drone_pixels : smallest width of a drone in the image of another at which it counts as
        disturbing, px

    Raises
    ------
    ProblemError
        If a value is out of range.
    """

    at_least: float = 0.3
    pixel_error: float = 5.0
    position_error: float = 0.0
    attitude_error: float = 0.0
    exposure: float = 1 / 500
    drone_size: float = 0.4
    drone_pixels: float = 100.0

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Returns the default assumptions, with the share of a person with which the scene counts
        views.
        """
        views = problem.objective.views
        return cls() if views is None else cls(at_least=views.at_least)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_visible_share(self.at_least, "at_least")
        within(self.pixel_error, 1e-6, MOST_PIXELS, "pixel_error", "px")
        within(self.position_error, 0, LARGEST, "position_error", "m")
        within(self.attitude_error, 0, math.pi, "attitude_error", "rad")
        within(self.exposure, 0, 3600, "exposure", "s")
        within(self.drone_size, 0, LARGEST, "drone_size", "m")
        within(self.drone_pixels, 0, MOST_PIXELS, "drone_pixels", "px")
