"""Coordination of robots: teams, best responses, and searches that use them.

`team` is a plan in progress. `best_response` finds one robot's best path; `low_level` defines what
planners of one robot take and return, and `responses` replans one robot after another with them.
`neighbourhoods` searches with many responses, which `restricted_value_iteration` computes over few
states: `kept_states` selects them, `kept_graph` finds the best path over them, compiled in
`response_kernel`.
"""

__all__ = [
    "best_response",
    "kept_graph",
    "low_level",
    "neighbourhoods",
    "responses",
    "restricted_value_iteration",
    "team",
]
