"""Bounds what the steps before and after a step can be worth at the prices of a narrowing.

The best path of each robot alone gives both bounds. The exploration of joint paths (`team_moves`)
follows only those that may exceed the target with them.
"""

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing


class OtherSteps:
    """Upper bounds on what robots collect before and after a step.

    Attributes
    ----------
    threshold : J that a path has to exceed to be followed, including rounding
    """

    def __init__(self, narrowing: Narrowing) -> None:
        self._narrowing = narrowing
        self.threshold = narrowing.target - 2 * narrowing.rounding

    def rest_after(self, t: int) -> float:
        """Returns the J that later constants and rows add to the worth so far and `future`.

        A plan that has collected F up to step t is worth at most the sum of F, this amount, and the
        most that all robots can collect after t.
        """
        # At the step itself, rows charge at most their multipliers, which this sum contains.
        constants, saved = self._narrowing.constants, self._narrowing.saved
        return float(constants[t + 1 :].sum() - saved[t + 1 :].sum()) + self._rows(t)

    def rest_before(self, t: int) -> float:
        """Returns the J that earlier constants and rows, and best paths, add to the worth of the
        steps from t on and `past`.
        """
        narrowing = self._narrowing
        # Moves save something in these steps only if both of their steps are among them.
        others = narrowing.constants[t:].sum() - narrowing.saved[max(t - 1, 0) :].sum()
        return narrowing.bound - float(others) - self._rows(t)

    def _rows(self, t: int) -> float:
        """Returns the sum of the multipliers of the rows of a step and of later ones."""
        rows = self._narrowing.row_multipliers
        return exact_sum(multiplier for step, multiplier in rows if step >= t)

    def most_before(self, t: int) -> float:
        """Returns the most that all steps before a step, and best paths, can be worth."""
        narrowing = self._narrowing
        return narrowing.bound_of_steps - float(narrowing.constants[t:].sum()) - self._rows(t)

    def future(self, t: int, number: int, states: IntArray) -> FloatArray:
        """Returns the most [n] that robots of a class can collect after a step, in units of J.

        Parameters
        ----------
        states : [n] their states at step t
        """
        to_go, rewards = self._narrowing.to_go[number], self._narrowing.rewards[number]
        future: FloatArray = to_go[t, states] - rewards[t, states]
        return future

    def past(self, t: int, number: int, states: IntArray) -> FloatArray:
        """Returns the most [n] that robots of a class can collect before a step, less the value of
        a best path; parameters are those of `future`.
        """
        # The best path through a state is worth the best path less the state's slack.
        slack, to_go = self._narrowing.slack[number], self._narrowing.to_go[number]
        past: FloatArray = -slack[t, states] - to_go[t, states]
        return past


class TailSteps(OtherSteps):
    """The same bounds for the tails of plans: the steps before the tail lose nothing, and shorter
    tails lose what has been proved of them.

    Parameters
    ----------
    losses : [T+2] the J that every plan above the target loses from each step on
    loss : J less than which the explored part of a plan has to lose to be followed
    """

    def __init__(self, narrowing: Narrowing, losses: FloatArray, loss: float) -> None:
        super().__init__(narrowing)
        self._losses = losses
        self.threshold = narrowing.bound_of_steps - loss - 2 * narrowing.rounding

    def rest_after(self, t: int) -> float:
        """Returns the J that later constants and rows add, less the loss of the tail after the
        step.
        """
        later = float(self._narrowing.constants[t + 1 :].sum()) + self._rows(t)
        return later - float(self._losses[t + 1])
