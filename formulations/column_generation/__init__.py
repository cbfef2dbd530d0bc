"""Column generation and branch-and-price: bounds and proved optima over paths.

The two methods are `column_generation` (the bound at the root) and `branch_and_price` (the search
tree), both in `branch_and_price`. The subpackages, from the lowest up:

- `parameters`: every number that guides the search, documented;
- `master`: paths as columns, their mixtures, the restricted master problem and pricing;
- `primal`: heuristics that make plans from mixtures and from other plans;
- `search`: the state that all nodes share;
- `step_envelopes`: the second stage of the root, which often closes the gap that the relaxation
  leaves;
- `tree`: the relaxation of a node, the root, and the nodes below it.
"""

__all__ = ["branch_and_price", "master", "parameters", "search", "step_envelopes", "tree"]
