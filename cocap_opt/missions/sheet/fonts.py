"""Fonts that have the letters of names, in whatever script a scene writes them."""

from collections.abc import Iterable
from functools import cache

from matplotlib.font_manager import FontProperties, fontManager, get_font

USUAL = "DejaVu Sans"  # which comes with matplotlib
_BOXES = "Last Resort"  # so begin the names of fonts that draw a box for any letter


def families_of(texts: Iterable[str]) -> tuple[list[str], str]:
    """Returns the font families that texts need, the usual one first, and the letters of none.

    Other families are looked for among the fonts that are installed, and only where the usual one
    lacks letters.
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
    """Returns the code points that a font file has; none if it cannot be read."""
    try:
        return frozenset(get_font(file).get_charmap())
    except (OSError, RuntimeError):
        return frozenset()
