"""The flights of drones from home to their first places and back, and the required battery life.

Drones fly one after the other, each along the quickest way over the map's cells, while those that
have not left, or have arrived, hover: so the rules between drones in the air, obstacles and no-fly
zones are obeyed on these flights as in the plan. A drone at home is on the ground and is not an
obstacle; homes are distinct. People are known only during the take, and are not considered here.
"""

import math
from collections.abc import Iterator, Sequence
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray, ProblemError
from cocap_opt.graph.motion import Window, allowed_moves
from cocap_opt.problem import Plan, Problem, Robot, State
from cocap_opt.problem.homes import landing_layers

if TYPE_CHECKING:
    from scipy.sparse import csr_array

RISE = 1.0  # m/s, at which drones rise from the ground and descend to it, unless limits are lower
CRUISE = 4.0  # m/s, horizontally, for drones whose limits are known and allow it
_ROOM = 60  # cells around homes and the plan in which ways are searched first, before the whole map
_LEAST = 1e-9  # s; scipy ignores moves of zero duration


class Way(NamedTuple):
    """The way of a drone between its place on the ground and one of the plan.

    Attributes
    ----------
    drone : number of the drone
    points : [n, 3] turning points from the beginning to the end, including the ground, m
    seconds : duration of the flight, s
    waits : time for which the drone hovers at its place of the plan while others are on their way,
        s
    """

    drone: int
    points: FloatArray
    seconds: float
    waits: float


class AirTime(NamedTuple):
    """The time that a drone is in the air for a take, or for the part of one between two pauses.

    Attributes
    ----------
    drone : number of the drone
    out : its way from home
    filming : duration of the plan, s
    back : its way home
    endurance : time for which its battery lasts, s; None if unknown
    """

    drone: int
    out: Way
    filming: float
    back: Way
    endurance: float | None

    @property
    def seconds(self) -> float:
        """Seconds from take-off to landing."""
        out, back = self.out, self.back
        return out.seconds + out.waits + self.filming + back.waits + back.seconds

    @property
    def lasts(self) -> bool:
        """True if the battery lasts, or its endurance is unknown."""
        return self.endurance is None or self.seconds <= self.endurance


class Part(NamedTuple):
    """A part of a take that is flown with one set of batteries, from one step to another."""

    first: int
    last: int
    drones: tuple[AirTime, ...]

    @property
    def words(self) -> str:
        """The steps of the part."""
        return f"{self.first}..{self.last}"


def records_of(parts: Sequence[Part]) -> list[dict[str, Any]]:
    """Returns plain data: each drone's time in the air in each part, and its flights from and to
    home.

    Keys: `first` and `last` (the steps of the part), `drone`, `seconds` (from take-off to landing),
    `filming` (s), `endurance` (s; None if unknown), `out` and `back`, each with the `seconds` of
    the way, `waits` (s) and turning `points` (m).
    """
    return [
        {
            "first": part.first, "last": part.last, "drone": drone.drone,
            "seconds": drone.seconds, "filming": drone.filming, "endurance": drone.endurance,
            "out": _record_of(drone.out), "back": _record_of(drone.back),
        }
        for part in parts
        for drone in part.drones
    ]  # fmt: skip


def _record_of(way: Way) -> dict[str, Any]:
    return {"seconds": way.seconds, "waits": way.waits, "points": way.points.tolist()}


def pauses_of(parts: Sequence[Part]) -> str:
    """Returns a message with the steps at which the take must be paused for new batteries; empty if
    none.
    """
    if len(parts) < 2:
        return ""
    steps = [str(part.last) for part in parts[:-1]]
    at = f"step {steps[0]}" if len(steps) == 1 else f"steps {', '.join(steps)}"
    return (
        f"batteries do not last for the whole take: pause it (people, too) at {at} at the "
        "latest, fly all drones home, change batteries, and resume it there"
    )


def rising(robot: Robot) -> float:
    """Returns the speed (m/s) at which a drone rises from the ground: RISE, or less if limits
    require it.
    """
    return min(RISE, (robot.limits and robot.limits.climb) or RISE)


def sinking(robot: Robot) -> float:
    """Returns the speed (m/s) at which a drone descends to the ground: RISE, or less if limits
    require it.
    """
    return min(RISE, (robot.limits and robot.limits.descent) or RISE)


NOTE = (
    "flights from and to home keep clear of obstacles, no-fly zones and other drones, which "
    "hover while one drone at a time flies; people were not considered, and must stay away"
)


def has_homes(problem: Problem) -> bool:
    """Returns True if the drones of a problem have homes."""
    return problem.robots[0].home is not None


@lru_cache(maxsize=4)
def parts_of_take(problem: Problem, plan: Plan) -> tuple[Part, ...]:
    """Returns the parts of a take between which batteries are changed, each as long as batteries
    last.

    There is one part if they last for the whole take. All drones fly home at the same time, and
    resume the take where they left it.

    Raises
    ------
    ProblemError
        If a drone has no way home, or a battery does not last for a single step and the flights
        home; the message is one line.
    """
    whole = Window.all_of(problem.workspace)
    cells = [(state.x, state.y) for path in plan.paths for state in path]
    homes = [robot.home for robot in problem.robots if robot.home is not None]
    near = Window.around([*cells, *homes], _ROOM, problem.workspace)
    try:
        return tuple(_parts(problem, plan, near))
    except _NoWayError:
        if near == whole:
            raise
        return tuple(_parts(problem, plan, whole))


class _NoWayError(ProblemError):
    """A drone has no way on the part of the map that was searched."""


def _parts(problem: Problem, plan: Plan, window: Window) -> list[Part]:
    ways, horizon = _Ways(problem, window), problem.horizon
    parts: list[Part] = []
    first = 0
    while first < horizon:
        out = ways.out_to([path[first] for path in plan.paths])
        last, found = _longest(ways, plan, out, first)
        if last == first:
            worst = max(found, key=lambda drone: drone.seconds - (drone.endurance or math.inf))
            raise ProblemError(
                f"drone {worst.drone} cannot fly even one step from step {first} on: with its "
                f"flights from and to home and the waits for others it is {worst.seconds:.4g} s in "
                f"the air, but its battery lasts {worst.endurance:.4g} s; move its home closer, or "
                "use fewer drones"
            )
        parts.append(Part(first, last, found))
        first = last
    return parts


def _longest(
    ways: "_Ways", plan: Plan, out: list[Way], first: int
) -> tuple[int, tuple[AirTime, ...]]:
    """Returns the last step until which batteries last if drones fly home then, and the flight
    times.

    It is the first step itself if they do not last for a single step; the times are then for one
    step.
    """

    def times(last: int) -> tuple[AirTime, ...]:
        back = ways.back_from([path[last] for path in plan.paths], out)
        return tuple(_times(ways.problem, out, back, (last - first) * ways.step))

    for last in range(ways.problem.horizon, first, -1):
        if ways.may_last(plan, out, first, last):
            found = times(last)
            if all(drone.lasts for drone in found):
                return last, found
    return first, times(first + 1)


def _times(
    problem: Problem, out: Sequence[Way], back: Sequence[Way], filming: float
) -> Iterator[AirTime]:
    for i, robot in enumerate(problem.robots):
        endurance = None if robot.limits is None else robot.limits.endurance
        yield AirTime(i, out[i], filming, back[i], endurance)


class _Ways:
    """The ways between the homes of drones and any of their places."""

    def __init__(self, problem: Problem, window: Window) -> None:
        assert problem.step is not None
        self.problem, self.step = problem, problem.step
        self._nets = [_Net(problem, i, window) for i in range(len(problem.robots))]

    def out_to(self, states: Sequence[State]) -> list[Way]:
        """Returns the ways from all homes to places; drones that have arrived hover until all have.

        The drone with the quickest way flies last.
        """
        return self._in_turn(states, None)

    def back_from(self, states: Sequence[State], out: Sequence[Way]) -> list[Way]:
        """Returns the ways from places to all homes; drones that have not left hover.

        The drone that has been in the air longest flies first.
        """
        return self._in_turn(states, [way.seconds + way.waits for way in out])

    def may_last(self, plan: Plan, out: Sequence[Way], first: int, last: int) -> bool:
        """Returns False if a battery cannot last even if no other drone is in the way home."""
        for i, robot in enumerate(self.problem.robots):
            if robot.limits is not None and robot.limits.endurance is not None:
                least = self._nets[i].seconds_home(plan.paths[i][last])
                filming = (last - first) * self.step
                if out[i].seconds + out[i].waits + filming + least > robot.limits.endurance:
                    return False
        return True

    def _in_turn(self, states: Sequence[State], flown: Sequence[float] | None) -> list[Way]:
        """Returns a way for each drone.

        Ways out are found from the last drone to the first, in reverse time.

        Parameters
        ----------
        flown : time for which drones have been in the air, s; None: compute the ways out
        """
        is_out = flown is None
        robots = zip(self.problem.robots, states, strict=True)
        at = [self.problem.where(robot, [state])[0] for robot, state in robots]
        found: dict[int, Way] = {}
        waits = 0.0
        while len(found) < len(states):
            left = [i for i in range(len(states)) if i not in found]
            ways = [
                way
                for i in left
                if (way := self._nets[i].way(states[i], is_out, [at[k] for k in left if k != i]))
            ]
            if not ways:
                where = "from home to its place" if is_out else "home"
                raise _NoWayError(
                    f"drone {left[0]} has no way {where} that is clear of obstacles, no-fly "
                    "zones and the drones that hover"
                )
            if flown is None:
                way = min(ways, key=lambda way: way.seconds)
            else:
                way = max(ways, key=lambda way: flown[way.drone])
            found[way.drone] = way._replace(waits=waits)
            waits += way.seconds
        return [found[i] for i in range(len(states))]


class _Net:
    """The places of a drone and its moves between cells, with the duration of each in s."""

    def __init__(self, problem: Problem, drone: int, window: Window) -> None:
        self._problem, self._drone = problem, drone
        self._robot = problem.robots[drone]
        # Ways are timed by the drone's limits, not by steps, so the plan's strides do not apply.
        self._motion = self._robot.motion.replace(radius=1, climb=1, spacing=1, stride=None)
        assert self._robot.home is not None
        self._home = self._robot.home
        x, y = self._home
        self._ground = float(problem.height_map.heights[x, y])
        self._window = window
        self._shape = (len(self._motion.layers), *window.shape)
        self._pad = math.prod(self._shape)  # the node on the ground at home
        self._tails, self._heads, self._seconds = self._moves()
        self._at = self._places()

    def _places(self) -> FloatArray:
        """Returns the positions [n, 3] (m) of the nodes; the last is on the ground."""
        layer, x, y = np.unravel_index(np.arange(self._pad), self._shape)
        rows = np.column_stack([x + self._window.x0, y + self._window.y0, layer])
        places = self._problem.above(self._motion, rows)
        ground = [*self._problem.height_map.centre(*self._home), self._ground]
        return np.concatenate([places, [ground]])

    def _moves(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Returns all moves: their first and last nodes, and their durations in s."""
        workspace, limits = self._problem.workspace, self._robot.limits
        size, step = workspace.height_map.resolution, self._problem.step
        assert step is not None
        level = max(self._robot.motion.radius, 1) * size / step  # speed in the take, along an axis
        if limits is not None and limits.speed is not None:
            level = min(max(level, CRUISE), limits.speed)
        tails, heads, seconds = [], [], []
        altitudes = self._window.of(workspace.height_map.altitudes(self._motion.layers))
        numbers = np.arange(self._pad).reshape(self._shape)
        for (up, dx, dy), may in allowed_moves(workspace, self._motion, self._window):
            if (up, dx, dy) == (0, 0, 0):
                continue
            layer, x, y = np.nonzero(may)
            rise = altitudes[layer + up, x + dx, y + dy] - altitudes[layer, x, y]
            tails.append(numbers[layer, x, y])
            heads.append(numbers[layer + up, x + dx, y + dy])
            along = math.hypot(dx, dy) * size / level
            seconds.append(np.maximum(along, self._climbing(rise)))
        for landing in landing_layers(self._problem, self._robot):
            node = self._node(State(*self._home, landing))
            high = self._altitude(landing) - self._ground
            tails += [np.array([node]), np.array([self._pad])]
            heads += [np.array([self._pad]), np.array([node])]
            for speed in (sinking(self._robot), rising(self._robot)):
                seconds.append(np.array([max(high / speed, _LEAST)]))
        return np.concatenate(tails), np.concatenate(heads), np.concatenate(seconds)

    def _climbing(self, rise: FloatArray) -> FloatArray:
        """Returns the durations in s of climbs and descents (m), at the speed that limits allow, or
        RISE.
        """
        limits = self._robot.limits
        up = (limits and limits.climb) or RISE
        down = (limits and limits.descent) or RISE
        seconds: FloatArray = np.where(rise > 0, rise / up, -rise / down)
        return seconds

    def _node(self, state: State) -> int:
        place = state.layer, state.x - self._window.x0, state.y - self._window.y0
        return int(np.ravel_multi_index(place, self._shape))

    def _altitude(self, layer: int) -> float:
        """Returns the altitude (m) of a layer at home."""
        height = self._motion.layers[layer]
        return self._problem.height_map.altitude(*self._home, height)

    def _matrix(self, hovering: Sequence[FloatArray]) -> "csr_array":
        """Returns the durations in s of all moves that obey the rules near hovering drones (m)."""
        from scipy.sparse import csr_array  # takes long to import

        kept, rules = np.ones(len(self._tails), dtype=np.bool_), self._problem.rules
        for place in hovering:
            before, after = self._at[self._tails] - place, self._at[self._heads] - place
            kept &= ~(rules.too_near(before) | rules.too_near(after))
            kept &= ~rules.pass_too_near(before, after)
        nodes = self._pad + 1
        rows = self._tails[kept], self._heads[kept]
        return csr_array((self._seconds[kept], rows), shape=(nodes, nodes))

    @cached_property
    def _alone(self) -> FloatArray:
        """The durations in s from all nodes to home, with nobody in the way."""
        from scipy.sparse.csgraph import dijkstra  # takes long to import

        found: FloatArray = dijkstra(self._matrix([]).T.tocsr(), indices=[self._pad])[0]
        return found

    def seconds_home(self, state: State) -> float:
        """Returns the duration in s of the way home with nobody in the way; inf if there is
        none.
        """
        return float(self._alone[self._node(state)])

    def way(self, state: State, is_out: bool, hovering: Sequence[FloatArray]) -> Way | None:
        """Returns the quickest way from or to home past hovering drones (m); None if there is
        none.
        """
        from scipy.sparse.csgraph import dijkstra  # takes long to import

        matrix = self._matrix(hovering)
        matrix = matrix if is_out else matrix.T.tocsr()
        (seconds,), (before,) = dijkstra(matrix, indices=[self._pad], return_predecessors=True)
        node = self._node(state)
        if not math.isfinite(seconds[node]):
            return None
        nodes = [node]
        while nodes[-1] != self._pad:
            nodes.append(int(before[nodes[-1]]))
        points = self._at[nodes[::-1] if is_out else nodes]
        return Way(self._drone, _turns(points), float(seconds[node]), 0.0)


def _turns(points: FloatArray) -> FloatArray:
    """Returns the points [n, 3] at which a way turns, including both ends."""
    ways = np.diff(points, axis=0)
    kept = [0]
    for k in range(1, len(ways)):
        if np.linalg.norm(np.cross(ways[k - 1], ways[k])) > 1e-9 or ways[k - 1] @ ways[k] < 0:
            kept.append(k)
    return points[[*kept, len(points) - 1]]
