"""The cost of coverage on large maps, and coverage compared with a third-party program's."""

__all__ = ["coverage"]
