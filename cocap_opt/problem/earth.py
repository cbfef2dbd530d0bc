"""Where a scene is on the Earth."""

from typing import Literal

from cocap_opt.data import LARGEST, MOST_LETTERS, Data, require, within

MOST_CRS = 100 * MOST_LETTERS  # letters; WKT may be long


class Earth(Data, frozen=True):
    """The place of a scene on the Earth: what its coordinates x, y and z mean.

    Nothing is converted between heights above the sea and above the ellipsoid.

    Attributes
    ----------
    crs : reference system of x and y, a projection in metres, as a code such as EPSG:25830 or as
        WKT
    origin : latitude and longitude (WGS 84, degrees) of the point x = 0, y = 0, from which the
        axes go along those of the system; None: x and y are the system's own
    heights : what altitudes are above, "sea" or "ellipsoid"; None: nobody knows
    base : m, altitude above that of z = 0
    """

    crs: str
    origin: tuple[float, float] | None = None
    heights: Literal["sea", "ellipsoid"] | None = None
    base: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(0 < len(self.crs) <= MOST_CRS, "crs", "must name a reference system")
        known = self.heights in (None, "sea", "ellipsoid")
        require(known, "heights", f"must be sea or ellipsoid, not {self.heights!r}")
        within(self.base, -LARGEST, LARGEST, "base", "m")
        require(
            self.heights is not None or self.base == 0,
            "base",
            "must be 0 where heights does not say what it is above",
        )
        if self.origin is not None:
            within(self.origin[0], -90, 90, "origin", "degrees of latitude")
            within(self.origin[1], -180, 180, "origin", "degrees of longitude")
