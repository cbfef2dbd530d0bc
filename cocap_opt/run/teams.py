"""Teams: a scene with another number of drones, other cameras, or another flight height.

A team's drones are all alike, like those of the scene, and start where it is best, in the area that
the scene gives them or in any free state.
"""

from typing import NamedTuple

from cocap_opt.data import ProblemError, require, within
from cocap_opt.problem import (
    AnyCamera,
    AnyStart,
    Camera,
    GoalArea,
    Problem,
    Robot,
    StartArea,
    State,
)
from cocap_opt.run.view_share import views_alone, views_asked
from cocap_opt.scenarios.hardware import camera_called
from cocap_opt.text import counted

MOST_DRONES = 1000

# What the drones of a team have in common, and its names in the tables of a recipe.
_ALIKE = {
    "motion": "[drones.motion]",
    "camera": "camera and tilts",
    "limits": "airframe and limits",
}


class TeamChoice(NamedTuple):
    """A choice of drones.

    Attributes
    ----------
    drones : number of drones
    camera : name of their camera, one of `CAMERAS`; None: as in the scene
    height : the only flight height, relative to the same datum as the scene's heights, m; None: the
        heights of the scene
    """

    drones: int
    camera: str | None = None
    height: float | None = None

    @property
    def words(self) -> str:
        """The choice in words, e.g. "3 drones, skydio-2, at 9 m"."""
        camera = "" if self.camera is None else f", {self.camera}"
        height = "" if self.height is None else f", at {self.height:g} m"
        return f"{counted(self.drones, 'drone')}{camera}{height}"

    def scene(self, problem: Problem) -> Problem:
        """Returns the scene with these drones instead of its own; they start where it is best.

        Raises
        ------
        ProblemError
            If the scene's drones are not alike, if there are not enough starts that obey the rules,
            or if no place is free at this height.
        """
        within(self.drones, 1, MOST_DRONES, "drones")
        robot = _with_height(_with_camera(drone_of(problem), self.camera), self.height)
        name = f"{problem.name}, {self.words}"
        try:
            return problem.replace(name=name, robots=(robot,) * self.drones)
        except ProblemError as error:
            raise ProblemError(f"{self.words}: {error}") from error


def seen_alone(scene: Problem, cameras: int, at_least: float | None = None) -> Problem:
    """Returns a scene whose J is the number of views, counted up to a number of drones per person.

    Parameters
    ----------
    scene : scene of a team
    cameras : k; J is the sum of min(k, drones that see the person) over person-steps
    at_least : share of a person that a drone must see; None: as in the scene
    """
    name = f"{scene.name}, seen by {cameras}"
    return views_alone(scene, views_asked(scene, cameras, at_least), name)


def drone_of(problem: Problem) -> Robot:
    """Returns the drone of which teams consist: like the scene's drones, with all their starts.

    It may start in any of the states that some drones can choose from; if all starts are fixed, it
    may start in every free state. A goal of several cells, e.g. ground to land on, remains the
    drones' goal. Homes are omitted, since each drone would need its own.

    Raises
    ------
    ProblemError
        If the scene's drones are not alike.
    """
    first = problem.robots[0]
    for i, robot in enumerate(problem.robots):
        others = [field for field in _ALIKE if getattr(robot, field) != getattr(first, field)]
        told = ", ".join(_ALIKE[field] for field in others)
        words = (
            f"must be alike to make teams, but drone {i} differs from drone 0 in "
            f"{' and '.join(others)}; in a recipe, all [[drones]] tables need the same {told}"
        )
        require(not others, "robots", words)
        words = (
            "must be left out, or be several cells that are the same for all drones, to make teams"
        )
        is_shared = isinstance(robot.goal, GoalArea) and robot.goal == first.goal
        require(robot.goal is None or is_shared, f"robots[{i}].goal", words)
    chosen = dict.fromkeys(
        robot.start for robot in problem.robots if not isinstance(robot.start, State)
    )
    words = "must be the same for all drones, or fixed, to make teams"
    require(len(chosen) <= 1, "robots", f"their choices of starts {words}")
    return first.replace(start=next(iter(chosen), StartArea()), home=None)


def _with_camera(robot: Robot, name: str | None) -> Robot:
    if name is None:
        return robot
    given = camera_called(name)
    camera: AnyCamera = robot.camera
    words = "must be a pinhole camera; others cannot be replaced"
    require(isinstance(camera, Camera), "robots[0].camera", words)
    return robot.replace(camera=given.replace(tilts=camera.tilts))


def _with_height(robot: Robot, height: float | None) -> Robot:
    """Returns a drone that stays at one flight height, and may start there."""
    if height is None:
        return robot
    start: AnyStart = robot.start
    if isinstance(start, StartArea):
        start = start.replace(layers=None)
    else:
        raise ProblemError(
            "robots: their starts are states at the scene's heights; give an area to use "
            "other heights"
        )
    return robot.replace(start=start, motion=robot.motion.replace(layers=(height,)))
