"""Plans flown in a third-party simulator: how much of their distances and of J remains."""

__all__ = ["figure", "flight", "tables"]
