"""Polynomials over 0..1, given by their Bernstein coefficients, which bound all their values.

Since the coefficients bound the values, subdivision gives proofs: a polynomial with only positive
coefficients is positive at every moment, and halves have tighter coefficients than wholes. Source:
Farouki, "The Bernstein polynomial basis: A centennial retrospective", 2012.
"""

import math
from functools import lru_cache
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import BoolArray, FloatArray

_DEEPEST = 40  # number of halvings after which a claim that is not proved counts as false
_FINE = 1e-9  # relative accuracy of a largest value


class Peak(NamedTuple):
    """The largest value of several polynomials, and where it occurs."""

    value: float  # an upper bound at every moment
    which: int  # number of the polynomial
    share: float  # 0..1

    @classmethod
    def of(cls, coefficients: FloatArray) -> Self:
        """Returns the peak of polynomials [N, n+1], N > 0, with a relative accuracy of 1e-9.

        The value is an upper bound of all of them.
        """
        index, low, width = np.arange(len(coefficients)), np.zeros(len(coefficients)), 1.0
        peak = cls(-math.inf, 0, 0.0)
        while len(coefficients):
            for end, share in ((0, 0.0), (-1, width)):
                k = int(np.argmax(coefficients[:, end]))
                if coefficients[k, end] > peak.value:
                    peak = cls(float(coefficients[k, end]), int(index[k]), float(low[k]) + share)
            slack = _FINE * (1 + abs(peak.value))
            larger = coefficients.max(axis=-1) > peak.value + slack
            index, low, width = np.tile(index[larger], 2), low[larger], width / 2
            coefficients = np.concatenate(parted(coefficients[larger]))
            low = np.concatenate([low, low + width])
        return peak._replace(value=peak.value + _FINE * (1 + abs(peak.value)))


def derivative(coefficients: FloatArray) -> FloatArray:
    """Returns the coefficients [.., n] of the derivatives of polynomials [.., n+1]."""
    degree = coefficients.shape[-1] - 1
    result: FloatArray = degree * np.diff(coefficients, axis=-1)
    return result


def product(first: FloatArray, second: FloatArray) -> FloatArray:
    """Returns the coefficients [.., n+m+1] of the products of polynomials [.., n+1], [.., m+1]."""
    n, m = first.shape[-1] - 1, second.shape[-1] - 1
    first, second = first * _binomials(n), second * _binomials(m)
    total = np.zeros((*np.broadcast_shapes(first.shape[:-1], second.shape[:-1]), n + m + 1))
    for k in range(n + 1):
        total[..., k : k + m + 1] += first[..., k, None] * second
    result: FloatArray = total / _binomials(n + m)
    return result


def squared_length(vectors: FloatArray) -> FloatArray:
    """Returns the coefficients [.., 2n+1] of the squared lengths of vectors [.., d, n+1]."""
    result: FloatArray = product(vectors, vectors).sum(axis=-2)
    return result


def elevated(coefficients: FloatArray, degree: int) -> FloatArray:
    """Returns the coefficients [.., degree+1] of the same polynomials [.., n+1] for a higher
    degree.
    """
    return product(coefficients, np.ones(degree - coefficients.shape[-1] + 2))


def parted(coefficients: FloatArray, share: float = 0.5) -> tuple[FloatArray, FloatArray]:
    """Returns the coefficients of polynomials [.., n+1] over 0..share and over share..1."""
    first, last, row = [coefficients[..., 0]], [coefficients[..., -1]], coefficients
    while row.shape[-1] > 1:
        row = share * row[..., 1:] + (1 - share) * row[..., :-1]
        first.append(row[..., 0])
        last.append(row[..., -1])
    return np.stack(first, axis=-1), np.stack(last[::-1], axis=-1)


def values(coefficients: FloatArray, shares: FloatArray) -> FloatArray:
    """Returns the values [n, ..] of polynomials [n, .., d+1], each at its own share [n]."""
    degree = coefficients.shape[-1] - 1
    k = np.arange(degree + 1)
    weights = _binomials(degree) * shares[:, None] ** k * (1 - shares[:, None]) ** (degree - k)
    shape = (len(shares), *(1,) * (coefficients.ndim - 2), degree + 1)
    result: FloatArray = (coefficients * weights.reshape(shape)).sum(axis=-1)
    return result


def ever_positive(conditions: list[FloatArray]) -> BoolArray:
    """Returns an array [N], True if all polynomials of a group are positive at the same moment.

    A group for which the opposite cannot be proved counts as True.

    Parameters
    ----------
    conditions : coefficients [N, n+1] of each polynomial of the groups
    """
    found = np.zeros(len(conditions[0]), dtype=np.bool_)
    index = np.arange(len(found))
    for _ in range(_DEEPEST):
        never = np.any([(part <= 0).all(axis=-1) for part in conditions], axis=0)
        once = np.zeros(len(index), dtype=np.bool_)
        for end in (0, -1):
            once |= np.all([part[:, end] > 0 for part in conditions], axis=0)
        found[index[once]] = True
        open_ = ~never & ~found[index]
        index = np.tile(index[open_], 2)
        conditions = [np.concatenate(parted(part[open_])) for part in conditions]
        if not len(index):
            return found
    found[index] = True
    return found


@lru_cache(maxsize=64)
def _binomials(degree: int) -> FloatArray:
    row = np.array([float(math.comb(degree, k)) for k in range(degree + 1)])
    row.setflags(write=False)
    return row
