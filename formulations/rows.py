"""Conflict rows: linear inequalities that every conflict-free plan obeys.

Each says that at most one robot uses a few cells at a step, or moves between two cells. The
swap row counts both directions: two robots cannot go the same way either, since they would
have left one cell (the swap rule implies the vertex rule).
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from cocap_opt.constraints import place_of
from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import Cell, Problem
from cocap_opt.timegraph import Charges
from formulations.certificate import CellsRow, Row, SwapRow

CellPath = tuple[Cell, ...]  # T+1 cells
Key = tuple[int, frozenset[Cell], bool]  # (t, cells, whether it is a swap)

VIOLATION = 1e-6  # rows that a fractional solution breaks by less are left alone


def uses(key: Key, path: CellPath) -> bool:
    """Whether a path of cells uses a row."""
    t, cells, swap = key
    if not swap:
        return path[t] in cells
    return path[t] != path[t + 1] and {path[t], path[t + 1]} == cells


def broken_rows(problem: Problem, paths: Sequence[CellPath], amounts: Sequence[float]) -> list[Key]:
    """Rows that a fractional mixture of paths breaks.

    Parameters
    ----------
    paths, amounts : cells of each path and how much of it is used
    """
    if problem.rules.none:
        return []
    found: list[Key] = []
    occupied: defaultdict[tuple[int, Cell], float] = defaultdict(float)
    crossed: defaultdict[tuple[int, frozenset[Cell]], float] = defaultdict(float)
    for path, amount in zip(paths, amounts, strict=True):
        for t, cell in enumerate(path):
            occupied[t, cell] += amount
        for t, (tail, head) in enumerate(pairwise(path)):
            if tail != head:
                crossed[t, frozenset((tail, head))] += amount
    for t, cell in list(occupied):
        cells = _clique(problem, t, cell, occupied) if problem.rules.separation else [cell]
        if sum(occupied[t, c] for c in cells) > 1 + VIOLATION:
            found.append((t, frozenset(cells), False))
    if problem.rules.swap:
        found += [(t, pair, True) for (t, pair), sum_ in crossed.items() if sum_ > 1 + VIOLATION]
    return list(dict.fromkeys(found))


def _clique(
    problem: Problem, t: int, cell: Cell, occupied: Mapping[tuple[int, Cell], float]
) -> list[Cell]:
    """Cells around `cell` of which any two conflict, the most used first."""
    near = [c for (step, c) in occupied if step == t and c != cell and problem.too_close(c, cell)]
    clique = [cell]
    for candidate in sorted(near, key=lambda c: (-occupied[t, c], c)):
        if all(problem.too_close(candidate, member) for member in clique):
            clique.append(candidate)
    return clique


def certificate_row(key: Key, multiplier: float) -> Row:
    """The row as it stands in a certificate."""
    t, cells, swap = key
    ordered = tuple(sorted(cells))
    if swap:
        return SwapRow(t, (ordered[0], ordered[1]), multiplier)
    return CellsRow(t, ordered, multiplier)


def row_charges(model: Model, group: RobotClass, rows: Iterable[tuple[Key, float]]) -> Charges:
    """What rows with these multipliers cost a robot of a class."""
    places: defaultdict[tuple[int, int], float] = defaultdict(float)
    moves: defaultdict[tuple[int, int, int], float] = defaultdict(float)
    for (t, cells, swap), multiplier in rows:
        used = [place_of(model, group, cell) for cell in sorted(cells)]
        if not swap:
            for place in used:
                if place is not None:
                    places[t, place] += multiplier
        elif used[0] is not None and used[1] is not None:
            moves[t, used[0], used[1]] += multiplier
            moves[t, used[1], used[0]] += multiplier
    return Charges(dict(places), dict(moves))
