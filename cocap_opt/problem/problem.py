"""The whole planning problem: workspace, robots, actors, objective and collision rules.

Everything here is immutable data, checked once where it is made and then trusted.
The same classes are the scene file: `cocap_opt.files.documents` reads and writes them as JSON.

Axis letters used throughout the project: R robots, T steps, S motion states, A actors,
F faces over all actors. Metres, radians, pixels. Steps are t = 0..T.

Source of the model: Rauniyar, Corah, Scherer, "CoCap: Coordinated motion Capture for
multi-actor scenes in outdoor environments", 2024 (arXiv 2412.20695), and Suresh et al.,
"Greedy Perspectives", 2024 (arXiv 2310.10863).
"""

import html
import math
from collections.abc import Sequence
from functools import cached_property
from operator import eq
from typing import TYPE_CHECKING, Protocol, overload

import msgspec
import numpy as np

from cocap_opt.data import (
    LARGEST,
    MOST_LETTERS,
    MOST_STEPS,
    SMALLEST,
    Data,
    FloatArray,
    IntArray,
    ProblemError,
    read_only,
    require,
    whole,
    within,
)
from cocap_opt.drawing import TopView
from cocap_opt.problem.actor import Actor
from cocap_opt.problem.airspace import Airspace
from cocap_opt.problem.earth import Earth
from cocap_opt.problem.limits import Limits
from cocap_opt.problem.motion import Cell, Motion, State
from cocap_opt.problem.objective import Objective
from cocap_opt.problem.robot import Robot
from cocap_opt.problem.rules import NO_RULES, CollisionRules
from cocap_opt.text import printable
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from cocap_opt.drawing import WholeAxes


class _Paths(Protocol):
    """A plan as pictures need it; `Plan` is one."""

    @property
    def paths(self) -> Sequence[Sequence[State]]:
        """One path of states per robot."""


class Problem(Data, frozen=True, eq=False, dict=True):
    """One view-planning problem: all that a planner, a bound or the referee needs to know.

    Attributes
    ----------
    name : shown in tables and pictures
    height_map : the terrain and buildings as columns
    robots : the drones
    actors : the people
    horizon : T, number of moves
    rules : the conflicts between drones that are forbidden
    objective : the weights of J besides those of the faces
    face_samples : each triangle of a face that a mesh may hide gets this number squared of sight
        rays; convex meshes, columns and actors need none
    meshes : solid matter besides the height map
    airspace : no-fly zones, a ceiling, and the distance that drones keep from people
    step : seconds from a step to the next; None: nobody says how long
    earth : where the scene is on the Earth; None: nobody knows

    Raises
    ------
    ProblemError
        If any field is wrong; the message starts with the field's path.
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

    def __post_init__(self) -> None:
        super().__post_init__()
        require(isinstance(self.name, str), "name", f"must be text, not {self.name!r}")
        msgspec.structs.force_setattr(self, "name", printable(self.name))  # it may be a file's
        letters = len(self.name)
        require(
            letters <= MOST_LETTERS,
            "name",
            f"must have at most {MOST_LETTERS} letters, not {letters}",
        )
        whole(self.horizon, "horizon")
        whole(self.face_samples, "face_samples")
        within(self.horizon, 1, MOST_STEPS, "horizon", "steps")
        require(len(self.robots) > 0, "robots", "must hold at least one drone")
        within(self.face_samples, 1, 64, "face_samples")
        if self.step is not None:
            within(self.step, SMALLEST, LARGEST, "step", "s")
        for j, actor in enumerate(self.actors):
            rows = len(actor.poses)
            require(
                rows > self.horizon,
                f"actors[{j}].poses",
                f"must have a row for each of the {self.horizon + 1} steps 0..{self.horizon}, "
                f"not {rows}",
            )
            self._check_importance(j, actor)
        for i, robot in enumerate(self.robots):
            self._check_robot(i, robot)
        self._check_starts_apart()

    def _check_importance(self, j: int, actor: Actor) -> None:
        if actor.importance is None:
            return
        field, steps = f"actors[{j}].importance", self.horizon + 1
        require(
            len(actor.importance) >= steps,
            field,
            f"must have a number for each of the {steps} steps, not {len(actor.importance)}",
        )
        require(
            not self.objective.over_time or len(set(actor.importance[:steps])) == 1,
            field,
            "must not change where pixels add up over time",
        )

    def _check_robot(self, i: int, robot: Robot) -> None:
        self._check_start(f"robots[{i}].start", robot)
        if robot.goal is not None:
            self._check_goal(f"robots[{i}].goal", robot.motion, *robot.goal)
        if robot.limits is not None and self.step is not None:
            self._check_limits(f"robots[{i}]", robot, robot.limits, self.step)

    def _check_start(self, field: str, robot: Robot) -> None:
        start, motion = robot.start, robot.motion
        sizes = (*self.height_map.shape, *robot.orientation_sizes)
        for name, value, size in zip(State._fields, start, sizes, strict=True):
            whole(value, f"{field}.{name}")
            require(0 <= value < size, f"{field}.{name}", f"must be 0..{size - 1}, not {value}")
        require(
            not self.blocked(start.x, start.y, motion, start.layer),
            field,
            f"cell ({start.x}, {start.y}) is blocked: {self._solid_at(start)}, flight height "
            f"{motion.layers[start.layer]:g} m",
        )
        require(
            not self._forbidden(start.x, start.y, motion, start.layer),
            field,
            f"cell ({start.x}, {start.y}) is in a no-fly zone or above the ceiling, flight height "
            f"{motion.layers[start.layer]:g} m",
        )
        for j, actor in enumerate(self.actors):
            at = self.where(robot, [start])[0]
            aside = math.dist(at[:2], actor.poses[0, :2])
            require(
                not self.airspace.near_person(actor, 0, at),
                field,
                f"is {aside:.2f} m from {self.person(j)} at step 0, must be "
                f"{self.airspace.told_people}",
            )

    def _check_goal(self, field: str, motion: Motion, x: int, y: int) -> None:
        whole(x, field)
        whole(y, field)
        width, depth = self.height_map.shape
        require(
            0 <= x < width and 0 <= y < depth,
            field,
            f"must lie inside the map of {width} x {depth} cells, not ({x}, {y})",
        )
        require(
            any(
                not self.blocked(x, y, motion, k) and not self._forbidden(x, y, motion, k)
                for k in range(len(motion.layers))
            ),
            field,
            f"cell ({x}, {y}) is blocked at every flight height",
        )

    def _check_limits(self, field: str, robot: Robot, limits: Limits, step: float) -> None:
        edge = self.height_map.resolution
        words = limits.broken_by(robot.motion, robot.camera.tilts, edge, step)
        if words:
            raise ProblemError(f"{field}.{words}")
        words = limits.outlasted_by(self.horizon * step)
        if words:
            raise ProblemError(f"{field}.limits.endurance: {words}; fewer steps would do")

    def _check_starts_apart(self) -> None:
        for i, first in enumerate(self.robots):
            for k in range(i):
                a, b = self.cell(k, self.robots[k].start), self.cell(i, first.start)
                apart = math.dist(*self.positions([a, b]))
                require(
                    not self.too_close(a, b),
                    f"robots[{i}].start",
                    f"is {apart:.2f} m from robots[{k}].start, must keep the rules {self.rules}",
                )

    def __repr__(self) -> str:
        x, y = self.height_map.shape
        return (
            f"Problem {self.name!r}: {len(self.robots)} drones film {len(self.actors)} people over "
            f"{self.horizon} steps\n"
            f"on {x} x {y} cells of {self.height_map.resolution:g} m; collision rules: {self.rules}"
            f"{f'; airspace: {self.airspace}' if str(self.airspace) else ''}"
        )

    def _repr_html_(self) -> str:
        """Describes the problem in a notebook, with a picture."""
        return f"<p>{html.escape(repr(self))}</p>{self.top_view().image()}"

    @overload
    def plot(self, plan: "_Paths | None" = None, ax: None = None) -> "WholeAxes": ...

    @overload
    def plot(self, plan: "_Paths | None" = None, *, ax: "Axes | None") -> "Axes": ...

    @overload
    def plot(self, plan: "_Paths | None", ax: "Axes | None") -> "Axes": ...

    def plot(self, plan: "_Paths | None" = None, ax: "Axes | None" = None) -> "Axes":
        """Draws the scene from above, with the flights of a plan or the drones' starts.

        Parameters
        ----------
        plan : a plan, or any object with `paths`
        ax : matplotlib axes; a figure of its own if not given
        """
        return self.top_view(plan).draw(ax)

    def top_view(self, plan: "_Paths | None" = None) -> TopView:
        """Returns the scene from above, with the flights of a plan or the drones' starts."""
        lowest = self.layers[0]
        clearance = max(
            robot.motion.clearance for robot in self.robots if robot.motion.layers[0] == lowest
        )
        altitude = self.height_map.altitudes((lowest,))
        columns = self.workspace.columns
        blocked = columns.solid(altitude - clearance, altitude + clearance)[0]
        blocked |= self.workspace.forbidden.solid(altitude, altitude)[0]
        covered = np.isfinite(columns.low[1:]).any(axis=0)
        kinds = np.where(self.height_map.stands_out, 3, 0)
        kinds[covered] = 1
        kinds[blocked] = 2
        paths = [[robot.start] for robot in self.robots] if plan is None else plan.paths
        flights = [
            np.array(
                [
                    (*self.height_map.centre(s.x, s.y), math.tau * s.heading / r.motion.headings)
                    for s in path
                ]
            )
            for r, path in zip(self.robots, paths, strict=True)
        ]
        return TopView(
            kinds=kinds,
            corner=self.height_map.origin,
            cell=self.height_map.resolution,
            height=lowest,
            walks=[actor.poses[: self.horizon + 1, :2] for actor in self.actors],
            flights=flights,
        )

    @property
    def workspace(self) -> Workspace:
        """The map and the meshes: all solid matter, and what else is closed to drones."""
        airspace = self.airspace
        return Workspace(self.height_map, self.meshes, airspace.no_fly, airspace.ceiling)

    def may_hover(self, i: int) -> bool:
        """Returns True if a robot may stay at its start, alone: no goal or person sends it away."""
        robot, steps = self.robots[i], self.horizon + 1
        if robot.goal not in (None, (robot.start.x, robot.start.y)):
            return False
        if not self.airspace.people_aside:
            return True
        (at,) = self.where(robot, [robot.start])
        return not any(
            self.airspace.near_person(actor, t, at)
            or (t + 1 < steps and self.airspace.near_person(actor, t, at, at))
            for actor in self.actors
            for t in range(steps)
        )

    def person(self, j: int) -> str:
        """Returns the words for a person: the number, and the name if there is one."""
        name = self.actors[j].name
        return f"person {j}" if name is None else f"person {j} ({name})"

    def where(self, robot: Robot, states: Sequence[State]) -> FloatArray:
        """Returns where a robot is in states [n], as [n, 3] (m)."""
        altitude, centre = self.height_map.altitude, self.height_map.centre
        rows = [
            (*centre(s.x, s.y), altitude(s.x, s.y, robot.motion.layers[s.layer])) for s in states
        ]
        return np.array(rows)

    def _forbidden(self, x: int, y: int, motion: Motion, layer: int) -> bool:
        """Returns True if a no-fly zone or the ceiling forbids to be there."""
        altitude = self.height_map.altitude(x, y, motion.layers[layer])
        return self.workspace.forbidden.solid_at(x, y, altitude, altitude)

    def blocked(self, x: int, y: int, motion: Motion, layer: int) -> bool:
        """Returns True if solid matter is within the clearance of a robot of this motion."""
        altitude = self.height_map.altitude(x, y, motion.layers[layer])
        low, high = altitude - motion.clearance, altitude + motion.clearance
        return self.workspace.columns.solid_at(x, y, low, high)

    def _solid_at(self, start: State) -> str:
        """Says which solid matter is in a robot's start cell."""
        (_, height), *solids = self.workspace.columns.at(start.x, start.y)
        if not solids:
            return f"height {height:g} m"
        spans = " and ".join(f"from {low:g} to {high:g} m" for low, high in solids)
        return f"ground at {height:g} m, and walls or a mesh {spans}"

    def without_rules(self) -> "Problem":
        """Returns the problem without inter-robot collisions; the same one if it has no rules.

        It is the same object each time, so that what is computed of it once is found again.
        """
        return self if self.rules.none else self._without_rules

    @cached_property
    def _without_rules(self) -> "Problem":
        return self.replace(rules=NO_RULES)

    @cached_property
    def layers(self) -> tuple[float, ...]:
        """Flight heights (m) of all robots together, increasing; `Cell.layer` indexes them."""
        return tuple(sorted({height for robot in self.robots for height in robot.motion.layers}))

    def cell(self, robot: int, state: State) -> Cell:
        """Returns the cell of a robot's state, comparable between robots with different layers."""
        height = self.robots[robot].motion.layers[state.layer]
        return Cell(state.x, state.y, self.layers.index(height))

    def positions(self, cells: Sequence[Cell]) -> FloatArray:
        """Returns where robots in cells [n] are [n, 3], in m from the corner of the map."""
        size, altitude = self.height_map.resolution, self.height_map.altitude
        rows = [(c.x * size, c.y * size, altitude(c.x, c.y, self.layers[c.layer])) for c in cells]
        return np.array(rows).reshape(-1, 3)

    @property
    def cells_apart(self) -> int:
        """Number of cells along an axis from which on no two robots are too near."""
        return math.ceil(self.rules.separation / self.height_map.resolution)

    def too_close(self, a: Cell, b: Cell) -> bool:
        """Returns True if two robots in cells `a` and `b` at one step break a rule."""
        one, other = self.positions([a, b])
        return bool(self.rules.too_near(other - one))

    def paths_conflict(self, p: Sequence[Cell], q: Sequence[Cell]) -> bool:
        """Returns True if two robots with these cells at the steps 0..T break a rule."""
        if self.rules.none:
            return False
        if not self.rules.separation:
            if any(map(eq, p, q)):
                return True
            return self.rules.swap and any(
                p[t] == q[t + 1] and p[t + 1] == q[t] for t in range(len(p) - 1)
            )
        ways = self.positions(q) - self.positions(p)
        return bool(
            self.rules.too_near(ways).any() or self.rules.pass_too_near(ways[:-1], ways[1:]).any()
        )

    @cached_property
    def step_weights(self) -> FloatArray:
        """Weights of all faces at all steps [T+1, F]: the face's times its actor's importance."""
        steps = self.horizon + 1
        importance = np.array(
            [(1.0,) * steps if a.importance is None else a.importance[:steps] for a in self.actors]
        ).reshape(len(self.actors), steps)
        return read_only(importance.T[:, self.face_owner] * self.face_weights)

    @cached_property
    def face_weights(self) -> FloatArray:
        """Weights of all faces [F], actors in order, before the actors' importance."""
        weights = [actor.face_weights for actor in self.actors]
        return read_only(np.concatenate(weights or [np.empty(0)]))

    @cached_property
    def face_owner(self) -> IntArray:
        """Index of the actor that each face belongs to [F]."""
        counts = [len(actor.face_weights) for actor in self.actors]
        owner = np.repeat(np.arange(len(counts)), counts)
        owner.setflags(write=False)
        return owner

    @property
    def view_sum_steps(self) -> int:
        """Number of steps whose pixels are kept apart: T+1, or 1 if they add up over time.

        A view sum is a face at such a step, number step * F + face; J sums the view sums' roots.
        """
        return 1 if self.objective.over_time else self.horizon + 1

    def view_sums_at(self, t: int) -> slice:
        """Returns the view sums to which the pixels of step t are added, face by face."""
        faces = len(self.face_weights)
        first = 0 if self.objective.over_time else t * faces
        return slice(first, first + faces)

    def no_pixels(self) -> FloatArray:
        """Make view sums [Z] to which no robot has added anything yet."""
        return np.zeros(self.view_sum_steps * len(self.face_weights))

    @cached_property
    def view_sum_weights(self) -> FloatArray:
        """Weight w of every view sum [Z]; 0 for steps that do not count."""
        if self.objective.over_time:  # pixels of steps that do not count are not added
            always: FloatArray = self.step_weights[0]
            return always
        counts = np.arange(self.horizon + 1) >= self.first_step
        return read_only((counts[:, None] * self.step_weights).ravel())

    @property
    def most_views(self) -> int:
        """Largest number of views, each of one robot at one step, that add to a view sum."""
        return len(self.robots) * (self.horizon + 1 if self.objective.over_time else 1)

    @property
    def first_step(self) -> int:
        """First step whose views count, 0 or 1."""
        return 0 if self.objective.count_start else 1
