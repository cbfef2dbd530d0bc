"""Coverage of states that is an upper bound until it is evaluated.

Before that a state counts as if nothing hid anybody from it. The reward of a view is
w (sqrt(z + c) - sqrt(z)) summed over the faces, which grows with its coverage c whatever pixels z
the others have: an upper bound on coverage gives one on the reward.
"""

from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.model import Model, Path, RobotClass
from cocap_opt.objective import marginal_gain
from cocap_opt.stop import Stop
from cocap_opt.vision.coverage import usable_cores
from cocap_opt.vision.spans import spans

_SLACK = 1e-9  # of the largest reward, much more than the rounding of bounds
_AT_ONCE = 1_000_000  # entries, to bound the memory


class OptimisticCoverage:
    """Coverage of the states of a robot class on top of what other robots see.

    Node t S + s is state s at step t.

    Parameters
    ----------
    stop : stopping criterion, checked at every step; LimitReached

    Attributes
    ----------
    evaluated : number of nodes evaluated so far
    rewards : [T+1, S] of every state on top of the others' pixels: the reward itself of nodes that
        are known, an upper bound on it elsewhere, CLOSED outside the free states
    """

    def __init__(self, model: Model, robot_class: RobotClass, stop: Stop) -> None:
        model.require_memory(robot_class)
        problem = model.problem
        self._views, self._n_states = model.views(robot_class), robot_class.graph.n_states
        self._steps, self._n_faces = (problem.first_step, problem.horizon), model.n_faces
        self._weights, self._problem = problem.view_sum_weights, problem
        self._entries = _Entries.of(model, robot_class, stop)
        self._pixels = problem.no_pixels()
        self._closed = robot_class.graph.no_reward(problem.horizon)
        self._bounds = self._alone()
        self._known = np.ones(len(self._bounds), dtype=bool)
        self._known[self._entries.nodes] = False
        self._bounds[~self._known] += _SLACK * self._bounds.max(initial=0.0)
        self._rows: dict[int, int] = {}  # of evaluated nodes
        self._found, self._new = _Found.nothing(), list[_Found]()
        self.evaluated = 0
        self.rewards = self._closed + self._bounds.reshape(self._closed.shape)

    def _alone(self) -> FloatArray:
        """Returns an upper bound on the reward of every node for a robot that is alone."""
        roots = np.sqrt(self._entries.pixels) * np.repeat(self._weights, self._entries.counts)
        return np.bincount(self._entries.nodes, roots, self._closed.size).astype(np.float64)

    def unknown(self, nodes: IntArray) -> IntArray:
        """Returns those of nodes [n] that are not evaluated and may see something, increasing."""
        return np.unique(nodes[~self._known[nodes]])

    def known_rewards(self) -> FloatArray:
        """Returns rewards [T+1, S] with nothing where a node is not known: lower bounds."""
        rewards = self.rewards.copy()
        rewards.reshape(-1)[~self._known] = 0.0
        return rewards

    def put_on_top_of(self, pixels: FloatArray) -> None:
        """Lets `rewards` be on top of the pixels [Z] that others have."""
        before, self._pixels = self._pixels, pixels.copy()
        changed = np.flatnonzero(pixels != before)
        n_parts = int(self._entries.counts[changed].sum()) // _AT_ONCE + 1
        for some in np.array_split(changed, n_parts):
            entries, of = self._entries.of_view_sums(some)
            seen = self._entries.pixels[entries]
            gains = marginal_gain(pixels[of], seen) - marginal_gain(before[of], seen)
            np.add.at(self._bounds, self._entries.nodes[entries], gains * self._weights[of])
        np.add(self._closed, self._bounds.reshape(self._closed.shape), out=self.rewards)
        self._found = _Found.joined(self._found, *self._new)
        self._new.clear()
        self.rewards.reshape(-1)[self._found.nodes] = self._gains(self._found)

    def evaluate(self, nodes: IntArray, stop: Stop) -> None:
        """Evaluates nodes [n], increasing, that are not known; `rewards` tell of it.

        Raises
        ------
        LimitReached
            If a limit is reached before all are evaluated. What is evaluated is kept.
        """
        for first in range(0, len(nodes), self._views.batch):
            stop.check()
            some = nodes[first : first + self._views.batch]
            seen = self._views.seen(some, self._steps)
            at = some[seen.rows] // self._n_states * self._n_faces + seen.faces
            at %= max(len(self._pixels), 1)  # of fewer view sums, if pixels add up over time
            found = _Found(some, np.bincount(seen.rows, minlength=len(some)), at, seen.pixels)
            rows = range(self.evaluated, self.evaluated + len(some))
            self._rows |= zip(some.tolist(), rows, strict=True)
            self._new.append(found)
            self.evaluated += len(some)
            self._known[some] = True
            self.rewards.reshape(-1)[some] = self._gains(found)

    def _gains(self, found: "_Found") -> FloatArray:
        """Returns the rewards [n] of evaluated nodes, to the last bit as `marginal_reward` does."""
        gains = marginal_gain(self._pixels[found.view_sums], found.pixels)
        gains *= self._weights[found.view_sums]
        rewards = np.zeros(len(found.nodes))
        some = np.flatnonzero(found.counts)
        if len(some):
            rewards[some] = np.add.reduceat(gains, found.first[some])
        return rewards

    def pixels_along(self, path: Path) -> FloatArray:
        """Returns the pixels [Z] along a path whose nodes are all known."""
        nodes = np.arange(len(path)) * self._n_states + np.array(path)
        rows = [self._rows[node] for node in nodes.tolist() if node in self._rows]
        found = _Found.joined(self._found, *self._new)
        entries = spans(found.first[rows], found.counts[rows])
        pixels = self._problem.no_pixels()
        np.add.at(pixels, found.view_sums[entries], found.pixels[entries])
        return pixels


class _Entries(NamedTuple):
    """Upper bounds on what nodes see of each face, in the order of the view sums."""

    nodes: IntArray  # [n]
    pixels: FloatArray  # [n] px/m2, > 0
    first: IntArray  # [Z] first entry of each view sum
    counts: IntArray  # [Z] number of its entries

    @classmethod
    def of(cls, model: Model, robot_class: RobotClass, stop: Stop) -> Self:
        """Returns the bounds for all nodes that a class can reach; LimitReached."""
        problem, views = model.problem, model.views(robot_class)
        reachable = model.reachable(robot_class)
        size = robot_class.graph.n_states

        def at_step(t: int) -> tuple[IntArray, FloatArray, IntArray]:
            stop.check()
            found = views.unhidden(t, reachable[t])
            # NumPy sorts numbers of 16 bits much faster.
            order = np.argsort(found.faces.astype(np.min_scalar_type(model.n_faces)), kind="stable")
            counts = np.bincount(found.faces, minlength=model.n_faces)
            return t * size + found.states[order], found.pixels[order], counts

        none = np.zeros(0, dtype=np.int64)
        before = np.zeros(problem.first_step * model.n_faces, dtype=np.int64)
        parts = [(none, np.zeros(0), before)]
        pool = ThreadPoolExecutor(usable_cores())
        try:
            parts += pool.map(at_step, range(problem.first_step, problem.horizon + 1))
        finally:
            pool.shutdown(cancel_futures=True)
        nodes, pixels, counts = (np.concatenate(column) for column in zip(*parts, strict=True))
        if problem.objective.over_time:
            faces = np.arange(len(counts)) % max(model.n_faces, 1)
            order = np.argsort(np.repeat(faces, counts), kind="stable")
            nodes, pixels = nodes[order], pixels[order]
            counts = counts.reshape(problem.horizon + 1, -1).sum(axis=0)
        return cls(nodes, pixels, np.cumsum(counts) - counts, counts)

    def of_view_sums(self, some: IntArray) -> tuple[IntArray, IntArray]:
        """Returns the numbers of the entries [n] of some view sums, and the view sum of each."""
        counts = self.counts[some]
        return spans(self.first[some], counts), np.repeat(some, counts)


class _Found(NamedTuple):
    """The pixels of evaluated nodes, in the order in which they were evaluated."""

    nodes: IntArray  # [n]
    counts: IntArray  # [n] number of view sums that each sees
    view_sums: IntArray  # [m]
    pixels: FloatArray  # [m] px/m2, > 0

    @classmethod
    def nothing(cls) -> Self:
        """Returns what no nodes see."""
        none = np.zeros(0, dtype=np.int64)
        return cls(none, none, none, np.zeros(0))

    @property
    def first(self) -> IntArray:
        """First entry [n] of each node."""
        return np.cumsum(self.counts) - self.counts

    @classmethod
    def joined(cls, *parts: Self) -> Self:
        """Returns the nodes of all parts."""
        return cls(*map(np.concatenate, zip(*parts, strict=True))) if len(parts) > 1 else parts[0]
