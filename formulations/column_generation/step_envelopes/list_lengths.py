"""The lengths of the lists of states to which step envelopes are restricted.

The longer a list, the more its prices can close, and the longer its search takes. So the length of
each step's list depends on the duration of its last search, and the slack of all lists is raised if
they are too short on the whole, or if a round has closed little.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from cocap_opt.formulations.column_generation.parameters import ListParameters


@dataclass
class ListLengths:
    """The lengths of the lists of all steps, adapted to the durations of searches.

    Attributes
    ----------
    steps : number of steps that have a list
    parameters : parameters of the lengths
    widening : slack of the current lists, in multiples of the slack of the first lists
    long_search : number of nodes above which a search is long
    """

    steps: int
    parameters: ListParameters
    widening: float = 1.0
    # list length that a step with a long search can bear
    _bearable: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Sets the size of a long search to that of the parameters."""
        self.long_search = self.parameters.long_search

    @property
    def first(self) -> int:
        """The largest number of states on a step's first list."""
        return max(
            self.parameters.fewest_first,
            min(self.parameters.of_all_steps // self.steps, self.parameters.most_first),
        )

    @property
    def can_grow(self) -> bool:
        """True as long as searches may take longer than they do."""
        return self.long_search <= self.parameters.longest_search

    def most(self, t: int) -> int:
        """Returns the largest number of states that the next list of step t may have."""
        return min(self._bearable.get(t, self.first), self.parameters.most)

    def slack(self, open_: float, count: Callable[[float], int]) -> float:
        """Returns the slack up to which states are listed, which is raised if lists are too short.

        Parameters
        ----------
        open_ : the remaining gap of the bound, in units of J
        count : function that returns the number of states of all steps up to a slack
        """
        per_step = self.parameters.slack * open_ / self.steps
        enough = self.parameters.mean * self.first * self.steps
        while (
            self.widening < self.parameters.most_slack and count(per_step * self.widening) < enough
        ):
            self.widening *= self.parameters.a_little_more_slack
        return per_step * self.widening

    def note(self, t: int, listed: int, nodes: int | None) -> None:
        """Records how long the search of a step's list took.

        Parameters
        ----------
        listed : number of states on the list
        nodes : nodes of the search; None if it has not ended
        """
        work = self.parameters.not_ended if nodes is None else nodes / self.long_search
        if work > 1:
            self._bearable[t] = max(
                int(listed * work**-self.parameters.shorter), self.parameters.fewest
            )
        elif work < self.parameters.short_search:
            self._bearable[t] = int(self.most(t) * self.parameters.longer)

    def grow(self) -> None:
        """Makes all lists longer, and allows longer searches."""
        self.widening = min(self.parameters.more_slack * self.widening, self.parameters.most_slack)
        self.long_search *= self.parameters.more_nodes
        for t, most in self._bearable.items():
            self._bearable[t] = int(most * self.parameters.longer)
