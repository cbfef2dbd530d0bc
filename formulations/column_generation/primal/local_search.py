"""Local search: makes plans from fractional mixtures by rounding and best responses.

All steps obey the collision rules. Rounding fixes the most used columns that do not conflict; then
local optima of a pool of columns are improved one by one (`column_pool`). A best response is one
robot's best path given the paths of all others. A perturbation replans some robots, and local
search restarts from the result.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.coordination.best_response import best_response
from cocap_opt.formulations.column_generation.parameters import DEFAULTS, LocalSearchParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.mixtures.column_pool import (
    ColumnPool,
    LocalOptimum,
    PlanKey,
)
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.plan_search import tell_nobody
from cocap_opt.model import Model
from cocap_opt.problem import Problem
from cocap_opt.stop import Limit, LimitReached, Stop, never


class ResponseLimit(Stop):
    """A limit on the best responses of a local search.

    Responses are counted, not timed, so that a search takes the same course on every machine.

    Attributes
    ----------
    left : remaining number of best responses
    """

    def __init__(self, responses: float = np.inf) -> None:
        self.left = responses

    def reached(self) -> Limit | None:
        """Returns `Limit.WORK` if none remains."""
        return Limit.WORK if self.left <= 0 else None

    def count_work(self) -> None:
        """Counts one best response."""
        self.left -= 1


@dataclass(frozen=True)
class LocalSearch:
    """Improves plans of a model; if it is stopped, it returns the best plan so far.

    Attributes
    ----------
    rng : random generator of roundings and perturbations
    tell : called before each best response
    found : called with each plan in which a search ends
    taken_up : the plans from which searches have started, and those in which they have ended
    """

    model: Model
    stop: Stop = never
    allowance: ResponseLimit = field(default_factory=ResponseLimit)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    tell: Callable[[], None] = tell_nobody
    found: Callable[[Incumbent], None] = tell_nobody
    taken_up: set[PlanKey] = field(default_factory=set)
    parameters: LocalSearchParameters = DEFAULTS.local_search

    def from_mixture(self, mixture: Mixture, known: Incumbent | None = None) -> Incumbent | None:
        """Returns the best plan found from a mixture; None if none was found.

        Parameters
        ----------
        known : a plan whose columns may be used, too
        """
        pool, best, in_vain = ColumnPool(self.model), None, 0
        for column, amount in mixture.used(self.parameters.least_amount):
            pool.add(column, amount)
        for column in () if known is None else known.columns:
            pool.add(column, self.parameters.found_amount)
        for start in self._starts(mixture, pool, known):
            found = self._improved(start, pool)
            if found is not None and (best is None or found.gains_over(best)):
                best, in_vain = found, 0
            in_vain += 1
            if in_vain > self.parameters.most_in_vain:
                break
        return best

    def rounded(self, mixture: Mixture) -> Incumbent | None:
        """Returns the plan of a mixture's most used columns, improved among its columns; None if
        they leave a robot no path, or at a limit.
        """
        pool = ColumnPool(self.model)
        for column, amount in mixture.used(self.parameters.least_amount):
            pool.add(column, amount)
        for _, columns in self._starts(mixture, pool, None):
            return Incumbent.of(self.model, columns)
        return None

    def _starts(
        self, mixture: Mixture, pool: ColumnPool, known: Incumbent | None
    ) -> Iterator[LocalOptimum]:
        """Yields local optima of a pool that have not been improved yet, until the limit is
        reached.
        """
        with suppress(LimitReached):
            rounded = self._rounded(mixture, known)
            if rounded is None:
                return
            first = pool.ascended(rounded)
            if not self._is_taken_up(first):
                yield first
            while True:
                self._check()
                drawn = (found for found in self._drawn(pool) if not self._is_taken_up(found))
                best = max(drawn, key=lambda found: found[0], default=None)
                if best is None:
                    return
                yield best

    def _is_taken_up(self, found: LocalOptimum) -> bool:
        return tuple(column.path for column in found[1]) in self.taken_up

    def _drawn(self, pool: ColumnPool) -> Iterator[LocalOptimum]:
        """Yields local optima drawn from a pool; at least one, even at a limit."""
        for found in pool.drawn(self.rng, self.parameters.draws):
            self.tell()
            yield found
            if self.stop.reached():
                return

    def _improved(self, start: LocalOptimum, pool: ColumnPool) -> Incumbent | None:
        """Returns the plan after best responses, and adds its columns to the pool."""
        columns = start[1]
        self.taken_up.add(tuple(column.path for column in columns))
        best = self.with_best_responses(columns)
        if best is None:
            return None
        self.found(best)
        self.taken_up.add(best.paths)
        for column in best.columns:
            pool.add(column, self.parameters.found_amount)
        return best

    def from_integral(self, mixture: Mixture) -> Incumbent | None:
        """Returns the plan of an integral mixture after best responses; None if fractional."""
        plan = Incumbent.of_integral(self.model, mixture)
        return None if plan is None else self.with_best_responses(plan.columns)

    def perturbed(self, plan: Incumbent) -> Incumbent | None:
        """Returns the local optimum that is found after some robots are replanned, one by one.

        Best responses then lead to another local optimum: iterated local search. Returns None if
        the robots block each other.
        """
        robots = len(plan.columns)
        if robots < 2:
            return None
        anew = self.rng.permutation(robots)[: min(self.parameters.perturbed, robots - 1)].tolist()
        columns = plan.of_others(*anew)
        for robot in anew:
            answer = self.best_response(robot, columns)
            if answer is None:
                return None
            columns.append(answer)
        best = self.with_best_responses(sorted(columns, key=lambda column: column.robot))
        if best is not None:
            self.found(best)
        return best

    def _check(self) -> None:
        """Raises LimitReached if the search is stopped or no more responses are allowed."""
        self.tell()
        self.stop.check()
        self.allowance.check()

    def best_response(self, robot: int, others: Sequence[Column]) -> Column | None:
        """Returns a robot's best path given other robots' columns; None if they leave no path."""
        model, pixels = self.model, self.model.problem.no_pixels()
        self.allowance.count_work()
        for column in others:
            column.add_to(pixels)
        charges = Column.avoid(model, model.class_of[robot], others)
        path = best_response(model, robot, pixels, charges, self.stop)
        return None if path is None else Column.of(model, robot, path)

    def with_best_responses(self, columns: Sequence[Column]) -> Incumbent | None:
        """Returns the plan after best responses, robot by robot, until no robot gains.

        None if the columns break a rule.
        """
        best = Incumbent.of(self.model, columns)
        if best is None:
            return None
        quiet = 0  # number of consecutive robots that could not gain
        robot = 0
        with suppress(LimitReached):
            while quiet < len(best.columns):
                self._check()
                answer = self.best_response(robot, best.of_others(robot))
                if answer is not None and answer.key != best.columns[robot].key:
                    better = best.changed(answer)
                    if better is not None and better.gains_over(best):
                        best, quiet = better, 0
                quiet += 1
                robot = (robot + 1) % len(best.columns)
        return best

    def _rounded(self, mixture: Mixture, known: Incumbent | None) -> list[Column] | None:
        """Returns one column per robot without conflicts; None if a robot has no path left.

        The most used columns are fixed first, then best responses; at a limit, or if no response
        exists, columns of a known plan are used.

        Raises
        ------
        LimitReached
            If robots without a column remain and no plan is known.
        """
        columns, amounts, problem = mixture.columns, mixture.amounts, self.model.problem
        chosen: dict[int, Column] = {}
        for n in np.argsort(-amounts, kind="stable").tolist():
            column = columns[n]
            if amounts[n] < self.parameters.least_amount or len(chosen) == len(problem.robots):
                break
            if column.robot not in chosen and not any(
                column.conflicts_with(other, problem) for other in chosen.values()
            ):
                chosen[column.robot] = column
        for robot in range(len(problem.robots)):
            if robot in chosen:
                continue
            try:
                self._check()
                answer = self.best_response(robot, list(chosen.values()))
            except LimitReached:
                if known is None:
                    raise
                answer = None
            if answer is None:
                return None if known is None else _completed(chosen, known, problem)
            chosen[robot] = answer
        return [chosen[robot] for robot in range(len(problem.robots))]


def _completed(chosen: dict[int, Column], known: Incumbent, problem: Problem) -> list[Column]:
    """Returns one column per robot without conflicts: the chosen columns, completed from a known
    plan.

    Chosen columns are kept unless they conflict with columns that other robots must use.
    """
    columns = {column.robot: column for column in known.columns} | chosen
    waiting = [robot for robot in columns if robot not in chosen]
    while waiting:
        new = columns[waiting.pop()]
        for robot, column in columns.items():
            theirs = known.columns[robot]
            if column is not theirs and column.conflicts_with(new, problem):
                columns[robot] = theirs
                waiting.append(robot)
    return [columns[robot] for robot in range(len(columns))]
