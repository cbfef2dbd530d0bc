"""Searches for the joint state of largest reduced profit, and for all joint states that count.

It searches the tree of partial joint states depth-first. A partial joint state with pixels z can be
completed to at most F(z) - prices so far + sum over the remaining robots of the largest gain, since
gains only shrink as more is seen (returns are concave, so that F is submodular): a subtree that
cannot exceed the least profit asked for is pruned. A ceiling from earlier prices prunes more: if no
joint state had more profit than V' at price', then

    F(s) - sum_i price(s_i) <= V' - sum_i [price(s_i) - price'(s_i)].

Ceilings bound the worth less charges, too: a few states with large slack use up the allowed loss,
whatever their worth. Nodes that pass all of these tests are relaxed (`relaxation`), where most
branches are pruned.

There are two implementations: the plain search in this module, which is written to be read, and the
compiled one (`search_kernel`), which takes over if a search is long, unless it is switched off.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.compiled_search import KERNEL
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.relaxation import ROBOTS, Conditions, Relaxation
from cocap_opt.stop import Stop, never

if TYPE_CHECKING:
    from cocap_opt.formulations.certificates.staged.search_kernel import CompiledSearch

PLAIN_NODES = 300  # nodes after which the compiled search takes over, if it is available
# nodes (second) after which it takes over for teams of at least this many robots (first)
_LARGE, _FEW_NODES = 5, 30
# Limit on the joint states that one search collects, of some hundred bytes each
MOST_FOUND = 3_000_000
AT_ONCE = 20_000  # nodes of the compiled search between two checks of the stopping criterion


class NotEndedError(Exception):
    """The search needs more than its number of nodes."""


class MostProfitable(NamedTuple):
    """The joint state of largest reduced profit among those that count."""

    profit: float  # its profit, or the least profit asked for if no joint state has more
    positions: tuple[int, ...] = ()  # positions of its states; empty if no joint state has more
    nodes: int = 0  # number of nodes of the tree


def most_profitable(
    joint: JointStates, least: float, most_nodes: int, stop: Stop = never, plain: bool = False
) -> MostProfitable:
    """Returns the joint state of largest profit, if it is clearly above the least profit asked for.

    An excess of up to half the margin does not count. Profits in the search have errors of up to an
    eighth of the margin, so a search among fewer states may return another joint state, whose
    profit is higher by up to a quarter of the margin. The margin covers that half and the errors of
    the search.

    Parameters
    ----------
    least : profits up to this value are ignored
    most_nodes : largest number of nodes of the tree
    plain : True: use the plain search only

    Raises
    ------
    NotEndedError
        If the tree is larger.
    LimitReached
        If a limit is reached.
    """
    search = _searched(joint, least, most_nodes, stop, plain)
    if search.positions:
        profit = joint.reduced_profit(search.positions)
        if profit > least + joint.margin / 2:
            return MostProfitable(profit, search.positions, search.nodes)
    return MostProfitable(least, nodes=search.nodes)


def all_that_count(
    joint: JointStates, most_nodes: int, stop: Stop = never
) -> tuple[list[tuple[int, ...]], int]:
    """Returns the positions of all joint states that count, and the number of nodes of the plain
    search.

    Raises
    ------
    NotEndedError
        If the tree is larger, or more than `MOST_FOUND` joint states count.
    LimitReached
        If a limit is reached.
    """
    # With its charges as prices, a joint state counts if its profit reaches the floor.
    joint = replace(joint, price=joint.charge, ceilings=())
    search = _PlainSearch(joint, joint.floor - joint.margin, most_nodes, collects=True)
    search.run(stop)
    return search.found, search.nodes


def plain_nodes(joint: JointStates) -> int:
    """Returns the number of nodes at which a search counts as long and is compiled if possible."""
    return _FEW_NODES if sum(joint.sizes) >= _LARGE else PLAIN_NODES


def _searched(
    joint: JointStates, least: float, most_nodes: int, stop: Stop, plain: bool
) -> "_PlainSearch | CompiledSearch":
    """Returns a finished search; a long search is restarted with compiled code if possible.

    Loading the compiled search takes longer than most searches; once it is loaded, all searches use
    it.
    """
    if not plain and KERNEL.is_loaded:
        return _run_compiled(joint, least, most_nodes, stop)
    few = plain_nodes(joint)
    is_long = not plain and most_nodes > few and KERNEL.may_take_over(stop)
    search = _PlainSearch(joint, least, few if is_long else most_nodes)
    try:
        search.run(stop)
    except NotEndedError:
        if not is_long:
            raise
        if KERNEL.takes_over(stop):
            return _run_compiled(joint, least, most_nodes, stop)
        search = _PlainSearch(joint, least, most_nodes)
        search.run(stop)
    return search


def _run_compiled(
    joint: JointStates, least: float, most_nodes: int, stop: Stop
) -> "CompiledSearch":
    """Returns a finished compiled search; raises NotEndedError and LimitReached.

    A call may exceed its number of nodes slightly, by those of the last two robots.
    """
    from cocap_opt.formulations.certificates.staged.search_kernel import CompiledSearch

    search, has_ended = CompiledSearch.of(joint, least), False
    while not has_ended and search.nodes <= most_nodes:
        stop.check()
        has_ended = search.advance(min(AT_ONCE, most_nodes - search.nodes + 1))
    if not has_ended or search.nodes > most_nodes:
        raise NotEndedError
    return search


class _Partial(NamedTuple):
    """A partial joint state."""

    chosen: tuple[int, ...]  # positions of its states
    pixels: FloatArray  # [F] seen so far
    profit: float  # worth so far less the prices so far
    low: float  # worth so far less the charges so far
    below: tuple[float, ...]  # ceilings and limits, less the increases of prices and charges so far
    counts: tuple[int, ...]  # remaining robots of each class
    states: IntArray  # positions of the states that may still be taken, class by class
    shares: FloatArray  # [n] of all states in the mixture of the parent node (`relaxation`)


class _Children(NamedTuple):
    """The states that may be taken next and can reach enough profit; the next robot's first, best
    first.
    """

    states: IntArray  # [n] their positions
    gains: FloatArray  # [n] of worth less prices
    low: FloatArray  # [n] gains of worth less charges
    most: FloatArray  # [n] the largest profit that is reachable with them
    of_class: int  # number of states of the next robot's class


class _PlainSearch:
    """The plain search, written to be read; `compiled_search` is a faster version.

    Parameters
    ----------
    collects : True: find all joint states that count instead of the most profitable one

    Attributes
    ----------
    best : largest profit found, initially the least profit asked for
    positions : positions of the states of the best joint state; empty if none was found
    found : positions of the joint states that were collected
    nodes : number of nodes of the tree so far
    """

    def __init__(
        self, joint: JointStates, least: float, most_nodes: int, collects: bool = False
    ) -> None:
        self._joint, self._most_nodes, self._collects = joint, most_nodes, collects
        self.best = least
        self.positions: tuple[int, ...] = ()
        self.found: list[tuple[int, ...]] = []
        self._floor = joint.floor - joint.margin
        self._payments = np.array([
            joint.price, joint.charge, *(raised for _, raised in joint.bounds)
        ])  # fmt: skip
        self.nodes = 0

    def run(self, stop: Stop = never) -> None:
        """Searches the tree; raises NotEndedError and LimitReached."""
        joint = self._joint
        nothing, everything = np.zeros(len(joint.weights)), np.arange(len(joint.states))
        below = tuple(profit for profit, _ in joint.bounds)
        none = np.zeros(len(joint.states))
        self._explore(_Partial((), nothing, 0.0, 0.0, below, joint.sizes, everything, none), stop)

    def _explore(self, node: _Partial, stop: Stop) -> None:
        """Explores all completions of a partial joint state that count and may be better."""
        self.nodes += 1
        if self.nodes > self._most_nodes:
            raise NotEndedError
        if not self.nodes % 500:
            stop.check()
        robot_class = next((c for c, n in enumerate(node.counts) if n), None)
        if robot_class is None:
            self._end(node)
            return
        counts = tuple(n - (c == robot_class) for c, n in enumerate(node.counts))
        found = self._children(node, robot_class)
        if found.of_class and sum(node.counts) >= ROBOTS:
            node, found = self._relaxed(node, found)
        for k in range(found.of_class):
            # Later robots of this class take no state before this one.
            worse = found.gains[0] - found.gains[k]
            if found.most[k] - counts[robot_class] * worse <= self.best:
                break
            left = found.states[k if counts[robot_class] else found.of_class :]
            gained = float(found.gains[k]), float(found.low[k])
            self._explore(self._child(node, int(found.states[k]), gained, counts, left), stop)

    def _end(self, node: _Partial) -> None:
        """Records a complete joint state."""
        if self._collects:
            self.found.append(node.chosen)
            if len(self.found) > MOST_FOUND:
                raise NotEndedError
        elif node.profit > self.best:
            self.best, self.positions = node.profit, node.chosen

    def _children(self, node: _Partial, robot_class: int) -> _Children:
        """Returns the states that may be taken next, those of the given class first."""
        joint, states, counts = self._joint, node.states, node.counts
        worth = joint.returns.values(node.pixels) @ joint.weights
        gains = joint.returns.values(node.pixels + joint.pixels[states]) @ joint.weights - worth
        low = gains - joint.charge[states]
        gains -= joint.price[states]
        classes = joint.class_of[states]
        most = _most(node.profit, gains, classes, counts)
        is_able = (most > self.best) & (_most(node.low, low, classes, counts) >= self._floor)
        for k, (_, raised) in enumerate(joint.bounds):
            at_most = _most(node.below[k], -raised[states], classes, counts)
            is_able &= at_most > self.best if k < len(joint.ceilings) else at_most >= self._floor
        able = np.flatnonzero(is_able)
        of_class = int(np.searchsorted(classes[able], robot_class, side="right"))
        able[:of_class] = able[:of_class][np.argsort(-gains[able[:of_class]], kind="stable")]
        return _Children(states[able], gains[able], low[able], most[able], of_class)

    def _relaxed(self, node: _Partial, found: _Children) -> tuple[_Partial, _Children]:
        """Returns the node with its mixture, and the states that pass the relaxation."""
        joint = self._joint
        least = [
            self.best if k < len(joint.ceilings) else self._floor for k in range(len(node.below))
        ]
        constants = [node.profit - self.best, node.low - self._floor]
        constants += [below - wanted for below, wanted in zip(node.below, least, strict=True)]
        conditions = Conditions(np.array(constants), self._payments)
        relaxation = Relaxation(joint, conditions, node.pixels, node.counts, found.states)
        relaxation.run(node.shares[found.states])
        kept, shares = relaxation.kept, np.zeros(len(joint.states))
        shares[found.states] = relaxation.shares
        left = _Children(
            found.states[kept], found.gains[kept], found.low[kept], found.most[kept],
            int(np.count_nonzero(kept[: found.of_class])),
        )  # fmt: skip
        return node._replace(shares=shares), left

    def _child(
        self, node: _Partial, state: int, gained: tuple[float, float], counts: tuple[int, ...],
        left: IntArray,
    ) -> _Partial:  # fmt: skip
        """Returns the child of a node for one more state, with its gains net of prices and of
        charges.
        """
        joint, bounds = self._joint, zip(node.below, self._joint.bounds, strict=True)
        return _Partial(
            (*node.chosen, state),
            node.pixels + joint.pixels[state],
            node.profit + gained[0],
            node.low + gained[1],
            tuple(below - float(raised[state]) for below, (_, raised) in bounds),
            counts,
            left[~joint.conflicts.between(state, left)],
            node.shares,
        )


def _most(
    so_far: float, gains: FloatArray, classes: IntArray, counts: tuple[int, ...]
) -> FloatArray:
    """Returns the largest profit [n] that completions with each of the states can reach."""
    best = np.full(len(counts), -np.inf)
    np.maximum.at(best, classes, gains)
    total = so_far + sum(n * best[c] for c, n in enumerate(counts) if n)
    most: FloatArray = total - best[classes] + gains
    return most
