"""Coverage as planned beside coverage as rendered, and pictures of what drones see."""

import io
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from cocap_opt.atomic_write import write_atomically
from cocap_opt.check import check
from cocap_opt.data import FloatArray
from cocap_opt.model import Model, compiled
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem, State
from cocap_opt.render import TERRAIN, Picture, Renderer, pinhole
from experiments.figures import actor_colour
from experiments.files import save_csv, write
from experiments.rows import Row

LEAST_PIXELS = 400  # of a face, for its error to say something
SKY_COLOUR, GROUND_COLOUR = (0.80, 0.88, 0.95), (0.62, 0.60, 0.55)


class Pose(NamedTuple):
    """A robot in a state at a step."""

    robot: int
    t: int
    state: State


class FaceView(NamedTuple):
    """A face in the image of one pose, in pixels."""

    pose: Pose
    face: int
    area: float  # m2, of the face
    planned: float  # as coverage has it
    rendered: float
    unhidden: float  # rendered, were nothing in the way

    @property
    def hidden(self) -> bool:
        """Whether something hides a part of what would be in the image."""
        return self.rendered < self.unhidden

    @property
    def error(self) -> float:
        """(planned - rendered) / rendered; infinite where it is not in the picture at all."""
        return (self.planned - self.rendered) / self.rendered if self.rendered else math.inf


def poses_of(plan: Plan, first_step: int = 0) -> list[Pose]:
    """All poses of a plan, step by step."""
    steps = range(first_step, len(plan.paths[0]))
    return [Pose(i, t, path[t]) for t in steps for i, path in enumerate(plan.paths)]


def face_views(
    model: Model,
    renderer: Renderer,
    poses: Sequence[Pose],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Iterator[FaceView]:
    """Every face that is seen, by plan or in the picture, from each pose."""
    problem = model.problem
    for done, pose in enumerate(poses):
        robot, group = problem.robots[pose.robot], model.class_of[pose.robot]
        state = np.array([group.graph.index(pose.state)])
        planned = model.views(group).coverage(pose.t, state)[0] * renderer.areas(pose.t)
        rendered = renderer.pixels(robot, pose.t, pose.state)
        unhidden = renderer.unhidden(robot, pose.t, pose.state)
        for f in np.flatnonzero((planned > 0) | (rendered > 0)).tolist():
            area = float(renderer.areas(pose.t)[f])
            yield FaceView(pose, f, area, float(planned[f]), float(rendered[f]), float(unhidden[f]))
        progress(done + 1, len(poses))


def rendered_reward(problem: Problem, views: Iterable[FaceView], reward_moves: float) -> float:
    """J of a plan with its rendered pixels in place of the planned ones.

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


def error_row(views: Sequence[FaceView]) -> Row:
    """How far planned pixels are from rendered ones, in % of these.

    Faces count that have LEAST_PIXELS or more by plan or in the picture. Of one that is planned
    and not in the picture the error is infinite.
    """
    row: Row = {"faces": len(views)}
    for name, hidden in (("clear", False), ("hidden", True)):
        errors = [
            100 * abs(v.error) for v in views
            if v.hidden == hidden and max(v.planned, v.rendered) >= LEAST_PIXELS
        ]  # fmt: skip
        row[name] = len(errors)
        for quantile, word in ((0.5, "median"), (0.9, "90 %"), (0.99, "99 %"), (1.0, "largest")):
            # An error that is there: between a finite and an infinite one lies none.
            value = float(np.quantile(errors, quantile, method="higher")) if errors else None
            row[f"{name}, {word} error (%)"] = value
    return row


def write_views(
    folder: Path,
    problem: Problem,
    plan: Plan,
    width: int,
    pixel_step: int,
    progress: Callable[[int, int], None],
) -> Row:
    """Write a picture per robot and step, and coverage.csv; returns what it comes to.

    Parameters
    ----------
    width : px, of the pictures
    pixel_step : of the renderer that counts pixels
    """
    verdict = check(problem, plan)
    steps = [max(round(pinhole(robot).width / width), 1) for robot in problem.robots]
    painters = {step: Renderer(problem, step) for step in set(steps)}
    for pose in poses_of(plan):
        painter = painters[steps[pose.robot]]
        picture = painter.picture(problem.robots[pose.robot], pose.t, pose.state)
        name = folder / f"drone{pose.robot:02d}-step{pose.t:03d}.png"
        content = png(problem, picture)
        write(name, partial(write_atomically, name, content))
    renderer = Renderer(problem, pixel_step)
    poses = poses_of(plan, problem.first_step)
    views = list(face_views(compiled(problem), renderer, poses, progress))
    save_csv(
        folder / "coverage.csv", [_csv_row(problem, view) for view in views] or [{"robot": ""}]
    )
    return {
        "reward": verdict.reward,
        "reward_rendered": rendered_reward(problem, views, verdict.reward_moves),
        **error_row(views),
    }


def _csv_row(problem: Problem, view: FaceView) -> Row:
    actor = int(problem.face_owner[view.face])
    return {
        "robot": view.pose.robot,
        "step": view.pose.t,
        "actor": actor,
        "face": view.face - int(np.searchsorted(problem.face_owner, actor)),
        "planned (px/m2)": view.planned / view.area,
        "rendered (px/m2)": view.rendered / view.area,
        "rendered (px)": view.rendered,
        "unhidden (px)": view.unhidden,
    }


def png(problem: Problem, picture: Picture) -> bytes:
    """A rendered image: actors' faces in colours of their own, the terrain shaded."""
    height, width = picture.faces.shape
    image = np.empty((height, width, 3))
    image[:] = SKY_COLOUR
    light = 0.35 + 0.65 * picture.shade[..., None]
    ground = picture.faces == TERRAIN
    image[ground] = (light * GROUND_COLOUR)[ground]
    colours = face_colours(problem)
    if len(colours):
        actors = picture.faces >= 0
        image[actors] = (light * colours[np.maximum(picture.faces, 0)])[actors]
    content = io.BytesIO()
    Image.fromarray((255 * np.clip(image, 0, 1)).astype(np.uint8)).save(content, format="PNG")
    return content.getvalue()


def face_colours(problem: Problem) -> FloatArray:
    """Colour of every face [F, 3]: the actor's, in a brightness of the face's own."""
    owners = problem.face_owner.tolist()
    colours = []
    for f, owner in enumerate(owners):
        first = owners.index(owner)
        share = (f - first) / max(owners.count(owner) - 1, 1)
        colours.append((1 - 0.5 * share) * np.array(actor_colour(owner)) + 0.25 * share)
    return np.array(colours).reshape(-1, 3)
