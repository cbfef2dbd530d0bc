"""Bounds on J as they are told."""

import math

from cocap_opt.output.told_bounds import is_attained, told_bound, told_gap


def test_a_bound_that_a_plan_attains_has_its_number() -> None:
    """Rounded by itself it would seem to be above J; others are rounded up."""
    assert told_bound(27.00501, 27.00499) == "27.00"
    assert told_bound(54_899.7717201, 54_899.771) == "54,899.77"
    assert told_bound(54_899.7717201) == "54,899.78"
    assert told_bound(math.inf) == "inf"
    assert told_bound(54_904.0, 54_899.77) == "54,904.00"
    assert told_bound(27.0, 30.0) == "27.00"  # of a plan that breaks rules
    assert not is_attained(math.inf, 27.0) and not is_attained(27.0, None)


def test_a_small_gap_is_not_told_in_figures() -> None:
    """Rounded up it would seem to be a hundredth of a percent."""
    assert told_gap(2e-6) == told_gap(9.9e-5) == "less than 0.01 %, if at all"
    assert told_gap(1.2e-4) == "at most 0.02 %"
    assert told_gap(1.2e-4, 1) == "at most 0.1 %"
