"""Pictures of plans at a step, by matplotlib, and figures as files.

Each drawing function takes an axes and returns it.
"""

import io
import math
import textwrap
import warnings
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon, Wedge
from matplotlib.text import Text

from cocap_opt.pictures.gif import gif
from cocap_opt.pictures.style import (
    BLUE,
    LABEL,
    SMALL,
    TITLE,
    WIDTH,
    families_for,
    new_figure,
    set_frame,
)
from cocap_opt.problem import Plan, Problem, pictures
from cocap_opt.problem.apart_numbers import ApartNumbers
from cocap_opt.problem.map_frame import MapFrame
from cocap_opt.problem.pictures import TopView
from cocap_opt.referee import Verdict, check
from cocap_opt.text import counted, printable

_TITLE = 40  # characters of the name of a scene; longer ones are cut
VIEW_LENGTH = 0.2  # length of drawn view cones, relative to the map; cameras see farther
_SPACES = "\n\u00a0\u2009\u202f"
_FRAME_MILLISECONDS = 500
_BELOW = 3  # up to this number, wide panels of a strip are drawn below each other
_PANEL = 3.2  # inches, width of two panels beside each other
_LETTERS = 56  # largest number of letters of a legend in three columns
_DISC = 11  # points, the width of a drone
_TO_COME = "#c9d6df"
PICTURES = (".png", ".pdf", ".svg")


def robot_colour(robot: int) -> tuple[float, float, float, float]:
    """Returns the colour of a robot, the same in every picture; red is kept for people."""
    return to_rgba(pictures.DRONE_COLOURS[robot % len(pictures.DRONE_COLOURS)])


def draw_plan(ax: Axes, problem: Problem, plan: Plan, t: int, frame: MapFrame) -> Axes:
    """Draws the terrain from above, and drones and people at step t with their paths so far."""
    view = TopView.of(problem)
    view.draw_map(ax)
    _draw_robots(ax, problem, plan, t, VIEW_LENGTH * max(frame.size))
    _draw_actors(ax, problem, t)
    _number_people(ax, problem, plan, t)
    ax.set_xlim(frame.low[0], frame.high[0])
    ax.set_ylim(frame.low[1], frame.high[1])
    view.draw_cuts(ax)
    return ax


def _draw_actors(ax: Axes, problem: Problem, t: int) -> Axes:
    """Draws people at step t as filled outlines with their walk so far."""
    for j, actor in enumerate(problem.actors):
        x, y, _, yaw = actor.poses[t]
        colour = pictures.take_colour(int(problem.take_of[j]))
        ax.plot(*actor.poses[: t + 1, :2].T, color=colour, lw=1, ls=":", zorder=3)
        outline = actor.shape.faces()
        base = np.unique(np.concatenate(outline)[:, :2].round(9), axis=0)
        order = np.argsort(np.arctan2(base[:, 1], base[:, 0]))
        c, s = np.cos(yaw), np.sin(yaw)
        corners = base[order] @ np.array([[c, s], [-s, c]]) + [x, y]
        ax.add_patch(Polygon(corners, facecolor=colour, edgecolor="black", lw=0.6, zorder=5))
        ax.plot(x, y, marker="o", color=colour, ms=5, zorder=4)  # for small outlines
        tip = (x + 0.9 * c, y + 0.9 * s)
        arrow = ax.annotate(
            "", xy=tip, xytext=(x, y), zorder=6, annotation_clip=True,
            arrowprops={"arrowstyle": "-|>", "lw": 0.8, "mutation_scale": 7},
        )  # fmt: skip
        arrow.set_in_layout(False)  # people may be far off the map
    return ax


def _number_people(ax: Axes, problem: Problem, plan: Plan, t: int) -> Axes:
    """Writes each person's number beside them at step t, clear of others and of drones."""
    people = np.array([actor.poses[t, :2] for actor in problem.actors]).reshape(-1, 2)
    drones = [problem.height_map.centre(path[t].x, path[t].y) for path in plan.paths]
    colours = [pictures.take_colour(int(take)) for take in problem.take_of]
    bases = [np.concatenate(actor.shape.faces())[:, :2] for actor in problem.actors]
    marks = np.array([np.ptp(base, axis=0).max() for base in bases])
    numbers = ApartNumbers(people, colours, SMALL, np.array(drones), _DISC, marks)
    numbers.set_zorder(9)
    ax.add_artist(numbers)
    return ax


def _draw_robots(ax: Axes, problem: Problem, plan: Plan, t: int, length: float) -> Axes:
    """Draws drones at step t with their paths; a ring marks each start.

    Parameters
    ----------
    length : m, of the cones that show where cameras look
    """
    for i, (robot, path) in enumerate(zip(problem.robots, plan.paths, strict=True)):
        colour = robot_colour(i)
        track = np.array([problem.height_map.centre(state.x, state.y) for state in path])
        ax.plot(*track.T, color=colour, lw=0.8, alpha=0.35, zorder=2)
        ax.plot(*track[: t + 1].T, color=colour, lw=1.8, zorder=4)
        ax.plot(*track[0], marker="o", mfc="none", mec=colour, ms=_DISC, zorder=4)
        yaw = 360 * path[t].heading / robot.motion.headings
        half = np.degrees(robot.camera.half_angle)
        cone = Wedge(
            tuple(track[t]), length, yaw - half, yaw + half, color=colour, alpha=0.18, zorder=1
        )
        ax.add_patch(cone)
        ax.plot(*track[t], marker="o", color=colour, mec="black", mew=0.6, ms=_DISC, zorder=8)
        ax.text(
            track[t, 0],
            track[t, 1],
            str(i),
            color="white",
            fontsize=SMALL,
            weight="bold",
            ha="center",
            va="center_baseline",
            zorder=9,
            clip_on=True,
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
    view = TopView.of(problem, plan)
    frame = view.frame
    width, depth = frame.size
    height = min(max((WIDTH - 0.6) * depth / width, 2.5), 9.0)
    figure = new_figure(WIDTH, height + 1.7)
    top, bottom = figure.subplots(2, 1, height_ratios=[height, 1.1])
    draw_plan(top, problem, plan, t, frame)
    words = f"step {t} of {problem.horizon} ({_told(verdict)})"
    top.set_title(f"{_name(problem)}, {words}", fontsize=TITLE)
    _draw_reward(bottom, verdict, t)
    _draw_meanings(figure, view)
    return figure


def _strip_figure(problem: Problem, plan: Plan, verdict: Verdict, steps: Sequence[int]) -> Figure:
    """Draws top views at several steps, below each other if they are wide and few."""
    view = TopView.of(problem, plan)
    frame = view.frame
    width, depth = frame.size
    columns = 1 if len(steps) <= _BELOW and width > depth else 2
    rows = math.ceil(len(steps) / columns)
    panel = WIDTH - 0.6 if columns == 1 else _PANEL
    height = min(max(panel * depth / width, 1.5), 6.0) + 0.4
    figure = new_figure(panel * columns + 0.6, height * rows + 0.7)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for ax, t in zip(panels, steps, strict=False):
        draw_plan(ax, problem, plan, t, frame)
        ax.set_title(f"step {t}", fontsize=LABEL)
        ax.label_outer()
    for ax in panels[len(steps) :]:
        ax.set_axis_off()
    _draw_meanings(figure, view)
    figure.suptitle(f"{_name(problem)} ({_told(verdict)})", fontsize=TITLE)
    return figure


def _draw_meanings(figure: Figure, view: TopView) -> None:
    """Draws a legend of cells and arrows below a figure, if there are not only obstacles.

    Cells that block the lowest flight height are dark; lighter cells are free there, with a mesh
    above or below.
    """
    shown = view.meanings
    if view.is_cut and 4 in shown:
        shown[4] = pictures.CLOSED, "no-fly zone (arrows: it goes on)"
    if shown.keys() - {2} or view.has_hidden_zones:
        handles: list[Artist] = [
            Patch(color=colour, label=label) for colour, label in shown.values()
        ]
        if view.has_hidden_zones:
            handles.append(Line2D([], [], color=pictures.ZONE, lw=1.0, label=pictures.HIDDEN))
        letters = sum(len(str(handle.get_label())) for handle in handles)
        figure.legend(handles=handles, fontsize=SMALL, loc="outside lower center",
                      ncols=3 if letters <= _LETTERS else 2, frameon=False)  # fmt: skip


def _name(problem: Problem) -> str:
    return textwrap.shorten(problem.name, _TITLE, placeholder=" ..")[:_TITLE]


def _told(verdict: Verdict) -> str:
    """Returns J and the conflicts of a plan in words."""
    conflicts = f", {counted(len(verdict.conflicts), 'conflict')}" if verdict.conflicts else ""
    return f"whole plan: J = {verdict.reward:,.0f}{conflicts}"


def plan_picture(
    problem: Problem, plan: Plan | None, suffix: str, steps: Sequence[int] = ()
) -> bytes:
    """Returns a file that shows a plan at some steps; a GIF file shows them one after the other.

    Parameters
    ----------
    plan : without it, the drones are shown at their starts, or where they may start
    suffix : one of PICTURES, or ``".gif"`` for a plan
    steps : steps to draw (default: the last one; in a GIF file, all)
    """
    if plan is None:
        starts = problem.plot().get_figure(root=True)
        assert starts is not None
        return picture(starts, suffix)
    verdict = check(problem, plan)
    if suffix == ".gif":
        shown = steps or range(problem.horizon + 1)
        drawn = [picture(_plan_figure(problem, plan, verdict, t), ".png") for t in shown]
        return gif(drawn, [_FRAME_MILLISECONDS] * len(drawn))
    if len(steps) > 1:
        return picture(_strip_figure(problem, plan, verdict, steps), suffix)
    (t,) = steps or (problem.horizon,)
    return picture(_plan_figure(problem, plan, verdict, t), suffix)


def picture(figure: Figure, suffix: str) -> bytes:
    """Returns a figure as the content of a file.

    Parameters
    ----------
    suffix : one of PICTURES; text in a PDF stays text
    """
    content = io.BytesIO()
    canvas = FigureCanvasAgg(figure)
    for text in figure.findobj(Text):  # names of scenes and files may contain dollar signs
        text.set_parse_math(False)
        text.set_text(printable(text.get_text(), _SPACES))
        text.set_fontfamily(families_for(text.get_text()))
    with (
        mpl.rc_context({"pdf.fonttype": 42, "text.parse_math": False}),
        warnings.catch_warnings(),
    ):
        warnings.filterwarnings("ignore", "Glyph")  # names may have any letters
        if suffix == ".png":
            # `savefig` would draw twice, first for the layout alone.
            canvas.print_png(content)  # type: ignore[no-untyped-call]
        else:
            figure.savefig(content, format=suffix[1:])
    return content.getvalue()
