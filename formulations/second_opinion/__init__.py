"""A second opinion on certificates: the bound that one proves, added up anew with networkx.

`certificates.pricing` says which inequalities bound J, and prices them by value iteration over
arrays. Here the same sums are made in plain loops over states and moves, and each drone's best path
is networkx's longest path through the time-expanded graph that is in reach of its start. Both know
the problem, the moves that there are, what a view sees and the format of files; they share no
numbering of states, no charges, no envelopes and no sweep. Whether a row is one that every plan
obeys is not asked again. Of a proof every leaf is priced.

The longest path of a directed acyclic graph may begin and end anywhere, so that networkx leaves out
whatever has a negative sum. Every edge is therefore raised by one constant until none is negative.
Then a longest path begins at the start and ends at step T; it has T edges, which take the constant
off again.
"""

from cocap_opt.formulations.second_opinion.opinion import (
    SecondOpinion,
    TooLargeError,
    require_small,
)

__all__ = ["SecondOpinion", "TooLargeError", "require_small"]
