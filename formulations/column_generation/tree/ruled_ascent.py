"""Mixture ascent under conflict rows and envelope cuts, where masters would take too long.

As in `mixture_ascent`, the root of a view sum is a smooth minimum of its bounds: of the sum of
roots R, of S = sqrt(sum of pixels), and here also of the heights H of its envelope cuts. Each
has a share of the root's multiplier, in proportion to its value to the power -(k+1).

A conflict row has a multiplier that rises with its excess over one use, as in an augmented
Lagrangian: mu <- max(0, mu + rho (uses - 1)). Whatever the multipliers, pricing gives a bound.
"""

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.master.alike_cuts import alike_cut
from cocap_opt.formulations.column_generation.master.columns import Column, users
from cocap_opt.formulations.column_generation.master.mixture import Mixture
from cocap_opt.formulations.column_generation.master.mixture_ascent import (
    SHARPNESS,
    MixtureProgram,
    joined,
    raised,
)
from cocap_opt.formulations.column_generation.master.pricing import Priced
from cocap_opt.formulations.column_generation.parameters import RuledAscentParameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.formulations.relaxations.separation import Seen, loose_view_sums
from cocap_opt.model import Model, Path

_DARK = 1e-6  # px^0.5/m: a root below it is none, so that nothing is divided by it


class RuledAscent:
    """A mixture that is raised under rules and cuts.

    Attributes
    ----------
    best : the best bound so far with its multipliers
    value : of the mixture, without regard for conflicts
    columns : all that pricing has found
    rows : conflict rows so far
    cuts : envelope cuts so far
    """

    def __init__(self, search: Search, mixture: Mixture, best: Priced) -> None:
        self._search, self._priced = search, best
        self.mixture, self.best, self.value = mixture, best, -np.inf
        self.columns: dict[tuple[int, Path], Column] = {}
        self.rows: dict[Resource, int] = {}
        self.cuts: list[Cut] = []
        self._charges = np.zeros(0)  # [rows] multipliers
        self._shares = np.zeros(0)  # [cuts] of their roots
        self._in_vain: dict[int, float] = {}  # what could be cut off, by view sum without a cut
        horizon, robots = search.model.problem.horizon, len(search.model.problem.robots)
        self._steepness = self._parameters.steepness * best.bound / (horizon * robots)
        self._add_columns()

    @property
    def _parameters(self) -> RuledAscentParameters:
        return self._search.parameters.ruled_ascent

    def step(self) -> None:
        """Adds rows, raises the mixture, and prices its multipliers; raises LimitReached."""
        self._add_rows()
        search, mixture = self._search, joined(self.mixture, self._priced.columns)
        base = MixtureProgram(search.model, mixture.columns)
        program = _RuledProgram(
            base, self.cuts, self._charges, self._steepness,
            _cut_heights(base, mixture.columns, self.cuts),
            _uses(search.model, mixture.columns, self.rows), self._parameters.least_share,
        )  # fmt: skip
        open_ = self.best.bound - self.value if self.value > 0 else np.inf
        amounts = raised(
            program.gradient,
            base.robots,
            mixture.amounts,
            search.parameters.ascent.rough * open_,
            search.stop,
            search.parameters.ascent,
            self._parameters.least_factor,
        )
        judged = program.judged(amounts)
        duals = judged.duals(self.rows, self.cuts)
        self.value, self._charges, self._shares = judged.value, judged.charges, judged.shares
        self._priced = search.pricer(duals)
        self.best = min(self.best, self._priced, key=lambda pricing: pricing.bound)
        kept = np.flatnonzero(amounts > self._parameters.least_amount)
        self.mixture = Mixture([mixture.columns[n] for n in kept.tolist()], amounts[kept])
        self._add_columns()

    def _add_columns(self) -> None:
        """Remembers the columns that pricing has found."""
        self.columns.update((column.key, column) for column in self._priced.columns)
        self._search.columns = max(self._search.columns, len(self.columns))

    def _add_rows(self) -> None:
        """Adds the conflict rows that the mixture breaks."""
        for resource in self.mixture.violated_rows(self._search.model, self._parameters.broken):
            self.rows.setdefault(resource, len(self.rows))
        new = len(self.rows) - len(self._charges)
        self._charges = np.append(self._charges, np.zeros(new))

    # -- cuts ----------------------------------------------------------------------------

    def add_cuts(self) -> int:
        """Adds the envelope cuts that the mixture breaks most, and returns how many.

        Those without a share are dropped.

        Raises
        ------
        LimitReached
            Between two cuts.
        """
        search = self._search
        self.cuts = [
            self.cuts[k]
            for k in np.flatnonzero(self._shares > self._parameters.least_amount).tolist()
        ]
        added = []
        loose = loose_view_sums(
            self._seen_by_equals(), self.cuts, search.weights, search.model.class_sizes,
            self._parameters.least_cut * abs(self.best.bound), search.stop,
        )  # fmt: skip
        loose = [
            loose_sum
            for loose_sum in loose
            if loose_sum.most >= self._parameters.again * self._in_vain.get(loose_sum.view_sum, 0.0)
        ]
        for loose_sum in loose[: self._parameters.most_cuts]:
            search.stop.check()
            search.report_again()
            number = int(loose_sum.seen.classes[0])
            cut = alike_cut(
                loose_sum.view_sum, loose_sum.seen,
                float(search.largest[number, loose_sum.view_sum]),
                search.model.class_sizes[number], loose_sum.height, loose_sum.least,
                search.parameters.alike_cuts,
            )  # fmt: skip
            if cut is None:
                self._in_vain[loose_sum.view_sum] = loose_sum.most
            else:
                added.append(cut)
        self.cuts += added
        self._shares = np.ones(len(self.cuts))
        return len(added)

    def _seen_by_equals(self) -> Iterator[tuple[int, Seen]]:
        """Yields the view sums that robots of a single class see; those of several are not alike.

        It raises LimitReached between two of them.
        """
        for view_sum, seen in self.mixture.seen():
            self._search.stop.check()
            if seen.classes.min() == seen.classes.max():
                yield view_sum, seen


class _Multipliers(NamedTuple):
    """The value of a mixture, and its multipliers."""

    value: float
    alpha: FloatArray  # [Z]
    beta: FloatArray  # [Z]
    shares: FloatArray  # [cuts]
    charges: FloatArray  # [rows]

    def duals(self, rows: dict[Resource, int], cuts: Sequence[Cut]) -> Duals:
        """Returns the multipliers with the rows and the cuts that they belong to."""
        return Duals(
            self.alpha,
            self.beta,
            tuple(zip(rows, self.charges.tolist(), strict=True)),
            tuple(zip(cuts, self.shares.tolist(), strict=True)),
        )


class _RuledProgram:
    """The amounts of some columns, under conflict rows and envelope cuts.

    Parameters
    ----------
    base : the same without them
    charges : [rows] multipliers at a use of 1
    steepness : by how much they rise with each robot too many
    heights : [n, cuts] by how much a column raises the heights of cuts
    uses : [n, rows] of resources by columns
    least_share : of a root's multiplier, from which on pixels have one of their own
    """

    def __init__(
        self, base: MixtureProgram, cuts: Sequence[Cut], charges: FloatArray, steepness: float,
        heights: sparse.csr_array, uses: sparse.csr_array,
        least_share: float,
    ) -> None:  # fmt: skip
        self._base, self._heights, self._uses = base, heights, uses
        self._charges, self._steepness, self._least_share = charges, steepness, least_share
        self._at = np.array([cut.view_sum for cut in cuts], dtype=np.int64)
        self._constants = np.array([cut.constant for cut in cuts])

    def judged(self, amounts: FloatArray) -> _Multipliers:
        """Returns the value of a mixture, and the multipliers of its view sums and rows."""
        base, at = self._base, self._at
        alone, together = amounts @ base.roots, np.sqrt(amounts @ base.pixels)
        heights = self._constants + amounts @ self._heights
        least = np.minimum(alone, together)
        np.minimum.at(least, at, heights)
        seen = least > _DARK
        least = np.where(seen, least, 1.0)
        of_alone, of_together, of_cuts = (
            np.minimum(bounds / np.maximum(values, _DARK), 1.0) ** (SHARPNESS + 1)
            for bounds, values in ((least, alone), (least, together), (least[at], heights))
        )
        total = of_alone + of_together + np.bincount(at, of_cuts, minlength=len(least))
        total = np.where(seen, total, 1.0)
        share = of_together / total
        # The rounding of what alpha leaves would outweigh so small a beta: it has none, and alpha
        # a little more than is left.
        nearly = share < self._least_share
        alpha = np.where(seen, of_alone / total + np.where(nearly, share + 1e-12, 0.0), 1.0)
        beta = np.where(seen & ~nearly, share / (2 * np.maximum(together, _DARK)), 0.0)
        charges = self._charges + self._steepness * (amounts @ self._uses - 1)
        value = base.weights @ np.where(seen, least, 0.0) + amounts @ base.bonus
        shares = np.where(seen[at], of_cuts / total[at], 0.0)
        return _Multipliers(float(value), alpha, beta, shares, np.maximum(charges, 0.0))

    def gradient(self, amounts: FloatArray) -> FloatArray:
        """Returns what the multipliers of a mixture pay for each column [n], less its charges."""
        base, judged = self._base, self.judged(amounts)
        prices = base.priced(judged.alpha, judged.beta)
        prices += self._heights @ (base.weights[self._at] * judged.shares)
        prices -= self._uses @ judged.charges
        return prices


def _cut_heights(
    base: MixtureProgram, columns: Sequence[Column], cuts: Sequence[Cut]
) -> sparse.csr_array:
    """Returns by how much each column raises the heights of cuts [n, cuts]."""
    by_view_sum = base.roots.tocsc()
    classes = np.array([column.along.class_number for column in columns])
    values, at, ends = [np.zeros(0)], [np.zeros(0, dtype=np.int64)], [0]
    for cut in cuts:
        part = slice(*by_view_sum.indptr[cut.view_sum : cut.view_sum + 2])
        at.append(by_view_sum.indices[part].astype(np.int64))
        values.append(cut.phi_of(classes[at[-1]], by_view_sum.data[part]))
        ends.append(ends[-1] + len(at[-1]))
    shape = len(columns), len(cuts)
    return sparse.csc_array((np.concatenate(values), np.concatenate(at), ends), shape).tocsr()


def _uses(model: Model, columns: Sequence[Column], rows: Collection[Resource]) -> sparse.csr_array:
    """Returns which resources columns use [n, rows]."""
    horizon = model.problem.horizon
    using = users(model, [arc for column in columns for arc in column.arcs], [*rows])
    at = np.repeat(np.arange(len(rows)), [len(arcs) for arcs in using])
    of = np.array([arc // horizon for arcs in using for arc in arcs], dtype=np.int64)
    return sparse.csr_array((np.ones(len(of)), (of, at)), (len(columns), len(rows)))
