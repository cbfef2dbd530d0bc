"""Resources: the cells, swaps, moves and states that robots use at a step, and the prices of their
use.

Every rule between robots is a row "at most one robot uses this resource"; every decision of a
branch-and-price tree is a row "at most k" or "at least k + 1 robots use this resource". The
multipliers of such rows charge places, moves and states of one robot's graph, so that pricing
stays value iteration.

A new kind of resource needs one more class here with its own tag and the same four methods, and a
place in `Resource`.
"""

from collections import defaultdict
from collections.abc import Iterable
from typing import ClassVar, NamedTuple

import msgspec

from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model, PathCells
from cocap_opt.problem import Cell, Problem, State

MOST_MOVES = 2000  # moves of one resource


class _Footprint(NamedTuple):
    """The places, moves and states of one class's graph that make up a resource at its step."""

    places: tuple[int, ...] = ()
    moves: tuple[tuple[int, int], ...] = ()  # (tail, head) places
    states: tuple[int, ...] = ()


class _Resource(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Base of all resources."""

    lasts: ClassVar[int] = 0  # 1 if a move uses the resource, which takes one step; otherwise 0
    t: int

    def used_by(self, model: Model, path: PathCells) -> bool:
        """Returns True if a path uses the resource."""
        raise NotImplementedError

    def footprint(self, model: Model, number: int) -> _Footprint:
        """Returns the part of the graph of class `number` that the resource covers; may be
        empty.
        """
        raise NotImplementedError

    def why_absent(self, model: Model) -> str:
        """Returns the reason why the problem has no such resource; empty if it has it."""
        last = model.problem.horizon - self.lasts
        if not 0 <= self.t <= last:
            return f"t: must be 0..{last}, not {self.t}"
        number, most = getattr(self, "class_number", None), len(model.classes) - 1
        if not (number is None or 0 <= number <= most):
            return f"robot_class: must be 0..{most}, not {number}"
        return _wrong_cells(model.problem, getattr(self, "cells", ()))

    def why_shared(self, problem: Problem) -> str:
        """Returns the reason why two robots may use the resource at once; empty if a rule forbids
        it.
        """
        return "must be cells, a swap or moves of all drones"


class Cells(_Resource, frozen=True, tag="cells"):
    """The resource that a robot uses by being in one of these cells at step t.

    Attributes
    ----------
    type : `cells`
    t : step
    cells : a robot in any of these cells uses the resource
    robot_class : number of the class of robots, from 0; null: all robots
    """

    cells: tuple[Cell, ...]
    class_number: int | None = msgspec.field(default=None, name="robot_class")

    def used_by(self, model: Model, path: PathCells) -> bool:
        """Returns True if a path uses the resource."""
        is_about = self.class_number in (None, path.class_number)
        return is_about and path.cells[self.t] in self.cells

    def footprint(self, model: Model, number: int) -> _Footprint:
        """Returns the places of the cells; empty for classes to which the resource does not
        apply.
        """
        if self.class_number not in (None, number):
            return _Footprint()
        return _Footprint(places=_places(model, number, self.cells))

    def why_shared(self, problem: Problem) -> str:
        """Returns the reason why two robots may be in the cells at once; empty if a rule forbids
        it.
        """
        if self.class_number is not None:
            return "must be cells, a swap or moves of all drones"
        at = problem.positions(self.cells)
        apart = not problem.rules.too_near(at[None] - at[:, None]).all()
        return "cells: two drones may be in these cells at once" if apart else ""


class Swap(_Resource, frozen=True, tag="swap"):
    """The resource that a robot uses by moving between two cells, in either direction, from step t
    to t + 1.

    Attributes
    ----------
    type : `swap`
    t : step at which the move begins
    cells : the two cells
    """

    lasts: ClassVar[int] = 1
    cells: tuple[Cell, Cell]

    def used_by(self, model: Model, path: PathCells) -> bool:
        """Returns True if a path uses the resource."""
        tail, head = path.cells[self.t], path.cells[self.t + 1]
        return tail != head and {tail, head} == set(self.cells)

    def footprint(self, model: Model, number: int) -> _Footprint:
        """Returns the moves between the cells in both directions; empty if one cell is out of
        reach.
        """
        if len(places := _places(model, number, self.cells)) < 2:
            return _Footprint()
        here, there = places
        return _Footprint(moves=((here, there), (there, here)))

    def why_shared(self, problem: Problem) -> str:
        """Returns the reason why two robots may swap the cells; empty if a rule forbids it."""
        return "" if problem.rules.swap else "the scene has no swap rule"


class Moves(_Resource, frozen=True, tag="moves"):
    """The resource that a robot uses by making one of these moves, from step t to t + 1.

    A move goes from the first to the second of two cells; if both are the same, the robot stays in
    place.

    Attributes
    ----------
    type : `moves`
    t : step at which the moves begin
    moves : pairs of cells, each move from the first to the second
    """

    lasts: ClassVar[int] = 1
    moves: tuple[tuple[Cell, Cell], ...]

    def used_by(self, model: Model, path: PathCells) -> bool:
        """Returns True if a path uses the resource."""
        return path.cells[self.t : self.t + 2] in self.moves

    def footprint(self, model: Model, number: int) -> _Footprint:
        """Returns the moves, except those that are out of reach."""
        robot_class = model.classes[number]
        ends = [[model.places.place_of(robot_class, cell) for cell in move] for move in self.moves]
        kept = [(tail, head) for tail, head in ends if tail is not None and head is not None]
        return _Footprint(moves=tuple(kept))

    def why_absent(self, model: Model) -> str:
        """Returns the reason why the problem has no such moves; empty if it has them."""
        if not 0 < len(self.moves) <= MOST_MOVES:
            return f"moves: must be 1..{MOST_MOVES}, not {len(self.moves)}"
        if len(set(self.moves)) < len(self.moves):
            return "moves: must be distinct"
        cells = tuple({cell for move in self.moves for cell in move})
        return super().why_absent(model) or _wrong_cells(model.problem, cells)

    def why_shared(self, problem: Problem) -> str:
        """Returns the reason why two robots may make these moves at once; empty if a rule forbids
        it.
        """
        tails, heads = (problem.positions([move[k] for move in self.moves]) for k in (0, 1))
        rows, columns = (tails[:, None], heads[:, None]), (tails[None], heads[None])
        apart = not problem.rules.moves_conflict(rows, columns).all()
        return "moves: two drones may make these moves at once" if apart else ""


class Visit(_Resource, frozen=True, tag="visit"):
    """The resource that a robot of one class uses by being in this state at step t.

    Attributes
    ----------
    type : `visit`
    t : step
    state : the state
    robot_class : number of the class of robots, from 0
    """

    state: State
    class_number: int = msgspec.field(name="robot_class")

    def used_by(self, model: Model, path: PathCells) -> bool:
        """Returns True if a path uses the resource."""
        if self.class_number != path.class_number:
            return False
        return path.states[self.t] == model.classes[self.class_number].graph.index(self.state)

    def footprint(self, model: Model, number: int) -> _Footprint:
        """Returns the state; empty for other classes."""
        if self.class_number != number:
            return _Footprint()
        return _Footprint(states=(model.classes[number].graph.index(self.state),))

    def why_absent(self, model: Model) -> str:
        """Returns the reason why the class has no such state; empty if it has it."""
        if wrong := super().why_absent(model):
            return wrong
        graph = model.classes[self.class_number].graph
        x, y, *rest = self.state
        sizes = len(graph.motion.layers), *graph.shape[:2]
        inside = all(0 <= value < size for value, size in zip(rest, sizes, strict=True))
        return (
            ""
            if inside and graph.window.covers(x, y)
            else f"state: {tuple(self.state)} is not a state of the class"
        )


class Move(_Resource, frozen=True, tag="move"):
    """The resource that a robot of one class uses by moving from the first cell to the second.

    The move begins at step t and ends at t + 1.

    Attributes
    ----------
    type : `move`
    t : step at which the move begins
    cells : the first and the second cell
    robot_class : number of the class of robots, from 0
    """

    lasts: ClassVar[int] = 1
    cells: tuple[Cell, Cell]
    class_number: int = msgspec.field(name="robot_class")

    def used_by(self, model: Model, path: PathCells) -> bool:
        """Returns True if a path uses the resource."""
        is_about = self.class_number == path.class_number
        return is_about and path.cells[self.t : self.t + 2] == self.cells

    def footprint(self, model: Model, number: int) -> _Footprint:
        """Returns the move; empty for other classes or if one cell is out of reach."""
        if self.class_number != number:
            return _Footprint()
        if len(places := _places(model, number, self.cells)) < 2:
            return _Footprint()
        tail, head = places
        return _Footprint(moves=((tail, head),))


Resource = Cells | Swap | Moves | Visit | Move


def charges_of(model: Model, number: int, costs: Iterable[tuple[Resource, float]]) -> Charges:
    """Returns the charges for robots of class `number`, given the costs of resources."""
    places: defaultdict[tuple[int, int], float] = defaultdict(float)
    moves: defaultdict[tuple[int, int, int], float] = defaultdict(float)
    states: defaultdict[tuple[int, int], float] = defaultdict(float)
    for resource, cost in costs:
        used = resource.footprint(model, number)
        for place in used.places:
            places[resource.t, place] += cost
        for tail, head in used.moves:
            moves[resource.t, tail, head] += cost
        for state in used.states:
            states[resource.t, state] += cost
    return Charges(dict(places), dict(moves), dict(states))


def _places(model: Model, number: int, cells: Iterable[Cell]) -> tuple[int, ...]:
    """Returns the places of cells in the graph of class `number`, without cells outside the
    graph.
    """
    found = [model.places.place_of(model.classes[number], cell) for cell in cells]
    return tuple(place for place in found if place is not None)


def _wrong_cells(problem: Problem, cells: tuple[Cell, ...]) -> str:
    width, depth = problem.height_map.shape
    for x, y, layer in cells:
        if not (0 <= x < width and 0 <= y < depth and 0 <= layer < len(problem.layers)):
            return f"cells: ({x}, {y}, {layer}) is outside the map"
    return "" if len(set(cells)) == len(cells) else "cells: must be distinct"
