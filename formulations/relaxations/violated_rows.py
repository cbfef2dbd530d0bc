"""Separation of conflict rows: the collision rules that a mixture of paths breaks."""

from collections import defaultdict
from collections.abc import Iterable, Mapping

from cocap_opt.formulations.certificates import Cells, Flight, Swap
from cocap_opt.model import Model
from cocap_opt.problem import Cell, Problem


def violated_rows(
    model: Model, flights: Iterable[tuple[Flight, float]], tolerance: float
) -> list[Cells | Swap]:
    """Returns the resources that a mixture of paths uses more than once, though one robot may.

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
) -> tuple[Cell, ...]:
    """Returns a sorted clique of cells with `cell`: any two conflict.

    It grows by the most used cells first.
    """
    near = [c for (step, c) in occupied if step == t and c != cell and problem.too_close(c, cell)]
    clique = [cell]
    for candidate in sorted(near, key=lambda c: (-occupied[t, c], c)):
        if all(problem.too_close(candidate, member) for member in clique):
            clique.append(candidate)
    return tuple(sorted(clique))
