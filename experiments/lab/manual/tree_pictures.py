"""Trees: how the concepts follow from each other, CoCap's tree, the tree of a proof."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cocap_opt.experiments.lab.manual import worked
from cocap_opt.experiments.lab.manual.worked_words import number, told_resource
from cocap_opt.formulations.certificates import Branch
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    FADED,
    GREY,
    SMALL,
    TEAL,
    new_figure,
)

_WAY = {"arrowstyle": "-|>", "color": GREY, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}

# Boxes of the overview: words, and where they stand.
_BOXES = {
    "scene": ("a scene\nmap, walks, drones, rules", (0.5, 4)),
    "graph": ("time-expanded graph\nwhere a drone can be", (0, 3)),
    "coverage": ("coverage\nwhat it sees there", (1, 3)),
    "planner": ("a planner\nCoCap, and others", (0, 2)),
    "bound": ("relaxations, step envelopes,\nbranch-and-price", (1, 2)),
    "plan": ("a plan\nand its value J", (0, 1)),
    "certificate": ("a certificate\nand its bound B", (1, 1)),
    "gap": ("the gap\n(B - J) / B", (0.5, 0)),
}
_ARROWS = (
    ("scene", "graph"), ("scene", "coverage"), ("graph", "planner"), ("coverage", "planner"),
    ("graph", "bound"), ("coverage", "bound"), ("planner", "plan"), ("bound", "certificate"),
    ("plan", "gap"), ("certificate", "gap"),
)  # fmt: skip


def draw_overview() -> Figure:
    """Draws how the concepts follow from each other."""
    figure = new_figure(4.8, 4.4)
    ax = figure.add_subplot()
    for words, spot in _BOXES.values():
        _draw_box(ax, spot, words, BLUE)
    for tail, head in _ARROWS:
        (x, y), (u, v) = _BOXES[tail][1], _BOXES[head][1]
        ax.annotate("", xy=(u + (x - u) / 4, v + 0.3), xytext=(x + (u - x) / 4, y - 0.3),
                    arrowprops=_WAY)  # fmt: skip
    ax.set(xlim=(-0.55, 1.55), ylim=(-0.4, 4.4))
    ax.axis("off")
    return figure


def draw_tree() -> Figure:
    """Draws CoCap's tree on the doorway: J of each node, and when it is taken."""
    nodes = worked.doorway_tree()
    spots = _spots([node.parent for node in nodes])
    figure = new_figure(5, 3.3)
    ax = figure.add_subplot()
    for n, node in enumerate(nodes):
        if node.parent is not None:
            _draw_branch(ax, spots[node.parent], spots[n], _told(n))
        colour = TEAL if node.conflict is None and node.turn else AMBER if node.turn else FADED
        turn = f"taken: {node.turn}" if node.turn else "never taken"
        _draw_box(ax, spots[n], f"node {n}\nJ = {number(node.value)}\n{turn}", colour)
    _frame_tree(ax, spots)
    return figure


def _told(n: int) -> str:
    """Says which robot a node makes give way, and how."""
    new = worked.doorway_tree()[n].closed
    before = worked.doorway_tree()[worked.doorway_tree()[n].parent or 0].closed
    (added,) = [closed for closed in new if closed not in before]
    return f"drone {added.robot}\ngives way"


def _spots(parents: list[int | None]) -> list[tuple[float, float]]:
    """Returns where nodes of a tree stand: leaves side by side, parents above their children."""
    children: dict[int, list[int]] = {n: [] for n in range(len(parents))}
    for n, parent in enumerate(parents):
        if parent is not None:
            children[parent].append(n)
    spots: dict[int, tuple[float, float]] = {}
    leaves = iter(range(len(parents)))

    def place(n: int, depth: int) -> float:
        below = [place(child, depth + 1) for child in children[n]]
        x = float(np.mean(below)) if below else float(next(leaves))
        spots[n] = (x, -float(depth))
        return x

    place(0, 0)
    return [spots[n] for n in range(len(parents))]


def _draw_box(ax: Axes, spot: tuple[float, float], words: str, colour: str) -> None:
    ax.text(*spot, words, fontsize=SMALL, ha="center", va="center", zorder=3,
            bbox={"boxstyle": "round", "facecolor": "white", "edgecolor": colour,
                  "lw": 2})  # fmt: skip


def _draw_branch(
    ax: Axes, parent: tuple[float, float], child: tuple[float, float], words: str
) -> None:
    ax.plot(*zip(parent, child, strict=True), color=GREY, lw=1, zorder=1)
    x, y = np.mean([parent, child], axis=0)
    ax.text(x, y, words, fontsize=SMALL - 1, color=GREY, ha="center", va="center", zorder=2,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip


def _frame_tree(ax: Axes, spots: list[tuple[float, float]]) -> None:
    x, y = np.array(spots).T
    ax.set(xlim=(x.min() - 0.6, x.max() + 0.6), ylim=(y.min() - 0.4, 0.4))
    ax.axis("off")


def draw_proof_tree() -> Figure:
    """Draws the tree of decisions of a proof, with the bounds of its leaves."""
    nodes, bounds = worked.proof().file.nodes, iter(worked.proof().bounds)
    parents: list[int | None] = [None] * len(nodes)
    sides = {}
    for n, node in enumerate(nodes):
        if isinstance(node, Branch):
            parents[node.at_most] = parents[node.at_least] = n
            sides[node.at_most] = f"at most {node.robots}"
            sides[node.at_least] = f"{node.robots + 1} or more"
    spots = _spots(parents)
    figure = new_figure(5.6, 4.6)
    ax = figure.add_subplot()
    for n, node in enumerate(nodes):
        parent = parents[n]
        if parent is not None:
            _draw_branch(ax, spots[parent], spots[n], sides[n])
        if isinstance(node, Branch):
            words = f"{n}: how many drones in\n{told_resource(node.resource)}?"
            _draw_box(ax, spots[n], words, AMBER)
        else:
            _draw_box(ax, spots[n], f"{n}: leaf\nB = {number(next(bounds))}", TEAL)
    _frame_tree(ax, spots)
    return figure
