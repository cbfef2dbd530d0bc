"""State cuts: bounds on the root of a view sum, given the state of each robot at its step.

By the vertex rule, no two robots are in the same cell at a step. Take a number phi for each of some
listed states of robots, and in all other states, with root s of the robot's pixels, phi = min(s,
slope s^2). Then

    |s| <= constant + sum_i phi(state of robot i)

is valid if it holds with listed states alone in different cells, and with the root replaced by the
line that touches it, left of where they touch:

    F(z) = 1 / (4 slope) + slope z  if z < 1 / (4 slope^2), else sqrt(z),

for a robot in another state adds at most its root s to the norm, and p pixels more raise sqrt(z) by
at most slope p beyond F(z). The sets of listed states in different cells are the corners of an
envelope cut (`envelope`) in which cells take the place of robots, each with the listed states in it
as its breakpoints; so the constant is found in the same way. Envelope cuts see only the pixels of
robots, and miss that two robots cannot both have the best view from one cell.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.envelope import Corners, Curve, Cut
from cocap_opt.model import Model
from cocap_opt.problem import Cell
from cocap_opt.stop import Stop, never


class ListedStates(NamedTuple):
    """phi at the listed states of one class."""

    states: IntArray  # [n] state numbers, increasing
    roots: FloatArray  # [n] root of the pixels of a robot there, px^0.5/m
    values: FloatArray  # [n] phi >= 0, px^0.5/m

    @classmethod
    def of(
        cls, model: Model, number: int, view_sum: int, states: IntArray, values: FloatArray
    ) -> "ListedStates":
        """Returns phi at some states of class `number`, in any order."""
        order = np.argsort(states, kind="stable")
        roots = np.sqrt(pixels_of(model, number, view_sum, states[order]))
        return cls(states[order], roots, values[order])


@dataclass(frozen=True, eq=False)
class CutByStates:
    """A state cut of a view sum.

    Attributes
    ----------
    slope : price of pixels in all other states, m/px^0.5
    listed : phi at listed states, by number of the robot class
    """

    view_sum: int
    slope: float
    listed: Mapping[int, ListedStates]
    constant: float

    @classmethod
    def valid(
        cls,
        model: Model,
        view_sum: int,
        slope: float,
        listed: Mapping[int, ListedStates],
        stop: Stop = never,
    ) -> Self:
        """Returns the cut with the smallest constant that makes it valid, or slightly more.

        The scene must have the vertex rule. The constant is >= 0, since possibly no robot sees the
        view sum. Raises LimitReached if a limit is reached.
        """
        points: dict[Cell, list[tuple[float, float]]] = {}
        for number, (states, roots, values) in listed.items():
            cells, n_places = model.places.cells[number], model.classes[number].graph.n_places
            for k, place in enumerate((states % n_places).tolist()):
                points.setdefault(cells[place], []).append((float(roots[k]), float(values[k])))
        curves = {k: Curve(*np.array(of_cell).T) for k, of_cell in enumerate(points.values())}
        sizes = (1,) * len(curves)
        constant = Corners(curves, sizes, slope, stop).highest() if curves else 0.0
        return cls(view_sum, slope, listed, max(constant, 0.25 / slope))

    def phi(self, number: int, states: IntArray, roots: FloatArray) -> FloatArray:
        """Returns phi of robots of class `number` in any states [n], given their roots [n]."""
        result: FloatArray = roots * np.minimum(1.0, self.slope * roots)
        if number in self.listed:
            listed, _, values = self.listed[number]
            at = np.minimum(np.searchsorted(listed, states), len(listed) - 1)
            is_listed = listed[at] == states
            result[is_listed] = values[at[is_listed]]
        return result

    @property
    def n_listed(self) -> int:
        """The number of listed states of all classes."""
        return sum(len(states) for states, _, _ in self.listed.values())

    @property
    def magnitude(self) -> float:
        """The sum of the absolute values of all numbers of which the constant can be made."""
        listed = self.listed.values()
        return 0.25 / self.slope + sum(float((r + v).sum()) for _, r, v in listed)


def pixels_of(model: Model, number: int, view_sum: int, states: IntArray) -> FloatArray:
    """Returns the pixels [n] that robots of class `number` have of a view sum in some states [n].

    View sums belong to one step, so pixels must not add up over time.
    """
    robot_class = model.classes[number]
    table, n_states = model.coverage(robot_class), robot_class.graph.n_states
    t = view_sum // model.n_faces
    which, entries = table.entries(t * n_states + states)
    of_view_sum = table.view_sums[entries] == view_sum
    pixels = np.zeros(len(states))
    pixels[which[of_view_sum]] = table.pixels[entries[of_view_sum]]
    return pixels


AnyCut = Cut | CutByStates  # of a view sum, with phi of roots or of states
