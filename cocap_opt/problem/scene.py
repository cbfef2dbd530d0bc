"""The data of a scene: its place on the Earth, and the geometry of its robots and solid matter."""

import math
from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from itertools import pairwise
from operator import eq
from typing import Literal

import numpy as np

from cocap_opt.data import (
    LARGEST,
    MOST_LETTERS,
    BoolArray,
    Data,
    FloatArray,
    IntArray,
    ProblemError,
    read_only,
    require,
    within,
)
from cocap_opt.problem.actor import Actor
from cocap_opt.problem.airspace import Airspace
from cocap_opt.problem.goals import may_end
from cocap_opt.problem.land_cover import LandCover
from cocap_opt.problem.motion import Cell, Motion, State
from cocap_opt.problem.objective import Objective
from cocap_opt.problem.placement import UndecidedError, places_apart
from cocap_opt.problem.robot import Robot
from cocap_opt.problem.rules import CollisionRules
from cocap_opt.problem.starts import StartSet, StartStates
from cocap_opt.problem.takes import Take, told_take
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

_MOST_CRS = 100 * MOST_LETTERS  # letters; WKT may be long


class Earth(Data, frozen=True):
    """The place of a scene on the Earth: the meaning of its coordinates x, y and z.

    Heights above the sea and above the ellipsoid are never converted into each other.

    Attributes
    ----------
    crs : reference system of x and y, a projection in metres, as a code such as EPSG:25830 or as
        WKT
    origin : latitude and longitude (WGS 84, degrees) of the point x = 0, y = 0, with axes parallel
        to those of the system; None: x and y are coordinates of the system
    heights : vertical datum of altitudes, "sea" or "ellipsoid"; None if unknown
    base : altitude of z = 0 above that datum, m
    """

    crs: str
    origin: tuple[float, float] | None = None
    heights: Literal["sea", "ellipsoid"] | None = None
    base: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(0 < len(self.crs) <= _MOST_CRS, "crs", "must name a reference system")
        known = self.heights in (None, "sea", "ellipsoid")
        require(known, "heights", f"must be sea or ellipsoid, not {self.heights!r}")
        within(self.base, -LARGEST, LARGEST, "base", "m")
        require(
            self.heights is not None or self.base == 0,
            "base",
            "must be 0 if heights does not name a vertical datum",
        )
        if self.origin is not None:
            within(self.origin[0], -90, 90, "origin", "degrees of latitude")
            within(self.origin[1], -180, 180, "origin", "degrees of longitude")


class SceneData(Data, frozen=True, eq=False, dict=True):
    """The fields of a problem, which `Problem` documents, and the geometry that follows from
    them.
    """

    name: str
    height_map: HeightMap
    robots: tuple[Robot, ...]
    actors: tuple[Actor, ...]
    horizon: int
    rules: CollisionRules = CollisionRules()
    objective: Objective = Objective()
    face_samples: int = 3
    meshes: tuple[Mesh, ...] = ()
    airspace: Airspace = Airspace()
    step: float | None = None
    earth: Earth | None = None
    takes: tuple[Take, ...] = ()
    land_cover: tuple[LandCover, ...] = ()

    @property
    def workspace(self) -> Workspace:
        """The map and the meshes, i.e. all solid matter, and the airspace that is closed to
        drones.
        """
        airspace = self.airspace
        return Workspace(self.height_map, self.meshes, airspace.no_fly, airspace.ceiling)

    @cached_property
    def starts(self) -> tuple[StartSet, ...]:
        """The possible start states of each robot [R]; a single state if the start is fixed."""
        known: dict[object, StartSet] = {}
        found = []
        for robot in self.robots:
            kind = robot.start, robot.motion, robot.camera.tilts
            if kind not in known:
                known[kind] = self._states_to_start_in(robot)
            found.append(known[kind])
        return tuple(found)

    def _states_to_start_in(self, robot: Robot) -> StartSet:
        if isinstance(robot.start, State):
            return StartSet.of((robot.start,))
        if isinstance(robot.start, StartStates):
            return StartSet.of(robot.start.states)
        places = robot.start.places(robot.motion.free_places(self.workspace))
        able = self.may_start(robot.motion, places)
        _, headings, pitches = robot.orientation_sizes
        return robot.start.states_in(places[able], headings, pitches)

    def may_start(self, motion: Motion, places: IntArray) -> BoolArray:
        """Returns an array [n], True for places x, y, layer [n, 3] where a robot may be at step 0.

        Other robots are ignored.
        """
        x, y, layer = places.T
        able: BoolArray = motion.free_places(self.workspace)[layer, x, y]
        if self.airspace.people_aside:
            able[able] = ~self.near_people(0, self.above(motion, places[able]))
        return able

    @property
    def begins_in_the_air(self) -> bool:
        """True if the scene is the rest of a mission, so its drones take off before step 0."""
        return any(robot.number is not None for robot in self.robots)

    @cached_property
    def has_free_starts(self) -> bool:
        """True if some robot has several possible starts."""
        return bool(self.open_starts)

    @cached_property
    def open_starts(self) -> frozenset[int]:
        """The numbers of the robots that have several possible starts."""
        return frozenset(i for i, states in enumerate(self.starts) if len(states) > 1)

    @cached_property
    def first_starts(self) -> tuple[State, ...]:
        """A start for each robot, chosen such that all obey the rules; fixed starts do not change.

        Starts at which robots may stay are preferred, if such a choice is found.

        Raises
        ------
        ProblemError
            If no such choice exists, or none is found.
        """
        for i, states in enumerate(self.starts):
            require(
                len(states) > 0,
                f"robots[{i}].start",
                "must have a cell in which the drone may be at step 0; all are blocked, forbidden, "
                f"or too close to people{self._above_ceiling(self.robots[i])}",
            )
        if not self.has_free_starts:
            return tuple(states[0] for states in self.starts)
        words = f"must have a start for every drone that obeys the rules {self.rules}"
        chosen = None
        with suppress(UndecidedError):
            chosen = self.starts_apart([self._with_hovering(i) for i in range(len(self.robots))])
        try:
            chosen = chosen or self.starts_apart(self.starts)
        except UndecidedError:
            raise ProblemError(f"robots: {words}; none was found: try larger areas") from None
        require(chosen is not None, "robots", f"{words}; no such choice exists")
        assert chosen is not None
        return chosen

    def _above_ceiling(self, robot: Robot) -> str:
        """Returns a message if all flight heights of a robot are above the ceiling; empty
        otherwise.
        """
        ceiling, lowest = self.airspace.ceiling, min(robot.motion.layers)
        if ceiling is None or lowest <= ceiling:
            return ""
        return f": all its heights, {lowest:g} m and more, are above the ceiling of {ceiling:g} m"

    def _with_hovering(self, i: int) -> StartSet:
        """Returns the starts at which a robot may stay, or all starts if there are none."""
        states = self.starts[i]
        able = self.may_hover(i, states)
        return StartSet(states.array[able]) if able.any() and not able.all() else states

    def starts_apart(self, starts: Sequence[StartSet]) -> tuple[State, ...] | None:
        """Returns a state for each robot: the first choice found that obeys the rules.

        Returns None if no such choice exists.

        Parameters
        ----------
        starts : the states of each robot, in the order in which to try them

        Raises
        ------
        UndecidedError
            If the search gives up.
        """
        states_of, places = [], []
        for robot, states in zip(self.robots, starts, strict=True):
            states_of.append(states.in_different_cells())
            size, at = self.height_map.resolution, self.above(robot.motion, states.cells)
            # In the coordinates of the rules between robots: m from the map's corner.
            places.append(np.column_stack([states.cells[:, :2] * size, at[:, 2]]))
        numbers = places_apart(self.rules, places)
        if numbers is None:
            return None
        return tuple(states[k] for states, k in zip(states_of, numbers, strict=True))

    def may_hover(self, i: int, states: StartSet) -> BoolArray:
        """Returns an array, True for states in which a robot may stay; other robots are ignored.

        It may not stay if its goal is elsewhere or if a person comes too close.

        Returns
        -------
        [n], one per state
        """
        robot, steps, cells = self.robots[i], self.horizon + 1, states.array[:, :3]
        able = np.ones(len(cells), dtype=np.bool_)
        if robot.goal is not None:
            able &= may_end(robot.goal, *cells[:, :2].T)
        if not self.airspace.people_aside:
            return able
        # By numbers within their bounding box, which contains many more numbers than there are
        # places.
        low = cells.min(axis=0)
        numbers = np.ravel_multi_index((cells - low).T, cells.max(axis=0) - low + 1)
        _, first, which = np.unique(numbers, return_index=True, return_inverse=True)
        places = cells[first]
        at, near = self.above(robot.motion, places), np.zeros(len(places), dtype=np.bool_)
        for t in range(steps):
            near |= self.near_people(t, at)
            if t + 1 < steps:
                near |= self.near_people(t, at, at)
        return np.asarray(able & ~near[which.ravel()])

    def near_people(self, t: int, before: FloatArray, after: FloatArray | None = None) -> BoolArray:
        """Returns an array [n], True if drones are too close to anybody.

        Parameters
        ----------
        before, after : [n, 3] m, as in `Airspace.near_person`
        """
        near = np.zeros(len(before), dtype=np.bool_)
        for actor in self.distinct_people if self.airspace.people_aside else ():
            near |= self.airspace.near_person(actor, t, before, after)
        return near

    def person(self, j: int) -> str:
        """Returns the name of a person in messages: `Ada (0)`, or `person 0` without a name; and
        the take.
        """
        name, take = self.actors[j].name, self.actors[j].take
        more = [*([] if name is None else [str(j)]), *([] if take is None else [told_take(take)])]
        first = f"person {j}" if name is None else name
        return f"{first} ({', '.join(more)})" if more else first

    @cached_property
    def distinct_people(self) -> tuple[Actor, ...]:
        """The people, including only one of those who walk alike in several takes."""
        if not self.takes:
            return self.actors
        alike = {
            (actor.poses.tobytes(), actor.shape, actor.swerve): actor
            for actor in reversed(self.actors)
        }
        return tuple(reversed(alike.values()))

    @cached_property
    def take_of(self) -> IntArray:
        """Number of each person's take [A]; all 0 if there are no takes."""
        numbers = {take.name: k for k, take in enumerate(self.takes)}
        of_each = [0 if actor.take is None else numbers[actor.take] for actor in self.actors]
        found = np.array(of_each, dtype=np.int64)
        found.setflags(write=False)
        return found

    @property
    def numbers_in_take(self) -> IntArray:
        """Number of each person within the take, in order [A]."""
        numbers = np.zeros(len(self.actors), dtype=np.int64)
        for k in np.unique(self.take_of).tolist():
            inside = np.flatnonzero(self.take_of == k)
            numbers[inside] = np.arange(len(inside))
        return numbers

    @cached_property
    def chances(self) -> FloatArray:
        """Probability that each person is present [A]: that of the person's take; 1 without
        takes.
        """
        if not self.takes:
            return read_only(np.ones(len(self.actors)))
        return read_only(np.array([take.probability for take in self.takes])[self.take_of])

    def where(self, robot: Robot, states: Sequence[State]) -> FloatArray:
        """Returns the positions [n, 3] (m) of a robot in states [n]."""
        return self.above(robot.motion, np.array([state[:3] for state in states]).reshape(-1, 3))

    def above(self, motion: Motion, places: IntArray) -> FloatArray:
        """Returns the positions [n, 3] (m) of a robot with this motion in places x, y, layer [n,
        3].
        """
        (x, y, layer), height_map = places.T, self.height_map
        heights = np.array(motion.layers)[layer]
        if height_map.flight_datum is not None:
            heights = heights + height_map.flight_datum[x, y]
        (ox, oy), size = height_map.origin, height_map.resolution
        return np.column_stack([ox + (x + 0.5) * size, oy + (y + 0.5) * size, heights])

    def blocked(self, x: int, y: int, motion: Motion, layer: int) -> bool:
        """Returns True if solid matter is within the clearance of a robot with this motion."""
        altitude = self.height_map.altitude(x, y, motion.layers[layer])
        low, high = altitude - motion.clearance, altitude + motion.clearance
        return self.workspace.columns.solid_at(x, y, low, high)

    def closed(self, x: int, y: int, motion: Motion, layer: int) -> bool:
        """Returns True if a no-fly zone or the ceiling closes the place to a robot."""
        altitude = self.height_map.altitude(x, y, motion.layers[layer])
        return self.workspace.forbidden.solid_at(x, y, altitude, altitude)

    @cached_property
    def layers(self) -> tuple[float, ...]:
        """Flight heights (m) of all robots together, increasing; `Cell.layer` indexes them."""
        return tuple(sorted({height for robot in self.robots for height in robot.motion.layers}))

    def cell(self, robot: int, state: State) -> Cell:
        """Returns the cell of a robot's state, comparable between robots with different layers."""
        height = self.robots[robot].motion.layers[state.layer]
        return Cell(state.x, state.y, self.layers.index(height))

    def positions(self, cells: Sequence[Cell]) -> FloatArray:
        """Returns the positions [n, 3] of robots in cells [n], in m from the corner of the map."""
        size, altitude = self.height_map.resolution, self.height_map.altitude
        rows = [(c.x * size, c.y * size, altitude(c.x, c.y, self.layers[c.layer])) for c in cells]
        return np.array(rows).reshape(-1, 3)

    @property
    def cells_apart(self) -> int:
        """Number of cells along an axis at which no two robots are too close."""
        return math.ceil(self.rules.separation / self.height_map.resolution)

    def too_close(self, a: Cell, b: Cell) -> bool:
        """Returns True if two robots in cells `a` and `b` at one step break a rule."""
        first, second = self.positions([a, b])
        return bool(self.rules.too_near(second - first))

    def paths_conflict(self, p: Sequence[Cell], q: Sequence[Cell]) -> bool:
        """Returns True if two robots with these cells at steps 0..T break a rule."""
        if self.rules.none:
            return False
        if not self.rules.separation:
            if any(map(eq, p, q)):
                return True
            return self.rules.swap and any(map(eq, pairwise(p), zip(q[1:], q, strict=False)))
        ways = self.positions(q) - self.positions(p)
        return bool(
            self.rules.too_near(ways).any() or self.rules.pass_too_near(ways[:-1], ways[1:]).any()
        )
