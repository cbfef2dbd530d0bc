"""Concave returns: the value of a view sum, to which several drones may add.

A return phi is concave and non-decreasing, and phi(0) = 0. There are two:

- the root, phi(z) = sqrt(z), of the pixels z that drones have on a face;
- the count, phi(z) = min(z, k), of the number z of drones that see a person.

Hence phi is subadditive, and for any numbers alpha, beta >= 0 and all amounts c_i >= 0,

    phi(sum_i c_i) <= alpha sum_i phi(c_i) + beta sum_i c_i + kappa,
    kappa = sup over z >= 0 of (1 - alpha) phi(z) - beta z  if alpha < 1, else 0.

Proof: phi(z) = alpha phi(z) + (1 - alpha) phi(z) with z = sum_i c_i; the first part is at most
alpha sum_i phi(c_i), the second at most beta z + kappa. Bounds on J are based on this inequality.

To a count, each drone adds c = 0 or 1, so phi(c) = c: alpha and beta have the same effect, and only
their sum matters. Envelope cuts and arguments with phi(a z) = sqrt(a) phi(z) hold only for roots.
"""

import math
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray, IntArray


class Returns(NamedTuple):
    """The returns of a sequence of view sums: roots first, then counts.

    Attributes
    ----------
    n_roots : number of view sums whose return is the root
    caps : [Z - n_roots] k >= 1 of the counts; drones beyond this number add nothing
    """

    n_roots: int
    caps: FloatArray

    def values(self, amounts: FloatArray) -> FloatArray:
        """Returns phi of amounts [.., Z] of all view sums, without units or in px^0.5/m."""
        found: FloatArray = np.sqrt(amounts)
        if len(self.caps):
            found[..., self.n_roots :] = np.minimum(amounts[..., self.n_roots :], self.caps)
        return found

    def values_at(self, view_sums: IntArray | slice, amounts: FloatArray) -> FloatArray:
        """Returns phi of amounts [.., m] of some view sums [m]; a slice must contain only roots."""
        found: FloatArray = np.sqrt(amounts)
        if len(self.caps) and not isinstance(view_sums, slice):
            counts = np.flatnonzero(view_sums >= self.n_roots)
            caps = self.caps[view_sums[counts] - self.n_roots]
            found[..., counts] = np.minimum(amounts[..., counts], caps)
        return found

    def gains(self, amounts: FloatArray, view_sums: IntArray, more: FloatArray) -> FloatArray:
        """Returns the gains [m] if some view sums [m] increase by `more` [m] from amounts [Z]."""
        gains = self.values_at(view_sums, amounts[view_sums] + more)
        gains -= self.values(amounts)[view_sums]
        return gains

    def value_of(self, view_sum: int, amounts: FloatArray) -> FloatArray:
        """Returns phi of amounts of one view sum, in the same shape."""
        if view_sum < self.n_roots:
            return np.asarray(np.sqrt(amounts))
        return np.minimum(amounts, float(self.caps[view_sum - self.n_roots]))

    def slopes(self, amounts: FloatArray) -> FloatArray:
        """Returns slopes [.., Z] of tangents to phi at amounts > 0; 0 for counts at k or beyond."""
        found: FloatArray = 0.5 / np.sqrt(amounts)
        if len(self.caps):
            found[..., self.n_roots :] = amounts[..., self.n_roots :] < self.caps
        return found

    def kappas(
        self, alpha: FloatArray, beta: FloatArray, rest: FloatArray | float = 1.0
    ) -> FloatArray:
        """Returns kappa [Z] for alpha and beta [Z], with `rest` instead of 1.

        It is infinite for roots with alpha < 1 and beta = 0, and always finite for counts.
        """
        left = np.maximum(rest - alpha, 0.0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found: FloatArray = np.where(left > 0, left**2 / (4 * beta), 0.0)
        if len(self.caps):
            at = slice(self.n_roots, None)
            found[at] = self.caps * np.maximum(left[at] - beta[at], 0.0)
        return found

    def part(self, view_sums: IntArray) -> Self:
        """Returns the returns of some view sums [m], increasing."""
        n_roots = int(np.searchsorted(view_sums, self.n_roots))
        return type(self)(n_roots, self.caps[view_sums[n_roots:] - self.n_roots])


def return_of(n_roots: int, caps: FloatArray, view_sum: int, amount: float) -> float:
    """Returns phi of an amount of one view sum, as `Returns` does; numba can compile it."""
    if view_sum < n_roots:
        return math.sqrt(amount)
    cap: float = caps[view_sum - n_roots]
    return min(amount, cap)
