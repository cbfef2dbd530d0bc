"""Long tables of a scene in CSV: who sees whom from where, and who can move how.

A kind consists of the drones that move and see alike. x, y, layer, heading and tilt are the indices
used in plans; persons and faces are numbered from 0. States that no drone of a kind can reach are
left out. Rows are written in chunks, so no table is ever in memory as text.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, BinaryIO, NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import Model, RobotClass
from cocap_opt.model.coverage_tables import Sight
from cocap_opt.problem import GoalArea, goal_cells

_CHUNK = 50_000  # rows, or states whose moves are all written
_STATE = ("x", "y", "layer", "heading", "tilt")

# a single number applies to all rows
_Columns = Sequence["IntArray | FloatArray | BoolArray | int"]


class LongTable(NamedTuple):
    """A table that represents a part of a scene.

    Attributes
    ----------
    columns : names of the columns
    chunks : yields the rows of a model, column by column
    about : description of a row
    """

    columns: tuple[str, ...]
    chunks: Callable[[Model], Iterator[_Columns]]
    about: str

    def write(self, file: BinaryIO, model: Model) -> int:
        """Writes the table of a model with complete coverage; returns its number of rows."""
        file.write(f"{','.join(self.columns)}\n".encode())
        total = 0
        for chunk in self.chunks(model):
            size = max((len(column) for column in chunk if not isinstance(column, int)), default=1)
            lists = [_listed(column, size) for column in chunk]
            lines = [",".join(map(str, row)) for row in zip(*lists, strict=True)]
            file.write("".join(f"{line}\n" for line in lines).encode())
            total += len(lines)
        return total


def _listed(column: "IntArray | FloatArray | BoolArray | int", size: int) -> list[Any]:
    if isinstance(column, int):
        return [column] * size
    found: list[Any] = (column.astype(np.int64) if column.dtype == np.bool_ else column).tolist()
    return found


def _kinds(model: Model) -> list[RobotClass]:
    """Returns one class of each kind; the position in the list is the kind's number."""
    found: dict[Sight, RobotClass] = {}
    for robot_class in model.classes:
        found.setdefault(robot_class.sight, robot_class)
    return list(found.values())


def _state(graph: TimeGraph, states: IntArray) -> list[IntArray]:
    """Returns the indices x, y, layer, heading and tilt of states [n]."""
    orientations, places = np.divmod(states, graph.n_places)
    layer, x, y = graph.coordinates(places)
    heading, tilt = np.divmod(orientations, graph.shape[1])
    return [x, y, layer, heading, tilt]


def _drones(model: Model) -> Iterator[_Columns]:
    """Yields the starts of each drone, and its goal."""
    kinds = [robot_class.sight for robot_class in _kinds(model)]
    for drone, robot_class in enumerate(model.class_of):
        starts = model.starts(drone)
        goal = robot_class.goal or (-1, -1)
        if isinstance(goal, GoalArea):
            goal = (-2, -2)
        yield [
            drone, np.full(len(starts), kinds.index(robot_class.sight)),
            *_state(robot_class.graph, starts), *goal,
        ]  # fmt: skip


def _goals(model: Model) -> Iterator[_Columns]:
    """Yields the cells in which each drone with a goal may end."""
    for drone, robot_class in enumerate(model.class_of):
        if robot_class.goal is not None:
            x, y = goal_cells(robot_class.goal).T
            yield [drone, x, y]


def _coverage(model: Model) -> Iterator[_Columns]:
    """Yields the pixels of faces from each state at each step."""
    owner = model.problem.face_owner
    first = np.searchsorted(owner, owner)  # the first face of the same person
    for kind, t, state, columns, pixels in _seen(model):
        faces = columns < model.n_faces
        face = columns[faces]
        yield [kind, t[faces], *(index[faces] for index in state), owner[face],
               face - first[face], pixels[faces]]  # fmt: skip


def _views(model: Model) -> Iterator[_Columns]:
    """Yields the people who count as seen from each state at each step."""
    for kind, t, state, columns, _ in _seen(model):
        people = columns >= model.n_faces
        person = columns[people] - model.n_faces
        yield [kind, t[people], *(index[people] for index in state), person]


def _seen(
    model: Model,
) -> Iterator[tuple[int, IntArray, list[IntArray], IntArray, FloatArray]]:
    """Yields views, a chunk of states at a time.

    Returns
    -------
    The kind and, for each entry: step, indices of the state, the face (F or more for a counted
    person), and px/m2
    """
    problem = model.problem
    for kind, robot_class in enumerate(_kinds(model)):
        table, n_states = model.coverage(robot_class), robot_class.graph.n_states
        for first in range(0, len(table.nodes), _CHUNK):
            nodes = table.nodes[first : first + _CHUNK]
            part = slice(table.indptr[first], table.indptr[first + len(nodes)])
            each = np.diff(table.indptr[first : first + len(nodes) + 1])
            t, states = np.divmod(np.repeat(nodes, each), n_states)
            sums, counted = table.view_sums[part], problem.returns.n_roots
            columns = np.where(sums < counted, sums % max(model.n_faces, 1), 0)
            if people := problem.count_weights.shape[1]:
                at = sums >= counted
                columns[at] = model.n_faces + (sums[at] - counted) % people
            yield kind, t, _state(robot_class.graph, states), columns, table.pixels[part]


def _moves(model: Model) -> Iterator[_Columns]:
    """Yields the moves of drones from each place at each step; turns are independent of them."""
    problem = model.problem
    for kind, robot_class in enumerate(_kinds(model)):
        graph = robot_class.graph
        positions = model.places.positions[robot_class.number]
        balanced = np.array([not sum(move[1:]) for move in graph.moves])
        shape = (problem.horizon + 1, graph.n_orientations, graph.n_places)
        reachable = np.asarray(model.reachable(robot_class).reshape(shape).any(axis=1))
        for t in range(problem.horizon):
            places = np.flatnonzero(reachable[t])
            for first in range(0, len(places), max(1, _CHUNK // len(graph.moves))):
                tails = places[first : first + max(1, _CHUNK // len(graph.moves))]
                heads = graph.heads_at(t, tails).T
                at, move = np.nonzero(heads >= 0)
                tail, head = tails[at], heads[at, move]
                layer, x, y = graph.coordinates(tail)
                to_layer, to_x, to_y = graph.coordinates(head)
                metres = np.linalg.norm(positions[head] - positions[tail], axis=1)
                yield [kind, np.full(len(at), t), x, y, layer, to_x, to_y, to_layer,
                       np.round(metres, 9), balanced[move]]  # fmt: skip


def _turns(model: Model) -> Iterator[_Columns]:
    """Yields the headings and tilts to which drones can turn in a step, in any place."""
    for kind, robot_class in enumerate(_kinds(model)):
        graph = robot_class.graph
        pairs = [(a, b) for a, ahead in enumerate(graph.turns) for b in ahead]
        ends = np.array(pairs, dtype=np.int64).T
        yield [kind, *(part for end in ends for part in np.divmod(end, graph.shape[1]))]


TABLES = {
    "drones": LongTable(
        ("drone", "kind", *_STATE, "goal_x", "goal_y"), _drones,
        "a state in which the drone may start; goal -1: it may end anywhere; -2: in one of several "
        "cells",
    ),
    "goals": LongTable(
        ("drone", "x", "y"), _goals, "a cell in which a drone with a goal may end",
    ),
    "coverage": LongTable(
        ("kind", "step", *_STATE, "person", "face", "px_per_m2"), _coverage,
        "a face that a drone of the kind sees from a state, and its coverage",
    ),
    "views": LongTable(
        ("kind", "step", *_STATE, "person"), _views,
        "a person who counts as seen from a state, in a scene with --views",
    ),
    "moves": LongTable(
        ("kind", "step", "x", "y", "layer", "to_x", "to_y", "to_layer", "m", "balanced"), _moves,
        "a place that a drone of the kind can reach one step later; m: its distance; balanced: "
        "1 if dx + dy = 0",
    ),
    "turns": LongTable(
        ("kind", "heading", "tilt", "to_heading", "to_tilt"), _turns,
        "a heading and tilt to which a drone of the kind can turn during any step",
    ),
}  # fmt: skip
