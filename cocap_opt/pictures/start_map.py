"""Maps of where drones may start at step 0, with rejected starts, to help choose starts."""

import math
import textwrap
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.output.heights import over_datum
from cocap_opt.pictures.figures import picture, robot_colour
from cocap_opt.pictures.style import LABEL, SMALL, TITLE
from cocap_opt.problem import Motion, StartArea, State
from cocap_opt.problem.cut_zones import CUT
from cocap_opt.problem.pictures import (
    STARTABLE,
    ZONE,
    TopView,
    distinct_colours,
    people_by_take,
)
from cocap_opt.problem.refusals import startable
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.start_ground import StartGround
from cocap_opt.scenarios import Site

FREE, ABOVE, PEOPLE, CLOSED, BLOCKED = range(5)
COLOURS = STARTABLE, "#a5cdae", "#f8d99b", "#e9b3ba", "#6f747c"
REFUSED = "#b00020"
_WORDS = {
    FREE: "free",
    ABOVE: "free, above something",
    PEOPLE: "too close to people at step 0",
    CLOSED: "no-fly zone or ceiling",
    BLOCKED: "blocked",
}
_MOST_PANELS = 4
_WIDTH, _MOST_DEPTH, _LINE = 10.8, 8.0, 0.21  # inches: the picture, a panel, a line of text
_LEGEND_LINE, _LONG = 0.22, 40  # inches of a line, letters beside three others
_LETTERS = 145  # largest number of letters in a line of text below the picture


class Level(NamedTuple):
    """The cells of a map at a flight height.

    Attributes
    ----------
    height : m
    kinds : [X, Y] FREE, ABOVE, PEOPLE, CLOSED or BLOCKED
    """

    height: float
    kinds: IntArray

    @classmethod
    def of(cls, scene: SceneData, motion: Motion, height: float) -> "Level":
        """Returns the kinds of all cells at a height, for starts of drones with this motion."""
        motion = motion.replace(layers=(height,))
        altitude = scene.height_map.altitudes((height,))
        low, high = altitude - motion.clearance, altitude + motion.clearance
        stands_out = scene.height_map.stands_out
        covered = stands_out | np.isfinite(scene.workspace.columns.low[1:]).any(axis=0)
        kinds = np.where(covered, ABOVE, FREE)
        kinds[~startable(scene, motion, 0)] = PEOPLE
        kinds[scene.workspace.forbidden.solid(altitude, altitude)[0]] = CLOSED
        kinds[scene.workspace.columns.solid(low, high)[0]] = BLOCKED
        return cls(height, kinds)


def levels(site: Site, heights: Sequence[float] = ()) -> list[Level]:
    """Returns the cells at each flight height of a site's drones, lowest first.

    If drones have different clearances, the largest counts.

    Parameters
    ----------
    heights : m, flight heights to use instead of the drones'
    """
    widest = max(site.motions, key=lambda motion: motion.clearance)
    named = heights or sorted({height for motion in site.motions for height in motion.layers})
    return [Level.of(site.scene, widest, height) for height in named]


def start_picture(site: Site, suffix: str, heights: Sequence[float] = ()) -> bytes:
    """Returns a file that shows where drones may start, from above, at up to four heights.

    Parameters
    ----------
    suffix : one of `cocap_opt.pictures.figures.PICTURES`
    heights : m (default: those at which drones start, or else the lowest of the drones)
    """
    flown = _heights_of_starts(site)
    shown = [
        level for level in levels(site, heights) if heights or not flown or level.height in flown
    ]
    return picture(_figure(site, shown[: _MOST_PANELS if flown or heights else 1]), suffix)


def _heights_of_starts(site: Site) -> set[float]:
    """Returns the heights (m) of all starts that are stated one by one."""
    return {
        robot.motion.layers[robot.start.layer]
        for robot in site.scene.robots
        if isinstance(robot.start, State)
    }


def _figure(site: Site, shown: Sequence[Level]) -> Figure:
    """Draws panels side by side, and below them the legend and the rejected starts."""
    columns = min(len(shown), 2)
    rows = math.ceil(len(shown) / columns)
    width, depth = site.scene.height_map.shape
    panel = min((_WIDTH - 0.9) / columns * depth / width, _MOST_DEPTH / rows) + 0.75
    lines = [
        line
        for words in site.words
        for line in textwrap.wrap(words, _LETTERS, subsequent_indent="    ")
    ]
    below = 0.55 + _LINE * len(lines)
    handles = _handles(site, shown)
    beside = 4 if max(map(len, handles)) <= _LONG else 2
    legend = _LEGEND_LINE * max(math.ceil(len(handles) / beside), 2)
    whole = 0.1 + rows * panel + below + legend
    figure = Figure(figsize=(_WIDTH, whole), dpi=130)
    grid = figure.add_gridspec(
        rows, columns, left=0.07, right=0.98, top=1 - 0.75 / whole,
        bottom=(below + 0.05 + legend) / whole, hspace=0.75 / panel * 1.2, wspace=0.16,
    )  # fmt: skip
    for number, level in enumerate(shown):
        ax = figure.add_subplot(grid[divmod(number, columns)])
        draw_level(ax, site, level)
    title = f"{site.scene.name}: where drones may start"
    figure.text(0.07, 1 - 0.32 / whole, title, fontsize=TITLE + 2, weight="bold")
    figure.legend(
        list(handles.values()), list(handles), loc="lower left", ncols=beside, fontsize=SMALL,
        frameon=False, bbox_to_anchor=(0.06, (below - 0.42) / whole), columnspacing=1.6,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.3)},
    )  # fmt: skip
    for number, line in enumerate(lines):
        at = (below - 0.6 - _LINE * number) / whole
        figure.text(0.07, at, line, fontsize=SMALL, color=REFUSED, va="center")
    return figure


def draw_level(ax: Axes, site: Site, level: Level) -> Axes:
    """Draws the cells at a height, people's walks, and the starts of the drones there."""
    scene = site.scene
    view = TopView.of_map(scene, level.kinds, level.height)
    view.draw_map(ax, COLOURS)
    view.draw_walks(ax)
    view.draw_cuts(ax)
    for found in site.refusals:
        if scene.robots[found.robot].motion.layers[found.state.layer] == level.height:
            _draw_refused(ax, site, found.state, found.nearest, found.robot)
    refused = {found.robot for found in site.refusals}
    for area in _stated_areas(scene):
        view.draw_area(ax, area)
    for number, robot in enumerate(scene.robots):
        if number not in refused and not isinstance(robot.start, StartArea):
            for state in scene.starts[number]:
                if robot.motion.layers[state.layer] == level.height:
                    yaw = math.tau * state.heading / robot.motion.headings
                    _draw_start(ax, _middle(scene, state), yaw, number, view.cell)
    ax.grid(color="white", lw=0.7, alpha=0.7)
    ax.tick_params(labelsize=SMALL)
    ax.set_title(f"at {level.height:g} m {over_datum(scene)}", fontsize=LABEL, loc="left")
    return ax


def _middle(scene: SceneData, state: State) -> FloatArray:
    return np.array(scene.height_map.centre(state.x, state.y))


def _draw_start(ax: Axes, at: FloatArray, yaw: float, number: int, cell: float) -> None:
    colour = robot_colour(number)
    tip = at + 1.4 * cell * np.array([math.cos(yaw), math.sin(yaw)])
    ax.plot(*np.stack([at, tip]).T, color=colour, lw=2, zorder=5, solid_capstyle="round")
    ax.plot(*at, marker="o", mfc="white", mec=colour, mew=1.8, ms=12, zorder=6)
    _number(ax, at, number, "black")


def _draw_refused(ax: Axes, site: Site, state: State, nearest: State | None, number: int) -> None:
    at = _middle(site.scene, state)
    halo = [withStroke(linewidth=5, foreground="white")]
    if nearest is not None:
        to = _middle(site.scene, nearest)
        ax.annotate(
            "", xy=(to[0], to[1]), xytext=(at[0], at[1]), zorder=6, annotation_clip=False,
            arrowprops={
                "arrowstyle": "-|>", "lw": 1.2, "color": REFUSED, "shrinkA": 6, "shrinkB": 6,
            },
        )  # fmt: skip
        ax.plot(*to, marker="o", mfc="white", mec=REFUSED, mew=1.4, ms=12, ls="none", zorder=7)
        _number(ax, to, number, REFUSED)
    ax.plot(*at, marker="x", color=REFUSED, ms=10, mew=2.6, zorder=8, path_effects=halo, ls="none")


def _stated_areas(scene: SceneData) -> list[StartGround]:
    """Returns the areas in which drones may choose their start, except those of a whole map."""
    found: dict[StartArea, list[int]] = {}
    for number, robot in enumerate(scene.robots):
        if isinstance(robot.start, StartArea) and robot.start.cells is not None:
            found.setdefault(robot.start, []).append(number)
    areas = []
    for area, drones in found.items():
        inside = np.zeros(scene.height_map.shape, dtype=np.bool_)
        inside[tuple(np.array(area.cells).T)] = True
        areas.append(StartGround(tuple(drones), inside))
    return areas


def _number(ax: Axes, at: FloatArray, number: int, colour: str) -> None:
    x, y = at.tolist()
    ax.text(
        x, y, str(number), color=colour, fontsize=7, weight="bold", ha="center",
        va="center_baseline", zorder=9, clip_on=True,
    )  # fmt: skip


def _handles(site: Site, shown: Sequence[Level]) -> dict[str, Any]:
    """Returns the entries of the legend for everything that is drawn: words and their marks."""

    def mark(marker: str, colour: str, fill: str | None = None) -> Line2D:
        return Line2D([], [], marker=marker, ls="none", color=colour, mfc=fill or colour, mew=1.8,
                      ms=8)  # fmt: skip

    scene, refused = site.scene, {found.robot for found in site.refusals}
    there = {kind for level in shown for kind in np.unique(level.kinds).tolist()}
    handles: dict[str, Any] = {
        words: (Patch(color=COLOURS[kind]),) for kind, words in _WORDS.items() if kind in there
    }
    if any(TopView.of_map(scene, level.kinds, level.height).is_cut for level in shown):
        handles[CUT] = (mark(">", ZONE),)
    if scene.actors:
        for words, colour in people_by_take([take.name for take in scene.takes]).items():
            handles[words] = (mark("o", colour),)
    stated = [
        number for number, robot in enumerate(scene.robots)
        if number not in refused and not isinstance(robot.start, StartArea)
    ]  # fmt: skip
    if stated:
        rings = tuple(mark("o", colour, "white") for colour in distinct_colours(stated))
        handles["starts, with the way they look"] = rings
    for area in _stated_areas(scene):
        handles[area.words] = tuple(
            Patch(facecolor="none", edgecolor=colour, ls="--", lw=1.4)
            for colour in distinct_colours(area.drones)
        )
    if refused:
        handles["rejected, with the nearest free place"] = (mark("x", REFUSED),)
    return handles
