"""Finds the best plan among the remaining joint states: value iteration over joint states.

From each joint state that is reached, a search finds the joint states s at the next step t that
plans above the target may visit (`team_moves`). The J of a plan is at most

    value before + F(s) + sum_i future_i(s_i) + rest(t),

where `future` is the most that a robot can collect later at the prices, and `rest` the sum of K and
of the rows of the later steps; s is explored only if this
sum is above the target. The bound less this sum is the total loss of all steps up to t, so the
number of joint states falls quickly, whereas (*) of `narrowing` considers the loss of each step
alone. Only the best way to each joint state is continued, where robots of one class are
exchangeable. If no joint state remains, no plan is above the target.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, IntArray
from cocap_opt.formulations.certificates.pricing import Pricing
from cocap_opt.formulations.certificates.staged.move_searches import MoveSearches
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.reached import Reached
from cocap_opt.formulations.certificates.staged.search import NotEndedError
from cocap_opt.formulations.certificates.staged.team_moves import MOST_CHOICES, Team
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop, never

_STARTS_AT_ONCE = 1_000  # joint states between two checks of the stopping criterion


class BestPlan(NamedTuple):
    """The best plan among the joint states that a narrowing leaves."""

    narrowing: Narrowing
    value: float  # J; -inf if there is no plan
    paths: tuple[Path, ...] = ()  # state numbers, robot by robot
    nodes: int = 0  # number of nodes that the searches took
    # number of joint states at each step; from the start, up to the first step without any
    reached: tuple[int, ...] = ()

    @property
    def pricing(self) -> Pricing:
        """The bound on all plans, given that all plans above the target have been explored."""
        return self.narrowing.pricing_of(self.value)


def best_plan(
    narrowing: Narrowing, most_nodes: int, stop: Stop = never, plain: bool = False
) -> BestPlan:
    """Returns the best plan above the target among the remaining joint states.

    Parameters
    ----------
    most_nodes : largest number of nodes of all searches together
    plain : True: use the plain search only

    Raises
    ------
    NotEndedError
        If there are too many joint states.
    LimitReached
        If a limit is reached.
    ValueError
        If moves are rewarded.
    """
    require_usable(narrowing.model)
    team, searches = Team(narrowing), MoveSearches(most_nodes, plain)
    reached = _Beginning(narrowing, team).reached(searches, stop)
    for t in range(len(reached), narrowing.model.problem.horizon + 1):
        if not len(reached[-1].values):
            break
        reached.append(team.after(t, reached[-1], searches, stop))
    nodes = most_nodes - searches.nodes_left
    numbers = tuple(len(step.values) for step in reached)
    # Rows may charge nobody, so a path that is followed to its end may be worth less than the
    # target.
    if not (reached[-1].values > team.others.threshold).any():
        return BestPlan(narrowing, -np.inf, nodes=nodes, reached=numbers)
    return BestPlan(narrowing, float(reached[-1].values[0]), paths_along(reached), nodes, numbers)


def may_be_used(model: Model) -> bool:
    """Returns True if joint states determine J: no move is rewarded."""
    o = model.problem.objective
    return not (o.stationarity or o.keep_cell or o.keep_heading or o.balanced)


def require_usable(model: Model) -> None:
    """Raises ValueError if joint states do not determine J."""
    if not may_be_used(model):
        raise ValueError("joint paths: not possible if moves are rewarded")


class _Beginning:
    """The joint states at which the paths of all robots begin."""

    def __init__(self, narrowing: Narrowing, team: Team) -> None:
        self._narrowing, self._model, self._team = narrowing, narrowing.model, team

    def reached(self, searches: MoveSearches, stop: Stop) -> list[Reached]:
        """Returns the joint states reached at step 0 and, if starts are free, at step 1.

        Free starts have too many joint states, unless views count there. Therefore the joint states
        of step 1 are found first, and then starts that lead to each of them.

        Raises
        ------
        NotEndedError, LimitReached
            As in `Team.after`.
        """
        problem, numbers = self._model.problem, self._team.numbers.tolist()
        starts = [
            states[self._narrowing.left[number][0, states]]
            for number, states in zip(numbers, self._starts, strict=True)
        ]
        if not all(map(len, starts)):
            return [Reached.empty(len(numbers))]
        if not problem.has_free_starts:
            return [self._team.fixed(starts)]
        if problem.first_step == 0:
            return [self._team.best(self._team.chosen(0, starts, searches, stop))]
        if sum(map(len, starts)) > MOST_CHOICES:
            raise NotEndedError
        ways = _StartWays(self._model, self._team.numbers, starts)
        heads = [
            np.flatnonzero(self._narrowing.left[number][1] & ways.reached(robot))
            for robot, number in enumerate(numbers)
        ]
        if not all(map(len, heads)):
            return [Reached.empty(len(numbers))]
        chosen = self._team.chosen(1, heads, searches, stop)
        found = [ways.with_starts(part, searches, stop) for part in chosen]
        placed = np.concatenate([tails for tails, _ in found])
        number = np.cumsum([0, *(len(tails) for tails, _ in found)])[:-1]
        after = self._team.best(
            part._replace(before=first + np.arange(len(part.values)))
            for first, (_, part) in zip(number.tolist(), found, strict=True)
        )
        nothing = np.zeros(len(placed), dtype=np.int64)
        return [Reached(np.zeros(len(placed)), placed, nothing), after]

    @property
    def _starts(self) -> list[IntArray]:
        """The possible start states of each robot, whether closed or not [R]."""
        return [self._model.starts(robot) for robot in range(len(self._team.numbers))]


class _StartWays:
    """The ways, from step 0 to step 1, of robots that choose their start.

    Parameters
    ----------
    starts : [R] for each robot, its remaining states at step 0
    """

    def __init__(self, model: Model, numbers: IntArray, starts: Sequence[IntArray]) -> None:
        self._rules = model.problem.rules
        classes = [model.classes[number] for number in numbers.tolist()]
        self._graphs = [robot_class.graph for robot_class in classes]
        self._where = [model.places.positions[number] for number in numbers.tolist()]
        # for each robot, its starts by its state at step 1
        self._tails: list[dict[int, list[int]]] = []
        self._able: dict[tuple[int, ...], BoolArray] = {}
        known: dict[tuple[int, bytes], dict[int, list[int]]] = {}
        for number, graph, states in zip(numbers.tolist(), self._graphs, starts, strict=True):
            key = number, states.tobytes()
            if key not in known:
                known[key] = _tails_of(graph, states)
            self._tails.append(known[key])

    def reached(self, robot: int) -> BoolArray:
        """Returns the states [S] of step 1 that a robot can reach."""
        found = np.zeros(self._graphs[robot].n_states, dtype=np.bool_)
        found[list(self._tails[robot])] = True
        return found

    def with_starts(
        self, reached: Reached, searches: MoveSearches, stop: Stop
    ) -> tuple[IntArray, Reached]:
        """Returns starts for the joint states of step 1 that have any, together with these joint
        states.

        Raises
        ------
        NotEndedError
            If the searches for starts use more than the remaining nodes.
        LimitReached
            If a limit is reached.
        """
        tails = []
        for row, heads in enumerate(reached.placed.tolist()):
            if row % _STARTS_AT_ONCE == 0:
                stop.check()
            tails.append(self._starts_of(heads, searches))
        kept = [row for row, found in enumerate(tails) if found]
        placed = np.array([tails[row] for row in kept], dtype=np.int64)
        able = Reached(reached.values[kept], reached.placed[kept], reached.before[kept])
        return placed.reshape(len(kept), len(self._tails)), able

    def _starts_of(
        self, heads: list[int], searches: MoveSearches, chosen: tuple[int, ...] = ()
    ) -> list[int]:
        """Returns starts of all robots that lead to given states at step 1; empty if there are
        none.

        Parameters
        ----------
        chosen : for the first robots, the number of the chosen start among those that lead to the
            state
        """
        searches.spend(1)
        robot = len(chosen)
        if robot == len(heads):
            both = zip(self._tails, heads, chosen, strict=True)
            return [tails[head][which] for tails, head, which in both]
        for which in range(len(self._tails[robot][heads[robot]])):
            pairs = enumerate(chosen)
            if all(self._may_start(k, heads[k], robot, heads[robot])[at, which] for k, at in pairs):
                found = self._starts_of(heads, searches, (*chosen, which))
                if found:
                    return found
        return []

    def _may_start(self, first: int, head: int, second: int, other_head: int) -> BoolArray:
        """Returns an array [n, m], True if the ways of two robots from their starts keep the
        rules.
        """
        # Robots with the same class and the same choices share a table of tails.
        key = id(self._tails[first]), head, id(self._tails[second]), other_head
        if key not in self._able:
            ways = []
            for robot, end, axis in ((first, head, 1), (second, other_head, 0)):
                n_places, where = self._graphs[robot].n_places, self._where[robot]
                tails = np.array(self._tails[robot][end]) % n_places
                ways.append((np.expand_dims(where[tails], axis), where[end % n_places]))
            self._able[key] = ~self._rules.moves_conflict(*ways)
        return self._able[key]


def _tails_of(graph: TimeGraph, starts: IntArray) -> dict[int, list[int]]:
    """Returns the starts that lead to each state of step 1, one per place."""
    found: dict[int, dict[int, int]] = {}
    for start in starts.tolist():
        for head in graph.successors(0, start).tolist():
            found.setdefault(head, {}).setdefault(start % graph.n_places, start)
    return {head: [*by_place.values()] for head, by_place in found.items()}


def paths_along(reached: list[Reached]) -> tuple[Path, ...]:
    """Returns the paths of all robots along the best way to the best joint state at the end."""
    along, number = [], 0
    for step in reached[::-1]:
        along.append(step.placed[number].tolist())
        number = int(step.before[number])
    return tuple(tuple(path) for path in zip(*along[::-1], strict=True))
