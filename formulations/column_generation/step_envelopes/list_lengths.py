"""The lengths of the lists of states that step envelopes are searched among.

The longer a list, the more its prices can close, and the longer its search takes. So each step
has as many states on its list as its last search could bear, and all lists have more slack where
they are too short on the whole, or where a round has closed little.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

from cocap_opt.formulations.column_generation.parameters import ListParameters


@dataclass
class ListLengths:
    """The lengths of the lists of all steps, as searches tell how long lists can be.

    Attributes
    ----------
    steps : number of steps that have a list
    parameters : how long lists are
    widening : times as much slack as the first lists': that of the present ones
    long_search : number of nodes above which a search is long
    """

    steps: int
    parameters: ListParameters
    widening: float = 1.0
    _bearable: dict[int, int] = field(default_factory=dict)  # states, of steps with long searches

    def __post_init__(self) -> None:
        """Begins with the long searches of the parameters."""
        self.long_search = self.parameters.long_search

    @property
    def first(self) -> int:
        """The number of states that a step's first list has at most."""
        return max(
            self.parameters.fewest_first,
            min(self.parameters.of_all_steps // self.steps, self.parameters.most_first),
        )

    @property
    def can_grow(self) -> bool:
        """True while searches may take longer than they do."""
        return self.long_search <= self.parameters.longest_search

    def most(self, t: int) -> int:
        """Returns the most states that the next list of step t may have."""
        return min(self._bearable.get(t, self.first), self.parameters.most)

    def slack(self, open_: float, count: Callable[[float], int]) -> float:
        """Returns the slack up to which states are listed, with more of it if lists are too short.

        Parameters
        ----------
        open_ : the remaining gap of the bound, in units of J
        count : returns the number of states up to a slack, at all steps
        """
        per_step = self.parameters.slack * open_ / self.steps
        enough = self.parameters.mean * self.first * self.steps
        while (
            self.widening < self.parameters.most_slack and count(per_step * self.widening) < enough
        ):
            self.widening *= self.parameters.a_little_more_slack
        return per_step * self.widening

    def note(self, t: int, listed: int, nodes: int | None) -> None:
        """Takes down how long the search of a step's list took.

        Parameters
        ----------
        listed : number of states on the list
        nodes : of the search; None if it has not ended
        """
        work = self.parameters.not_ended if nodes is None else nodes / self.long_search
        if work > 1:
            self._bearable[t] = max(
                int(listed * work**-self.parameters.shorter), self.parameters.fewest
            )
        elif work < self.parameters.short_search:
            self._bearable[t] = int(self.most(t) * self.parameters.longer)

    def grow(self) -> None:
        """Makes all lists longer, and allows their searches to take longer."""
        self.widening = min(self.parameters.more_slack * self.widening, self.parameters.most_slack)
        self.long_search *= self.parameters.more_nodes
        for t, most in self._bearable.items():
            self._bearable[t] = int(most * self.parameters.longer)
