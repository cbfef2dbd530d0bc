"""Tails: the J that all plans above the target lose at their latest steps, proved step by step.

By the identity of `narrowing`, a plan's J is B less its losses: those of its paths on each move,
and K_t - h_t at each step. All are >= 0. The tail of a plan begins at a step and ends at the last
one. If every plan above the target loses at least L_t from step t on, then

    J <= max(target, B - L_t)    for all plans.

L_t is found from L_t+1, L_t+2, ...: the joint states of step t that may begin a tail with a loss
below a number d lose at most d - L_t+1 at step t alone, so there are few of them. Paths are
explored from these, and are followed while

    loss so far + L of the steps that follow < d.

If none of them gets to the end, L_t >= d. This takes far fewer joint states than exploring whole
plans, whose losses are almost all still ahead at the beginning. It is Russian doll search
(Verfaillie, Lemaitre, Schiex 1996) over steps.
"""

from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.formulations.certificates.staged.joint_paths import paths_along
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.other_steps import TailSteps
from cocap_opt.formulations.certificates.staged.reached import Reached
from cocap_opt.formulations.certificates.staged.team_moves import Team
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop, never


class LeastLoss(NamedTuple):
    """The outcome of exploring the tails of one length.

    Attributes
    ----------
    loss : J that every plan above the target loses from the step on
    nodes : number of nodes that the searches took
    paths : state numbers of each robot in the plan that loses this; empty if tails do not begin at
        step 0, or if all lose more
    """

    loss: float
    nodes: int
    paths: tuple[Path, ...] = ()


class Tails(NamedTuple):
    """The losses of tails that have been proved.

    Attributes
    ----------
    narrowing : the narrowing to plans above its target
    losses : [T+2] the J that each of them loses from each step on; 0 after the last step
    """

    narrowing: Narrowing
    losses: FloatArray

    @classmethod
    def of(cls, narrowing: Narrowing) -> "Tails":
        """Returns tails of which nothing is known yet."""
        return cls(narrowing, np.zeros(narrowing.model.problem.horizon + 2))

    @property
    def pricing(self) -> Pricing:
        """The bound on all plans; errors are those of `Narrowing.pricing`."""
        return self.narrowing.pricing_of(self.narrowing.bound_of_steps - float(self.losses.max()))

    @property
    def most(self) -> float:
        """The loss that no plan above the target exceeds, including rounding."""
        narrowing = self.narrowing
        return narrowing.bound_of_steps + 2 * narrowing.rounding - narrowing.target

    def longer(self, t: int, loss: float) -> "Tails":
        """Returns the tails with a loss of those that begin at a step; longer ones lose no less."""
        losses = self.losses.copy()
        losses[: t + 1] = np.maximum(losses[: t + 1], loss)
        return self._replace(losses=losses)

    def beginnings(
        self, t: int, alone: float, searches: MoveSearches, stop: Stop = never
    ) -> Reached:
        """Returns the joint states of a step, `first_tail`..T, that lose less than an amount there;
        step 0 has a single one. Errors are those of `least_loss`.
        """
        if t == 0:
            return self._start()
        above = float(self.narrowing.constants[t]) - alone - 4 * self.narrowing.rounding
        return Team(self.narrowing).with_profits(t, above, searches, stop)

    def least_loss(
        self, t: int, loss: float, most_nodes: int, stop: Stop = never, plain: bool = False,
        known: Reached | None = None,
    ) -> LeastLoss:  # fmt: skip
        """Returns the least loss of the tails that begin at a step, at most a given loss.

        Parameters
        ----------
        t : the step, `first_tail`..T
        loss : tails that lose more are not explored
        most_nodes : largest number of nodes of all searches together
        plain : True: use the plain search only
        known : the beginnings of all tails with a smaller loss, and perhaps more; None: they are
            searched, and their nodes count

        Raises
        ------
        NotEndedError
            If there are too many joint states.
        LimitReached
            If a limit is reached.
        """
        others = TailSteps(self.narrowing, self.losses, loss)
        team, searches = Team(self.narrowing, others), MoveSearches(most_nodes, plain)
        if known is None:
            alone = loss - float(self.losses[t + 1])  # what the step itself may lose
            known = self.beginnings(t, alone, searches, stop)
        reached = [team.promising(t, known)]
        for step in range(t + 1, self.narrowing.model.problem.horizon + 1):
            if not len(reached[-1].values):
                break
            reached.append(team.after(step, reached[-1], searches, stop))
        nodes, last = most_nodes - searches.nodes_left, reached[-1]
        if not len(last.values):
            return LeastLoss(loss, nodes)
        # At the end, the value of the best is all that such a plan can be worth.
        most = float(last.values.max())
        least = self.narrowing.bound_of_steps - most - 4 * self.narrowing.rounding
        if least >= loss:
            return LeastLoss(loss, nodes)
        paths = () if t else paths_along(reached)
        return LeastLoss(max(least, float(self.losses[t + 1])), nodes, paths)

    def _start(self) -> Reached:
        """Returns the joint state of robots with fixed starts at step 0, if that remains."""
        narrowing, team = self.narrowing, Team(self.narrowing)
        starts = [narrowing.model.starts(robot) for robot in range(len(team.numbers))]
        able = zip(team.numbers.tolist(), starts, strict=True)
        if not all(narrowing.left[number][0, states].all() for number, states in able):
            return Reached.empty(len(team.numbers))
        return team.fixed(starts)


def first_tail(model: Model) -> int:
    """Returns the step at which the longest tails begin: 0, or 1 if robots choose their starts."""
    return int(model.problem.has_free_starts)
