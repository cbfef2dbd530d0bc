"""The resource to branch on: one that a fractional mixture of paths uses a fraction of.

A robot in a cell at a step, of all robots, then of one class; then a state, which settles the
heading; then a move. A decision about any of these stays a charge on places, states or moves, so
that pricing stays value iteration. If all states are used by integral numbers of robots, so are
all moves but where the swap rule couples them.
"""

from collections import defaultdict
from typing import NamedTuple

from cocap_opt.formulations.certificates.resources import Cells, Move, Resource, Visit
from cocap_opt.formulations.column_generation.master.mixture import Mixture
from cocap_opt.model import Model

INTEGRAL = 1e-4  # amounts nearer than this to an integer count as integral

Amounts = dict[Resource, float]


class ResourceUse(NamedTuple):
    """The number of robots of a mixture, maybe fractional, that uses each resource, by kinds."""

    cells: Amounts  # by all robots
    cells_of_classes: Amounts  # empty where there is one class
    states: Amounts
    moves: Amounts

    @classmethod
    def of(cls, model: Model, mixture: Mixture) -> "ResourceUse":
        """Returns the use of resources by a mixture."""
        cells: defaultdict[Resource, float] = defaultdict(float)
        of_classes: defaultdict[Resource, float] = defaultdict(float)
        states: defaultdict[Resource, float] = defaultdict(float)
        moves: defaultdict[Resource, float] = defaultdict(float)
        several = len(model.classes) > 1
        for column, amount in mixture.used():
            along = column.along
            graph = model.classes[along.class_number].graph
            for t, (number, cell) in enumerate(zip(along.states, along.cells, strict=True)):
                cells[Cells(t, (cell,))] += amount
                if several:
                    of_classes[Cells(t, (cell,), along.class_number)] += amount
                states[Visit(t, graph.state(number), along.class_number)] += amount
                if t and cell != along.cells[t - 1]:
                    moves[Move(t - 1, (along.cells[t - 1], cell), along.class_number)] += amount
        return cls(dict(cells), dict(of_classes), dict(states), dict(moves))

    @property
    def has_integral_states(self) -> bool:
        """True where an integral number of robots is in every state, be it on fractional paths."""
        return not any(_is_fractional(amount) for amount in self.states.values())

    def fractional(self, tolerance: float = INTEGRAL) -> Amounts:
        """Returns the fractionally used resources of the first kind that has any.

        Parameters
        ----------
        tolerance : amounts nearer than this to an integer count as integral
        """
        for part in self:
            found = {r: a for r, a in part.items() if _is_fractional(a, tolerance)}
            if found:
                return found
        return {}

    def most_fractional(self, tolerance: float) -> tuple[Resource, float] | None:
        """Returns the resource to branch on and its amount; ties go to the earlier step."""
        choices = self.fractional(tolerance).items()
        return min(
            choices,
            key=lambda c: (round(abs(c[1] % 1 - 0.5), 3), c[0].t, repr(c[0])),
            default=None,
        )


def _is_fractional(amount: float, tolerance: float = INTEGRAL) -> bool:
    return abs(amount - round(amount)) > tolerance
