"""Exact searches for the heights of steps, and of moves between two steps, at new prices.

Known joint states and moves are below these heights; the searches find what is higher.
"""

import math
from collections.abc import Mapping, Sequence

from cocap_opt.formulations.certificates.format import (
    MoveConstant,
    Stage,
    StepConstant,
    StepPrices,
)
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing, NotEndedError
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.profitable_moves import (
    HighJointStates,
    Moves,
    ProfitableMoves,
    high_joint_states,
)
from cocap_opt.formulations.column_generation.parameters import MoveParameters
from cocap_opt.formulations.column_generation.step_envelopes.priced_states import CLEARLY
from cocap_opt.formulations.column_generation.step_envelopes.step_searches import StepSearches


class ExactHeights:
    """The heights of steps and of moves, which searches raise from those that are known.

    Parameters
    ----------
    narrowing : the remaining states, at their prices so far
    searches : searches for the highest joint states of steps
    heights : by step, the profit of a known joint state
    profits : by first step, the profit of a known move, or a constant below which none matters
    most_nodes : largest number of nodes that a checker may need for all searches together

    Attributes
    ----------
    heights : by step, so far
    profits : by first step, so far; moves whose search is too long have none in the end
    found : by first step, the moves that the searches have found, best first
    nodes : number of nodes that a checker needs at most for the searches so far
    """

    def __init__(
        self, narrowing: Narrowing, searches: StepSearches, heights: Mapping[int, float],
        profits: Mapping[int, float], most_nodes: int,
    ) -> None:  # fmt: skip
        self._narrowing, self._searches, self._stop = narrowing, searches, searches.search.stop
        self._most_nodes = most_nodes
        self.heights, self.profits = {**heights}, {**profits}
        self._first = [*profits]  # the first step of each move
        self._high: dict[int, HighJointStates] = {}
        self.found: dict[int, Moves] = {}
        self.nodes = 0

    @property
    def _parameters(self) -> MoveParameters:
        return self._searches.search.parameters.moves

    def proved(self, prices: Sequence[StepPrices]) -> tuple[Stage, Narrowing] | None:
        """Returns the stage that sets new prices, with constants that hold at them, and the
        narrowing after it; None if the search of a step is too long.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        # First steps of moves come last, without a limit: how deep their searches go, for the joint
        # states that begin moves, depends on the heights of second steps.
        second_first = sorted(self.heights, key=lambda t: t in self._first)
        lowest = tuple(
            StepConstant(t, -math.inf if t in self._first else self.heights[t])
            for t in second_first
        )
        stage = Stage(tuple(prices), lowest, self._move_constants())
        try:
            after = self._narrowing.after(stage, self._highest, self._highest_move)
        except NotEndedError:
            return None
        constants = tuple(StepConstant(t, height) for t, height in self.heights.items())
        return Stage(stage.prices, constants, self._move_constants()), after

    def _move_constants(self) -> tuple[MoveConstant, ...]:
        return tuple(MoveConstant(t, profit) for t, profit in self.profits.items())

    def _nodes(self) -> int:
        """Returns the number of nodes that the next search may use."""
        return max(min(self._parameters.most_nodes, self._most_nodes - self.nodes), 0)

    def _count(self, nodes: int, times: int = 1) -> None:
        """Counts the nodes of a search for moves, which a checker makes so many times."""
        self.nodes += times * nodes
        self._searches.nodes += nodes

    def _highest(self, _: int, joint: JointStates) -> float:
        """Returns the height of a step; raises NotEndedError."""
        t = joint.t
        if t in self._first and self._has_listed(joint):
            high = float(self._high[t].profits.max(initial=-math.inf))
            self.heights[t] = max(self.heights[t], high)
            return self.heights[t]
        before = self._searches.nodes
        found = self._searches.highest(joint, self.heights[t], self._nodes())
        if found is None:
            raise NotEndedError
        self.nodes += self._searches.nodes - before
        self.heights[t] = found.profit
        return found.profit

    def _has_listed(self, joint: JointStates) -> bool:
        """Lists the joint states of a step that may begin high moves; returns False if that takes
        too many nodes.
        """
        t, most = joint.t, self._nodes()
        searches = MoveSearches(most)
        above = self.profits[t] - self.heights[t + 1] - CLEARLY * abs(self._narrowing.bound)
        above = min(above, self.heights[t])
        try:
            self._high[t] = high_joint_states(
                self._narrowing.model, joint, above, searches, self._stop
            )
        except NotEndedError:
            return False
        # A checker searches twice: for the constant of the step, and for that of the move.
        self._count(most - searches.nodes_left, times=2)
        return True

    def _highest_move(self, k: int, narrowing: Narrowing) -> float:
        """Returns the height of moves between two steps; infinite if the search is too long."""
        t, most = self._first[k], self._nodes()
        searches = MoveSearches(most)
        between = ProfitableMoves(narrowing, t)
        try:
            found = between.above(self.profits[t], searches, self._stop, self._high.get(t))
        except NotEndedError:
            del self.profits[t]
            return math.inf
        self._count(most - searches.nodes_left)
        self.found[t] = found
        self.profits[t] = max(self.profits[t], float(found.profits.max(initial=-math.inf)))
        return self.profits[t]
