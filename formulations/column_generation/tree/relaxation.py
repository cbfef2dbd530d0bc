"""Solves the relaxation of a node of the search over a growing set of paths.

The restricted master (`master`) and pricing (`pricing`) alternate. Every iteration's multipliers
form a certificate; conflict rows and envelope cuts are added when a mixture violates them; every
mixture is a source of plans (`local_search`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cocap_opt.formulations.certificates import CertificateFile, Decision
from cocap_opt.formulations.column_generation.master.master import BEST_ACCURACY, Master
from cocap_opt.formulations.column_generation.master.master_program import Solution
from cocap_opt.formulations.column_generation.master.pricing import Priced
from cocap_opt.formulations.column_generation.master.resource_use import (
    roots_seen,
    violated_rows,
)
from cocap_opt.formulations.column_generation.parameters import RelaxationParameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.relaxations.separation import loose_view_sums
from cocap_opt.formulations.result import certify
from cocap_opt.mixtures.columns import Column

_LEAST_SHARE = 1e-6  # share of a cut in a solution; cuts with larger shares are kept


@dataclass
class Relaxation:
    """The relaxation under some decisions: a node of the search.

    Attributes
    ----------
    best : the best bound so far, with its multipliers
    solution : the last mixture
    is_stuck : True if the last call of `solve` ended because of the solver's accuracy
    cuts_end : True if searching for more cuts is not worthwhile
    has_searched_by_prices : True if plans have been searched for where the prices suggest
    """

    search: Search
    master: Master
    best: Priced
    decisions: tuple[Decision, ...] = ()
    solution: Solution | None = None
    is_stuck: bool = False
    iterations: int = 0
    cut_rounds: int = 0
    cuts_end: bool = False
    raises: int = 0  # how often the penalty has been raised
    has_searched_by_prices: bool = False

    def solve(
        self,
        cutoff: Callable[[], float],
        rough: float = 0.0,
        others: float = -np.inf,
        nodes: int = 0,
        rounds: int | None = None,
        until_cuts: bool = False,
        try_to_prove: Callable[[], bool] = lambda: False,
    ) -> None:
        """Alternates solving and pricing until the bound is at most the cutoff, or has converged.

        Parameters
        ----------
        cutoff : bound at or below which the node is pruned; it may rise during the call
        rough : share of the gap to the cutoff at which convergence is sufficient
        others, nodes : largest bound of the other nodes and number of solved nodes, for the report
        rounds : largest number of rounds of cuts; None: as set in the parameters
        until_cuts : True: return before searching for cuts
        try_to_prove : called before each round of cuts except the first; if it returns True, the
            call ends

        Raises
        ------
        LimitReached
            If a limit is reached; `best` is then the best bound so far.
        """
        search, before = self.search, np.inf
        most_rounds = self._parameters.most_cut_rounds if rounds is None else rounds
        self.is_stuck = False
        while (open_ := self.best.bound - cutoff()) > 0:
            search.stop.begin_work()
            search.allow_responses()
            wanted = max(self._parameters.accuracy * abs(self.best.bound), rough * open_)
            solution, columns, improves = self._iterate(wanted)
            search.report(search.snapshot(max(self.best.bound, others), nodes))
            may_cut = self.cut_rounds < most_rounds and not self.cuts_end
            enough = max(wanted, self._parameters.early * open_) if may_cut else wanted
            if self._enlarge_master(solution, columns, enough):
                continue
            if not solution.is_solved and not improves:
                search.stop.check()  # a limit ends solves of the master, too
                self.is_stuck = True
                return
            if solution.slack > self._parameters.broken * 10:
                # Rows are still violated at the penalty: either no plan exists or the penalty is
                # too low.
                if self.raises == self._parameters.most_penalty_raises:
                    self.is_stuck = True
                    return
                self.master.penalty *= 10
                self.raises += 1
                continue
            if not may_cut or until_cuts:
                return
            if self.cut_rounds and try_to_prove():
                return
            gain, before = before - self.best.bound, self.best.bound
            tailing = self.cut_rounds > 0 and self._is_tailing(gain, open_)
            self.cut_rounds += 1
            self.cuts_end = tailing or not self._add_cuts(solution)
            self._add_columns(columns)
            self._improve_plans()

    @property
    def _parameters(self) -> RelaxationParameters:
        return self.search.parameters.relaxation

    def certificate(self, method: str) -> CertificateFile:
        """Returns the certificate of the best bound so far, without decisions, for the given
        method.
        """
        model = self.search.model
        return certify(model.problem, model, method, self.best.duals.certificate(model))

    def _iterate(self, wanted: float) -> tuple[Solution, list[Column], bool]:
        """Solves the master, and prices its multipliers and some between them and the best so far.

        Returns
        -------
        The solution, the columns of the pricing, and True if the master's own multipliers are the
        best so far.
        """
        search, best = self.search, self.best
        self.iterations += 1
        accuracy = min(
            max(wanted / 10 / search.scale, BEST_ACCURACY), self._parameters.worst_accuracy
        )
        solution = self.solution = self.master.solve(search.stop, accuracy)
        priced = search.pricer(solution.duals, self.decisions)
        # Part of the way to the best multipliers so far (Wentges 1997), which oscillate less.
        between = [
            search.pricer(solution.duals.blended(best.duals, share), self.decisions)
            for share in self._parameters.smoothing
        ]
        for pricing in (priced, *between):
            self.offer(pricing)
        columns = [column for part in (priced, *between) for column in part.columns]
        return solution, columns, priced.bound < best.bound

    def step(self) -> tuple[Solution, list[Column]]:
        """Solves the master once, to the roughest accuracy, and adds columns and violated rows.

        Returns
        -------
        The solution, and the columns of its pricing.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        solution, columns, _ = self._iterate(np.inf)
        self._enlarge_master(solution, columns, -np.inf)
        return solution, columns

    def offer(self, priced: Priced) -> None:
        """Keeps a bound and its multipliers if it is the best so far."""
        self.best = min(self.best, priced, key=lambda pricing: pricing.bound)

    def _improve_plans(self) -> None:
        """Searches for plans in the mixture after cut rounds 1, 2, 4, ..; in other rounds, perturbs
        the incumbent.

        Skipped once prices have led to plans: on 18 scenes it then found no better plan.
        """
        search, rounds = self.search, self.cut_rounds
        if self.has_searched_by_prices:
            return
        if search.allowance.left < self._parameters.least_responses * len(
            search.model.problem.robots
        ):
            return
        if rounds & (rounds - 1) == 0:
            self.round_to_plans()
        else:
            search.perturb()

    def round_to_plans(self) -> None:
        """Offers the plans that local search makes from the last mixture, and recombinations of all
        plans.

        Raises
        ------
        LimitReached
            If a limit is reached during recombination.
        """
        if self.solution is None:
            return
        self.search.round_to_plans(self.solution.mixture)
        self._recombine()

    def search_by_prices(self, *, is_quick: bool = False) -> None:
        """Offers the plans that the prices suggest, and recombinations; raises LimitReached.

        Parameters
        ----------
        is_quick : True: stop after a few plans without improvement, and skip recombination
        """
        if self.solution is None:
            return
        if self.search.incumbent is None:
            self.round_to_plans()  # finds a first plan to begin with
        most_in_vain = self._parameters.few_in_vain if is_quick else None
        search = self.search.plan_search(most_in_vain)
        search.add_mixture(self.solution.mixture)
        self.search.search_by_prices(search, self.best.duals)
        self.has_searched_by_prices = True
        if not is_quick:
            self._recombine()

    def _recombine(self) -> None:
        if self.decisions or not self.search.can_recombine:
            return
        narrowing = self.search.narrowing(self.best.duals, self.search.value)
        if narrowing is not None:
            self.search.recombine(narrowing)

    def _enlarge_master(self, solution: Solution, columns: list[Column], wanted: float) -> int:
        """Adds violated conflict rows and, unless converged, columns; returns how many are new."""
        converged = self.best.bound - solution.value <= wanted
        broken = violated_rows(solution.mixture, self.search.model, self._parameters.broken)
        rows = sum(self.master.add_row(resource) for resource in broken)
        return rows if converged and not rows else self._add_columns(columns) + rows

    def _add_columns(self, columns: Sequence[Column]) -> int:
        """Adds columns and returns how many are new; drops columns that have long been unused."""
        # The longer the solve takes, the longer arcs are kept: otherwise the same arcs come and go.
        self.master.drop_idle(self._parameters.most_idle + self.iterations // 8)
        added = sum(self.master.add(column) for column in columns)
        self.search.columns += added
        return added

    def _is_tailing(self, gain: float, open_: float) -> bool:
        """Returns True if the last round of cuts gained too little to justify another."""
        bound = abs(self.best.bound)
        return gain < max(
            self._parameters.tail * bound, self._parameters.tail_open * min(open_, bound)
        )

    def _add_cuts(self, solution: Solution) -> bool:
        """Adds the envelope cuts that the mixture violates most; returns False if there are none.

        Raises
        ------
        LimitReached
            Between two cuts.
        """
        search, found, problem = self.search, False, self.search.model.problem
        if problem.objective.over_time:  # a robot sees a view sum more than once
            return False
        used = [cut for cut, share in solution.duals.cuts if share > _LEAST_SHARE]
        self.master.cuts = used
        loose = loose_view_sums(
            roots_seen(solution.mixture, problem), self.master.cuts, search.weights,
            search.model.class_sizes, self._parameters.least_cut * abs(self.best.bound),
            search.stop,
        )  # fmt: skip
        for candidate in loose[: self._parameters.most_cuts]:
            search.stop.check()
            search.report_again()
            cut = candidate.seen.best_cut(
                candidate.view_sum, search.largest[:, candidate.view_sum], search.model.class_sizes,
                candidate.height, candidate.least,
            )  # fmt: skip
            if cut is not None:
                self.master.cuts.append(cut)
                found = True
        return found
