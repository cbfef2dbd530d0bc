"""Fonts that contain the letters of names, in any script."""

from collections.abc import Iterable
from functools import cache

from matplotlib.font_manager import FontProperties, fontManager, get_font

USUAL = "DejaVu Sans"  # installed with matplotlib
_BOXES = "Last Resort"  # prefix of fonts that draw a box for any letter


def families_of(texts: Iterable[str]) -> tuple[list[str], str]:
    """Returns the font families that texts need, the default first, and letters that are in none.

    Other families are searched among the installed fonts, and only if the default lacks letters.
    """
    wanted = {ord(letter) for text in texts for letter in text if letter.isprintable()}
    families, missing = [USUAL], wanted - _letters(fontManager.findfont(FontProperties(USUAL)))
    # In an order that does not depend on the disk.
    for name, file in sorted({(font.name, font.fname) for font in fontManager.ttflist}):
        if not missing:
            break
        if not name.startswith(_BOXES) and (found := missing & _letters(file)):
            families += [name] if name not in families else []
            missing -= found
    return families, "".join(map(chr, sorted(missing)))


@cache
def _letters(file: str) -> frozenset[int]:
    """Returns the code points that a font file contains; empty if it cannot be read."""
    try:
        return frozenset(get_font(file).get_charmap())
    except (OSError, RuntimeError):
        return frozenset()
