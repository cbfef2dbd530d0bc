"""Step envelopes: one envelope over all faces of a step closes what the relaxation leaves open.

`envelopes` goes round by round; `price_bundle` finds the prices of a round, `heights` the stages
that they make, and `stages` holds all stages so far. `step_searches` searches for joint states, and
`known_states` looks for them by local search; `counting` counts what is left, `list_lengths` tells
how many states are listed, and `path_trials` when all paths are tried.
"""
