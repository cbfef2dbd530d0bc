"""The root of scenes with very many robots: bound and plan in turn, without masters.

Where a master takes many seconds, three kinds of work take turns: mixtures are raised and priced
under rules and cuts (`ruled_ascent`), the plan is changed over the arcs of all columns that were
found (`arc_search`), and its robots answer one another over all arcs there are (`local_search`).
Each turn goes to the kind that has gained most when it was last at work; those that wait gain
prospects, since the others' work may bring them some.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.formulations.column_generation.master.columns import Column
from cocap_opt.formulations.column_generation.master.mixture import Mixture
from cocap_opt.formulations.column_generation.master.pricing import Priced
from cocap_opt.formulations.column_generation.parameters import LargeRootParameters
from cocap_opt.formulations.column_generation.primal.arc_search import ArcSearch
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.ruled_ascent import RuledAscent
from cocap_opt.model import Path


def is_large(search: Search) -> bool:
    """Returns True if masters of the search's model would take too long."""
    problem = search.model.problem
    return (
        len(problem.robots) > 1
        and len(problem.robots) * problem.horizon >= search.parameters.large_root.many_robot_steps
        and not problem.objective.over_time
    )


@dataclass
class LargeRoot:
    """The bound and the plan of a large scene.

    Attributes
    ----------
    found : columns of plans, beside those of the ascent
    """

    search: Search
    ascent: RuledAscent
    found: dict[tuple[int, Path], Column] = field(default_factory=dict)
    _turns: int = 0  # of the ascent, from which on cuts are looked for

    @classmethod
    def of(cls, search: Search, mixture: Mixture, best: Priced) -> "LargeRoot":
        """Returns the root with the mixture and the bound of a first ascent."""
        return cls(search, RuledAscent(search, mixture, best))

    @property
    def _parameters(self) -> LargeRootParameters:
        return self.search.parameters.large_root

    def begin(self) -> None:
        """Raises the mixture until it nearly obeys the rules.

        Raises
        ------
        LimitReached
            At a limit; the plan that the mixture gives so far is offered.
        """
        with self.search.rounding_at_a_limit(lambda: self.ascent.mixture):
            self._steps(self._parameters.first_steps)
            # Rows that come in at first cost more than they should: no bound is the best for a
            # while.
            for _ in range(self._parameters.first_steps, self._parameters.most_first_steps):
                if self._is_near():
                    break
                self._steps(1)

    def solve(self, cutoff: Callable[[], float]) -> None:
        """Raises the plan and lowers the bound until neither gains; raises LimitReached.

        Parameters
        ----------
        cutoff : bound at which nothing is open; it rises with the plan
        """
        kinds = (self._ascend, self._rearrange, self._respond)
        last, hopes = [np.inf] * len(kinds), [np.inf] * len(kinds)
        open_ = self.ascent.best.bound - cutoff()
        while open_ > 0 and max(last) > self._parameters.least_gain * open_:
            turn = int(np.argmax(hopes))
            kinds[turn]()
            before, open_ = open_, self.ascent.best.bound - cutoff()
            last[turn] = before - open_
            hopes = [hope * self._parameters.patience for hope in hopes]
            hopes[turn] = max(last[turn], self._parameters.least_gain * open_)

    def _tell(self) -> None:
        self.search.report(self.search.snapshot(self.ascent.best.bound))

    def _ascend(self) -> None:
        """Raises the mixture, with new cuts if it is near the bound."""
        if self._is_near() and self._turns % self._parameters.turns_per_cuts == 0:
            self.ascent.add_cuts()
        self._turns += self._is_near()
        self._steps(self._parameters.steps)

    def _is_near(self) -> bool:
        """Returns True if bound and mixture are near enough for cuts."""
        bound = self.ascent.best.bound
        return bound - self.ascent.value <= self._parameters.nearly * bound

    def _steps(self, count: int) -> None:
        for _ in range(count):
            self.search.stop.begin_work()
            self.ascent.step()
            self._tell()

    def _rearrange(self) -> None:
        """Changes the plan over the arcs that are known."""
        plan = self.search.incumbent
        if plan is None:
            return
        columns = {**self.ascent.columns, **self.found}
        search = self.search
        arcs = ArcSearch(
            search.model,
            plan,
            columns.values(),
            search.stop,
            search.report_again,
            self._parameters,
        )
        try:
            arcs.search(self._parameters.moves, search.rng)
        finally:
            self._take(arcs.plan())

    def _respond(self) -> None:
        """Lets each robot answer the others over all arcs."""
        search = self.search
        if search.incumbent is not None:
            robots = len(search.model.problem.robots)
            search.allowance.left = max(search.allowance.left, robots)
            self._take(search.local_search.with_best_responses(search.incumbent.columns))

    def _take(self, plan: Incumbent | None) -> None:
        """Offers a plan, whose columns others may use."""
        self.search.offer(plan)
        if plan is not None:
            self.found.update((column.key, column) for column in plan.columns)
        self._tell()
