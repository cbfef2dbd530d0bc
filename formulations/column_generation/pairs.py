"""The best pair of paths over a few arcs: value iteration over two robots' states.

All other robots stay as they are. Over the arcs of a restricted master a step has some dozens
of states per robot, so that all pairs of them fit into a small array.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.pair_iteration import PairIteration, Successors
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.column_generation.arc_pool import ArcPool
from cocap_opt.formulations.column_generation.columns import Arc, Column
from cocap_opt.graph.charges import Charges
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.model import Model, RobotClass

MOST_PAIRS = 250_000  # of states at one step


def best_pair(
    model: Model, robots: tuple[int, int], arcs: Iterable[Arc], others: Sequence[Column]
) -> tuple[Column, Column] | None:
    """Returns the best paths of two robots over some arcs against the columns of all others.

    The swap rule between the two is not looked at. None if a robot has no path, if there are
    too many pairs of states, and where pixels add up over time, so that steps are not separate.
    """
    if model.problem.objective.over_time:
        return None
    arcs = list(arcs)
    a, b = (_side(model, robot, arcs, others) for robot in robots)
    if a is None or b is None:
        return None
    if any(len(p) * len(q) > MOST_PAIRS for p, q in zip(a.states, b.states, strict=True)):
        return None
    pair = _ArcPair(model, (a, b), others)
    starts = int(a.states[0][0]), int(b.states[0][0])
    paths = pair.best_paths(pair.sweep(), starts, (0, 0))
    if paths is None:
        return None
    return Column.of(model, robots[0], paths[0]), Column.of(model, robots[1], paths[1])


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
        faces = slice(t * model.n_faces, (t + 1) * model.n_faces)
        weights = model.problem.view_sum_weights[faces]
        one, other = (model.coverage_at(s.robot_class, t, s.states[t]) for s in (a, b))
        used = np.flatnonzero((weights > 0) & (one.any(axis=0) | other.any(axis=0)))
        base = self._seen[faces][used]
        pixels = base + one[:, None, used] + other[None, :, used]
        reward: FloatArray = (np.sqrt(pixels) - np.sqrt(base)) @ weights[used]
        places = [s.states[t] % s.robot_class.graph.n_places for s in (a, b)]
        classes = a.robot_class, b.robot_class
        reward[model.conflict_matrix(classes, (places[0], places[1]))] = CLOSED
        return reward

    def step_back(self, t: int, ahead: FloatArray) -> FloatArray:
        """Returns the best value over both robots' arcs, which are in the order of their tails."""
        a, b = self._sides
        values = ahead[np.ix_(a.heads[t], b.heads[t])]
        values = values + a.rewards[t][:, None] + b.rewards[t][None, :]
        first, second = (np.flatnonzero(np.diff(s.tails[t], prepend=-1)) for s in (a, b))
        best: FloatArray = np.maximum.reduceat(values, first, axis=0)
        return np.maximum.reduceat(best, second, axis=1)

    def successors(self, which: int, t: int, state: int) -> Successors:
        """Returns the states that arcs of robot 0 or 1 lead to."""
        side = self._sides[which]
        at = int(np.searchsorted(side.states[t], state))
        own = np.flatnonzero(side.tails[t] == at)
        heads = side.heads[t][own]
        return Successors(side.states[t + 1][heads], heads, side.rewards[t][own])


def _side(model: Model, robot: int, arcs: Iterable[Arc], others: Sequence[Column]) -> _Side | None:
    """Returns a robot's part: the arcs of its class that the others leave open.

    None where they lead nowhere.
    """
    robot_class, horizon = model.class_of[robot], model.problem.horizon
    number, graph = model.classes.index(robot_class), robot_class.graph
    closed = Column.avoid(model, robot_class, others)
    own = [arc for arc in arcs if arc.class_number == number]
    own = [arc for arc in own if not _is_closed(arc, closed, graph.n_places)]
    on = ArcPool.states_on_paths(own, [(number, model.start(robot))], horizon)
    if not on[0]:
        return None
    states = [np.array(sorted(state for _, state in some), dtype=np.int64) for some in on]
    ends: list[list[tuple[int, int]]] = [[] for _ in range(horizon)]
    for arc in own:
        if arc.leaves in on[arc.t] and arc.enters in on[arc.t + 1]:
            ends[arc.t].append((arc.tail, arc.head))
    bonuses = Bonuses.of(model.problem.objective)
    side = _Side(robot_class, states, [], [], [])
    for t, some in enumerate(ends):
        tails, heads = np.array(sorted(some), dtype=np.int64).reshape(-1, 2).T
        side.tails.append(np.searchsorted(states[t], tails))
        side.heads.append(np.searchsorted(states[t + 1], heads))
        side.rewards.append(bonuses.of_edges(graph.shape, tails, heads))
    return side


def _is_closed(arc: Arc, closed: Charges, n_places: int) -> bool:
    tail, head = arc.tail % n_places, arc.head % n_places
    return (arc.t + 1, head) in closed.places or (
        tail != head and (arc.t, tail, head) in closed.moves
    )
