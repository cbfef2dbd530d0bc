"""Step envelopes: one envelope over all faces of a step closes the gap that the relaxation leaves.

`envelopes` runs the rounds; `price_bundle` finds the prices of a round, `heights` turns them into
stages, and `stages` holds all stages so far. `step_searches` searches for joint states exactly, and
`known_states` by local search; `counting` counts remaining states, `list_lengths` decides how many
states are listed, and `path_trials` when to explore all paths.
"""
