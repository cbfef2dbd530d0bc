"""Plans flown in a simulator by others: what is left of their distances and of J."""

__all__ = ["figure", "flight", "tables"]
