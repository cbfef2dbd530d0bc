"""The cost of coverage on large maps, and coverage beside that of other people's program."""

__all__ = ["coverage"]
