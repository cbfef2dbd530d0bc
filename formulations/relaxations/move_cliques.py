"""Cliques of moves: at most one robot makes any of them in a step.

All moves that are at one moment of a step nearer to one point than half the separation are a
clique (`CollisionRules.near_point`).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates import MOST_MOVES
from cocap_opt.model import Model
from cocap_opt.problem import Cell

_Move = tuple[Cell, Cell]


class CliquesOfMoves:
    """The cliques of moves of a problem with a separation."""

    def __init__(self, model: Model) -> None:
        self._model, self._rules = model, model.problem.rules

    def conflicts(self, moves: Sequence[_Move]) -> tuple[BoolArray, BoolArray]:
        """Returns which of several moves of one step [n, n] conflict.

        Returns
        -------
        at all, and between the steps only
        """
        tails, heads = (self._model.problem.positions([m[k] for m in moves]) for k in (0, 1))
        pairs = (tails[:, None], heads[:, None]), (tails[None], heads[None])
        return self._rules.moves_conflict(*pairs), self._rules.conflict_between(*pairs)

    def around(self, one: _Move, other: _Move) -> tuple[_Move, ...]:
        """Returns a clique with two moves in conflict: what passes where these are nearest.

        It has the moves of all classes, those nearest to that point where they are too many.
        """
        point = self._point(one, other)
        model, found = self._model, dict[_Move, float]()
        for number, robot_class in enumerate(model.classes):
            graph, cells = robot_class.graph, model.cells[number]
            tails, heads = graph.moves_past(*point.move, model.problem.cells_apart)
            at = model.positions[number]
            passing, far = self._passing(point, at[tails], at[heads])
            ends = zip(tails[passing].tolist(), heads[passing].tolist(), strict=True)
            moves = ((cells[tail], cells[head]) for tail, head in ends)
            found |= dict(zip(moves, far.tolist(), strict=True))
        nearest = sorted(found, key=lambda move: (found[move], move))[:MOST_MOVES]
        return tuple(sorted(nearest)) if {one, other} <= set(nearest) else (one, other)

    def among(self, one: _Move, other: _Move, tails: FloatArray, heads: FloatArray) -> IntArray:
        """Returns which of some moves [n] are a clique with two of them, by number.

        Parameters
        ----------
        tails, heads : [n, 3] m, where the moves begin and end
        """
        return self._passing(self._point(one, other), tails, heads)[0]

    def _point(self, one: _Move, other: _Move) -> "_Point":
        """Returns the point in the middle between two moves, when they are nearest."""
        a, b, c, d = self._model.problem.positions([*one, *other])
        share = float(self._rules.closest(c - a, d - b).share)
        (x, y, _), (u, v, _) = one
        middle = ((1 - share) * (a + c) + share * (b + d)) / 2
        return _Point(middle, share, ((x, y), (u, v)))

    def _passing(
        self, point: "_Point", tails: FloatArray, heads: FloatArray
    ) -> tuple[IntArray, FloatArray]:
        """Returns which moves pass nearer to a point than half the separation, and how near (m)."""
        ways = (1 - point.share) * tails + point.share * heads - point.middle
        near, far = self._rules.near_point(ways), np.linalg.norm(ways, axis=1)
        passing = np.flatnonzero(near)
        return passing, far[passing]


class _Point(NamedTuple):
    """A point at a moment of a step, near which moves pass."""

    middle: FloatArray  # [3] m
    share: float  # of the step
    move: tuple[tuple[int, int], tuple[int, int]]  # one of those that pass, from cell to cell
