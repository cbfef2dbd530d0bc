"""Relations between robots: teams, best responses to them, and searches made of these."""

__all__ = [
    "best_response",
    "low_level",
    "neighbourhoods",
    "pair_iteration",
    "responses",
    "restricted_value_iteration",
    "team",
]
