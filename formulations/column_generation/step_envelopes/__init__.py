"""Step envelopes: one envelope over all faces of a step closes what the relaxation leaves open.

`envelopes` adds the stages; `price_bundle` finds the prices of a stage; `known_states` looks for
joint states by local search; `counting` counts what is left, `list_lengths` tells how many states
are listed, and `path_trials` when all paths are tried.
"""
