"""Local search: plans from fractional mixtures by rounding, best responses and best pairs.

All of it obeys the collision rules. Rounding fixes the most used columns that do not
conflict. A best response is one robot's best path against all others. A best pair (`pairs`)
is that of two robots over the arcs of the restricted master: local search on the restricted
integer master, two robots changed at a time. A perturbation plans some robots anew, from where
local search starts again.
"""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from cocap_opt.coordination.best_response import best_response
from cocap_opt.formulations.column_generation.columns import Arc, Column
from cocap_opt.formulations.column_generation.incumbent import Incumbent
from cocap_opt.formulations.column_generation.mixture import Mixture
from cocap_opt.formulations.column_generation.pairs import best_pair
from cocap_opt.model import Model
from cocap_opt.stop import LimitReached, Stop, never

MOST_PARTNERS = 5  # robots with which each is paired
PERTURBED = 3  # robots that are planned anew at a time
PROMISING = 0.01  # relative loss up to which a local optimum is worth best pairs


@dataclass(frozen=True)
class LocalSearch:
    """Improves plans of a model; where it is stopped, it returns the best plan so far."""

    model: Model
    stop: Stop = never

    def from_mixture(self, mixture: Mixture, arcs: Collection[Arc]) -> Incumbent | None:
        """Returns the best plan found from a mixture; None if none was found.

        Parameters
        ----------
        arcs : of the restricted master, for best pairs
        """
        try:
            rounded = self._rounded(mixture)
        except LimitReached:
            return None
        plan = None if rounded is None else self.with_best_responses(rounded)
        return None if plan is None else self._with_best_pairs(plan, arcs)

    def from_integral(self, mixture: Mixture) -> Incumbent | None:
        """Returns the plan of an integral mixture after best responses; None if fractional."""
        plan = Incumbent.of_integral(self.model, mixture)
        return None if plan is None else self.with_best_responses(plan.columns)

    def perturbed(
        self, plan: Incumbent, arcs: Collection[Arc], rng: np.random.Generator
    ) -> Incumbent | None:
        """Returns the local optimum found after some robots are planned anew, one by one.

        Iterated local search: best responses lead to another local optimum, best pairs on from
        it if it is nearly as good. None where the robots leave one another no way.
        """
        robots = len(plan.columns)
        if robots < 2:
            return None
        anew = rng.permutation(robots)[: min(PERTURBED, robots - 1)].tolist()
        columns = plan.without(*anew)
        for robot in anew:
            answer = self.best_response(robot, columns)
            if answer is None:
                return None
            columns.append(answer)
        best = self.with_best_responses(sorted(columns, key=lambda column: column.robot))
        if best is None or best.value < plan.value * (1 - PROMISING):
            return best
        return self._with_best_pairs(best, arcs)

    def best_response(self, robot: int, others: Sequence[Column]) -> Column | None:
        """Returns a robot's best path against other robots' columns; None if they leave none."""
        model, pixels = self.model, self.model.problem.no_pixels()
        for column in others:
            pixels[column.view_sums] += column.pixels
        charges = Column.avoid(model, model.class_of[robot], others)
        path = best_response(model, robot, pixels, charges)
        return None if path is None else Column.of(model, robot, path)

    def with_best_responses(self, columns: Sequence[Column]) -> Incumbent | None:
        """Returns the plan after best responses, robot by robot, until none gains.

        None if the columns break a rule.
        """
        best = Incumbent.of(self.model, columns)
        if best is None:
            return None
        quiet = 0  # robots in a row that could gain nothing
        robot = 0
        with suppress(LimitReached):
            while quiet < len(best.columns):
                self.stop.check()
                answer = self.best_response(robot, best.without(robot))
                if answer is not None and answer.key != best.columns[robot].key:
                    better = best.changed(self.model, answer)
                    if better is not None and better.clearly_better_than(best):
                        best, quiet = better, 0
                quiet += 1
                robot = (robot + 1) % len(best.columns)
        return best

    def _with_best_pairs(self, best: Incumbent, arcs: Collection[Arc]) -> Incumbent:
        """Returns the plan after best pairs, each followed by best responses, until none gains."""
        before = None
        with suppress(LimitReached):
            while before is None or best.clearly_better_than(before):
                before = best
                for pair in _pairs(self.model, best):
                    self.stop.check()
                    better = self._with_best_pair(best, pair, arcs)
                    if better is not None and better.clearly_better_than(best):
                        best = self.with_best_responses(better.columns) or better
        return best

    def _with_best_pair(
        self, plan: Incumbent, pair: tuple[int, int], arcs: Collection[Arc]
    ) -> Incumbent | None:
        """Returns the plan with the best paths of two robots over some arcs and their own."""
        own = [arc for robot in pair for arc in plan.columns[robot].arcs]
        found = best_pair(self.model, pair, {*arcs, *own}, plan.without(*pair))
        return None if found is None else plan.changed(self.model, *found)

    def _rounded(self, mixture: Mixture) -> list[Column] | None:
        """Returns one column per robot without conflicts; None where none is left for a robot.

        The most used ones come first, then best responses.

        Raises
        ------
        LimitReached
            While robots without a column are left.
        """
        columns, amounts, problem = mixture.columns, mixture.amounts, self.model.problem
        chosen: dict[int, Column] = {}
        for n in np.argsort(-amounts, kind="stable").tolist():
            column = columns[n]
            if amounts[n] < 1e-6 or len(chosen) == len(problem.robots):
                break
            if column.robot not in chosen and not any(
                column.conflicts_with(other, problem) for other in chosen.values()
            ):
                chosen[column.robot] = column
        for robot in range(len(problem.robots)):
            if robot not in chosen:
                self.stop.check()
                answer = self.best_response(robot, list(chosen.values()))
                if answer is None:
                    return None
                chosen[robot] = answer
        return [chosen[robot] for robot in range(len(problem.robots))]


def _pairs(model: Model, plan: Incumbent) -> list[tuple[int, int]]:
    """Returns pairs of robots, those whose views overlap most first; a few for each robot."""
    roots = np.zeros((len(plan.columns), len(model.problem.view_sum_weights)))
    for row, column in zip(roots, plan.columns, strict=True):
        row[column.view_sums] = np.sqrt(column.pixels)
    pairs = []
    for i in range(len(roots)):
        shared = np.minimum(roots, roots[i]).sum(axis=1)
        shared[i] = -1.0
        for k in np.argsort(-shared, kind="stable")[:MOST_PARTNERS].tolist():
            if k != i:
                pairs.append((float(shared[k]), min(i, k), max(i, k)))
    return [(i, k) for _, i, k in sorted(set(pairs), key=lambda p: (-p[0], p[1:]))]
