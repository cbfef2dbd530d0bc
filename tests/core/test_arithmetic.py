import math

import numpy as np
import pytest

from cocap_opt.arithmetic import angles_of, cosines, exact_sum, sines


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


def test_angles_are_those_of_vectors() -> None:
    """Cosine and sine of a vector's angle are the vector again; the zero vector looks along x."""
    x, y = np.array([1.0, 0.0, -3.0, -1.0, 0.6]), np.array([0.0, 2.0, 0.0, -1.0, -0.8])
    angles, lengths = angles_of(y, x), np.sqrt(x**2 + y**2)
    assert lengths * cosines(angles) == pytest.approx(x, abs=1e-15)
    assert lengths * sines(angles) == pytest.approx(y, abs=1e-15)
    assert angles_of(np.zeros(1), np.zeros(1)).tolist() == [0.0]
    assert angles_of(np.zeros(0), np.zeros(0)).shape == (0,)
