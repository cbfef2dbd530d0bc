"""Checks a scene; each message names the wrong field and the allowed values."""

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
from cocap_opt.problem.goals import AnyGoal, GoalArea
from cocap_opt.problem.homes import landing_layers
from cocap_opt.problem.motion import Motion
from cocap_opt.problem.refusals import refused_starts, told
from cocap_opt.problem.robot import Limits, Robot
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.starts import StartArea
from cocap_opt.problem.takes import require_takes
from cocap_opt.text import in_digits


def require_scene(scene: SceneData) -> None:
    """Checks that the fields of a scene, whose types have been checked before, fit each other.

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
        "must not change if pixels add up over time",
    )


def _require_robot(scene: SceneData, i: int, robot: Robot) -> None:
    if isinstance(robot.start, StartArea):
        _require_area(scene, f"robots[{i}].start", robot.start, robot)
    if robot.goal is not None:
        _require_goal(scene, f"robots[{i}].goal", robot.motion, robot.goal)
    without = f"robots[{i}].home", "must be given for all drones or for none"
    require((robot.home is None) == (scene.robots[0].home is None), *without)
    if robot.home is not None:
        _require_home(scene, i, robot)
    if robot.limits is not None and scene.step is not None:
        _require_limits(scene, f"robots[{i}]", robot, robot.limits, scene.step)


def _require_home(scene: SceneData, i: int, robot: Robot) -> None:
    """Checks that a drone can take off from its home, where no other drone lands."""
    assert robot.home is not None
    field, (x, y) = f"robots[{i}].home", robot.home
    _require_on_map(scene, field, x, y)
    for k, other in enumerate(scene.robots[:i]):
        words = f"must be in a cell of its own; robots[{k}] has cell ({x}, {y}), too"
        require(other.home != robot.home, field, words)
    require(
        len(landing_layers(scene, robot)) > 0,
        field,
        f"cell ({x}, {y}), at {_in_metres(scene, x, y)}, must be open above, up to one of the "
        "drone's flight heights, for take-off and landing",
    )


def _in_metres(scene: SceneData, x: int, y: int) -> str:
    """Returns the middle of a cell, in words."""
    across, along = scene.height_map.centre(x, y)
    return f"x = {in_digits(across)}, y = {in_digits(along)} m"


def _require_area(scene: SceneData, field: str, area: StartArea, robot: Robot) -> None:
    """Checks that an area lies on the map and fits the robot."""
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


def _require_on_map(scene: SceneData, field: str, x: int, y: int) -> None:
    whole(x, field)
    whole(y, field)
    width, depth = scene.height_map.shape
    require(
        0 <= x < width and 0 <= y < depth,
        field,
        f"must lie inside the map of {width} x {depth} cells, not ({x}, {y})",
    )


def _require_goal(scene: SceneData, field: str, motion: Motion, goal: AnyGoal) -> None:
    if isinstance(goal, GoalArea):
        width, depth = scene.height_map.shape
        for cell in goal.cells:  # there may be many: no message is built for cells on the map
            if not (0 <= cell[0] < width and 0 <= cell[1] < depth):
                _require_on_map(scene, f"{field}.cells", *cell)
        free = motion.free_places(scene.workspace)[:, *goal.array.T]
        require(bool(free.any()), f"{field}.cells", "are blocked at every flight height")
        return
    x, y = goal
    _require_on_map(scene, field, x, y)
    require(
        any(
            not scene.blocked(x, y, motion, k) and not scene.closed(x, y, motion, k)
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
    if robot.home is not None:  # batteries are changed there during a pause of the take
        return
    words = limits.outlasted_by(scene.horizon * step)
    if words:
        raise ProblemError(
            f"{field}.limits.endurance: {words}; use fewer steps, or define homes, at which "
            "batteries are changed"
        )


def _require_starts(scene: SceneData) -> None:
    """Checks that each robot has a start, and that all can start without a conflict."""
    if refusals := refused_starts(scene):
        raise ProblemError(told(scene, refusals))
    _ = scene.first_starts  # raises an error if there are none
