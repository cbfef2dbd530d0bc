"""Motion of robots: the time-expanded graph compiled to arrays, best paths, and networkx graphs.

The modules are `motion` (the moves of a step), `timegraph` (the compiled graph), `charges` and
`move_rewards` (costs and rewards on it), `value_iteration` (best paths through it) and `networks`
(the same graphs by networkx). This front imports neither of the last two: they are no part of what
certificates trust.
"""

from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.graph.move_rewards import NO_BONUSES, Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph

__all__ = [
    "CLOSED",
    "NO_BONUSES",
    "NO_CHARGES",
    "Bonuses",
    "Charges",
    "TimeGraph",
]
