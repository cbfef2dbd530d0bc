"""Pictures of the nodes of CoCap's tree on the doorway: paths, conflict, constraints."""

from collections.abc import Iterable

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Rectangle

from cocap_opt.experiments.lab.manual.recorded_tree import Closed, RecordedNode
from cocap_opt.experiments.lab.manual.worked import doorway, doorway_tree
from cocap_opt.experiments.lab.manual.worked_words import number
from cocap_opt.pictures.style import AMBER, LABEL, RED, SMALL, TITLE, new_figure
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
_ASIDE, _ALONG = 0.22, 0.19  # m, by which discs of drones and of steps are set apart in a cell
_ORDINALS = ("", "first", "second", "third", "fourth", "fifth")


def draw_small_scene(ax: Axes, problem: Problem, plan: Plan) -> Axes:
    """Draws a tiny scene, its people, and a disc with the step's number for each drone and step."""
    width, depth = problem.height_map.shape
    for x in range(width):
        for y in range(depth):
            wall = problem.height_map.heights[x, y] > 0
            colour = pictures.WALL if wall else pictures.GROUND
            ax.add_patch(Rectangle((x, y), 1, 1, facecolor=colour, edgecolor="white", lw=1.5))
    for j, actor in enumerate(problem.actors):
        x, y = actor.poses[0, :2]
        ax.add_patch(Rectangle((x - 0.5, y - 0.25), 1, 0.5, color=pictures.PERSON))
        ax.text(x, y + 0.33, f"person {j}", color=pictures.PERSON, fontsize=LABEL, ha="center")
    for robot, path in enumerate(plan.paths):
        _draw_path(ax, robot, path)
    people = [actor.poses[0, 0] for actor in problem.actors]
    ax.set(xlim=(min(0, *people) - 0.6, max(width, *people) + 0.6), ylim=(-0.3, depth + 0.05))
    ax.set_aspect("equal")
    ax.axis("off")
    return ax


def _draw_path(ax: Axes, robot: int, path: tuple[State, ...]) -> None:
    middle = (len(path) - 1) / 2
    spots = [
        (s.x + 0.5 + (t - middle) * _ALONG, s.y + 0.5 + (0.5 - robot) * 2 * _ASIDE)
        for t, s in enumerate(path)
    ]
    colour = COLOURS[robot]
    ax.plot(*zip(*spots, strict=True), color=colour, lw=1.2, zorder=4)
    x, y = spots[0]
    ax.text(x - 0.16, y + 0.16, f"drone {robot}", color=colour, fontsize=SMALL, zorder=6)
    for t, spot in enumerate(spots):
        ax.add_patch(Circle(spot, 0.13, facecolor=colour, edgecolor="white", lw=0.6, zorder=5))
        ax.text(*spot, str(t), color="white", fontsize=SMALL - 1, ha="center", va="center_baseline",
                zorder=6)  # fmt: skip


def node_picture(n: int) -> Figure:
    """Draws one node of the doorway's tree."""
    figure = new_figure(4.6, 2.5)
    _draw_node(figure.add_subplot(), n, doorway_tree()[n])
    return figure


def _draw_node(ax: Axes, n: int, node: RecordedNode) -> None:
    draw_small_scene(ax, doorway(), node.plan)
    _draw_closed(ax, node.closed)
    if node.conflict is not None:
        _draw_conflict(ax, node.conflict)
    ax.text(7.5, 2.95, "\n".join(_facts(node)), fontsize=LABEL - 1, ha="right", va="top")
    ax.set_title(f"node {n}: J = {number(node.value)}", fontsize=TITLE, loc="left")


def _facts(node: RecordedNode) -> Iterable[str]:
    """Yields what is said beside a node."""
    yield "never taken" if node.turn is None else f"taken {_ORDINALS[node.turn]} from OPEN"
    if node.conflict is None:
        yield "no conflict: the plan"
    elif isinstance(node.conflict, SwapConflict):
        yield f"conflict: a swap after step {node.conflict.t}"
    else:
        yield f"conflict: one cell at step {node.conflict.t}"


def _draw_conflict(ax: Axes, conflict: Conflict) -> None:
    """Draws an amber frame around the cells of a conflict."""
    cells = conflict.moves[0] if isinstance(conflict, PassConflict) else conflict.cells
    x, y = min(cell.x for cell in cells), min(cell.y for cell in cells)
    width = max(cell.x for cell in cells) - x + 1
    ax.add_patch(Rectangle((x + 0.03, y + 0.03), width - 0.06, 0.94, fill=False, edgecolor=AMBER,
                           lw=3, zorder=3))  # fmt: skip


def _draw_closed(ax: Axes, closed: Iterable[Closed]) -> None:
    for k, ban in enumerate(closed):
        if len(ban.cells) == 1:
            _draw_closed_cell(ax, ban)
        else:
            _draw_closed_move(ax, ban.robot, ban.t, *ban.cells)
        words = f"closed to drone {ban.robot}"
        ax.plot([], [], color=RED, lw=1.5, ls="--", label=words if k == 0 else None)


def _draw_closed_cell(ax: Axes, ban: Closed) -> None:
    x, y = ban.cells[0][:2]
    ax.add_patch(Rectangle((x + 0.09, y + 0.09), 0.82, 0.82, fill=False, edgecolor=RED, lw=1.5,
                           ls="--", zorder=3))  # fmt: skip
    ax.text(x + 1.06, y + 0.62, f"not drone {ban.robot}\nat step {ban.t}", color=RED,
            fontsize=SMALL, va="center")  # fmt: skip


def _draw_closed_move(ax: Axes, robot: int, t: int, tail: Cell, head: Cell) -> None:
    ends = [(cell.x + 0.5, cell.y - 0.15) for cell in (tail, head)]
    ax.add_patch(FancyArrowPatch(*ends, arrowstyle="-|>", mutation_scale=9, color=RED, ls="--",
                                 lw=1.5, zorder=7))  # fmt: skip
    ax.text(3.06, -0.15, f"drone {robot} not this way after step {t}", color=RED,
            fontsize=SMALL, va="center")  # fmt: skip
