"""Mixtures under conflict rows and cuts, for scenes in which a master would take too long.

As in `mixtures.mixture_ascent`, the root of a view sum is a smooth minimum of its bounds, here
including the heights H of its cuts. Each bound has a share of the root's multiplier, in
proportion to its value to the power -(k+1). The multiplier of a conflict row rises with the excess
over one use, as in an augmented Lagrangian: mu <- max(0, mu + rho (uses - 1)). For any multipliers,
pricing gives a bound.
"""

from collections.abc import Sequence

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.state_cuts import AnyCut
from cocap_opt.formulations.relaxations.separation import phi_of
from cocap_opt.mixtures.mixture_ascent import SHARPNESS, MixtureProgram, together_of
from cocap_opt.model import PathCells

_DARK = 1e-6  # px^0.5/m: smaller roots count as zero, which avoids divisions by zero


class RuledProgram:
    """The amounts of some columns under conflict rows and cuts.

    Parameters
    ----------
    base : the program without rows and cuts
    along : path of each column [n]
    n_faces : number of faces, each of which has a view sum at each step
    uses : [n, rows] use of resources by columns
    charges : [rows] multipliers at one use
    steepness : increase of the multipliers per robot in excess
    least_share : share of a root's multiplier above which pixels have a multiplier of their own
    """

    def __init__(
        self, base: MixtureProgram, along: Sequence[PathCells], cuts: Sequence[AnyCut],
        n_faces: int, uses: sparse.csr_array, charges: FloatArray, steepness: float,
        least_share: float,
    ) -> None:  # fmt: skip
        self._base, self._uses = base, uses
        self._heights = _cut_heights(base, along, cuts, n_faces)
        self._charges, self._steepness, self._least_share = charges, steepness, least_share
        self._at = np.array([cut.view_sum for cut in cuts], dtype=np.int64)
        self._constants = np.array([cut.constant for cut in cuts])

    def _bounds(self, amounts: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Returns the bounds R, S and H on the roots of view sums, and their minimum."""
        alone = amounts @ self._base.roots
        together = together_of(self._base.returns, amounts @ self._base.pixels)
        heights = self._constants + amounts @ self._heights
        least = np.minimum(alone, together)
        np.minimum.at(least, self._at, heights)
        return alone, together, heights, least

    def value(self, amounts: FloatArray) -> float:
        """Returns the value of a mixture, ignoring conflicts."""
        least = self._bounds(amounts)[-1]
        seen = np.where(least > _DARK, least, 0.0)
        return float(self._base.weights @ seen + amounts @ self._base.bonus)

    def multipliers(
        self, amounts: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Returns alpha [Z], beta [Z], the shares [cuts] and the charges [rows] of a mixture."""
        at, (alone, together, heights, least) = self._at, self._bounds(amounts)
        seen = least > _DARK
        least = np.where(seen, least, 1.0)
        of_alone, of_together, of_cuts = (
            np.minimum(bounds / np.maximum(values, _DARK), 1.0) ** (SHARPNESS + 1)
            for bounds, values in ((least, alone), (least, together), (least[at], heights))
        )
        total = of_alone + of_together + np.bincount(at, of_cuts, minlength=len(least))
        total = np.where(seen, total, 1.0)
        share = of_together / total
        # With so small a beta, the rounding of alpha's remainder would dominate: beta is set to 0,
        # and alpha to slightly more than the share that cuts leave.
        nearly = share < self._least_share
        alpha = np.where(seen, of_alone / total + np.where(nearly, share + 1e-12, 0.0), 1.0)
        beta = np.where(seen & ~nearly, share / (2 * np.maximum(together, _DARK)), 0.0)
        beta[self._base.returns.n_roots :] = 0.0
        charges = self._charges + self._steepness * (amounts @ self._uses - 1)
        shares = np.where(seen[at], of_cuts / total[at], 0.0)
        return alpha, beta, shares, np.maximum(charges, 0.0)

    def gradient(self, amounts: FloatArray) -> FloatArray:
        """Returns the credit of each column under the multipliers, less its charges [n]."""
        alpha, beta, shares, charges = self.multipliers(amounts)
        prices = self._base.priced(alpha, beta)
        prices += self._heights @ (self._base.weights[self._at] * shares)
        prices -= self._uses @ charges
        return prices


def _cut_heights(
    base: MixtureProgram, along: Sequence[PathCells], cuts: Sequence[AnyCut], n_faces: int
) -> sparse.csr_array:
    """Returns the amounts by which each column raises the heights of cuts [n, cuts]."""
    by_view_sum = base.roots.tocsc()
    classes = np.array([path.class_number for path in along])
    states = np.array([path.states for path in along])
    values, at, ends = [np.zeros(0)], [np.zeros(0, dtype=np.int64)], [0]
    for cut in cuts:
        part = slice(*by_view_sum.indptr[cut.view_sum : cut.view_sum + 2])
        columns = by_view_sum.indices[part].astype(np.int64)
        then, roots = states[columns, cut.view_sum // n_faces], by_view_sum.data[part]
        values.append(phi_of(cut, classes[columns], then, roots))
        at.append(columns)
        ends.append(ends[-1] + len(columns))
    shape = len(classes), len(cuts)
    return sparse.csc_array((np.concatenate(values), np.concatenate(at), ends), shape).tocsr()
