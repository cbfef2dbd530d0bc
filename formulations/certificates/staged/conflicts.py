"""Conflicts: pairs of states of a step that two robots may not have at once.

Two states conflict if their places are too close. As many states share a place, the table is
indexed by place.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import CollisionRules

_ROWS = 500  # rows of the table for which distances are computed at once


@dataclass(frozen=True, eq=False)
class Conflicts:
    """The conflicts of n states at P places.

    Attributes
    ----------
    place_of : [n] number of each state's place
    table_of : computes `too_near` at its first use and caches it, also for parts
    """

    place_of: IntArray
    table_of: Callable[[], BoolArray]

    @classmethod
    def of(cls, rules: CollisionRules, positions: FloatArray) -> "Conflicts":
        """Returns the conflicts of states, given the positions of their robots [n, 3] in m."""
        places, place_of = np.unique(positions, axis=0, return_inverse=True)

        def table() -> BoolArray:
            rows = [
                rules.too_near(places[None] - places[k : k + _ROWS, None])
                for k in range(0, len(places), _ROWS)
            ]
            return np.concatenate([np.zeros((0, len(places)), np.bool_), *rows])

        return cls(place_of.reshape(-1), cache(table))

    @property
    def too_near(self) -> BoolArray:
        """An array [P, P], True for pairs of places that two robots may not occupy at once."""
        return self.table_of()

    def between(self, state: IntArray | int, other: IntArray | int) -> BoolArray:
        """Returns True for pairs of states, given by their positions, that conflict."""
        conflict: BoolArray = self.too_near[self.place_of[state], self.place_of[other]]
        return conflict

    def part(self, positions: IntArray) -> "Conflicts":
        """Returns the conflicts among some of the states."""
        return Conflicts(self.place_of[positions], self.table_of)

    @cached_property
    def may_repeat(self) -> bool:
        """True if two robots may be in the same state."""
        return not bool(self.too_near.diagonal()[self.place_of].all())

    def cliques(self, class_of: IntArray) -> IntArray:
        """Returns numbers [n] such that any two states of one number and class conflict.

        No number is used for two classes.

        Parameters
        ----------
        class_of : [n] number of each state's class
        """
        n = len(self.place_of)
        numbers, classes = np.full(n, -1), np.full(n, -1)
        # for each number, the places that conflict with all places of that number
        fits: list[BoolArray] = []
        of_place: dict[tuple[int, int], int] = {}
        for s, place in enumerate(zip(class_of.tolist(), self.place_of.tolist(), strict=True)):
            number = of_place.get(place)
            near = self.too_near[place[1]]
            if number is None or not near[place[1]]:
                same = np.flatnonzero(classes[: len(fits)] == place[0])
                number = next((k for k in same.tolist() if fits[k][place[1]]), len(fits))
                if number == len(fits):
                    fits.append(near)
                    classes[number] = place[0]
                fits[number] = fits[number] & near
                of_place[place] = number
            numbers[s] = number
        return numbers
