"""Step envelopes: one envelope over all faces of a step closes the gap that the relaxation leaves.

`envelopes` runs the rounds; `price_bundle` finds the prices of a round for the states of
`priced_states`, with the master problem of `price_master`; `heights` turns them into stages, and
`stages` holds all stages so far. At the end, `move_bundle` finds prices for moves between two
steps, with `local_moves` and `exact_heights`. `step_searches` searches for joint states exactly,
and `local_optima` (compiled in `ascent_kernel`) by local search from those of `known_states`;
`counting` counts remaining states, and `list_lengths` decides how many states are listed.
`path_trials` decides when to explore all paths, and `middle_step` from which step; `tail_search`
decides up to which losses tails are explored, from the joint states of `tail_beginnings`.
"""
