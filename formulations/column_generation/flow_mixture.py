"""The mixture of paths that a flow on arcs splits into."""

from collections.abc import Mapping

import numpy as np

from cocap_opt.formulations.column_generation.columns import Arc, Column
from cocap_opt.formulations.column_generation.mixture import Mixture
from cocap_opt.model import Model, Path

_LEAST_USE = 1e-6  # of a robot, that counts as flow


def flow_mixture(model: Model, flow: Mapping[Arc, float]) -> Mixture:
    """Returns paths of all robots that a flow splits into, the widest of each robot first.

    Parameters
    ----------
    flow : number of robots on each arc
    """
    left: dict[tuple[int, int, int], dict[int, float]] = {}
    for arc, amount in flow.items():
        left.setdefault((arc.class_number, arc.t, arc.tail), {})[arc.head] = amount
    columns: list[Column] = []
    amounts: list[float] = []
    for robot in range(len(model.problem.robots)):
        number, rest = model.classes.index(model.class_of[robot]), 1.0
        while rest > _LEAST_USE:
            path, amount = _widest(left, number, model.start(robot), model.problem.horizon)
            amount = min(rest, amount)
            if amount <= _LEAST_USE:
                break
            for t in range(len(path) - 1):
                left[number, t, path[t]][path[t + 1]] -= amount
            rest -= amount
            columns.append(Column.of(model, robot, path))
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
        head = max(heads, key=lambda one: heads[one])
        least = min(least, heads[head])
        path.append(head)
    return tuple(path), float(least)
