"""Charges on one robot's time-expanded graph, by which planners and prices steer its path."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.data import BoolArray


class Charges(NamedTuple):
    """The costs of places, moves and states; infinity closes them, a negative cost attracts.

    `places` maps (t, place) to the cost of being there at t; `moves` maps (t, place, place)
    to the cost of leaving the first at t for the second at t+1; `states` maps (t, state) to
    the cost of being in it at t. Staying is never charged as a move.
    """

    places: Mapping[tuple[int, int], float] = {}
    moves: Mapping[tuple[int, int, int], float] = {}
    states: Mapping[tuple[int, int], float] = {}

    def free_moves(self, t: int, tail: int, heads: Sequence[int], n_places: int) -> BoolArray:
        """Returns which moves to states `heads` [n] at t+1, from state `tail` at t, cost nothing.

        Parameters
        ----------
        n_places : number of places of the graph; a state's place is its remainder by it
        """
        here = tail % n_places
        is_free = [
            (t + 1, head % n_places) not in self.places
            and (t + 1, head) not in self.states
            and (head % n_places == here or (t, here, head % n_places) not in self.moves)
            for head in heads
        ]
        return np.array(is_free, dtype=np.bool_)


NO_CHARGES = Charges()
