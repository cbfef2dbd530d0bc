"""Checks of a scene: each check names the field that is wrong, and what is allowed."""

import math
from collections.abc import Sequence

import numpy as np

from cocap_opt.data import (
    LARGEST,
    MOST_LETTERS,
    MOST_STEPS,
    SMALLEST,
    ProblemError,
    require,
    whole,
    within,
)
from cocap_opt.problem.actor import Actor
from cocap_opt.problem.motion import Motion, State
from cocap_opt.problem.robot import Limits, Robot
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.starts import StartArea, StartStates
from cocap_opt.problem.takes import require_takes


def require_scene(scene: SceneData) -> None:
    """Checks how the fields of a scene go together; each is of its type.

    Raises
    ------
    ProblemError
        If any field is wrong; the message starts with the field's path.
    """
    letters = len(scene.name)
    require(
        letters <= MOST_LETTERS,
        "name",
        f"must have at most {MOST_LETTERS} letters, not {letters}",
    )
    whole(scene.horizon, "horizon")
    whole(scene.face_samples, "face_samples")
    within(scene.horizon, 1, MOST_STEPS, "horizon", "steps")
    require(len(scene.robots) > 0, "robots", "must hold at least one drone")
    within(scene.face_samples, 1, 64, "face_samples")
    if scene.step is not None:
        within(scene.step, SMALLEST, LARGEST, "step", "s")
    require_takes(scene.takes, scene.actors)
    for j, actor in enumerate(scene.actors):
        rows = len(actor.poses)
        require(
            rows > scene.horizon,
            f"actors[{j}].poses",
            f"must have a row for each of the {scene.horizon + 1} steps 0..{scene.horizon}, "
            f"not {rows}",
        )
        _require_importance(scene, j, actor)
    if scene.objective.views is not None:
        scene.objective.views.require_for(len(scene.actors), "objective.views.weight")
    for i, robot in enumerate(scene.robots):
        _require_robot(scene, i, robot)
    _require_starts(scene)


def _require_importance(scene: SceneData, j: int, actor: Actor) -> None:
    if actor.importance is None:
        return
    field, steps = f"actors[{j}].importance", scene.horizon + 1
    require(
        len(actor.importance) >= steps,
        field,
        f"must have a number for each of the {steps} steps, not {len(actor.importance)}",
    )
    require(
        not scene.objective.over_time or len(set(actor.importance[:steps])) == 1,
        field,
        "must not change where pixels add up over time",
    )


def _require_robot(scene: SceneData, i: int, robot: Robot) -> None:
    _require_start(scene, f"robots[{i}].start", robot)
    if robot.goal is not None:
        _require_goal(scene, f"robots[{i}].goal", robot.motion, *robot.goal)
    if robot.limits is not None and scene.step is not None:
        _require_limits(scene, f"robots[{i}]", robot, robot.limits, scene.step)


def _require_start(scene: SceneData, field: str, robot: Robot) -> None:
    start = robot.start
    if isinstance(start, State):
        _require_free(scene, field, robot, start)
    elif isinstance(start, StartStates):
        for k in _suspicious(scene, robot, start.states):
            _require_free(scene, f"{field}.states[{k}]", robot, start.states[k])
    else:
        _require_area(scene, field, robot, start)


def _suspicious(scene: SceneData, robot: Robot, states: Sequence[State]) -> list[int]:
    """Returns the numbers of the states that a robot may not start in, found all at once.

    Where some are no whole numbers, or out of range, all are suspected.
    """
    rows = np.array(states)
    sizes = np.array((*scene.height_map.shape, *robot.orientation_sizes))
    if rows.dtype.kind != "i" or (rows < 0).any() or (rows >= sizes).any():
        return list(range(len(states)))
    x, y, layer = rows[:, :3].T
    free = robot.motion.free_places(scene.workspace)[layer, x, y]
    near = scene.near_people(0, scene.above(robot, rows[:, :3]))
    return np.flatnonzero(~free | near).tolist()


def _require_area(scene: SceneData, field: str, robot: Robot, area: StartArea) -> None:
    """Checks that an area is of the map and the robot."""
    width, depth = scene.height_map.shape
    for x, y in area.cells or ():
        require(
            0 <= x < width and 0 <= y < depth,
            f"{field}.cells",
            f"must lie inside the map of {width} x {depth} cells, not ({x}, {y})",
        )
    given = area.layers, area.headings, area.pitches
    names = "layers", "headings", "pitches"
    for name, chosen, size in zip(names, given, robot.orientation_sizes, strict=True):
        for value in chosen or ():
            require(0 <= value < size, f"{field}.{name}", f"must be 0..{size - 1}, not {value}")


def _require_free(scene: SceneData, field: str, robot: Robot, start: State) -> None:
    motion = robot.motion
    sizes = (*scene.height_map.shape, *robot.orientation_sizes)
    for name, value, size in zip(State._fields, start, sizes, strict=True):
        whole(value, f"{field}.{name}")
        require(0 <= value < size, f"{field}.{name}", f"must be 0..{size - 1}, not {value}")
    require(
        not scene.blocked(start.x, start.y, motion, start.layer),
        field,
        f"cell ({start.x}, {start.y}) is blocked: {_solid_at(scene, start)}, flight height "
        f"{motion.layers[start.layer]:g} m",
    )
    require(
        not _forbidden(scene, start.x, start.y, motion, start.layer),
        field,
        f"cell ({start.x}, {start.y}) is in a no-fly zone or above the ceiling, flight height "
        f"{motion.layers[start.layer]:g} m",
    )
    for j, actor in enumerate(scene.actors):
        at = scene.where(robot, [start])[0]
        aside = math.dist(at[:2], actor.poses[0, :2])
        require(
            not scene.airspace.near_person(actor, 0, at),
            field,
            f"is {aside:.2f} m from {scene.person(j)} at step 0, must be "
            f"{scene.airspace.told_people}",
        )


def _require_goal(scene: SceneData, field: str, motion: Motion, x: int, y: int) -> None:
    whole(x, field)
    whole(y, field)
    width, depth = scene.height_map.shape
    require(
        0 <= x < width and 0 <= y < depth,
        field,
        f"must lie inside the map of {width} x {depth} cells, not ({x}, {y})",
    )
    require(
        any(
            not scene.blocked(x, y, motion, k) and not _forbidden(scene, x, y, motion, k)
            for k in range(len(motion.layers))
        ),
        field,
        f"cell ({x}, {y}) is blocked at every flight height",
    )


def _require_limits(
    scene: SceneData, field: str, robot: Robot, limits: Limits, step: float
) -> None:
    edge = scene.height_map.resolution
    words = limits.broken_by(robot.motion, robot.camera.tilts, edge, step)
    if words:
        raise ProblemError(f"{field}.{words}")
    words = limits.outlasted_by(scene.horizon * step)
    if words:
        raise ProblemError(f"{field}.limits.endurance: {words}; fewer steps would do")


def _require_starts(scene: SceneData) -> None:
    """Checks that each robot has a start, and that all together have starts that are apart."""
    for i, states in enumerate(scene.starts):
        require(
            len(states) > 0,
            f"robots[{i}].start",
            "must have a cell in which the drone may be at step 0; all are blocked, forbidden, or "
            "too near to people",
        )
    for i, states in enumerate(scene.starts):
        for k, others in enumerate(scene.starts[:i]):
            if len(states) > 1 or len(others) > 1:
                continue
            a, b = scene.cell(k, others[0]), scene.cell(i, states[0])
            apart = math.dist(*scene.positions([a, b]))
            require(
                not scene.too_close(a, b),
                f"robots[{i}].start",
                f"is {apart:.2f} m from robots[{k}].start, must keep the rules {scene.rules}",
            )
    _ = scene.first_starts  # which raises where there is no such choice


def _forbidden(scene: SceneData, x: int, y: int, motion: Motion, layer: int) -> bool:
    """Returns True if a no-fly zone or the ceiling forbids to be there."""
    altitude = scene.height_map.altitude(x, y, motion.layers[layer])
    return scene.workspace.forbidden.solid_at(x, y, altitude, altitude)


def _solid_at(scene: SceneData, start: State) -> str:
    """Says which solid matter is in a robot's start cell."""
    (_, height), *solids = scene.workspace.columns.at(start.x, start.y)
    if not solids:
        return f"height {height:g} m"
    spans = " and ".join(f"from {low:g} to {high:g} m" for low, high in solids)
    return f"ground at {height:g} m, and walls or a mesh {spans}"
