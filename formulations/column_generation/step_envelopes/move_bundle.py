"""The bundle method over prices of states whose heights are those of moves between two steps.

A step envelope does not know which joint states of the next step a team can reach: the highest
joint states of two steps in a row often have no move between them. Here the cutting planes are
moves of the whole team from a step to the next (`profitable_moves`), over pairs of steps that have
no step in common. Otherwise the method is that of `price_bundle`, except that exact searches judge
the prices, so that better ones can become a stage at once.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import chain
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.format import (
    MoveConstant,
    Stage,
    StepConstant,
)
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing, NotEndedError
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.profitable_moves import (
    HighJointStates,
    Moves,
    ProfitableMoves,
    high_joint_states,
)
from cocap_opt.formulations.column_generation.parameters import MoveParameters
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known
from cocap_opt.formulations.column_generation.step_envelopes.price_master import (
    KnownJoint,
    PriceMaster,
    gains_of,
)
from cocap_opt.formulations.column_generation.step_envelopes.priced_states import PricedStates
from cocap_opt.formulations.column_generation.step_envelopes.step_searches import StepSearches

_Place = tuple[int, int, int]  # class number, step, state number


@dataclass
class KnownMoves:
    """The moves between two steps that have been found, and what their bundles have learned.

    Attributes
    ----------
    worths : by the first step of a move and the places at both of its steps, the worth of both
    depths : by first step, how far the highest move was below the sum of both constants
    weight : of the distance to the centre, at the end of the last bundle; 0: none yet
    """

    worths: dict[int, dict[tuple[_Place, ...], float]] = field(default_factory=dict)
    depths: dict[int, float] = field(default_factory=dict)
    weight: float = 0.0


class _Judged(NamedTuple):
    """What prices prove.

    Attributes
    ----------
    stage : the prices, and the constants of steps and moves that hold at them
    bound : the bound on all plans after this stage
    new : number of new moves and paths
    """

    stage: Stage
    bound: float
    new: int


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
        self.best, self._prices = narrowing.pricing.bound, self._priced.initial
        self.stage: Stage | None = None
        self._class_of = np.zeros(len(problem.robots), dtype=np.int64)
        for number, robot_class in enumerate(narrowing.model.classes):
            self._class_of[list(robot_class.robots)] = number

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
        parameters, before, latest = self._parameters, self.best, self._prices
        room = before - cutoff()
        moves = self._moves
        first_weight = parameters.first_weight / max(float(np.abs(latest).mean()), 1e-9)
        moves.weight = moves.weight or first_weight
        for iteration in range(parameters.most_iterations):
            report()
            if iteration or self._are_known():
                solved = self._master.solved(
                    gains_of(self._priced, self._known.paths), self._highest_known(latest),
                    self._prices, moves.weight,
                )  # fmt: skip
                latest, least = solved.prices, dict(solved.constants)
                promised = self.best - solved.value - self._priced.rest
            else:
                latest, least, promised = self._prices, {}, np.inf
            judged = self._judged(latest, least)
            if judged is None:
                moves.weight *= 1.5
                continue
            gained = self.best - judged.bound
            if gained > 0 and (promised == np.inf or gained >= parameters.serious * promised):
                self.best, self._prices, self.stage = judged.bound, latest, judged.stage
                moves.weight /= 3 if gained > parameters.good * promised else 1
            elif gained < -promised or iteration % 4 == 3:
                moves.weight *= 1.5
            if before - self.best >= parameters.of_stage * room or not judged.new:
                break
            if promised < parameters.least_gain * room:
                break
        return before - self.best >= parameters.least_gain * room

    # -- judging prices -------------------------------------------------------------------------

    def _judged(self, prices: FloatArray, least: Mapping[int, float]) -> _Judged | None:
        """Returns what prices prove; None if a search takes too many nodes.

        Parameters
        ----------
        least : by first step, constants of moves below which none matters
        """
        priced = self._priced
        is_new = prices is not priced.initial
        parts = (priced.written(t, prices[span], 0.0) for t, span in priced.spans.items())
        written = tuple(chain.from_iterable(parts)) if is_new else ()
        heights = self._known_heights(prices) if is_new else {}
        if -np.inf in heights.values():
            return None  # at some step, no joint state that counts is known
        profits = {
            t: max(least.get(t, -np.inf), profit)
            for t, profit in self._known_profits(prices).items()
        }
        high = dict[int, HighJointStates]()
        depth = {t: self._depth(t) for t in self._first}
        new = 0

        def highest(k: int, joint: JointStates) -> float:
            t = joint.t
            if t in depth:
                # They are the tails of moves, too.
                high[t] = self._high_joint_states(joint, heights[t] - depth[t])
                heights[t] = max(heights[t], float(high[t].profits.max(initial=-np.inf)))
            else:
                found = self._searches.highest(joint, heights[t], self._parameters.most_nodes)
                if found is None:
                    raise NotEndedError
                heights[t] = found.profit
            return heights[t]

        def highest_move(k: int, narrowing: Narrowing) -> float:
            nonlocal new
            t = self._first[k]
            profits[t], found = self._moves_above(narrowing, t, profits[t], depth[t], high.get(t))
            new += self._remember(t, found, prices)
            return profits[t]

        def claims() -> tuple[tuple[StepConstant, ...], tuple[MoveConstant, ...]]:
            constants = (StepConstant(t, height) for t, height in heights.items())
            moves = (MoveConstant(t, profit) for t, profit in profits.items())
            return tuple(constants), tuple(moves)

        lowest = tuple(StepConstant(t, height - depth.get(t, 0.0)) for t, height in heights.items())
        try:
            stage = Stage(written, lowest, claims()[1])
            after = self._narrowing.after(stage, highest, highest_move)
        except NotEndedError:
            return None
        paths = priced.best_paths(prices, {})[1]
        new += sum(self._known.add_path(number, path) for number, path in paths)
        return _Judged(Stage(written, *claims()), after.pricing.bound, new)

    @property
    def _gap(self) -> float:
        """The distance between bound and target before the stage."""
        return self._narrowing.bound - self._narrowing.target

    def _depth(self, t: int) -> float:
        """Returns how far below the sum of both constants the first search for moves goes."""
        last = self._parameters.margin * self._moves.depths.get(t, 0.0)
        return max(last, self._parameters.first_depth * self._gap)

    def _high_joint_states(self, joint: JointStates, above: float) -> HighJointStates:
        """Returns the joint states with a profit above a value; raises NotEndedError."""
        searches = MoveSearches(self._parameters.most_nodes)
        return high_joint_states(self._narrowing.model, joint, above, searches, self._stop)

    def _moves_above(
        self, narrowing: Narrowing, t: int, least: float, depth: float,
        tails: HighJointStates | None,
    ) -> tuple[float, Moves]:  # fmt: skip
        """Returns a profit that no move from a step to the next exceeds, and the highest moves.

        Parameters
        ----------
        least : moves up to this profit do not matter
        depth : depth, below the largest profit that is possible, of the first search

        Raises
        ------
        NotEndedError
            If a search takes too many nodes.
        LimitReached
            If a limit is reached.
        """
        between, searches = ProfitableMoves(narrowing, t), MoveSearches(self._parameters.most_nodes)
        while True:
            floor = max(between.most - depth, least)
            found = between.above(floor, searches, self._stop, tails)
            if len(found.profits):
                most = float(found.profits[0])
                self._moves.depths[t] = between.most - most
                return most, found.part(slice(self._parameters.most_new))
            # Further below, no joint state of the two steps counts.
            if floor == least or depth > 4 * self._gap:
                return floor, found
            depth *= self._parameters.deeper

    # -- known moves ----------------------------------------------------------------------------

    def _are_known(self) -> bool:
        """Returns True if a move is known for each pair of steps."""
        alone = all(self._known.at(self._priced.joints[t]) for t in self._alone)
        return alone and all(len(self._rows_of(t)[1]) for t in self._first)

    def _remember(self, t: int, found: Moves, prices: FloatArray) -> int:
        """Stores moves from a step to the next; returns the number of new ones.

        Parameters
        ----------
        prices : prices at which their profits are given
        """
        position, worths = self._priced.positions, self._moves.worths.setdefault(t, {})
        before = len(worths)
        classes = self._class_of.tolist()
        for profit, *ends in zip(*map(np.ndarray.tolist, found), strict=True):
            places = tuple(
                sorted(
                    (number, at, state)
                    for at, states in zip((t, t + 1), ends, strict=True)
                    for number, state in zip(classes, states, strict=True)
                )
            )
            paid = prices[[position[place] for place in places]].sum()
            worths.setdefault(places, profit + float(paid))
        return len(worths) - before

    def _rows_of(self, t: int) -> tuple[IntArray, FloatArray]:
        """Returns the positions [M, 2 R] and the worths [M] of the known moves from a step."""
        position = self._priced.positions
        known = [
            ([position[place] for place in places], worth)
            for places, worth in self._moves.worths.get(t, {}).items()
            if all(place in position for place in places)
        ]
        at = np.array([positions for positions, _ in known], dtype=np.int64)
        return at.reshape(len(known), 2 * len(self._class_of)), np.array(
            [worth for _, worth in known]
        )

    def _known_profits(self, prices: FloatArray) -> dict[int, float]:
        """Returns the largest profit of a known move from each step; -inf if there is none."""
        rows = {t: self._rows_of(t) for t in self._first}
        return {
            t: float((worths - prices[at].sum(axis=1)).max(initial=-np.inf))
            for t, (at, worths) in rows.items()
        }

    def _known_heights(self, prices: FloatArray) -> dict[int, float]:
        """Returns the largest profit of a known joint state of each step; -inf if there is none."""
        heights = {}
        for t, joint in self._priced.joints.items():
            repriced = replace(joint, price=prices[self._priced.spans[t]])
            heights[t] = self._known.highest(repriced)
        return heights

    def _highest_known(self, latest: FloatArray) -> list[KnownJoint]:
        """Returns the known moves that are among the highest at the centre or the latest prices."""
        chosen: list[KnownJoint] = []
        for t in (*self._first, *self._alone):
            at, worths = self._rows_of(t) if t in self._first else self._joint_states_of(t)
            highest: set[int] = set()
            for prices in (self._prices, latest):
                order = np.argsort(prices[at].sum(axis=1) - worths, kind="stable")
                highest.update(order[: self._parameters.most_heights].tolist())
            chosen += [
                KnownJoint(t, tuple(at[k].tolist()), float(worths[k])) for k in sorted(highest)
            ]
        return chosen

    def _joint_states_of(self, t: int) -> tuple[IntArray, FloatArray]:
        """Returns the positions [M, R] and the worths [M] of the known joint states of a step."""
        joint, first = self._priced.joints[t], self._priced.spans[t].start
        known = self._known.at(joint)
        return first + np.array(known), np.array([joint.worth(team) for team in known])
