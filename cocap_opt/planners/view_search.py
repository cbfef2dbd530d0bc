"""CoCap, Alg. 2: single-robot planning by view search, a lazy best-first search.

     1  Rbar(start) <- 0; insert the start, k = 1, into OPEN
     2  while OPEN is not empty
     3      v <- the state of greatest key in OPEN, the k-th of its path
     4      if k is the last: return the path to v
     5      if v has been processed: continue, else it is processed now
     6      for each state w that may follow v, with its marginal reward R
     7          value <- (R + Rbar(v)) gamma^(k-1)
     8          if w has been processed, or value <= Rbar(w): w is dominated
     9          else Rbar(w) <- value, w comes from v, insert w into OPEN with the key Rbar(w)
    10  there is no path

Source: Rauniyar, Corah, Scherer 2024 (arXiv 2412.20695), to the letter: the discount of line 7,
Rbar_{k+1} = (R_{k+1} + Rbar_k) gamma^(k-1) with k from 1, compounds, since Rbar_k is discounted
already; a state includes its step; dominance compares the compounded values; after a dead end the
search continues with the best state in OPEN. The listing is our wording, the same as in
docs/concepts/view-search.md; its numbers are beside the lines of `_algorithm_2`. The search
evaluates the coverage of a state only when it reaches that state, which is its purpose: rendering
views takes far longer than searching. The paper names no gamma; `cocap-opt study gamma` measures
some.
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import count

import numpy as np

from cocap_opt.coordination.low_level import SingleRobotPath, SingleRobotTask
from cocap_opt.data import IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.graph.value_iteration import leads_to_goal
from cocap_opt.model import Model, Path
from cocap_opt.objective import marginal_gain
from cocap_opt.planners.lazy_coverage import LazyCoverage
from cocap_opt.problem import Problem

# The gamma that needs the fewest views for 95 % of the J that CoCap has with value iteration, as
# `cocap-opt study gamma` measures it on scenes `corridor` and `bottleneck`: 0.97 gets 95 % of that
# J from 17 % of the views; 0.8 gets 98 % from 64 %, 0.99 gets 93 % from 9 %.
GAMMA = 0.97
# gamma ** T of the undiscounted search. Measured over 8 seeds with gamma from 0.6 to 1: near this
# value CoCap gets 92-99 % of the J that it gets with value iteration and evaluates 17-40 % of the
# states (`corridor`, T = 8, and `bottleneck`, T = 11); 0.05 evaluates most of the states, 1 gives
# 84-96 %.
_FINAL_DISCOUNT = 0.2
_TIE = 6  # digits; angles and distances that agree to this many digits are equal

_Way = tuple[float, float]  # angle from the heading (rad) and distance (m) of the nearest actor
_Entry = tuple[float, int, _Way, int, int]  # entry of the queue: -key, -k, way, number, state


@dataclass(frozen=True)
class Compounded:
    """The paper's discount: values are discounted again at every step, and serve as the keys."""

    gamma: float = GAMMA

    def collect(self, value: float, reward: float, k: int) -> float:
        """Returns Rbar_{k+1} of a path, from Rbar_k and the reward of its (k+1)-th state."""
        return (reward + value) * self.gamma ** (k - 1)

    def key(self, value: float, k: int, horizon: int) -> float:
        """Returns Rbar_{k+1}, the key of the (k+1)-th state in the queue."""
        return value


@dataclass(frozen=True)
class Undiscounted:
    """Values are plain sums of rewards; only the keys in the queue are discounted by depth.

    With gamma below 1, promising shallow branches compete with deep ones: paths are better, and
    more states are evaluated. With gamma 1 the search goes straight to the last step.
    """

    gamma: float | None = None  # None: _FINAL_DISCOUNT ** (1 / T)

    def collect(self, value: float, reward: float, k: int) -> float:
        """Returns the sum of the rewards so far."""
        return value + reward

    def key(self, value: float, k: int, horizon: int) -> float:
        """Returns the sum of rewards, discounted by depth."""
        gamma = _FINAL_DISCOUNT ** (1 / horizon) if self.gamma is None else self.gamma
        return value * gamma ** (k - 1)


_Discount = Compounded | Undiscounted


def _algorithm_2(task: SingleRobotTask, coverage: LazyCoverage, discount: _Discount) -> Path | None:
    """CoCap's Alg. 2: returns the path to the first state at the last step that is popped; None if
    there is none.

    Nodes are (k, v): state number v as the k-th of a path, k = 1..T+1.
    """
    T = task.model.problem.horizon
    starts = _rewarded_starts(task, coverage)
    Rbar = {(1, v): R for v, R, _ in starts}
    parent, processed = {(1, v): (1, v) for v, *_ in starts}, set[tuple[int, int]]()
    # The greatest key is first. Ties go to the deeper state, then to the one that looks more
    # directly at the nearest actor, then to the one nearer to it: without a view there is no other
    # criterion. Remaining ties go to the older state.
    numbers = count()
    OPEN: list[_Entry] = [(-R, -1, way, next(numbers), v) for v, R, way in starts]  # 1
    heapq.heapify(OPEN)
    while OPEN:  # 2
        _, less_k, _, _, v = heapq.heappop(OPEN)  # 3
        k, v = node = -less_k, v
        if k == T + 1:  # 4
            return _trace(parent, node)
        if node in processed:  # 5
            continue
        processed.add(node)
        task.stop.check()
        for w, R, way in _rewarded_successors(task, coverage, k, v):  # 6
            child = (k + 1, w)
            value = discount.collect(Rbar[node], R, k)  # 7
            if child not in processed and value > Rbar.get(child, CLOSED):  # 8
                Rbar[child], parent[child] = value, node  # 9
                key = discount.key(value, k, T)
                heapq.heappush(OPEN, (-key, -(k + 1), way, next(numbers), w))
    return None  # 10


class ViewSearch:
    """View search as a low level. Each instance caches the coverage it has evaluated.

    Parameters
    ----------
    discount : discount of the rewards of later views
    """

    is_lazy = True

    def __init__(self, discount: _Discount | None = None) -> None:
        self._discount = discount or Compounded()
        self._views: dict[Model, list[LazyCoverage]] = {}  # for each model, the coverage by robot

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Searches for a path, or raises LimitReached."""
        model = task.model
        if model not in self._views:
            self._views[model] = LazyCoverage.of_robots(model)
        coverage = self._views[model][task.robot]
        evaluated_before = coverage.evaluated
        path = _algorithm_2(task, coverage, self._discount)
        pixels = coverage.along(model.problem, path or ())
        return SingleRobotPath(path, pixels, coverage.evaluated - evaluated_before)


def _rewarded_starts(
    task: SingleRobotTask, coverage: LazyCoverage
) -> list[tuple[int, float, _Way]]:
    """Returns the possible start states of the robot, with their rewards and ways to actors.

    The paper has a single start, whose reward is a constant and taken as 0. With several starts,
    the search begins at the one that looks most directly at the nearest actor if views at the start
    do not count; if they count, all starts are evaluated.
    """
    problem, robot_class = task.model.problem, task.model.class_of[task.robot]
    graph, every = robot_class.graph, task.model.starts(task.robot)
    starts = every[task.charges.free_states(0, every, graph.n_places)]
    if len(every) == 1:
        return [(start, 0.0, (0.0, 0.0)) for start in starts.tolist()]
    starts = starts[leads_to_goal(graph, problem.horizon, robot_class.goal)[0, starts]]
    rewards = np.zeros(len(starts))
    if problem.first_step == 0 and len(starts):
        view_sums = problem.view_sums_at(0)
        gains = marginal_gain(problem, view_sums, task.pixels[view_sums], coverage(0, starts))
        rewards = (gains * problem.view_sum_weights[view_sums]).sum(axis=1)
    ways = _ways(problem, graph, 0, starts)
    return list(zip(starts.tolist(), rewards.tolist(), ways, strict=True))


def _rewarded_successors(
    task: SingleRobotTask, coverage: LazyCoverage, k: int, v: int
) -> Iterator[tuple[int, float, _Way]]:
    """Yields the states that may follow v, the k-th state, with their marginal rewards and ways to
    actors.
    """
    problem, robot_class = task.model.problem, task.model.class_of[task.robot]
    graph = robot_class.graph
    heads = graph.successors(k - 1, v)
    # A move is open if no charge closes it and the goal can still be reached from its end.
    leads = leads_to_goal(graph, problem.horizon, robot_class.goal)[k, heads]
    heads = heads[leads & task.charges.free_moves(k - 1, v, heads.tolist(), graph.n_places)]
    if not len(heads):
        return  # a dead end: the queue contains the alternatives
    view_sums = problem.view_sums_at(k)
    gains = marginal_gain(problem, view_sums, task.pixels[view_sums], coverage(k, heads))
    rewards = (gains * problem.view_sum_weights[view_sums]).sum(axis=1)
    rewards += Bonuses.of(problem.objective).of_edges(graph.shape, v, heads)
    yield from zip(heads.tolist(), rewards.tolist(), _ways(problem, graph, k, heads), strict=True)


def _ways(problem: Problem, graph: TimeGraph, t: int, states: IntArray) -> list[_Way]:
    """Returns, for each state, the angle (rad) from its heading to the nearest actor, and the
    distance (m).
    """
    if not problem.actors:
        return [(0.0, 0.0)] * len(states)
    orientation, place = np.divmod(states, graph.n_places)
    eyes = graph.positions(problem.height_map, place)[:, None, :2]
    ways = np.array([actor.poses[t, :2] for actor in problem.actors]) - eyes  # [n, A, 2]
    far = np.hypot(ways[..., 0], ways[..., 1])
    nearest = far.argmin(axis=1)[:, None]
    way = np.take_along_axis(ways, nearest[..., None], axis=1)[:, 0]
    yaw = 2 * np.pi * (orientation // graph.shape[1]) / graph.motion.headings
    off = np.abs((np.arctan2(way[:, 1], way[:, 0]) - yaw + np.pi) % (2 * np.pi) - np.pi)
    # Rounded, so that a turned copy of a scene is searched in the same order.
    near = np.take_along_axis(far, nearest, axis=1)[:, 0]
    return list(zip(off.round(_TIE).tolist(), near.round(_TIE).tolist(), strict=True))


def _trace(parent: dict[tuple[int, int], tuple[int, int]], node: tuple[int, int]) -> Path:
    path = [node[1]]
    while parent[node] != node:
        node = parent[node]
        path.append(node[1])
    return tuple(reversed(path))
