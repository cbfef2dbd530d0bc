"""The relaxation of a node of the search, solved over the paths that matter.

Restricted master (`master`) and pricing (`pricing`) take turns. Every iteration's multipliers
are a certificate; conflict rows and envelope cuts are added when a mixture breaks them; every
mixture is a source of plans (`primal`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates.certificate import Decision
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import violated_rows
from cocap_opt.formulations.column_generation.master import BEST_ACCURACY, Column, Master, Solution
from cocap_opt.formulations.column_generation.pricing import Priced
from cocap_opt.formulations.column_generation.primal import improved
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.relaxations import separation
from cocap_opt.formulations.relaxations.duals import blended
from cocap_opt.formulations.relaxations.separation import Seen
from cocap_opt.stop import Limit, begin_work

ACCURACY = 2e-7  # of the bound: where bound and master agree to this, they have converged
WORST_ACCURACY = 1e-5  # of the master
BROKEN = 1e-6  # uses of a resource in excess of the rule that are left alone
LEAST_CUT = 2e-6  # of the bound: what an envelope cut must cut off
MOST_CUT_ROUNDS = 20
TAIL = 1e-5  # of the bound: what a round of cuts must gain for another one
TAIL_OPEN = 0.05  # of what is open to the cutoff, likewise
MOST_PENALTY_RAISES = 8
SMOOTHING = (0.25, 0.5, 0.75)  # shares of the master's multipliers; the best ones have the rest
FIRST_PLAN = 8  # iterations, and twice as many each time, after which plans are looked for
KICK = 4  # iterations after which the incumbent is kicked
MANY_ARCS = 2000  # of a master beside whose solves kicks are cheap: then every one
MOST_IDLE = 12  # solves after which an unused column is dropped


@dataclass
class Relaxation:
    """The relaxation under some decisions: a node of the search.

    Attributes
    ----------
    best : the best bound so far with its multipliers
    solution : the last mixture
    limit : what stopped it; NONE where it has converged or is cut off
    """

    search: Search
    master: Master
    best: Priced
    decisions: tuple[Decision, ...] = ()
    solution: Solution | None = None
    limit: Limit = Limit.NONE
    iterations: int = 0
    cut_rounds: int = 0
    raises: int = 0  # of the penalty

    def solve(
        self,
        cutoff: Callable[[], float],
        rough: float = 0.0,
        others: float = -np.inf,
        nodes: int = 0,
        rounds: int = MOST_CUT_ROUNDS,
    ) -> None:
        """Solve and price in turn until the bound is at most the cutoff, or has converged.

        Parameters
        ----------
        cutoff : bound from which on the node is of no interest; it may rise meanwhile
        rough : share of what is open to the cutoff that convergence may leave
        others, nodes : largest bound of the other nodes and how many have been solved, for
            the report
        rounds : most rounds of cuts
        """
        search, before = self.search, np.inf
        while (open_ := self.best.bound - cutoff()) > 0:
            begin_work(search.stop)
            self.limit = search.stop()
            if self.limit is not Limit.NONE:
                return
            wanted = max(ACCURACY * abs(self.best.bound), rough * open_)
            solution, columns, improves = self._iterate(wanted)
            self._improve_plans()
            search.report(search.snapshot(max(self.best.bound, others), nodes))
            converged = self.best.bound - solution.value <= wanted
            rows = self._add_rows(solution)
            if (rows or not converged) and self._add_columns(columns) + rows:
                continue
            if not solution.solved and not improves:
                limit = search.stop()
                self.limit = Limit.NUMERICS if limit is Limit.NONE else limit
                return
            if solution.slack > BROKEN * 10:
                # Rows are still paid for: either there is no plan or the penalty is too low.
                if self.raises == MOST_PENALTY_RAISES:
                    self.limit = Limit.NUMERICS
                    return
                self.master.penalty *= 10
                self.raises += 1
                continue
            gain, before = before - self.best.bound, self.best.bound
            tailing = gain < max(TAIL * abs(before), TAIL_OPEN * min(open_, abs(before)))
            if (tailing and self.cut_rounds) or self.cut_rounds >= rounds:
                return
            self.cut_rounds += 1
            if not self._add_cuts(solution):
                return

    def _iterate(self, wanted: float) -> tuple[Solution, list[Column], bool]:
        """Solve the master, price its multipliers and some between them and the best so far.

        Returns
        -------
        solution, columns : of the master, and of the pricing
        improves : whether the master's own multipliers are the best so far
        """
        search, best = self.search, self.best
        self.iterations += 1
        accuracy = min(max(wanted / 10 / search.scale, BEST_ACCURACY), WORST_ACCURACY)
        solution = self.solution = self.master.solve(search.stop, accuracy)
        priced = search.pricer(solution.duals, self.decisions)
        # Some way to the best multipliers so far (Wentges 1997): they oscillate less.
        between = [
            search.pricer(blended(solution.duals, best.duals, share), self.decisions)
            for share in SMOOTHING
        ]
        self.best = min(best, priced, *between, key=lambda some: some.bound)
        columns = [column for some in (priced, *between) for column in some.columns]
        return solution, columns, priced.bound < best.bound

    def _improve_plans(self) -> None:
        """Now and then look for plans in the mixture, and between kick the best one."""
        if self.iterations < FIRST_PLAN:
            return
        if self.iterations & (self.iterations - 1) == 0:  # 8, 16, 32, ..
            self.look_for_plans()
        elif len(self.master.arcs) > MANY_ARCS or self.iterations % KICK == 0:
            self.search.kick(self.master.arcs)

    def look_for_plans(self) -> None:
        """Offer what rounding and local search make of the last mixture."""
        search, solution = self.search, self.solution
        if solution is not None:
            search.offer(
                improved(
                    search.model, solution.columns, solution.mixture, self.master.arcs, search.stop
                )
            )

    def _add_rows(self, solution: Solution) -> int:
        """Take in the conflict rows that the mixture breaks, and return how many."""
        pairs = zip(solution.columns, solution.mixture.tolist(), strict=True)
        flights = [(column.flight, amount) for column, amount in pairs if amount > 1e-9]
        broken = violated_rows(self.search.model, flights, BROKEN)
        return sum(self.master.add_row(resource) for resource in broken)

    def _add_columns(self, columns: Sequence[Column]) -> int:
        """Take in columns, and return how many are new; what has long been idle is dropped."""
        # The longer it takes, the longer arcs are kept: else the same ones come and go.
        self.master.drop_idle(MOST_IDLE + self.iterations // 8)
        added = sum(self.master.add(column) for column in columns)
        self.search.columns += added
        return added

    def _add_cuts(self, solution: Solution) -> bool:
        """Take in the envelope cuts that the mixture breaks; False if there are none."""
        search, found = self.search, 0
        if search.model.problem.objective.over_time:  # a robot sees a view sum more than once
            return False
        sizes = search.model.class_sizes
        self.master.drop_cuts(solution.duals)
        known: dict[int, list[Cut]] = {}
        for cut in self.master.cuts:
            known.setdefault(cut.view_sum, []).append(cut)
        for view_sum, seen in seen_in(solution.columns, solution.mixture):
            weight = float(search.weights[view_sum])
            if weight == 0 or search.stop() is not Limit.NONE:
                continue
            height = min(
                float(np.sqrt(seen.amounts @ seen.roots**2)), float(seen.amounts @ seen.roots)
            )
            height = min([height, *(seen.height(cut) for cut in known.get(view_sum, []))])
            least = LEAST_CUT * abs(self.best.bound) / weight
            if seen.is_exact(sizes) or height - separation.coupled(seen, sizes) < least:
                continue
            largest = search.largest[:, view_sum]
            best = separation.best_cut(view_sum, seen, largest, sizes, height, least)
            if best is not None:
                self.master.add_cut(best[0])
                found += 1
        return found > 0


def seen_in(columns: Sequence[Column], mixture: FloatArray) -> list[tuple[int, Seen]]:
    """Groups that a mixture sees, and what it sees of them."""
    used = np.flatnonzero(mixture > 1e-7).tolist()
    view_sums = np.concatenate([np.zeros(0, dtype=np.int64), *(columns[n].view_sums for n in used)])
    if not len(view_sums):
        return []
    roots = np.sqrt(np.concatenate([columns[n].pixels for n in used]))
    counts = [len(columns[n].view_sums) for n in used]
    amounts = np.repeat(mixture[used], counts)
    classes = np.repeat([columns[n].flight.class_number for n in used], counts)
    order = np.argsort(view_sums, kind="stable")
    distinct, first = np.unique(view_sums[order], return_index=True)
    parts = np.split(order, first[1:])
    return [
        (g, Seen(classes[p], roots[p], amounts[p]))
        for g, p in zip(distinct.tolist(), parts, strict=True)
    ]
