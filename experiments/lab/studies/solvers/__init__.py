"""Bounds and exact methods compared with their targets and with generic solvers."""

__all__ = ["comparisons", "table"]
