"""Top views of scenes and flights, drawn by matplotlib, which is imported only for drawing."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, overload

import numpy as np

from cocap_opt.arithmetic import cosines, sines
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem.cut_zones import CUT, cuts, draw_cuts
from cocap_opt.problem.land_cover import Land, LandCover
from cocap_opt.problem.map_frame import MapFrame
from cocap_opt.problem.motion import State
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.start_ground import StartGround

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    _Marks = tuple[Line2D | Patch, ...]

    class WholeAxes(Axes):
        """Axes in a whole figure, which can be saved, rather than in a subfigure.

        It exists for type checkers only: matplotlib's types do not distinguish the two.
        """

        @property
        def figure(self) -> Figure:
            """The figure."""


GROUND, COVERED, WALL, LOW, CLOSED = "#f4f1ea", "#d9cfb8", "#a0a6ae", "#d0b79b", "#d0021b40"
ZONE = "#a00000"  # colour of outlines of no-fly zones, and of arrows where a picture cuts one
HIDDEN = "no-fly zone, over obstacles"  # legend of outlines alone
PERSON = "#d1495b"
# Colours of land, as on maps; drones, people and obstacles stand out from all of them.
LAND_COLOURS: Mapping[Land, str] = {
    "water": "#b5d3e8", "green": "#cfe0b4", "street": "#d3d2d0", "footway": "#e8e5df",
    "paved": "#dfd8cb", "yard": "#eee6c8", "building": "#d9c3b0", "other": "#d8d3c8",
}  # fmt: skip
NAME = "#4f5a66"  # colour of names written on the land
# Colours of drones, independent of matplotlib's style; red is reserved for people.
DRONE_COLOURS = (
    "#1f77b4", "#2ca02c", "#ff7f0e", "#9467bd", "#17becf", "#8c564b", "#bcbd22", "#e377c2",
    "#7f7f7f",
)  # fmt: skip
# Colours of people, one per take; the first is used if there are no takes.
TAKE_COLOURS = PERSON, "#7b3fa0", "#b35900", "#c2378f", "#5b4bbd", "#8f6a00"
# Colour of the ground above which drones may start.
STARTABLE = "#d3ead6"
TICK = 0.9  # cells; length of the line that shows a heading


_MOST_TAKES = len(TAKE_COLOURS)  # takes in a legend
_MOST_AREAS = 6  # start areas in a legend
_MOST_NAMES = 6  # people whose names are in the legend
_DASH, _SMALL, _DISC = 3.0, 9.0, 11.0  # points: dashes, letters, marks of drones and people
# inches: width of a picture, height of a legend's line; letters of a long line
_WIDTH, _LINE, _LONG = 5.2, 0.2, 26
_DPI, _FINE = 100, 2  # resolution of a picture, and factor for sharp screens


def take_colour(take: int) -> str:
    """Returns the colour of the people of a take, by its number."""
    return TAKE_COLOURS[take % len(TAKE_COLOURS)]


def people_by_take(takes: Sequence[str]) -> dict[str, str]:
    """Returns the legend's lines for the walks of people, and the colour of each.

    Parameters
    ----------
    takes : names of the takes; empty if the scene has none
    """
    words = "people, last step (cross: step 0)"
    named = [f"{words}, {name}" for name in takes[:_MOST_TAKES]] or [words]
    return {label: take_colour(k) for k, label in enumerate(named)}


def land_colour(kind: Land, strength: float = 1.0) -> str:
    """Returns the colour of a kind of land, mixed with white; with a strength of 0 it is white."""
    parts = (int(LAND_COLOURS[kind][k : k + 2], 16) for k in (1, 3, 5))
    return "#" + "".join(f"{round(255 - strength * (255 - part)):02x}" for part in parts)


def drone_colour(number: int) -> str:
    """Returns the colour of a drone, given its number."""
    return DRONE_COLOURS[number % len(DRONE_COLOURS)]


def shared_digits(corner: float) -> float:
    """Returns the offset (m) that is subtracted from coordinates and shown once; 0 for small
    coordinates.

    Map coordinates have seven digits, and those of a scene share the first ones.

    Parameters
    ----------
    corner : smallest coordinate, m
    """
    return corner // 1000 * 1000 if abs(corner) >= 10_000 else 0.0


def distinct_colours(drones: Iterable[int]) -> list[str]:
    """Returns the distinct colours of drones."""
    return list(dict.fromkeys(map(drone_colour, drones)))


class HasPaths(Protocol):
    """A plan as pictures need it; `Plan` satisfies it."""

    @property
    def paths(self) -> Sequence[Sequence[State]]:
        """One path of states per robot."""


class TopView(NamedTuple):
    """A scene from above, and the flights over it, if any."""

    # [X, Y] 0 ground, 1 an obstacle that does not block this height, 2 blocks, 3 lower, 4 closed
    # airspace
    kinds: IntArray
    corner: tuple[float, float]  # m, of cell (0, 0)
    cell: float  # m, edge of a cell
    height: float  # m, flight height for which blocked cells are shown
    walks: Sequence[FloatArray]  # per person [T+1, 2] m
    take_of: Sequence[int]  # per person
    takes: Sequence[str]  # names; empty if there are no takes
    # By number of a drone: x, y (m) and yaw (rad) [T+1, 3]; or only its start [1, 3], if fixed.
    flights: Mapping[int, FloatArray]
    areas: Sequence[StartGround]  # ground above which the other drones may start
    frame: MapFrame  # the part that is drawn
    land: Sequence[LandCover] = ()  # shown where there is no obstacle
    zones: Sequence[FloatArray] = ()  # triangles [n, 3, 3] (m) of no-fly zones at the height
    names: Sequence[str | None] = ()  # of people

    @classmethod
    def of(cls, scene: SceneData, plan: HasPaths | None = None) -> TopView:
        """Returns the scene from above, with the flights of a plan or the drones' starts.

        Drones that may start in several states are represented by their area instead of a start.
        """
        lowest = scene.layers[0]
        clearance = max(
            robot.motion.clearance for robot in scene.robots if robot.motion.layers[0] == lowest
        )
        altitude = scene.height_map.altitudes((lowest,))
        columns = scene.workspace.columns
        blocked = columns.solid(altitude - clearance, altitude + clearance)[0]
        closed = scene.workspace.forbidden.solid(altitude, altitude)[0]
        covered = np.isfinite(columns.low[1:]).any(axis=0)
        kinds = np.where(scene.height_map.stands_out, 3, 0)
        kinds[covered] = 1
        kinds[closed] = 4
        kinds[blocked] = 2
        if plan is None:
            placed = (i for i in range(len(scene.robots)) if i not in scene.open_starts)
            paths: dict[int, Sequence[State]] = {i: scene.starts[i] for i in placed}
        else:
            paths = dict(enumerate(plan.paths))
        flights = {i: _flight(scene, i, path) for i, path in paths.items()}
        areas = StartGround.all_of(scene) if plan is None else []
        view = cls.of_map(scene, kinds, lowest)
        view = view._replace(flights=flights, areas=areas, land=scene.land_cover)
        return view._replace(frame=MapFrame.around(scene.height_map, view._places()))

    @classmethod
    def of_map(cls, scene: SceneData, kinds: IntArray, height: float) -> TopView:
        """Returns the scene from above with other kinds of cells, and without drones."""
        altitudes = scene.height_map.altitudes((height,))
        zones = [
            mesh.corners
            for mesh in scene.airspace.no_fly
            if mesh.vertices[:, 2].min() <= altitudes.max()
            and mesh.vertices[:, 2].max() >= altitudes.min()
        ]
        return cls(
            kinds=kinds,
            corner=scene.height_map.origin,
            cell=scene.height_map.resolution,
            height=height,
            walks=[actor.poses[: scene.horizon + 1, :2] for actor in scene.actors],
            take_of=scene.take_of.tolist(),
            takes=[take.name for take in scene.takes],
            flights={},
            areas=[],
            frame=MapFrame.around(scene.height_map, ()),
            zones=zones,
            names=[actor.name for actor in scene.actors],
        )

    @overload
    def draw(self, ax: None = None) -> WholeAxes: ...

    @overload
    def draw(self, ax: Axes | None) -> Axes: ...

    def draw(self, ax: Axes | None = None) -> Axes:
        """Draw the map, the walks of people from a cross to a disc, and the drones' flights.

        A ring marks the start of each drone; the line at each of its places shows its heading. In a
        new figure the legend is below the map. Several axes in one figure share one legend below
        all of them, and the axis labels; single axes passed by the caller have the legend on the
        map.
        """
        handles, figure = self._handles(), None
        if ax is None:
            from matplotlib.figure import Figure

            width, depth = self.frame.size
            size = min(max(0.84 * _WIDTH * depth / width, 1.2), 9.0)  # inches, height of the map
            below = 0.6 + _LINE * math.ceil(len(handles) / _columns(handles)) + 0.1
            whole = size + below + 0.3
            figure = Figure(figsize=(_WIDTH, whole), dpi=_DPI)
            figure.set_layout_engine("none")  # regardless of the style in use
            ax = figure.add_axes((0.12, below / whole, 0.84, size / whole))
        if not hasattr(ax, "imshow"):
            raise TypeError(f"ax: must be axes of matplotlib, not {ax!r}")
        self.draw_map(ax)
        self.draw_walks(ax)
        for area in self.areas:
            self.draw_area(ax, area, is_filled=True)
        for number, flight in self.flights.items():
            _draw_flight(ax, flight, drone_colour(number), number, self.cell)
        (left, low), (right, high) = self.frame.low, self.frame.high
        ax.set_xlim(left, right)
        ax.set_ylim(low, high)
        self.draw_cuts(ax)
        _draw_legend(ax, handles, figure)
        return ax

    def draw_cuts(self, ax: Axes) -> None:
        """Draw arrows where the frame of axes cuts a no-fly zone."""
        draw_cuts(ax, self.zones, ZONE)

    @property
    def is_cut(self) -> bool:
        """True if the frame cuts a no-fly zone, so that there are arrows."""
        return bool(cuts(self.zones, self.frame.low, self.frame.high))

    def _places(self) -> Iterator[tuple[float, float]]:
        """Yields the positions (m) at which something happens."""
        for way in (*self.walks, *(flight[:, :2] for flight in self.flights.values())):
            yield from map(tuple, way.tolist())
        for area in self.areas:
            cells = np.argwhere(area.cells)
            corners = [*cells, *(cells + 1)]
            yield from map(tuple, (self.corner + self.cell * np.array(corners)).tolist())

    def draw_area(self, ax: Axes, area: StartGround, is_filled: bool = False) -> None:
        """Draw the ground of an area, with an outline dashed in the colours of its drones."""
        from matplotlib.colors import ListedColormap

        (x, y), (width, depth) = self.corner, self.kinds.shape
        if is_filled:
            ax.imshow(
                np.ma.masked_equal(area.cells.T, 0), origin="lower", alpha=0.7, zorder=1,
                extent=(x, x + width * self.cell, y, y + depth * self.cell),
                interpolation="nearest", cmap=ListedColormap([STARTABLE]),
            )  # fmt: skip
        framed = np.pad(area.cells.astype(float), 1).repeat(4, axis=0).repeat(4, axis=1)
        at = [
            corner + self.cell * (np.arange(4 * (size + 2)) + 0.5 - 4) / 4
            for corner, size in zip(self.corner, self.kinds.shape, strict=True)
        ]
        colours = distinct_colours(area.drones)
        gap = _DASH * (2 * len(colours) - 1)
        for k, colour in enumerate(colours):
            ax.contour(
                *at, framed.T, levels=[0.5], colors=[colour], linewidths=1.4, zorder=2,
                linestyles=[(-2 * k * _DASH, (_DASH, gap))],
            )  # fmt: skip

    def draw_walks(self, ax: Axes) -> None:
        """Draw the walks of people from a cross to a disc and a number, in the colours of takes."""
        from cocap_opt.problem.apart_numbers import ApartNumbers

        colours = [take_colour(take) for take in self.take_of]
        for walk, colour in zip(self.walks, colours, strict=True):
            ax.plot(*walk.T, color=colour, lw=1, ls=":", zorder=3)
            ax.plot(*walk[0], marker="x", color=colour, ms=6, zorder=3)
            ax.plot(*walk[-1], marker="o", color=colour, mec="black", mew=0.6, ms=6, zorder=7)
        if self.walks:
            last = np.array([walk[-1] for walk in self.walks])
            drones = np.array([flight[-1, :2] for flight in self.flights.values()])
            numbers = ApartNumbers(last, colours, _SMALL, drones, _DISC)
            numbers.set_zorder(9)
            ax.add_artist(numbers)

    def draw_map(
        self, ax: Axes, colours: Sequence[str] = (GROUND, COVERED, WALL, LOW, CLOSED),
        strength: float = 1.0,
    ) -> None:  # fmt: skip
        """Draw the cells of a scene, in axes of world coordinates.

        Parameters
        ----------
        colours : colours of the kinds of cells
        strength : strength of the colours of the land; 0 is white
        """
        from matplotlib.colors import ListedColormap
        from matplotlib.ticker import FuncFormatter, MaxNLocator

        (x, y), (width, depth) = self.corner, self.kinds.shape
        extent = (x, x + width * self.cell, y, y + depth * self.cell)
        shown = np.ma.masked_equal(self.kinds, 0) if self.land else self.kinds
        self._draw_land(ax, strength)
        ax.imshow(
            shown.T, origin="lower", extent=extent, vmin=0, vmax=len(colours) - 1,
            interpolation="nearest", cmap=ListedColormap(list(colours)), zorder=0,
        )  # fmt: skip
        ax.set_aspect("equal")
        ax.grid(visible=False)
        ax.set_xlim(*extent[:2])  # later drawing must not move the frame
        ax.set_ylim(*extent[2:])
        for outline in self._zone_outlines():  # zones over obstacles have no cells of their own
            ax.plot(*outline.T, color=ZONE, lw=1.0, zorder=1)
        for axis, name, corner in ((ax.xaxis, "x", x), (ax.yaxis, "y", y)):
            axis.set_major_locator(MaxNLocator(6))
            shared = shared_digits(corner)
            axis.set_major_formatter(FuncFormatter(lambda at, _, less=shared: f"{at - less:g}"))
            axis.set_label_text(f"{name} - {shared:,.0f} (m)" if shared else f"{name} (m)")

    def _zone_outlines(self) -> Iterator[FloatArray]:
        """Yields the outlines [n, 2] (m) of the no-fly zones at this height, from above."""
        import shapely

        triangles = [shapely.polygons(corners[:, :, :2]) for corners in self.zones]
        whole = shapely.union_all([shapely.union_all(sides) for sides in triangles])
        for part in shapely.get_parts(whole):
            if part.geom_type == "Polygon":
                for ring in (part.exterior, *part.interiors):
                    yield shapely.get_coordinates(ring)

    def _draw_land(self, ax: Axes, strength: float) -> None:
        """Draw the areas of the land, the first at the bottom, and all names that fit
        completely.
        """
        from matplotlib.patches import PathPatch, Rectangle
        from matplotlib.path import Path
        from matplotlib.patheffects import withStroke

        from cocap_opt.problem.whole_names import WholeName

        if self.land:
            (x, y), (width, depth) = self.corner, self.kinds.shape
            whole = Rectangle((x, y), width * self.cell, depth * self.cell, zorder=-2)
            whole.set(facecolor=GROUND, lw=0)
            ax.add_patch(whole)
        for area in self.land:
            rims = [np.concatenate([rim, rim[:1]]) for rim in (area.outline, *area.holes)]
            path = Path.make_compound_path(*(Path(rim, closed=True) for rim in rims))
            colour = land_colour(area.kind, strength)
            ax.add_patch(PathPatch(path, facecolor=colour, lw=0, zorder=-1))
            if area.name is not None:
                name = WholeName(
                    area, fontsize=_SMALL, style="italic", color=NAME, zorder=1,
                    transform=ax.transData,
                    path_effects=[withStroke(linewidth=2, foreground="white", alpha=0.7)],
                )  # fmt: skip
                name.set_in_layout(False)
                ax.add_artist(name)

    def _handles(self) -> dict[str, _Marks]:
        """Returns the lines of the legend: their texts, with the marks before them."""
        from matplotlib.lines import Line2D
        from matplotlib.patches import Patch

        def disc(colour: str, edge: str = "black") -> Line2D:
            return Line2D([], [], marker="o", ls="none", ms=7, color=colour, mec=edge)

        found: dict[str, _Marks] = {}
        if self.flights:
            flown = any(len(flight) > 1 for flight in self.flights.values())
            words = "drones, last step (ring: start)" if flown else "drones' starts and headings"
            found[words] = tuple(
                disc(colour) if flown else disc("white", colour)
                for colour in distinct_colours(self.flights)
            )
        for area in self.areas[:_MOST_AREAS]:
            found[area.words] = tuple(
                Patch(facecolor=STARTABLE, edgecolor=colour, lw=1.2)
                for colour in distinct_colours(area.drones)
            )
        if self.walks:
            for words, colour in people_by_take(self.takes).items():
                found[f"{words}{self._told_names()}"] = (disc(colour),)
        for colour, label in self.meanings.values():
            found[label] = (Patch(color=colour),)
        if self.has_hidden_zones:
            found[HIDDEN] = (Line2D([], [], color=ZONE, lw=1.0),)
        if self.is_cut:
            mark = Line2D([], [], marker=">", ls="none", ms=7, color=ZONE, mec="white")
            found[CUT] = (mark,)
        return found

    def _told_names(self) -> str:
        """Returns the names of people beside their numbers, if a few have any."""
        named = [f"{number} {name}" for number, name in enumerate(self.names) if name]
        if self.takes or not 0 < len(named) <= _MOST_NAMES:
            return ""
        return f": {', '.join(named)}"

    @property
    def has_hidden_zones(self) -> bool:
        """True if no-fly zones cover nothing but obstacles, so that only outlines show them."""
        return bool(self.zones) and 4 not in self.meanings

    @property
    def meanings(self) -> dict[int, tuple[str, str]]:
        """The colour of each kind of cell that occurs, and its meaning."""
        kinds = {
            1: (COVERED, f"free at {self.height:g} m, below or above a mesh"),
            2: (WALL, f"blocks flight at {self.height:g} m"),
            3: (LOW, "lower obstacle"),
            4: (CLOSED, f"no-fly zone or ceiling at {self.height:g} m"),
        }
        return {kind: found for kind, found in kinds.items() if (self.kinds == kind).any()}

    @property
    def words(self) -> str:
        """The alt text of the picture."""
        flown = any(len(flight) > 1 for flight in self.flights.values())
        count, people = len(self.flights), len(self.walks)
        drones = f"the {'flight of 1 drone' if count == 1 else f'flights of {count} drones'}"
        walks = "the walk of 1 person" if people == 1 else f"the walks of {people} people"
        return f"Map from above with {drones if flown else 'starts of drones'} and {walks}"

    def image(self) -> str:
        """Draw the picture as an HTML image that needs no file."""
        content = io.BytesIO()
        figure = self.draw().get_figure(root=True)
        assert figure is not None
        figure.savefig(content, format="png", dpi=_FINE * _DPI)
        source = base64.b64encode(content.getvalue()).decode()
        width = round(_WIDTH * _DPI)
        style = "max-width: 100%; height: auto"
        return (
            f'<img alt="{self.words}" width="{width}" style="{style}" '
            f'src="data:image/png;base64,{source}">'
        )


def _flight(scene: SceneData, number: int, path: Sequence[State]) -> FloatArray:
    """Returns the positions x, y (m) and headings (rad) of a drone [T+1, 3]."""
    turn = math.tau / scene.robots[number].motion.headings
    return np.array([(*scene.height_map.centre(s.x, s.y), turn * s.heading) for s in path])


def _columns(labels: Iterable[str]) -> int:
    """Returns the number of columns of a legend: two if all its lines are short."""
    return 2 if max(map(len, labels), default=0) <= _LONG else 1


def _draw_legend(ax: Axes, handles: Mapping[str, _Marks], below: Figure | None) -> None:
    """Draw a legend: below a new figure, once below several axes, or on single axes."""
    from matplotlib.legend_handler import HandlerTuple

    how: dict[str, Any] = {
        "handles": list(handles.values()), "labels": list(handles), "fontsize": _SMALL,
        "handlelength": max(4.0, 0.9 * max(map(len, handles.values()), default=1)),
        "handler_map": {tuple: HandlerTuple(ndivide=None, pad=0.3)},
    }  # fmt: skip
    grid, beside = ax.get_subplotspec(), ax.figure
    if below is not None:
        ax.legend(
            loc="lower left", bbox_to_anchor=(0.02, 0.01), borderaxespad=0.0,
            bbox_transform=below.transFigure, frameon=False, ncols=_columns(handles), **how,
        )  # fmt: skip
    elif grid is not None and max(grid.get_gridspec().get_geometry()) > 1:
        ax.label_outer()
        if not beside.legends:
            beside.legend(loc="outside lower center", frameon=False, ncols=_columns(handles), **how)
    else:
        ax.legend(loc="best", framealpha=0.85, **how)


def _draw_flight(ax: Axes, flight: FloatArray, colour: str, number: int, cell: float) -> None:
    ax.plot(*flight[:, :2].T, color=colour, lw=1.8, zorder=4)
    ticks = np.stack([cosines(flight[:, 2]), sines(flight[:, 2])], axis=1) * TICK * cell
    for (x, y, _), (dx, dy) in zip(flight.tolist(), ticks.tolist(), strict=True):
        ax.plot([x, x + dx], [y, y + dy], color=colour, lw=0.8, alpha=0.8, zorder=4)
    (east, north), (x, y) = ticks[0] / (TICK * cell), flight[0, :2]
    ax.quiver(  # the heading at the start, longer than the ring on any map
        x, y, east, north, angles="xy", units="inches", scale_units="inches", width=1.4 / 72,
        scale=72 / (_DISC / 2 + 5), headwidth=0, headlength=0, headaxislength=0, color=colour,
        zorder=5,
    )  # fmt: skip
    ax.plot(*flight[0, :2], marker="o", mfc="white", mec=colour, ms=_DISC + 1, zorder=6)
    if len(flight) == 1:
        _write_number(ax, flight[0, :2], number, "black")
    else:
        _draw_numbered_disc(ax, flight[-1, :2], colour, number)


def _draw_numbered_disc(ax: Axes, at: FloatArray, colour: str, number: int) -> None:
    ax.plot(*at, marker="o", color=colour, mec="black", mew=0.6, ms=_DISC, zorder=8)
    _write_number(ax, at, number, "white")


def _write_number(ax: Axes, at: FloatArray, number: int, colour: str) -> None:
    x, y = at.tolist()
    ax.text(
        x, y, str(number), color=colour, fontsize=_SMALL - 1, ha="center",
        va="center_baseline", zorder=9,
        clip_on=True,
    )  # fmt: skip
