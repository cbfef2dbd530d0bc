"""Finds the losses of tails (`tails`), from the last step on, with a limit on the nodes.

The longer the tails, the more they lose, and from the losses follows the bound. The loss up to
which the tails of a step can be explored is known only after trying. So it grows until an
exploration has taken a share of the nodes that each step may take; then it is the turn of the step
before. At the end, all steps are explored again with twice as many nodes each.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

from cocap_opt.formulations.certificates.format import Stage, Tail
from cocap_opt.formulations.certificates.staged import (
    NotEndedError,
    Tails,
    first_tail,
    may_be_used,
)
from cocap_opt.formulations.column_generation.parameters import TailParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.recombination import searches_are_fast
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.step_envelopes.tail_beginnings import Beginnings


class ProvedTails(NamedTuple):
    """Losses of tails, and what they prove."""

    bound: float  # on all plans
    stages: tuple[Stage, ...]  # stages before them
    tails: tuple[Tail, ...]


@dataclass
class _Known:
    """The proved loss of the tails from a step on, and the explorations that proved it."""

    loss: float = 0.0
    is_least: bool = False  # True: some plan loses no more there
    nodes: int = 0  # the explorations had so many nodes
    before: float = 0.0  # what was known of the next step
    beginnings: Beginnings = field(default_factory=Beginnings)


@dataclass
class TailSearch:
    """The explorations of tails so far.

    Attributes
    ----------
    best : the losses that have proved the lowest bound; None before any
    nodes : total nodes of all explorations
    is_on : False: explore no tails
    """

    search: Search
    best: ProvedTails | None = None
    nodes: int = 0
    is_on: bool = True
    _failed_room: float = math.inf
    _known: dict[int, _Known] = field(default_factory=dict)
    _of: Stages | None = None
    _allowed: int = 0

    @property
    def bound(self) -> float:
        """The lowest bound on all plans that tails have proved; infinite before any."""
        return math.inf if self.best is None else self.best.bound

    @property
    def is_possible(self) -> bool:
        """True if tails may be explored: joint states determine J."""
        return self.is_on and may_be_used(self.search.model)

    def after_stages(self, proved: Stages, nodes: int, report: Callable[[], None]) -> bool:
        """Explores tails in compiled code if the room has shrunk since the last time; returns True
        if they prove that no plan is above the target.

        Parameters
        ----------
        proved : the stages
        nodes : number of nodes of their searches
        report : called to report the bound that has been proved

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        allowed = int(self._parameters.times_nodes * nodes) - self.nodes
        room = proved.narrowing.room_above(proved.narrowing.target)
        is_easier = room <= self._parameters.less_room * self._failed_room
        is_long = self._is_fast and allowed >= self._parameters.fewest_nodes
        if not self.is_possible or not is_easier or not is_long:
            return False
        self._failed_room = room
        return self._explore(proved, allowed, report)

    def at_the_end(
        self, proved: Stages, nodes: int, report: Callable[[], None], to_the_end: bool = False
    ) -> None:
        """Explores tails again and again, with ever more nodes; raises LimitReached.

        Parameters
        ----------
        proved, nodes, report : as in `after_stages`
        to_the_end : False: stop before explorations become long in comparison with the stages
        """
        if not self.is_possible:
            return
        of_stages = max(nodes if self._is_fast else 0, self._fewest_nodes)
        allowed = max(of_stages, self._allowed)
        most = self._parameters.most_nodes
        if not to_the_end:
            most = min(most, int(self._parameters.times_at_the_end * of_stages))
        target = proved.narrowing.target
        while allowed <= most and self.search.value <= target:
            if self._explore(proved, allowed, report):
                return
            allowed *= 2

    def _explore(self, proved: Stages, allowed: int, report: Callable[[], None]) -> bool:
        """Explores the tails from each step on; returns True if no plan is above the target.

        Parameters
        ----------
        allowed : number of nodes for all steps together
        """
        if self._of is not proved:
            self._of, self._known = proved, {}
        self._allowed = allowed
        narrowing, model = proved.narrowing, proved.narrowing.model
        tails, claims, first = Tails.of(narrowing), list[Tail](), first_tail(model)
        each = allowed // (model.problem.horizon + 1 - first)
        more = self._parameters.first_loss * tails.most
        for t in range(model.problem.horizon, first - 1, -1):
            before = float(tails.losses[t + 1])
            # Whole plans have one beginning, so a node takes a fifth of the time.
            most_nodes = allowed if t == 0 else each
            loss, more = self._least_loss(tails, t, more, most_nodes)
            if loss > before:
                claims.append(Tail(t, loss))
                tails = tails.longer(t, loss)
                bound = tails.pricing.bound
                if bound < min(self.bound, narrowing.pricing.bound):
                    self.best = ProvedTails(bound, proved.stages, tuple(claims))
                    report()
            if loss >= tails.most:
                return True
            if self.search.value > narrowing.target:
                return False
        return False

    def _least_loss(
        self, tails: Tails, t: int, more: float, most_nodes: int
    ) -> tuple[float, float]:
        """Returns the J that plans above the target lose from a step on, and by how much more than
        from the next step on tails were explored.

        Parameters
        ----------
        more : the same of the step after
        """
        parameters, known = self._parameters, self._known.setdefault(t, _Known())
        beginnings = known.beginnings
        before = float(tails.losses[t + 1])
        known.loss = max(known.loss, before)
        if known.is_least or (most_nodes <= known.nodes and before <= known.before):
            return known.loss, more
        more = max(more / parameters.growth**2, parameters.first_loss * tails.most)
        begin, explored = known.loss, 0.0
        while known.loss < tails.most and not known.is_least:
            asked = min(begin + more, tails.most)
            self.nodes += beginnings.extend(
                tails, t, asked - before, most_nodes, parameters, self.search.stop
            )
            loss = min(asked, before + beginnings.alone)
            if loss <= known.loss:
                break
            try:
                found = tails.least_loss(
                    t, loss, most_nodes, self.search.stop, known=beginnings.reached
                )
            except NotEndedError:
                self.nodes += most_nodes
                break
            self.nodes += found.nodes
            known.loss, known.is_least, explored = found.loss, found.loss < loss, loss - begin
            if found.paths:
                self.search.offer(Incumbent.along(tails.narrowing.model, found.paths))
            if found.nodes > parameters.enough * most_nodes:
                break
            more *= parameters.growth
        known.nodes, known.before = most_nodes, before
        return known.loss, max(explored, parameters.first_loss * tails.most)

    @property
    def _is_fast(self) -> bool:
        return searches_are_fast(self.search.stop)

    @property
    def _fewest_nodes(self) -> int:
        """The size of the smallest exploration of all steps."""
        few, plain = self._parameters.fewest_nodes, self._parameters.fewest_plain_nodes
        return few if self._is_fast else plain

    @property
    def _parameters(self) -> TailParameters:
        return self.search.parameters.tails
