"""Coverage of states that is an upper bound until it is evaluated.

An unevaluated state's coverage is computed as if nobody were hidden, except by a single column of
the map that hides the whole person. The reward of a view is w (sqrt(z + c) - sqrt(z)), summed over
the faces. It grows with the view's coverage c, whatever pixels z the others have, so an upper bound
on coverage gives one on the reward. If drones that see people are counted, everybody who may be
partly visible counts as seen.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.arithmetic import spans
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.objective import marginal_gain
from cocap_opt.stop import Stop
from cocap_opt.vision.coverage import usable_cores
from cocap_opt.vision.seen import SeenColumns
from cocap_opt.vision.unhidden import UnhiddenViews

_SLACK = 1e-9  # relative to the largest reward; much more than the rounding of bounds
_AT_ONCE = 1_000_000  # entries, which limits memory


class OptimisticCoverage:
    """Coverage of the states of a robot class, and rewards on top of what other robots see.

    Node t S + s is state s at step t.

    Parameters
    ----------
    stop : stopping criterion, checked at every step; raises LimitReached

    Attributes
    ----------
    evaluated : number of nodes evaluated so far
    rewards : [T+1, S] rewards of states on top of the others' pixels: exact for evaluated nodes,
        upper bounds for others, CLOSED outside the free states
    """

    def __init__(self, model: Model, robot_class: RobotClass, stop: Stop) -> None:
        model.tables.require_memory(robot_class.spec)
        problem = model.problem
        self._views, self._n_states = model.views(robot_class), robot_class.graph.n_states
        self._steps = problem.first_step, problem.horizon
        self._weights, self._problem = problem.view_sum_weights, problem
        self._pixels = problem.no_pixels()
        self.rewards = robot_class.graph.no_reward(problem.horizon)
        self._flat = self.rewards.reshape(-1)
        steps = _steps(model, robot_class, stop)
        self._set_bounds(steps)
        nodes = np.concatenate([step.nodes for step in steps])
        alone = np.concatenate([step.rewards for step in steps])
        self._flat[nodes] = alone + _SLACK * alone.max(initial=0.0)
        self._known = np.ones(len(self._flat), dtype=bool)
        self._known[nodes] = False
        self._rows: dict[int, int] = {}  # row of each evaluated node
        self._found, self._new = _Evaluated.nothing(), list[_Evaluated]()
        self.evaluated = 0

    def _set_bounds(self, steps: "list[_StepBounds]") -> None:
        """Stores the bounds on each node's pixels of each face, ordered by view sum."""
        nodes, pixels, counts = (
            np.concatenate(column)
            for column in zip(*((s.seeing, s.pixels, s.counts) for s in steps), strict=True)
        )
        objective = self._problem.objective
        if objective.over_time or objective.views is not None:
            view_sums = self._problem.step_view_sums.ravel()
            order = np.argsort(np.repeat(view_sums, counts), kind="stable")
            nodes, pixels = nodes[order], pixels[order]
            counts = np.bincount(view_sums, weights=counts).astype(np.int64)
        self._bounded, self._bounds = nodes, pixels  # [n], and [n] px/m2, > 0
        self._bound_counts = counts  # [Z] number of entries of each view sum
        self._first_bounds = np.cumsum(counts) - counts  # [Z]

    def unknown(self, nodes: IntArray) -> IntArray:
        """Returns the nodes among [n] that are not evaluated and may see something, in increasing
        order.
        """
        return np.unique(nodes[~self._known[nodes]])

    def known_rewards(self) -> FloatArray:
        """Returns rewards [T+1, S] that are 0 for nodes that are not evaluated: lower bounds."""
        return np.where(self._known.reshape(self.rewards.shape), self.rewards, 0.0)

    def put_on_top_of(self, pixels: FloatArray) -> None:
        """Sets `rewards` to those on top of the pixels [Z] of the other robots."""
        before, self._pixels = self._pixels, pixels.copy()
        changed = np.flatnonzero(pixels != before)
        n_parts = int(self._bound_counts[changed].sum()) // _AT_ONCE + 1
        for part in np.array_split(changed, n_parts):
            counts = self._bound_counts[part]
            entries, of = spans(self._first_bounds[part], counts), np.repeat(part, counts)
            seen = self._bounds[entries]
            values_at = self._problem.returns.values_at
            others = values_at(part, pixels[part]) - values_at(part, before[part])
            gains = values_at(of, pixels[of] + seen) - values_at(of, before[of] + seen)
            gains -= np.repeat(others, counts)
            np.add.at(self._flat, self._bounded[entries], gains * self._weights[of])
        self._found = _Evaluated.joined(self._found, *self._new)
        self._new.clear()
        self._flat[self._found.nodes] = self._gains(self._found)

    def evaluate(self, nodes: IntArray, stop: Stop) -> None:
        """Evaluates nodes [n] that are not evaluated yet, in increasing order, and updates
        `rewards`.

        Raises
        ------
        LimitReached
            If a limit is reached before all are evaluated. Nodes evaluated so far are kept.
        """
        for first in range(0, len(nodes), self._views.batch):
            stop.check()
            batch = nodes[first : first + self._views.batch]
            seen = self._views.seen(batch, self._steps)
            steps = np.repeat(batch // self._n_states, seen.counts)
            at = self._problem.step_view_sums[steps, seen.columns]
            found = _Evaluated(batch, seen.counts, at, seen.amounts)
            rows = range(self.evaluated, self.evaluated + len(batch))
            self._rows |= zip(batch.tolist(), rows, strict=True)
            self._new.append(found)
            self.evaluated += len(batch)
            self._known[batch] = True
            self._flat[batch] = self._gains(found)

    def _gains(self, found: "_Evaluated") -> FloatArray:
        """Returns the rewards [n] of evaluated nodes, bit for bit those of `marginal_reward`."""
        of = found.view_sums
        gains = marginal_gain(self._problem, of, self._pixels[of], found.pixels)
        gains *= self._weights[of]
        rewards = np.zeros(len(found.nodes))
        seeing = np.flatnonzero(found.counts)
        if len(seeing):
            rewards[seeing] = np.add.reduceat(gains, found.first[seeing])
        return rewards

    def pixels_along(self, path: Path) -> FloatArray:
        """Returns the pixels [Z] along a path whose nodes are all evaluated."""
        nodes = np.arange(len(path)) * self._n_states + np.array(path)
        rows = [self._rows[node] for node in nodes.tolist() if node in self._rows]
        found = _Evaluated.joined(self._found, *self._new)
        entries = spans(found.first[rows], found.counts[rows])
        pixels = self._problem.no_pixels()
        np.add.at(pixels, found.view_sums[entries], found.pixels[entries])
        return pixels


class _StepBounds(NamedTuple):
    """Upper bounds at one step."""

    nodes: IntArray  # [s] nodes that may see something, increasing
    rewards: FloatArray  # [s] rewards of a robot that is alone
    seeing: IntArray  # [n] nodes of the entries; one entry for each column that a node may see
    pixels: FloatArray  # [n] px/m2, > 0; 1 for counted people
    counts: IntArray  # [W] number of entries of each column, whose entries are contiguous

    @classmethod
    def of(cls, found: SeenColumns, first: int, weights: FloatArray) -> Self:
        """Returns the bounds of a step, given the number of its first node.

        Parameters
        ----------
        weights : [W] weights of the columns
        """
        seeing = np.flatnonzero(found.counts)
        nodes, sizes = first + seeing, found.counts[seeing]
        starts = np.cumsum(sizes) - sizes
        # also for counts, as the root of 1 drone is 1
        roots = np.sqrt(found.amounts) * weights[found.columns]
        rewards = np.add.reduceat(roots, starts) if len(starts) else roots
        # NumPy sorts 16-bit numbers much faster.
        columns = found.columns.astype(np.min_scalar_type(len(weights)))
        order = np.argsort(columns, kind="stable")
        counts = np.bincount(found.columns, minlength=len(weights))
        return cls(nodes, rewards, np.repeat(nodes, sizes)[order], found.amounts[order], counts)


def _steps(model: Model, robot_class: RobotClass, stop: Stop) -> list[_StepBounds]:
    """Returns the bounds of all steps, for all nodes that a class can reach; raises
    LimitReached.
    """
    problem, views = model.problem, UnhiddenViews(model.views(robot_class))
    reachable, size = model.reachable(robot_class), robot_class.graph.n_states

    def at(t: int) -> _StepBounds:
        stop.check()
        if t < problem.first_step:
            return _StepBounds.of(SeenColumns.nothing(size), t * size, np.zeros(problem.step_width))
        weights = problem.view_sum_weights[problem.view_sums_at(t)]
        return _StepBounds.of(views.at(t, reachable[t]), t * size, weights)

    pool = ThreadPoolExecutor(usable_cores())
    try:
        return list(pool.map(at, range(problem.horizon + 1)))
    finally:
        pool.shutdown(cancel_futures=True)


class _Evaluated(NamedTuple):
    """The pixels of evaluated nodes, in the order in which they were evaluated."""

    nodes: IntArray  # [n]
    counts: IntArray  # [n] number of view sums that each node sees
    view_sums: IntArray  # [m]
    pixels: FloatArray  # [m] px/m2, > 0

    @classmethod
    def nothing(cls) -> Self:
        """Returns the pixels of no nodes."""
        none = np.zeros(0, dtype=np.int64)
        return cls(none, none, none, np.zeros(0))

    @property
    def first(self) -> IntArray:
        """First entry [n] of each node."""
        return np.cumsum(self.counts) - self.counts

    @classmethod
    def joined(cls, *parts: Self) -> Self:
        """Returns the nodes of all parts in one."""
        return cls(*map(np.concatenate, zip(*parts, strict=True))) if len(parts) > 1 else parts[0]
