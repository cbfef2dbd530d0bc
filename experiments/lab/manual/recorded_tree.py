"""CoCap's constraint tree, recorded node by node while the planner makes it."""

from dataclasses import dataclass
from typing import NamedTuple

from cocap_opt.coordination.low_level import value_iteration
from cocap_opt.coordination.responses import Responses
from cocap_opt.planners.cocap import algorithm_1
from cocap_opt.planners.constraint_tree import ConstraintTree, Node, OpenNodes
from cocap_opt.problem import Cell, Conflict, Plan, Problem
from cocap_opt.stop import never


class Closed(NamedTuple):
    """A cell at step t, or a move of two cells after step t, that a constraint forbids a robot."""

    robot: int
    t: int
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class RecordedNode:
    """A node of the tree, and its place in the tree.

    Attributes
    ----------
    parent : number of its parent; None for the root
    turn : its turn among the nodes taken from OPEN, 1 for the first; None if it was never taken
    """

    node: Node
    parent: int | None
    turn: int | None = None

    @property
    def value(self) -> float:
        """J of its plan."""
        return self.node.value

    @property
    def plan(self) -> Plan:
        """The paths of all robots."""
        return self.node.team.model.plan(self.node.team.paths)

    @property
    def conflict(self) -> Conflict | None:
        """The first conflict of its plan; None if there is none."""
        return next(iter(self.node.conflicts), None)

    @property
    def closed(self) -> list[Closed]:
        """The cells and moves that its constraints forbid robots."""
        return [
            Closed(robot, int(t), tuple(self._cell(robot, place) for place in places))
            for robot, charges in enumerate(self.node.constraints)
            for costs in (charges.places, charges.moves)
            for t, *places in costs
        ]

    def _cell(self, robot: int, place: int) -> Cell:
        model = self.node.team.model
        return model.places.cells[model.class_of[robot].number][place]


class _Recorder(OpenNodes):
    """Queue of open nodes that also keeps all nodes that were ever in it."""

    def __init__(self) -> None:
        super().__init__()
        self.recorded: list[RecordedNode] = []

    def push(self, node: Node) -> None:
        """Adds a node, a child of the node taken last."""
        parent = None if self.last is None else self._number(self.last)
        self.recorded.append(RecordedNode(node, parent))
        super().push(node)

    def pop(self) -> Node:
        """Takes the first node."""
        node = super().pop()
        number = self._number(node)
        self.recorded[number] = RecordedNode(node, self.recorded[number].parent, self.popped)
        return node

    def _number(self, node: Node) -> int:
        return next(k for k, recorded in enumerate(self.recorded) if recorded.node is node)


def recorded_tree(problem: Problem) -> list[RecordedNode]:
    """Returns all nodes that `cocap` makes for a problem, in the order in which it makes them."""
    responses, recorder = Responses(value_iteration, never), _Recorder()
    nobody = responses.nobody(problem)
    algorithm_1(ConstraintTree(nobody, responses, never, recorder))
    return recorder.recorded
