"""Pictures of objective, coverage and graph, and of what is left of them."""

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from cocap_opt.experiments.lab.manual import one_face, worked
from cocap_opt.experiments.lab.manual.node_pictures import COLOURS, draw_small_scene
from cocap_opt.experiments.lab.manual.worked_words import number
from cocap_opt.pictures.style import (
    BLUE,
    FADED,
    GREY,
    LABEL,
    RED,
    SMALL,
    TEAL,
    TITLE,
    add_legend,
    new_figure,
    set_frame,
)
from cocap_opt.problem import State, pictures
from cocap_opt.problem.pictures import TopView

_NEAR = (5, 25)  # m, the part of the bottleneck in which people walk


def draw_root() -> Figure:
    """Draws the root, on which the second of two views adds less than the first."""
    figure = new_figure(5, 3.2)
    ax = set_frame(figure.add_subplot())
    first, both = 15.0**2, 15.0**2 + 12.0**2
    pixels = np.linspace(0, 420, 300)
    ax.plot(pixels, np.sqrt(pixels), color=BLUE, lw=2)
    heights = (0.0, np.sqrt(first), np.sqrt(both))
    for at, (low, high), colour, words in zip(
        (first, both), pairwise(heights), COLOURS[:2], ("a view of 225 px/m2", "then one of 144"),
        strict=True,
    ):  # fmt: skip
        ax.plot([at, at], [low, high], color=colour, lw=5, solid_capstyle="butt")
        ax.annotate(f"{words}\nadds {high - low:.2f}", (at, (low + high) / 2), xytext=(8, -4),
                    textcoords="offset points", fontsize=LABEL, color=colour)  # fmt: skip
        ax.plot([0, at], [high, high], color=FADED, lw=0.8, ls=":")
    ax.set(xlim=(0, 560), ylim=(0, 23), xlabel="pixels on the face, all drones together (px/m2)",
           ylabel="reward: the root of them")  # fmt: skip
    return figure


def draw_trap() -> Figure:
    """Draws two plans of the scene in which planning in turn takes the wrong view."""
    figure = new_figure(6.2, 3.6)
    for ax, (words, planner) in zip(
        figure.subplots(2, 1), (("in turn", "sequential"), ("best", "joint")), strict=True
    ):
        result = worked.planned(worked.trap(), planner)
        assert result.plan is not None
        draw_small_scene(ax, worked.trap(), result.plan)
        for robot, path in enumerate(result.plan.paths):
            _draw_look(ax, path[-1], robot)
        ax.set_title(f"{words}: J = {number(result.value)}", fontsize=TITLE)
    return figure


def _draw_look(ax: Axes, state: State, robot: int) -> None:
    """Draws where a drone looks to, with one of four headings."""
    angle = state.heading * np.pi / 2
    x, y = state.x + 0.5, state.y + 0.5
    ends = (x + 0.5 * np.cos(angle), y), (x + 2.2 * np.cos(angle), y + 2.2 * np.sin(angle))
    ax.annotate("", xy=ends[1], xytext=ends[0],
                arrowprops={"arrowstyle": "-|>", "color": COLOURS[robot], "lw": 1.8})  # fmt: skip


def draw_seen_from() -> Figure:
    """Draws how well the best heading of each cell sees one person of the bottleneck."""
    example, t = worked.bottleneck(), worked.middle()
    rewards = worked.seen_from(0)
    figure = new_figure(5, 4.6)
    ax = figure.add_subplot()
    TopView.of(example.problem).draw_map(ax)
    image = ax.imshow(np.where(rewards > 0, rewards, np.nan).T, origin="lower", zorder=1,
                      extent=(*ax.get_xlim(), *ax.get_ylim()), cmap="YlGnBu",
                      vmin=0)  # fmt: skip
    ax.set_ylim(_NEAR)
    for j, actor in enumerate(example.problem.actors):
        ax.plot(*actor.poses[t, :2], marker="o", ms=8, color=pictures.PERSON, mec="black", zorder=4)
        x, y = actor.poses[t, :2].tolist()
        ax.text(x, y, str(j), color="white", fontsize=SMALL - 2, ha="center",
                va="center", zorder=5)  # fmt: skip
    bar = figure.colorbar(image, ax=ax, orientation="horizontal", shrink=0.8)
    bar.set_label("reward of a drone that sees person 0 alone", fontsize=LABEL)
    return figure


def draw_shadow() -> Figure:
    """Draws the front of a person as a drone sees it, and what a column hides of it."""
    scene = one_face.shadow()
    figure = new_figure(4.6, 3.4)
    ax = figure.add_subplot()
    for n, polygon in enumerate(scene.column):
        ax.add_patch(Polygon(polygon, color=pictures.WALL, label="column" if n == 0 else None))
    ax.add_patch(Polygon(scene.face, color="#f3c9cf",
                         label="front of a person, hidden part"))  # fmt: skip
    for n, piece in enumerate(scene.pieces):
        ax.add_patch(Polygon(piece, facecolor=pictures.PERSON, edgecolor="white", lw=1.2,
                             label="visible pieces" if n == 0 else None))  # fmt: skip
    x, y = scene.face.mean(axis=0)
    half = 1.15 * float(np.ptp(scene.face[:, 1]))
    ax.set(xlim=(x - half, x + half), ylim=(y - 0.75 * half, y + 0.75 * half))
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    add_legend(figure, ax, columns=2)
    return figure


def draw_graph() -> Figure:
    """Draws the states of drone 1 at each step, and its best path with and without a constraint."""
    figure = new_figure(5, 5.6)
    axes = figure.subplots(2, 1, sharex=True)
    for ax, n, words in zip(
        axes, (0, 2), ("no constraint", "not in (2, 0) at step 3"), strict=True
    ):
        _draw_graph(ax, n)
        ax.set_title(words, fontsize=TITLE)
        ax.set_ylabel("cell")
    axes[1].set(xlabel="step", xticks=range(worked.doorway().horizon + 1))
    add_legend(figure, axes[1])
    return figure


def _draw_graph(ax: Axes, n: int) -> None:
    node, graph = worked.doorway_tree()[n], worked.doorway_graph()
    cells = sorted({(state.x, state.y) for state, _ in graph}, reverse=True)
    row = {cell: k for k, cell in enumerate(cells)}
    hidden = {(c.cells[0][:2], c.t) for c in node.closed if c.robot == 1}
    for tail, head in graph.edges:
        gone = ((head[0].x, head[0].y), head[1]) in hidden
        rows = [row[state.x, state.y] for state, _ in (tail, head)]
        ax.plot([tail[1], head[1]], rows, color=RED if gone else FADED, lw=1, zorder=1,
                ls=":" if gone else "-", alpha=1 if gone else 0.6)  # fmt: skip
    open_ = [(t, row[s.x, s.y]) for s, t in graph if ((s.x, s.y), t) not in hidden]
    ax.plot(*zip(*open_, strict=True), "o", color="white", mec=GREY, ms=8, zorder=2)
    for cell, t in hidden:
        ax.plot(t, row[cell], "x", color=RED, ms=9, mew=2, zorder=3, label="hidden by a constraint")
    path = [row[state.x, state.y] for state in node.plan.paths[1]]
    ax.plot(range(len(path)), path, "-o", color=COLOURS[1], lw=2.5, ms=8, zorder=3,
            label="best path of drone 1")  # fmt: skip
    ax.set_yticks(range(len(cells)), [f"({x}, {y})" for x, y in cells])
    set_frame(ax, None)


def draw_cells_left() -> Figure:
    """Draws the cells that drones can reach at a step, and those that a better plan may visit."""
    example, t = worked.bottleneck(), worked.middle()
    figure = new_figure(5.2, 4.8)
    ax = figure.add_subplot()
    TopView.of(example.problem).draw_map(ax)
    first, *_, last = worked.stages()
    for cells, colour, words in (
        (first.cells, "#cfe0ec", f"in reach at step {t}"),
        (last.cells, TEAL, "left to better plans"),
    ):
        spots = np.array([example.problem.height_map.centre(*cell) for cell in sorted(cells)])
        ax.set_ylim(_NEAR)
        ax.plot(*spots.T, "s", ms=5.5, color=colour, label=words, zorder=2)
    for j, actor in enumerate(example.problem.actors):
        ax.plot(*actor.poses[t, :2], "o", ms=7, color=pictures.PERSON, mec="black", zorder=4,
                label="people" if j == 0 else None)  # fmt: skip
    add_legend(figure, ax)
    return figure
