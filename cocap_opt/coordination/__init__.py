"""Relations between robots: constraints, best responses, and value iteration over pairs."""

__all__ = ["best_response", "constraints", "pair_iteration"]
