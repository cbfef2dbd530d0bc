"""Single-robot planning by view search, CoCap Alg. 2: lazy best-first search.

It asks for the coverage of a state only when it reaches it, which is its whole point:
rendering views costs far more than searching.
"""

import heapq
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.graph.move_rewards import bonuses_of
from cocap_opt.graph.timegraph import CLOSED, TimeGraph
from cocap_opt.model import Model, RobotClass
from cocap_opt.objective import marginal_gain, no_pixels, view_sum_weights
from cocap_opt.planners.single import SingleRobotPath, SingleRobotTask
from cocap_opt.problem.problem import Problem
from cocap_opt.stop import Limit
from cocap_opt.vision.views import Views, eyes_at

# gamma ** T by default. Measured over 8 seeds with gamma from 0.6 to 1: near this value CoCap
# gets 92-99 % of the J that it gets with value iteration and evaluates 17-40 % of the states
# (corridor, T = 8, and bottleneck, T = 11); 0.05 costs most of the states, 1 gives 84-96 % of J.
FINAL_DISCOUNT = 0.2
TIE = 6  # digits; what is nearer than that is equally near


class LazyCoverage:
    """Coverage of the states of one class, evaluated on first use and then remembered."""

    def __init__(self, views: Views) -> None:
        self._views = views
        self._known: dict[tuple[int, int], FloatArray] = {}

    @property
    def evaluated(self) -> int:
        """Number of states evaluated so far."""
        return len(self._known)

    def __call__(self, t: int, states: IntArray) -> FloatArray:
        """Coverage [n, F] in px/m2 of states [n] at step t."""
        new = [s for s in states.tolist() if (t, s) not in self._known]
        if new:
            rows = self._views.coverage(t, np.array(new, dtype=np.int64))
            self._known.update(zip(((t, s) for s in new), rows, strict=True))
        return np.array([self._known[t, s] for s in states.tolist()])


@dataclass(frozen=True)
class ViewSearch:
    """Best-first search over (step, state), keyed by the discounted reward of the path so far.

    The key of a child at step k+1 is (Rbar_k + R_{k+1}) gamma^k: the reward collected on the
    way to its parent, plus its own, discounted by depth. (The paper has gamma^(k-1), which
    orders the queue alike.) Below 1, gamma lets promising
    shallow branches compete with deep ones (better paths, more states evaluated); at 1 the
    search dives. Each instance remembers the coverage it has evaluated.
    """

    gamma: float | None = None  # None: FINAL_DISCOUNT ** (1 / T)
    _sources: dict[tuple[Model, tuple[int, ...]], LazyCoverage] = field(default_factory=dict)

    def __call__(self, task: SingleRobotTask) -> SingleRobotPath:
        """Search; backtracks from dead ends, and fails only if there is no path at all."""
        model, robot_class = task.model, task.model.class_of[task.robot]
        coverage = self._source(model, robot_class)
        evaluated_before = coverage.evaluated
        path, limit = self._search(task, coverage)
        pixels = no_pixels(model.problem)
        if path is not None:
            pixels = self._path_pixels(model, coverage, path)
        return SingleRobotPath(path, pixels, coverage.evaluated - evaluated_before, limit)

    def _source(self, model: Model, robot_class: RobotClass) -> LazyCoverage:
        key = model, robot_class.robots
        if key not in self._sources:
            self._sources[key] = LazyCoverage(model.views(robot_class))
        return self._sources[key]

    def _path_pixels(
        self, model: Model, coverage: LazyCoverage, path: tuple[int, ...]
    ) -> FloatArray:
        pixels = no_pixels(model.problem)
        for t in range(model.problem.first_step, len(path)):
            pixels[model.problem.view_sums_at(t)] += coverage(t, np.array([path[t]]))[0]
        return pixels

    def _search(
        self, task: SingleRobotTask, coverage: LazyCoverage
    ) -> tuple[tuple[int, ...] | None, Limit]:
        problem, graph = task.model.problem, task.model.class_of[task.robot].graph
        horizon, bonuses = problem.horizon, bonuses_of(problem.objective)
        gamma = FINAL_DISCOUNT ** (1 / horizon) if self.gamma is None else self.gamma
        weights = view_sum_weights(problem)
        may_enter = _goal_filter(task)
        start = task.model.start(task.robot)
        parent: dict[tuple[int, int], int] = {}
        best = {(0, start): 0.0}
        processed: set[tuple[int, int]] = set()
        # Ties go to the deeper node, then to the one that looks more directly at the nearest
        # actor, then to the nearer one: without a view there is nothing else to go by.
        queue = [(0.0, 0, (0.0, 0.0), 0, start)]
        pushed = 0
        while queue:
            _, minus_depth, _, _, state = heapq.heappop(queue)
            k = -minus_depth
            if k == horizon:
                return _trace(parent, k, state), Limit.NONE
            if (k, state) in processed:
                continue
            processed.add((k, state))
            limit = task.stop()
            if limit is not Limit.NONE:
                return None, limit
            heads = graph.successors(state)
            heads = heads[[may_enter(k, state, int(head)) for head in heads]]
            if not len(heads):
                continue  # a dead end: the queue holds the alternatives
            view_sums = problem.view_sums_at(k + 1)
            gains = marginal_gain(task.pixels[view_sums], coverage(k + 1, heads))
            rewards = (gains * weights[view_sums]).sum(axis=1)
            rewards += bonuses.of_edges(graph.shape, state, heads)
            ways = _ways(problem, graph, k + 1, heads)
            for head, reward, way in zip(heads.tolist(), rewards.tolist(), ways, strict=True):
                total = best[k, state] + reward
                node = (k + 1, head)
                if node in processed or total <= best.get(node, CLOSED):
                    continue
                best[node] = total
                parent[node] = state
                pushed += 1
                heapq.heappush(queue, (-total * gamma**k, -(k + 1), way, pushed, head))
        return None, Limit.NONE


def _ways(
    problem: Problem, graph: TimeGraph, t: int, states: IntArray
) -> list[tuple[float, float]]:
    """How far off each state's heading the nearest actor is (rad), and how far away (m)."""
    if not problem.actors:
        return [(0.0, 0.0)] * len(states)
    orientation, place = np.divmod(states, graph.n_places)
    eyes = eyes_at(problem.height_map, graph, place)[:, None, :2]
    ways = np.array([actor.poses[t, :2] for actor in problem.actors]) - eyes  # [n, A, 2]
    far = np.hypot(ways[..., 0], ways[..., 1])
    nearest = far.argmin(axis=1)[:, None]
    way = np.take_along_axis(ways, nearest[..., None], axis=1)[:, 0]
    yaw = 2 * np.pi * (orientation // graph.shape[1]) / graph.motion.headings
    off = np.abs((np.arctan2(way[:, 1], way[:, 0]) - yaw + np.pi) % (2 * np.pi) - np.pi)
    # Rounded, so that a turned copy of a scene is searched in the same order.
    near = np.take_along_axis(far, nearest, axis=1)[:, 0]
    return list(zip(off.round(TIE).tolist(), near.round(TIE).tolist(), strict=True))


def _goal_filter(task: SingleRobotTask) -> Callable[[int, int, int], bool]:
    """Say which steps of motion are open: not closed by a charge, and the goal still in reach."""
    robot_class = task.model.class_of[task.robot]
    graph, charges = robot_class.graph, task.charges
    in_reach = None
    if robot_class.goal is not None:
        in_reach = graph.backward_sweep(
            graph.no_reward(task.model.problem.horizon), goal=robot_class.goal
        )

    def may_enter(t: int, tail: int, head: int) -> bool:
        tail_place, head_place = tail % graph.n_places, head % graph.n_places
        return (
            (t + 1, head_place) not in charges.places
            and (t + 1, head) not in charges.states
            and (head_place == tail_place or (t, tail_place, head_place) not in charges.moves)
            and (in_reach is None or in_reach[t + 1, head] > CLOSED)
        )

    return may_enter


def _trace(parent: dict[tuple[int, int], int], k: int, state: int) -> tuple[int, ...]:
    path = [state]
    while k:
        state = parent[k, state]
        k -= 1
        path.append(state)
    return tuple(reversed(path))
