"""Value iteration over pairs of states: the best paths of two robots together.

Two robots move independently of each other, so that the maximum over pairs of actions is taken
one robot after the other: a step costs S^2 * 2 |A| instead of S^2 |A|^2. The planner `joint`
does this over all places that two robots can reach, column generation over the arcs of a
restricted master. The backward sweep and reading off the paths stand here.
A step back and the rewards of pairs do not: the planner has millions of pairs on a regular grid,
where moves are shifts and the reward is put right face by face where both robots see one;
column generation has some thousands of pairs with any arcs between them, all faces at once.
"""

from abc import ABC, abstractmethod

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Path


class PairIteration(ABC):
    """Value iteration of two robots, 0 and 1, whose states at each step are numbered per step.

    Values are arrays [n, m] over the states of both robots at a step, CLOSED where the two
    conflict or one of them has no way on.
    """

    horizon: int

    @abstractmethod
    def reward(self, t: int) -> FloatArray:
        """Returns the reward [n, m] of being in each pair of states at step t."""

    @abstractmethod
    def step_back(self, t: int, ahead: FloatArray) -> FloatArray:
        """Returns the best value [n, m] over both robots' moves from step t to t+1.

        Parameters
        ----------
        ahead : values of the pairs of states at step t+1
        """

    @abstractmethod
    def successors(self, which: int, t: int, state: int) -> tuple[IntArray, IntArray, FloatArray]:
        """Returns the states that robot 0 or 1 can go to from its state at step t.

        Returns
        -------
        State numbers [n], their positions among the robot's states of step t+1, and the rewards
        for the moves themselves.
        """

    def forbidden(
        self, tails: tuple[int, int], heads: tuple[IntArray, IntArray]
    ) -> BoolArray | bool:
        """Returns which pairs of moves [n, m], from two states to their heads, break a rule."""
        return False

    def sweep(self) -> list[FloatArray]:
        """Returns the best reward to go of all pairs at every step."""
        values = [self.reward(self.horizon)]
        for t in range(self.horizon - 1, -1, -1):
            values.append(self.step_back(t, values[-1]) + self.reward(t))
        return values[::-1]

    def best_paths(
        self, values: list[FloatArray], starts: tuple[int, int], positions: tuple[int, int]
    ) -> tuple[Path, Path] | None:
        """Reads the best pair of paths off the values; ties go to the first pair of states.

        Parameters
        ----------
        values : as `sweep` returns them
        starts, positions : state numbers at step 0, and where their values are

        Returns
        -------
        State numbers of both paths; None where there is no pair of paths.
        """
        if values[0][positions] == CLOSED:
            return None
        path_a, path_b = [starts[0]], [starts[1]]
        for t, following in enumerate(values[1:]):
            states_a, at_a, rewards_a = self.successors(0, t, path_a[-1])
            states_b, at_b, rewards_b = self.successors(1, t, path_b[-1])
            ahead = following[np.ix_(at_a, at_b)]
            ahead = ahead + rewards_a[:, None] + rewards_b[None, :]
            forbidden = self.forbidden((path_a[-1], path_b[-1]), (states_a, states_b))
            ahead = np.where(forbidden, CLOSED, ahead)
            row, column = np.unravel_index(np.argmax(ahead), ahead.shape)
            path_a.append(int(states_a[row]))
            path_b.append(int(states_b[column]))
        return tuple(path_a), tuple(path_b)
