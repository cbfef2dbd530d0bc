"""Integer programs over the aggregated flow, and the generic solvers that take them."""
