"""The bundle method over prices of states whose heights are those of moves between two steps.

A step envelope does not know which joint states of the next step a team can reach: the highest
joint states of two steps in a row often have no move between them. Here the cutting planes are
moves of the whole team from a step to the next (`profitable_moves`), over pairs of steps that have
no step in common. Otherwise the method is that of `price_bundle`: local search judges prices
(`local_moves`), but those that it finds to be better are judged again by exact searches
(`exact_heights`), and can become a stage at once.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from cocap_opt.arithmetic import exact_sum
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.format import Stage
from cocap_opt.formulations.certificates.staged import Narrowing
from cocap_opt.formulations.certificates.staged.profitable_moves import Moves
from cocap_opt.formulations.column_generation.parameters import MoveParameters
from cocap_opt.formulations.column_generation.step_envelopes.exact_heights import ExactHeights
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known
from cocap_opt.formulations.column_generation.step_envelopes.local_moves import LocalMoves
from cocap_opt.formulations.column_generation.step_envelopes.price_master import (
    KnownJoint,
    PriceMaster,
    gains_of,
)
from cocap_opt.formulations.column_generation.step_envelopes.priced_states import (
    CLEARLY,
    PricedStates,
)
from cocap_opt.formulations.column_generation.step_envelopes.step_searches import StepSearches

_RobotMove = tuple[int, int, int]  # class number, numbers of the states at both steps


@dataclass
class KnownMoves:
    """The moves between two steps that have been found, and the latest weight of their bundles.

    Attributes
    ----------
    worths : by the first step of a move and the moves of all robots, sorted, the worth of both
        steps together
    weight : of the distance to the centre, at the end of the last bundle; 0: none yet
    nodes : number of nodes that a checker needs at most for the stages of earlier bundles
    """

    worths: dict[int, dict[tuple[_RobotMove, ...], float]] = field(default_factory=dict)
    weight: float = 0.0
    nodes: int = 0


class _Rows(NamedTuple):
    """Known moves from a step, or known joint states of a step.

    Attributes
    ----------
    at : [M, 2 R] or [M, R] positions of the prices of their states
    worths : [M] worth of both steps, or of the step
    """

    at: IntArray
    worths: FloatArray

    def profits(self, prices: FloatArray) -> FloatArray:
        """Returns their reduced profits [M] at given prices."""
        profits: FloatArray = self.worths - prices[self.at].sum(axis=1)
        return profits


class _Judged(NamedTuple):
    """The bound that some prices prove, and the stage that proves it.

    Attributes
    ----------
    stage : the prices, and the constants of steps and moves that hold at them
    bound : the bound on all plans after this stage
    new : number of new moves and paths
    nodes : number of nodes that a checker needs at most for the stage
    """

    stage: Stage
    bound: float
    new: int
    nodes: int


class MoveBundle:
    """The bundle method, from the prices of a narrowing to a stage with better ones.

    Parameters
    ----------
    narrowing : the remaining states and their prices
    known : known paths
    moves : known moves; more are added
    searches : searches for the highest joint states of steps

    Attributes
    ----------
    best : the bound that the best prices prove
    stage : the stage with these prices; None before any are better than those of the narrowing
    nodes : number of nodes that a checker needs at most for this stage
    """

    def __init__(
        self, narrowing: Narrowing, known: Known, moves: KnownMoves, searches: StepSearches
    ) -> None:
        self._narrowing, self._known, self._moves, self._searches = (
            narrowing, known, moves, searches,
        )  # fmt: skip
        self._stop = searches.search.stop
        problem = narrowing.model.problem
        steps = range(problem.first_step, problem.horizon + 1)
        self._first = steps[:-1:2]  # the first step of each move
        self._alone = steps[2 * len(self._first) :]  # the last step, if their number is odd
        joints = {t: narrowing.joint_states(t) for t in steps}
        self._priced = PricedStates(narrowing, joints, {}, self._stop)
        self._master = PriceMaster(self._priced)
        self.best, self._best_prices = narrowing.pricing.bound, self._priced.initial
        self._prices = self._best_prices
        # the prices at which moves have constants
        self._judged_prices = self._prices if narrowing.saved.any() else None
        # as far as local search can tell, the bound that the centre proves
        self._value = self.best
        self._least: Mapping[int, float] = {}
        self.stage: Stage | None = None
        self.nodes = 0
        self._local = {t: LocalMoves(narrowing, joints[t], joints[t + 1]) for t in self._first}

    @property
    def _parameters(self) -> MoveParameters:
        return self._searches.search.parameters.moves

    def run(self, cutoff: Callable[[], float], report: Callable[[], None]) -> bool:
        """Looks for a stage with better prices; returns True if one is clearly better.

        Parameters
        ----------
        cutoff : bound at which the root is closed
        report : called at every iteration

        Raises
        ------
        LimitReached
            If a limit is reached; the best stage by then is stored.
        """
        before, latest = self.best, self._prices
        room = before - cutoff()
        enough, least_gain = (
            share * room for share in (self._parameters.of_stage, self._parameters.least_gain)
        )
        self._begin()
        for iteration in range(self._parameters.most_iterations):
            report()
            if before - self.best >= enough or not self._are_known():
                break
            arcs, known = gains_of(self._priced, self._known.paths), self._highest_known(latest)
            solved = self._master.solved(arcs, known, self._prices, self._weight)
            promised = self._value - solved.value - self._priced.rest
            latest, least = solved.prices, dict(solved.constants)
            new = False
            if promised >= least_gain:
                new = self._step_to(latest, least, promised, is_fourth=iteration % 4 == 3)
            if not new or before - self._value >= enough:
                new |= self._judge()
            if not new:
                break
        return before - self.best >= least_gain

    @property
    def _weight(self) -> float:
        """The weight of the distance to the centre."""
        mean = float(np.abs(self._priced.initial).mean())
        return self._moves.weight or self._parameters.first_weight / max(mean, 1e-9)

    def _step_to(
        self, prices: FloatArray, least: Mapping[int, float], promised: float, is_fourth: bool
    ) -> bool:
        """Makes prices the new centre if local search finds them better; returns True if it finds
        new moves or paths.

        Parameters
        ----------
        least : by first step, constants of moves above which moves matter
        promised : gain that the master predicts
        is_fourth : True at every fourth iteration, in which the weight grows without a step
        """
        value, new = self._estimated(prices, least)
        gained, weight = self._value - value, self._weight
        if gained > 0 and gained >= self._parameters.serious * promised:
            self._value, self._prices, self._least = value, prices, least
            weight /= 3 if gained > self._parameters.good * promised else 1
        elif gained < -promised or is_fourth:
            weight *= 1.5
        self._moves.weight = weight
        return new > 0

    def _judge(self) -> bool:
        """Judges the centre by exact searches; returns True if these find new moves or paths.

        If it proves no more than the best prices so far, these are the centre again.
        """
        if self._prices is self._judged_prices:
            return False
        judged = self._judged(self._prices, self._least)
        if judged is not None and judged.bound < self.best:
            self.best, self._best_prices = judged.bound, self._prices
            self.stage, self.nodes = judged.stage, judged.nodes
        else:
            self._prices, self._moves.weight = self._best_prices, 1.5 * self._weight
        self._value, self._least, self._judged_prices = self.best, {}, self._best_prices
        return judged is not None and judged.new > 0

    # -- judging prices -------------------------------------------------------------------------

    def _estimated(self, prices: FloatArray, least: Mapping[int, float]) -> tuple[float, int]:
        """Returns the bound that prices may prove at best, as local search finds no higher moves,
        and the number of new moves and paths.

        Parameters
        ----------
        least : by first step, constants of moves above which moves matter
        """
        total, paths = self._priced.best_paths(prices, {})
        new = sum(self._known.add_path(number, path) for number, path in paths)
        bound = (
            total + self._priced.rest + exact_sum(least[t] for t in (*self._first, *self._alone))
        )
        for t in self._first:
            rows = self._rows_of(t)
            highest = self._highest(rows, prices, self._parameters.starts)
            teams = [rows.at[k].reshape(2, -1) - self._begins(t) for k in highest]
            found = self._ascend(t, teams, prices)
            high = found.part(found.profits > least[t] + CLEARLY * abs(self.best))
            new += self._remember(t, high, prices)
            bound += max(float(high.profits.max(initial=-np.inf)) - least[t], 0.0)
        for t in self._alone:
            bound += max(self._height(t, prices) - least[t], 0.0)
        return bound, new

    def _judged(self, prices: FloatArray, least: Mapping[int, float]) -> _Judged | None:
        """Returns the bound that prices prove, or None if the search of a step is too long.

        Parameters
        ----------
        least : by first step, constants of moves below which none matters
        """
        priced, new = self._priced, 0
        parts = (priced.written(t, prices[span], 0.0) for t, span in priced.spans.items())
        written = tuple(chain.from_iterable(parts))
        heights = {t: self._height(t, prices) for t in priced.joints}
        profits = self._known_profits(prices)
        profits = {t: max(least.get(t, -np.inf), profit) for t, profit in profits.items()}
        if -np.inf in (*heights.values(), *profits.values()):
            return None  # at some step, no joint state that counts is known
        most_nodes = self._parameters.most_total_nodes - self._moves.nodes
        exact = ExactHeights(self._narrowing, self._searches, heights, profits, most_nodes)
        proved = exact.proved(written)
        for t, found in exact.found.items():
            new += self._remember(t, found.part(slice(self._parameters.most_new)), prices)
        if proved is None:
            return None
        stage, after = proved
        new += sum(exact.heights[t] > least.get(t, math.inf) for t in self._alone)
        paths = priced.best_paths(prices, {})[1]
        new += sum(self._known.add_path(number, path) for number, path in paths)
        return _Judged(stage, after.pricing.bound, new, exact.nodes)

    # -- known moves ----------------------------------------------------------------------------

    def _are_known(self) -> bool:
        """Returns True if a move is known for each pair of steps."""
        return all(len(self._rows_of(t).worths) for t in (*self._first, *self._alone))

    def _begin(self) -> None:
        """Stores high moves near those of the best plan, or near random ones where its states do
        not remain.
        """
        plan = self._searches.search.incumbent
        columns = () if plan is None else plan.columns
        for t, local in self._local.items():
            if not local.are_possible:
                return
            ways = ((column.along.class_number, column.path) for column in columns)
            robots = sorted((number, path[t], path[t + 1]) for number, path in ways)
            try:
                team = np.array(self._positions(t, robots)).reshape(2, -1) - self._begins(t)
            except KeyError:
                team = local.random(self._known.rng)
            self._remember(t, self._ascend(t, [team], self._prices), self._prices)

    def _ascend(self, t: int, teams: Sequence[IntArray], prices: FloatArray) -> Moves:
        """Returns high moves that local search finds.

        Parameters
        ----------
        teams : [2, R] positions of the robots' states at both steps, from which it starts
        """
        local, spans = self._local[t], self._priced.spans
        times = range(self._parameters.random_starts)
        changed = [local.changed(team, self._known.rng) for team in teams for _ in times]
        return local.ascended([*teams, *changed], (prices[spans[t]], prices[spans[t + 1]]))

    def _begins(self, t: int) -> IntArray:
        """Returns the position [2, 1] of the first price of a step and of the next."""
        return np.array([[self._priced.spans[t].start], [self._priced.spans[t + 1].start]])

    def _remember(self, t: int, found: Moves, prices: FloatArray) -> int:
        """Stores moves from a step to the next; returns the number of new ones.

        Parameters
        ----------
        prices : prices at which their profits are given
        """
        worths = self._moves.worths.setdefault(t, {})
        before, classes = len(worths), self._local[t].numbers.tolist()
        tails_of, heads_of = self._priced.joints[t], self._priced.joints[t + 1]
        for profit, tails, heads in zip(*map(np.ndarray.tolist, found), strict=True):
            robots = tuple(sorted(zip(classes, tails, heads, strict=True)))
            at = self._positions(t, robots)
            worths.setdefault(robots, profit + float(prices[at].sum()))
            teams = np.array(at).reshape(2, -1) - self._begins(t)
            for joint, team in zip((tails_of, heads_of), teams.tolist(), strict=True):
                self._known.add(joint, team)
        return len(worths) - before

    def _positions(self, t: int, robots: Iterable[_RobotMove]) -> list[int]:
        """Returns the positions of the prices of a move: those of the first step come first.

        Raises
        ------
        KeyError
            If a state does not remain.
        """
        position = self._priced.positions
        ends = [[(number, t + k, move[k]) for number, *move in robots] for k in (0, 1)]
        return [position[place] for place in chain(*ends)]

    def _rows_of(self, t: int) -> _Rows:
        """Returns the known moves from a step, or the known joint states of one without moves."""
        joint, first = self._priced.joints[t], self._priced.spans[t].start
        if t in self._alone:
            known = self._known.at(joint)
            worths = [joint.worth(team) for team in known]
            return _Rows(first + np.array(known, dtype=np.int64), np.array(worths))
        found = []
        for robots, worth in self._moves.worths.get(t, {}).items():
            with suppress(KeyError):
                found.append((self._positions(t, robots), worth))
        at = np.array([positions for positions, _ in found], dtype=np.int64)
        at = at.reshape(len(found), 2 * len(self._local[t].numbers))
        return _Rows(at, np.array([worth for _, worth in found]))

    def _known_profits(self, prices: FloatArray) -> dict[int, float]:
        """Returns the largest profit of a known move from each step; -inf if there is none."""
        rows = {t: self._rows_of(t) for t in self._first}
        return {t: float(known.profits(prices).max(initial=-np.inf)) for t, known in rows.items()}

    def _height(self, t: int, prices: FloatArray) -> float:
        """Returns the largest profit of a joint state of a step that local search finds; -inf if
        there is none.
        """
        joint = self._priced.joints[t]
        repriced = replace(joint, price=prices[self._priced.spans[t]])
        known = (repriced.reduced_profit(team) for team in self._known.at(joint))
        return max(self._known.highest(repriced), max(known, default=-np.inf))

    def _highest(self, rows: _Rows, prices: FloatArray, most: int) -> list[int]:
        """Returns the numbers of the rows with most profit."""
        order = np.argsort(-rows.profits(prices), kind="stable")
        return [*map(int, order[:most])]

    def _highest_known(self, latest: FloatArray) -> list[KnownJoint]:
        """Returns the known moves that are among the highest at the centre or the latest prices."""
        chosen: list[KnownJoint] = []
        for t in (*self._first, *self._alone):
            rows, highest = self._rows_of(t), set[int]()
            for prices in (self._prices, latest):
                highest.update(self._highest(rows, prices, self._parameters.most_heights))
            chosen += [
                KnownJoint(t, tuple(rows.at[k].tolist()), float(rows.worths[k]))
                for k in sorted(highest)
            ]
        return chosen
