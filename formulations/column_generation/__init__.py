"""Column generation and branch-and-price: bounds and proved optima over paths."""
