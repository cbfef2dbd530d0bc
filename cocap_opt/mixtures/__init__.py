"""Mixtures: several paths of each robot, flown in part, and the prices that they teach.

`columns` are the paths, `mixture` weighs them, `prices` values what they see, `mixture_ascent`
raises one in turn with pricing, `column_pool` makes plans of their columns, `plan_search` betters
these; `parameters` guide it all. What planners and column generation both use of them is here.
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
