"""The moves of a whole team between the joint states of two steps, forwards and backwards.

From each joint state that is reached, a search (`move_searches`) finds the joint states of the next
step, or of the step before, that plans above the target may visit. Only the best way to each joint
state is continued, where robots of one class are exchangeable.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.formulations.certificates.staged.joint_states import JointStates
from cocap_opt.formulations.certificates.staged.move_searches import (
    Choices,
    MoveSearches,
    Neighbours,
)
from cocap_opt.formulations.certificates.staged.narrowing import Narrowing
from cocap_opt.formulations.certificates.staged.other_steps import OtherSteps
from cocap_opt.formulations.certificates.staged.reached import Reached, merged
from cocap_opt.formulations.certificates.staged.search import NotEndedError
from cocap_opt.stop import Stop

MOST_PLACED = 20_000_000  # states of all robots in the joint states of one step, 8 bytes each
MOST_CHOICES = 10_000  # states of one step over all robots: a table has a row and a column for each
_AT_ONCE = 50_000  # joint states whose pixels are added up at once

# The most [n] that robots of a class can collect at steps not yet explored, given their states [n].
Potential = Callable[[int, IntArray], FloatArray]


class _Direction(NamedTuple):
    """The direction in which a team moves, and the most that the steps ahead of it can be worth.

    Attributes
    ----------
    neighbours : for each class, the states to which a robot may move from a state
    potential : returns the most that robots of a class can collect at the steps ahead, for each of
        their states [n] at the step to which they move; in units of J
    least : J that the steps explored so far and potentials have to exceed together: the target less
        what constants and rows of the steps ahead add, and best paths if backwards
    is_forward : False: moves lead to the previous step
    """

    neighbours: list[Neighbours]
    potential: Potential
    least: float
    is_forward: bool = True


class Team:
    """The robots, distinguished from each other, with their remaining states.

    Attributes
    ----------
    numbers : [R] class of each robot
    others : what the steps before and after a step can be worth
    """

    def __init__(self, narrowing: Narrowing, others: OtherSteps | None = None) -> None:
        model = narrowing.model
        self._narrowing, self._model = narrowing, model
        class_of = {robot: n for n, robots in enumerate(model.classes) for robot in robots.robots}
        self.numbers = np.array([class_of[robot] for robot in range(len(class_of))])
        self.others = OtherSteps(narrowing) if others is None else others

    # -- from step to step --------------------------------------------------------------------

    def after(self, t: int, before: Reached, searches: MoveSearches, stop: Stop) -> Reached:
        """Returns the joint states reached at a step from those of the step before, best first.

        Raises
        ------
        NotEndedError
            If too many joint states are reached, or the searches use too many nodes.
        LimitReached
            If a limit is reached.
        """
        reached, waiting = Reached.empty(len(self.numbers)), list[Reached]()
        for part in self.moves_after(t, before, searches, stop):
            waiting.append(part)
            if _are_too_many(waiting):
                reached, waiting = self.best([reached, *waiting]), []
                if _are_too_many([reached]):
                    raise NotEndedError
        return self.best([reached, *waiting])

    def moves_after(
        self, t: int, before: Reached, searches: MoveSearches, stop: Stop
    ) -> Iterator[Reached]:
        """Yields the moves from the joint states of the step before to those of a step, in blocks.

        A joint state is listed as often as a move leads to it. Errors are those of `after`.
        """
        classes = range(len(self._model.classes))
        direction = _Direction(
            [self.heads(number, t) for number in classes], partial(self.others.future, t),
            self.others.threshold - self.others.rest_after(t),
        )  # fmt: skip
        return self._moves(t, before, direction, searches, stop)

    def moves_before(
        self, t: int, later: Reached, searches: MoveSearches, stop: Stop
    ) -> Iterator[Reached]:
        """Yields the moves from joint states of a step to given ones of the next step, in blocks.

        A joint state is listed as often as a move begins there, and `Reached.before` has the number
        of the joint state to which the move leads. Errors are those of `after`.

        Parameters
        ----------
        later : joint states of step t + 1, with the J of all steps from there on
        """
        classes = range(len(self._model.classes))
        direction = _Direction(
            [self._tails(number, t) for number in classes], partial(self.others.past, t),
            self.others.threshold - self.others.rest_before(t), is_forward=False,
        )  # fmt: skip
        return self._moves(t, later, direction, searches, stop)

    def _moves(
        self, t: int, origin: Reached, direction: _Direction, searches: MoveSearches, stop: Stop
    ) -> Iterator[Reached]:
        """Yields the moves to the joint states of a step from those of the step next to it."""
        if not len(origin.values):
            return
        numbers = self.numbers.tolist()
        choices = Choices.of(origin.placed, [direction.neighbours[number] for number in numbers])
        if sum(map(len, choices.states)) > MOST_CHOICES:
            raise NotEndedError
        numbers = self.numbers[choices.robots].tolist()
        joint = self._apart(numbers, t, choices.states, direction.potential)
        floors = direction.least - origin.values
        for rows, heads in searches.found(joint, choices, floors, stop):
            placed = np.empty_like(heads)
            placed[:, choices.robots] = joint.states[heads]
            ends = [origin.placed[rows], placed]
            able = ~self.conflicts(*(ends if direction.is_forward else ends[::-1]))
            rows, heads, placed = rows[able], heads[able], placed[able]
            yield Reached(origin.values[rows] + _worths(joint, heads), placed, rows)

    def heads(self, number: int, t: int) -> Neighbours:
        """Returns a function that returns the states of step t to which a robot of a class can move
        from a state of the step before.
        """
        graph, left = self._model.classes[number].graph, self._narrowing.left[number]
        among = np.flatnonzero(left[t])
        return lambda tail: np.intersect1d(graph.successors(t - 1, tail), among, assume_unique=True)

    def _tails(self, number: int, t: int) -> Neighbours:
        """Returns a function that returns the states of step t from which a robot of a class can
        move to a state of the next step.
        """
        graph, left = self._model.classes[number].graph, self._narrowing.left[number]
        tails: dict[int, list[int]] = {}
        for tail in np.flatnonzero(left[t]).tolist():
            for head in graph.successors(t, tail).tolist():
                tails.setdefault(head, []).append(tail)
        return lambda head: np.array(tails.get(head, []), dtype=np.int64)

    # -- the joint states of a step -----------------------------------------------------------

    def fixed(self, starts: Sequence[IntArray]) -> Reached:
        """Returns the joint state at step 0 of robots with fixed starts.

        Parameters
        ----------
        starts : [R] the only start of each robot
        """
        values = np.zeros(1)
        if self._model.problem.first_step == 0:
            joint = self.apart(self.numbers.tolist(), 0, starts)
            values[0] = joint.worth(range(len(self.numbers)))
        return Reached(values, np.column_stack(starts), np.zeros(1, dtype=np.int64))

    def chosen(
        self, t: int, states: Sequence[IntArray], searches: MoveSearches, stop: Stop
    ) -> list[Reached]:
        """Returns the joint states of a step that are worth enough, regardless of how they are
        reached; errors are those of `after`.

        Parameters
        ----------
        states : [R] the possible states of each robot
        """
        choices = Choices.of_lists(states)
        if sum(map(len, choices.states)) > MOST_CHOICES:
            raise NotEndedError
        numbers = self.numbers[choices.robots].tolist()
        joint = self.apart(numbers, t, choices.states)
        floors = np.array([self.others.threshold - self.others.rest_after(t)])
        return self._collected(joint, choices, floors, searches, stop)

    def all_that_count(
        self, t: int, searches: MoveSearches, stop: Stop
    ) -> tuple[Reached, FloatArray]:
        """Returns the joint states of a step that count, and the worth [L] of each.

        The value of each is its worth and the most that any way to it can be worth. Robots of one
        class are exchangeable, so each joint state is listed once. Errors are those of `after`.
        """
        joint = self._narrowing.charged_joint_states(t)
        if len(joint.states) > MOST_CHOICES:
            raise NotEndedError
        robots = np.concatenate([robot_class.robots for robot_class in self._model.classes])
        choices = Choices.of_classes(joint, robots)
        found = self._collected(joint, choices, np.array([joint.floor]), searches, stop)
        reached = Reached.joined(found)
        worth = reached.values
        values = worth + self.others.rest_before(t)
        for robot, number in enumerate(self.numbers.tolist()):
            values += self.others.past(t, number, reached.placed[:, robot])
        return reached._replace(values=values), worth

    def with_profits(self, t: int, above: float, searches: MoveSearches, stop: Stop) -> Reached:
        """Returns the joint states of a step that count and have larger profits.

        The value of each is its worth and the most that all earlier steps can be worth, whatever
        its states. Robots of one class are exchangeable, so each joint state is listed once. Errors
        are those of `after`.
        """
        profits, joint = self._narrowing.profitable_joint_states(t, above)
        if len(joint.states) > MOST_CHOICES:
            raise NotEndedError
        robots = np.concatenate([robot_class.robots for robot_class in self._model.classes])
        choices = Choices.of_classes(profits, robots)
        floors = np.array([above])
        reached = Reached.joined(self._collected(profits, choices, floors, searches, stop, joint))
        values = reached.values + self.others.most_before(t)
        for robot, number in enumerate(self.numbers.tolist()):
            values -= self._narrowing.to_go[number][t, reached.placed[:, robot]]
        return reached._replace(values=values)

    def promising(self, t: int, reached: Reached) -> Reached:
        """Returns the joint states of a step whose values, with the most that all robots can
        collect later, exceed the threshold, including rounding.
        """
        most = reached.values + self.others.rest_after(t)
        for robot, number in enumerate(self.numbers.tolist()):
            most += self.others.future(t, number, reached.placed[:, robot])
        is_promising = most > self.others.threshold - 2 * self._narrowing.rounding
        values, placed, before = reached
        return Reached(values[is_promising], placed[is_promising], before[is_promising])

    def _collected(
        self, joint: JointStates, choices: Choices, floors: FloatArray, searches: MoveSearches,
        stop: Stop, counting: JointStates | None = None,
    ) -> list[Reached]:  # fmt: skip
        """Returns the joint states that reach the floor, each with its worth.

        Parameters
        ----------
        counting : the same joint states at the charges that decide whether they count; None: all
            count
        """

        def parts() -> Iterator[Reached]:
            for rows, heads in searches.found(joint, choices, floors, stop):
                worths = _worths(joint, heads)
                if counting is not None:
                    low = worths - counting.charge[heads].sum(axis=1)
                    counts = low >= counting.floor - counting.margin
                    rows, heads, worths = rows[counts], heads[counts], worths[counts]
                placed = np.empty_like(heads)
                placed[:, choices.robots] = joint.states[heads]
                yield Reached(worths, placed, rows)

        return self.listed(parts())

    def listed(self, parts: Iterable[Reached]) -> list[Reached]:
        """Returns all blocks of joint states, after an empty one; raises NotEndedError if these are
        too many.
        """
        found = [Reached.empty(len(self.numbers))]
        for part in parts:
            found.append(part)
            if _are_too_many(found):
                raise NotEndedError
        return found

    def apart(self, numbers: Sequence[int], t: int, states: Sequence[IntArray]) -> JointStates:
        """Returns the joint states of distinguished robots; their charges are what the robots can
        collect later, negated.

        Thus the worth less the charges is the most that this step and the later prices can bring,
        and the current prices limit it.

        Parameters
        ----------
        numbers : class of each robot
        states : for each robot, some of its remaining states at the step
        """
        return self._apart(numbers, t, states, partial(self.others.future, t))

    def _apart(
        self, numbers: Sequence[int], t: int, states: Sequence[IntArray], potential: Potential
    ) -> JointStates:
        """Returns the joint states of distinguished robots, with potentials as negative charges."""
        charge = [-potential(number, at) for number, at in zip(numbers, states, strict=True)]
        raised = [
            charges - self._narrowing.rewards[number][t, at]
            for number, at, charges in zip(numbers, states, charge, strict=True)
        ]
        limit = self._narrowing.ceiling_of(self._narrowing.ceiling(t), np.concatenate(raised))
        return JointStates.of(
            self._model, t, states, charge, charge, -np.inf, limits=(limit,), apart=numbers
        )

    def best(self, parts: Iterable[Reached]) -> Reached:
        """Returns the best way to each joint state, best first."""
        return merged(self.numbers, parts)[0]

    def conflicts(self, tails: IntArray, heads: IntArray) -> BoolArray:
        """Returns an array [M], True for moves of the team that have a conflict between the
        steps.
        """
        rules, model = self._model.problem.rules, self._model
        found = np.zeros(len(tails), dtype=np.bool_)
        if not rules.hold_between_steps:
            return found
        ends = [
            (places[tails[:, robot] % n], places[heads[:, robot] % n])
            for robot, (places, n) in enumerate(
                (model.places.positions[number], model.classes[number].graph.n_places)
                for number in self.numbers.tolist()
            )
        ]
        for robot, moves in enumerate(ends):
            for other in ends[:robot]:
                found |= rules.conflict_between(moves, other)
        return found


def _are_too_many(parts: Iterable[Reached]) -> bool:
    """Returns True if some joint states, all parts together, take too much memory."""
    return sum(part.placed.size for part in parts) > MOST_PLACED


def _worths(joint: JointStates, chosen: IntArray) -> FloatArray:
    """Returns the worths of joint states [K, R], computed in blocks."""
    parts = range(0, len(chosen), _AT_ONCE)
    return np.concatenate([*(joint.worths(chosen[k : k + _AT_ONCE]) for k in parts), []])
