"""The camera of a recipe's drones: a known camera by name, or the numbers of any other."""

import logging
import math
import re
from collections.abc import Sequence
from typing import Annotated

from msgspec import Meta

from cocap_opt.data import MOST_PIXELS, ProblemError
from cocap_opt.problem import Camera
from cocap_opt.scenarios.hardware import CAMERAS, camera_called, film_of, require_tilts
from cocap_opt.scenarios.tables import Length, Table
from cocap_opt.scenarios.text import naming

log = logging.getLogger(__name__)

ASSUMED = "greedy-perspectives"  # camera of drones whose table names none
# mm, diagonal of the film frame to which 35 mm equivalent focal lengths refer
FILM_35MM = math.hypot(36.0, 24.0)

# the end of the name of a calibration's file
_FILE = re.compile(r"\.(?:ya?ml|toml|txt|xml|json|cam|csv|opt|cal)$", re.IGNORECASE)

_Pixels = Annotated[int, Meta(ge=1, le=MOST_PIXELS)]
_Angle = Annotated[float, Meta(gt=0, lt=180)]  # degrees
# degrees; more than pi, so that an angle in radians is never mistaken for one in degrees
_NARROWEST = 3.2
_ACROSS = 0.2, 170.0  # degrees
_LENSES = "focal", "fov", "fov_vertical", "fov_diagonal", "lens", "lens_35mm"
_OF_PHOTOS = "fov_diagonal", "fov_vertical", "lens_35mm"  # these refer to more than the width


class CameraTable(Table):
    """A camera given by numbers: the size of its images, and its lens in one of six ways.

    The pixels are square, and the principal point is in the middle of the image.
    """

    width: _Pixels
    height: _Pixels
    focal: Length | None = None  # px
    fov: _Angle | None = None  # degrees across the width of the image
    fov_vertical: _Angle | None = None  # degrees
    fov_diagonal: _Angle | None = None  # degrees
    sensor: Length | None = None  # mm, width of the part of the sensor that makes the image
    lens: Length | None = None  # mm, true focal length
    lens_35mm: Length | None = None  # mm, focal length of the same diagonal angle on 35 mm film
    # aspect ratio of the photos for which the lens is specified
    photo: tuple[_Pixels, _Pixels] | None = None

    def camera(self, tilts: tuple[float, ...]) -> Camera:
        """Returns the pinhole camera with these tilts (rad).

        Raises
        ------
        ProblemError
            If the lens is not given exactly once, or if numbers contradict each other.
        """
        given = [name for name in _LENSES if getattr(self, name) is not None]
        if not given:
            raise ProblemError(
                "must give the lens by focal (px), fov, fov_vertical or fov_diagonal (degrees), "
                "sensor and lens (mm), or lens_35mm (mm)"
            )
        if len(given) > 1:
            raise ProblemError(f"must have only one of {' and '.join(given)}: each gives the lens")
        if (self.sensor is None) != (self.lens is None):
            missing, there = ("sensor", "lens") if self.sensor is None else ("lens", "sensor")
            raise ProblemError(f"{missing}: must be given beside {there}, both in mm")
        if given[0].startswith("fov") and (angle := getattr(self, given[0])) < _NARROWEST:
            raise ProblemError(
                f"{given[0]}: must be {_NARROWEST} degrees or more, not {angle:g}; "
                f"{angle:g} radians are {math.degrees(angle):.3g} degrees; for a narrower lens, "
                "set focal (px)"
            )
        if self.photo is not None and given[0] not in _OF_PHOTOS:
            raise ProblemError(
                f"photo: must be left out beside {given[0]}, which it does not change; it is for "
                f"{', '.join(_OF_PHOTOS)}"
            )
        focal = self._focal()
        across = math.degrees(2 * math.atan(self.width / 2 / focal))
        if not _ACROSS[0] <= across <= _ACROSS[1]:
            raise ProblemError(
                f"{given[0]}: must be of a lens that sees {_ACROSS[0]:g} to {_ACROSS[1]:g} degrees "
                f"across the width of the image, not {across:.4g}; focal and the image are in px, "
                "sensor and lenses in mm"
            )
        return Camera(width=self.width, height=self.height, focal=focal, tilts=tilts)

    def _focal(self) -> float:
        """Returns the focal length in pixels of the image."""
        if self.focal is not None:
            return self.focal
        if self.fov is not None:
            return _focal(self.width, self.fov)
        if self.lens is not None and self.sensor is not None:
            return self.lens / self.sensor * self.width
        height = self._whole_height()
        if self.fov_vertical is not None:
            return _focal(height, self.fov_vertical)
        diagonal = math.hypot(self.width, height)
        if self.fov_diagonal is not None:
            return _focal(diagonal, self.fov_diagonal)
        assert self.lens_35mm is not None
        return self.lens_35mm / FILM_35MM * diagonal

    def _whole_height(self) -> float:
        """Returns the height (px) of the picture for which the lens is specified, with the width of
        the image.

        This is the height of photos; video usually keeps their full width and crops their height.
        """
        if self.photo is None:
            return self.height
        height = self.width * self.photo[1] / self.photo[0]
        if height < self.height * (1 - 1e-9):
            raise ProblemError(
                f"photo: must be no flatter than the image of {self.width} x {self.height} px, "
                f"which is cut out of it, not {self.photo[0]}:{self.photo[1]}"
            )
        return height


def _focal(length: float, degrees: float) -> float:
    """Returns the focal length of an image with the given length and angle of view (degrees)."""
    return length / 2 / math.tan(math.radians(degrees) / 2)


def camera_of(given: str | CameraTable | None, tilts: Sequence[float]) -> Camera:
    """Returns the camera of drones.

    Parameters
    ----------
    given : the name of a camera, or its numbers; None: the camera is `ASSUMED`
    tilts : degrees below the horizon

    Raises
    ------
    ProblemError
        If no camera has the name, numbers contradict each other, or tilts are out of range or not
        in order.
    """
    require_tilts(tilts)
    radians = tuple(math.radians(angle) for angle in tilts)
    if isinstance(given, CameraTable):
        with naming("camera"):
            return given.camera(radians)
    if given is not None and given not in CAMERAS and _FILE.search(given):
        raise ProblemError(
            f"camera: must be a name or numbers, not the file {given!r:.60}: write its numbers, "
            "such as { width = 1920, height = 1080, focal = 1400 } in px, with focal = fx"
        )
    numbers = "; or numbers, such as { width = 3840, height = 2160, fov = 65 }"
    return camera_called(ASSUMED if given is None else given, numbers).replace(tilts=radians)


def say_tilts(given: Sequence[Sequence[float]]) -> None:
    """Logs tilts (degrees) that may be radians, for each table of drones."""
    for k, tilts in enumerate(given):
        if any(0 < abs(angle) <= math.pi / 2 for angle in tilts):
            log.warning(
                "drones[%d].tilts: %s degrees are almost level: are they radians?",
                k, ", ".join(f"{angle:g}" for angle in tilts),
            )  # fmt: skip


def say_cameras(given: Sequence[str | CameraTable | None]) -> None:
    """Logs which camera is assumed, and which names mean photos with another aspect ratio than
    video.

    Parameters
    ----------
    given : camera of each table of drones, as in `camera_of`
    """
    if lacking := ", ".join(f"drones[{k}]" for k, each in enumerate(given) if each is None):
        assumed = camera_called(ASSUMED)
        log.warning(
            "%s: camera: not given; %s, %d x %d px, is assumed",
            lacking, ASSUMED, assumed.width, assumed.height,
        )  # fmt: skip
    for name in dict.fromkeys(each for each in given if isinstance(each, str)):
        if film := film_of(name):
            log.warning('camera = "%s" has the shape of its photos; use "%s" for film', name, film)
