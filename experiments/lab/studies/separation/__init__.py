"""The price of keeping drones apart: its certified cost in J, and its cost in time."""

__all__ = ["figure", "points", "separation", "tables"]
