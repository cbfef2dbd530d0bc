"""Primal heuristics: plans made of mixtures and of other plans.

`local_search` rounds a mixture and improves plans by best responses, over the columns of
`column_pool`. `recombination` finds the best plan along the states of several, and `arc_search`
changes plans of very many robots over known arcs.
"""
