"""Coverage as planned beside coverage as rendered: what each face has, and J of a plan's images."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.model import Model
from cocap_opt.output.printing import Record
from cocap_opt.problem import Plan, Problem, State
from cocap_opt.vision.render import Renderer

LEAST_PIXELS = 400  # of a face, for its error to say something
_QUANTILES = {"median": 0.5, "90 %": 0.9, "99 %": 0.99, "largest": 1.0}


class Pose(NamedTuple):
    """A robot in a state at a step."""

    robot: int
    t: int
    state: State

    @classmethod
    def all_of(cls, plan: Plan, first_step: int = 0) -> "list[Pose]":
        """Returns all poses of a plan, step by step."""
        steps = range(first_step, len(plan.paths[0]))
        return [cls(i, t, path[t]) for t in steps for i, path in enumerate(plan.paths)]


class FaceView(NamedTuple):
    """A face in the image of one pose, in pixels."""

    pose: Pose
    face: int
    area: float  # m2, of the face
    planned: float  # as coverage has it
    rendered: float
    unhidden: float  # rendered, were nothing in the way

    @classmethod
    def all_from(
        cls,
        model: Model,
        renderer: Renderer,
        poses: Sequence[Pose],
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> "Iterator[FaceView]":
        """Yields every face that is seen, by plan or in the picture, from each pose.

        Parameters
        ----------
        progress : told how many poses are done, and of how many
        """
        problem = model.problem
        for done, pose in enumerate(poses):
            robot, robot_class = problem.robots[pose.robot], model.class_of[pose.robot]
            state = np.array([robot_class.graph.index(pose.state)])
            areas = renderer.areas(pose.t)
            coverage = model.views(robot_class).coverage(pose.t, state)[0, : len(areas)]
            planned = coverage * areas  # of faces; people whom drones count come after these
            rendered = renderer.pixels(robot, pose.t, pose.state)
            unhidden = renderer.unhidden(robot, pose.t, pose.state)
            for f in np.flatnonzero((planned > 0) | (rendered > 0)).tolist():
                area = float(areas[f])
                yield cls(pose, f, area, float(planned[f]), float(rendered[f]), float(unhidden[f]))
            progress(done + 1, len(poses))

    @property
    def hidden(self) -> bool:
        """True if something hides a part of what would be in the image."""
        return self.rendered < self.unhidden

    @property
    def error(self) -> float:
        """Returns (planned - rendered) / rendered; infinite where it is not in the picture."""
        return (self.planned - self.rendered) / self.rendered if self.rendered else math.inf

    @staticmethod
    def reward(problem: Problem, views: "Iterable[FaceView]", reward_moves: float) -> float:
        """Returns J of a plan with its rendered pixels in place of the planned ones.

        Parameters
        ----------
        reward_moves : the plan's rewards for moves
        """
        seen: dict[tuple[int, int], float] = {}
        for view in views:
            if view.pose.t >= problem.first_step:
                t = 0 if problem.objective.over_time else view.pose.t
                seen[t, view.face] = seen.get((t, view.face), 0.0) + view.rendered / view.area
        weights = problem.step_weights
        return math.fsum([*(weights[key] * math.sqrt(z) for key, z in seen.items()), reward_moves])

    @staticmethod
    def errors(views: "Sequence[FaceView]") -> Record:
        """Returns errors of planned pixels against rendered ones, in % of these.

        Faces count that have LEAST_PIXELS or more by plan or in the picture. Of one that is planned
        and not in the picture the error is infinite.
        """
        row: Record = {"faces": len(views)}
        for name, hidden in (("clear", False), ("hidden", True)):
            errors = [
                100 * abs(v.error) for v in views
                if v.hidden == hidden and max(v.planned, v.rendered) >= LEAST_PIXELS
            ]  # fmt: skip
            row[name] = len(errors)
            for word, quantile in _QUANTILES.items():
                # An error that is there: between a finite and an infinite one lies none.
                value = float(np.quantile(errors, quantile, method="higher")) if errors else None
                row[f"{name}, {word} error (%)"] = value
        return row
