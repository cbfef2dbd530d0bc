"""The root of scenes with very many robots: improves bound and plan in turn.

A master takes many seconds there. So four kinds of work alternate: the bound is lowered; the plan
is improved by the bound's prices (`mixtures.plan_search`), over the arcs of all known columns
(`arc_search`), or by its robots' responses to each other over all arcs (`local_search`). Each turn
goes to the kind with the largest expected gain: the gain of its last turn, which grows while it
waits, since the work of the others may help it.

The bound is lowered by a mixture that is improved and priced under rules and cuts
(`_RuledAscent`). Once that closes little of its gap, masters take over: they begin with the
columns, rows and cuts of the ascent, and it separates cuts from their mixtures: envelope cuts, and
once these are used up, state cuts.
"""

from collections.abc import Callable, Collection, Iterable, Sequence

import numpy as np
from scipy import sparse

from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.certificates.state_cuts import AnyCut
from cocap_opt.formulations.column_generation.master.alike_cuts import alike_cut
from cocap_opt.formulations.column_generation.master.arc_users import users_of
from cocap_opt.formulations.column_generation.master.master_program import Solution
from cocap_opt.formulations.column_generation.master.resource_use import roots_seen, violated_rows
from cocap_opt.formulations.column_generation.master.ruled_program import RuledProgram
from cocap_opt.formulations.column_generation.master.state_cuts import KERNEL as STATE_CUTS
from cocap_opt.formulations.column_generation.master.state_cuts import state_cut
from cocap_opt.formulations.column_generation.parameters import (
    LargeRootParameters,
    RuledAscentParameters,
)
from cocap_opt.formulations.column_generation.primal.arc_search import ArcSearch
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.tree.relaxation import Relaxation
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.formulations.relaxations.separation import LooseViewSum, loose_view_sums
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.mixture_ascent import (
    MixtureProgram,
    raised,
)
from cocap_opt.model import Model, Path


class _RuledAscent:
    """A mixture that is improved under rules and cuts.

    Parameters
    ----------
    relaxation : holds the best bound so far, with its multipliers

    Attributes
    ----------
    value : value of the mixture, ignoring conflicts
    columns : all columns that pricing has found
    rows : conflict rows so far
    cuts : envelope cuts so far
    """

    def __init__(self, relaxation: Relaxation, mixture: Mixture) -> None:
        self._relaxation, self._search = relaxation, relaxation.search
        self._priced = relaxation.best
        self.mixture, self.value = mixture, -np.inf
        self.columns: dict[tuple[int, Path], Column] = {}
        self.rows: dict[Resource, int] = {}
        self.cuts: list[AnyCut] = []
        self._charges = np.zeros(0)  # [rows] multipliers
        self._shares = np.zeros(0)  # [cuts] their shares of the roots
        # for each kind of cut and view sum, the possible reduction at the last search in vain
        self._in_vain: dict[str, dict[int, float]] = {}
        problem = self._search.model.problem
        of_a_step = relaxation.best.bound / (problem.horizon * len(problem.robots))
        self._steepness = self._parameters.steepness * of_a_step
        self.add_columns(self._priced.columns)

    @property
    def _parameters(self) -> RuledAscentParameters:
        return self._search.parameters.ruled_ascent

    @property
    def open(self) -> float:
        """Gap between the bound and the mixture."""
        return self._relaxation.best.bound - self.value

    def step(self) -> None:
        """Adds rows, improves the mixture, and prices its multipliers; raises LimitReached."""
        self._add_rows()
        search, mixture = self._search, self.mixture.joined(self._priced.columns)
        base = MixtureProgram(search.model, mixture.columns)
        program = RuledProgram(
            base, [column.along for column in mixture.columns], self.cuts, search.model.n_faces,
            _uses(search.model, mixture.columns, self.rows), self._charges, self._steepness,
            self._parameters.least_share,
        )  # fmt: skip
        open_ = self.open if self.value > 0 else np.inf
        amounts = raised(
            program.gradient, base.robots, mixture.amounts, search.parameters.ascent.rough * open_,
            search.stop, search.parameters.ascent, self._parameters.least_factor,
        )  # fmt: skip
        self.value = program.value(amounts)
        alpha, beta, self._shares, self._charges = program.multipliers(amounts)
        rows = tuple(zip(self.rows, self._charges.tolist(), strict=True))
        cuts = tuple(zip(self.cuts, self._shares.tolist(), strict=True))
        self._priced = search.pricer(Duals(alpha, beta, rows, cuts))
        self._relaxation.offer(self._priced)
        self.mixture = mixture.raised(amounts, self._parameters.least_amount)
        self.add_columns(self._priced.columns)

    def add_columns(self, columns: Iterable[Column]) -> None:
        """Stores columns that pricing has found."""
        self.columns.update((column.key, column) for column in columns)
        self._search.columns = max(self._search.columns, len(self.columns))

    def _add_rows(self) -> None:
        """Adds the conflict rows that the mixture violates."""
        for resource in violated_rows(self.mixture, self._search.model, self._parameters.broken):
            self.rows.setdefault(resource, len(self.rows))
        new = len(self.rows) - len(self._charges)
        self._charges = np.append(self._charges, np.zeros(new))

    def take(self, solution: Solution) -> None:
        """Goes on from the mixture and the cuts of a master."""
        self.mixture, self.value = solution.mixture, solution.value
        self.cuts = [cut for cut, _ in solution.duals.cuts]
        self._shares = np.array([share for _, share in solution.duals.cuts])

    # -- cuts ----------------------------------------------------------------------------

    def add_cuts(self) -> int:
        """Adds the cuts that the mixture violates most, and returns how many.

        Cuts without a share are dropped.

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
        before = len(self.cuts)
        if not search.model.problem.objective.over_time:  # otherwise no cut of a step holds
            self.cuts += self._round(self._cut_by_roots, self._parameters.least_cut)
            if len(self.cuts) - before < self._parameters.few_cuts and self._may_cut_by_states():
                self.cuts += self._round(
                    self._cut_by_states, search.parameters.state_cuts.least_cut
                )
        self._shares = np.ones(len(self.cuts))
        return len(self.cuts) - before

    def _may_cut_by_states(self) -> bool:
        """Returns True if no two robots may share a cell, and the search for cuts is compiled."""
        search = self._search
        return search.model.problem.rules.vertex and STATE_CUTS.takes_over_in_time(search.stop)

    def _round(self, cut_of: Callable[[LooseViewSum], AnyCut | None], least: float) -> list[AnyCut]:
        """Returns cuts of the view sums that the mixture violates most; raises LimitReached between
        two.

        Parameters
        ----------
        least : of the bound; smallest violation
        """
        search, added = self._search, list[AnyCut]()
        in_vain = self._in_vain.setdefault(cut_of.__name__, {})
        loose = loose_view_sums(
            roots_seen(self.mixture, search.model.problem), self.cuts, search.weights,
            search.model.class_sizes, least * abs(self._relaxation.best.bound), search.stop,
        )  # fmt: skip
        loose = [
            loose_sum
            for loose_sum in loose
            if loose_sum.most >= self._parameters.again * in_vain.get(loose_sum.view_sum, 0.0)
        ]
        for loose_sum in loose[: self._parameters.most_cuts]:
            search.stop.check()
            search.report_again()
            cut = cut_of(loose_sum)
            if cut is None:
                in_vain[loose_sum.view_sum] = loose_sum.most
            else:
                added.append(cut)
        return added

    def _cut_by_states(self, loose: LooseViewSum) -> AnyCut | None:
        """Returns the state cut that the mixture violates most."""
        search = self._search
        return state_cut(
            search.model, loose.view_sum, loose.seen, loose.height, loose.least,
            search.parameters.state_cuts,
        )  # fmt: skip

    def _cut_by_roots(self, loose: LooseViewSum) -> AnyCut | None:
        """Returns the envelope cut that the mixture violates most, if robots of one class alone see
        the view sum; robots of several classes are not alike.
        """
        search, number = self._search, int(loose.seen.classes[0])
        if (loose.seen.classes != number).any():
            return None
        return alike_cut(
            loose.view_sum, loose.seen, float(search.largest[number, loose.view_sum]),
            search.model.class_sizes[number], loose.height, loose.least,
            search.parameters.alike_cuts,
        )  # fmt: skip


def _uses(model: Model, columns: Sequence[Column], rows: Collection[Resource]) -> sparse.csr_array:
    """Returns a matrix [n, rows] with 1 if a column uses the resource of a row."""
    horizon = model.problem.horizon
    using = users_of(model, [arc for column in columns for arc in column.arcs], [*rows])
    at = np.repeat(np.arange(len(rows)), [len(arcs) for arcs in using])
    of = np.array([arc // horizon for arcs in using for arc in arcs], dtype=np.int64)
    return sparse.csr_array((np.ones(len(of)), (of, at)), (len(columns), len(rows)))


class LargeRoot:
    """The bound and the plan of a large scene.

    Parameters
    ----------
    relaxation : the relaxation of the root, with the best bound of a first ascent
    mixture : the mixture of that ascent
    cutoff : bound at which the root is closed; it rises with the plan
    rough : share of the gap to the cutoff at which masters have converged

    Attributes
    ----------
    found : columns of plans, in addition to those of the ascent
    """

    def __init__(
        self, relaxation: Relaxation, mixture: Mixture, cutoff: Callable[[], float], rough: float
    ) -> None:
        self.relaxation, self.search = relaxation, relaxation.search
        self.ascent = _RuledAscent(relaxation, mixture)
        self._cutoff, self._rough = cutoff, rough
        self.found: dict[tuple[int, Path], Column] = {}
        self._plan_search = self.search.plan_search()
        # the mixture and the plan of the last search by prices
        self._searched_mixture: Mixture | None = None
        self._searched_plan: Incumbent | None = None
        self._turns = 0  # turns near the bound; at some of them, cuts are added
        self._has_masters = False

    @property
    def _parameters(self) -> LargeRootParameters:
        return self.search.parameters.large_root

    def begin(self) -> None:
        """Improves the mixture until it nearly obeys the rules.

        Raises
        ------
        LimitReached
            If a limit is reached; the plan that the current mixture gives is offered.
        """
        with self.search.rounding_at_a_limit(lambda: self.ascent.mixture):
            self._steps(self._parameters.first_steps)
            # Rows that are added at first are priced too high: for a while, no bound improves on
            # the best.
            for _ in range(self._parameters.first_steps, self._parameters.most_first_steps):
                if self._is_near():
                    break
                self._steps(1)

    def solve(self) -> None:
        """Improves the plan and lowers the bound until neither gains; raises LimitReached."""
        kinds = (self._lower, self._search_by_prices, self._rearrange, self._respond)
        last, open_ = [np.inf] * len(kinds), self._open()
        # Responses over all states take long: they wait until the others gain little.
        hopes = [np.inf, np.inf, np.inf, self._parameters.least_gain * open_]
        while open_ > 0 and max(last) > self._parameters.least_gain * open_:
            turn = int(np.argmax(hopes))
            kinds[turn]()
            before, open_ = open_, self._open()
            last[turn] = before - open_
            hopes = [hope * self._parameters.patience for hope in hopes]
            hopes[turn] = max(last[turn], self._parameters.least_gain * open_)
        if not self._has_masters:
            self._hand_over()
        self.relaxation.master.cuts = [*self.ascent.cuts]

    @property
    def _bound(self) -> float:
        return self.relaxation.best.bound

    def _open(self) -> float:
        """Returns the gap between the bound and the cutoff."""
        return self._bound - self._cutoff()

    def _tell(self) -> None:
        self.search.report(self.search.snapshot(self._bound))

    def _has_converged(self) -> bool:
        """Returns True if further masters would lower the bound little without new cuts."""
        return self._has_masters and self.ascent.open <= self._rough * self._open()

    def _lower(self) -> None:
        """Lowers the bound, with new cuts if the mixture is close to it."""
        added = 0
        if self._is_near():
            if self._turns % self._parameters.turns_per_cuts == 0:
                added = self.ascent.add_cuts()
            self._turns += 1
        if not self._has_masters:
            self._ascend()
        elif added or not self._has_converged():
            self._solve_masters()

    def _is_near(self) -> bool:
        """Returns True if bound and mixture are close enough for cuts."""
        return self.ascent.open <= self._parameters.nearly * self._bound

    def _ascend(self) -> None:
        """Improves the mixture; if that closes too little of its gap, masters take over at once."""
        before, open_ = self._bound, self.ascent.open
        self._steps(self._parameters.steps)
        if before - self._bound < self._parameters.least_closed * open_:
            self._hand_over()
            self._solve_masters()

    def _hand_over(self) -> None:
        """Adds the columns and rows of the ascent to the master."""
        used = self.ascent.mixture.used(self.search.parameters.root.least_amount)
        self.relaxation.master.add_all((column for column, _ in used), self.ascent.rows, ())
        self._has_masters = True

    def _solve_masters(self) -> None:
        """Solves and prices masters, whose last mixture becomes that of the ascent."""
        relaxation, ascent = self.relaxation, self.ascent
        relaxation.master.cuts = [*ascent.cuts]
        for _ in range(self._parameters.masters):
            self.search.stop.begin_work()
            solution, columns = relaxation.step()
            ascent.add_columns(columns)
            if solution.is_solved:
                ascent.take(solution)
            self._tell()
            if self._has_converged():
                return

    def _steps(self, count: int) -> None:
        for _ in range(count):
            self.search.stop.begin_work()
            self.ascent.step()
            self._tell()

    def _search_by_prices(self) -> None:
        """Improves the plan by the prices of the best bound, and the paths of the mixture."""
        search, mixture = self.search, self.ascent.mixture
        if mixture is not self._searched_mixture:
            self._plan_search.add_mixture(mixture)
            self._searched_mixture = mixture
        is_searched = search.incumbent is self._searched_plan
        duals, starts = self.relaxation.best.duals, self._parameters.starts
        try:
            search.search_by_prices(self._plan_search, duals, starts, is_searched)
        finally:
            self._take(search.incumbent)
        self._searched_plan = search.incumbent

    def _rearrange(self) -> None:
        """Improves the plan over the known arcs."""
        plan = self.search.incumbent
        if plan is None:
            return
        columns = {**self.ascent.columns, **self.found}
        search = self.search
        arcs = ArcSearch(
            search.model, plan, columns.values(), search.stop, search.report_again, self._parameters
        )
        try:
            arcs.search(self._parameters.moves, search.rng)
        finally:
            self._take(arcs.plan())

    def _respond(self) -> None:
        """Lets each robot respond to the others over all arcs."""
        search = self.search
        if search.incumbent is not None:
            robots = len(search.model.problem.robots)
            search.allowance.left = max(search.allowance.left, robots)
            self._take(search.local_search.with_best_responses(search.incumbent.columns))

    def _take(self, plan: Incumbent | None) -> None:
        """Offers a plan, whose columns other robots may use."""
        self.search.offer(plan)
        if plan is not None:
            self.found.update((column.key, column) for column in plan.columns)
        self._tell()
