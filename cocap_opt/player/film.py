"""Films of plans: the player's pictures one after the other, as a video or an animated image.

The pictures are screenshots of the player's page in headless Chromium. PyAV writes videos, and
Pillow writes animated images.
"""

import io
from collections.abc import Callable, Iterator
from fractions import Fraction
from importlib.util import find_spec
from itertools import chain, repeat
from typing import Any

import numpy as np
from PIL import Image

from cocap_opt.pictures.gif import gif
from cocap_opt.player.chromium import NAMES, Chromium, ChromiumError
from cocap_opt.player.filming import VIDEOS, Filming
from cocap_opt.player.player import Player
from cocap_opt.stop import Stop

_LAST = 1.0  # s, for which the last picture is shown
_CODEC_OPTIONS = {
    ".webm": {"crf": "32", "b": "0", "deadline": "realtime", "cpu-used": "7", "row-mt": "1"},
    ".mp4": {"crf": "21", "preset": "medium", "movflags": "+faststart"},
}
_QUALITY = 80  # quality of WebP


class FilmError(ValueError):
    """A film cannot be made; one line that gives the reason, or the number of pictures made."""


def require_film(suffix: str) -> str:
    """Returns the path of the browser that films of a kind need.

    Raises
    ------
    FilmError
        If there is no browser, or the library that writes such films is missing.
    """
    if suffix in VIDEOS and find_spec("av") is None:
        raise FilmError(
            f"{suffix} films need PyAV: pip install 'cocap-opt[film]'; .webp and .gif do not"
        )
    program = Chromium.program()
    if program is None:
        raise FilmError(
            f"films need Chromium or Chrome, named {' or '.join(NAMES)}; an .html file "
            "needs none, and its `record` saves a film, too"
        )
    return program


def filmed_plans(
    player: Player, filming: Filming, stop: Stop, tell: Callable[[int, int], None]
) -> tuple[bytes, int]:
    """Returns the film of a player's plans, and its number of pictures.

    Parameters
    ----------
    tell : called with the number of pictures done and their total

    Raises
    ------
    FilmError
        If it cannot be made, or not before `stop` is reached.
    """
    program, page = require_film(filming.suffix), player.page()
    try:
        with Chromium.opened(program, page, "film", filming.size) as browser:
            shown = browser.value("film.shown")
            browser.value(f"film.look({filming.view!r})")
            times = filming.times(shown["first"], shown["last"], shown["speed"])

            def pictures() -> Iterator[bytes]:
                for k, at in enumerate(times):
                    if stop.reached():
                        raise FilmError(
                            f"the time limit was reached after {k} of {len(times)} pictures, so "
                            "there is no film; allow more time, or use a higher --speed"
                        )
                    tell(k, len(times))
                    browser.value(f"film.show({at!r})")
                    yield browser.picture()

            write = _video if filming.suffix in VIDEOS else _moving
            return write(filming, pictures()), len(times)
    except ChromiumError as error:
        raise FilmError(f"{program}: {error}") from error


def _read(picture: bytes) -> Image.Image:
    return Image.open(io.BytesIO(picture)).convert("RGB")


def _video(filming: Filming, pictures: Iterator[bytes]) -> bytes:
    import av  # an extra

    content = io.BytesIO()
    with av.open(content, "w", format=filming.suffix[1:]) as container:
        stream: Any = container.add_stream(VIDEOS[filming.suffix], rate=filming.rate)
        stream.width, stream.height = filming.size
        stream.pix_fmt, stream.options = "yuv420p", _CODEC_OPTIONS[filming.suffix]
        stream.time_base = Fraction(1, filming.rate)
        for number, picture in enumerate(_lingering(pictures, round(_LAST * filming.rate))):
            frame: Any = av.VideoFrame.from_ndarray(np.asarray(_read(picture)))
            frame.pts, frame.time_base = number, Fraction(1, filming.rate)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return content.getvalue()


def _lingering(pictures: Iterator[bytes], count: int) -> Iterator[bytes]:
    """Yields pictures, and repeats the last one so many times."""
    picture = next(pictures)
    for following in pictures:
        yield picture
        picture = following
    yield from chain([picture], repeat(picture, count))


def _moving(filming: Filming, pictures: Iterator[bytes]) -> bytes:
    drawn = list(pictures)
    pauses = [*repeat(1000 // filming.rate, len(drawn) - 1), round(1000 * _LAST)]
    if filming.suffix == ".gif":
        return gif(drawn, pauses)
    content, (first, *others) = io.BytesIO(), map(_read, drawn)
    first.save(
        content, "WEBP", save_all=True, append_images=others, duration=pauses, loop=0,
        quality=_QUALITY, method=4,
    )  # fmt: skip
    return content.getvalue()
