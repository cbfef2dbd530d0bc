"""Motion of robots: networkx graphs, the time-expanded graph compiled to arrays, and best paths.

The modules are `motion` (the graphs by networkx), `timegraph` (their compiled form), `charges` and
`move_rewards` (costs and rewards on it) and `value_iteration` (best paths through it). Certificates
use the others, so this front does not import `value_iteration`: it is no part of what they trust.
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
