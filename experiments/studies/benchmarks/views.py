"""How far planned coverage is from rendered coverage, and what more sample points cost."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.report.figures import png
from cocap_opt.experiments.results.files import make_folder, save_bytes, save_csv
from cocap_opt.experiments.results.printing import print_table
from cocap_opt.experiments.results.rendered import Pose, error_row, face_views
from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.studies.benchmarks.views_figure import views_figure
from cocap_opt.model import Model
from cocap_opt.problem.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.vision.render import Renderer

SEED = 0
SHOWN = {
    "scene": "scene",
    "samples": "samples",
    "seconds": "seconds",
    "clear": "clear",
    "99 %": "clear, 99 % error (%)",
    "largest": "clear, largest error (%)",
    "hidden": "hidden",
    "median": "hidden, median error (%)",
    "90 %": "hidden, 90 % error (%)",
}


def views(
    scenes: Sequence[str], poses: int, samples: Sequence[int], out: Path | None = None
) -> None:
    """Measure, print, and write the table (views.csv) and the figure (views.png)."""
    make_folder(out)
    rows: list[Row] = []
    for scene in scenes:
        problem = load_scene(scene, SEED)
        some = random_poses(problem, poses)
        renderer = Renderer(problem)
        rendered = list(face_views(Model(problem), renderer, some, _told(scene)))
        for n in samples:
            varied = Model(problem.replace(face_samples=n), use_cache=False)
            begin = time.process_time()
            for robot_class in varied.classes:
                varied.coverage(robot_class)
            seconds = time.process_time() - begin
            planned = _planned(varied, some)
            again = [
                view._replace(planned=float(planned[view.pose][view.face]) * view.area)
                for view in rendered
            ]
            rows.append(
                {"scene": problem.name, "samples": n, "seconds": seconds} | error_row(again)
            )
            if out is not None:
                save_csv(out / "views.csv", rows)
    shown = [{name: row[key] for name, key in SHOWN.items()} for row in rows]
    print_table(f"errors (%) of planned pixels, {poses} random poses a scene", shown)
    if out is not None:
        save_bytes(out / "views.png", png(views_figure(rows)))


def random_poses(problem: Problem, count: int) -> list[Pose]:
    """Poses of random robots at random steps, from which some face is in view."""
    rng, model = np.random.default_rng(SEED), Model(problem)
    poses = []
    for robot in rng.integers(len(problem.robots), size=count).tolist():
        robot_class = model.class_of[robot]
        nodes = model.coverage(robot_class).nodes
        t, state = divmod(int(rng.choice(nodes)), robot_class.graph.n_states)
        poses.append(Pose(robot, t, robot_class.graph.state(state)))
    return poses


def _planned(model: Model, poses: Sequence[Pose]) -> dict[Pose, FloatArray]:
    """Planned coverage of each pose."""
    found = {}
    for pose in poses:
        robot_class = model.class_of[pose.robot]
        state = np.array([robot_class.graph.index(pose.state)])
        found[pose] = model.views(robot_class).coverage(pose.t, state)[0]
    return found


def _told(scene: str) -> Callable[[int, int], None]:
    """Say now and then how far it is."""
    last = time.monotonic()

    def tell(done: int, total: int) -> None:
        nonlocal last
        if time.monotonic() - last > 10:
            last = time.monotonic()
            say(f"{scene}: view {done}/{total}")

    return tell
