"""The planning problem: workspace, robots, actors, objective and collision rules.

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
from typing import TYPE_CHECKING, NamedTuple, Protocol

import msgspec
import numpy as np

from cocap_opt import drawing
from cocap_opt.data import (
    FOCAL,
    LARGEST,
    MOST_PIXELS,
    MOST_STEPS,
    MOST_TURN,
    MOST_WEIGHT,
    SMALLEST,
    Data,
    FloatArray,
    IntArray,
    frozen,
    printable,
    read_only,
    require,
    whole,
    within,
)
from cocap_opt.world.workspace import HeightMap, Mesh, Workspace

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class State(NamedTuple):
    """Motion state of one robot: grid cell, layer, heading and gimbal pitch, all indices.

    Heading 0 looks along +x and headings go counter-clockwise; `layer` indexes
    `Motion.layers` and `pitch` indexes `Camera.tilts`.
    """

    x: int
    y: int
    layer: int = 0
    heading: int = 0
    pitch: int = 0


class Cell(NamedTuple):
    """A robot's place without its orientation; `layer` is an index into `Problem.layers`."""

    x: int
    y: int
    layer: int = 0


class Motion(Data, frozen=True):
    """What a robot can do in one step: move up to `radius` cells and turn.

    The default is Greedy Perspectives' action set: 3x3 cells times yaw -45, 0, +45 degrees.
    """

    radius: int = 1  # cells along each axis per step
    headings: int = 8  # number of headings in a full turn
    turn: int = 1  # heading indices per step, either way
    layers: tuple[float, ...] = (5.0,)  # m above the map's datum, flight heights, increasing
    climb: int = 1  # layers per step, either way
    pitch_turn: int = 1  # gimbal pitch indices per step, either way
    clearance: float = 0.0  # m, to solid matter above and below; touching it is too near
    # True: only the target cell of a move must be free, whatever is between (papers)
    corner_cutting: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("radius", "headings", "turn", "climb", "pitch_turn"):
            whole(getattr(self, field), field)
        within(self.radius, 0, 16, "radius", "cells")
        within(self.headings, 1, 360, "headings", "directions")
        for field in ("turn", "climb", "pitch_turn"):
            within(getattr(self, field), 0, MOST_TURN, field, "indices per step")
        within(self.clearance, 0, LARGEST, "clearance", "m")
        require(len(self.layers) > 0, "layers", "must name at least one flight height")
        for height in self.layers:
            within(height, -LARGEST, LARGEST, "layers", "m")
        increasing = all(a < b for a, b in zip(self.layers, self.layers[1:], strict=False))
        require(increasing, "layers", "flight heights must increase")


class Camera(Data, frozen=True, tag="pinhole"):
    """A pinhole camera with square pixels and its principal point in the middle.

    More than one tilt makes a gimbal: the pitch index is then part of the motion state.
    """

    width: int = 4000  # px
    height: int = 3000  # px
    focal: float = 2500.0  # px
    tilts: tuple[float, ...] = (math.radians(10.0),)  # rad below the horizon, one per pitch

    def __post_init__(self) -> None:
        super().__post_init__()
        whole(self.width, "width")
        whole(self.height, "height")
        within(self.width, 1, MOST_PIXELS, "width", "px")
        within(self.height, 1, MOST_PIXELS, "height", "px")
        within(self.focal, *FOCAL, "focal", "px")
        require(len(self.tilts) > 0, "tilts", "must hold at least one tilt")
        for tilt in self.tilts:
            # False for nan, too.
            require(abs(tilt) <= math.pi / 2, "tilts", f"must be within +-pi/2 rad, not {tilt}")

    @property
    def half_angle(self) -> float:
        """Half of the horizontal angle of view, in rad."""
        return math.atan(self.width / 2 / self.focal)


class Cone(Data, frozen=True, tag="cone"):
    """Sensor of Hughes et al. 2024: neither image nor obstacles nor range.

    It detects the actors whose foot point is ahead, within half of the opening to either side.
    Each of their faces, with normal n, then has |d.u| max(0, -d.n) / |d|^4 in place of px/m2,
    d being the way to the middle of the face, dropped to the ground, and u the (level) look
    direction.
    """

    opening: float = math.pi / 2  # rad

    def __post_init__(self) -> None:
        super().__post_init__()
        within(self.opening, 0, math.tau, "opening", "rad")

    @property
    def tilts(self) -> tuple[float, ...]:
        """It looks level, and has no gimbal."""
        return (0.0,)

    @property
    def half_angle(self) -> float:
        """Half of the horizontal angle of view, in rad."""
        return self.opening / 2


AnyCamera = Camera | Cone


class Robot(Data, frozen=True):
    """One camera drone: start state, motion, camera and, if wanted, a goal cell at step T."""

    start: State
    motion: Motion = Motion()
    camera: AnyCamera = Camera()
    goal: tuple[int, int] | None = None  # cell (x, y), any layer and orientation

    def __post_init__(self) -> None:
        super().__post_init__()
        require(isinstance(self.start, State), "start", "must be a State")
        sizes = self.goal is None or len(self.goal) == 2
        require(sizes, "goal", "must be a cell (x, y)")


class Cuboid(Data, frozen=True, tag="cuboid"):
    """Box actor: four sides and a top. The bottom stands on the ground and is never seen."""

    length: float = 1.0  # m, along the actor's heading
    width: float = 1.0  # m, across it
    height: float = 1.8  # m

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_sizes(self)

    def faces(self) -> list[FloatArray]:
        """Faces as polygons [V, 3], counter-clockwise seen from outside: front, left, back,
        right, top."""
        x, y, z = self.length / 2, self.width / 2, self.height
        base = np.array([[x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0], [-x, -y, 0.0]])
        return _prism_faces(base, z)


class Prism(Data, frozen=True, tag="prism"):
    """Upright regular prism: `sides` side faces, the first facing the heading, and a top."""

    sides: int = 6
    apothem: float = 0.5  # m, centre to the middle of a side
    height: float = 1.8  # m

    def __post_init__(self) -> None:
        super().__post_init__()
        whole(self.sides, "sides")
        within(self.sides, 3, 64, "sides")
        _require_sizes(self)

    def faces(self) -> list[FloatArray]:
        """Faces as polygons [V, 3], counter-clockwise seen from outside: sides, then the top."""
        corner = self.apothem / math.cos(math.pi / self.sides)
        angles = 2 * math.pi / self.sides * (np.arange(self.sides) - 0.5)
        base = np.column_stack(
            [corner * np.cos(angles), corner * np.sin(angles), np.zeros(self.sides)]
        )
        return _prism_faces(base, self.height)


class TriangulatedCuboid(Data, frozen=True, tag="triangulated-cuboid"):
    """Box whose sides and top are two triangles each, every triangle a face of its own.

    Greedy Perspectives counts its actors so: the square root of each triangle's coverage
    is summed. Faces are ordered as those of `Cuboid`, two by two, and cut along the same
    diagonals as theirs.
    """

    length: float = 1.0  # m
    width: float = 1.0  # m
    height: float = 2.5  # m

    def __post_init__(self) -> None:
        super().__post_init__()
        _require_sizes(self)

    def faces(self) -> list[FloatArray]:
        """Faces as triangles [3, 3], counter-clockwise seen from outside."""
        quads = Cuboid(length=self.length, width=self.width, height=self.height).faces()
        first_to_third, second_to_fourth = ((0, 1, 2), (2, 3, 0)), ((1, 2, 3), (3, 0, 1))
        cuts = [
            first_to_third,
            second_to_fourth,
            second_to_fourth,
            first_to_third,
            second_to_fourth,
        ]
        return [
            quad[list(corners)] for quad, cut in zip(quads, cuts, strict=True) for corners in cut
        ]


Shape = Cuboid | Prism | TriangulatedCuboid


def _require_sizes(shape: Shape) -> None:
    for field in ("length", "width", "apothem", "height"):
        if hasattr(shape, field):
            within(getattr(shape, field), SMALLEST, LARGEST, field, "m")


def _prism_faces(base: FloatArray, height: float) -> list[FloatArray]:
    top = base + np.array([0.0, 0.0, height])
    following = np.roll(np.arange(len(base)), -1)
    sides = [
        np.stack([base[i], base[j], top[j], top[i]])
        for i, j in zip(range(len(base)), following, strict=True)
    ]
    return [*sides, top]


class Actor(Data, frozen=True, eq=False, dict=True):
    """A moving person: a shape, its pose at every step, and a weight for each face.

    Raises
    ------
    ProblemError
        If poses are not [>= T+1, 4] finite numbers (T is checked by `Problem`), or weights
        are out of range or not one per face.
    """

    poses: FloatArray  # [T+1, 4]: x, y, z of the foot point (m) and yaw (rad, from +x, ccw)
    shape: Shape = Cuboid()
    weights: tuple[float, ...] | None = None  # one per face of the shape; None: all 1
    importance: tuple[float, ...] | None = None  # [>= T+1] factor of the weights; None: all 1

    def __post_init__(self) -> None:
        super().__post_init__()
        msgspec.structs.force_setattr(self, "poses", frozen(self.poses, "poses", 2))
        columns = self.poses.shape[1]
        require(columns == 4, "poses", f"must have 4 columns x, y, z, yaw, not {columns}")
        if self.weights is not None:
            faces = len(self.shape.faces())
            require(
                len(self.weights) == faces,
                "weights",
                f"must hold one weight for each of the {faces} faces, not {len(self.weights)}",
            )
            for weight in self.weights:
                within(weight, 0, MOST_WEIGHT, "weights")

        for value in self.importance or ():
            within(value, 0, MOST_WEIGHT, "importance")

    @cached_property
    def face_weights(self) -> FloatArray:
        """Weight of each face of this actor [F of the shape], before its importance."""
        if self.weights is None:
            return read_only(np.ones(len(self.shape.faces())))
        return read_only(np.array(self.weights, dtype=np.float64))


class CollisionRules(Data, frozen=True):
    """Which inter-robot conflicts count. Planners, formulations and referee read only this.

    Vertex: two robots in one cell (layers count, headings do not) at one step. Swap: two
    robots exchange cells in one step. Separation: two robots' cell centres nearer than this
    many metres at one step (0: no such rule).
    """

    vertex: bool = True
    swap: bool = True
    separation: float = 0.0  # m

    def __post_init__(self) -> None:
        super().__post_init__()
        within(self.separation, 0, LARGEST, "separation", "m")
        require(
            self.vertex or not (self.swap or self.separation),
            "vertex",
            "must be true where the swap or separation rule is on",
        )

    def too_near(self, way: tuple[float, float, float]) -> bool:
        """True where two robots break the rules if this way (m) leads from one to the other."""
        apart = math.hypot(*way)
        return self.vertex and (apart == 0 or apart < self.separation)

    @property
    def none(self) -> bool:
        """True where robots may pass through each other."""
        return not self.vertex

    def __str__(self) -> str:
        names = [name for name in ("vertex", "swap") if getattr(self, name)]
        if self.separation:
            names.append(f"separation {self.separation:g} m")
        return "+".join(names) or "none"


NO_RULES = CollisionRules(vertex=False, swap=False)
PAPER_RULES = CollisionRules(vertex=True, swap=False)


class Objective(Data, frozen=True):
    """Weights of the objective besides the actors' face weights.

    J = sum over t, actors, faces of w sqrt(pixels of all robots at t, in px/m2)
      + sum over robots and their T moves of
          stationarity [same state] + keep_cell [same cell] + keep_heading [same heading]
          + balanced [dx + dy = 0].

    Robots are rewarded for these moves one by one, whatever they see. `keep_heading` and
    `keep_cell` are what the planner of Hughes et al. (2024) adds (0.02 and 0.01). `balanced` is
    what the program of Greedy Perspectives (Suresh et al. 2024) adds (100): it is meant for
    staying, but dx + dy is 0 for the two diagonal moves (+1, -1) and (-1, +1) as well.

    With `over_time` the pixels of a face add up over all steps before the root is taken, the
    other reading of CoCap's eq. 1: J = sum over actors, faces of w sqrt(pixels of all robots
    at all t) + the rewards for moves as before. Planning one robot is then no dynamic program
    any more; bounds and exact methods hold.
    """

    stationarity: float = 0.0  # reward for each step in which a robot's state does not change
    keep_cell: float = 0.0  # for each step in which it stays in its cell, layer included
    keep_heading: float = 0.0  # for each step in which its heading does not change
    balanced: float = 0.0  # for each step with dx + dy = 0 cells, layers aside
    count_start: bool = False  # True: the views at t = 0 count too (a constant)
    over_time: bool = False  # True: pixels add up over time as well as over robots

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("stationarity", "keep_cell", "keep_heading", "balanced"):
            within(getattr(self, field), 0, MOST_WEIGHT, field)


class Paths(Protocol):
    """A plan, as pictures need it."""

    @property
    def paths(self) -> Sequence[Sequence[State]]:
        """One path of states per robot."""


class Problem(Data, frozen=True, eq=False, dict=True):
    """One view-planning problem. Everything a planner, a bound or the referee needs to know.

    Raises
    ------
    ProblemError
        If any field is wrong; the message starts with the field's path.
    """

    name: str
    height_map: HeightMap
    robots: tuple[Robot, ...]
    actors: tuple[Actor, ...]
    horizon: int  # T, number of moves
    rules: CollisionRules = CollisionRules()
    objective: Objective = Objective()
    face_samples: int = 3  # each triangle of a face gets this number squared of sight rays
    meshes: tuple[Mesh, ...] = ()  # solid matter besides the height map

    def __post_init__(self) -> None:
        super().__post_init__()
        require(isinstance(self.name, str), "name", f"must be text, not {self.name!r}")
        msgspec.structs.force_setattr(self, "name", printable(self.name))  # it may be a file's
        whole(self.horizon, "horizon")
        whole(self.face_samples, "face_samples")
        within(self.horizon, 1, MOST_STEPS, "horizon", "steps")
        require(len(self.robots) > 0, "robots", "must hold at least one robot")
        within(self.face_samples, 1, 64, "face_samples")
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
        start, motion = robot.start, robot.motion
        field = f"robots[{i}].start"
        sizes = (*self.height_map.shape, *orientation_sizes(robot))
        for name, value, size in zip(State._fields, start, sizes, strict=True):
            whole(value, f"{field}.{name}")
            require(0 <= value < size, f"{field}.{name}", f"must be 0..{size - 1}, not {value}")
        require(
            not self.blocked(start.x, start.y, motion, start.layer),
            field,
            f"cell ({start.x}, {start.y}) is blocked: {self._solid_at(start)}, flight height "
            f"{motion.layers[start.layer]:g} m",
        )
        if robot.goal is not None:
            field, (x, y) = f"robots[{i}].goal", robot.goal
            whole(x, field)
            whole(y, field)
            width, depth = self.height_map.shape
            require(
                0 <= x < width and 0 <= y < depth,
                field,
                f"must lie inside the map of {width} x {depth} cells, not ({x}, {y})",
            )
            require(
                any(not self.blocked(x, y, motion, k) for k in range(len(motion.layers))),
                field,
                f"cell ({x}, {y}) is blocked at every flight height",
            )

    def _check_starts_apart(self) -> None:
        for i, first in enumerate(self.robots):
            for k in range(i):
                a, b = self.cell(k, self.robots[k].start), self.cell(i, first.start)
                require(
                    not self.too_close(a, b),
                    f"robots[{i}].start",
                    f"conflicts with the start of robots[{k}] under the rules {self.rules}",
                )

    def __repr__(self) -> str:
        x, y = self.height_map.shape
        return (
            f"Problem {self.name!r}: {len(self.robots)} drones film {len(self.actors)} people over "
            f"{self.horizon} steps\n"
            f"on {x} x {y} cells of {self.height_map.resolution:g} m; collision rules: {self.rules}"
        )

    def _repr_html_(self) -> str:
        """Describe the problem in a notebook, with a picture."""
        return f"<p>{html.escape(repr(self))}</p>{drawing.inline_image(self.plot())}"

    def plot(self, plan: "Paths | None" = None, ax: "Axes | None" = None) -> "Axes":
        """Draw the scene from above, with the flights of a plan or the drones' starts.

        Parameters
        ----------
        plan : a plan, or whatever has its `paths`
        ax : matplotlib axes; a figure of its own if not given
        """
        return drawing.draw(self.top_view(plan), ax)

    def top_view(self, plan: "Paths | None" = None) -> drawing.TopView:
        """Return the scene from above, with the flights of a plan or the drones' starts."""
        lowest = self.layers[0]
        clearance = max(
            robot.motion.clearance for robot in self.robots if robot.motion.layers[0] == lowest
        )
        altitude = self.height_map.altitudes((lowest,))
        columns = self.workspace.columns
        blocked = columns.solid(altitude - clearance, altitude + clearance)[0]
        covered = np.isfinite(columns.low[1:]).any(axis=0)
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
        return drawing.TopView(
            kinds=np.where(blocked, 2, np.where(covered, 1, 0)),
            corner=self.height_map.origin,
            cell=self.height_map.resolution,
            height=lowest,
            walks=[actor.poses[: self.horizon + 1, :2] for actor in self.actors],
            flights=flights,
        )

    @property
    def workspace(self) -> Workspace:
        """All that is solid."""
        return Workspace(self.height_map, self.meshes)

    def blocked(self, x: int, y: int, motion: Motion, layer: int) -> bool:
        """True where a robot of this motion may not be: solid matter within its clearance."""
        altitude = self.height_map.altitude(x, y, motion.layers[layer])
        low, high = altitude - motion.clearance, altitude + motion.clearance
        return self.workspace.columns.solid_at(x, y, low, high)

    def _solid_at(self, start: State) -> str:
        """What is solid in a robot's start cell, in words."""
        (_, height), *meshes = self.workspace.columns.at(start.x, start.y)
        if not meshes:
            return f"height {height:g} m"
        spans = ", ".join(f"{low:g}..{high:g} m" for low, high in meshes)
        return f"height {height:g} m and meshes at {spans}"

    @cached_property
    def layers(self) -> tuple[float, ...]:
        """Flight heights (m) of all robots together, increasing; `Cell.layer` indexes them."""
        return tuple(sorted({height for robot in self.robots for height in robot.motion.layers}))

    def cell(self, robot: int, state: State) -> Cell:
        """Cell of a robot's state, comparable between robots with different layers."""
        height = self.robots[robot].motion.layers[state.layer]
        return Cell(state.x, state.y, self.layers.index(height))

    def too_close(self, a: Cell, b: Cell) -> bool:
        """True where two robots in cells `a` and `b` at one step break the rules."""
        if not self.rules.vertex:
            return False
        if a == b:
            return True
        if not self.rules.separation:
            return False
        ends = (a.x, a.y, self.layers[a.layer]), (b.x, b.y, self.layers[b.layer])
        return self.rules.too_near(self.height_map.way(*ends))

    @cached_property
    def step_weights(self) -> FloatArray:
        """Weight of every face at every step [T+1, F]: the face's times its actor's importance."""
        steps = self.horizon + 1
        importance = np.array(
            [(1.0,) * steps if a.importance is None else a.importance[:steps] for a in self.actors]
        ).reshape(len(self.actors), steps)
        return read_only(importance.T[:, self.face_owner] * self.face_weights)

    @cached_property
    def face_weights(self) -> FloatArray:
        """Weight of every face [F], actors in order, before the actors' importance."""
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
        """Number of steps whose pixels are kept apart: T+1, or 1 where they add up over time.

        A view sum is a face at such a step, number step * F + face; J sums the view sums' roots.
        """
        return 1 if self.objective.over_time else self.horizon + 1

    def view_sums_at(self, t: int) -> slice:
        """Groups to which the pixels of step t are added, face by face."""
        faces = len(self.face_weights)
        first = 0 if self.objective.over_time else t * faces
        return slice(first, first + faces)

    @property
    def first_step(self) -> int:
        """First step whose views count."""
        return 0 if self.objective.count_start else 1


def orientation_sizes(robot: Robot) -> tuple[int, int, int]:
    """Number of layers, headings and pitches of a robot, in the order of `State`."""
    return len(robot.motion.layers), robot.motion.headings, len(robot.camera.tilts)
