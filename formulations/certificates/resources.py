"""Resources: what robots can use at a step, and what using it costs.

Every rule between robots is a row "at most one robot uses this resource"; every branching
decision is a row "at most k" or "at least k + 1 robots use this resource". Whatever the rows,
their multipliers are charges on places, moves and states of one robot's graph, so that
pricing stays value iteration.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import msgspec

from cocap_opt.coordination.constraints import place_of
from cocap_opt.graph.timegraph import Charges
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.problem.problem import Cell, Problem, State

CellPath = tuple[Cell, ...]  # T+1 cells


class _Resource(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    t: int


class Cells(_Resource, frozen=True, tag="cells"):
    """To be in one of these cells at step t."""

    cells: tuple[Cell, ...]
    class_number: int | None = msgspec.field(default=None, name="robot_class")  # None: all robots


class Swap(_Resource, frozen=True, tag="swap"):
    """To move between these two cells, either way, from t to t+1."""

    cells: tuple[Cell, Cell]


class Visit(_Resource, frozen=True, tag="visit"):
    """To be in this state at step t, for the robots of one class."""

    state: State
    class_number: int = msgspec.field(name="robot_class")


class Move(_Resource, frozen=True, tag="move"):
    """To move from the first cell to the second from t to t+1, for the robots of one class."""

    cells: tuple[Cell, Cell]
    class_number: int = msgspec.field(name="robot_class")


Resource = Cells | Swap | Visit | Move


class Flight(NamedTuple):
    """A path as resources see it."""

    class_number: int  # its number
    path: Path
    cells: CellPath


def flight_of(model: Model, robot: int, path: Path) -> Flight:
    """A robot's path of state numbers with its cells."""
    robot_class = model.class_of[robot]
    number = model.classes.index(robot_class)
    of, n_places = model.cells[number], robot_class.graph.n_places
    return Flight(number, path, tuple([of[state % n_places] for state in path]))


def uses(model: Model, resource: Resource, flight: Flight) -> bool:
    """Whether a path uses a resource."""
    t, cells = resource.t, flight.cells
    if isinstance(resource, Swap):
        return cells[t] != cells[t + 1] and {cells[t], cells[t + 1]} == set(resource.cells)
    if resource.class_number not in (None, flight.class_number):
        return False
    if isinstance(resource, Cells):
        return cells[t] in resource.cells
    if isinstance(resource, Visit):
        graph = model.classes[flight.class_number].graph
        return flight.path[t] == graph.index(resource.state)
    return (cells[t], cells[t + 1]) == resource.cells


class Footprint(NamedTuple):
    """What a resource is in the graph of one class, at its step."""

    places: tuple[int, ...] = ()
    moves: tuple[tuple[int, int], ...] = ()  # (tail, head) places
    states: tuple[int, ...] = ()


def footprint(model: Model, number: int, resource: Resource) -> Footprint:
    """A resource in the graph of class `number`; empty where it has nothing of it."""
    robot_class = model.classes[number]
    if not isinstance(resource, Swap) and resource.class_number not in (None, number):
        return Footprint()
    if isinstance(resource, Visit):
        return Footprint(states=(robot_class.graph.index(resource.state),))
    places = [place_of(model, robot_class, cell) for cell in resource.cells]
    inside = tuple(place for place in places if place is not None)
    if isinstance(resource, Cells):
        return Footprint(places=inside)
    if len(inside) < 2:
        return Footprint()
    one, other = inside
    return Footprint(moves=((one, other), (other, one))[: 1 + isinstance(resource, Swap)])


def charges_of(model: Model, number: int, costs: Iterable[tuple[Resource, float]]) -> Charges:
    """What resources with these costs charge the robots of class `number`."""
    places: defaultdict[tuple[int, int], float] = defaultdict(float)
    moves: defaultdict[tuple[int, int, int], float] = defaultdict(float)
    states: defaultdict[tuple[int, int], float] = defaultdict(float)
    for resource, cost in costs:
        used = footprint(model, number, resource)
        for place in used.places:
            places[resource.t, place] += cost
        for tail, head in used.moves:
            moves[resource.t, tail, head] += cost
        for state in used.states:
            states[resource.t, state] += cost
    return Charges(dict(places), dict(moves), dict(states))


def violated_rows(
    model: Model, flights: Iterable[tuple[Flight, float]], tolerance: float
) -> list[Cells | Swap]:
    """Resources that a mixture of paths uses more than once, though at most one robot may.

    Parameters
    ----------
    flights : paths and how much of each is used
    tolerance : uses in excess of 1 that are left alone
    """
    problem = model.problem
    if problem.rules.none:
        return []
    occupied: defaultdict[tuple[int, Cell], float] = defaultdict(float)
    crossed: defaultdict[tuple[int, Cell, Cell], float] = defaultdict(float)
    for flight, amount in flights:
        cells = flight.cells
        for t, cell in enumerate(cells):
            occupied[t, cell] += amount
            if t and cells[t - 1] != cell:
                pair = sorted((cells[t - 1], cell))
                crossed[t - 1, pair[0], pair[1]] += amount
    found: list[Cells | Swap] = []
    for t, cell in list(occupied):
        cells = _clique(problem, t, cell, occupied) if problem.rules.separation else (cell,)
        if sum(occupied[t, c] for c in cells) > 1 + tolerance:
            found.append(Cells(t, cells))
    if problem.rules.swap:
        found += [Swap(t, (a, b)) for (t, a, b), used in crossed.items() if used > 1 + tolerance]
    return list(dict.fromkeys(found))


def _clique(
    problem: Problem, t: int, cell: Cell, occupied: Mapping[tuple[int, Cell], float]
) -> CellPath:
    """Cells around `cell` of which any two conflict, the most used first; sorted."""
    near = [c for (step, c) in occupied if step == t and c != cell and problem.too_close(c, cell)]
    clique = [cell]
    for candidate in sorted(near, key=lambda c: (-occupied[t, c], c)):
        if all(problem.too_close(candidate, member) for member in clique):
            clique.append(candidate)
    return tuple(sorted(clique))


def misuse(model: Model, resource: Resource) -> str:
    """What is wrong with a resource read from a file; empty where it exists in this problem."""
    problem = model.problem
    last = problem.horizon - isinstance(resource, (Swap, Move))
    if not 0 <= resource.t <= last:
        return f"t: must be 0..{last}, not {resource.t}"
    if not isinstance(resource, Swap) and resource.class_number is not None:
        if not 0 <= resource.class_number < len(model.classes):
            return f"robot_class: must be 0..{len(model.classes) - 1}, not {resource.class_number}"
        if isinstance(resource, Visit):
            return _misuse_of_state(problem, model.classes[resource.class_number], resource.state)
    width, depth = problem.height_map.shape
    for x, y, layer in resource.cells:
        if not (0 <= x < width and 0 <= y < depth and 0 <= layer < len(problem.layers)):
            return f"cells: ({x}, {y}, {layer}) is outside the map"
    if len(set(resource.cells)) != len(resource.cells):
        return "cells: must differ"
    return ""


def _misuse_of_state(problem: Problem, robot_class: RobotClass, state: State) -> str:
    spec = robot_class.spec
    sizes = (
        *problem.height_map.shape,
        len(spec.motion.layers),
        spec.motion.headings,
        len(spec.camera.tilts),
    )
    inside = all(0 <= value < size for value, size in zip(state, sizes, strict=True))
    return "" if inside else f"state: {tuple(state)} is none of the class's states"


def misruled(problem: Problem, resource: Resource) -> str:
    """Why two robots may use a resource at once; empty where the rules forbid it."""
    if isinstance(resource, Swap):
        return "" if problem.rules.swap else "the scene has no swap rule"
    if not isinstance(resource, Cells) or resource.class_number is not None:
        return "must be cells or a swap, of all robots"
    apart = not all(problem.too_close(a, b) for a in resource.cells for b in resource.cells)
    return "cells: two robots may be in these cells at once" if apart else ""
