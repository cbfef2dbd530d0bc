"""Concave returns: their values, tangents, and the inequality that bounds rest on."""

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import examples

from cocap_opt.returns import Returns, return_of

ROOT = Returns(1, np.zeros(0))
AMOUNT = st.one_of(st.floats(0, 1e6), st.sampled_from([0.0, 1.0, 2.0, 3.0]))


def count(cap: int) -> Returns:
    """Of one view sum, which counts drones."""
    return Returns(0, np.array([float(cap)]))


EITHER = st.one_of(st.just(ROOT), st.builds(count, st.integers(1, 4)))


def value(returns: Returns, amount: float) -> float:
    """Of one view sum."""
    return float(returns.values(np.array([amount]))[0])


def test_a_row_of_view_sums_has_its_roots_first() -> None:
    """All at once, some, and one."""
    returns = Returns(2, np.array([1.0, 3.0]))
    amounts = np.array([4.0, 9.0, 4.0, 4.0])
    assert returns.values(amounts).tolist() == [2, 3, 1, 3]
    assert returns.values(np.stack([amounts, 0 * amounts])).tolist() == [[2, 3, 1, 3], [0] * 4]
    some = np.array([3, 0, 2, 3])
    assert returns.values_at(some, np.array([2.0, 16, 0.5, 7])).tolist() == [2, 4, 0.5, 3]
    assert returns.value_of(1, np.array([25.0])) == 5 and returns.value_of(3, np.array([25.0])) == 3
    part = returns.part(np.array([1, 3]))
    assert part.n_roots == 1 and part.caps.tolist() == [3]
    assert returns.slopes(amounts).tolist() == [0.25, 1 / 6, 0, 0]
    assert Returns(4, np.zeros(0)).values_at(slice(1, 3), amounts[:2]).tolist() == [2, 3]


@examples(200)
@given(st.lists(AMOUNT, min_size=5, max_size=5))
def test_one_view_sum_has_the_value_that_it_has_among_all(amounts: list[float]) -> None:
    """To the last bit: kernels take them one by one."""
    returns = Returns(3, np.array([1.0, 3.0]))
    values = [return_of(*returns, k, amount) for k, amount in enumerate(amounts)]
    assert values == returns.values(np.array(amounts)).tolist()


@examples(200)
@given(EITHER, AMOUNT, AMOUNT, AMOUNT)
def test_gains_shrink_and_are_not_negative(
    returns: Returns, seen: float, more: float, own: float
) -> None:
    """As a concave function's that does not fall; alone, a gain is the value itself."""

    def gain(before: float) -> float:
        return value(returns, before + own) - value(returns, before)

    assert gain(seen) >= gain(seen + more) - 1e-9 * math.sqrt(seen + more + own)
    assert gain(seen) >= 0 and gain(0.0) == value(returns, own)


@examples(200)
@given(EITHER, st.floats(1e-3, 1e6), AMOUNT)
def test_tangents_are_nowhere_below(returns: Returns, at: float, amount: float) -> None:
    """Slopes are those of tangents."""
    slope = float(returns.slopes(np.array([at]))[0])
    tangent = value(returns, at) + slope * (amount - at)
    assert value(returns, amount) <= tangent + 1e-9 * (1 + abs(tangent))


@examples(300)
@given(
    EITHER,
    st.lists(st.floats(0, 1e4), min_size=1, max_size=5),
    st.floats(0, 2),
    st.floats(0, 2),
    st.sampled_from([1.0, 0.6]),
)
def test_the_inequality_that_bounds_rest_on(
    returns: Returns, amounts: list[float], alpha: float, beta: float, rest: float
) -> None:
    """rest phi(sum c) <= alpha sum phi(c) + beta sum c + kappa; of counts, c is 0 or 1."""
    if len(returns.caps):
        amounts = [float(amount > 5000) for amount in amounts]
    kappa = float(returns.kappas(np.array([alpha]), np.array([beta]), rest)[0])
    total = sum(amounts)
    paid = alpha * sum(value(returns, c) for c in amounts) + beta * total + kappa
    assert rest * value(returns, total) <= paid + 1e-9 * (1 + abs(total))


@examples(100)
@given(EITHER, st.floats(0, 2), st.floats(0.001, 2))
def test_kappa_is_a_least_upper_bound(returns: Returns, alpha: float, beta: float) -> None:
    """Of (1 - alpha) phi(z) - beta z, on a fine grid that has the greatest one."""
    kappa = float(returns.kappas(np.array([alpha]), np.array([beta]))[0])
    left = max(1 - alpha, 0.0)
    best = left**2 / (4 * beta**2) if returns.n_roots else float(returns.caps[0])
    grid = np.array([0.0, best, *np.linspace(0, 3 * best + 1, 200)])
    tops = left * np.array([value(returns, z) for z in grid.tolist()]) - beta * grid
    assert kappa == pytest.approx(tops.max(), rel=1e-9, abs=1e-9)


def test_kappa_is_exact() -> None:
    """In fractions, and infinite where a root is paid for by neither."""
    alpha, beta = np.array([0.25]), np.array([0.5])
    assert Fraction(float(ROOT.kappas(alpha, beta)[0])) == Fraction(9, 32)
    assert Fraction(float(count(3).kappas(alpha, beta)[0])) == Fraction(3, 4)
    assert ROOT.kappas(np.array([0.5]), np.zeros(1))[0] == math.inf
    assert ROOT.kappas(np.ones(1), np.zeros(1))[0] == 0
    assert count(2).kappas(np.array([0.5]), np.zeros(1))[0] == 1
