"""Searches for the highest joint state of a step, with limits on their nodes."""

import math
from contextlib import suppress
from dataclasses import dataclass

from cocap_opt.compiling import is_there
from cocap_opt.formulations.certificates.staged import (
    JointStates,
    NotEndedError,
    most_profitable,
)
from cocap_opt.formulations.certificates.staged.search import MostProfitable
from cocap_opt.formulations.column_generation.parameters import EnvelopeParameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known

# times the bound in which every robot is alone: no sum of constants and prices is as large
_LOW = 8


@dataclass
class StepSearches:
    """The searches made so far.

    Attributes
    ----------
    known : the joint states that are known
    search : its stopping criterion ends all searches for joint states
    nodes : total nodes of all searches so far
    """

    known: Known
    search: Search
    nodes: int = 0

    @property
    def parameters(self) -> EnvelopeParameters:
        """Limits on the nodes of a search."""
        return self.search.parameters.envelopes

    def highest(self, joint: JointStates, least: float, most_nodes: int) -> MostProfitable | None:
        """Returns the joint state of largest profit; None if the search takes too many nodes.

        The joint state is then known, so that the next prices take it into account. If none counts,
        which proves that no plan is above the target, the profit is so low that the bound shows it.

        Parameters
        ----------
        least : profit of a known joint state
        """
        found, nodes = None, most_nodes
        with suppress(NotEndedError):
            found = most_profitable(joint, least, most_nodes, self.search.stop)
            nodes = found.nodes
            self.known.add(joint, found.positions)
            if found.profit == -math.inf:
                found = found._replace(profit=-_LOW * self.search.scale)
        self.known.note(nodes, joint, self.search.stop)
        self.nodes += nodes
        return found

    def few_nodes(self, states: int) -> int:
        """Returns a number of nodes that a search among this many states is worth."""
        work = self.parameters.few_work if is_there() else self.parameters.few_plain_work
        return min(self.parameters.few_nodes, work // max(states, 1))

    def many_nodes(self) -> int:
        """Returns the number of nodes within which a search is expected to end."""
        return self.parameters.many_nodes if is_there() else self.parameters.many_plain_nodes
