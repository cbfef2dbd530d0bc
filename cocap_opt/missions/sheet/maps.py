"""The maps of a sheet: positions in a phase, with marks that are distinct in grey prints."""

import math
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import AbstractPathEffect, withStroke

from cocap_opt.data import FloatArray
from cocap_opt.flight.flights import Flight
from cocap_opt.missions.sheet.clock import BACK, OUT, TAKE, Phase
from cocap_opt.missions.sheet.kinds import FREE, KINDS, draw_kinds
from cocap_opt.missions.zones import outlines
from cocap_opt.problem.cut_zones import draw_cuts
from cocap_opt.problem.labels import placed
from cocap_opt.problem.pictures import ZONE, TopView, drone_colour, land_colour

_MARGIN = 6.0  # m of margin around flights and walks
_DASHES = "-", "--", "-.", (0, (1, 1)), (0, (5, 1, 1, 1, 1, 1))

_INK, _PERSON = "#000000", "#7a1020"
_HATCH = "xxx"  # hatch of no-fly zones
LAND = 0.3  # strength of land colours, paler than everything else
_DOTS = 4  # dots along a flight in a phase, besides its ends
_LETTER = 6.5  # points, size of labels and numbers
_MOVES = 0.1  # m; shorter moves count as none
_MM = 25.4
_NICE = 1, 2, 5  # lengths of scale bars, times a power of ten


class _Label(NamedTuple):
    """A number at a place of the map.

    Attributes
    ----------
    at : position, m
    style : style of its box, for matplotlib
    """

    words: str
    at: FloatArray
    style: str
    fill: str
    ink: str


def ground_of(flight: Flight) -> TopView:
    """Returns the ground below all maps, without no-fly zones, which are hatched separately."""
    problem = flight.flown.problem
    return TopView.of(problem.replace(airspace=problem.airspace.replace(no_fly=())))


def draw(ax: Axes, flight: Flight, phase: Phase, ground: TopView) -> None:
    """Draws a phase in axes with a final size.

    Numbers in circles show drones at its start, numbers in squares at its end; a hovering drone has
    only a circle.
    """
    problem = flight.flown.problem
    ground.draw_map(ax, [FREE, *(kind.fill for kind in KINDS.values())], LAND)
    size = _millimetres(ax)
    (left, right), (low, high) = ends = _frame(flight, phase, size[0] / size[1])
    ax.set_xlim(left, right)
    ax.set_ylim(low, high)
    _draw_end_of_map(ax, flight)
    draw_kinds(ax, ground, ends)
    for mesh in problem.airspace.no_fly:
        for outline in outlines(mesh):
            corners = np.array(outline.exterior.coords)
            ax.fill(*corners.T, fc="white", ec=ZONE, hatch=_HATCH, lw=1.6, zorder=2)
    draw_cuts(ax, [mesh.corners for mesh in problem.airspace.no_fly], ZONE)
    walks = _draw_walks(ax, flight, phase) if phase.kind == TAKE else []
    lines, labels = _draw_flights(ax, flight, phase)
    people = [label for label, _ in walks]
    _draw_labels(ax, [*labels, *people], [*lines, *(walk for _, walk in walks)], ends, size)
    _draw_scale(ax, ends, size)
    _draw_north(ax, flight, size)
    ax.tick_params(labelsize=_LETTER, length=2, pad=1.5)
    for axis in (ax.xaxis, ax.yaxis):
        axis.label.set_fontsize(_LETTER)
        axis.labelpad = 2


def draw_legend(ax: Axes, flight: Flight, has_homes: bool, ground: TopView) -> None:
    """Draws the legend of all maps."""
    problem = flight.flown.problem

    def mark(shape: str, fill: str, words: str) -> Line2D:
        return Line2D([], [], ls="none", marker=shape, mfc=fill, mec=_INK, mew=0.8, ms=8,
                      label=words)  # fmt: skip

    handles: list[Line2D | Patch] = [
        mark("o", "white", "number in a circle: drone, at the start"),
        mark("s", "white", "number in a square: drone, at the end"),
        Line2D([], [], color=_INK, lw=1.6, marker=".", ms=6, label="flight, dots at equal times"),
    ]
    if problem.actors:
        handles += [
            mark("o", _PERSON, "P and a number: person, at the start"),
            Line2D([], [], color=_PERSON, lw=2.2, ls=":", marker="d", ms=4, label="walk"),
        ]
    if has_homes:
        handles.append(mark("h", "#d8d8d8", "H and a number: home of that drone"))
    if problem.airspace.no_fly:
        handles.append(
            Patch(
                fc="white", ec=ZONE, hatch=_HATCH, lw=1.2, label="no-fly zone (arrows: it goes on)"
            )
        )
    handles += [kind.patch for number, kind in KINDS.items() if (ground.kinds == number).any()]
    words = [str(handle.get_label()) for handle in handles]
    marks: list[Line2D | Patch | tuple[Patch, ...]] = [*handles]
    if ground.land:
        colours = dict.fromkeys(land_colour(area.kind, LAND) for area in ground.land)
        marks.append(tuple(Patch(fc=colour, ec="#999999", lw=0.3) for colour in [*colours][:4]))
        words.append("ground, in pale colours")
    ax.axis("off")
    ax.legend(marks, words, loc="upper left", ncols=3, fontsize=_LETTER, frameon=False,
              borderaxespad=0.0, borderpad=0.0, columnspacing=1.6,
              handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)})  # fmt: skip


def _millimetres(ax: Axes) -> FloatArray:
    """Returns the width and height of axes on paper."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    box = ax.get_position(original=True)
    return np.asarray(figure.get_size_inches() * [box.width, box.height] * _MM)


def _frame(flight: Flight, phase: Phase, aspect: float) -> FloatArray:
    """Returns the limits of x and of y [2, 2] (m) of the drawn part, with the given aspect ratio.

    The part is shifted into the map if it fits.
    """
    problem = flight.flown.problem
    points = [way.points[:, :2] for way in phase.ways]
    if phase.kind == TAKE:
        points.append(flight.flown.at(_times(flight, phase, phase.last - phase.first)).place[:, :2])
        points += [actor.poses[phase.first : phase.last + 1, :2] for actor in problem.actors]
    least, most = (end(np.concatenate(points), axis=0) for end in (np.min, np.max))
    middle, size = (least + most) / 2, most - least
    size = size + 2 * np.maximum(_MARGIN, size.max() / 10)
    size = np.maximum(size, size[::-1] * np.array([aspect, 1 / aspect]))
    corner = np.array(problem.height_map.origin)
    map_size = np.array(problem.height_map.shape) * problem.height_map.resolution
    half = size / 2
    lowest, highest = corner + half, corner + map_size - half
    middle = np.where(lowest <= highest, np.clip(middle, lowest, highest), corner + map_size / 2)
    return np.column_stack([middle - half, middle + half])


def _times(flight: Flight, phase: Phase, parts: int) -> FloatArray:
    """Returns moments (s) from the start of a phase to its end, in equal parts."""
    step = flight.flown.step
    return np.linspace(phase.first * step, phase.last * step, max(parts, 1) + 1)


def _draw_end_of_map(ax: Axes, flight: Flight) -> None:
    """Draws the edge of the map."""
    height_map = flight.flown.problem.height_map
    width, depth = np.array(height_map.shape) * height_map.resolution
    ax.set_facecolor("#f3f3f3")
    ax.add_patch(Rectangle(height_map.origin, width, depth, fc="none", ec="#777777", lw=0.8))


def _draw_walks(ax: Axes, flight: Flight, phase: Phase) -> list[tuple[_Label, FloatArray]]:
    """Draws the walks of people, and returns their labels and lines."""
    problem, found = flight.flown.problem, []
    steps = _times(flight, phase, _DOTS + 1) / flight.flown.step
    for j, actor in enumerate(problem.actors):
        walk = actor.poses[phase.first : phase.last + 1, :2]
        ax.plot(*walk.T, color=_PERSON, lw=2.0, ls=":", zorder=3)
        at = [np.interp(steps, range(len(actor.poses)), axis) for axis in actor.poses[:, :2].T]
        ax.plot(*at, color=_PERSON, marker="d", ms=3, ls="none", zorder=3)
        _draw_arrow(ax, walk, _PERSON)
        found.append((_Label(f"P{j}", walk[0], "circle,pad=0.2", _PERSON, "white"), walk))
    return found


def _draw_flights(ax: Axes, flight: Flight, phase: Phase) -> tuple[list[FloatArray], list[_Label]]:
    """Draws the flights of a phase; returns them as lines [n, 2], and the labels at their ends."""
    problem = flight.flown.problem
    lines, labels = list[FloatArray](), list[_Label]()
    fine = flight.flown.at(_times(flight, phase, 10 * (phase.last - phase.first)))
    dots = flight.flown.at(_times(flight, phase, _DOTS + 1))
    for i in range(len(problem.robots)):
        if phase.kind == TAKE:
            line, marks = fine.place[fine.drone == i, :2], dots.place[dots.drone == i, :2]
        else:
            line = marks = phase.ways[i].points[:, :2]
        colour = drone_colour(i)
        ax.plot(*line.T, color=colour, lw=1.5, ls=_DASHES[i % len(_DASHES)], zorder=4)
        ax.plot(*marks.T, color=colour, marker=".", ls="none", ms=4, zorder=4)
        lines.append(line)
        _draw_arrow(ax, line, colour)
        begins = _Label(str(i), line[0], "circle,pad=0.2", "white", _INK)
        ends = _Label(str(i), line[-1], "square,pad=0.25", "white", _INK)
        if phase.kind == OUT:
            begins = _Label(f"H{i}", line[0], "round4,pad=0.2", "#d8d8d8", _INK)
        elif phase.kind == BACK:
            ends = _Label(f"H{i}", line[-1], "round4,pad=0.2", "#d8d8d8", _INK)
        moves = float(np.ptp(line, axis=0).max()) > _MOVES
        labels += [begins, ends] if moves else [begins]
    return lines, labels


def _draw_arrow(ax: Axes, line: FloatArray, colour: str) -> None:
    """Draws the head of an arrow at the end of a line, along its last move, if there is one."""
    ways = line[-1] - line
    far = np.flatnonzero(np.hypot(*ways.T) > _MOVES)
    if len(far):
        x, y = ways[far[-1]]
        turned = math.degrees(math.atan2(y, x)) - 90
        ax.plot(*line[-1], marker=(3, 0, turned), color=colour, mec=_INK, mew=0.4, ms=7, zorder=5)


def _draw_labels(
    ax: Axes, labels: list[_Label], lines: list[FloatArray], ends: FloatArray, size: FloatArray
) -> None:
    """Draws labels beside their points, each with a line to its point."""
    scale = size / (ends[:, 1] - ends[:, 0])  # mm per metre
    points = np.array([(label.at - ends[:, 0]) * scale for label in labels]).reshape(-1, 2)
    high = _LETTER * _MM / 72
    wide = [max(0.65 * high * len(label.words), high) for label in labels]
    sizes = np.array([(w + 1.6, high + 1.6) for w in wide]).reshape(-1, 2)
    sizes[:, 1] = np.where([label.style.startswith("round") for label in labels], sizes[:, 1],
                           sizes.max(axis=1))  # fmt: skip
    sizes[:, 0] = np.maximum(sizes[:, 0], sizes[:, 1])
    shown = (np.concatenate(lines) - ends[:, 0]) * scale
    north = (size - [6.0, 9.0], [11.0, 17.0])
    bar = ([20.0, 5.0], [40.0, 10.0])
    room = float(size[0]), float(size[1])
    middles = placed(points, sizes, room, shown, np.array([north, bar]))
    for label, middle in zip(labels, middles, strict=True):
        at = middle / scale + ends[:, 0]
        ax.plot(*np.array([label.at, at]).T, color="#444444", lw=0.5, zorder=8)
        ax.text(
            at[0], at[1], label.words, fontsize=_LETTER, ha="center", va="center", color=label.ink,
            bbox={"boxstyle": label.style, "fc": label.fill, "ec": _INK, "lw": 0.7}, zorder=9,
            clip_on=True,
        )  # fmt: skip


def _draw_scale(ax: Axes, ends: FloatArray, size: FloatArray) -> None:
    """Draws a scale bar of a round length, about a sixth of the width, in a corner."""
    metres = float(ends[0, 1] - ends[0, 0])
    power = 10.0 ** math.floor(math.log10(metres / 6))
    length = max(n * power for n in _NICE if n * power <= metres / 6)
    mm = float(size[0]) / metres
    left, low = float(ends[0, 0]) + 4 / mm, float(ends[1, 0]) + 4 / mm
    box = Rectangle((left - 2 / mm, low - 2.5 / mm), length + 10 / mm, 8 / mm, fc="white",
                    ec="none", alpha=0.85, zorder=7)  # fmt: skip
    ax.add_patch(box)
    for k, fill in enumerate((_INK, "white")):
        ax.add_patch(Rectangle((left + k * length / 2, low), length / 2, 1.3 / mm, fc=fill,
                               ec=_INK, lw=0.7, zorder=8))  # fmt: skip
    for k, words in enumerate(("0", f"{length / 2:g}", f"{length:g} m")):
        ax.text(left + k * length / 2, low + 1.9 / mm, words, fontsize=_LETTER, ha="center",
                va="bottom", zorder=8)  # fmt: skip


def _draw_north(ax: Axes, flight: Flight, size: FloatArray) -> None:
    """Draws an arrow to true north, which may differ from grid north; or to +y, if true north is
    unknown.
    """
    way, words = 0.0, "y"
    if flight.geodesy is not None:
        x, y = flight.flown.problem.height_map.centre(0, 0)
        up = flight.geodesy.compass(np.array([x]), np.array([y]), np.array([np.pi / 2]))
        way, words = -math.radians(float(up[0])), "N"
    foot = 1 - 6.0 / size[0], 1 - 13.0 / size[1]
    points = 8.0 * 72 / _MM
    halo: list[AbstractPathEffect] = [withStroke(linewidth=3, foreground="white")]
    arrow = ax.annotate(
        words, xy=foot, xytext=(points * math.sin(way), points * math.cos(way)),
        xycoords="axes fraction", textcoords="offset points", fontsize=9, weight="bold",
        ha="center", va="center", arrowprops={"arrowstyle": "<|-", "fc": _INK, "lw": 1.2},
        zorder=9,
    )  # fmt: skip
    arrow.set_path_effects(halo)
