"""Primal heuristics: make plans from mixtures and from other plans.

`incumbent` is a plan that obeys the rules, as columns. `local_search` rounds a mixture and improves
plans by best responses. `recombination` finds the best plan along the states of several plans, and
`arc_search` improves plans of very many robots over known arcs.
"""
