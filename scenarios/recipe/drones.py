"""The drones of a recipe, placed as stated, or at random near people."""

import logging
import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Any, Literal, NamedTuple, TypeVar

import msgspec
import numpy as np
import shapely
from msgspec import Meta
from shapely import Polygon

from cocap_opt.arithmetic import angles_of
from cocap_opt.data import BoolArray, FloatArray, IntArray, ProblemError
from cocap_opt.graph.encounters import NEAR, Encounters
from cocap_opt.graph.motion import People, Window
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.plausibility import buried
from cocap_opt.problem import (
    Actor,
    Airspace,
    AnyGoal,
    CollisionRules,
    LandCover,
    Limits,
    Motion,
    Robot,
    StartArea,
    State,
)
from cocap_opt.scenarios.hardware import AIRFRAMES
from cocap_opt.scenarios.maps.ground_plans import sound
from cocap_opt.scenarios.recipe.cameras import CameraTable, camera_of
from cocap_opt.scenarios.recipe.landing import ground_to_land_on
from cocap_opt.scenarios.recipe.people import IMPOSSIBLE
from cocap_opt.scenarios.tables import Coordinate, Count, Heading, Length, Point, Table
from cocap_opt.scenarios.text import naming, rectangle
from cocap_opt.text import in_digits, meant, pair, span
from cocap_opt.world.workspace import HeightMap, Workspace

_OFF = 0.5  # degrees, by which a stated heading may be rounded
_MOVED = 0.5001  # share of a cell; a larger shift of a drone's start is logged

log = logging.getLogger(__name__)

_T = TypeVar("_T")
_Several = Annotated[tuple[_T, ...], Meta(min_length=1)]


class Surroundings(NamedTuple):
    """The scene into which drones are placed, without any drones.

    Attributes
    ----------
    horizon : T, number of moves
    land_cover : areas of the ground
    """

    workspace: Workspace
    actors: tuple[Actor, ...]
    horizon: int
    rules: CollisionRules
    airspace: Airspace
    land_cover: tuple[LandCover, ...] = ()

    @property
    def height_map(self) -> HeightMap:
        """The map on which drones start."""
        return self.workspace.height_map


class _StartTable(Table):
    """The start of a drone: metres, and degrees from +x, counter-clockwise."""

    x: Coordinate
    y: Coordinate
    height: Coordinate | None = None  # one of the layers; None: the lowest
    heading: Heading = 0.0


class _AreaTable(Table):
    """The area in which drones may start: metres, and degrees from +x; planners choose the best
    place.
    """

    area: Literal["anywhere"] | list[Point]
    heights: _Several[Coordinate] | None = None  # some of the layers; None: all
    headings: _Several[Heading] | None = None  # None: all

    def starts(self, motion: Motion, height_map: HeightMap) -> StartArea:
        """Returns the area of the cells whose middles are in the polygon.

        Raises
        ------
        ProblemError
            If it is not a polygon, if it contains no cell's middle, or if drones do not have the
            layer or heading.
        """
        cells = None
        if self.area != "anywhere":
            with naming("area"):
                cells = _cells_in(self.area, height_map)
        layers = (
            None if self.heights is None else [_layer(h, motion, "heights") for h in self.heights]
        )
        headings = None
        if self.headings is not None:
            headings = [_stated_heading(h, motion, "headings") for h in self.headings]
        return StartArea(
            cells=cells,
            layers=None if layers is None else tuple(sorted(set(layers))),
            headings=None if headings is None else tuple(sorted(set(headings))),
        )


def _cells_in(corners: Sequence[Point], height_map: HeightMap) -> tuple[tuple[int, int], ...]:
    """Returns the cells whose middles are in a polygon or on its edge."""
    if len(corners) < 3:
        raise ProblemError(f"must have at least 3 corners, not {len(corners)}")
    polygon = sound(Polygon(corners), "polygon")
    width, depth = height_map.shape
    cells = np.stack(np.meshgrid(np.arange(width), np.arange(depth), indexing="ij"), axis=-1)
    middles = np.array(height_map.origin) + (cells + 0.5) * height_map.resolution
    inside = shapely.intersects_xy(polygon, middles[..., 0], middles[..., 1])
    if not inside.any():
        raise ProblemError(
            f"must contain the middle of a cell of {height_map.resolution:g} m; the map is "
            f"{rectangle(*height_map.ends)}"
        )
    return tuple((int(x), int(y)) for x, y in np.argwhere(inside))


class _LimitsTable(Table):
    """The limits of a drone; given ones replace those of the airframe."""

    speed: Length | None = None  # m/s
    climb: Length | None = None  # m/s
    descent: Length | None = None  # m/s
    acceleration: Length | None = None  # m/s2
    yaw_rate: Length | None = None  # degrees/s
    gimbal_rate: Length | None = None  # degrees/s
    endurance: Length | None = None  # s

    def over(self, airframe: Limits | None) -> Limits | None:
        """Returns the limits of a drone; None if there are none."""
        given = {
            name: math.radians(value) if name.endswith("_rate") else value
            for name in self.__struct_fields__
            if (value := getattr(self, name)) is not None
        }
        return (airframe or Limits()).replace(**given) if given else airframe


class DronesTable(Table):
    """One of the tables `drones` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    count: Count | None = None
    near: Length | None = None
    starts: _Several[_StartTable] | _AreaTable | None = None
    camera: str | CameraTable | None = None  # None: `ASSUMED`, and a warning
    tilts: tuple[float, ...] = (10.0,)  # degrees below the horizon
    motion: Motion = Motion()
    airframe: str | None = None
    limits: _LimitsTable = msgspec.field(default_factory=_LimitsTable)
    homes: _Several[Point] | None = None  # m, for each drone of the table
    land: Literal["ground"] | None = None  # above which drones end; None: anywhere

    def added_to(
        self, team: list[Robot], around: Surroundings, rng: np.random.Generator
    ) -> list[Robot]:
        """Returns a team with the drones of this table added.

        Drones without a stated start or area are placed in random free cells of their lowest layer.
        They are apart from the rest of the team, can come near somebody from there, and face the
        actor that is nearest at step 0.

        Raises
        ------
        ProblemError
            If there is no such camera, place or layer, or too few free cells; the message is one
            line.
        """
        chosen = isinstance(self.starts, _AreaTable)
        if (self.count is None) if chosen else (self.starts is None) == (self.count is None):
            words = "a count with the area of starts" if chosen else "either starts or a count"
            raise ProblemError(f"must have {words}")
        self._require_free_cell(around.workspace)
        parts: dict[str, Any] = {
            "motion": self.motion,
            "camera": camera_of(self.camera, self.tilts),
            "limits": self._limits(),
            "goal": self._goal(around),
        }
        homes = self._homes(around.height_map)
        team = list(team)
        if self.near is not None and self.starts is not None:
            raise ProblemError("near: must be left out if starts are given; it applies to a count")
        if isinstance(self.starts, _AreaTable):
            with naming("starts"):
                area = self.starts.starts(self.motion, around.height_map)
            return team + [Robot(start=area, home=home, **parts) for home in homes]
        for k, (start, home) in enumerate(zip(self.starts or (), homes, strict=False)):
            state = _stated(start, self.motion, around.height_map, f"starts[{k}]")
            team.append(Robot(start=state, home=home, **parts))
        states = iter(self._candidates(around, rng) if self.count else ())
        for k in range(self.count or 0):
            apart = (
                state
                for state in states
                if not _crowded(state, self.motion, around.rules, around.height_map, team)
                and not _beside(state, self.motion, around)
                and _gets_away(state, self.motion, around)
            )
            state_apart = next(apart, None)
            if state_apart is None:
                if k == 0:
                    _require_people_on_map(around)
                raise ProblemError(f"count: must be at most {k} here; {self._room(around)}")
            team.append(Robot(start=state_apart, home=homes[k], **parts))
        return team

    def _require_free_cell(self, workspace: Workspace) -> None:
        """Raises ProblemError if the drones can be nowhere, which would make all else wrong."""
        if self.motion.free_places(workspace).any():
            return
        low = workspace._replace(ceiling=None)
        if workspace.ceiling is not None and self.motion.free_places(low).any():
            why = f"the ceiling is at {workspace.ceiling:g} m"
        elif self.motion.free_places(low._replace(no_fly=())).any():
            why = "no-fly zones cover all cells that are open"
        else:
            heights = workspace.height_map.heights
            on_it = ", and obstacles are on it" if workspace.meshes else ""
            lowest, highest = float(heights.min()), float(heights.max())
            at = in_digits(lowest) if lowest == highest else span(lowest, highest)
            why = f"the surface is at {at} m{on_it}"
        layers = ", ".join(f"{layer:g}" for layer in self.motion.layers)
        raise ProblemError(
            f"motion.layers: must be heights at which a cell is free; at {layers} m none is: {why}"
        )

    def _goal(self, around: Surroundings) -> AnyGoal | None:
        """Returns the cells in which the drones must end; None if they may end anywhere."""
        if self.land is None:
            return None
        with naming("land"):
            if self.homes is not None:
                raise ProblemError("must be left out beside homes, in which drones land")
            return ground_to_land_on(around.workspace, around.land_cover, self.motion)

    def _homes(self, height_map: HeightMap) -> list[tuple[int, int] | None]:
        """Returns the cells of the homes, one for each drone of the table; None without homes."""
        drones = self.count or len(self.stated)
        if self.homes is None:
            return [None] * drones
        if len(self.homes) != drones:
            raise ProblemError(
                f"homes: must be a place for each of {drones} drones, not {len(self.homes)}"
            )
        cells = [height_map.cell_of(x, y) for x, y in self.homes]
        for k, (cell, (x, y)) in enumerate(zip(cells, self.homes, strict=True)):
            if not height_map.inside(*cell):
                ends = rectangle(*height_map.ends)
                raise ProblemError(
                    f"homes[{k}]: must lie on the map, {ends}, not at {pair(x, y)} m"
                )
            if cell in cells[:k]:
                raise ProblemError(f"homes[{k}]: must be in a cell of its own; {cell} is taken")
        return [*cells]

    @property
    def known_limits(self) -> Limits | None:
        """The limits of the drones; None if they are unknown."""
        return self._limits()

    @property
    def tilts_in_radians(self) -> tuple[float, ...]:
        """The tilts of the camera, below the horizon."""
        return tuple(math.radians(angle) for angle in self.tilts)

    @property
    def size(self) -> int:
        """The number of drones."""
        return self.count or len(self.stated)

    def without_limits(self) -> "DronesTable":
        """Returns the table with unknown limits."""
        return msgspec.structs.replace(self, airframe=None, limits=_LimitsTable())

    def with_motion(self, motion: Motion) -> "DronesTable":
        """Returns the table with another motion."""
        return msgspec.structs.replace(self, motion=motion)

    @property
    def stated(self) -> tuple[_StartTable, ...]:
        """The starts that are stated individually."""
        return () if isinstance(self.starts, _AreaTable) else self.starts or ()

    @property
    def stated_heights(self) -> set[float]:
        """The flight heights of stated starts."""
        if isinstance(self.starts, _AreaTable):
            return set(self.starts.heights or ())
        return {start.height for start in self.stated if start.height is not None}

    def require_likely(self, resolution: float, step: float) -> None:
        """Raises ProblemError if a speed is impossible, or if a name in the table is unknown.

        Parameters
        ----------
        resolution : edge of the map's cells, m
        step : seconds between steps
        """
        camera_of(self.camera, self.tilts)
        self._limits()
        speed = self.motion.radius * resolution / step
        if speed > IMPOSSIBLE:
            raise ProblemError(
                f"motion.radius: must allow at most {IMPOSSIBLE:g} m/s, but {self.motion.radius} "
                f"cells of {resolution:g} m in a step of {step:g} s are {speed:.4g} m/s: are "
                "resolution and step right?"
            )

    def require_pace(self, resolution: float, step: float) -> None:
        """Raises ProblemError if the drones' limits do not allow some move at constant speed."""
        limits = self._limits()
        words = limits and limits.broken_by(
            self.motion, camera_of(self.camera, self.tilts).tilts, resolution, step
        )
        if words:
            raise ProblemError(words)

    def _limits(self) -> Limits | None:
        if self.airframe is not None and self.airframe not in AIRFRAMES:
            raise ProblemError(
                f"airframe: must be one of {', '.join(AIRFRAMES)}, not {self.airframe!r}"
                f"{meant(self.airframe, AIRFRAMES)}; for any other, set limits"
            )
        return self.limits.over(AIRFRAMES[self.airframe] if self.airframe else None)

    def _room(self, around: Surroundings) -> str:
        """Describes how much room there is for drones."""
        workspace, actors = around.workspace, around.actors
        free = self.motion.free_places(workspace)[0]
        words = (
            f"free cells at their lowest layer, {self.motion.layers[0]:g} m: {free.sum()} of "
            f"{free.size}"
        )
        if actors:
            meet = int(self._can_meet(around).sum())
            words += f"; from {meet} of them a drone comes within {NEAR:g} m of somebody in sight"
            inside = (buried(workspace, actor, around.horizon) for actor in actors)
            shut = [
                f"person {j} {warning}" for j, warning in enumerate(inside) if warning and not meet
            ]
            words = "; ".join([words, *shut[:1]])
        if self.near is not None:
            words += f"; some are within {self.near:g} m at step 0"
        return f"{words}; rules: {around.rules}"

    def _can_meet(self, around: Surroundings, far: float = math.inf) -> BoolArray:
        """Returns the cells [X, Y] of the lowest layer from which a drone can come near somebody.

        Parameters
        ----------
        far : largest distance in m from where people are at any step; drones do not fly farther
            away
        """
        workspace, actors, horizon, *_ = around
        height_map, motion = workspace.height_map, self.motion
        poses = np.concatenate([actor.poses[: horizon + 1, :2] for actor in actors]).tolist()
        most = NEAR / height_map.resolution + horizon * motion.radius
        reach = math.ceil(min(most, far / height_map.resolution)) + 1
        window = Window.around((height_map.cell_of(x, y) for x, y in poses), reach, workspace)
        found = np.zeros(height_map.shape, dtype=np.bool_)
        window.of(found)[...] = _that_can_meet(workspace, motion, actors, horizon, window)
        return found

    def _meeting(self, around: Surroundings, free: BoolArray) -> BoolArray:
        """Returns those of some cells [X, Y] from which a drone can come near somebody."""
        if self.near is None:
            return free & self._can_meet(around)
        height_map, near_people = around.height_map, np.zeros_like(free)
        reach = math.ceil(self.near / height_map.resolution)
        for actor in around.actors:
            cell = height_map.cell_of(*actor.poses[0, :2].tolist())
            window = Window.around([cell], reach, around.workspace)
            window.of(near_people)[...] = window.of(free)
        # Usually all of them qualify without leaving the surroundings of people, which is quick to
        # check.
        found = self._can_meet(around, self.near + NEAR)
        if not found[near_people].all():
            found = self._can_meet(around)
        return near_people & found

    def _candidates(self, around: Surroundings, rng: np.random.Generator) -> list[State]:
        """Returns free cells near someone in random order, with headings towards the nearest
        actor.
        """
        actors, allowed = around.actors, self.motion.free_places(around.workspace)[0]
        if actors:
            allowed = self._meeting(around, allowed)
        free = np.argwhere(allowed)
        ways = _ways(around.height_map, free, actors)
        far = np.hypot(ways[:, 0], ways[:, 1])
        if self.near is not None and actors:
            near = far <= self.near
            free, ways = free[near], ways[near]
        order = rng.permutation(len(free))
        yaws = angles_of(ways[order, 1], ways[order, 0]).tolist()
        cells = free[order].tolist()
        return [
            State(x, y, 0, _heading(yaw, self.motion))
            for (x, y), yaw in zip(cells, yaws, strict=True)
        ]


@lru_cache(maxsize=4)  # several tables may have the same motion
def _that_can_meet(
    workspace: Workspace, motion: Motion, actors: tuple[Actor, ...], horizon: int, window: Window
) -> BoolArray:
    """Returns the cells [X, Y] of a window from whose lowest layer a drone can come near
    somebody.
    """
    encounters = Encounters(workspace, motion, actors, horizon, NEAR, window)
    found: BoolArray = encounters.graph.without_border(encounters.can_meet())[0]
    return found


def _require_people_on_map(around: Surroundings) -> None:
    """Raises ProblemError if there are people but none of them is ever on the map."""
    if not around.actors:
        return
    steps = around.horizon + 1
    points = np.concatenate([actor.poses[:steps, :2] for actor in around.actors])
    first, last = around.height_map.ends
    if not ((first <= points) & (points < last)).all(axis=1).any():
        raise ProblemError(
            f"all people are off the map, at {rectangle(points.min(axis=0), points.max(axis=0))}, "
            f"so no drone can start near them; the map is {rectangle(first, last)}; origin of "
            "[map] moves the map, `at` of [[tracks]] moves the people"
        )


def _stated(start: _StartTable, motion: Motion, height_map: HeightMap, field: str) -> State:
    x, y = height_map.cell_of(start.x, start.y)
    if not height_map.inside(x, y):
        raise ProblemError(
            f"{field}: must lie on the map, {rectangle(*height_map.ends)}, not at "
            f"{pair(start.x, start.y)} m"
        )
    layer = 0 if start.height is None else _layer(start.height, motion, f"{field}.height")
    heading = _stated_heading(start.heading, motion, f"{field}.heading")
    return State(x, y, layer, heading)


def _layer(height: float, motion: Motion, field: str) -> int:
    """Returns the index of a flight height."""
    if height not in motion.layers:
        layers = ", ".join(f"{layer:g}" for layer in motion.layers)
        raise ProblemError(f"{field}: must be one of the layers {layers} m, not {height:g} m")
    return motion.layers.index(height)


def _stated_heading(degrees: float, motion: Motion, field: str) -> int:
    """Returns the index of a heading, which must be one of the drones' headings."""
    heading = _heading(math.radians(degrees), motion)
    step = 360 / motion.headings
    off = math.remainder(degrees - heading * step, 360)
    if abs(off) > _OFF:
        beside = (heading + (1 if off > 0 else -1)) % motion.headings
        near = " and ".join(f"{k * step:.6g}" for k in sorted((heading, beside)))
        if motion.headings == 1:
            raise ProblemError(
                f"{field}: must be 0, the only direction, not {degrees:g}; motion.headings sets "
                "their number"
            )
        raise ProblemError(
            f"{field}: must be one of the {motion.headings} directions from 0 in steps of "
            f"{step:.6g} degrees, such as {near}, not {degrees:g}; motion.headings sets their "
            "number"
        )
    return heading


def say_moved(tables: Sequence[DronesTable], height_map: HeightMap) -> None:
    """Logs in one line how far starts are moved from where they are stated, if that is far."""
    starts = [start for table in tables for start in table.stated]
    if not starts:
        return
    stated = np.array([(start.x, start.y) for start in starts])
    cells = np.array([height_map.cell_of(x, y) for x, y in stated.tolist()])
    middles = np.array(height_map.origin) + (cells + 0.5) * height_map.resolution
    away = np.hypot(*(middles - stated).T)
    moved = np.flatnonzero(away > _MOVED * height_map.resolution)
    if not len(moved):
        return
    (x, y), (to_x, to_y) = stated[moved[0]].tolist(), middles[moved[0]].tolist()
    others = len(moved) - 1
    more = f"; {others} more {'are' if others > 1 else 'is'} moved, too" if others else ""
    log.warning(
        "a drone starts in the middle of its cell: the start at (%.10g, %.10g) m is moved by "
        "%.2g m to (%.10g, %.10g) m%s", x, y, away[moved[0]], to_x, to_y, more,
    )  # fmt: skip


def _heading(yaw: float, motion: Motion) -> int:
    """Returns the index of the heading nearest to a yaw in rad."""
    return round(yaw / math.tau * motion.headings) % motion.headings


def _ways(height_map: HeightMap, cells: IntArray, actors: tuple[Actor, ...]) -> FloatArray:
    """Returns the vectors [n, 2] (m) from the middles of cells [n, 2] to the nearest actor at step
    0.

    Without actors they are 0.
    """
    middles = np.array(height_map.origin) + (cells + 0.5) * height_map.resolution
    if not actors:
        return np.zeros_like(middles)
    feet = np.array([actor.poses[0, :2] for actor in actors])
    ways = feet[None] - middles[:, None]
    nearest = np.hypot(ways[..., 0], ways[..., 1]).argmin(axis=1)
    result: FloatArray = ways[np.arange(len(ways)), nearest]
    return result


def _crowded(
    state: State, motion: Motion, rules: CollisionRules, height_map: HeightMap, team: list[Robot]
) -> bool:
    """Returns True if a start breaks a collision rule with a start of the team."""
    cell = state.x, state.y, motion.layers[state.layer]
    starts = [
        (r.start.x, r.start.y, r.motion.layers[r.start.layer])
        for r in team
        if isinstance(r.start, State)
    ]
    return any(bool(rules.too_near(np.array(height_map.way(cell, other)))) for other in starts)


def _gets_away(state: State, motion: Motion, around: Surroundings) -> bool:
    """Returns True if a drone at a start has moves that keep clear of people at all steps.

    This is not checked for drones without limits.
    """
    airspace, workspace, horizon = around.airspace, around.workspace, around.horizon
    if not airspace.people_stray:
        return True
    window = Window.around([(state.x, state.y)], motion.radius * horizon, workspace)
    people = People(around.actors, airspace, horizon)
    graph = TimeGraph(workspace, motion, 1, window, people)
    return bool(graph.reachable([graph.index(state)], horizon)[-1].any())


def _beside(state: State, motion: Motion, around: Surroundings) -> bool:
    """Returns True if a start is too close to somebody."""
    height_map = around.height_map
    altitude = height_map.altitude(state.x, state.y, motion.layers[state.layer])
    at = np.array([*height_map.centre(state.x, state.y), altitude])
    return any(bool(around.airspace.near_person(actor, 0, at)) for actor in around.actors)
