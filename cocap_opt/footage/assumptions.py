"""The numbers that the quality of a plan is measured with."""

import math
from typing import Self

from cocap_opt.data import LARGEST, MOST_PIXELS, Data, within
from cocap_opt.problem import Problem, require_visible_share


class Assumptions(Data, frozen=True):
    """The numbers that quality is measured with.

    Pixels are those of the scene's cameras: who films at a lower resolution than they have states
    the error in their pixels.

    Attributes
    ----------
    at_least : smallest visible share of a person, by the solid angle that they have with nothing
        in the way, with which a drone sees them
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

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Returns the usual numbers, with the share of a person by which the scene counts views."""
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
