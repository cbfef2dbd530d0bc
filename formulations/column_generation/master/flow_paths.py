"""Splits flows on arcs into paths of robots."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, Path

# Tolerances, in robots. A smaller flow on an arc counts as zero, since solvers with an accuracy of
# 1e-8 leave about that much on any arc. Ten times as much of a robot may be missing, since each of
# its arcs may lack some.
LEAST_USE = 1e-7


class StartChoice(NamedTuple):
    """A start state of a class's robots that have a choice of starts."""

    class_number: int
    start_set: int  # number of their set of starts among those of the class
    state: int

    @classmethod
    def of_arcs(cls, model: Model, arcs: Iterable[Arc]) -> "list[StartChoice]":
        """Returns the choices from which arcs lead on, one set after the other."""
        tails: dict[int, set[int]] = {}
        for arc in arcs:
            if arc.t == 0:
                tails.setdefault(arc.class_number, set()).add(arc.tail)
        return [
            cls(number, k, state)
            for number, robot_class in enumerate(model.classes)
            for k, (starts, _) in enumerate(robot_class.start_sets)
            if len(starts) > 1
            for state in np.intersect1d(starts, [*tails.get(number, ())]).tolist()
        ]


def mixture_of_flow(
    model: Model,
    flow: Mapping[Arc, float],
    known: Mapping[tuple[int, Path], Column] = MappingProxyType({}),
    starting: Mapping[StartChoice, float] | None = None,
) -> Mixture:
    """Returns the paths into which a flow splits, for all robots, each robot's widest path first.

    The amounts of a robot's paths add up to 1, or to less if the flow runs out.

    Parameters
    ----------
    flow : number of robots on each arc
    known : existing columns by robot and path, which are reused
    starting : number of robots that choose each start; None: as many as the flow that leaves it
    """
    left: dict[tuple[int, int, int], dict[int, float]] = {}
    for arc, amount in flow.items():
        if amount > LEAST_USE:
            left.setdefault((arc.class_number, arc.t, arc.tail), {})[arc.head] = amount
    open_ = dict(starting) if starting is not None else _going_on(model, flow)
    columns: list[Column] = []
    amounts: list[float] = []
    for robot in range(len(model.problem.robots)):
        number, rest = model.class_of[robot].number, 1.0
        starts = _starts(model, robot, open_)
        while rest > 10 * LEAST_USE and starts:
            choice = max(starts, key=lambda choice: open_.get(choice, 1.0))
            path, amount = _widest(left, number, choice.state, model.problem.horizon)
            amount = min(rest, amount, open_.get(choice, 1.0))
            if amount <= LEAST_USE:
                break
            for t in range(len(path) - 1):
                left[number, t, path[t]][path[t + 1]] -= amount
            if choice in open_:
                open_[choice] -= amount
            rest -= amount
            column = known.get((robot, path)) or Column.of(model, robot, path)
            columns.append(column)
            amounts.append(amount)
    return Mixture(columns, np.array(amounts))


def _going_on(model: Model, flow: Mapping[Arc, float]) -> dict[StartChoice, float]:
    """Returns the flow that leaves each start; two sets of starts may share a state."""
    leaving: dict[tuple[int, int], float] = {}
    for arc, amount in flow.items():
        if arc.t == 0:
            leaving[arc.leaves] = leaving.get(arc.leaves, 0.0) + amount
    choices = StartChoice.of_arcs(model, flow)
    return {choice: leaving[choice.class_number, choice.state] for choice in choices}


def _starts(model: Model, robot: int, open_: Mapping[StartChoice, float]) -> list[StartChoice]:
    """Returns the starts that a robot may choose and that have flow, or its fixed start."""
    robot_class = model.class_of[robot]
    number = robot_class.number
    of_robot = next(k for k, (_, robots) in enumerate(robot_class.start_sets) if robot in robots)
    starts = model.starts(robot)
    if len(starts) == 1:
        return [StartChoice(number, of_robot, int(starts[0]))]
    return [choice for choice in open_ if choice[:2] == (number, of_robot)]


def _widest(
    left: Mapping[tuple[int, int, int], Mapping[int, float]], number: int, start: int, horizon: int
) -> tuple[Path, float]:
    """Returns a path along the largest flow at each step, and its smallest flow; 0 if the flow runs
    out.
    """
    path, least = [start], np.inf
    for t in range(horizon):
        heads = left.get((number, t, path[-1]), {})
        if not heads:
            return (), 0.0
        head = max(heads, key=lambda state: heads[state])
        least = min(least, heads[head])
        path.append(head)
    return tuple(path), float(least)
