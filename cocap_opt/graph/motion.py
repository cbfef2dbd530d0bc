"""Motion of one robot as networkx graphs: the moves and the turns of one step.

Moving and turning do not depend on each other, so the motion graph is the tensor product of
a place graph (cells) and an orientation graph (headings and gimbal pitches), both with
self-loops. Here are the graphs themselves, as networkx has them; `timegraph` compiles the same
moves to arrays for planners and bounds, which need neither edges one by one nor the product.
"""

from __future__ import annotations  # networkx graphs take type arguments in stubs only

from collections.abc import Iterable, Iterator
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar, cast

import networkx as nx
import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.problem import AnyCamera, Motion, Problem, State
from cocap_opt.problem.motion import Move
from cocap_opt.world.columns import Columns
from cocap_opt.world.workspace import Workspace

T = TypeVar("T", bound=np.generic)
Place = tuple[int, int, int]  # (layer, x, y)
Orientation = tuple[int, int]  # (heading, pitch)
if TYPE_CHECKING:
    Graph = nx.DiGraph[Any]


class Window(NamedTuple):
    """A rectangle of cells on the map: x0 <= x < x1, y0 <= y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int

    @classmethod
    def all_of(cls, workspace: Workspace) -> Window:
        """Returns the whole map."""
        return cls(0, 0, *workspace.height_map.shape)

    @classmethod
    def around(cls, cells: Iterable[tuple[int, int]], reach: int, workspace: Workspace) -> Window:
        """Returns the least window that has all cells (x, y), and `reach` more on all sides.

        It ends where the map ends, and cells beyond it count as the nearest of its cells.
        """
        width, depth = workspace.height_map.shape
        at = np.clip(list(cells), 0, [width - 1, depth - 1])
        (x0, y0), (x1, y1) = at.min(axis=0), at.max(axis=0)
        return cls(
            max(int(x0) - reach, 0),
            max(int(y0) - reach, 0),
            min(int(x1) + reach + 1, width),
            min(int(y1) + reach + 1, depth),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of cells along x and y."""
        return self.x1 - self.x0, self.y1 - self.y0

    def covers(self, x: int, y: int) -> bool:
        """Returns True if a cell is in it."""
        return self.x0 <= x < self.x1 and self.y0 <= y < self.y1

    def of(self, values: NDArray[T]) -> NDArray[T]:
        """Returns its part of values [.., X, Y] of the map."""
        part: NDArray[T] = values[..., self.x0 : self.x1, self.y0 : self.y1]
        return part


class _Room(NamedTuple):
    """The solid matter, the altitudes and the limits in a window."""

    free: BoolArray  # [layer, X, Y] true where a robot may be
    altitudes: FloatArray  # [layer, X, Y] m, where it flies
    columns: Columns
    forbidden: Columns  # by no-fly zones and the ceiling


def allowed_moves(
    workspace: Workspace, motion: Motion, window: Window | None = None
) -> Iterator[tuple[Move, BoolArray]]:
    """Yields each move of one step, and an array [layer, X, Y], true where it may begin.

    Parameters
    ----------
    window : the part of the map that robots do not leave, and X x Y its cells; all if not given
    """
    window = window or Window.all_of(workspace)
    room = _Room(
        window.of(motion.free_places(workspace)),
        window.of(workspace.height_map.altitudes(motion.layers)),
        Columns(*map(window.of, workspace.columns)),
        Columns(*map(window.of, workspace.forbidden)),
    )
    for move in motion.moves:
        yield move, _allowed_starts(room, motion, move)


def _allowed_starts(room: _Room, motion: Motion, move: Move) -> BoolArray:
    """Returns an array [layer, X, Y], true for free places from which a move is allowed.

    The cells that it passes must have no solid matter from the lower of its two altitudes to
    the higher, nor within the clearance of these. With corner cutting only the two ends count for
    that. Nothing may be forbidden in between either.
    """
    here, there = room.altitudes, _shifted(room.altitudes, move, np.nan)
    low, high = np.minimum(here, there), np.maximum(here, there)
    allowed = ~np.isnan(there) & _clear(room.forbidden, move, low, high)  # it does not lead out
    if motion.corner_cutting:
        return allowed & room.free & _shifted(room.free, move, False)
    return allowed & _clear(room.columns, move, low - motion.clearance, high + motion.clearance)


def _clear(columns: Columns, move: Move, low: FloatArray, high: FloatArray) -> BoolArray:
    """Returns where the cells that a move passes are empty at altitudes low..high [layer, X, Y]."""
    clear = np.ones(low.shape, dtype=np.bool_)
    if not np.isfinite(columns.high).any() and not np.isfinite(columns.low).any():
        return clear
    for i, j in Motion.swept_cells(*move[1:]):
        below, above = (_shifted(part, (0, i, j), np.nan) for part in columns)
        clear &= ~Columns(below, above).solid(low, high)
    return clear


def _shifted(values: NDArray[T], move: Move, outside: float) -> NDArray[T]:
    """Returns `values` [layer, X, Y] at every place + `move`, and `outside` beyond."""
    result = np.full_like(values, outside)
    source, target = [], []
    for step, size in zip(move, values.shape, strict=True):
        source.append(slice(max(0, step), max(0, size + min(0, step))))
        target.append(slice(max(0, -step), max(0, size - max(0, step))))
    result[tuple(target)] = values[tuple(source)]
    return result


def place_graph(workspace: Workspace, motion: Motion) -> Graph:
    """Returns the directed graph of places (layer, x, y) and moves, self-loops included."""
    graph: Graph = nx.DiGraph()
    for (climb, dx, dy), starts in allowed_moves(workspace, motion):
        graph.add_edges_from(
            ((layer, x, y), (layer + climb, x + dx, y + dy))
            for layer, x, y in np.argwhere(starts).tolist()
        )
    return graph


def _orientation_graph(motion: Motion, camera: AnyCamera) -> Graph:
    """Returns the directed graph of orientations (heading, pitch), self-loops included.

    Headings are a ring, pitches a line.
    """
    graph: Graph = nx.DiGraph()
    for heading, pitch in product(range(motion.headings), range(len(camera.tilts))):
        graph.add_edges_from(
            ((heading, pitch), (next_heading, next_pitch))
            for next_heading in motion.headings_after(heading)
            for next_pitch in motion.pitches_after(pitch, len(camera.tilts))
        )
    return graph


def _motion_graph(problem: Problem, robot: int) -> Graph:
    """Returns the motion graph of one robot; nodes are `State`, an edge is one step."""
    motion, camera = problem.robots[robot].motion, problem.robots[robot].camera
    graph = nx.tensor_product(
        place_graph(problem.workspace, motion), _orientation_graph(motion, camera)
    )
    # The stubs of both functions say Graph where they return the type they are given.
    return cast("Graph", nx.relabel_nodes(graph, {node: _state(*node) for node in graph}))


def _state(place: Place, orientation: Orientation) -> State:
    layer, x, y = place
    return State(x, y, layer, *orientation)


def time_expanded_graph(problem: Problem, robot: int) -> Graph:
    """Returns the time-expanded graph of one robot; nodes (State, t) lie on a path from its start.

    It is the tensor product of the motion graph and the directed path 0..T, pruned to nodes that
    the start reaches and, if there is a goal, that reach the goal. Every planner searches this
    graph; `timegraph.TimeGraph` is its compiled form.
    """
    steps: Graph = nx.path_graph(problem.horizon + 1, create_using=nx.DiGraph)
    graph = cast("Graph", nx.tensor_product(_motion_graph(problem, robot), steps))
    _remove_near_people(graph, problem, robot)
    spec = problem.robots[robot]
    source = (spec.start, 0)
    keep = {source} | nx.descendants(graph, source)
    ends = [node for node in keep if node[1] == problem.horizon and _at_goal(node[0], spec.goal)]
    keep &= set(_reached(graph.reverse(copy=False), ends))
    pruned: Graph = graph.subgraph(keep).copy()
    return pruned


def _remove_near_people(graph: Graph, problem: Problem, robot: int) -> None:
    """Removes the nodes and edges at which a robot is too near to somebody."""

    def near(t: int, *states: State) -> bool:
        at = problem.where(problem.robots[robot], states)
        return any(bool(problem.airspace.near_person(actor, t, *at)) for actor in problem.actors)

    if problem.airspace.people_aside:
        graph.remove_nodes_from([(s, t) for s, t in graph if near(t, s)])
        graph.remove_edges_from([(a, b) for a, b in graph.edges if near(a[1], a[0], b[0])])


def _at_goal(state: State, goal: tuple[int, int] | None) -> bool:
    return goal is None or (state.x, state.y) == goal


def _reached(graph: Graph, sources: list[tuple[State, int]]) -> Iterator[tuple[State, int]]:
    for layer in nx.bfs_layers(graph, sources):
        yield from layer
