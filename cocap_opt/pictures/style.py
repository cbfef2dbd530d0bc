"""The style that all figures share: colours, sizes, frames, legends, and fonts for any letters."""

import logging
import math
from collections.abc import Collection, Iterable
from functools import lru_cache
from typing import Any, Literal

from matplotlib import font_manager, ft2font
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from cocap_opt.letters import columns_of

BLUE, RED, AMBER, TEAL, PURPLE, GREY, BROWN, GREEN = SERIES = (
    "#30638e", "#d1495b", "#edae49", "#00798c", "#7b5ea7", "#5a5a5a", "#8c5a2b", "#2e8b57",
)  # fmt: skip
FADED = "#8d99ae"  # for things that are drawn only for comparison
MARKS = "osD^vPXp*"  # marks of series, in addition to their colours
_Dashes = str | tuple[int, tuple[float, ...]]
_DASHES: tuple[_Dashes, ...] = (
    "-", (0, (5, 1.5)), (0, (1.5, 1.2)), (0, (6, 1.5, 1.5, 1.5)),
    (0, (9, 1.5, 1.5, 1.5, 1.5, 1.5)),
)  # fmt: skip
# Number of different lines: as both counts are coprime, no two lines share colour and dashes.
LINES = len(SERIES) * len(_DASHES)
WIDTH = 5.2  # inches, of figures that are readable in a page's column and on a phone
TITLE, LABEL, SMALL = 11, 10, 9  # pt, sizes of letters
_DPI = 130
_HANDLE, _LETTER = 0.55, 0.085  # inches, widths in an entry of a legend, at size LABEL
_DEFAULT = "DejaVu Sans"  # comes with matplotlib
_BOXES = "Last Resort"  # a font that has a box for every letter

_log = logging.getLogger(__name__)


def new_figure(width: float, height: float) -> Figure:
    """Returns an empty figure with a size in inches."""
    return Figure(figsize=(width, height), layout="constrained", dpi=_DPI)


def new_canvas(width: float, height: float) -> tuple[Figure, Axes]:
    """Returns a figure with a size in inches, and axes over all of it, in inches, too."""
    figure = Figure(figsize=(width, height), dpi=_DPI)
    ax = figure.add_axes((0, 0, 1, 1), xlim=(0, width), ylim=(0, height))
    ax.axis("off")
    return figure, ax


def set_frame(ax: Axes, grid: Literal["both", "x", "y"] | None = "both") -> Axes:
    """Keeps only the two sides of the frame that have numbers, above a faint grid."""
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    if grid is not None:
        ax.set_axisbelow(True)
        ax.grid(axis=grid, lw=0.5, alpha=0.35)
    return ax


def line_look(number: int) -> dict[str, Any]:
    """Returns colour and dashes of a line by its number; the first LINES lines all differ."""
    return {
        "color": SERIES[number % len(SERIES)],
        "linestyle": _DASHES[number % len(_DASHES)],
    }


def columns_for(names: Collection[str], width: float) -> int:
    """Returns the number of columns of a legend with these names, for a width in inches."""
    longest = max(map(columns_of, names), default=0)
    most = max(1, min(3, int(width / (_HANDLE + _LETTER * longest))))
    return math.ceil(len(names) / math.ceil(len(names) / most)) if names else 1


def add_legend(figure: Figure, ax: Axes, columns: int | None = None) -> None:
    """Draws the legend of an axes below the whole figure, where it covers nothing."""
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        figure.legend(handles, labels, loc="outside lower center", fontsize=LABEL,
                      ncols=columns or len(handles), frameon=False)  # fmt: skip


def set_plain_log(ax: Axes, axis: Literal["x", "y"]) -> None:
    """Makes an axis logarithmic, with numbers as people write them."""
    ax.set(**{f"{axis}scale": "log"})
    drawn_axis = ax.xaxis if axis == "x" else ax.yaxis
    drawn_axis.set_major_formatter("{x:g}")
    drawn_axis.set_minor_formatter(NullFormatter())


def draw_level(ax: Axes, height: float, words: str, align: str = "left") -> None:
    """Draws a level as a dotted line, with words above it."""
    ax.axhline(height, color=GREY, lw=0.8, ls=":")
    ax.annotate(words, (0.01 if align == "left" else 0.99, height), (0, 4), fontsize=SMALL,
                color=GREY, xycoords=("axes fraction", "data"), textcoords="offset points",
                va="bottom", ha=align, zorder=5,
                bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none", "alpha": 0.8},
                )  # fmt: skip


@lru_cache(maxsize=256)
def families_for(text: str) -> tuple[str, ...]:
    """Returns the font of all figures and, if it lacks letters, installed ones that have them."""
    lacking = _lacking(text, _letters(font_manager.findfont(_DEFAULT)))
    found = [_DEFAULT]
    fonts = [font for font in font_manager.fontManager.ttflist if _BOXES not in font.name]
    for font in sorted(fonts, key=_oddness) if lacking else ():
        left = _lacking(lacking, _letters(font.fname))
        if len(left) < len(lacking):
            lacking = left
            found.append(font.name)
        if not lacking:
            break
    if lacking:
        letters = "".join(sorted(lacking))
        _log.warning("figures: no installed font has the letters %s", letters)
    return tuple(found)


def _oddness(font: font_manager.FontEntry) -> tuple[bool, str]:
    """Returns a sorting key that puts upright fonts of common weight first."""
    return font.style != "normal" or font.weight not in (400, "normal", "regular"), font.name


def _lacking(text: Iterable[str], letters: frozenset[int]) -> frozenset[str]:
    return frozenset(c for c in text if not c.isspace() and ord(c) not in letters)


@lru_cache(maxsize=512)
def _letters(path: str) -> frozenset[int]:
    """Returns the code points that a font has; none of a file that cannot be read."""
    try:
        return frozenset(ft2font.FT2Font(path).get_charmap())
    except (OSError, RuntimeError):
        return frozenset()
