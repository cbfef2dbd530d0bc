"""Relations between robots: constraints, best responses, re-plans, value iteration over pairs."""

__all__ = ["best_response", "constraints", "pair_iteration", "replans"]
