"""Pictures of the nodes of CoCap's tree on the doorway: paths, conflict, constraints."""

from collections.abc import Iterable

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from cocap_opt.experiments.lab.manual.recorded_tree import Closed, RecordedNode
from cocap_opt.experiments.lab.manual.worked import doorway, doorway_tree
from cocap_opt.experiments.lab.manual.worked_words import number
from cocap_opt.pictures.style import AMBER, GREY, LABEL, RED, SMALL, TITLE, WIDTH, new_canvas
from cocap_opt.problem import (
    Cell,
    Conflict,
    PassConflict,
    Plan,
    Problem,
    State,
    SwapConflict,
    pictures,
)

COLOURS = pictures.DRONE_COLOURS
_CELL = 1.0  # inches
_LOW, _HIGH = 0.08, 0.32  # inches, below and above the map
_BANNED = 0.34  # inches, below a map with a closed move
_DISC = 0.105  # cells, radius; a cell has room for four side by side
_ASIDE, _ALONG = 0.2, 0.235  # cells, distances of discs in a cell: of two drones, of two steps
_BESIDE, _PERSON = 3.15, 4.45  # cells, x of the words beside the map, and of the person
_ORDINALS = ("", "first", "second", "third", "fourth", "fifth")


def node_picture(n: int) -> Figure:
    """Draws one node of the doorway's tree."""
    problem, node = doorway(), doorway_tree()[n]
    depth = problem.height_map.shape[1]
    low = _BANNED if any(len(ban.cells) > 1 for ban in node.closed) else _LOW
    height = depth * _CELL + low + _HIGH
    figure, ax = new_canvas(WIDTH, height)
    ax.set(xlim=(-0.05, WIDTH / _CELL - 0.05), ylim=(-low / _CELL, depth + _HIGH / _CELL))
    draw_cells(ax, problem)
    _draw_person_beyond(ax, problem)
    _draw_paths(ax, node.plan)
    _draw_closed(ax, node.closed)
    if node.conflict is not None:
        _draw_conflict(ax, node.conflict)
    ax.text(0, depth + 0.1, f"node {n}: J = {number(node.value)}", fontsize=TITLE)
    ax.text(_BESIDE, depth - 0.05, "\n".join(_facts(node)), fontsize=LABEL, va="top",
            linespacing=1.4)  # fmt: skip
    return figure


def draw_cells(ax: Axes, problem: Problem) -> None:
    """Draws the cells of a tiny map; walls are dark."""
    width, depth = problem.height_map.shape
    for x in range(width):
        for y in range(depth):
            wall = problem.height_map.heights[x, y] > 0
            colour = pictures.WALL if wall else pictures.GROUND
            ax.add_patch(Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", lw=1.5))


def _draw_person_beyond(ax: Axes, problem: Problem) -> None:
    """Draws the person closer than they are, with their distance from the map."""
    (actor,) = problem.actors
    x, y = actor.poses[0, :2]
    width = problem.height_map.shape[0]
    ax.annotate("", xy=(_PERSON - 0.05, y), xytext=(width + 0.05, y),
                arrowprops={"arrowstyle": "<|-|>", "color": GREY, "lw": 1, "ls": ":",
                            "shrinkA": 0, "shrinkB": 0})  # fmt: skip
    ax.text((width + _PERSON) / 2, y - 0.06, f"{x - width:g} m", fontsize=SMALL, color=GREY,
            ha="center", va="top")  # fmt: skip
    ax.add_patch(Rectangle((_PERSON, y - 0.25), 0.5, 0.5, color=pictures.PERSON))
    ax.text(_PERSON + 0.25, y + 0.33, "person 0", color=pictures.PERSON, fontsize=LABEL,
            ha="center")  # fmt: skip


def _draw_paths(ax: Axes, plan: Plan) -> None:
    """Draws the drones' paths, with a disc for each step, and its number."""
    for robot, path in enumerate(plan.paths):
        _draw_path(ax, robot, path)


def _draw_path(ax: Axes, robot: int, path: tuple[State, ...]) -> None:
    middle = (len(path) - 1) / 2
    spots = [
        (s.x + 0.5 + (t - middle) * _ALONG, s.y + 0.5 + (0.5 - robot) * 2 * _ASIDE)
        for t, s in enumerate(path)
    ]
    colour = COLOURS[robot]
    ax.plot(*zip(*spots, strict=True), color=colour, lw=1.6, zorder=4)
    x, y = spots[0]
    ax.text(x - _DISC, y + 0.15, f"drone {robot}", color=colour, fontsize=LABEL, zorder=6)
    for t, spot in enumerate(spots):
        draw_disc(ax, spot, _DISC, str(t), colour)


def draw_disc(ax: Axes, spot: tuple[float, float], radius: float, words: str, colour: str) -> None:
    """Draws a disc with a number in it."""
    ax.add_patch(Circle(spot, radius, facecolor=colour, edgecolor="white", lw=0.8, zorder=5))
    ax.text(*spot, words, color="white", fontsize=LABEL, ha="center", va="center_baseline",
            weight="bold", zorder=6)  # fmt: skip


def _facts(node: RecordedNode) -> Iterable[str]:
    """Yields the lines beside a node."""
    yield "never taken" if node.turn is None else f"taken {_ORDINALS[node.turn]} from OPEN"
    if node.conflict is None:
        yield "no conflict: the plan"
    elif isinstance(node.conflict, SwapConflict):
        yield f"conflict: a swap\nafter step {node.conflict.t}"
    else:
        yield f"conflict: one cell\nat step {node.conflict.t}"


def _draw_conflict(ax: Axes, conflict: Conflict) -> None:
    """Draws an amber frame around the cells of a conflict."""
    cells = conflict.moves[0] if isinstance(conflict, PassConflict) else conflict.cells
    x, y = min(cell.x for cell in cells), min(cell.y for cell in cells)
    width = max(cell.x for cell in cells) - x + 1
    ax.add_patch(Rectangle((x + 0.02, y + 0.02), width - 0.04, 0.96, fill=False, edgecolor=AMBER,
                           lw=3.5, zorder=3))  # fmt: skip


def _draw_closed(ax: Axes, closed: Iterable[Closed]) -> None:
    for ban in closed:
        if len(ban.cells) == 1:
            _draw_closed_cell(ax, ban)
        else:
            _draw_closed_move(ax, ban.robot, ban.t, *ban.cells)


def _draw_closed_cell(ax: Axes, ban: Closed) -> None:
    x, y = ban.cells[0][:2]
    ax.add_patch(Rectangle((x + 0.06, y + 0.06), 0.88, 0.88, fill=False, edgecolor=RED, lw=1.8,
                           ls="--", zorder=3))  # fmt: skip
    words = f"red frame: closed\nto drone {ban.robot} at step {ban.t}"
    ax.text(_BESIDE, y + 1.06, words, color=RED, fontsize=LABEL, va="bottom")


def _draw_closed_move(ax: Axes, robot: int, t: int, tail: Cell, head: Cell) -> None:
    ends = [(cell.x + 0.5, cell.y - 0.12) for cell in (tail, head)]
    ax.add_patch(FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=14, color=RED, ls="--",
                                 lw=1.8, shrinkA=0, shrinkB=0, zorder=7))  # fmt: skip
    words, right = f"forbidden to drone {robot} after step {t}", max(tail.x, head.x) + 0.62
    ax.text(right, tail.y - 0.12, words, color=RED, fontsize=LABEL, va="center")
