"""Plans flown in a third-party simulator: what is left of their distances and of J."""

__all__ = ["figure", "flight", "tables"]
