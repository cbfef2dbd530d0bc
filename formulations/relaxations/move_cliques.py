"""Cliques of moves: at most one robot makes any of them in a step.

All moves that are at one moment of a step nearer to one point than half the separation are a
clique (`CollisionRules.near_point`).
"""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.resources import MOST_MOVES
from cocap_opt.model import Model
from cocap_opt.problem import Cell
from cocap_opt.problem.rules import Meeting

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
        meeting, found = self._meeting(one, other), dict[_Move, float]()
        for number, robot_class in enumerate(self._model.classes):
            cells = self._model.places.cells[number]
            moves, far = self._model.places.moves_through(robot_class, meeting, one)
            between = ((cells[tail], cells[head]) for tail, head in moves.tolist())
            found |= dict(zip(between, far.tolist(), strict=True))
        nearest = sorted(found, key=lambda move: (found[move], move))[:MOST_MOVES]
        return tuple(sorted(nearest)) if {one, other} <= set(nearest) else (one, other)

    def among(self, one: _Move, other: _Move, tails: FloatArray, heads: FloatArray) -> IntArray:
        """Returns which of some moves [n] are a clique with two of them, by number.

        Parameters
        ----------
        tails, heads : [n, 3] m, where the moves begin and end
        """
        ways = self._meeting(one, other).ways(tails, heads)
        return np.flatnonzero(self._rules.near_point(ways))

    def _meeting(self, one: _Move, other: _Move) -> Meeting:
        ends = zip(one, other, strict=True)
        return self._rules.meeting(*(self._model.problem.positions(cells) for cells in ends))
