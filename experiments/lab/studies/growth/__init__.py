"""Growth of the time and the gap of column generation with drones, steps and cells."""

__all__ = ["figure", "growth", "points"]
