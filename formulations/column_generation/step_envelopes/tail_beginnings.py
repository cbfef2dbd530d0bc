"""Finds the joint states with which tails begin: those of a step that lose least there.

How many joint states lose less than an amount is known only after a search, which takes longer than
most explorations from them. So a search collects a number of them: as soon as it has found more, it
goes on with the loss of the last of these, and ends with all joint states that lose less. What it
found is kept for the explorations that follow.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.staged import JointStates, NotEndedError, Tails
from cocap_opt.formulations.certificates.staged.move_searches import (
    Choices,
    MoveSearches,
    TeamMoves,
    nodes_of_move,
)
from cocap_opt.formulations.certificates.staged.reached import Reached
from cocap_opt.formulations.column_generation.parameters import TailParameters
from cocap_opt.stop import Stop

_FEWEST = 100  # how fast the number of joint states grows is estimated from at least so many


@dataclass
class Beginnings:
    """The joint states of a step that lose less than an amount there, as far as they were found.

    Attributes
    ----------
    reached : the joint states; None before a search has ended
    alone : the amount, in units of J
    """

    reached: Reached | None = None
    alone: float = 0.0
    _within: float = math.inf  # amount that a search can be expected to get to
    _most_nodes: int = 0  # number of nodes that searches were allowed

    def extend(
        self, tails: Tails, t: int, alone: float, most_nodes: int, parameters: TailParameters,
        stop: Stop,
    ) -> int:  # fmt: skip
        """Finds all that lose less than an amount, or those that lose least if all take too many
        nodes; returns the number of nodes.

        It also finds some that lose more, so that one search serves several explorations.

        Parameters
        ----------
        t : the step
        alone : the amount
        most_nodes : largest number of nodes of each search

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        if most_nodes > self._most_nodes:
            self._most_nodes, self._within = most_nodes, math.inf
        if alone <= self.alone:
            return 0
        each = nodes_of_move(len(tails.narrowing.model.problem.robots))
        most = max(int(parameters.beginnings * most_nodes / each), 1)
        nodes, goal = 0, min(parameters.ahead * alone, self._within)
        least = max(self.alone, parameters.first_loss * tails.most / parameters.growth**2)
        while goal > least:
            searches = _FewSearches(most_nodes, most=most)
            try:
                self.reached = tails.beginnings(t, goal, searches, stop)
            except NotEndedError:
                nodes += most_nodes
                goal /= parameters.growth**2
                self._within = goal
                continue
            used = most_nodes - searches.nodes_left
            is_over = used > parameters.enough * most_nodes
            self.alone = goal - searches.raised
            self._within = min(self._within, self.alone + (0.0 if is_over else searches.further))
            return nodes + used
        return nodes


@dataclass
class _FewSearches(MoveSearches):
    """Searches that collect only a number of joint states, those that are worth most.

    Attributes
    ----------
    most : the number
    raised : amount by which the floor was raised, since more joint states reach it
    further : amount by which it could be lower, if the number of joint states grows exponentially;
        infinite if there are too few to tell
    """

    most: int = 1
    raised: float = 0.0
    further: float = math.inf

    def found(
        self, joint: JointStates, choices: Choices, floors: FloatArray, stop: Stop
    ) -> Iterator[TeamMoves]:
        """Yields the joint states in blocks, and raises the floor between these."""
        floor, highest = float(floors[0]), np.empty(0)
        for rows, heads in super().found(joint, choices, floors, stop):
            values = joint.worths(heads) - joint.charge[heads].sum(axis=1)
            highest = np.concatenate([highest, values])
            if len(highest) > self.most:
                highest = np.partition(highest, -self.most)[-self.most :]
                floors[0] = max(floors[0], highest[0])
            yield rows, heads
        self.raised = float(floors[0]) - floor
        if len(highest) >= _FEWEST:
            doubles = float(np.median(highest)) - floor
            self.further = doubles * math.log2(self.most / len(highest))
