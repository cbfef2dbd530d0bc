"""Motion of robots: the time-expanded graph compiled to arrays, best paths, and networkx graphs.

The modules are `motion` (the moves of a step, and the people from whom drones keep a distance),
`timegraph` (the compiled graph), `frames` (the reachable part of it), `charges` and `move_rewards`
(costs and rewards on it), `value_iteration` (best paths through it), `sweep_kernel` (the same,
compiled), `networks` (the same graphs by networkx), `encounters` (the places from which a drone can
come near somebody) and `choke_points` (the cells through which all ways lead). This package's front
imports none of the last five: certificates do not depend on them.
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
