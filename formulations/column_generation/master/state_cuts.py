"""Separates state cuts for view sums that robots see from many cells."""

import math
from collections import defaultdict
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from cocap_opt.compiling import Kernel
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Curve
from cocap_opt.formulations.certificates.format import MOST_STATES
from cocap_opt.formulations.certificates.state_cuts import CutByStates, ListedStates, pixels_of
from cocap_opt.formulations.column_generation.parameters import StateCutParameters
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.model import Model
from cocap_opt.problem import Cell

# without it there are no state cuts
KERNEL = Kernel(
    "cocap_opt.formulations.column_generation.master.state_cut_kernel", "state cuts",
    compiling=6.0,
)  # fmt: skip
_ALIKE = 1e-6  # relative to the largest root: roots in one cell that differ by less are equal


def state_cut(
    model: Model, view_sum: int, seen: Seen, known: float, least: float,
    parameters: StateCutParameters,
) -> CutByStates | None:  # fmt: skip
    """Returns the state cut that is tightest, or nearly tightest, at a mixture.

    All states that see the view sum from the mixture's cells are listed, unless the price of other
    states is lower.

    Parameters
    ----------
    known, least : height of the known cuts at the mixture, and the amount by which the new cut must
        be lower; otherwise None is returned
    """
    from cocap_opt.formulations.column_generation.master.state_cut_kernel import tightest

    cells, first, roots, amounts = _by_cell(model, seen)
    if len(cells) < 2:
        return None
    unit, values = float(roots.max()), np.zeros(len(roots))
    touching = parameters.touching * float(amounts @ roots**2)
    if not tightest(
        (roots / unit) ** 2, first, np.maximum(amounts, parameters.least_mass),
        touching / unit**2, known / unit, least / unit, parameters.nearly, values,
    ):  # fmt: skip
        return None
    # More pixels never pay less, since the root of the sum grows with them.
    curves = [
        Curve(roots[a:b], np.minimum.accumulate(values[a:b][::-1])[::-1] * unit)
        for a, b in pairwise(first.tolist())
    ]
    slope = 0.5 / math.sqrt(touching)
    listed = {
        number: states
        for number in range(len(model.classes))
        if len((states := _listed(model, number, view_sum, cells, curves, slope)).states)
    }
    cut = CutByStates.valid(model, view_sum, slope, listed)
    return cut if known - seen.height(cut) > least else None


def _by_cell(model: Model, seen: Seen) -> tuple[list[Cell], IntArray, FloatArray, FloatArray]:
    """Returns the distinct roots that robots have from each cell.

    Returns
    -------
    The cells, the position of the first root of each, and the number of roots [cells+1], the roots
    [n], increasing within a cell, and the amount of robots with each [n].
    """
    alike = _ALIKE * float(seen.roots.max())
    amounts: defaultdict[Cell, defaultdict[float, float]] = defaultdict(lambda: defaultdict(float))
    for number, state, root, amount in zip(
        seen.classes.tolist(), seen.states.tolist(), seen.roots.tolist(), seen.amounts.tolist(),
        strict=True,
    ):  # fmt: skip
        place = state % model.classes[number].graph.n_places
        amounts[model.places.cells[number][place]][max(round(root / alike), 1) * alike] += amount
    by_cell = [sorted(of_cell.items()) for of_cell in amounts.values()]
    roots, masses = np.array([entry for of_cell in by_cell for entry in of_cell]).T
    return [*amounts], np.cumsum([0, *map(len, by_cell)]), roots, masses


def _listed(
    model: Model, number: int, view_sum: int, cells: Sequence[Cell], curves: Sequence[Curve],
    slope: float,
) -> ListedStates:  # fmt: skip
    """Returns phi at the states of a class in some cells, where it is below that of other states.

    Between two roots that the mixture has from a cell, phi may be linear, since norms are convex;
    beyond the largest one it grows with the root, which norms do not exceed.
    """
    robot_class = model.classes[number]
    graph = robot_class.graph
    of_cells = [
        (place, curve)
        for cell, curve in zip(cells, curves, strict=True)
        if (place := model.places.place_of(robot_class, cell)) is not None
    ]
    places = np.array([place for place, _ in of_cells], dtype=np.int64)
    turned = np.arange(graph.n_orientations)[:, None] * graph.n_places
    states = (places + turned).T.ravel()
    roots = np.sqrt(pixels_of(model, number, view_sum, states))
    by_place = roots.reshape(len(places), graph.n_orientations)
    values = np.concatenate(
        [np.zeros(0), *(curve(at) for (_, curve), at in zip(of_cells, by_place, strict=True))]
    )
    kept = np.flatnonzero(values < roots * np.minimum(1.0, slope * roots))[:MOST_STATES]
    kept = kept[np.argsort(states[kept])]
    return ListedStates(states[kept], roots[kept], values[kept])
