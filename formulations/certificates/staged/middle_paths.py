"""Explores the joint paths of plans above the target from a step in the middle, onward and back.

At some steps far fewer joint states count than at others. Paths that begin there multiply less than
those that begin at step 0 (`joint_paths`), because the losses of the hardest step are known at
once. From the joint states s of that step, paths are explored to the end; the way to each of them
is worth at most

    K of the earlier steps + their rows + sum_i past_i(s_i),

where `past` is the most that a robot collects at the prices on its way to a state. Most joint
states of the step are left without a path to the end. Then the paths from the others are explored
back to the start, step by step. Now the worth of all later steps is exact, and `past` bounds the
earlier ones. At step 0, the best value is that of the best plan.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.joint_paths import BestPlan, may_be_used
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.search import NotEndedError
from cocap_opt.formulations.certificates.staged.team_moves import (
    MOST_PLACED,
    Following,
    Reached,
    Team,
    n_placed,
)
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never


def best_plan_through(
    narrowing: Narrowing, middle: int, most_nodes: int, stop: Stop = never, plain: bool = False
) -> BestPlan:
    """Returns the best plan above the target among the remaining joint states.

    The result is that of `best_plan`; only the number of nodes differs.

    Parameters
    ----------
    middle : the step at which the exploration begins, 1..T
    most_nodes : largest number of nodes of all searches together
    plain : True: use the plain search only

    Raises
    ------
    NotEndedError
        If there are too many joint states.
    LimitReached
        If a limit is reached.
    ValueError
        If `may_begin_later` does not hold.
    """
    if not may_begin_later(narrowing.model):
        raise ValueError("joint paths: may not begin at a later step if starts are free")
    team, following = Team(narrowing), Following(most_nodes, plain)
    begun, worth = team.counting(middle, following, stop)
    onward = _Onward(team, begun)
    for t in range(middle + 1, narrowing.model.problem.horizon + 1):
        onward.add(_few(team, team.moves_after(t, onward.last, following, stop)))
    gains = onward.gains
    kept = np.flatnonzero(begun.values + gains[0] > team.matters)
    back = [Reached((worth + gains[0])[kept], begun.placed[kept], kept)]
    for t in range(middle - 1, -1, -1):
        back.append(team.best(_few(team, team.moves_before(t, back[-1], following, stop))))
    nodes = most_nodes - following.nodes_left
    numbers = tuple(len(step.values) for step in (*back[::-1], *onward.steps[1:]))
    starts = _starts(narrowing.model)
    begins = (team.in_order(back[-1].placed) == team.in_order(starts)).all(axis=1)
    able = np.flatnonzero(begins & (back[-1].values > team.matters))
    if not len(able):
        return BestPlan(narrowing, -np.inf, nodes=nodes, reached=numbers)
    best = int(able[0])  # the best comes first
    along = _along(team, best, back, onward, gains)
    robots = _matched(team.numbers, starts[0], along[0])
    paths = tuple(tuple(path) for path in along[:, robots].T.tolist())
    return BestPlan(narrowing, float(back[-1].values[best]), paths, nodes, numbers)


def may_begin_later(model: Model) -> bool:
    """Returns True if the exploration may begin at a later step: joint states determine J, and no
    robot chooses its start.
    """
    return may_be_used(model) and not model.problem.has_free_starts


def _few(team: Team, parts: Iterable[Reached]) -> list[Reached]:
    """Returns the moves to a step; raises NotEndedError if there are too many."""
    found = [Reached.empty(len(team.numbers))]
    for part in parts:
        found.append(part)
        if n_placed(found) > MOST_PLACED:
            raise NotEndedError
    return found


class _Moves(NamedTuple):
    """All moves from the joint states of one step to those of the next."""

    tails: IntArray  # [M] number of the joint state at which each begins
    heads: IntArray  # [M] number of the joint state at which it ends
    placed: IntArray  # [M, R] the robots' states there, in the order of robots at the tail
    gains: FloatArray  # [M] worth of the step


class _Onward:
    """The joint states from the middle to the end, and all moves between them.

    Attributes
    ----------
    steps : joint states of each step, with the most that a path to them can be worth
    moves : moves from each step to the next
    """

    def __init__(self, team: Team, begun: Reached) -> None:
        self._team = team
        self.steps, self.moves = [begun], list[_Moves]()

    @property
    def last(self) -> Reached:
        """The joint states of the last step so far."""
        return self.steps[-1]

    def add(self, parts: list[Reached]) -> None:
        """Adds the moves to the next step."""
        before = self.last
        values, placed, tails = (np.concatenate(column) for column in zip(*parts, strict=True))
        reached, heads = self._team.merged(parts)
        self.steps.append(reached)
        self.moves.append(_Moves(tails, heads, placed, values - before.values[tails]))

    @property
    def gains(self) -> list[FloatArray]:
        """The most that the best path from each joint state on collects after its step, by step."""
        gains = [np.zeros(len(self.last.values))]
        for moves, step in zip(self.moves[::-1], self.steps[-2::-1], strict=True):
            best = np.full(len(step.values), -np.inf)
            np.maximum.at(best, moves.tails, moves.gains + gains[-1][moves.heads])
            gains.append(best)
        return gains[::-1]


def _starts(model: Model) -> IntArray:
    """Returns the only start of each robot [1, R]."""
    return np.array([[int(model.starts(k)[0]) for k in range(len(model.problem.robots))]])


def _along(
    team: Team, number: int, back: list[Reached], onward: _Onward, gains: list[FloatArray]
) -> IntArray:
    """Returns the states [T+1, R] along the best way, in the order of robots at step 0.

    Parameters
    ----------
    number : number of the joint state at step 0
    back : joint states of the steps from the middle to step 0
    """
    along = []
    for step in back[::-1]:
        along.append(step.placed[number])
        number = int(step.before[number])
    order = np.arange(len(team.numbers))  # the column of each robot in the current joint state
    for moves, step, later in zip(onward.moves, onward.steps[1:], gains[1:], strict=True):
        able = np.flatnonzero(moves.tails == number)
        which = able[np.argmax(moves.gains[able] + later[moves.heads[able]])]
        along.append(moves.placed[which][order])
        number = int(moves.heads[which])
        order = _matched(team.numbers, moves.placed[which], step.placed[number])[order]
    return np.array(along)


def _matched(numbers: IntArray, placed: IntArray, other: IntArray) -> IntArray:
    """Returns, for each robot of a joint state, a robot of its class that has the same state in
    another order of the robots.
    """
    found = np.empty(len(numbers), dtype=np.int64)
    found[np.lexsort((placed, numbers))] = np.lexsort((other, numbers))
    return found
