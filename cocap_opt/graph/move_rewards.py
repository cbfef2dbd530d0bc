"""Rewards per move, which robots earn regardless of their views: `Objective` in the form for
planners.

The reward of an edge is the sum of a part for the cell move, a part for the turn, and
`stationarity` for the one edge that changes nothing. Therefore value iteration can still take the
maximum over turns first and then over moves.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.problem import Objective

Shape = tuple[int, ...]  # (headings, pitches, layers, X, Y) of a numbering of states


class Bonuses(NamedTuple):
    """The rewards for one step of one robot, which add up; see `Objective`."""

    stationarity: float = 0.0  # reward for an unchanged state
    keep_cell: float = 0.0
    keep_heading: float = 0.0
    balanced: float = 0.0  # reward for dx + dy = 0

    @classmethod
    def of(cls, objective: Objective) -> "Bonuses":
        """Returns the rewards per move of an objective."""
        return cls(
            objective.stationarity, objective.keep_cell, objective.keep_heading, objective.balanced
        )

    @property
    def none(self) -> bool:
        """True if no step has a reward."""
        return not any(self)

    @property
    def stay(self) -> float:
        """Reward of the step that changes nothing, which earns all of them."""
        return math.fsum(self)

    def of_moves(self, moves: IntArray) -> FloatArray:
        """Returns the part of the rewards [n] that depends on moves [n, 3] (layers, cells x and
        y).
        """
        _, dx, dy = moves.T
        stays = (moves == 0).all(axis=1)
        rewards: FloatArray = self.keep_cell * stays + self.balanced * (dx + dy == 0)
        return rewards

    def of_edges(self, shape: Shape, tails: IntArray | int, heads: IntArray) -> FloatArray:
        """Returns the rewards [n] of the steps between numbered states.

        Parameters
        ----------
        shape : shape of the numbering, `TimeGraph.shape`
        tails : [n] states, or a single state for all steps
        heads : [n] states
        """
        rewards: FloatArray = self.stationarity * (heads == tails)
        if self.keep_cell or self.keep_heading or self.balanced:
            before, after = np.unravel_index(tails, shape), np.unravel_index(heads, shape)
            turn, _, *move = (b - a for a, b in zip(before, after, strict=True))
            rewards += self.of_moves(np.stack(move, axis=1))
            rewards += self.keep_heading * (turn == 0)
        return rewards

    def of_path(self, shape: Shape, path: Sequence[int]) -> float:
        """Returns the reward of all steps along a path of state numbers."""
        if self.none:
            return 0.0
        states = np.array(path, dtype=np.int64)
        return math.fsum(self.of_edges(shape, states[:-1], states[1:]).tolist())


NO_BONUSES = Bonuses()
