"""Charges on one robot's time-expanded graph, by which planners and prices steer its path."""

from collections.abc import Mapping
from typing import NamedTuple


class Charges(NamedTuple):
    """The costs of places, moves and states; infinity closes them, a negative cost attracts.

    `places` maps (t, place) to the cost of being there at t; `moves` maps (t, place, place)
    to the cost of leaving the first at t for the second at t+1; `states` maps (t, state) to
    the cost of being in it at t. Staying is never charged as a move.
    """

    places: Mapping[tuple[int, int], float] = {}
    moves: Mapping[tuple[int, int, int], float] = {}
    states: Mapping[tuple[int, int], float] = {}


NO_CHARGES = Charges()
