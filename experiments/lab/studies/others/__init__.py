"""Plans of other projects and ours on their scenes, under one evaluator, with certified bounds."""

__all__ = ["others", "stored_values"]
