"""Relations between robots: teams, constraints, best responses, pair iteration, re-plans."""

__all__ = ["best_response", "constraints", "pair_iteration", "team"]
