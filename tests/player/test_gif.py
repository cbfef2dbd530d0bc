"""GIF files: what has one colour in a film has it in each of its pictures."""

import io

import numpy as np
from PIL import Image

from cocap_opt.pictures.gif import gif

VIOLET, SKY = (148, 103, 189), (238, 240, 243)


def drawn(number: int) -> bytes:
    """A PNG with a thin violet line, beside more and more shades."""
    pixels = np.full((120, 160, 3), SKY, np.uint8)
    pixels[40:110, : 10 + 30 * number] = np.random.default_rng(number).integers(
        0, 256, (70, 10 + 30 * number, 3)
    )
    pixels[10, 20 + number : 60 + number] = VIOLET
    content = io.BytesIO()
    Image.fromarray(pixels).save(content, "PNG")
    return content.getvalue()


def test_a_thin_line_has_its_colour_in_all_pictures() -> None:
    """Whatever else is in a picture, and however few pixels a line has."""
    with Image.open(io.BytesIO(gif([drawn(number) for number in range(5)], [40] * 5))) as film:
        assert film.n_frames == 5
        lines, skies = [], []
        for number in range(5):
            film.seek(number)
            pixels = np.asarray(film.convert("RGB")).astype(int)
            lines.append(pixels[10, 20 + number : 60 + number])
            skies.append(pixels[:10])
    assert len(np.unique(np.concatenate(lines), axis=0)) == 1
    assert np.abs(lines[0] - VIOLET).max() <= 24
    assert len(np.unique(np.concatenate(skies).reshape(-1, 3), axis=0)) == 1
    assert np.abs(skies[0] - SKY).max() <= 8


def test_each_picture_is_shown_for_its_time() -> None:
    """The last one may be longer."""
    with Image.open(io.BytesIO(gif([drawn(0), drawn(1), drawn(2)], [100, 100, 1000]))) as film:
        assert film.info["loop"] == 0
        times = []
        for number in range(3):
            film.seek(number)
            times.append(film.info["duration"])
    assert times == [100, 100, 1000]
