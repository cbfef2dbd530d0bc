"""Relations between robots: teams, constraints, best responses, pair iteration, re-plans."""

__all__ = ["best_response", "pair_iteration", "team"]
