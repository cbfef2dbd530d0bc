"""The project's own measurements, each a command of `cocap-opt study`.

The paper's experiments, planners over start sets, growth, exact methods beside generic solvers,
the cost and the accuracy of coverage, and the speed of planners.
"""

__all__ = [
    "app", "coverage", "gamma", "growth", "notebooks", "paper", "pictures", "runs",
    "separation", "solvers", "speed", "start_sets", "views",
]  # fmt: skip
