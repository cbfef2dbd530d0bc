"""Sensors of robots: pinhole cameras, and the cone sensor of Hughes et al."""

import math

from cocap_opt.data import FOCAL, MOST_PIXELS, Data, require, whole, within


class Camera(Data, frozen=True, tag="pinhole"):
    """A pinhole camera with square pixels and its principal point in the middle.

    A camera with more than one tilt has a gimbal: the pitch index is then part of the motion state.

    Attributes
    ----------
    width : px
    height : px
    focal : px
    tilts : rad below the horizon, one per pitch
    """

    width: int = 4000
    height: int = 3000
    focal: float = 2500.0
    tilts: tuple[float, ...] = (math.radians(10.0),)

    def __post_init__(self) -> None:
        super().__post_init__()
        whole(self.width, "width")
        whole(self.height, "height")
        within(self.width, 1, MOST_PIXELS, "width", "px")
        within(self.height, 1, MOST_PIXELS, "height", "px")
        within(self.focal, *FOCAL, "focal", "px")
        require(len(self.tilts) > 0, "tilts", "must hold at least one tilt")
        for tilt in self.tilts:
            allowed = abs(tilt) <= math.pi / 2  # False for nan, too
            require(allowed, "tilts", f"must be within +-pi/2 rad, not {tilt}")

    @property
    def half_angle(self) -> float:
        """Half of the horizontal angle of view, in rad."""
        return math.atan(self.width / 2 / self.focal)


class Cone(Data, frozen=True, tag="cone"):
    """The sensor of Hughes et al. 2024, which has no image and no range limit, and sees through
    obstacles.

    It detects the actors whose foot point is ahead, within half of the opening to either side. Each
    of their faces then counts as `|d.u| max(0, -d.n) / |d|^4` instead of px/m2, where n is the
    face's normal, d the vector in space from the sensor to the point on the ground below the face's
    middle, and u the horizontal viewing direction.

    Attributes
    ----------
    opening : rad
    """

    opening: float = math.pi / 2

    def __post_init__(self) -> None:
        super().__post_init__()
        within(self.opening, 0, math.tau, "opening", "rad")

    @property
    def tilts(self) -> tuple[float, ...]:
        """The only tilt, 0: the sensor looks horizontally and has no gimbal."""
        return (0.0,)

    @property
    def half_angle(self) -> float:
        """Half of the horizontal angle of view, in rad."""
        return self.opening / 2


AnyCamera = Camera | Cone
