"""Column generation and branch-and-price: bounds and proved optima over paths.

The two methods are `column_generation` (the bound at the root) and `branch_and_price` (the
search tree). Both solve the relaxation of a node (`relaxation`): the restricted master problem
over the columns found so far (`master`) and pricing (`pricing`) take turns, while `local_search`
and `diving` make plans of the mixtures that come up. The root's first columns are those of a
mixture that is raised without a master (`mixture_ascent`); where robots are very many, bound and
plan come without masters altogether (`large_root`).
"""

__all__ = ["branch_and_price", "column_generation", "root", "search", "step_envelopes"]
