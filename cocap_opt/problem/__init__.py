"""The planning problem as immutable data, and plans with their conflicts."""
