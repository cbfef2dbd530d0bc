"""A printed sheet for the crew (.pdf, A4): a map of the flights, and what must be known of them."""

import io
import textwrap
import warnings
from collections.abc import Iterator

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import AbstractPathEffect, withStroke

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.ways import Way, has_homes, parts_of_take
from cocap_opt.missions.briefing import Section, briefing
from cocap_opt.missions.export import Export
from cocap_opt.missions.zones import ZONE, outlines
from cocap_opt.problem.pictures import DRONE_COLOURS, PERSON, TopView
from cocap_opt.text import shortened

_A4 = 210 / 25.4, 297 / 25.4  # inches
_LEFT, _TOP, _BOTTOM = 0.09, 0.945, 0.05  # of the page
_SIZE = 7.5  # points
_LINE = 1.35 * _SIZE / 72 / _A4[1]  # of the page
_LETTERS = 104  # of a line
_AXIS, _HIGHEST = 0.04, 0.5  # of the page: numbers beside the map, and its height at most
_MARGIN = 5.0  # m around flights and walks, on the map
_DASHES = "-", "--", "-.", (0, (1, 1)), (0, (5, 1, 1, 1, 1, 1))  # which grey prints tell apart
_SQUARE = 14  # points, more than a ring has
_MARKS = 11  # of a drone's way, with times

Line = tuple[str, bool]  # and true for a title


def write(flight: Flight, every: float | None) -> Export:
    """Returns pages with a map, tables of times and places, distances, and what was not checked."""
    sections = [list(_lines(section)) for section in briefing(flight, every)]
    first, top = _first_page(flight)
    pages = [first]
    for k, part in enumerate(_paged(sections, top)):
        if k:
            pages.append(Figure(figsize=_A4))
        _write_lines(pages[-1], _TOP if k else top, part)
    content = io.BytesIO()
    with (
        mpl.rc_context({"pdf.fonttype": 42, "text.parse_math": False}),
        warnings.catch_warnings(),
        PdfPages(content, metadata={"CreationDate": None}) as file,
    ):
        warnings.filterwarnings("ignore", "Glyph")  # a scene's name may have any letters
        for number, page in enumerate(pages, 1):
            words = f"{shortened(flight.flown.problem.name)}, page {number} of {len(pages)}"
            _write(page, 1 - _LEFT, 0.025, words, ha="right")
            file.savefig(page)
    return Export({"": content.getvalue()})


def _first_page(flight: Flight) -> tuple[Figure, float]:
    """Returns a page with the title and the map, and where there is room below them."""
    page = Figure(figsize=_A4)
    _write(page, _LEFT, _TOP, f"Flight sheet: {shortened(flight.flown.problem.name)}",
           size=14, weight="bold")  # fmt: skip
    (left, right), (low, high) = ends = _frame(flight)
    width = 1 - 2 * _LEFT - _AXIS
    height = min(width * _A4[0] * (high - low) / (right - left) / _A4[1], _HIGHEST)
    top = _TOP - 0.04
    ax = page.add_axes((_LEFT + _AXIS, top - height, width, height))
    _draw_map(ax, flight)
    ax.set_xlim(*ends[0])
    ax.set_ylim(*ends[1])
    return page, top - height - 0.06


def _frame(flight: Flight) -> FloatArray:
    """Returns the ends of x and of y [2, 2] (m) of the part of the map that is shown."""
    height_map = flight.flown.problem.height_map
    steps = flight.flown.problem.horizon + 1
    points = np.concatenate([
        flight.flown.at(np.linspace(0.0, flight.flown.seconds, steps)).place[:, :2],
        *(actor.poses[:steps, :2] for actor in flight.flown.problem.actors),
        *(way.points[:, :2] for way in _ways(flight)),
    ])  # fmt: skip
    corner = np.array(height_map.origin)
    size = np.array(height_map.shape) * height_map.resolution
    least, most = (points.min(axis=0), points.max(axis=0))
    margin = np.maximum(_MARGIN, (most - least).max() / 5)
    low, high = corner, corner + size
    return np.column_stack([np.clip(least - margin, low, high), np.clip(most + margin, low, high)])


def _ways(flight: Flight) -> list[Way]:
    """Returns the ways of drones from home and back, if they have homes."""
    problem = flight.flown.problem
    parts = parts_of_take(problem, flight.plan) if has_homes(problem) else ()
    return [way for part in parts for each in part.drones for way in (each.out, each.back)]


def _draw_map(ax: Axes, flight: Flight) -> None:
    """Draws the flights; numbers stand at the starts."""
    flown, problem = flight.flown, flight.flown.problem
    TopView.of(problem).draw_map(ax)
    for mesh in problem.airspace.no_fly:
        for outline in outlines(mesh):
            corners = np.array(outline.exterior.coords)
            ax.fill(*corners.T, fc="none", ec=ZONE, hatch="////", lw=1.2)
    for j, actor in enumerate(problem.actors):
        walk = actor.poses[: problem.horizon + 1, :2]
        ax.plot(*walk.T, color=PERSON, lw=1, ls=":")
        _mark_end(ax, walk[-1], PERSON)
        _mark(ax, walk[0], f"P{j}", PERSON, "white")
    times = np.linspace(0, flown.seconds, 20 * problem.horizon + 1)
    found = flown.at(times)
    marks = flown.at(np.linspace(0, flown.seconds, _MARKS))
    for i in range(len(flown.pieces)):
        colour = DRONE_COLOURS[i % len(DRONE_COLOURS)]
        way, dots = found.place[found.drone == i, :2], marks.place[marks.drone == i, :2]
        ax.plot(*way.T, color=colour, lw=1.6, ls=_DASHES[i % len(_DASHES)])
        ax.plot(*dots.T, color=colour, marker=".", ls="none", ms=5)
        _mark_end(ax, way[-1], colour)
        _mark(ax, way[0], str(i), "white", "black")
    for leg in _ways(flight):
        colour = DRONE_COLOURS[leg.drone % len(DRONE_COLOURS)]
        ax.plot(*leg.points[:, :2].T, color=colour, lw=0.8, alpha=0.7)
    for i, robot in enumerate(problem.robots):
        if robot.home is not None:
            _mark(ax, np.array(problem.height_map.centre(*robot.home)), f"H{i}", "white", "black")
    _draw_north(ax, flight)
    _draw_legend(ax, flight)
    ax.tick_params(labelsize=_SIZE)


def _draw_legend(ax: Axes, flight: Flight) -> None:
    """Draws the marks of the map above it, each with its meaning."""
    problem = flight.flown.problem
    every = flight.flown.seconds / (_MARKS - 1)

    def ring(letter: str, fill: str, words: str) -> Line2D:
        return Line2D([], [], ls="none", marker="o", mfc=fill, mec="black", mew=0.8, ms=9,
                      label=f"{letter}: {words}")  # fmt: skip

    handles: list[Artist] = [
        ring("0, 1, ..", "white", "drone, start"),
        Line2D([], [], color="black", lw=1.6, marker=".", ms=5,
               label=f"flight, a dot every {every:.3g} s"),
    ]  # fmt: skip
    if problem.actors:
        handles += [
            ring("P0, P1, ..", PERSON, "person, start"),
            Line2D([], [], color=PERSON, lw=1, ls=":", label="walk"),
        ]
    handles.append(Line2D([], [], ls="none", marker="s", mfc="none", mec="black", label="end"))
    if problem.airspace.no_fly:
        handles.append(Patch(fc="none", ec=ZONE, hatch="////", lw=1.2, label="no-fly zone"))
    if has_homes(problem):
        handles += [
            ring("H0, H1, ..", "white", "home"),
            Line2D([], [], color="black", lw=0.8, alpha=0.7, label="way from or to home"),
        ]
    ax.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=4,
              fontsize=_SIZE, frameon=False, borderaxespad=0.2)  # fmt: skip


def _mark_end(ax: Axes, at: FloatArray, colour: str) -> None:
    """Draws a square, around the ring where a way ends at its start."""
    ax.plot(*at, marker="s", mfc="none", mec="black", mew=2.4, ms=_SQUARE)
    ax.plot(*at, marker="s", mfc="none", mec=colour, mew=1.4, ms=_SQUARE)


def _mark(ax: Axes, at: FloatArray, words: str, fill: str, ink: str) -> None:
    box = {"boxstyle": "circle,pad=0.25", "fc": fill, "ec": "black", "lw": 0.8}
    x, y = at.tolist()
    ax.text(x, y, words, fontsize=6, ha="center", va="center", color=ink, bbox=box,
            clip_on=True, zorder=9)  # fmt: skip


def _draw_north(ax: Axes, flight: Flight) -> None:
    """Draws an arrow to true north, which the grid's may not be."""
    if flight.geodesy is None:
        return
    x, y = flight.flown.problem.height_map.centre(0, 0)
    up = flight.geodesy.compass(np.array([x]), np.array([y]), np.array([np.pi / 2]))
    way = -np.radians(float(up[0]))
    north = ax.annotate(
        "N", xy=(0.96, 0.94), xytext=(-22 * np.sin(way), -22 * np.cos(way)), fontsize=9,
        xycoords="axes fraction", textcoords="offset points", ha="center", va="center",
        arrowprops={"arrowstyle": "-|>"}, zorder=9,
    )  # fmt: skip
    halo: list[AbstractPathEffect] = [
        withStroke(linewidth=4, foreground="white")
    ]  # houses are dark
    north.set_path_effects(halo)
    if north.arrow_patch is not None:
        north.arrow_patch.set_path_effects(halo)


def _lines(section: Section) -> Iterator[Line]:
    title, lines = section
    yield title, True
    for line in lines:
        yield from ((part, False) for part in textwrap.wrap(
            line, _LETTERS, subsequent_indent="  ", drop_whitespace=False) or [""])  # fmt: skip
    yield "", False


def _paged(sections: list[list[Line]], top: float) -> list[list[Line]]:
    """Returns the lines of each page, the first of which has less room.

    A section that a page can hold is not parted.
    """
    most, whole = (int((edge - _BOTTOM) / _LINE) for edge in (top, _TOP))
    pages: list[list[Line]] = [[]]
    for section in sections:
        room = most - len(pages[-1])
        if room < len(section) <= whole:
            room = most = whole
            pages.append([])
        pages[-1] += section[:room]
        for k in range(room, len(section), whole):
            most = whole
            pages.append(section[k : k + whole])
    return pages


def _write_lines(page: Figure, top: float, lines: list[Line]) -> None:
    for k, (words, is_title) in enumerate(lines):
        _write(page, _LEFT, top - k * _LINE, words, weight="bold" if is_title else "normal")


def _write(
    page: Figure, x: float, y: float, words: str, size: float = _SIZE, weight: str = "normal",
    ha: str = "left", va: str = "baseline",
) -> None:  # fmt: skip
    page.text(x, y, words, size=size, weight=weight, ha=ha, va=va, family="monospace")
