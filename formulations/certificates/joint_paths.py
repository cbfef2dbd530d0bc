"""The best plan among the joint states that are left: value iteration over joint states.

Where states have been closed until a step has few joint states that count (`staged`), the plans
above the target are few, too. Value iteration goes through them step by step: a joint state follows
another where each robot of the one can move to a robot's state of the other, each to one of its
own, without a conflict between the steps. Robots of one class are exchangeable, so that any such
assignment does.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np

from cocap_opt.formulations.certificates.joint_states import NotEndedError
from cocap_opt.formulations.certificates.narrowing import Narrowing
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop, never

MOST_TRIED = 3_000_000  # pairs of joint states: some minutes

Placed = tuple[int, int]  # class number and state number of a robot


class BestPlan(NamedTuple):
    """The best plan among the joint states that are left."""

    value: float  # J; -infinity if there is no plan
    paths: tuple[Path, ...] = ()  # state numbers, robot by robot


class _Node(NamedTuple):
    """The best way to a joint state."""

    value: float
    placed: tuple[Placed, ...]  # robot by robot
    before: "_Node | None"


def best_plan(
    narrowing: Narrowing,
    most_nodes: int,
    most_tried: int = MOST_TRIED,
    stop: Stop = never,
    most_in_all: float = math.inf,
) -> BestPlan:
    """Returns the best plan above the target among the joint states that are left.

    Parameters
    ----------
    most_nodes : of the search for the joint states of one step
    most_tried : pairs of joint states of two steps
    most_in_all : nodes of the searches of all steps together

    Raises
    ------
    NotEndedError
        If there are too many joint states.
    LimitReached
        At a limit.
    ValueError
        If moves are rewarded, or views do not count at step 1.
    """
    problem = narrowing.model.problem
    if not may_be_used(narrowing.model):
        raise ValueError("joint paths: moves are rewarded, or views do not count at step 1")
    ways, tried = _Ways(narrowing.model), 0
    matters = narrowing.target - 2 * narrowing.rounding
    nodes = [_Node(0.0, _starts(narrowing.model), None)]
    for t in range(problem.horizon + 1):
        found: list[_Node] = []
        worths = _worths(narrowing, t, int(min(most_nodes, most_in_all)), stop)
        most_in_all -= worths.nodes
        for value, heads in worths.of_joint:
            # What is worth no more than the target at the end need not be followed.
            least = matters - narrowing.rest(t, heads) - value
            for node in nodes:
                if node.value <= least:
                    break
                stop.check()
                tried += 1
                if tried > most_tried:
                    raise NotEndedError
                placed = node.placed if t == 0 else ways.placed(t - 1, node.placed, heads)
                if placed is not None:
                    found.append(_Node(node.value + value, placed, node))
                    break
        nodes = sorted(found, key=lambda node: -node.value)
    if not nodes:
        return BestPlan(-np.inf)
    return BestPlan(nodes[0].value, _paths(nodes[0]))


def may_be_used(model: Model) -> bool:
    """Returns True if joint states decide J: no move is rewarded, and views count from step 1."""
    objective = model.problem.objective
    rewarded = objective.stationarity or objective.keep_cell or objective.keep_heading
    return not (rewarded or objective.balanced) and model.problem.first_step <= 1


def _starts(model: Model) -> tuple[Placed, ...]:
    """Returns where robots start, robot by robot."""
    number = {robot: n for n, one in enumerate(model.classes) for robot in one.robots}
    return tuple((number[robot], model.start(robot)) for robot in range(len(model.problem.robots)))


class _Worths(NamedTuple):
    """The joint states that are left at a step, each with what it is worth."""

    of_joint: list[tuple[float, tuple[Placed, ...]]]
    nodes: int  # of the search for them


def _worths(narrowing: Narrowing, t: int, most_nodes: int, stop: Stop) -> _Worths:
    """Returns the joint states that are left at a step, each with what it is worth."""
    if t == 0:
        starts, joint = _starts(narrowing.model), narrowing.joint_states(0)
        if not all(narrowing.left[number][0, state] for number, state in starts):
            return _Worths([], 0)
        at = {key: k for k, key in enumerate(joint.keys)}
        counts = narrowing.model.problem.first_step == 0
        return _Worths([(joint.worth([at[one] for one in starts]) if counts else 0.0, starts)], 0)
    joint = narrowing.joint_states(t)
    all_of_them = joint.all_that_count(most_nodes, stop)
    of_joint = [
        (joint.worth(chosen), tuple(joint.keys[k] for k in chosen))
        for chosen in all_of_them.positions
    ]
    return _Worths(of_joint, all_of_them.nodes)


class _Ways:
    """The ways of a team from joint state to joint state."""

    def __init__(self, model: Model) -> None:
        problem, classes = model.problem, model.classes

        @cache
        def heads(t: int, number: int, state: int) -> frozenset[int]:
            return frozenset(classes[number].graph.successors(t, state).tolist())

        @cache
        def conflict(one: tuple[Placed, Placed], other: tuple[Placed, Placed]) -> bool:
            ends = [
                [model.positions[number][state % classes[number].graph.n_places]
                 for number, state in move]
                for move in (one, other)
            ]  # fmt: skip
            (a, b), (c, d) = ends
            return bool(problem.rules.moves_conflict((a, b), (c, d)))

        self._heads, self._conflict = heads, conflict

    def placed(
        self, t: int, tails: Sequence[Placed], heads: Sequence[Placed]
    ) -> tuple[Placed, ...] | None:
        """Returns where each robot goes so that together they are in `heads`; None if it fails."""
        options: list[list[int]] = []
        for number, tail in tails:
            ahead = self._heads(t, number, tail)
            own = [k for k, (n, state) in enumerate(heads) if n == number and state in ahead]
            if not own:
                return None
            options.append(own)
        order = sorted(range(len(tails)), key=lambda robot: len(options[robot]))
        chosen: dict[int, int] = {}

        def complete(depth: int) -> bool:
            if depth == len(order):
                return True
            robot = order[depth]
            for k in options[robot]:
                if k in chosen.values():
                    continue
                move = tails[robot], heads[k]
                if any(
                    self._conflict(move, (tails[other], heads[taken]))
                    for other, taken in chosen.items()
                ):
                    continue
                chosen[robot] = k
                if complete(depth + 1):
                    return True
                del chosen[robot]
            return False

        if not complete(0):
            return None
        return tuple(heads[chosen[robot]] for robot in range(len(tails)))


def _paths(node: _Node | None) -> tuple[Path, ...]:
    """Returns the paths of all robots along the best way to a joint state."""
    along: list[tuple[Placed, ...]] = []
    while node is not None:
        along.append(node.placed)
        node = node.before
    steps = along[::-1][1:]  # the first node is before step 0
    return tuple(tuple(placed[robot][1] for placed in steps) for robot in range(len(steps[0])))
