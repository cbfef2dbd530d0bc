"""The project's own measurements, each a command of `cocap-opt study`.

The paper's experiments, plans of other projects compared with ours, growth, exact methods compared
with generic solvers, the cost and the accuracy of coverage, the speed of planners, and plans flown
in a simulator.
"""

__all__ = ["app", "browser", "drawings", "first_flight", "options", "pictures", "quotes"]
