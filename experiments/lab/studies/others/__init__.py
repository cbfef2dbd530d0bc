"""Plans of other projects and ours on their scenes, with one evaluator and certified bounds."""

__all__ = ["others", "stored_values"]
