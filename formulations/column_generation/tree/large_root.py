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
from cocap_opt.formulations.column_generation.primal.arc_search import ArcSearch
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.ruled_ascent import RuledAscent
from cocap_opt.model import Model, Path

# Robots times steps, from which on masters take too long: one of field-large's 64 drones and 40
# steps takes six to eight seconds, and gains next to nothing.
MANY_ROBOT_STEPS = 1500
# Of the ascent before there is any plan: as many as new rows need to become worth their cost, and
# no more than leave time for plans where bound and mixture do not come near.
FIRST_STEPS, MOST_FIRST_STEPS = 20, 80
STEPS = 5  # of the ascent in a turn, to settle after new rows and cuts
TURNS_PER_CUTS = 3  # of the ascent: cuts take as long as several turns, and need some to settle
# Of the bound: cuts are looked for once bound and mixture are nearer. Further off, a mixture breaks
# cuts that the next one does not.
NEARLY = 0.004
MOVES = 250  # of the plan in a turn; all three kinds take about as long then
PATIENCE = 1.2  # times its last gain: what is expected of a kind of work after each turn of others
# Of what is open, that a turn must gain for more of its kind. It is also what is expected at least
# of a kind that gained nothing, so that each has another turn before all end.
LEAST_GAIN = 5e-4


def is_large(model: Model) -> bool:
    """Returns True if masters of a model would take too long."""
    problem = model.problem
    return (
        len(problem.robots) > 1
        and len(problem.robots) * problem.horizon >= MANY_ROBOT_STEPS
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

    def begin(self) -> None:
        """Raises the mixture until it nearly obeys the rules.

        Raises
        ------
        LimitReached
            At a limit; the plan that the mixture gives so far is offered.
        """
        with self.search.rounding_at_a_limit(lambda: self.ascent.mixture):
            self._steps(FIRST_STEPS)
            # Rows that come in at first cost more than they should: no bound is the best for a
            # while.
            for _ in range(FIRST_STEPS, MOST_FIRST_STEPS):
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
        while open_ > 0 and max(last) > LEAST_GAIN * open_:
            turn = int(np.argmax(hopes))
            kinds[turn]()
            before, open_ = open_, self.ascent.best.bound - cutoff()
            last[turn] = before - open_
            hopes = [hope * PATIENCE for hope in hopes]
            hopes[turn] = max(last[turn], LEAST_GAIN * open_)

    def _tell(self) -> None:
        self.search.report(self.search.snapshot(self.ascent.best.bound))

    def _ascend(self) -> None:
        """Raises the mixture, with new cuts if it is near the bound."""
        if self._is_near() and self._turns % TURNS_PER_CUTS == 0:
            self.ascent.add_cuts()
        self._turns += self._is_near()
        self._steps(STEPS)

    def _is_near(self) -> bool:
        """Returns True if bound and mixture are near enough for cuts."""
        bound = self.ascent.best.bound
        return bound - self.ascent.value <= NEARLY * bound

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
        arcs = ArcSearch(search.model, plan, columns.values(), search.stop, search.report_again)
        try:
            arcs.search(MOVES, search.rng)
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
