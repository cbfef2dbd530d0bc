"""GIF files, all of whose pictures have the same colours.

With colours of its own, each picture shows the same thing in another one, and the film flickers.
With the same ones, only what moves is written, and the file is a third as large.
"""

import io
from collections.abc import Iterator, Sequence

import numpy as np
from PIL import Image

_COLOURS = 255  # one is left for what does not change from one picture to the next
_MOST_SAMPLED = 16  # pictures, of which colours are chosen
_BITS = 5  # of each of red, green and blue, by which colours are counted
# A colour counts as this power of its pixels. By their number the background would have all
# colours, and a thin track none of its own.
_POWER = 0.35
_ROUNDS = 5  # of k-means, which fit the colours to those that are counted


def gif(pictures: Sequence[bytes], pauses: Sequence[int]) -> bytes:
    """Returns a GIF file that repeats.

    Parameters
    ----------
    pictures : files, such as PNG, of one size
    pauses : ms, for which each is shown
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
