"""Bounds and exact methods held against their targets, and against generic solvers."""

__all__ = ["comparisons", "table"]
