"""GIF files in which all pictures share one palette.

If each picture had its own palette, colours would change from picture to picture, and the film
would flicker. With one palette, only moving parts are written, and the file is a third as large.
"""

import io
from collections.abc import Iterator, Sequence

import numpy as np
from PIL import Image

_COLOURS = 255  # one more is for pixels that do not change from one picture to the next
_MOST_SAMPLED = 16  # pictures from which colours are chosen
_BITS = 5  # bits of each of red, green and blue, in which colours are counted
# A colour's weight is this power of its number of pixels. With the number itself, the background
# would get all colours, and a thin track none.
_POWER = 0.35
_ROUNDS = 5  # rounds of k-means, which fits the palette to the counted colours


def gif(pictures: Sequence[bytes], pauses: Sequence[int]) -> bytes:
    """Returns a GIF file that repeats.

    Parameters
    ----------
    pictures : contents of image files, such as PNG, of one size
    pauses : ms for which each picture is shown
    """
    content, colours = (
        io.BytesIO(),
        _common_colours(pictures[:: -(-len(pictures) // _MOST_SAMPLED)]),
    )
    drawn = (
        picture.quantize(palette=colours, dither=Image.Dither.NONE) for picture in _read(pictures)
    )
    next(drawn).save(
        content, "GIF", save_all=True, append_images=drawn, duration=list(pauses), loop=0
    )
    return content.getvalue()


def _read(pictures: Sequence[bytes]) -> Iterator[Image.Image]:
    for picture in pictures:
        yield Image.open(io.BytesIO(picture)).convert("RGB")


def _common_colours(pictures: Sequence[bytes]) -> Image.Image:
    """Returns a picture whose palette suits all of them."""
    counts, sums = np.zeros(1 << 3 * _BITS), np.zeros((1 << 3 * _BITS, 3))
    for picture in _read(pictures):
        pixels = np.asarray(picture).reshape(-1, 3)
        red, green, blue = (pixels >> 8 - _BITS).astype(int).T
        cells = (red << 2 * _BITS) | (green << _BITS) | blue
        counts += np.bincount(cells, minlength=len(counts))
        for channel, values in enumerate(pixels.T):
            sums[:, channel] += np.bincount(cells, values, len(counts))
    found = counts > 0
    means = np.rint(sums[found] / counts[found, None]).astype(np.uint8)
    weighed = np.repeat(means, np.ceil(counts[found] ** _POWER).astype(int), axis=0)
    return Image.fromarray(weighed[None]).quantize(
        _COLOURS, Image.Quantize.MEDIANCUT, kmeans=_ROUNDS
    )
