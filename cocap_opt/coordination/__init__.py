"""What robots mean to one another: constraints from conflicts and other robots' paths."""
