"""Explores the joint paths of plans above the target from a step in the middle, onward and back.

At some steps far fewer joint states count than at others. Paths that begin there multiply less than
those that begin at step 0 (`joint_paths`), because the losses of the hardest step are known at
once. From the joint states s of that step, paths are explored to the end; the way to each of them
is worth at most

    K of the earlier steps + their rows + sum_i past_i(s_i),

where `past` is the most that a robot can collect at the prices on its way to a state. From most of
these joint states, no path leads to the end. From the others, paths are explored back to the start,
step by step. Now the worth of all later steps is exact; K, rows and `past` bound the earlier ones.
At step 0, the best value is that of the best plan.
"""

from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.joint_paths import (
    BestPlan,
    best_plan,
    may_be_used,
    require_usable,
)
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.reached import Reached, in_order, merged
from cocap_opt.formulations.certificates.staged.team_moves import Team
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never


def best_plan_from(
    narrowing: Narrowing, from_step: int, most_nodes: int, stop: Stop = never, plain: bool = False
) -> BestPlan:
    """Returns the best plan above the target among the remaining joint states.

    Its J is that of `best_plan`; the numbers of nodes and of joint states depend on the step.

    Parameters
    ----------
    from_step : the step at which the exploration begins, 0..T; 0: the start
    most_nodes : largest number of nodes of all searches together
    plain : True: use the plain search only

    Raises
    ------
    NotEndedError
        If there are too many joint states.
    LimitReached
        If a limit is reached.
    ValueError
        If moves are rewarded, or starts are free and the exploration
        begins later.
    """
    if from_step:
        return _best_plan_through(narrowing, from_step, most_nodes, stop, plain)
    return best_plan(narrowing, most_nodes, stop, plain)


def _best_plan_through(
    narrowing: Narrowing, middle: int, most_nodes: int, stop: Stop, plain: bool
) -> BestPlan:
    """Returns the best plan above the target, exploring from a step in the middle, 1..T."""
    require_usable(narrowing.model)
    if not may_begin_later(narrowing.model):
        raise ValueError("joint paths: may not begin at a later step if starts are free")
    team, searches = Team(narrowing), MoveSearches(most_nodes, plain)
    threshold = team.others.threshold
    in_middle, worth = team.all_that_count(middle, searches, stop)
    onward = _Onward(team, in_middle)
    for t in range(middle + 1, narrowing.model.problem.horizon + 1):
        onward.add(team.listed(team.moves_after(t, onward.last, searches, stop)))
    gains = onward.gains
    kept = np.flatnonzero(in_middle.values + gains[0] > threshold)
    back = [Reached((worth + gains[0])[kept], in_middle.placed[kept], kept)]
    for t in range(middle - 1, -1, -1):
        back.append(team.best(team.listed(team.moves_before(t, back[-1], searches, stop))))
    nodes = most_nodes - searches.nodes_left
    numbers = tuple(len(step.values) for step in (*back[::-1], *onward.steps[1:]))
    starts = _starts(narrowing.model)
    begins = in_order(team.numbers, back[-1].placed) == in_order(team.numbers, starts)
    able = np.flatnonzero(begins.all(axis=1) & (back[-1].values > threshold))
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


class _Moves(NamedTuple):
    """All moves from the joint states of one step to those of the next."""

    tails: IntArray  # [M] number of the joint state at which each begins
    heads: IntArray  # [M] number of the joint state at which it ends
    placed: IntArray  # [M, R] the robots' states there, in the order of robots at the tail
    gains: FloatArray  # [M] worth of the step


class _Onward:
    """The joint states from the step in the middle to the end, and all moves between them.

    Parameters
    ----------
    middle : the joint states of the step in the middle

    Attributes
    ----------
    steps : joint states of each step, with the most that a path to them can be worth
    moves : moves from each step to the next
    """

    def __init__(self, team: Team, middle: Reached) -> None:
        self._team = team
        self.steps, self.moves = [middle], list[_Moves]()

    @property
    def last(self) -> Reached:
        """The joint states of the last step so far."""
        return self.steps[-1]

    def add(self, parts: list[Reached]) -> None:
        """Adds the moves to the next step."""
        before = self.last
        values, placed, tails = Reached.joined(parts)
        reached, heads = merged(self._team.numbers, parts)
        self.steps.append(reached)
        self.moves.append(_Moves(tails, heads, placed, values - before.values[tails]))

    @property
    def gains(self) -> list[FloatArray]:
        """For each step, the J [L] that the best path from each joint state collects after the
        step; -inf if no path leads to the end.
        """
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
