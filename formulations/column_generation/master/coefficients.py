"""Coefficients of arcs in the restricted master: rewards for moves, views, and use of resources."""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray, IntArray
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.master.columns import Arc
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.model import Model

_Into = dict[tuple[int, int, int], list[int]]  # arcs by class, step and place
_Along = dict[tuple[int, int, int, int], list[int]]  # by class, step and the two places


@dataclass(frozen=True)
class Coefficients:
    """The coefficients of a list of arcs."""

    model: Model
    arcs: Sequence[Arc]

    def move_rewards(self) -> FloatArray:
        """Returns the rewards of the arcs for the moves themselves [n]."""
        bonuses = Bonuses.of(self.model.problem.objective)
        classes, _, tails, heads = np.array(self.arcs, dtype=np.int64).reshape(-1, 4).T
        rewards = np.zeros(len(self.arcs))
        for number in np.unique(classes).tolist():
            of_class, shape = classes == number, self.model.classes[number].graph.shape
            rewards[of_class] = bonuses.of_edges(shape, tails[of_class], heads[of_class])
        return rewards

    def views(self) -> "_Views":
        """Returns the pixels that the arcs have of view sums."""
        return _Views.of(self.model, self.arcs)

    def users(self, resources: Sequence[Resource]) -> list[list[int]]:
        """Returns the numbers of the arcs that use each resource.

        A state is used by the arcs into it, a start by those out of it.
        """
        into, along = self._by_places()
        users = []
        for resource in resources:
            t, found = resource.t, list[int]()
            for number, robot_class in enumerate(self.model.classes):
                used = resource.footprint(self.model, number)
                for place in used.places:
                    found += into.get((number, t, place), [])
                for tail, head in used.moves:
                    found += along.get((number, t, tail, head), [])
                for state in used.states:
                    near = into.get((number, t, state % robot_class.graph.n_places), [])
                    found += [k for k in near if self._state(k, t) == state]
            users.append(found)
        return users

    def _state(self, k: int, t: int) -> int:
        """Returns the state that arc k leads to at step t; its start where that is step 0."""
        return self.arcs[k].head if t else self.arcs[k].tail

    def _by_places(self) -> "tuple[_Into, _Along]":
        """Returns the arcs by the place that they lead to or start from, and by their moves."""
        into: _Into = defaultdict(list)
        along: _Along = defaultdict(list)
        n_places = [robot_class.graph.n_places for robot_class in self.model.classes]
        for k, (number, t, tail, head) in enumerate(self.arcs):
            start, end = tail % n_places[number], head % n_places[number]
            along[number, t, start, end].append(k)
            into[number, t + 1, end].append(k)
            if t == 0:
                into[number, 0, start].append(k)
        return into, along


class _Views(NamedTuple):
    """Roots of the pixels that arcs have of view sums, entry by entry.

    An arc sees what the state sees that it enters; at step 0 also what its start sees.
    """

    arcs: IntArray  # [k] arc
    at: IntArray  # [k] position of the view sum in `view_sums`
    roots: FloatArray  # [k] in units of the view sum's scale, 0..1
    view_sums: IntArray  # [z] view sums that any arc sees and that count, increasing
    scale: FloatArray  # [z] largest root of each, px^0.5/m

    @classmethod
    def of(cls, model: Model, arcs: Sequence[Arc]) -> "_Views":
        """Returns the views of arcs."""
        parts = [_entries_of_class(model, number, arcs) for number in range(len(model.classes))]
        of, view_sums, pixels = (np.concatenate(part) for part in zip(*parts, strict=True))
        counted = model.problem.view_sum_weights[view_sums] > 0
        of, view_sums, pixels = of[counted], view_sums[counted], pixels[counted]
        distinct, at = np.unique(view_sums, return_inverse=True)
        best = np.zeros(len(distinct))
        np.maximum.at(best, at, pixels)
        scale = np.sqrt(best)
        return cls(of, at, np.sqrt(pixels) / scale[at], distinct, scale)


class _Entries(NamedTuple):
    """Pixels of arcs, entry by entry."""

    arcs: IntArray
    view_sums: IntArray
    pixels: FloatArray


def _entries_of_class(model: Model, number: int, arcs: Sequence[Arc]) -> _Entries:
    """Returns the pixels of those arcs that belong to one class."""
    robot_class = model.classes[number]
    table, n_states = model.coverage(robot_class), robot_class.graph.n_states
    of_class = [(k, arc) for k, arc in enumerate(arcs) if arc.class_number == number]
    first = [(k, arc.tail) for k, arc in of_class if arc.t == 0]
    nodes = [(arc.t + 1) * n_states + arc.head for _, arc in of_class] + [
        state for _, state in first
    ]
    which, entries = table.entries(np.array(nodes, dtype=np.int64))
    numbers = np.array([k for k, _ in (*of_class, *first)], dtype=np.int64)
    return _Entries(numbers[which], table.view_sums[entries], table.pixels[entries])
