"""The compiled searches of joint states, step by step; imported only if numba is installed.

A node of the tree is a partial joint state. The search descends into a child and returns; for each
depth, the data needed to continue is kept in arrays that are allocated once. The code avoids slices
and sorting by NumPy, with which compilation would take ten seconds instead of two.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.compiling import compiled
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.conflicts import Conflicts
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.kernel_arrays import (
    CHARGED,
    DEPTH,
    FOUND,
    IS_DONE,
    IS_NEW,
    MOST,
    NODES,
    PIXELS,
    PRICED,
    VALUES,
    Inputs,
    Memory,
)
from cocap_opt.formulations.certificates.staged.relaxation import ROBOTS
from cocap_opt.formulations.certificates.staged.relaxation_kernel import Relaxed, relax, relaxed_of
from cocap_opt.returns import Returns, return_of


class _MoveLists(NamedTuple):
    """The states that may be taken after each of L joint states of the step before, robot by
    robot.
    """

    first: IntArray  # [K+1] first entry of each list of states
    positions: IntArray  # positions of the states of all lists
    lists: IntArray  # [L, R] number of each robot's list
    floors: FloatArray  # [L] least worth less charges of a joint state that counts


# Inlined into the callers: calls that pass all arrays took half as long again.
_inlined = partial(compiled, kept=False, forceinline=True)
_return_of = _inlined(return_of)


@_inlined
def _end(memory: Memory, depth: int, best: float) -> float:
    """Records a complete joint state; returns the largest profit so far."""
    if len(memory.collected):
        for k in range(depth):
            memory.collected[memory.progress[FOUND], k] = memory.chosen[0, k]
        memory.progress[FOUND] += 1
    elif memory.profits[PRICED, depth] > best:
        for k in range(depth):
            memory.chosen[1, k] = memory.chosen[0, k]
        return float(memory.profits[PRICED, depth])
    return best


@_inlined
def _at_most(so_far: float, data: Inputs, depth: int, largest: FloatArray, row: int) -> float:
    """Returns an upper bound, in which each remaining robot adds its class's largest gain."""
    for c in range(data.counts.shape[1]):
        if data.counts[depth, c]:
            so_far += data.counts[depth, c] * largest[row, c]
    return so_far


@_inlined
def _keep_within_bounds(
    data: Inputs, memory: Memory, depth: int, least: float, floor: float
) -> None:
    """Drops states for which some ceiling or limit leaves no profit above the least profit asked
    for.
    """
    states, largest = memory.states, memory.largest
    for k in range(len(data.raised)):
        for c in range(largest.shape[1]):
            largest[0, c] = -np.inf
        for i in range(memory.numbers[depth, 0]):
            s = states[depth, i]
            c = data.class_of[s]
            largest[0, c] = max(largest[0, c], -data.raised[k, s])
        most = _at_most(memory.below[depth, k], data, depth, largest, 0)
        kept = 0
        for i in range(memory.numbers[depth, 0]):
            s = states[depth, i]
            high = most - largest[0, data.class_of[s]] - data.raised[k, s]
            if high >= floor if data.is_limit[k] else high > least:
                states[depth, kept] = s
                kept += 1
        memory.numbers[depth, 0] = kept


@_inlined
def _gain(data: Inputs, memory: Memory, relaxed: Relaxed, depth: int) -> None:
    """Computes the gain of each state at this node, and the largest gain of each class."""
    values, seen, largest = memory.values, memory.seen, memory.largest
    for c in range(largest.shape[1]):
        largest[PRICED, c], largest[CHARGED, c] = -np.inf, -np.inf
    for i in range(memory.numbers[depth, 0]):
        s = memory.states[depth, i]
        gain = 0.0
        for e in range(data.first[s], data.first[s + 1]):
            f = data.faces[e]
            amount = seen[PIXELS, depth, f] + data.pixels[e]
            value = _return_of(data.n_roots, data.caps, f, amount)
            relaxed.gains[e] = value - seen[VALUES, depth, f]
            gain += data.weights[f] * relaxed.gains[e]
        values[PRICED, depth, i] = gain - data.price[s]
        values[CHARGED, depth, i] = gain - data.charge[s]
        c = data.class_of[s]
        for row in (PRICED, CHARGED):
            largest[row, c] = max(largest[row, c], values[row, depth, i])


@_inlined
def _keep_high(data: Inputs, memory: Memory, depth: int, least: float, floor: float) -> None:
    """Drops states that reach too little even with the largest gains of the remaining robots."""
    states, values, largest = memory.states, memory.values, memory.largest
    most = _at_most(memory.profits[PRICED, depth], data, depth, largest, PRICED)
    most_charged = _at_most(memory.profits[CHARGED, depth], data, depth, largest, CHARGED)
    kept, same = 0, 0
    for i in range(memory.numbers[depth, 0]):
        s = states[depth, i]
        c = data.class_of[s]
        high = most - largest[PRICED, c] + values[PRICED, depth, i]
        low = most_charged - largest[CHARGED, c] + values[CHARGED, depth, i]
        if high > least and low >= floor:
            states[depth, kept] = s
            for row in (PRICED, CHARGED):
                values[row, depth, kept] = values[row, depth, i]
            values[MOST, depth, kept] = high
            kept += 1
            if c == data.classes[depth]:
                same += 1
    memory.numbers[depth, 0], memory.numbers[depth, 1] = kept, same


@_inlined
def _begin_with_highest(memory: Memory, depth: int) -> None:
    """Sorts the states of the next robot's class by their gains, and starts with the largest.

    The states arrive nearly sorted from the parent node; the sort is stable.
    """
    states, values = memory.states, memory.values
    for i in range(1, memory.numbers[depth, 1]):
        j = i
        while j > 0 and values[PRICED, depth, j - 1] < values[PRICED, depth, j]:
            states[depth, j - 1], states[depth, j] = states[depth, j], states[depth, j - 1]
            for row in range(3):
                above = values[row, depth, j - 1]
                values[row, depth, j - 1] = values[row, depth, j]
                values[row, depth, j] = above
            j -= 1
    memory.child[depth] = 0


@_inlined
def _is_exhausted(data: Inputs, memory: Memory, depth: int, least: float) -> bool:
    """Returns True if no remaining child can reach more than the least profit asked for."""
    i, values = memory.child[depth], memory.values
    if i >= memory.numbers[depth, 1]:
        return True
    # robots of this class that are chosen after this robot
    others = data.counts[depth + 1, data.classes[depth]]
    fallen = values[PRICED, depth, 0] - values[PRICED, depth, i]
    return bool(values[MOST, depth, i] - others * fallen <= least)


@_inlined
def _descend(data: Inputs, memory: Memory, depth: int, least: float) -> None:
    """Takes the next child's state and descends, with updated pixels and prices."""
    i, seen, profits = memory.child[depth], memory.seen, memory.profits
    s = memory.states[depth, i]
    memory.child[depth] = i + 1
    memory.chosen[0, depth] = s
    for f in range(len(data.weights)):
        seen[PIXELS, depth + 1, f] = seen[PIXELS, depth, f]
        seen[VALUES, depth + 1, f] = seen[VALUES, depth, f]
    for e in range(data.first[s], data.first[s + 1]):
        f = data.faces[e]
        seen[PIXELS, depth + 1, f] += data.pixels[e]
        amount = seen[PIXELS, depth + 1, f]
        seen[VALUES, depth + 1, f] = _return_of(data.n_roots, data.caps, f, amount)
    for row in (PRICED, CHARGED):
        profits[row, depth + 1] = profits[row, depth] + memory.values[row, depth, i]
    for k in range(len(data.raised)):
        memory.below[depth + 1, k] = memory.below[depth, k] - data.raised[k, s]
    _hand_down(data, memory, depth, i, least)


@_inlined
def _hand_down(data: Inputs, memory: Memory, depth: int, taken: int, least: float) -> None:
    """Passes on the states that do not conflict with the taken state and do not come before it."""
    states, values = memory.states, memory.values
    others = data.counts[depth + 1, data.classes[depth]]
    # Gains only shrink: states of the class whose gain is too small here need not be checked again.
    is_one_class = others > 0 and others == len(data.classes) - depth - 1
    least_gain = (
        least - memory.profits[PRICED, depth + 1] - (others - 1) * values[PRICED, depth, taken]
    )
    s, kept = states[depth, taken], 0
    for j in range(taken if others else memory.numbers[depth, 1], memory.numbers[depth, 0]):
        if is_one_class and values[PRICED, depth, j] <= least_gain:
            break
        if not data.too_near[data.place_of[s], data.place_of[states[depth, j]]]:
            states[depth + 1, kept] = states[depth, j]
            kept += 1
    memory.numbers[depth + 1, 0] = kept


@_inlined
def _end_with_two(data: Inputs, memory: Memory, depth: int, best: float, floor: float) -> float:
    """Chooses the states of the last two robots, of one class; returns the largest profit so far.

    It is equivalent to descending twice, with the same number of nodes, but updates only the faces
    that the first of the two states sees. Most nodes are at these two depths. Loops are inlined by
    hand: a call for each state, even if the compiler inlines it, doubles the time.
    """
    states, values, profits, seen = memory.states, memory.values, memory.profits, memory.seen
    for f in range(len(data.weights)):
        for row in (PIXELS, VALUES):
            seen[row, depth + 1, f] = seen[row, depth, f]
    while not _is_exhausted(data, memory, depth, best):
        i, least, found = memory.child[depth], best, -1
        s = states[depth, i]
        memory.child[depth] = i + 1
        memory.progress[NODES] += 1
        for e in range(data.first[s], data.first[s + 1]):
            f = data.faces[e]
            amount = seen[PIXELS, depth, f] + data.pixels[e]
            seen[PIXELS, depth + 1, f] = amount
            seen[VALUES, depth + 1, f] = _return_of(data.n_roots, data.caps, f, amount)
        profit = profits[PRICED, depth] + values[PRICED, depth, i]
        worth = profits[CHARGED, depth] + values[CHARGED, depth, i]
        for j in range(i, memory.numbers[depth, 0]):
            if values[PRICED, depth, j] <= least - profit:
                break
            other = states[depth, j]
            may_be = not data.too_near[data.place_of[s], data.place_of[other]]
            for k in range(len(data.raised)):
                high = memory.below[depth, k] - data.raised[k, s] - data.raised[k, other]
                may_be &= high >= floor if data.is_limit[k] else high > least
            if not may_be:
                continue
            gain = 0.0
            for e in range(data.first[other], data.first[other + 1]):
                f = data.faces[e]
                amount = seen[PIXELS, depth + 1, f] + data.pixels[e]
                value = _return_of(data.n_roots, data.caps, f, amount)
                gain += data.weights[f] * (value - seen[VALUES, depth + 1, f])
            high = profit + (gain - data.price[other])
            if high > best and worth + (gain - data.charge[other]) >= floor:
                best, found = high, other
        if found >= 0:
            memory.progress[NODES] += 1
            for k in range(depth):
                memory.chosen[1, k] = memory.chosen[0, k]
            memory.chosen[1, depth], memory.chosen[1, depth + 1] = s, found
        for e in range(data.first[s], data.first[s + 1]):
            f = data.faces[e]
            for row in (PIXELS, VALUES):
                seen[row, depth + 1, f] = seen[row, depth, f]
    return best


@partial(compiled, forceinline=True)
def _advance(
    data: Inputs, memory: Memory, relaxed: Relaxed, best: float, floor: float, nodes: int
) -> float:
    """Continues a search for a number of nodes; returns the largest profit so far."""
    depth, last_two = memory.progress[DEPTH], len(data.classes) - 2
    if last_two < 0 or data.classes[-2] != data.classes[-1] or len(memory.collected):
        last_two = -1
    while depth >= 0 and nodes > 0:
        if memory.progress[IS_NEW]:
            memory.progress[IS_NEW] = 0
            nodes -= 1
            memory.progress[NODES] += 1
            if depth == len(data.classes):
                best = _end(memory, depth, best)
                depth -= 1
                continue
            _keep_within_bounds(data, memory, depth, best, floor)
            _gain(data, memory, relaxed, depth)
            _keep_high(data, memory, depth, best, floor)
            if memory.numbers[depth, 1] and len(data.classes) - depth >= ROBOTS:
                relax(data, memory, relaxed, depth, best, floor)
            _begin_with_highest(memory, depth)
            if depth == last_two:
                before = memory.progress[NODES]
                best = _end_with_two(data, memory, depth, best, floor)
                nodes -= memory.progress[NODES] - before
        if _is_exhausted(data, memory, depth, best):
            depth -= 1
        else:
            _descend(data, memory, depth, best)
            depth += 1
            memory.progress[IS_NEW] = 1
    memory.progress[DEPTH] = depth
    memory.progress[IS_DONE] = depth < 0
    return best


@_inlined
def _begin_with_choices(memory: Memory, choices: _MoveLists, tail: int) -> None:
    """Begins a search among the states that may follow a given joint state."""
    n = 0
    for robot in range(choices.lists.shape[1]):
        number = choices.lists[tail, robot]
        for k in range(choices.first[number], choices.first[number + 1]):
            memory.states[0, n] = choices.positions[k]
            n += 1
    memory.numbers[0, 0] = n
    memory.progress[DEPTH], memory.progress[IS_NEW], memory.progress[IS_DONE] = 0, 1, 0


@compiled
def _follow(
    data: Inputs, memory: Memory, relaxed: Relaxed, choices: _MoveLists, tail: int,
    end: int, nodes: int, tails: IntArray,
) -> int:  # fmt: skip
    """Collects the successors of given joint states; returns the number of the first unfinished
    one.

    An interrupted search continues at the next call.

    Parameters
    ----------
    tail, end : number of the first joint state, and that of the last plus one
    nodes : number of nodes after which the search is interrupted; at most the number of joint
        states that can be collected
    tails : [most] for each collected joint state, the number of its predecessor
    """
    memory.progress[FOUND], memory.progress[NODES] = 0, 0
    while tail < end:
        if memory.progress[DEPTH] < 0:
            _begin_with_choices(memory, choices, tail)
        before = memory.progress[FOUND]
        nodes_left = nodes - memory.progress[NODES]
        floor = choices.floors[tail]
        _advance(data, memory, relaxed, floor, floor, nodes_left)
        for k in range(before, memory.progress[FOUND]):
            tails[k] = tail
        if not memory.progress[IS_DONE]:
            break
        tail += 1
    return tail


@dataclass(eq=False)
class CompiledSearch:
    """A search in progress.

    Attributes
    ----------
    data : the arrays that the search reads
    memory, relaxed : the arrays that the search writes
    best : largest profit found, initially the least profit asked for
    floor : least worth less charges of a joint state that counts
    """

    data: Inputs
    memory: Memory
    relaxed: Relaxed
    best: float
    floor: float

    @classmethod
    def of(cls, joint: JointStates, least: float, most_found: int = 0) -> "CompiledSearch":
        """Returns a search at its beginning.

        Parameters
        ----------
        least : profits up to this value are ignored
        most_found : if not 0, prepare for `follow`, which collects up to this many joint states per
            call
        """
        bounds, classes = joint.bounds, np.repeat(np.arange(len(joint.sizes)), joint.sizes)
        data = Inputs(
            *joint.sparse,
            joint.weights,
            *joint.returns,
            joint.price,
            joint.charge,
            joint.class_of.astype(np.uint32),
            classes.astype(np.uint32),
            counts=np.array([
                np.bincount(classes[d:], minlength=len(joint.sizes))
                for d in range(len(classes) + 1)
            ]),
            place_of=joint.conflicts.place_of.astype(np.uint32),
            too_near=joint.conflicts.too_near,
            raised=np.array([raised for _, raised in bounds]).reshape(
                len(bounds), len(joint.class_of)
            ),
            is_limit=np.arange(len(bounds)) >= len(joint.ceilings),
        )  # fmt: skip
        profits = np.array([profit for profit, _ in bounds])
        return cls(
            data, _beginning(data, profits, most_found), relaxed_of(data, joint), least,
            joint.floor - joint.margin,
        )  # fmt: skip

    @property
    def positions(self) -> tuple[int, ...]:
        """Positions of the states of the best joint state; empty if none has more profit."""
        found = self.memory.chosen[1]
        return tuple(found.tolist()) if found[0] >= 0 else ()

    def advance(self, nodes: int) -> bool:
        """Continues for a number of nodes; returns True if the search has ended."""
        arrays = self.data, self.memory, self.relaxed
        self.best = float(_advance(*arrays, self.best, self.floor, nodes))
        return bool(self.memory.progress[IS_DONE])

    def follow(
        self,
        choices: tuple[IntArray, IntArray, IntArray],
        floors: FloatArray,
        tails: tuple[int, int],
        nodes: int,
    ) -> tuple[int, IntArray, IntArray]:
        """Collects the successors of given joint states; continues after an interruption.

        Parameters
        ----------
        choices : first entry of each list of states [K+1], positions of the states of all lists,
            and the number of each robot's list [L, R]
        floors : [L] for each joint state of the step before: least worth less charges of a
            successor, including rounding
        tails : number of the first joint state of the step before, and that of the last plus one
        nodes : number of nodes after which the search is interrupted; it ends earlier if it has
            collected as many joint states as fit

        Returns
        -------
        The number of the first unfinished joint state and, for the collected ones, the numbers of
        their predecessors [M] and the positions of their states [M, R].
        """
        nodes = min(nodes, len(self.memory.collected))  # each node collects at most one joint state
        arrays = _MoveLists(*choices, floors)
        found = np.zeros(len(self.memory.collected), dtype=np.int64)
        both = self.data, self.memory, self.relaxed
        tail = int(_follow(*both, arrays, *tails, nodes, found))
        n = int(self.memory.progress[FOUND])
        return tail, found[:n], self.memory.collected[:n].copy()

    @property
    def nodes(self) -> int:
        """Number of nodes of the tree so far, or of the last call of `follow`."""
        return int(self.memory.progress[NODES])


def _beginning(data: Inputs, profits: FloatArray, most_found: int) -> Memory:
    """Returns the memory of a search whose next node is the root, or which `follow` starts."""
    depths, n_classes = data.counts.shape
    robots, n, n_faces = depths - 1, len(data.class_of), len(data.weights)
    return Memory(
        progress=np.array([-1 if most_found else 0, 1, 0, 0, 0]),
        states=np.tile(np.arange(n, dtype=np.uint32), (depths, 1)),
        numbers=np.tile([n, 0], (depths, 1)),
        child=np.zeros(depths, dtype=np.uint32),
        values=np.zeros((3, depths, n)),
        seen=np.zeros((2, depths, n_faces)),
        profits=np.zeros((2, depths)),
        below=np.tile(profits, (depths, 1)),
        largest=np.zeros((2, n_classes)),
        chosen=np.full((2, robots), -1),
        collected=np.zeros((most_found, robots), dtype=np.int64),
    )


def call_once() -> None:
    """Runs a search over one state, so that the kernel is loaded, or compiled and stored."""
    none, single = np.zeros(1, dtype=np.int64), np.ones(1)
    joint = JointStates(
        t=0, sizes=(1,), class_of=none, states=none, pixels=np.ones((1, 1)), weights=single,
        returns=Returns(1, np.zeros(0)), price=single, charge=single, floor=0.0,
        conflicts=Conflicts(none, lambda: np.ones((1, 1), dtype=np.bool_)),
    )  # fmt: skip
    CompiledSearch.of(joint, 0.0).advance(1)
    choices = np.array([0, 1]), none, none.reshape(1, 1)
    CompiledSearch.of(joint, 0.0, 1).follow(choices, single, (0, 1), 1)
