"""Planners over start sets, as in the table of Greedy Perspectives, with certified bounds."""

__all__ = ["start_sets", "tables"]
