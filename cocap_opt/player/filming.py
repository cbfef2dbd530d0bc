"""Kinds of films, and the moments that their pictures show."""

import math
from typing import NamedTuple

VIDEOS = {".webm": "libvpx-vp9", ".mp4": "libx264"}  # and their codecs
MOVING = (".webp", ".gif")
FILMS = (*VIDEOS, *MOVING)
VIEWS = ("3d", "above")
_RATES = {".gif": 10, ".webp": 15}  # pictures a second, of what is not a video
_VIDEO_RATE = 30


class Filming(NamedTuple):
    """The kind of a film, and what it shows.

    Attributes
    ----------
    suffix : one of `FILMS`
    view : one of `VIEWS`
    size : px, even numbers
    speed : steps a second; None: as the player plays them
    """

    suffix: str
    view: str
    size: tuple[int, int]
    speed: float | None

    @property
    def rate(self) -> int:
        """Pictures a second."""
        return _RATES.get(self.suffix, _VIDEO_RATE)

    def times(self, first: int, last: int, usual: float) -> list[float]:
        """Returns the steps, and what is between them, of the pictures from one step to another.

        Parameters
        ----------
        usual : steps a second, where no speed is asked for
        """
        each = (self.speed or usual) / self.rate
        count = math.floor((last - first) / each + 1e-9)
        times = [first + k * each for k in range(count + 1)]
        return times if last - times[-1] < 1e-9 else [*times, float(last)]
