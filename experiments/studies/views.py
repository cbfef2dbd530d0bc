"""Errors of planned coverage against rendered coverage, and what more sample points cost."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cocap_opt.data import FloatArray
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.report.figures import draw_frame, picture
from cocap_opt.experiments.results.files import make_folder, save_bytes, save_csv
from cocap_opt.experiments.results.printing import Listing, Record
from cocap_opt.experiments.results.rendered import FaceView, Pose
from cocap_opt.model import Model
from cocap_opt.problem import Problem
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Clock
from cocap_opt.vision.render import Renderer

_SEED = 0
_SECONDS_BETWEEN_LINES = 10.0
_CLEAR, _HIDDEN = "clear, 99 % error (%)", "hidden, median error (%)"
_SHOWN = {
    "scene": "scene",
    "samples": "samples",
    "seconds": "seconds",
    "clear": "clear",
    "99 %": _CLEAR,
    "largest": "clear, largest error (%)",
    "hidden": "hidden",
    "median": _HIDDEN,
    "90 %": "hidden, 90 % error (%)",
}
_PANELS = {
    _CLEAR: "faces in full view: 99 % have a smaller error",
    _HIDDEN: "faces partly hidden: half have a smaller error",
}
_COLOURS = ("#30638e", "#d1495b", "#edae49", "#4c956c", "#6a4c93")


def views(
    scenes: Sequence[str], poses: int, samples: Sequence[int], out: Path | None = None
) -> None:
    """Measures, prints, and writes the table (views.csv) and the figure (views.png).

    Parameters
    ----------
    poses : how many random ones of each scene
    samples : numbers of sample points along a triangle of a face
    """
    make_folder(out)
    rows: list[Record] = []
    for scene in scenes:
        problem = load_scene(scene, _SEED)
        some = _random_poses(problem, poses)
        rendered = list(FaceView.all_from(Model(problem), Renderer(problem), some, _told(scene)))
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
                {"scene": problem.name, "samples": n, "seconds": seconds} | FaceView.errors(again)
            )
            if out is not None:
                save_csv(out / "views.csv", rows)
    shown = [{name: row[key] for name, key in _SHOWN.items()} for row in rows]
    Listing(f"errors (%) of planned pixels, {poses} random poses a scene", shown).print()
    if out is not None:
        save_bytes(out / "views.png", picture(_figure(rows), ".png"))


def _random_poses(problem: Problem, count: int) -> list[Pose]:
    """Returns the poses of random robots at random steps, from which some face is in view."""
    rng, model = np.random.default_rng(_SEED), Model(problem)
    poses = []
    for robot in rng.integers(len(problem.robots), size=count).tolist():
        robot_class = model.class_of[robot]
        nodes = model.coverage(robot_class).nodes
        t, state = divmod(int(rng.choice(nodes)), robot_class.graph.n_states)
        poses.append(Pose(robot, t, robot_class.graph.state(state)))
    return poses


def _planned(model: Model, poses: Sequence[Pose]) -> dict[Pose, FloatArray]:
    """Returns the planned coverage [F] of each pose, px/m2."""
    found = {}
    for pose in poses:
        robot_class = model.class_of[pose.robot]
        state = np.array([robot_class.graph.index(pose.state)])
        found[pose] = model.views(robot_class).coverage(pose.t, state)[0]
    return found


def _told(scene: str) -> Callable[[int, int], None]:
    """Makes a function that prints now and then how many views are rendered."""
    clock = Clock()

    def tell(done: int, total: int) -> None:
        nonlocal clock
        if clock.seconds > _SECONDS_BETWEEN_LINES:
            clock = Clock()
            say(f"{scene}: view {done}/{total}")

    return tell


# -- figure -------------------------------------------------------------------------------


def _figure(rows: Sequence[Record]) -> Figure:
    """Draws errors against seconds of coverage, a panel for each kind of faces."""
    figure = Figure(figsize=(9, 3.8), layout="constrained", dpi=130)
    for ax, (key, title) in zip(figure.subplots(1, 2), _PANELS.items(), strict=True):
        _draw_errors(ax, rows, key)
        ax.set_title(title, fontsize=10)
    figure.suptitle(
        "Planned against rendered pixels; numbers: samples along a triangle", fontsize=11
    )
    return figure


def _draw_errors(ax: Axes, rows: Sequence[Record], key: str) -> Axes:
    """Draws a line per scene, a point per number of samples."""
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    for scene, colour in zip(scenes, _COLOURS, strict=False):
        own = [row for row in rows if row["scene"] == scene and row[key] is not None]
        ax.plot([row["seconds"] for row in own], [row[key] for row in own], marker="o", ms=4,
                color=colour, label=scene)  # fmt: skip
        for row in own:
            ax.annotate(str(row["samples"]), (row["seconds"], row[key]), fontsize=7,
                        xytext=(3, 3), textcoords="offset points", color=colour)  # fmt: skip
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    ax.set_xlabel("coverage of the whole scene (s)")
    ax.set_ylabel("error (%)")
    ax.grid(True, lw=0.4, alpha=0.5)
    draw_frame(ax)
    ax.legend(fontsize=8, frameon=False)
    return ax
