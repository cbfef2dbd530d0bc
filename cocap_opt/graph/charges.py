"""Charges on one robot's time-expanded graph, with which planners and prices steer its path."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np

from cocap_opt.data import BoolArray, FloatArray, IntArray

_Key = TypeVar("_Key", bound=tuple[int, ...])


class _Costs(NamedTuple):
    """Costs by step; costs of an item that is listed more than once add up."""

    keys: IntArray  # [n, k] step t and the charged item at t, t increasing
    costs: FloatArray  # [n]

    @classmethod
    def of(cls, keys: IntArray, costs: FloatArray) -> "_Costs":
        """Returns costs in the order of their steps."""
        order = np.argsort(keys[:, 0], kind="stable")
        return cls(keys[order], costs[order])

    @classmethod
    def of_mapping(cls, costs: Mapping[_Key, float], width: int) -> "_Costs":
        """Returns the costs of a mapping whose keys have the given length."""
        keys = np.array(list(costs), dtype=np.int64).reshape(-1, width)
        return cls.of(keys, np.array(list(costs.values()), dtype=np.float64))

    def at(self, t: int) -> "_Costs":
        """Returns the charges of step t."""
        if not len(self.costs):
            return self
        first, end = np.searchsorted(self.keys[:, 0], [t, t + 1])
        return _Costs(self.keys[first:end], self.costs[first:end])

    def total(self) -> dict[tuple[int, ...], float]:
        """Returns the total cost of each charged item."""
        found: dict[tuple[int, ...], float] = {}
        for key, cost in zip(map(tuple, self.keys.tolist()), self.costs.tolist(), strict=True):
            found[key] = found.get(key, 0.0) + cost
        return found


class Charges:
    """The costs of places, moves and states; infinity closes them, a negative cost attracts.

    Parameters
    ----------
    places : (t, place) and the cost of being in the place at t
    moves : (t, place, place) and the cost of moving from the first place at t to the second at t+1;
        if both are the same place, the cost of staying there
    states : (t, state) and the cost of being in the state at t
    """

    def __init__(
        self,
        places: Mapping[tuple[int, int], float] | None = None,
        moves: Mapping[tuple[int, int, int], float] | None = None,
        states: Mapping[tuple[int, int], float] | None = None,
    ) -> None:
        self._places = _Costs.of_mapping(places or {}, 2)
        self._moves = _Costs.of_mapping(moves or {}, 3)
        self._states = _Costs.of_mapping(states or {}, 2)

    @classmethod
    def of(
        cls,
        places: tuple[IntArray, FloatArray],
        moves: tuple[IntArray, FloatArray],
        states: tuple[IntArray, FloatArray],
    ) -> "Charges":
        """Returns charges from arrays of keys, [n, 2], [n, 3] and [n, 2], and of costs [n]."""
        charges = cls.__new__(cls)
        charges._places, charges._moves = _Costs.of(*places), _Costs.of(*moves)
        charges._states = _Costs.of(*states)
        return charges

    @classmethod
    def closing(cls, places: IntArray, moves: IntArray) -> "Charges":
        """Returns charges that close places [n, 2] and moves [m, 3], at their steps."""
        closed = [(keys, np.full(len(keys), np.inf)) for keys in (places, moves, places[:0])]
        return cls.of(*closed)

    @classmethod
    def joined(cls, parts: "Iterable[Charges]") -> "Charges":
        """Returns charges that add up several charges."""
        parts = [NO_CHARGES, *parts]
        return cls.of(*(
            (np.concatenate([c.keys for c in costs]), np.concatenate([c.costs for c in costs]))
            for costs in zip(*(charges.parts for charges in parts), strict=True)
        ))  # fmt: skip

    @property
    def parts(self) -> tuple[_Costs, _Costs, _Costs]:
        """Keys and costs of places, moves and states, by step, in the form that `of` takes."""
        return self._places, self._moves, self._states

    @property
    def none(self) -> bool:
        """True if nothing is charged."""
        return not any(len(part.costs) for part in self.parts)

    @cached_property
    def places(self) -> Mapping[tuple[int, ...], float]:
        """The cost of each charged (t, place)."""
        return self._places.total()

    @cached_property
    def moves(self) -> Mapping[tuple[int, ...], float]:
        """The cost of each charged (t, place, place)."""
        return self._moves.total()

    @cached_property
    def states(self) -> Mapping[tuple[int, ...], float]:
        """The cost of each charged (t, state)."""
        return self._states.total()

    def places_at(self, t: int) -> tuple[IntArray, FloatArray]:
        """Returns the charged places [n] at step t, some more than once, and their costs."""
        keys, costs = self._places.at(t)
        return keys[:, 1], costs

    def states_at(self, t: int) -> tuple[IntArray, FloatArray]:
        """Returns the charged states [n] at step t, some more than once, and their costs."""
        keys, costs = self._states.at(t)
        return keys[:, 1], costs

    def moves_at(self, t: int) -> tuple[IntArray, IntArray, FloatArray]:
        """Returns tails, heads and costs [n] of the charged moves from step t."""
        keys, costs = self._moves.at(t)
        return keys[:, 1], keys[:, 2], costs

    def cost_of_moves(self, t: int, tail: int, heads: IntArray) -> FloatArray:
        """Returns the cost [n] of the moves from place `tail` at t to places `heads` [n]."""
        tails, charged, costs = self.moves_at(t)
        if not len(tails):
            return np.zeros(len(heads))
        leaving = np.flatnonzero(tails == tail)
        same = heads[:, None] == charged[leaving]
        result: FloatArray = np.where(same, costs[leaving], 0.0).sum(axis=1)
        return result

    def free_states(self, t: int, states: IntArray, n_places: int) -> BoolArray:
        """Returns True for states [n] that cost nothing at t.

        Parameters
        ----------
        n_places : number of places, as in `free_moves`
        """
        places, charged = self.places_at(t)[0], self.states_at(t)[0]
        return ~(np.isin(states % n_places, places) | np.isin(states, charged))

    def free_moves(self, t: int, tail: int, heads: Sequence[int], n_places: int) -> BoolArray:
        """Returns True for moves from state `tail` at t to states `heads` [n] at t+1 that cost
        nothing.

        Parameters
        ----------
        n_places : number of places of the graph; a state's place is its remainder by it
        """
        here = tail % n_places
        is_free = [
            (t + 1, head % n_places) not in self.places
            and (t + 1, head) not in self.states
            and (t, here, head % n_places) not in self.moves
            for head in heads
        ]
        return np.array(is_free, dtype=np.bool_)


NO_CHARGES = Charges()
