"""Kinds of films, and the times that their pictures show."""

import math
from typing import NamedTuple

VIDEOS = {".webm": "libvpx-vp9", ".mp4": "libx264"}  # and their codecs
MOVING = (".webp", ".gif")
FILMS = (*VIDEOS, *MOVING)
VIEWS = ("3d", "above")
_RATES = {".gif": 10, ".webp": 15}  # pictures per second of animated images
_VIDEO_RATE = 30


class Filming(NamedTuple):
    """The kind, size and speed of a film, and its view.

    Attributes
    ----------
    suffix : one of `FILMS`
    view : one of `VIEWS`
    size : px, even numbers
    speed : steps per second; None: the speed of the player
    """

    suffix: str
    view: str
    size: tuple[int, int]
    speed: float | None

    @property
    def rate(self) -> int:
        """Pictures per second."""
        return _RATES.get(self.suffix, _VIDEO_RATE)

    def times(self, first: int, last: int, usual: float) -> list[float]:
        """Returns the times of the pictures from one step to another, in steps with fractions.

        Parameters
        ----------
        usual : steps per second if no speed is given
        """
        each = (self.speed or usual) / self.rate
        count = math.floor((last - first) / each + 1e-9)
        times = [first + k * each for k in range(count + 1)]
        return times if last - times[-1] < 1e-9 else [*times, float(last)]
