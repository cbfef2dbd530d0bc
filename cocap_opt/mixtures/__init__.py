"""Mixtures: weighted sets of paths of each robot, and the prices derived from them.

`columns` defines the paths, `mixture` their weights, and `prices` the value of their views.
`mixture_ascent` improves a mixture in alternation with pricing, `column_pool` makes plans from its
columns, and `plan_search` improves these; `parameters` has the parameters of all of them. Both
planners and column generation use this package.
"""

__all__ = [
    "column_pool",
    "columns",
    "mixture",
    "mixture_ascent",
    "parameters",
    "plan_search",
    "prices",
]
