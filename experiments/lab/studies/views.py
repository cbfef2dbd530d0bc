"""Errors of planned coverage against rendered coverage."""

from collections.abc import Callable
from typing import Annotated

import numpy as np
from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import Results, markdown, stored_rows
from cocap_opt.experiments.lab.studies.options import Out, Scenes
from cocap_opt.model import Model
from cocap_opt.output.printing import Listing, Record
from cocap_opt.output.rendered import FaceView, Pose
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Clock
from cocap_opt.vision.render import Renderer

_TABLE = "views.csv"
_SEED = 0
_SECONDS_BETWEEN_LINES = 10.0
_CLEAR, _HIDDEN = "clear, 99 % error (%)", "hidden, median error (%)"
_SHOWN = {
    "scene": "scene",
    "clear": "clear",
    "99 %": _CLEAR,
    "largest": "clear, largest error (%)",
    "hidden": "hidden",
    "median": _HIDDEN,
    "90 %": "hidden, 90 % error (%)",
}


def views(
    *,
    scene: Scenes = None,
    poses: Annotated[int, Parameter(help="random poses in each scene")] = 1000,
    out: Out = None,
) -> None:
    """Measures, prints, and writes the table (views.csv)."""
    results, rows = Results.into(out), list[Record]()
    for name in scene or ["corridor", "bottleneck", "passage"]:
        problem = load_scene(name, _SEED)
        chosen = _random_poses(problem, poses)
        found = list(FaceView.all_from(Model(problem), Renderer(problem), chosen, _told(name)))
        rows.append({"scene": problem.name} | FaceView.errors(found))
        results.save(_TABLE, rows)
    shown = [{name: row[key] for name, key in _SHOWN.items()} for row in rows]
    Listing(f"errors (%) of planned pixels, {poses} random poses a scene", shown).print()


def views_in_markdown() -> str:
    """Compares stored planned pixels with rendered ones, face by face."""
    errors = {"median": "half", "90 %": "nine tenths", "99 %": "99 of 100", "largest": "all"}
    return markdown([
        {
            "scene": row["scene"],
            "faces": words,
            "number": row[kind],
            **{
                f"{share} within": f"{float(row[f'{kind}, {error} error (%)']):.2g} %"
                for error, share in errors.items()
            },
        }
        for kind, words in (("clear", "in full view"), ("hidden", "partly hidden"))
        for row in stored_rows(_TABLE)
    ])  # fmt: skip


def _random_poses(problem: Problem, count: int) -> list[Pose]:
    """Returns poses of random robots at random steps, with some face in view."""
    rng, model = np.random.default_rng(_SEED), Model(problem)
    poses = []
    for robot in rng.integers(len(problem.robots), size=count).tolist():
        robot_class = model.class_of[robot]
        nodes = model.coverage(robot_class).nodes
        t, state = divmod(int(rng.choice(nodes)), robot_class.graph.n_states)
        poses.append(Pose(robot, t, robot_class.graph.state(state)))
    return poses


def _told(scene: str) -> Callable[[int, int], None]:
    """Makes a function that occasionally prints how many views are rendered."""
    clock = Clock()

    def tell(done: int, total: int) -> None:
        nonlocal clock
        if clock.seconds > _SECONDS_BETWEEN_LINES:
            clock = Clock()
            say(f"{scene}: view {done}/{total}")

    return tell
