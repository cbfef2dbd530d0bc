"""Sums that are the same with every Python: since 3.12 `sum` adds floats in another way."""

import math
from collections.abc import Iterable


def exact_sum(values: Iterable[float]) -> float:
    """Returns the sum of numbers, correctly rounded; NaN or infinite where it is not finite."""
    values = list(values)
    try:
        return math.fsum(values)
    except (OverflowError, ValueError):  # too large on the way, or of both infinities
        return math.inf if -math.inf not in values else math.nan
