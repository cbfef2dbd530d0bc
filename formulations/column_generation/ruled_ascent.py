"""Mixture ascent under conflict rows and envelope cuts, where masters would take too long.

As in `mixture_ascent`, the root of a view sum is a smooth minimum of its bounds: of the sum of
roots R, of S = sqrt(sum of pixels), and here also of the heights H of its envelope cuts. Each
has a share of the root's multiplier, in proportion to its value to the power -(k+1).

A conflict row has a multiplier that rises with its excess over one use, as in an augmented
Lagrangian: mu <- max(0, mu + rho (uses - 1)). Whatever the multipliers, pricing gives a bound.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates import Cells, Cut, Moves, Resource, Swap
from cocap_opt.formulations.column_generation.alike_cuts import alike_cut
from cocap_opt.formulations.column_generation.columns import Column
from cocap_opt.formulations.column_generation.mixture import Mixture
from cocap_opt.formulations.column_generation.mixture_ascent import (
    SHARPNESS,
    MixtureProgram,
    joined,
)
from cocap_opt.formulations.column_generation.pricing import Priced
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.model import Path
from cocap_opt.problem import Cell
from cocap_opt.stop import Stop, never

POWER = 2.0  # of the gradient
MOST_STEPS = 60  # in which a mixture is raised between two pricings
ROUGH = 0.02  # of bound - value: what these steps may leave to gain
LEAST_AMOUNT = 1e-3  # of a robot, below which a column is dropped
BROKEN = 1e-3  # uses of a resource in excess of the rule that are left alone
# Charge of one robot too many at first, in units of the reward of a robot at a step.
STEEPNESS = 0.2
LEAST_FACTOR = 0.01  # of a column's amount in a step, before the power
LEAST_SHARE = 1e-9  # of the root's multiplier, from which on pixels have one of their own
LEAST_CUT = 1e-6  # of the bound: what an envelope cut must cut off
MOST_CUTS = 1500  # in a round, those that can cut off most
AGAIN = 1.5  # times as much as when none was found: then a cut of the view sum is looked for again
_DARK = 1e-6  # px^0.5/m

_ByCell = dict[tuple[int, Cell], list[int]]
_ByMove = dict[tuple[int, tuple[Cell, Cell]], list[int]]


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
        self._steepness = STEEPNESS * best.bound / (horizon * robots)
        self._add_columns()

    def step(self) -> None:
        """Adds rows, raises the mixture, and prices its multipliers; raises LimitReached."""
        self._add_rows()
        mixture = joined(self.mixture, self._priced.columns)
        base = MixtureProgram(self._search.model, mixture.columns)
        program = _RuledProgram(
            base, self.cuts, self._charges, self._steepness,
            _cut_heights(base, mixture.columns, self.cuts), _uses(mixture.columns, self.rows),
        )  # fmt: skip
        open_ = self.best.bound - self.value if self.value > 0 else np.inf
        amounts = program.raised(mixture.amounts, ROUGH * open_, self._search.stop)
        judged = program.judged(amounts)
        duals = judged.duals(self.rows, self.cuts)
        self.value, self._charges, self._shares = judged.value, judged.charges, judged.shares
        self._priced = self._search.pricer(duals)
        self.best = min(self.best, self._priced, key=lambda some: some.bound)
        kept = np.flatnonzero(amounts > LEAST_AMOUNT)
        self.mixture = Mixture([mixture.columns[n] for n in kept.tolist()], amounts[kept])
        self._add_columns()

    def _add_columns(self) -> None:
        """Remembers the columns that pricing has found."""
        self.columns.update((column.key, column) for column in self._priced.columns)
        self._search.columns = max(self._search.columns, len(self.columns))

    def _add_rows(self) -> None:
        """Adds the conflict rows that the mixture breaks."""
        for resource in self.mixture.violated_rows(self._search.model, BROKEN):
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
        self.cuts = [self.cuts[k] for k in np.flatnonzero(self._shares > LEAST_AMOUNT).tolist()]
        added = []
        for most, view_sum, seen, height in self._broken()[:MOST_CUTS]:
            search.stop.check()
            search.report_again()
            number, least = int(seen.classes[0]), self._least_cut(view_sum)
            robots = search.model.class_sizes[number]
            largest = float(search.largest[number, view_sum])
            cut = alike_cut(view_sum, seen, largest, robots, height, least)
            if cut is None:
                self._in_vain[view_sum] = most
            else:
                added.append(cut)
        self.cuts += added
        self._shares = np.ones(len(self.cuts))
        return len(added)

    def _least_cut(self, view_sum: int) -> float:
        """Returns what a cut of a view sum must cut off, px^0.5/m."""
        return LEAST_CUT * abs(self.best.bound) / float(self._search.weights[view_sum])

    def _broken(self) -> list["_Broken"]:
        """Returns the view sums of which something can be cut off, those with most first."""
        weights, sizes = self._search.weights, self._search.model.class_sizes
        known: dict[int, list[Cut]] = {}
        for cut in self.cuts:
            known.setdefault(cut.view_sum, []).append(cut)
        found = []
        for view_sum, seen in self.mixture.seen():
            self._search.stop.check()
            # Robots of several classes are no more alike.
            if not weights[view_sum] or seen.classes.min() < seen.classes.max():
                continue
            if seen.is_exact(sizes):
                continue
            roots = float(np.sqrt(seen.amounts @ seen.roots**2)), float(seen.amounts @ seen.roots)
            height = min(*roots, *(seen.height(cut) for cut in known.get(view_sum, [])))
            most = height - seen.coupled(sizes)
            least = max(self._least_cut(view_sum), AGAIN * self._in_vain.get(view_sum, 0.0))
            if most >= least:
                found.append(_Broken(most, view_sum, seen, height))
        return sorted(found, key=lambda one: (-one.most * weights[one.view_sum], one.view_sum))


class _Broken(NamedTuple):
    """A view sum whose part of the mixture lies above the envelope of what robots can see."""

    most: float  # that a cut can cut off, px^0.5/m
    view_sum: int
    seen: Seen
    height: float  # of the cuts that are known


class _Judged(NamedTuple):
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
    """

    def __init__(
        self, base: MixtureProgram, cuts: Sequence[Cut], charges: FloatArray, steepness: float,
        heights: sparse.csr_array, uses: sparse.csr_array,
    ) -> None:  # fmt: skip
        self._base, self._heights, self._uses = base, heights, uses
        self._charges, self._steepness = charges, steepness
        self._at = np.array([cut.view_sum for cut in cuts], dtype=np.int64)
        self._constants = np.array([cut.constant for cut in cuts])

    def raised(self, amounts: FloatArray, enough: float, stop: Stop = never) -> FloatArray:
        """Returns amounts of a larger value, at best by all but `enough`; raises LimitReached."""
        base, robots = self._base, int(self._base.robots.max()) + 1
        for _ in range(MOST_STEPS):
            stop.check()
            gradient = self._gradient(self.judged(amounts))
            lowest, largest = np.zeros(robots), np.full(robots, -np.inf)
            np.minimum.at(lowest, base.robots, gradient)
            np.maximum.at(largest, base.robots, gradient)
            mean = base.by_robot(amounts * gradient)
            if (largest - mean).sum() <= enough:
                break
            # Charges may outweigh what a column is paid.
            above, mean = gradient - lowest[base.robots], (mean - lowest)[base.robots]
            factors = np.divide(above, mean, out=np.ones_like(mean), where=mean > _DARK)
            factors = np.maximum(factors, LEAST_FACTOR)
            amounts = amounts * factors**POWER
            amounts = amounts / base.by_robot(amounts)[base.robots]
        return amounts

    def judged(self, amounts: FloatArray) -> _Judged:
        """Returns the value of a mixture, and the multipliers of its view sums and rows."""
        base, at = self._base, self._at
        alone, together = amounts @ base.roots, np.sqrt(amounts @ base.pixels)
        heights = self._constants + amounts @ self._heights
        least = np.minimum(alone, together)
        np.minimum.at(least, at, heights)
        seen = least > _DARK
        least = np.where(seen, least, 1.0)
        of_alone, of_together, of_cuts = (
            np.minimum(own / np.maximum(values, _DARK), 1.0) ** (SHARPNESS + 1)
            for own, values in ((least, alone), (least, together), (least[at], heights))
        )
        total = of_alone + of_together + np.bincount(at, of_cuts, minlength=len(least))
        total = np.where(seen, total, 1.0)
        share = of_together / total
        # The rounding of what alpha leaves would outweigh so small a beta: it has none, and alpha
        # a little more than is left.
        nearly = share < LEAST_SHARE
        alpha = np.where(seen, of_alone / total + np.where(nearly, share + 1e-12, 0.0), 1.0)
        beta = np.where(seen & ~nearly, share / (2 * np.maximum(together, _DARK)), 0.0)
        charges = self._charges + self._steepness * (amounts @ self._uses - 1)
        value = base.weights @ np.where(seen, least, 0.0) + amounts @ base.bonus
        shares = np.where(seen[at], of_cuts / total[at], 0.0)
        return _Judged(float(value), alpha, beta, shares, np.maximum(charges, 0.0))

    def _gradient(self, judged: _Judged) -> FloatArray:
        """Returns what multipliers pay for each column [n]."""
        base = self._base
        paid = base.roots @ (base.weights * judged.alpha) + base.bonus
        paid += base.pixels @ (base.weights * judged.beta)
        paid += self._heights @ (base.weights[self._at] * judged.shares)
        paid -= self._uses @ judged.charges
        return np.asarray(paid)


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


def _uses(columns: Sequence[Column], rows: dict[Resource, int]) -> sparse.csr_array:
    """Returns which resources columns use [n, rows]."""
    places, moves = _numbers_of_users(rows)
    of, used = list[int](), list[int]()
    for n, column in enumerate(columns):
        cells = column.along.cells
        found = [k for t, cell in enumerate(cells) for k in places.get((t, cell), ())]
        for t in range(len(cells) - 1):
            found += moves.get((t, (cells[t], cells[t + 1])), ())
        of += [n] * len(found)
        used += found
    index: tuple[IntArray, IntArray] = np.array(of, dtype=np.int64), np.array(used, dtype=np.int64)
    return sparse.csr_array((np.ones(len(of)), index), (len(columns), len(rows)))


def _numbers_of_users(rows: dict[Resource, int]) -> tuple[_ByCell, _ByMove]:
    """Returns the numbers of the resources by step and cell, and by step and move."""
    places: _ByCell = {}
    moves: _ByMove = {}
    for resource, number in rows.items():
        t = resource.t
        if isinstance(resource, Cells):
            for cell in resource.cells:
                places.setdefault((t, cell), []).append(number)
        elif isinstance(resource, Swap):
            for move in (resource.cells, resource.cells[::-1]):
                moves.setdefault((t, (move[0], move[1])), []).append(number)
        elif isinstance(resource, Moves):
            for move in resource.moves:
                moves.setdefault((t, move), []).append(number)
    return places, moves
