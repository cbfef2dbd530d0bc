"""The best pair of paths over a few arcs: joint value iteration of two robots.

All other robots stay as they are. Over the arcs of a restricted master a step has some dozens
of states per robot, so that all pairs of them fit into a small array.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.constraints import avoid_paths
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.column_generation.master import Arc, Column, make_column
from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.graph.timegraph import CLOSED, Charges
from cocap_opt.model import Model, Path
from cocap_opt.objective import view_sum_weights
from cocap_opt.problem.problem import Cell

MOST_PAIRS = 250_000  # of states at one step


class _Side(NamedTuple):
    """One robot's states and arcs, step by step; only those on a path from start to end."""

    robot: int
    states: list[IntArray]  # [T+1] of [n_t] state numbers
    tails: list[IntArray]  # [T] of [m_t] positions in states[t], increasing
    heads: list[IntArray]  # [T] of [m_t] positions in states[t+1]
    bonus: list[FloatArray]  # [T] of [m_t] rewards for the moves themselves


def best_pair(
    model: Model, robots: tuple[int, int], arcs: Iterable[Arc], others: Sequence[Column]
) -> tuple[Column, Column] | None:
    """Best paths of two robots over some arcs against the columns of all others.

    The swap rule between the two is not looked at. None if a robot has no path, or if there
    are too many pairs of states.
    """
    if model.problem.objective.over_time:  # steps are not separate then
        return None
    arcs = list(arcs)
    sides = [_side(model, robot, arcs, others) for robot in robots]
    a, b = sides
    if a is None or b is None:
        return None
    if any(len(p) * len(q) > MOST_PAIRS for p, q in zip(a.states, b.states, strict=True)):
        return None
    horizon = model.problem.horizon
    seen = np.zeros(len(view_sum_weights(model.problem)))
    for column in others:
        seen[column.view_sums] += column.pixels
    values = [_reward(model, a, b, horizon, seen)]
    for t in range(horizon - 1, -1, -1):
        ahead = values[-1][np.ix_(a.heads[t], b.heads[t])]
        ahead = ahead + a.bonus[t][:, None] + b.bonus[t][None, :]
        first, second = (np.flatnonzero(np.diff(s.tails[t], prepend=-1)) for s in (a, b))
        ahead = np.maximum.reduceat(np.maximum.reduceat(ahead, first, axis=0), second, axis=1)
        values.append(ahead + _reward(model, a, b, t, seen))
    values.reverse()
    if values[0][0, 0] == CLOSED:
        return None
    paths = _follow(a, b, values)
    return make_column(model, a.robot, paths[0]), make_column(model, b.robot, paths[1])


def _follow(a: _Side, b: _Side, values: list[FloatArray]) -> tuple[Path, Path]:
    """Paths that attain the best value."""
    at = (0, 0)
    paths = [int(a.states[0][0])], [int(b.states[0][0])]
    for t in range(len(values) - 1):
        own = [np.flatnonzero(s.tails[t] == k) for s, k in zip((a, b), at, strict=True)]
        heads = a.heads[t][own[0]], b.heads[t][own[1]]
        ahead = values[t + 1][np.ix_(*heads)]
        ahead = ahead + a.bonus[t][own[0]][:, None] + b.bonus[t][own[1]][None, :]
        i, k = np.unravel_index(int(np.argmax(ahead)), ahead.shape)
        at = int(heads[0][i]), int(heads[1][k])
        paths[0].append(int(a.states[t + 1][at[0]]))
        paths[1].append(int(b.states[t + 1][at[1]]))
    return tuple(paths[0]), tuple(paths[1])


def _side(model: Model, robot: int, arcs: Iterable[Arc], others: Sequence[Column]) -> _Side | None:
    """A robot's part: arcs of its class that the others leave open."""
    robot_class, horizon = model.class_of[robot], model.problem.horizon
    number, graph = model.classes.index(robot_class), robot_class.graph
    paths = [(c.robot, [model.class_of[c.robot].graph.state(s) for s in c.path]) for c in others]
    closed = avoid_paths(model, robot_class, paths)
    by_step: list[list[Arc]] = [[] for _ in range(horizon)]
    for arc in arcs:
        if arc.class_number == number and not _is_closed(arc, closed, graph.n_places):
            by_step[arc.t].append(arc)
    reached = [{model.start(robot)}]
    for t in range(horizon):
        reached.append({arc.head for arc in by_step[t] if arc.tail in reached[t]})
    leading = [reached[-1]]
    for t in range(horizon - 1, -1, -1):
        leading.append({arc.tail for arc in by_step[t] if arc.head in leading[-1]} & reached[t])
    leading.reverse()
    if not leading[0]:
        return None
    states = [np.array(sorted(some), dtype=np.int64) for some in leading]
    bonuses = bonuses_of(model.problem.objective)
    tails, heads, bonus = [], [], []
    for t in range(horizon):
        own = sorted((a.tail, a.head) for a in by_step[t]
                     if a.tail in leading[t] and a.head in leading[t + 1])  # fmt: skip
        ends = np.array(own, dtype=np.int64).reshape(-1, 2)
        tails.append(np.searchsorted(states[t], ends[:, 0]))
        heads.append(np.searchsorted(states[t + 1], ends[:, 1]))
        bonus.append(bonuses.of_edges(graph.shape, ends[:, 0], ends[:, 1]))
    return _Side(robot, states, tails, heads, bonus)


def _is_closed(arc: Arc, closed: Charges, n_places: int) -> bool:
    tail, head = arc.tail % n_places, arc.head % n_places
    return (arc.t + 1, head) in closed.places or (
        tail != head and (arc.t, tail, head) in closed.moves
    )


def _reward(model: Model, a: _Side, b: _Side, t: int, seen: FloatArray) -> FloatArray:
    """Reward of all pairs of states at a step; CLOSED where the two conflict."""
    faces = slice(t * model.n_faces, (t + 1) * model.n_faces)
    weights = view_sum_weights(model.problem)[faces]
    one, other = (_coverage(model, side, t) for side in (a, b))
    used = np.flatnonzero((weights > 0) & (one.any(axis=0) | other.any(axis=0)))
    base = seen[faces][used]
    pixels = base + one[:, None, used] + other[None, :, used]
    reward: FloatArray = (np.sqrt(pixels) - np.sqrt(base)) @ weights[used]
    if not model.problem.rules.none:
        cells = [_cells(model, side, t) for side in (a, b)]
        if model.problem.rules.separation:
            near = [[model.problem.too_close(p, q) for q in cells[1]] for p in cells[0]]
        else:
            near = [[p == q for q in cells[1]] for p in cells[0]]
        reward[np.array(near)] = CLOSED
    return reward


def _coverage(model: Model, side: _Side, t: int) -> FloatArray:
    """Pixels [n, F] of one robot's states at a step."""
    robot_class = model.class_of[side.robot]
    table, result = model.coverage(robot_class), np.zeros((len(side.states[t]), model.n_faces))
    which, entries = table.entries(t * robot_class.graph.n_states + side.states[t])
    result[which, table.view_sums[entries] - t * model.n_faces] = table.pixels[entries]
    return result


def _cells(model: Model, side: _Side, t: int) -> list[Cell]:
    robot_class = model.class_of[side.robot]
    of = model.cells[model.classes.index(robot_class)]
    return [of[state % robot_class.graph.n_places] for state in side.states[t].tolist()]
