"""The joint states of a team at one step, and the search for the highest of them.

A joint state is one state for each robot. It is worth the weighted roots of what its robots see
together; each robot is paid for its state. The search finds the largest difference of the two,

    V = max over joint states s of  F(s) - sum_i payment(s_i),
    F(s) = sum_f w_f sqrt(sum_i c_f(s_i)),

over the states that are left at the step. Robots of one class are alike, so that joint states
are multisets; two robots whose states conflict are no joint state.

It goes through the tree of partial joint states in depth. A partial one of pixels z can be
completed to at most F(z) - payments so far + sum over the robots left of the largest gain, since
gains only shrink as more is seen (F is submodular): what cannot exceed the least height wanted
is left out, for the whole subtree. A ceiling of earlier payments leaves out more: where no joint
state was higher than V' when payment' was paid,

    F(s) - sum_i payment(s_i) <= V' - sum_i [payment(s_i) - payment'(s_i)].

Only such joint states count as some plan above a target may visit: their worth less what they are
charged is at least a floor (`narrowing` has the inequality). Ceilings bound that difference, too:
states of much slack are soon too many, whatever they are worth.

The producer of a certificate searches among more states than its checker, and in a search heights
round in their own way. So the height of what is found is computed anew, from its own states alone
and correctly rounded; and what is higher than wanted by rounding alone is not higher.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.pricing import UNIT_ROUNDOFF
from cocap_opt.formulations.certificates.staged import compiled_search
from cocap_opt.model import Model
from cocap_opt.stop import Stop, never
from cocap_opt.sums import exact_sum

PLAIN_NODES = 2000  # after which the compiled search takes over, where there is one
_LARGE, _FEW_NODES = 5, 100  # likewise, of teams of so many robots, whose searches are long
_ROWS = 500  # of a table of conflicts, for which distances are computed at once
# Joint states that one search collects: as many would follow each of them, so it does not end soon.
MOST_FOUND = 200_000
AT_ONCE = 200_000  # nodes of the compiled search between two looks at the stop


class Wanted(NamedTuple):
    """The height and the work that a search of joint states is asked for."""

    least: float  # heights up to here do not matter
    most_nodes: int  # of the tree


class Highest(NamedTuple):
    """The highest joint state that counts."""

    height: float  # or the least one wanted, if none is higher
    positions: tuple[int, ...] = ()  # of its states; none if none is higher
    nodes: int = 0  # of the tree


class Ceiling(NamedTuple):
    """The height of the highest joint state when other payments were paid, and what is paid now."""

    height: float
    more: FloatArray  # [n] what each state is paid, or charged, more than then


class Collected(NamedTuple):
    """All joint states that count."""

    found: list[tuple[int, ...]]  # positions of the states
    nodes: int  # of the search


class NotEndedError(Exception):
    """The search has not ended within its number of nodes."""


@dataclass(frozen=True, eq=False)
class JointStates:
    """The states that are left to the robots at one step, class by class.

    Attributes
    ----------
    t : the step
    sizes : number of robots of each class
    class_of : [n] number of each state's class, not decreasing
    states : [n] number of each state in the graph of its class
    pixels : [n, F] coverage of the faces that any of the states sees, px/m2
    weights : [F] of these faces, > 0
    payment : [n] of each state, in units of J
    charge : [n] of each state; a joint state counts if its worth less its charges is >= `floor`
    floor : in units of J
    conflict_of : returns `conflict`, for which not everyone asks, and keeps it for `repaid`
    ceilings : of earlier payments; rounding included
    limits : ceilings of the worth less the charges; rounding included
    """

    t: int
    sizes: tuple[int, ...]
    class_of: IntArray
    states: IntArray
    pixels: FloatArray
    weights: FloatArray
    payment: FloatArray
    charge: FloatArray
    floor: float
    conflict_of: Callable[[], BoolArray]
    ceilings: tuple[Ceiling, ...] = ()
    limits: tuple[Ceiling, ...] = ()

    @classmethod
    def of(
        cls,
        model: Model,
        t: int,
        left: Sequence[IntArray],
        payment: Sequence[FloatArray],
        charge: Sequence[FloatArray],
        floor: float,
        ceilings: tuple[Ceiling, ...] = (),
        limits: tuple[Ceiling, ...] = (),
        apart: Sequence[int] | None = None,
    ) -> "JointStates":
        """Returns the joint states of a step.

        Parameters
        ----------
        left : of each class, the numbers [n] of the states that are left at the step
        payment, charge : of each class, of these states [n]
        ceilings, limits : over these states
        apart : the class of each robot, if every robot is a class of its own here; "of each class"
            is of each robot then
        """
        class_of = np.repeat(np.arange(len(left)), [len(some) for some in left])
        numbers = range(len(left)) if apart is None else apart
        sizes = model.class_sizes if apart is None else (1,) * len(apart)
        pixels = np.concatenate([
            _pixels(model, c, t, some) for c, some in zip(numbers, left, strict=True)
        ])  # fmt: skip
        weights = model.problem.view_sum_weights[t * model.n_faces : (t + 1) * model.n_faces]
        seen = (pixels > 0).any(axis=0) & (weights > 0)
        at = np.concatenate([
            model.places.positions[c][some % model.classes[c].graph.n_places]
            for c, some in zip(numbers, left, strict=True)
        ])  # fmt: skip
        different, which = np.unique(at, axis=0, return_inverse=True)

        def conflict() -> BoolArray:
            parts = [
                model.problem.rules.too_near(different[None] - different[k : k + _ROWS, None])
                for k in range(0, len(different), _ROWS)
            ]
            return np.concatenate([np.zeros((0, len(different)), np.bool_), *parts])[
                np.ix_(which, which)
            ]

        return cls(
            t, sizes, class_of, np.concatenate(left), pixels[:, seen], weights[seen],
            np.concatenate(payment), np.concatenate(charge), floor,
            cache(conflict), ceilings, limits,
        )  # fmt: skip

    @property
    def conflict(self) -> BoolArray:
        """Returns whether two robots may not be in these states at once [n, n]."""
        return self.conflict_of()

    @cached_property
    def bounds(self) -> tuple[Ceiling, ...]:
        """The ceilings, and after them the limits."""
        return (*self.ceilings, *self.limits)

    @cached_property
    def keys(self) -> list[tuple[int, int]]:
        """Class and number of each state [n]."""
        return list(zip(self.class_of.tolist(), self.states.tolist(), strict=True))

    @cached_property
    def margin(self) -> float:
        """The room that a constant leaves above a height for rounding, in units of J.

        In the search a height is a sum of at most R (F + 2) terms, each the result of a few
        operations, none of them larger than what all robots see and are paid at most: rounding
        changes it by at most an eighth of this.
        """
        robots = sum(self.sizes)
        most = self.weights @ np.sqrt(robots * self.pixels.max(axis=0, initial=0.0))
        most += robots * np.abs(self.payment).max(initial=0.0)
        most += robots * np.abs(self.charge).max(initial=0.0)
        return float(16 * robots * (len(self.weights) + robots + 4) * UNIT_ROUNDOFF * most)

    @property
    def plain_nodes(self) -> int:
        """Nodes from which on a search is long, so that it is compiled where it can be."""
        return _FEW_NODES if sum(self.sizes) >= _LARGE else PLAIN_NODES

    def repaid(self, payment: FloatArray, constant: float = np.inf) -> "JointStates":
        """Returns the same joint states with other payments.

        Parameters
        ----------
        constant : that no joint state's height exceeds with the present payments, rounding
            included
        """
        more = payment - self.payment
        ceilings = [Ceiling(height, before + more) for height, before in self.ceilings]
        if constant < np.inf:
            ceilings.append(Ceiling(constant, more))
        return replace(self, payment=payment, ceilings=tuple(ceilings))

    def part(self, positions: IntArray, floor: float) -> "JointStates":
        """Returns the joint states of some of the states, those up to another floor.

        Parameters
        ----------
        positions : [n] of the states, increasing
        """
        bounds = (
            tuple(Ceiling(height, more[positions]) for height, more in some)
            for some in (self.ceilings, self.limits)
        )
        ceilings, limits = bounds
        return replace(
            self,
            class_of=self.class_of[positions],
            states=self.states[positions],
            pixels=self.pixels[positions],
            payment=self.payment[positions],
            charge=self.charge[positions],
            floor=floor,
            conflict_of=cache(lambda: self.conflict[np.ix_(positions, positions)]),
            ceilings=ceilings,
            limits=limits,
        )

    def worth(self, chosen: Sequence[int]) -> float:
        """Returns F of a joint state, whose states are given by their positions.

        It depends on these states alone: not on their order, nor on which others are listed.
        """
        return exact_sum(self._worths(chosen))

    def worths(self, chosen: IntArray) -> FloatArray:
        """Returns F of some joint states [K, R], each the same in whatever company."""
        seen = np.zeros((len(chosen), len(self.weights)))
        for k in range(chosen.shape[1]):
            seen += self.pixels[chosen[:, k]]
        worths: FloatArray = (np.sqrt(seen) * self.weights).sum(axis=1)
        return worths

    def height(self, chosen: Sequence[int]) -> float:
        """Returns the height of a joint state, its worth less its payments; as `worth` does."""
        return exact_sum([*self._worths(chosen), *(-self.payment[list(chosen)]).tolist()])

    def _worths(self, chosen: Sequence[int]) -> list[float]:
        """Returns what each face [F] is worth in a joint state."""
        pixels = [math.fsum(own) for own in self.pixels[list(chosen)].T.tolist()]
        worths: list[float] = (self.weights * np.sqrt(pixels)).tolist()
        return worths

    def counts(self, chosen: Sequence[int]) -> bool:
        """Returns True for a joint state that some plan above the target may visit."""
        at = list(chosen)
        apart = not np.triu(self.conflict[np.ix_(at, at)], 1).any()
        return apart and self.worth(at) - float(self.charge[at].sum()) >= self.floor - self.margin

    def highest(self, wanted: Wanted, stop: Stop = never) -> Highest:
        """Returns the highest joint state that counts, if it is clearly higher than wanted.

        One that is higher by no more than half the margin is not. Heights err in the search by up
        to an eighth of it, so that a search among fewer states may end with another joint state,
        higher by up to a quarter. The margin is room for that half and for errors of the search.

        Raises
        ------
        NotEndedError
            If the tree is larger than its limit.
        LimitReached
            At a limit.
        """
        search = self._searched(wanted, stop)
        if search.positions:
            height = self.height(search.positions)
            if height > wanted.least + self.margin / 2:
                return Highest(height, search.positions, search.nodes)
        return Highest(wanted.least, nodes=search.nodes)

    def all_that_count(self, most_nodes: int, stop: Stop = never) -> Collected:
        """Returns all joint states that count, by the plain search.

        Raises
        ------
        NotEndedError
            If the tree is larger than its limit, or more than `MOST_FOUND` count.
        LimitReached
            At a limit.
        """
        plain = _PlainSearch(self, Wanted(-np.inf, most_nodes), collects=True)
        plain.run(stop)
        return Collected(plain.found, plain.nodes)

    def _searched(self, wanted: Wanted, stop: Stop) -> "_PlainSearch | compiled_search.Running":
        """Returns a search that has ended; a long one is begun again, compiled, where it can be.

        Once the compiled search has been loaded, which takes longer than most searches, all are
        compiled.
        """
        if compiled_search.is_loaded():
            return self._run_compiled(wanted, stop)
        is_long = wanted.most_nodes > self.plain_nodes and compiled_search.may_take_over(stop)
        first = wanted._replace(most_nodes=self.plain_nodes) if is_long else wanted
        plain = _PlainSearch(self, first)
        try:
            plain.run(stop)
        except NotEndedError:
            if not is_long:
                raise
            return self._run_compiled(wanted, stop)
        return plain

    def running(self, least: float, most_found: int = 0) -> compiled_search.Running:
        """Returns a compiled search at its beginning.

        Parameters
        ----------
        least : least height that is wanted
        most_found : if not 0, the search is for `follow`, which collects up to so many in a call
        """
        first, faces, pixels = self.sparse
        return compiled_search.Running.of(
            (first, faces, pixels, self.weights, self.payment, self.charge),
            self.class_of, self.sizes, self.conflict, self.ceilings, self.limits,
            least, self.floor - self.margin, most_found,
        )  # fmt: skip

    def _run_compiled(self, wanted: Wanted, stop: Stop) -> compiled_search.Running:
        """Returns a compiled search that has ended."""
        running = self.running(wanted.least)
        for done in range(0, wanted.most_nodes, AT_ONCE):
            stop.check()
            if running.advance(min(AT_ONCE, wanted.most_nodes - done)):
                return running
        raise NotEndedError

    @cached_property
    def sparse(self) -> tuple[IntArray, IntArray, FloatArray]:
        """The pixels in compressed sparse rows: first entry of each state [n+1], faces, pixels."""
        rows, faces = np.nonzero(self.pixels)
        return (
            np.searchsorted(rows, np.arange(len(self.pixels) + 1)),
            np.ascontiguousarray(faces),  # numba compiles once more for another layout
            self.pixels[rows, faces],
        )


def _pixels(model: Model, number: int, t: int, states: IntArray) -> FloatArray:
    """Returns the coverage of all faces at a step [n, F] from states [n] of a class."""
    robot_class = model.classes[number]
    table = model.coverage(robot_class)
    which, entries = table.entries(t * robot_class.graph.n_states + states)
    pixels = np.zeros((len(states), model.n_faces))
    pixels[which, table.view_sums[entries] - t * model.n_faces] = table.pixels[entries]
    return pixels


class _Node(NamedTuple):
    """A partial joint state."""

    chosen: tuple[int, ...]  # positions of its states
    pixels: FloatArray  # [F] seen so far
    height: float  # worth so far less the payments so far
    low: float  # worth so far less the charges so far
    below: tuple[float, ...]  # ceilings and limits, less what is paid or charged more so far
    counts: tuple[int, ...]  # robots left of each class
    states: IntArray  # positions of the states that may still be taken, class by class


class _Children(NamedTuple):
    """States that may be taken next, first those of the next robot's class, the best first."""

    states: IntArray  # [n] their positions
    gains: FloatArray  # [n] of worth, less payments
    low: FloatArray  # [n] gains of worth, less charges
    most: FloatArray  # [n] height that is reached with them at most
    of_own: int  # how many are of the next robot's class


class _PlainSearch:
    """The plain search, written to be read; `compiled_search` does the same, faster.

    Parameters
    ----------
    collects : look for all joint states that count instead of the highest one

    Attributes
    ----------
    best : largest height found, at first the least one wanted
    positions : of the states of the highest joint state; none if none is higher
    found : positions of the joint states that were collected
    nodes : number of nodes of the tree so far
    """

    def __init__(self, joint: JointStates, wanted: Wanted, collects: bool = False) -> None:
        self._joint, self._most_nodes, self._collects = joint, wanted.most_nodes, collects
        self.best = wanted.least
        self.positions: tuple[int, ...] = ()
        self.found: list[tuple[int, ...]] = []
        self._floor = joint.floor - joint.margin
        self.nodes = 0

    def run(self, stop: Stop = never) -> None:
        """Goes through the tree; raises NotEndedError and LimitReached."""
        joint = self._joint
        nothing, everything = np.zeros(len(joint.weights)), np.arange(len(joint.states))
        below = tuple(ceiling.height for ceiling in joint.bounds)
        self._explore(_Node((), nothing, 0.0, 0.0, below, joint.sizes, everything), stop)

    def _explore(self, node: _Node, stop: Stop) -> None:
        """Goes through all completions of a partial joint state that count and may be higher."""
        self.nodes += 1
        if self.nodes > self._most_nodes:
            raise NotEndedError
        if not self.nodes % 500:
            stop.check()
        own = next((c for c, n in enumerate(node.counts) if n), None)
        if own is None:
            self._end(node)
            return
        counts = tuple(n - (c == own) for c, n in enumerate(node.counts))
        children = self._children(node, own)
        gains, most = children.gains, children.most
        for k in range(children.of_own):
            # Of this class, none of those before it is taken any more.
            if most[k] - counts[own] * (gains[0] - gains[k]) <= self.best:
                break
            left = children.states[k if counts[own] else children.of_own :]
            self._explore(self._child(node, children, k, counts, left), stop)

    def _end(self, node: _Node) -> None:
        """Takes down a joint state that is complete."""
        if self._collects:
            self.found.append(node.chosen)
            if len(self.found) > MOST_FOUND:
                raise NotEndedError
        elif node.height > self.best:
            self.best, self.positions = node.height, node.chosen

    def _children(self, node: _Node, own: int) -> _Children:
        """Returns the states that may be taken and reach enough."""
        joint, states, counts = self._joint, node.states, node.counts
        worth = np.sqrt(node.pixels) @ joint.weights
        gains = np.sqrt(node.pixels + joint.pixels[states]) @ joint.weights - worth
        low = gains - joint.charge[states]
        gains -= joint.payment[states]
        classes = joint.class_of[states]
        most = _most(node.height, gains, classes, counts)
        is_able = (most > self.best) & (_most(node.low, low, classes, counts) >= self._floor)
        for k, bound in enumerate(joint.bounds):
            at_most = _most(node.below[k], -bound.more[states], classes, counts)
            is_able &= at_most > self.best if k < len(joint.ceilings) else at_most >= self._floor
        able = np.flatnonzero(is_able)
        of_own = int(np.searchsorted(classes[able], own, side="right"))
        able[:of_own] = able[:of_own][np.argsort(-gains[able[:of_own]], kind="stable")]
        return _Children(states[able], gains[able], low[able], most[able], of_own)

    def _child(
        self, node: _Node, children: _Children, k: int, counts: tuple[int, ...], left: IntArray
    ) -> _Node:
        """Returns the node where the k-th child's state is taken too."""
        joint, state = self._joint, int(children.states[k])
        bounds = zip(node.below, joint.bounds, strict=True)
        return _Node(
            (*node.chosen, state),
            node.pixels + joint.pixels[state],
            node.height + float(children.gains[k]),
            node.low + float(children.low[k]),
            tuple(below - float(bound.more[state]) for below, bound in bounds),
            counts,
            left[~joint.conflict[state, left]],
        )


def _most(
    so_far: float, gains: FloatArray, classes: IntArray, counts: tuple[int, ...]
) -> FloatArray:
    """Returns what completions that take each of the states can reach at most [n]."""
    best = np.full(len(counts), -np.inf)
    np.maximum.at(best, classes, gains)
    total = so_far + sum(n * best[c] for c, n in enumerate(counts) if n)
    most: FloatArray = total - best[classes] + gains
    return most
