"""Local search: plans from fractional mixtures by rounding, best responses and best pairs.

All of it obeys the collision rules. Rounding fixes the most used columns that do not
conflict; then local optima of a pool of columns are taken up, one after the other
(`column_pool`). A best response is one robot's best path against all others. A best pair
is that of two robots over the arcs of the restricted master: local search on the restricted
integer master, two robots changed at a time. Over these arcs a step has some dozens of states
per robot, so that all pairs of them fit into a small array for value iteration. A perturbation
plans some robots anew, from where local search starts again.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.best_response import best_response
from cocap_opt.coordination.pair_iteration import PairIteration
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.column_generation.parameters import DEFAULTS, LocalSearchParameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.mixtures.column_pool import (
    ColumnPool,
    LocalOptimum,
    PlanKey,
)
from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.plan_search import tell_nobody
from cocap_opt.model import Model, RobotClass
from cocap_opt.problem import Problem
from cocap_opt.stop import Limit, LimitReached, Stop, never


class ResponseLimit(Stop):
    """The best responses and best pairs that local search may still ask for; reached at none.

    They are counted, not timed, so that a search takes the same course on every machine.

    Attributes
    ----------
    left : how many
    """

    def __init__(self, responses: float = np.inf) -> None:
        self.left = responses

    def reached(self) -> Limit | None:
        """Return `Limit.WORK` where none is left."""
        return Limit.WORK if self.left <= 0 else None

    def count_work(self) -> None:
        """Count one of them."""
        self.left -= 1


@dataclass(frozen=True)
class LocalSearch:
    """Improves plans of a model; where it is stopped, it returns the best plan so far.

    Attributes
    ----------
    rng : of roundings and perturbations
    tell : called before each best response and each best pair
    found : told each plan where it ends
    taken_up : the plans from which it has started, and those where it has ended
    """

    model: Model
    stop: Stop = never
    allowance: ResponseLimit = field(default_factory=ResponseLimit)
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    tell: Callable[[], None] = tell_nobody
    found: Callable[[Incumbent], None] = tell_nobody
    taken_up: set[PlanKey] = field(default_factory=set)
    parameters: LocalSearchParameters = DEFAULTS.local_search

    def from_mixture(
        self, mixture: Mixture, arcs: Collection[Arc], known: Incumbent | None = None
    ) -> Incumbent | None:
        """Returns the best plan found from a mixture; None if none was found.

        Parameters
        ----------
        arcs : of the restricted master, for best pairs
        known : a plan whose columns may be taken, too
        """
        pool, best, in_vain = ColumnPool(self.model), None, 0
        for column, amount in mixture.used(self.parameters.least_amount):
            pool.add(column, amount)
        for column in () if known is None else known.columns:
            pool.add(column, self.parameters.found_amount)
        for start in self._starts(mixture, pool, known):
            found = self._improved(start, pool, arcs)
            if found is not None and (best is None or found.gains_over(best)):
                best, in_vain = found, 0
            in_vain += 1
            if in_vain > self.parameters.most_in_vain:
                break
        return best

    def _starts(
        self, mixture: Mixture, pool: ColumnPool, known: Incumbent | None
    ) -> Iterator[LocalOptimum]:
        """Yields local optima of a pool that are not taken up yet, until no more are allowed."""
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
        """Yields local optima that are drawn from a pool, at a limit one at least."""
        for found in pool.drawn(self.rng, self.parameters.draws):
            self.tell()
            yield found
            if self.stop.reached():
                return

    def _improved(
        self, start: LocalOptimum, pool: ColumnPool, arcs: Collection[Arc]
    ) -> Incumbent | None:
        """Returns the plan after best responses and best pairs; its columns join the pool."""
        columns = start[1]
        self.taken_up.add(tuple(column.path for column in columns))
        settled = self.with_best_responses(columns)
        if settled is None:
            return None
        self.found(settled)
        best = self._with_best_pairs(settled, arcs)
        self.found(best)
        self.taken_up.add(best.paths)
        for column in (*settled.columns, *best.columns):
            pool.add(column, self.parameters.found_amount)
        return best

    def from_integral(self, mixture: Mixture) -> Incumbent | None:
        """Returns the plan of an integral mixture after best responses; None if fractional."""
        plan = Incumbent.of_integral(self.model, mixture)
        return None if plan is None else self.with_best_responses(plan.columns)

    def perturbed(self, plan: Incumbent, arcs: Collection[Arc]) -> Incumbent | None:
        """Returns the local optimum found after some robots are planned anew, one by one.

        Iterated local search: best responses lead to another local optimum, best pairs on from
        it if it is nearly as good. None where the robots leave one another no way.
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
        if best is None or best.value < plan.value * (1 - self.parameters.promising):
            return best
        best = self._with_best_pairs(best, arcs)
        self.found(best)
        return best

    def _check(self) -> None:
        """Raises LimitReached where it is stopped, or no more responses are allowed."""
        self.tell()
        self.stop.check()
        self.allowance.check()

    def best_response(self, robot: int, others: Sequence[Column]) -> Column | None:
        """Returns a robot's best path against other robots' columns; None if they leave none."""
        model, pixels = self.model, self.model.problem.no_pixels()
        self.allowance.count_work()
        for column in others:
            pixels[column.view_sums] += column.pixels
        charges = Column.avoid(model, model.class_of[robot], others)
        path = best_response(model, robot, pixels, charges, self.stop)
        return None if path is None else Column.of(model, robot, path)

    def best_pair(
        self, robots: tuple[int, int], arcs: Iterable[Arc], others: Sequence[Column]
    ) -> tuple[Column, Column] | None:
        """Returns the best paths of two robots over some arcs against the columns of all others.

        None if a robot has no path, if there are too many pairs of states, and where pixels add up
        over time, so that steps are not separate.
        """
        model = self.model
        if model.problem.objective.over_time:
            return None
        self.allowance.count_work()
        arcs = list(arcs)
        a, b = (_side(model, robot, arcs, others) for robot in robots)
        if a is None or b is None:
            return None
        if any(
            len(p) * len(q) > self.parameters.most_pairs
            for p, q in zip(a.states, b.states, strict=True)
        ):
            return None
        pair = _ArcPair(model, (a, b), others)
        starts = int(a.states[0][0]), int(b.states[0][0])
        paths = pair.best_paths(pair.sweep(), starts, (0, 0))
        if paths is None:
            return None
        return Column.of(model, robots[0], paths[0]), Column.of(model, robots[1], paths[1])

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
                self._check()
                answer = self.best_response(robot, best.of_others(robot))
                if answer is not None and answer.key != best.columns[robot].key:
                    better = best.changed(answer)
                    if better is not None and better.gains_over(best):
                        best, quiet = better, 0
                quiet += 1
                robot = (robot + 1) % len(best.columns)
        return best

    def _with_best_pairs(self, best: Incumbent, arcs: Collection[Arc]) -> Incumbent:
        """Returns the plan after best pairs, each followed by best responses, until none gains."""
        before = None
        with suppress(LimitReached):
            while before is None or best.gains_over(before):
                before = best
                for pair in _pairs(self.model, best, self.parameters.most_partners):
                    self._check()
                    theirs = [arc for robot in pair for arc in best.columns[robot].arcs]
                    found = self.best_pair(pair, {*arcs, *theirs}, best.of_others(*pair))
                    better = None if found is None else best.changed(*found)
                    if better is not None and better.gains_over(best):
                        best = self.with_best_responses(better.columns) or better
        return best

    def _rounded(self, mixture: Mixture, known: Incumbent | None) -> list[Column] | None:
        """Returns one column per robot without conflicts; None where none is left for a robot.

        The most used ones come first, then best responses; at a limit, and where none is left,
        columns of a known plan.

        Raises
        ------
        LimitReached
            While robots without a column are left, and no plan is known.
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
    """Returns one column per robot without conflicts: the chosen ones, or those of a known plan.

    The chosen ones are kept but for those in conflict with what others must take.
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


def _pairs(model: Model, plan: Incumbent, most_partners: int) -> list[tuple[int, int]]:
    """Returns pairs of robots, those whose views overlap most first; a few for each robot."""
    roots = np.zeros((len(plan.columns), len(model.problem.view_sum_weights)))
    for row, column in zip(roots, plan.columns, strict=True):
        row[column.view_sums] = np.sqrt(column.pixels)
    pairs = []
    for i in range(len(roots)):
        shared = np.minimum(roots, roots[i]).sum(axis=1)
        shared[i] = -1.0
        for k in np.argsort(-shared, kind="stable")[:most_partners].tolist():
            if k != i:
                pairs.append((float(shared[k]), min(i, k), max(i, k)))
    return [(i, k) for _, i, k in sorted(set(pairs), key=lambda p: (-p[0], p[1:]))]


# -- best pairs --------------------------------------------------------------------------------


class _Side(NamedTuple):
    """One robot's states and arcs, step by step; only those on a path from start to end."""

    robot_class: RobotClass
    states: list[IntArray]  # [T+1] of [n_t] state numbers, increasing
    tails: list[IntArray]  # [T] of [m_t] positions in states[t], increasing
    heads: list[IntArray]  # [T] of [m_t] positions in states[t+1]
    rewards: list[FloatArray]  # [T] of [m_t] rewards for the moves themselves


class _ArcPair(PairIteration):
    """Value iteration of two robots over the arcs of both."""

    def __init__(self, model: Model, sides: tuple[_Side, _Side], others: Sequence[Column]) -> None:
        self.horizon = model.problem.horizon
        self._model = model
        self._sides = sides
        self._seen = model.problem.no_pixels()
        for column in others:
            self._seen[column.view_sums] += column.pixels

    def reward(self, t: int) -> FloatArray:
        """Returns the reward of all pairs of states at a step; CLOSED where the two conflict."""
        model, (a, b) = self._model, self._sides
        view_sums, returns = model.problem.step_view_sums[t], model.problem.returns
        weights = model.problem.view_sum_weights[view_sums]
        of_a, of_b = (model.coverage_at(s.robot_class, t, s.states[t]) for s in (a, b))
        used = np.flatnonzero((weights > 0) & (of_a.any(axis=0) | of_b.any(axis=0)))
        view_sums = view_sums[used]
        base = self._seen[view_sums]
        pixels = base + of_a[:, None, used] + of_b[None, :, used]
        gains = returns.values_at(view_sums, pixels) - returns.values_at(view_sums, base)
        reward: FloatArray = gains @ weights[used]
        places = [s.states[t] % s.robot_class.graph.n_places for s in (a, b)]
        classes = a.robot_class, b.robot_class
        reward[model.places.conflict_matrix(classes, (places[0], places[1]))] = CLOSED
        return reward

    def step_back(self, t: int, ahead: FloatArray) -> FloatArray:
        """Returns the best value over both robots' arcs, which are in the order of their tails."""
        a, b = self._sides
        values = ahead[np.ix_(a.heads[t], b.heads[t])]
        values = values + a.rewards[t][:, None] + b.rewards[t][None, :]
        moves = [(s.states[t][s.tails[t]], s.states[t + 1][s.heads[t]]) for s in (a, b)]
        values[self._conflicts(moves)] = CLOSED
        first, second = (np.flatnonzero(np.diff(s.tails[t], prepend=-1)) for s in (a, b))
        best: FloatArray = np.maximum.reduceat(values, first, axis=0)
        return np.maximum.reduceat(best, second, axis=1)

    def forbidden(
        self, tails: tuple[int, int], heads: tuple[IntArray, IntArray]
    ) -> BoolArray | bool:
        """Returns True for the pairs of moves [n, m] that break a rule between the steps."""
        moves = [(np.full_like(ends, tail), ends) for tail, ends in zip(tails, heads, strict=True)]
        return self._conflicts(moves)

    def _conflicts(self, moves: Sequence[tuple[IntArray, IntArray]]) -> BoolArray:
        """Returns True for the moves [n, m] of both robots that break a rule between the steps.

        Parameters
        ----------
        moves : of each robot, the states from which and to which it moves
        """
        rules = self._model.problem.rules
        if not rules.hold_between_steps:
            return np.zeros((len(moves[0][0]), len(moves[1][0])), dtype=np.bool_)
        (a, b), (c, d) = (
            [
                self._model.places.where(side.robot_class, at % side.robot_class.graph.n_places)
                for at in ends
            ]
            for side, ends in zip(self._sides, moves, strict=True)
        )
        return rules.moves_conflict((a[:, None], b[:, None]), (c[None], d[None]))

    def successors(self, which: int, t: int, state: int) -> tuple[IntArray, IntArray, FloatArray]:
        """Returns the states that arcs of robot 0 or 1 lead to."""
        side = self._sides[which]
        at = int(np.searchsorted(side.states[t], state))
        out = np.flatnonzero(side.tails[t] == at)
        heads = side.heads[t][out]
        return side.states[t + 1][heads], heads, side.rewards[t][out]


def _side(model: Model, robot: int, arcs: Iterable[Arc], others: Sequence[Column]) -> _Side | None:
    """Returns a robot's part: the arcs of its class that the others leave open.

    None where they lead nowhere.
    """
    robot_class, horizon = model.class_of[robot], model.problem.horizon
    number, graph = model.classes.index(robot_class), robot_class.graph
    closed = Column.avoid(model, robot_class, others)
    of_class = [arc for arc in arcs if arc.class_number == number]
    open_ = [arc for arc in of_class if not _is_closed(arc, closed, graph.n_places)]
    by_step = Arc.on_paths(open_, [(number, model.start(robot))], horizon)
    if not by_step[0]:
        return None
    ends = [np.array(sorted((a.tail, a.head) for a in arcs)).T for arcs in by_step]
    states = [*(np.unique(tails) for tails, _ in ends), np.unique(ends[-1][1])]
    bonuses = Bonuses.of(model.problem.objective)
    return _Side(
        robot_class,
        states,
        [np.searchsorted(at, tails) for at, (tails, _) in zip(states[:-1], ends, strict=True)],
        [np.searchsorted(at, heads) for at, (_, heads) in zip(states[1:], ends, strict=True)],
        [bonuses.of_edges(graph.shape, tails, heads) for tails, heads in ends],
    )


def _is_closed(arc: Arc, closed: Charges, n_places: int) -> bool:
    tail, head = arc.tail % n_places, arc.head % n_places
    return (arc.t + 1, head) in closed.places or ((arc.t, tail, head) in closed.moves)
