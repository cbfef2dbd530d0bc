"""Flows on arcs, split into paths of robots."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, Path

# In robots: less flow on an arc is none, as solvers that are accurate to 1e-8 leave about as much
# anywhere. Of a robot ten times as much may be missing, since each of its arcs may lack some.
LEAST_USE = 1e-7


def mixture_of_flow(
    model: Model,
    flow: Mapping[Arc, float],
    known: Mapping[tuple[int, Path], Column] = MappingProxyType({}),
) -> Mixture:
    """Returns paths of all robots that a flow splits into, the widest of each robot first.

    The amounts of a robot's paths add up to 1, or to less where the flow runs dry.

    Parameters
    ----------
    flow : number of robots on each arc
    known : columns by robot and path, which need not be made again
    """
    left: dict[tuple[int, int, int], dict[int, float]] = {}
    for arc, amount in flow.items():
        if amount > LEAST_USE:
            left.setdefault((arc.class_number, arc.t, arc.tail), {})[arc.head] = amount
    columns: list[Column] = []
    amounts: list[float] = []
    for robot in range(len(model.problem.robots)):
        number, rest = model.classes.index(model.class_of[robot]), 1.0
        while rest > 10 * LEAST_USE:
            path, amount = _widest(left, number, model.start(robot), model.problem.horizon)
            amount = min(rest, amount)
            if amount <= LEAST_USE:
                break
            for t in range(len(path) - 1):
                left[number, t, path[t]][path[t + 1]] -= amount
            rest -= amount
            column = known.get((robot, path)) or Column.of(model, robot, path)
            columns.append(column)
            amounts.append(amount)
    return Mixture(columns, np.array(amounts))


def _widest(
    left: Mapping[tuple[int, int, int], Mapping[int, float]], number: int, start: int, horizon: int
) -> tuple[Path, float]:
    """Returns a path along the largest flow at each step, and its least; 0 where it runs dry."""
    path, least = [start], np.inf
    for t in range(horizon):
        heads = left.get((number, t, path[-1]), {})
        if not heads:
            return (), 0.0
        head = max(heads, key=lambda state: heads[state])
        least = min(least, heads[head])
        path.append(head)
    return tuple(path), float(least)
