"""Local search for high moves of the team between two steps.

One robot at a time takes the move, from state to state, with which the team has the most profit at
both steps together, until no robot alone can raise it.
"""

from collections.abc import Iterable
from itertools import chain

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing
from cocap_opt.formulations.certificates.staged.profitable_moves import Moves, counted_profits
from cocap_opt.formulations.certificates.staged.team_moves import Team

_TRIED = 20  # best moves of a robot that are tried, as moves of others may be in the way
_CLEARLY = 1e-9  # relative gain with which a robot changes its move


class LocalMoves:
    """The moves of single robots between the remaining states of two steps.

    Positions of states are given with the robots in the order of their classes.

    Parameters
    ----------
    narrowing : the remaining states
    tails, heads : the joint states of the first and of the second step

    Attributes
    ----------
    numbers : [R] class of each robot
    """

    def __init__(self, narrowing: Narrowing, tails: JointStates, heads: JointStates) -> None:
        self._ends, self._team = (tails, heads), Team(narrowing)
        self.numbers = self._team.numbers
        self._robots = np.argsort(self.numbers, kind="stable")
        self._classes = self.numbers[self._robots].tolist()
        self._arcs: list[tuple[IntArray, IntArray]] = []
        for number in range(len(narrowing.model.classes)):
            ways = self._team.heads(number, heads.t)
            first, at = (_positions(joint, number) for joint in self._ends)
            found = [[at[head] for head in ways(tail).tolist()] for tail in first]
            sizes = [len(among) for among in found]
            self._arcs.append((
                np.repeat(np.array([*first.values()], dtype=np.int64), sizes),
                np.array([head for among in found for head in among], dtype=np.int64),
            ))  # fmt: skip

    def ascended(self, starts: Iterable[IntArray], prices: tuple[FloatArray, FloatArray]) -> Moves:
        """Returns the starts that are moves and count, and high moves that local search finds from
        all starts, with their profits at the given prices.

        Parameters
        ----------
        starts : [2, R] positions of the robots' states at both steps; robots may be in conflict
        prices : [n] of the states of each step
        """
        teams = chain.from_iterable((start, self._ascended(start, prices)) for start in starts)
        tops = dict.fromkeys(team.tobytes() for team in teams)
        shape = (len(tops), 2, len(self._classes))
        placed = np.frombuffer(b"".join(tops), dtype=np.int64).reshape(shape)
        placed = placed[self._are_apart(placed) & self._may_move(placed)]
        profits = np.zeros(len(placed))
        for joint, chosen, price in zip(self._ends, placed.transpose(1, 0, 2), prices, strict=True):
            raised = (price - joint.price)[chosen].sum(axis=1)
            profits += counted_profits(joint, chosen) - raised
        return Moves(profits, *self._states(placed)).part(profits > -np.inf)

    @property
    def are_possible(self) -> bool:
        """True if each robot has a move; otherwise no better plan is left."""
        return all(len(self._arcs[number][0]) for number in self._classes)

    def changed(self, start: IntArray, rng: np.random.Generator) -> IntArray:
        """Returns positions [2, R] at which about half of the robots make a random move instead."""
        placed, robots = start.copy(), len(self._classes)
        for robot in rng.integers(robots, size=robots // 2 + 1).tolist():
            placed[:, robot] = self._random_move(robot, rng)
        return placed

    def random(self, rng: np.random.Generator) -> IntArray:
        """Returns positions [2, R] at which all robots make a random move, whatever is in the
        way.
        """
        return np.array([self._random_move(robot, rng) for robot in range(len(self._classes))]).T

    def _random_move(self, robot: int, rng: np.random.Generator) -> tuple[int, int]:
        """Returns the positions of a random move of a robot."""
        tails, heads = self._arcs[self._classes[robot]]
        way = int(rng.integers(len(tails)))
        return int(tails[way]), int(heads[way])

    def _ascended(self, start: IntArray, prices: tuple[FloatArray, FloatArray]) -> IntArray:
        """Returns the positions [2, R] at which no robot alone can raise the profit."""
        placed, in_vain, robot = start.copy(), 0, 0
        while in_vain < len(self._classes):
            better = self._better(placed, robot, prices)
            in_vain = in_vain + 1 if better is None else 0
            placed = placed if better is None else better
            robot = (robot + 1) % len(self._classes)
        return placed

    def _better(
        self, placed: IntArray, robot: int, prices: tuple[FloatArray, FloatArray]
    ) -> IntArray | None:
        """Returns the positions after a robot has changed its move; None if it has no better."""
        others = np.delete(placed, robot, axis=1)
        gains, counts = zip(
            *(
                _beside(joint, among, price)
                for joint, among, price in zip(self._ends, others, prices, strict=True)
            ),
            strict=True,
        )
        tails, heads = self._arcs[self._classes[robot]]
        profits = gains[0][tails] + gains[1][heads]
        may_count = counts[0][tails] & counts[1][heads]
        if may_count.any():
            profits[~may_count] = -np.inf
        now = gains[0][placed[0, robot]] + gains[1][placed[1, robot]]
        clearly = _CLEARLY * (1 + abs(now)) if now > -np.inf else 0.0
        above = np.flatnonzero(profits > now + clearly)
        above = above[np.argsort(-profits[above], kind="stable")[:_TRIED]]
        if not len(above):
            return None
        teams = np.repeat(placed[None], len(above), axis=0)
        teams[:, 0, robot], teams[:, 1, robot] = tails[above], heads[above]
        able = np.flatnonzero(self._may_move(teams))
        return teams[able[0]] if len(able) else None

    def _are_apart(self, teams: IntArray) -> BoolArray:
        """Returns True for teams [M, 2, R] whose robots do not conflict at either step."""
        first, second = np.triu_indices(len(self._classes), 1)
        conflict = np.zeros(len(teams), dtype=np.bool_)
        for joint, at in zip(self._ends, teams.transpose(1, 0, 2), strict=True):
            conflict |= joint.conflicts.between(at[:, first], at[:, second]).any(axis=1)
        return ~conflict

    def _may_move(self, teams: IntArray) -> BoolArray:
        """Returns True for teams [M, 2, R] whose robots do not conflict between the steps."""
        able: BoolArray = ~self._team.conflicts(*self._states(teams))
        return able

    def _states(self, teams: IntArray) -> tuple[IntArray, IntArray]:
        """Returns the numbers [M, R] of each robot's states at both steps, robot by robot."""
        found = np.empty_like(teams)
        for k, joint in enumerate(self._ends):
            found[:, k, self._robots] = joint.states[teams[:, k]]
        return found[:, 0], found[:, 1]


def _positions(joint: JointStates, number: int) -> dict[int, int]:
    """Returns the positions of the states of a class, by their numbers."""
    of_class = np.flatnonzero(joint.class_of == number)
    return dict(zip(joint.states[of_class].tolist(), of_class.tolist(), strict=True))


def _beside(
    joint: JointStates, others: IntArray, price: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Returns the gain of each state beside those of other robots, and True if the state counts.

    Returns
    -------
    The gains [n] of worth less price, -inf for states in conflict with others; and True [n] for
    states that are worth enough, less charges, beside those of others.
    """
    seen = joint.pixels[others].sum(axis=0)
    worths: FloatArray = joint.returns.values(seen + joint.pixels) @ joint.weights
    low = worths - joint.charge - joint.charge[others].sum()
    counts: BoolArray = low >= joint.floor - joint.margin
    gains = worths - price
    every = np.arange(len(joint.states))
    gains[joint.conflicts.between(every[:, None], others[None]).any(axis=1)] = -np.inf
    return gains, counts
