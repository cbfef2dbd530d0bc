"""Pictures of plans at a step, by matplotlib, and figures as files.

Each drawing function takes an axes and returns it.
"""

import io
import textwrap
import warnings
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon, Wedge
from matplotlib.text import Text
from PIL import Image

from cocap_opt import drawing
from cocap_opt.experiments.report.style import BLUE, TITLE, families_for, new_figure, set_frame
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import Verdict, check
from cocap_opt.text import printable

_TITLE = 40  # characters of the name of a scene; longer ones are cut
VIEW_LENGTH = 0.2  # of the map, length of view cones as they are drawn; cameras see farther
_SPACES = "\n\u00a0\u2009\u202f"
_FRAME_MILLISECONDS = 500
_TO_COME = "#c9d6df"
PICTURES = (".png", ".pdf", ".svg")


def robot_colour(robot: int) -> tuple[float, float, float, float]:
    """Returns the colour of a robot, the same in every picture; red is kept for people."""
    return to_rgba(drawing.DRONE_COLOURS[robot % len(drawing.DRONE_COLOURS)])


def draw_plan(ax: Axes, problem: Problem, plan: Plan, t: int) -> Axes:
    """Draws the terrain from above, and drones and people at step t with their ways so far."""
    _draw_terrain(ax, problem)
    _draw_robots(ax, problem, plan, t)
    return _draw_actors(ax, problem, t)


def _draw_terrain(ax: Axes, problem: Problem) -> Axes:
    """Draws the terrain from above.

    Cells that block the lowest flight height are dark; lighter cells are free there, with a mesh
    above or below.
    """
    view = problem.top_view()
    view.draw_map(ax)
    words = {
        2: (drawing.WALL, f"blocks {view.height:g} m"),
        1: (drawing.COVERED, "something above or below"),
    }
    shown = {kind: word for kind, word in words.items() if (view.kinds == kind).any()}
    if 1 in shown:
        handles = [Patch(color=colour, label=label) for colour, label in shown.values()]
        ax.legend(handles=handles, fontsize=6, loc="upper right", framealpha=0.8)
    return ax


def _draw_actors(ax: Axes, problem: Problem, t: int) -> Axes:
    """Draws people at step t as filled outlines with their walk so far."""
    for j, actor in enumerate(problem.actors):
        x, y, _, yaw = actor.poses[t]
        ax.plot(*actor.poses[: t + 1, :2].T, color=drawing.PERSON, lw=1, ls=":", zorder=3)
        outline = actor.shape.faces()
        base = np.unique(np.concatenate(outline)[:, :2].round(9), axis=0)
        order = np.argsort(np.arctan2(base[:, 1], base[:, 0]))
        c, s = np.cos(yaw), np.sin(yaw)
        corners = base[order] @ np.array([[c, s], [-s, c]]) + [x, y]
        ax.add_patch(
            Polygon(corners, facecolor=drawing.PERSON, edgecolor="black", lw=0.6, zorder=5)
        )
        tip = (x + 0.9 * c, y + 0.9 * s)
        arrow = ax.annotate(
            "", xy=tip, xytext=(x, y), arrowprops={"arrowstyle": "-|>", "lw": 0.8}, zorder=6,
            annotation_clip=False,
        )  # fmt: skip
        arrow.set_in_layout(False)  # people may be far off the map
        ax.text(
            x, y, str(j), color="white", fontsize=6, ha="center", va="center", zorder=7,
            clip_on=True,
        )  # fmt: skip
    return ax


def _draw_robots(ax: Axes, problem: Problem, plan: Plan, t: int) -> Axes:
    """Draws drones at step t with their view cones and paths; a ring marks each start."""
    length = VIEW_LENGTH * min(problem.height_map.shape) * problem.height_map.resolution
    for i, (robot, path) in enumerate(zip(problem.robots, plan.paths, strict=True)):
        colour = robot_colour(i)
        track = np.array([problem.height_map.centre(state.x, state.y) for state in path])
        ax.plot(*track.T, color=colour, lw=0.8, alpha=0.35, zorder=2)
        ax.plot(*track[: t + 1].T, color=colour, lw=1.8, zorder=4)
        ax.plot(*track[0], marker="o", mfc="none", mec=colour, ms=8, zorder=4)
        yaw = 360 * path[t].heading / robot.motion.headings
        half = np.degrees(robot.camera.half_angle)
        cone = Wedge(
            tuple(track[t]), length, yaw - half, yaw + half, color=colour, alpha=0.18, zorder=1
        )
        ax.add_patch(cone)
        ax.plot(*track[t], marker="o", color=colour, mec="black", mew=0.6, ms=7, zorder=8)
        ax.text(
            track[t, 0],
            track[t, 1],
            str(i),
            color="white",
            fontsize=6,
            ha="center",
            va="center",
            zorder=9,
        )
    return ax


def _draw_reward(ax: Axes, verdict: Verdict, t: int) -> Axes:
    """Draws the view reward of each step, up to step t in a darker colour."""
    steps = np.arange(1, len(verdict.reward_per_step) + 1)
    ax.bar(steps, verdict.reward_per_step, color=[BLUE if s <= t else _TO_COME for s in steps])
    ax.set_xlabel("step")
    ax.set_ylabel("view reward")
    ax.set_xticks(steps[:: max(1, len(steps) // 10)])
    return set_frame(ax, None)


def _plan_figure(problem: Problem, plan: Plan, verdict: Verdict, t: int) -> Figure:
    """Draws the top view at step t above the reward per step."""
    width, depth = problem.height_map.shape
    height = min(max(5.0 * depth / width, 2.5), 9.0)
    figure = new_figure(5.6, height + 1.7)
    top, bottom = figure.subplots(2, 1, height_ratios=[height, 1.1])
    draw_plan(top, problem, plan, t)
    conflicts = f", {len(verdict.conflicts)} conflicts" if verdict.conflicts else ""
    words = f"step {t} of {problem.horizon} (whole plan: J = {verdict.reward:,.0f}{conflicts})"
    name = textwrap.shorten(problem.name, _TITLE, placeholder=" ..")
    top.set_title(f"{name[:_TITLE]}, {words}", fontsize=TITLE)
    _draw_reward(bottom, verdict, t)
    return figure


def plan_picture(problem: Problem, plan: Plan | None, suffix: str) -> bytes:
    """Returns a file that shows a plan: its last step, or in a GIF file all steps.

    Parameters
    ----------
    plan : without it, the drones are shown at their starts
    suffix : one of PICTURES, or of a plan ``".gif"``
    """
    if plan is None:
        starts = problem.plot().get_figure(root=True)
        assert starts is not None
        return picture(starts, suffix)
    verdict = check(problem, plan)
    if suffix != ".gif":
        return picture(_plan_figure(problem, plan, verdict, problem.horizon), suffix)
    return _gif([_plan_figure(problem, plan, verdict, t) for t in range(problem.horizon + 1)])


def picture(figure: Figure, suffix: str) -> bytes:
    """Returns a figure as the content of a file.

    Parameters
    ----------
    suffix : one of PICTURES; text in a PDF stays text
    """
    content = io.BytesIO()
    FigureCanvasAgg(figure)
    for text in figure.findobj(Text):  # names of scenes and files may hold dollar signs
        text.set_parse_math(False)
        text.set_text(printable(text.get_text(), _SPACES))
        text.set_fontfamily(families_for(text.get_text()))
    with (
        mpl.rc_context({"pdf.fonttype": 42, "text.parse_math": False}),
        warnings.catch_warnings(),
    ):
        warnings.filterwarnings("ignore", "Glyph")  # names may have any letters
        figure.savefig(content, format=suffix[1:])
    return content.getvalue()


def _gif(figures: Sequence[Figure]) -> bytes:
    """Returns figures as the frames of a GIF file that repeats."""
    frames = [Image.open(io.BytesIO(picture(figure, ".png"))).convert("RGB") for figure in figures]
    content = io.BytesIO()
    frames[0].save(
        content, format="GIF", save_all=True, append_images=frames[1:], loop=0,
        duration=_FRAME_MILLISECONDS,
    )  # fmt: skip
    return content.getvalue()
