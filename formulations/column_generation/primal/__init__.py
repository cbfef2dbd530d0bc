"""Primal heuristics: make plans from mixtures and from other plans.

`local_search` rounds a mixture and improves plans by best responses, over the columns of
`column_pool`. `recombination` finds the best plan along the states of several plans, and
`arc_search` improves plans of very many robots over known arcs.
"""
