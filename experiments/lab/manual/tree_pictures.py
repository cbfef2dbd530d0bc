"""Trees: how the concepts follow from each other, CoCap's tree, the tree of a proof."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch

from cocap_opt.experiments.lab.manual import worked
from cocap_opt.experiments.lab.manual.worked_words import number, told_resource
from cocap_opt.formulations.certificates import Branch
from cocap_opt.pictures.style import (
    AMBER,
    BLUE,
    FADED,
    GREY,
    LABEL,
    SMALL,
    TEAL,
    WIDTH,
    new_canvas,
)

_Spot = tuple[float, float]

_WAY = {"arrowstyle": "-|>", "color": GREY, "lw": 1.2, "shrinkA": 0, "shrinkB": 0}
_MARGIN = 0.1  # inches, around pictures and within boxes

# Boxes of the overview: words, column and row; rows count from the bottom.
_BOXES = {
    "scene": ("a scene:\nmap, walks, drones, rules", (0.5, 4)),
    "graph": ("time-expanded graph:\nwhere a drone can be", (0, 3)),
    "coverage": ("coverage:\nwhat it sees there", (1, 3)),
    "planner": ("a planner:\nCoCap, and others", (0, 2)),
    "bound": ("relaxations, envelopes,\nbranch-and-price", (1, 2)),
    "plan": ("a plan\nand its value J", (0, 1)),
    "certificate": ("a certificate\nand its bound B", (1, 1)),
    "gap": ("the gap:\n(B - J) / B", (0.5, 0)),
}
_ARROWS = (
    ("scene", "graph"), ("scene", "coverage"), ("graph", "planner"), ("coverage", "planner"),
    ("graph", "bound"), ("coverage", "bound"), ("planner", "plan"), ("bound", "certificate"),
    ("plan", "gap"), ("certificate", "gap"),
)  # fmt: skip
_COLUMN, _ROW = 2.7, 1.0  # inches, from box to box of the overview


class _Box(NamedTuple):
    """A box in a picture, in inches."""

    centre: _Spot
    size: tuple[float, float]

    @property
    def left(self) -> float:
        """The place of its left side."""
        return self.centre[0] - self.size[0] / 2

    def draw(self, ax: Axes, words: str, colour: str) -> None:
        """Draws the box with words in it."""
        (x, y), (width, height) = self.centre, self.size
        ax.add_patch(FancyBboxPatch(
            (x - width / 2 + _MARGIN, y - height / 2 + _MARGIN), width - 2 * _MARGIN,
            height - 2 * _MARGIN, boxstyle=f"round,pad={_MARGIN}", facecolor="white",
            edgecolor=colour, lw=2, zorder=2,
        ))  # fmt: skip
        ax.text(x, y, words, fontsize=LABEL, ha="center", va="center", zorder=3)


def draw_overview() -> Figure:
    """Draws how the concepts follow from each other."""
    size = 2.3, 0.56
    low = size[1] / 2 + _MARGIN
    figure, ax = new_canvas(WIDTH, 4 * _ROW + 2 * low)
    left = (WIDTH - _COLUMN) / 2
    boxes = {
        name: _Box((left + column * _COLUMN, low + row * _ROW), size)
        for name, (_, (column, row)) in _BOXES.items()
    }
    for name, box in boxes.items():
        box.draw(ax, _BOXES[name][0], BLUE)
    for tail, head in _ARROWS:
        (x, y), (u, v) = boxes[tail].centre, boxes[head].centre
        aside = np.clip((u - x) / 4, -0.7, 0.7)
        ax.annotate("", xy=(u - aside, v + size[1] / 2 + 0.04),
                    xytext=(x + aside, y - size[1] / 2 - 0.02), arrowprops=_WAY)  # fmt: skip
    return figure


def draw_tree() -> Figure:
    """Draws CoCap's tree on the doorway: J of each node, and when it is taken."""
    nodes = worked.doorway_tree()
    places = _places([node.parent for node in nodes])
    size, step = (1.25, 0.75), (1.62, 1.35)
    deepest = max(depth for _, depth in places)
    low = size[1] / 2 + _MARGIN
    figure, ax = new_canvas(WIDTH, deepest * step[1] + 2 * low)
    leaves = max(column for column, _ in places)
    left = (WIDTH - leaves * step[0]) / 2
    boxes = [
        _Box((left + column * step[0], low + (deepest - depth) * step[1]), size)
        for column, depth in places
    ]
    for n, (box, node) in enumerate(zip(boxes, nodes, strict=True)):
        if node.parent is not None:
            _draw_branch(ax, boxes[node.parent], box, _told(n))
        colour = TEAL if node.conflict is None and node.turn else AMBER if node.turn else FADED
        turn = f"taken: {node.turn}" if node.turn else "never taken"
        box.draw(ax, f"node {n}\nJ = {number(node.value)}\n{turn}", colour)
    return figure


def _told(n: int) -> str:
    """Describes which robot gives way in a node, and how."""
    new = worked.doorway_tree()[n].closed
    before = worked.doorway_tree()[worked.doorway_tree()[n].parent or 0].closed
    (added,) = [closed for closed in new if closed not in before]
    return f"drone {added.robot}\ngives way"


def _draw_branch(ax: Axes, parent: _Box, child: _Box, words: str) -> None:
    (x, y), (u, v) = parent.centre, child.centre
    ax.plot([x, u], [y, v], color=GREY, lw=1.2, zorder=1)
    middle = (y - parent.size[1] / 2 + v + child.size[1] / 2) / 2
    ax.text(x + (u - x) * (y - middle) / (y - v), middle, words, fontsize=SMALL, color=GREY,
            ha="center", va="center", zorder=1.5,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 1})  # fmt: skip


def _places(parents: list[int | None]) -> list[_Spot]:
    """Returns column and depth of a tree's nodes: leaves side by side, parents above children."""
    children = _children(parents)
    places: dict[int, _Spot] = {}
    leaves = iter(range(len(parents)))

    def place(n: int, depth: int) -> float:
        below = [place(child, depth + 1) for child in children[n]]
        column = float(np.mean(below)) if below else float(next(leaves))
        places[n] = (column, float(depth))
        return column

    place(0, 0)
    return [places[n] for n in range(len(parents))]


def _children(parents: list[int | None]) -> list[list[int]]:
    """Returns the children of each node of a tree."""
    return [[n for n, parent in enumerate(parents) if parent == k] for k in range(len(parents))]


def draw_proof_tree() -> Figure:
    """Draws the decisions of a proof as an outline, one row per node, with the leaves' bounds."""
    nodes = worked.proof().file.nodes
    leaves = [n for n, node in enumerate(nodes) if not isinstance(node, Branch)]
    bounds = dict(zip(leaves, worked.proof().bounds, strict=True))
    parents: list[int | None] = [None] * len(nodes)
    sides = {}
    for n, node in enumerate(nodes):
        if isinstance(node, Branch):
            parents[node.at_most] = parents[node.at_least] = n
            sides[node.at_most] = f"at most {node.robots}"
            sides[node.at_least] = f"{node.robots + 1} or more"
    order, depths = _outline(parents)
    row, height = 0.66, 0.5
    figure, ax = new_canvas(WIDTH, row * len(nodes) + _MARGIN)
    width = {True: 1.75, False: 1.2}
    indent = (WIDTH - 2 * _MARGIN - width[False]) / max(depths)
    boxes: dict[int, _Box] = {}
    for k, n in enumerate(order):
        node, wide = nodes[n], width[isinstance(nodes[n], Branch)]
        left = _MARGIN + indent * depths[n]
        boxes[n] = _Box((left + wide / 2, row * (len(nodes) - k - 0.5) + _MARGIN / 2),
                        (wide, height))  # fmt: skip
        if (parent := parents[n]) is not None:
            _draw_elbow(ax, boxes[parent], boxes[n], sides[n])
        if isinstance(node, Branch):
            words = f"{n}: how many drones in\n{told_resource(node.resource)}?"
            boxes[n].draw(ax, words, AMBER)
        else:
            boxes[n].draw(ax, f"{n}: leaf\nB = {number(bounds[n])}", TEAL)
    return figure


def _outline(parents: list[int | None]) -> tuple[list[int], list[int]]:
    """Returns the nodes of a tree, each before its children, and their depths."""
    children = _children(parents)
    order, depths, left = list[int](), [0] * len(parents), [0]
    while left:
        n = left.pop()
        order.append(n)
        for child in reversed(children[n]):
            depths[child] = depths[n] + 1
            left.append(child)
    return order, depths


def _draw_elbow(ax: Axes, parent: _Box, child: _Box, words: str) -> None:
    """Draws a line from the bottom of a box down and then right, to the box of an answer."""
    trunk, y = parent.left + 0.12, child.centre[1]
    ax.plot([trunk, trunk, child.left], [parent.centre[1], y, y], color=GREY, lw=1.2, zorder=1)
    ax.text((trunk + child.left) / 2, y + 0.05, words, fontsize=SMALL, color=GREY, ha="center",
            va="bottom")  # fmt: skip
