"""Relations between robots: teams, best responses to them, and searches made of these."""

__all__ = [
    "best_response",
    "low_level",
    "neighbourhoods",
    "responses",
    "restricted_value_iteration",
    "team",
]
