"""Pictures of the objective, of coverage and of the graph, and of the cells that stages leave."""

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from cocap_opt.experiments.lab.manual import one_face, worked
from cocap_opt.experiments.lab.manual.node_pictures import COLOURS, draw_cells, draw_disc
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
    WIDTH,
    add_legend,
    new_canvas,
    new_figure,
    set_frame,
)
from cocap_opt.problem import Plan, pictures
from cocap_opt.problem.pictures import TopView

_TURNS = ((1, 0), (0, 1), (-1, 0), (0, -1))  # the directions of four headings
_HIDDEN = "#f3c9cf"  # colour of the hidden part of a person
_NEAR = (5, 25)  # m, the part of the bottleneck where people walk


def draw_root() -> Figure:
    """Draws the root function, by which the second of two views adds less than the first."""
    figure = new_figure(WIDTH, 3.3)
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
    """Draws two plans of the scene in which planning one drone after another takes a wrong view."""
    figure, ax = new_canvas(WIDTH, 2.8)
    unit, panel = WIDTH / 13.4, 1.48  # inches, of a metre, and of each plan from above
    for k, (words, planner) in enumerate((("planned in turn", "sequential"), ("best", "joint"))):
        result = worked.planned(worked.trap(), planner)
        assert result.plan is not None
        inner = ax.inset_axes((0, (1 - k) * panel, WIDTH, 2.6 * unit), transform=ax.transData)
        inner.set(xlim=(-6.2, 7.2), ylim=(-0.3, 2.3))
        inner.axis("off")
        _draw_trap_plan(inner, result.plan)
        ax.text(WIDTH / 2, (1 - k) * panel + 2.75 * unit, f"{words}: J = {number(result.value)}",
                fontsize=TITLE, ha="center")  # fmt: skip
    return figure


def _draw_trap_plan(ax: Axes, plan: Plan) -> None:
    """Draws drones that turn on the spot, their last directions, and people on both sides."""
    problem = worked.trap()
    draw_cells(ax, problem)
    for j, actor in enumerate(problem.actors):
        x, y = actor.poses[0, :2]
        ax.add_patch(Rectangle((x - 0.5 + (x > 0), y - 0.35), 1, 0.7, color=pictures.PERSON))
        ax.text(x + (x > 0), y + 0.5, f"person {j}", color=pictures.PERSON, fontsize=LABEL,
                ha="center")  # fmt: skip
    for robot, path in enumerate(plan.paths):
        last, x, y = path[-1], path[-1].x + 0.5, path[-1].y + 0.5
        aside, up = _TURNS[last.heading]
        draw_disc(ax, (x, y), 0.3, str(robot), COLOURS[robot])
        ax.annotate("", xy=(x + 4 * aside, y + 4 * up), xytext=(x + 0.3 * aside, y + 0.3 * up),
                    arrowprops={"arrowstyle": "-|>", "color": COLOURS[robot], "lw": 2,
                                "shrinkA": 0, "shrinkB": 0})  # fmt: skip


def draw_seen_from() -> Figure:
    """Draws how well the best heading of each cell sees one person of the bottleneck."""
    example, t = worked.bottleneck(), worked.middle()
    rewards = worked.seen_from(0)
    figure = new_figure(WIDTH, 4.5)
    ax = figure.add_subplot()
    TopView.of(example.problem).draw_map(ax)
    image = ax.imshow(np.where(rewards > 0, rewards, np.nan).T, origin="lower", zorder=1,
                      extent=(*ax.get_xlim(), *ax.get_ylim()), cmap="YlGnBu",
                      vmin=0)  # fmt: skip
    ax.set_ylim(_NEAR)
    for j, actor in enumerate(example.problem.actors):
        ax.plot(
            *actor.poses[t, :2], marker="o", ms=11, color=pictures.PERSON, mec="black", zorder=4
        )
        x, y = actor.poses[t, :2].tolist()
        ax.text(x, y, str(j), color="white", fontsize=SMALL, ha="center",
                va="center", zorder=5)  # fmt: skip
    bar = figure.colorbar(image, ax=ax, orientation="horizontal", shrink=0.8)
    bar.set_label("reward of a drone that sees person 0 alone", fontsize=LABEL)
    return figure


def draw_shadow() -> Figure:
    """Draws a person behind a column, from the side, and as the drone above sees them."""
    figure = new_figure(WIDTH, 5.2)
    side, image = figure.subplots(2, 1, height_ratios=[1, 1.25])
    _draw_side(set_frame(side, None))
    scene = one_face.shadow()
    for polygon in scene.column:
        image.add_patch(Polygon(polygon, color=pictures.WALL))
    image.add_patch(Polygon(scene.face, color=_HIDDEN))
    for piece in scene.pieces:
        image.add_patch(Polygon(piece, facecolor=pictures.PERSON, edgecolor="white", lw=1.2))
    x, y = scene.face.mean(axis=0)
    half = 0.7 * float(np.ptp(scene.face[:, 1]))
    image.set(xlim=(x - 2 * half, x + 2 * half), ylim=(y - half, y + half), xticks=[], yticks=[],
              aspect="equal")  # fmt: skip
    image.set_title("in the drone's image", fontsize=TITLE)
    left, right = scene.face[:, 0].min() - half / 20, scene.face[:, 0].max() + half / 20
    image.text(left - half / 3, y - 0.6 * half, "column", fontsize=LABEL, ha="right")
    image.text(right, y + half / 2, "visible", color=pictures.PERSON, fontsize=LABEL, va="center")
    image.text(left, y - half / 5, "hidden", fontsize=LABEL, ha="right", va="center")
    return figure


def _draw_side(ax: Axes) -> None:
    """Draws drone, column, shadow and person from the side."""
    scene = one_face.shadow()
    (x, _, z), (near, _, foot), (far, _, top) = scene.eye, scene.low, scene.high
    person, head = float(scene.person[0, 0]), float(scene.person[:, 2].max())
    edge = z + (top - z) * (person - x) / (far - x)  # height of the shadow's edge at the person
    end = x + (far - x) * z / (z - top)
    ax.add_patch(Polygon([(far, foot), (far, top), (end, 0)], color=FADED, alpha=0.25, lw=0))
    ax.add_patch(Rectangle((near, foot), far - near, top - foot, color=pictures.WALL))
    ax.plot([x, person], [z, edge], color=GREY, lw=1, ls="--")
    ax.plot([x, person], [z, head], color=GREY, lw=1, ls="--")
    for low, high, colour in ((0, edge, _HIDDEN), (edge, head, pictures.PERSON)):
        ax.plot([person] * 2, [low, high], color=colour, lw=5, solid_capstyle="butt", zorder=3)
    ax.plot(x, z, "o", color=COLOURS[0], ms=10, clip_on=False, zorder=4)
    ax.text(x + 0.4, z + 0.1, "the drone's camera", fontsize=LABEL)
    ax.text(near - 0.2, top / 2, "column", fontsize=LABEL, ha="right", va="center")
    ax.text(far + 0.3, 0.4, "shadow", fontsize=LABEL)
    ax.text(person + 0.3, head, "person", fontsize=LABEL, va="center")
    ax.set(xlim=(x - 0.4, end + 0.4), ylim=(0, z + 0.8), ylabel="z (m)", xlabel="x (m)",
           aspect="equal")  # fmt: skip
    ax.set_title("from the side", fontsize=TITLE)


def draw_graph() -> Figure:
    """Draws the states of drone 1 at each step, and its best path with and without a constraint."""
    figure = new_figure(WIDTH, 5.8)
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
    figure = new_figure(WIDTH, 4.1)
    ax = figure.add_subplot()
    TopView.of(example.problem).draw_map(ax)
    first, *_, last = worked.stages()
    for cells, colour, words in (
        (first.cells, "#cfe0ec", f"within reach at step {t}"),
        (last.cells, TEAL, "where a better plan can still be"),
    ):
        spots = np.array([example.problem.height_map.centre(*cell) for cell in sorted(cells)])
        ax.set_ylim(_NEAR)
        ax.plot(*spots.T, "s", ms=5.5, color=colour, label=words, zorder=2)
    for j, actor in enumerate(example.problem.actors):
        ax.plot(*actor.poses[t, :2], "o", ms=7, color=pictures.PERSON, mec="black", zorder=4,
                label="people" if j == 0 else None)  # fmt: skip
    add_legend(figure, ax, columns=2)
    return figure
