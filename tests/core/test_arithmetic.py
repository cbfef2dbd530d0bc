import math

import pytest

from cocap_opt.arithmetic import exact_sum


def test_sums_are_rounded_once() -> None:
    """Neither the order nor the version of Python changes a sum."""
    assert exact_sum([1e16, 1.0, -1e16]) == 1.0
    assert exact_sum(iter([0.1] * 10)) == 1.0
    assert exact_sum([]) == 0.0


@pytest.mark.parametrize(
    ("values", "total"),
    [
        ([1e308, 1e308], math.inf),
        ([-1e308, -1e308], math.inf),
        ([math.inf, 1.0], math.inf),
        ([-math.inf, 1.0], -math.inf),
        ([math.inf, -math.inf], math.nan),
        ([math.nan, 1.0], math.nan),
    ],
)
def test_sums_beyond_all_numbers_are_no_numbers(values: list[float], total: float) -> None:
    """What overflows is infinite and never small: no hostile file makes a bound of it."""
    assert exact_sum(values) == pytest.approx(total, nan_ok=True)
