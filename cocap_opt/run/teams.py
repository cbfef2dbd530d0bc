"""Teams: the drones of a scene in other numbers, with other cameras, or at another height.

A team's drones are all alike, as those of the scene are, and start where it is best, in the area
that the scene gives them or wherever they may be.
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

MOST_DRONES = 1000


class TeamChoice(NamedTuple):
    """A choice of drones.

    Attributes
    ----------
    drones : how many
    camera : name of their camera, one of `CAMERAS`; None: as in the scene
    height : m, the one flight height, as the scene's heights are given; None: those of the scene
    """

    drones: int
    camera: str | None = None
    height: float | None = None

    @property
    def words(self) -> str:
        """The choice in words, such as "3 drones, skydio-2, at 9 m"."""
        words = "1 drone" if self.drones == 1 else f"{self.drones} drones"
        camera = "" if self.camera is None else f", {self.camera}"
        height = "" if self.height is None else f", at {self.height:g} m"
        return f"{words}{camera}{height}"

    def scene(self, problem: Problem) -> Problem:
        """Returns a scene with these drones in place of its own, which starts where is best.

        Raises
        ------
        ProblemError
            If the scene's drones are not alike, so many do not find starts that keep the rules, or
            they may be nowhere at this height.
        """
        within(self.drones, 1, MOST_DRONES, "drones")
        robot = _with_height(_with_camera(drone_of(problem), self.camera), self.height)
        name = f"{problem.name}, {self.words}"
        try:
            return problem.replace(name=name, robots=(robot,) * self.drones)
        except ProblemError as error:
            raise ProblemError(f"{self.words}: {error}") from error


def seen_alone(scene: Problem, cameras: int, at_least: float | None = None) -> Problem:
    """Returns a scene whose J is the number of views, of which so many count of a person.

    Parameters
    ----------
    scene : of a team
    cameras : k; J is the sum of min(k, drones that see the person) over person-steps
    at_least : share of a person that a drone must see; None: as the scene has it
    """
    name = f"{scene.name}, seen by {cameras}"
    return views_alone(scene, views_asked(scene, cameras, at_least), name)


def drone_of(problem: Problem) -> Robot:
    """Returns the drone of which teams are made: as the scene's drones are, with all their starts.

    It has the choice of starts that some of them have; where all starts are fixed it may start in
    every free state. A goal of several cells stays the drones' goal, such as ground to land on.
    Homes are left out, for each drone needs one of its own.

    Raises
    ------
    ProblemError
        If the scene's drones are not alike.
    """
    first = problem.robots[0]
    for i, robot in enumerate(problem.robots):
        for field in ("motion", "camera", "limits"):
            same = getattr(robot, field) == getattr(first, field)
            words = "must be as that of robots[0] where teams are made"
            require(same, f"robots[{i}].{field}", words)
        words = "must be left out, or several cells that are the same for all, where teams are made"
        is_shared = isinstance(robot.goal, GoalArea) and robot.goal == first.goal
        require(robot.goal is None or is_shared, f"robots[{i}].goal", words)
    chosen = dict.fromkeys(
        robot.start for robot in problem.robots if not isinstance(robot.start, State)
    )
    words = "must be the same for all drones, or fixed ones, where teams are made"
    require(len(chosen) <= 1, "robots", f"their choices of starts {words}")
    return first.replace(start=next(iter(chosen), StartArea()), home=None)


def _with_camera(robot: Robot, name: str | None) -> Robot:
    if name is None:
        return robot
    given = camera_called(name)
    camera: AnyCamera = robot.camera
    require(isinstance(camera, Camera), "robots[0].camera", "must make pictures to be changed")
    return robot.replace(camera=given.replace(tilts=camera.tilts))


def _with_height(robot: Robot, height: float | None) -> Robot:
    """Returns a drone that stays at one height, and may start there."""
    if height is None:
        return robot
    start: AnyStart = robot.start
    if isinstance(start, StartArea):
        start = start.replace(layers=None)
    else:
        raise ProblemError(
            "robots: their starts are states of the scene's heights; give an area for other heights"
        )
    return robot.replace(start=start, motion=robot.motion.replace(layers=(height,)))
