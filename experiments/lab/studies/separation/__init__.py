"""The price that drones keep apart: what it costs in J and time, certified."""

__all__ = ["figure", "points", "separation", "tables"]
