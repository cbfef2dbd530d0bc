"""Finds all forbidden starts of a scene's drones, and the nearest free places."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, require, whole
from cocap_opt.problem.motion import Motion, State
from cocap_opt.problem.open_areas import largest_area
from cocap_opt.problem.robot import Robot
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.starts import StartStates
from cocap_opt.text import distance

_MOST_TOLD = 12


class Refusal(NamedTuple):
    """A rejected start, and a possible replacement.

    Attributes
    ----------
    robot : number of the robot
    field : path of the start, as in messages
    state : the rejected start
    why : the reason, in words
    nearest : the nearest free start at this height that does not conflict with accepted or
        previously proposed starts, in the largest free area (`largest_area`) if possible; None if
        there is none
    has_nearer : True if a nearer place is free, but in a smaller area, e.g. a closed yard
    height : m, the lowest other flight height at which this cell is free; None if there is none
    """

    robot: int
    field: str
    state: State
    why: str
    nearest: State | None
    has_nearer: bool
    height: float | None

    def way_out(self, scene: SceneData) -> str:
        """Returns the part of the message that names the nearest free place."""
        motion, nearest = scene.robots[self.robot].motion, self.nearest
        here = "" if self.height is None else f"; here it is free at {self.height:g} m"
        if nearest is None:
            return f"no cell is free at {motion.layers[self.state.layer]:g} m{here}"
        x, y = scene.height_map.centre(nearest.x, nearest.y)
        away = math.dist(nearest[:2], self.state[:2]) * scene.height_map.resolution
        place = f"x = {x:.10g}, y = {y:.10g}, cell ({nearest.x}, {nearest.y})"
        where = " that is not shut in" if self.has_nearer else ""
        return f"the nearest free place{where}, {distance(away)} away, is {place}{here}"


def told(scene: SceneData, refusals: Sequence[Refusal]) -> str:
    """Returns one line that names all rejected starts, and the nearest free place for each."""
    parts = [f"{each.field}: {each.why}; {each.way_out(scene)}" for each in refusals[:_MOST_TOLD]]
    more = len(refusals) - len(parts)
    return "; ".join([*parts, *([f"{more} more are rejected"] if more else [])])


def refused_starts(scene: SceneData) -> list[Refusal]:
    """Returns the stated starts that are not allowed, alone or together with the others.

    Of two that are too close to each other, the second is rejected. The proposed places are free,
    and do not conflict with each other or with the accepted starts.

    Raises
    ------
    ProblemError
        If an index is out of range; the message starts with the field's path.
    """
    found: dict[tuple[int, str], tuple[State, str]] = {}
    for i, robot in enumerate(scene.robots):
        for field, state in _stated(scene, i, robot):
            _require_in_range(scene, field, robot, state)
            if words := _closed(scene, robot, state):
                found[i, field] = state, words
    kept: list[tuple[int, State]] = []
    for i, states in enumerate(scene.starts):
        field = f"robots[{i}].start"
        if len(states) != 1 or (i, field) in found:
            continue
        placed = i, states[0]
        if words := next(filter(None, (_crowded(scene, other, placed) for other in kept)), ""):
            found[i, field] = states[0], words
        else:
            kept.append(placed)
    return list(_with_places(scene, found, kept))


def _stated(scene: SceneData, i: int, robot: Robot) -> Iterator[tuple[str, State]]:
    """Yields the starts of a robot that may be rejected, with their fields; one if the robot has a
    choice.
    """
    field = f"robots[{i}].start"
    if isinstance(robot.start, State):
        yield field, robot.start
    elif isinstance(robot.start, StartStates):
        states = robot.start.states
        _require_all_in_range(scene, field, robot, states)
        able = scene.may_start(robot.motion, np.array(states)[:, :3])
        yield from ((f"{field}.states[{k}]", states[k]) for k in np.flatnonzero(~able)[:1].tolist())


def _require_all_in_range(
    scene: SceneData, field: str, robot: Robot, states: Sequence[State]
) -> None:
    """Checks the indices of all states at once, since there may be very many."""
    rows = np.array(states)
    sizes = np.array((*scene.height_map.shape, *robot.orientation_sizes))
    if rows.dtype.kind != "i" or (rows < 0).any() or (rows >= sizes).any():
        for k, state in enumerate(states):
            _require_in_range(scene, f"{field}.states[{k}]", robot, state)


def _require_in_range(scene: SceneData, field: str, robot: Robot, start: State) -> None:
    sizes = (*scene.height_map.shape, *robot.orientation_sizes)
    for name, value, size in zip(State._fields, start, sizes, strict=True):
        whole(value, f"{field}.{name}")
        require(0 <= value < size, f"{field}.{name}", f"must be 0..{size - 1}, not {value}")


def _closed(scene: SceneData, robot: Robot, start: State) -> str:
    """Returns the reason why a robot may not be at a start, even alone; empty if it may."""
    motion = robot.motion
    cell, height = f"cell ({start.x}, {start.y})", f"flight height {motion.layers[start.layer]:g} m"
    if scene.blocked(start.x, start.y, motion, start.layer):
        return f"{cell} is blocked: {_solid_at(scene, start)}, {height}"
    if scene.closed(start.x, start.y, motion, start.layer):
        zones = scene.workspace._replace(ceiling=None).forbidden
        z = scene.where(robot, [start])[0, 2]
        in_zone = zones.solid_at(start.x, start.y, z, z)
        return f"{cell} is {'in a no-fly zone' if in_zone else 'above the ceiling'}, {height}"
    for j, actor in enumerate(scene.actors):
        at = scene.where(robot, [start])[0]
        if scene.airspace.near_person(actor, 0, at):
            aside = math.dist(at[:2], actor.poses[0, :2])
            who = scene.person(j)
            left = actor.nearest(aside)
            must = f"must be {scene.airspace.told_people}"
            return f"is {left:.2f} m from {who} at step 0{actor.told_swerve}, {must}"
    return ""


def _solid_at(scene: SceneData, start: State) -> str:
    """Returns words for the solid matter in a robot's start cell."""
    (_, height), *solids = scene.workspace.columns.at(start.x, start.y)
    if not solids:
        return f"height {height:g} m"
    spans = " and ".join(f"from {low:g} to {high:g} m" for low, high in solids)
    return f"ground at {height:g} m, and walls or a mesh {spans}"


def _crowded(scene: SceneData, kept: tuple[int, State], placed: tuple[int, State]) -> str:
    """Returns a message if a start is too close to an accepted one; empty if it is not."""
    a, b = scene.cell(*kept), scene.cell(*placed)
    if not scene.too_close(a, b):
        return ""
    apart = math.dist(*scene.positions([a, b]))
    return f"is {apart:.2f} m from robots[{kept[0]}].start, must obey the rules {scene.rules}"


def _with_places(
    scene: SceneData, found: dict[tuple[int, str], tuple[State, str]], kept: list[tuple[int, State]]
) -> Iterator[Refusal]:
    """Yields rejected starts with the nearest free places, free of conflicts among all proposed and
    accepted starts.

    Places in the largest free area of the flight height are preferred.
    """
    taken, areas = list(kept), dict[tuple[Motion, int], BoolArray]()
    for (i, field), (state, why) in sorted(found.items(), key=lambda row: row[0][0]):
        motion = scene.robots[i].motion
        if (motion, state.layer) not in areas:
            there = motion.free_places(scene.workspace)[state.layer]
            areas[motion, state.layer] = largest_area(there, motion.corner_cutting)
        free = _free(scene, scene.robots[i], state.layer, taken)
        best = free & areas[motion, state.layer]
        nearest, has_nearer = _nearest(best if best.any() else free, state), False
        if nearest is not None:
            other = _nearest(free, state) or nearest
            has_nearer = math.dist(other[:2], state[:2]) < math.dist(nearest[:2], state[:2])
            taken.append((i, nearest))
        height = _other_height(scene, i, state, taken)
        yield Refusal(i, field, state, why, nearest, has_nearer, height)


def _nearest(free: BoolArray, state: State) -> State | None:
    """Returns a state in the nearest of the free cells [X, Y]; None if there is none."""
    cells = np.argwhere(free)
    if not len(cells):
        return None
    x, y = cells[int(np.argmin(np.hypot(*(cells - state[:2]).T)))].tolist()
    return state._replace(x=x, y=y)


def _free(
    scene: SceneData, robot: Robot, layer: int, taken: Sequence[tuple[int, State]]
) -> BoolArray:
    """Returns the cells [X, Y] in which a robot may start, given the starts already taken."""
    free = startable(scene, robot.motion, layer)
    places = np.argwhere(free)
    rows = np.column_stack([places, np.full(len(places), layer)])
    at, crowded = scene.above(robot.motion, rows), np.zeros(len(rows), dtype=np.bool_)
    for other, state in taken:
        crowded |= scene.rules.too_near(at - scene.where(scene.robots[other], [state]))
    free[tuple(places[crowded].T)] = False
    return free


def startable(scene: SceneData, motion: Motion, layer: int) -> BoolArray:
    """Returns the cells [X, Y] in which a robot with this motion may be at step 0 if it is
    alone.
    """
    places = np.argwhere(np.ones((*scene.height_map.shape, 1)))
    places[:, 2] = layer
    return scene.may_start(motion, places).reshape(scene.height_map.shape)


def _other_height(
    scene: SceneData, i: int, state: State, taken: Sequence[tuple[int, State]]
) -> float | None:
    """Returns the lowest flight height (m), other than that of a start, at which its cell is
    free.
    """
    robot = scene.robots[i]
    for layer, height in enumerate(robot.motion.layers):
        other = state._replace(layer=layer)
        if layer != state.layer and not _closed(scene, robot, other):
            beside = (placed for placed in taken if placed[0] != i)
            if not any(_crowded(scene, placed, (i, other)) for placed in beside):
                return height
    return None
