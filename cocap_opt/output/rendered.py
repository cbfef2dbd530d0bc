"""Compares planned with rendered coverage: the pixels of each face, and J of a plan's images."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.model import Model
from cocap_opt.output.printing import Record
from cocap_opt.problem import Plan, Problem, State
from cocap_opt.vision.render import Renderer

LEAST_PIXELS = 400  # smallest number of pixels of a face whose error is meaningful
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
    area: float  # area of the face, m2
    planned: float  # pixels by coverage
    rendered: float
    unhidden: float  # rendered without obstructions

    @classmethod
    def all_from(
        cls,
        model: Model,
        renderer: Renderer,
        poses: Sequence[Pose],
        progress: Callable[[int, int], None] = lambda done, total: None,
    ) -> "Iterator[FaceView]":
        """Yields every face that is seen from each pose, in the plan or in the rendered image.

        Parameters
        ----------
        progress : called with the number of finished poses, and the total
        """
        problem = model.problem
        for done, pose in enumerate(poses):
            robot, robot_class = problem.robots[pose.robot], model.class_of[pose.robot]
            state = np.array([robot_class.graph.index(pose.state)])
            areas = renderer.areas(pose.t)
            coverage = model.views(robot_class).coverage(pose.t, state)[0, : len(areas)]
            planned = coverage * areas  # pixels of faces; counted people follow them
            rendered = renderer.pixels(robot, pose.t, pose.state)
            unhidden = renderer.unhidden(robot, pose.t, pose.state)
            for f in np.flatnonzero((planned > 0) | (rendered > 0)).tolist():
                area = float(areas[f])
                yield cls(pose, f, area, float(planned[f]), float(rendered[f]), float(unhidden[f]))
            progress(done + 1, len(poses))

    @property
    def hidden(self) -> bool:
        """True if something hides a part of the face in the image."""
        return self.rendered < self.unhidden

    @property
    def error(self) -> float:
        """Returns (planned - rendered) / rendered; infinite if the face is not in the image."""
        return (self.planned - self.rendered) / self.rendered if self.rendered else math.inf

    @staticmethod
    def reward(problem: Problem, views: "Iterable[FaceView]", reward_moves: float) -> float:
        """Returns J of a plan with rendered instead of planned pixels.

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
        """Returns errors of planned pixels relative to rendered ones, in %.

        Faces with at least LEAST_PIXELS in the plan or in the image count. The error is infinite if
        a face is planned but not in the image.
        """
        row: Record = {"faces": len(views)}
        for name, hidden in (("clear", False), ("hidden", True)):
            errors = [
                100 * abs(v.error) for v in views
                if v.hidden == hidden and max(v.planned, v.rendered) >= LEAST_PIXELS
            ]  # fmt: skip
            row[name] = len(errors)
            for word, quantile in _QUANTILES.items():
                # An actual value: interpolation between a finite and an infinite error is
                # impossible.
                value = float(np.quantile(errors, quantile, method="higher")) if errors else None
                row[f"{name}, {word} error (%)"] = value
        return row
