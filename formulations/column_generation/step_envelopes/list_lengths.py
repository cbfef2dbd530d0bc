"""The lengths of the lists of states that step envelopes are searched among.

The longer a list, the more its payments can close, and the longer its search takes. So each step
has as many states on its list as its last search could bear, and all lists have more slack where
they are too short on the whole, or where a round has closed little.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

SLACK = 1.4  # of what is open per step: of states that are listed at first
# States on the first lists: of all steps, and the least and the most of one. Hughes et al.'s
# priority_speaker, 60 steps: 0.06 % are left after a minute; 0.24 % with 100 a step, all with 200.
OF_ALL_STEPS, FEWEST_FIRST, MOST_FIRST = 4_000, 60, 200
FEWEST, MOST = 30, 600  # at a step later: the search of fewer is short, of more hopeless
MEAN = 0.6  # of the most on the first lists: with fewer on the mean, there is time for more slack
# A search of so many nodes is long. The next list of its step is shorter, by this power of how many
# times longer it was; one that has not ended counts as so many times.
LONG_SEARCH, SHORTER, NOT_ENDED = 200_000, 0.2, 20.0
# A search of this share of a long one's nodes is short: the next list may be longer by this factor.
SHORT_SEARCH, LONGER = 0.1, 1.2
# After a round that closes little: times as much slack, and times as many nodes of a long search,
# as long as these are not more than any search of a step may take.
MORE_SLACK, MORE_NODES, LONGEST_SEARCH = 1.5, 1.7, 2_000_000
A_LITTLE_MORE_SLACK, MOST_SLACK = 1.15, 12.0  # times: where lists are too short, and at most


@dataclass
class ListLengths:
    """The lengths of the lists of all steps, as searches tell how long lists can be.

    Attributes
    ----------
    steps : number of steps that have a list
    widening : times as much slack as the first lists': that of the present ones
    long_search : number of nodes from which on a search is long
    """

    steps: int
    widening: float = 1.0
    long_search: float = LONG_SEARCH
    _bearable: dict[int, int] = field(default_factory=dict)  # states, of steps with long searches

    @property
    def first(self) -> int:
        """The number of states that a step's first list has at most."""
        return max(FEWEST_FIRST, min(OF_ALL_STEPS // self.steps, MOST_FIRST))

    @property
    def can_grow(self) -> bool:
        """True while searches may take longer than they do."""
        return self.long_search <= LONGEST_SEARCH

    def most(self, t: int) -> int:
        """Returns how many states the next list of step t has at most."""
        return min(self._bearable.get(t, self.first), MOST)

    def slack(self, open_: float, count: Callable[[float], int]) -> float:
        """Returns the slack up to which states are listed, with more of it if lists are too short.

        Parameters
        ----------
        open_ : what is open of the bound, in units of J
        count : returns the number of states up to a slack, at all steps
        """
        per_step = SLACK * open_ / self.steps
        enough = MEAN * self.first * self.steps
        while self.widening < MOST_SLACK and count(per_step * self.widening) < enough:
            self.widening *= A_LITTLE_MORE_SLACK
        return per_step * self.widening

    def note(self, t: int, listed: int, nodes: int | None) -> None:
        """Takes down how long the search of a step's list took.

        Parameters
        ----------
        listed : number of states on the list
        nodes : of the search; None if it has not ended
        """
        work = NOT_ENDED if nodes is None else nodes / self.long_search
        if work > 1:
            self._bearable[t] = max(int(listed * work**-SHORTER), FEWEST)
        elif work < SHORT_SEARCH:
            self._bearable[t] = int(self.most(t) * LONGER)

    def grow(self) -> None:
        """Makes all lists longer, and allows their searches to take longer."""
        self.widening = min(MORE_SLACK * self.widening, MOST_SLACK)
        self.long_search *= MORE_NODES
        for t, most in self._bearable.items():
            self._bearable[t] = int(most * LONGER)
