"""Coordination of robots: teams, best responses, and searches that use them."""

__all__ = [
    "best_response",
    "low_level",
    "neighbourhoods",
    "responses",
    "restricted_value_iteration",
    "team",
]
