"""Searches for the highest joint state of a step, and how many nodes they may take."""

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
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known
from cocap_opt.stop import Stop


@dataclass
class StepSearches:
    """The searches so far.

    Attributes
    ----------
    known : the joint states that are known
    stop : limit of all searches
    parameters : how many nodes a search may take
    nodes : of all searches so far
    """

    known: Known
    stop: Stop
    parameters: EnvelopeParameters
    nodes: int = 0

    def highest(self, joint: JointStates, least: float, most_nodes: int) -> MostProfitable | None:
        """Returns the joint state of most profit; None if that takes too many nodes.

        From then on it is known, so that the next prices take it into account.

        Parameters
        ----------
        least : profit that some joint state is known to have
        """
        found, nodes = None, most_nodes
        with suppress(NotEndedError):
            found = most_profitable(joint, least, most_nodes, self.stop)
            nodes = found.nodes
            self.known.add(joint, found.positions)
        self.known.note(nodes, joint, self.stop)
        self.nodes += nodes
        return found

    def few_nodes(self, states: int) -> int:
        """Returns the nodes of a search among so many states that is worth a try."""
        work = self.parameters.few_work if is_there() else self.parameters.few_plain_work
        return min(self.parameters.few_nodes, work // max(states, 1))

    def many_nodes(self) -> int:
        """Returns the nodes of a search that should end."""
        return self.parameters.many_nodes if is_there() else self.parameters.many_plain_nodes
