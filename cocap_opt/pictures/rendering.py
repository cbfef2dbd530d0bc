"""Pictures from the drones' cameras, and a table that compares planned and rendered pixels."""

import io
from collections.abc import Callable
from itertools import product
from pathlib import Path

import matplotlib as mpl
import numpy as np
from PIL import Image

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.model import compiled
from cocap_opt.output.files import save_bytes, save_csv
from cocap_opt.output.printing import Record
from cocap_opt.output.rendered import (
    FaceView,
    Pose,
)
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.vision.render import TERRAIN, Renderer

_SKY_COLOUR, _GROUND_COLOUR = (0.80, 0.88, 0.95), (0.62, 0.60, 0.55)


def write_views(
    folder: Path,
    problem: Problem,
    plan: Plan,
    width: int,
    pixel_step: int,
    counter: Callable[[str], Callable[[int, int], None]],
) -> Record:
    """Writes a picture per drone and step, and coverage.csv; returns rewards and errors by name.

    If the scene has takes, there is a picture for each take.

    Parameters
    ----------
    width : px, width of the pictures
    pixel_step : step of the renderer that counts pixels
    counter : takes the name of things, and returns a function to call with the number done
    """
    verdict = check(problem, plan)
    steps = [max(round(Renderer.camera_of(robot).width / width), 1) for robot in problem.robots]
    painters = {step: Renderer(problem, step) for step in set(steps)}
    takes = range(max(len(problem.takes), 1))
    drawn, paint = list(product(Pose.all_of(plan), takes)), counter("picture")
    for number, (pose, take) in enumerate(drawn):
        paint(number, len(drawn))
        painter = painters[steps[pose.robot]]
        picture = painter.picture(problem.robots[pose.robot], pose.t, pose.state, take)
        of_take = f"-take{take}" if problem.takes else ""
        name = folder / f"drone{pose.robot:02d}-step{pose.t:03d}{of_take}.png"
        save_bytes(name, _png(problem, *picture))
    renderer = Renderer(problem, pixel_step)
    poses = Pose.all_of(plan, problem.first_step)
    views = list(FaceView.all_from(compiled(problem), renderer, poses, counter("view")))
    save_csv(
        folder / "coverage.csv", [_csv_row(problem, view) for view in views] or [{"robot": ""}]
    )
    return {
        "reward": verdict.reward,
        "reward_rendered": FaceView.reward(problem, views, verdict.reward_moves),
        **FaceView.errors(views),
    }


def drone_view(problem: Problem, plan: Plan, robot: int, t: int, width: int) -> bytes:
    """Returns the view of a drone at a step as a PNG file.

    Parameters
    ----------
    width : px, approximate width
    """
    spec = problem.robots[robot]
    painter = Renderer(problem, max(round(Renderer.camera_of(spec).width / width), 1))
    return _png(problem, *painter.picture(spec, t, plan.paths[robot][t]))


def _csv_row(problem: Problem, view: FaceView) -> Record:
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


def _png(problem: Problem, faces: IntArray, shade: FloatArray) -> bytes:
    """Returns a PNG file of a picture: people's faces in different colours, terrain shaded."""
    height, width = faces.shape
    image = np.empty((height, width, 3))
    image[:] = _SKY_COLOUR
    light = 0.35 + 0.65 * shade[..., None]
    ground = faces == TERRAIN
    image[ground] = (light * _GROUND_COLOUR)[ground]
    colours = _face_colours(problem)
    if len(colours):
        actors = faces >= 0
        image[actors] = (light * colours[np.maximum(faces, 0)])[actors]
    content = io.BytesIO()
    Image.fromarray((255 * np.clip(image, 0, 1)).astype(np.uint8)).save(content, format="PNG")
    return content.getvalue()


def _face_colours(problem: Problem) -> FloatArray:
    """Returns the colour of every face [F, 3]: the actor's colour in different brightnesses."""
    owners = problem.face_owner.tolist()
    colours = []
    for f, owner in enumerate(owners):
        first = owners.index(owner)
        share = (f - first) / max(owners.count(owner) - 1, 1)
        colours.append((1 - 0.5 * share) * np.array(_actor_colour(owner)) + 0.25 * share)
    return np.array(colours).reshape(-1, 3)


def _actor_colour(actor: int) -> tuple[float, float, float]:
    """Returns the colour of an actor."""
    red, green, blue, _ = mpl.colormaps["tab10"](actor % 10)
    return red, green, blue
