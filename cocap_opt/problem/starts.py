"""The start of a drone: a fixed state, several states, or all free states in an area."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from functools import cached_property
from itertools import starmap
from typing import Self, overload

import msgspec
import numpy as np

from cocap_opt.data import BoolArray, Data, IntArray, require, whole
from cocap_opt.problem.motion import State

_SHOWN = 12  # states of a set that are printed


class StartSet(Sequence[State]):
    """The free states in which a robot may start, as rows of an array; there may be very many.

    Parameters
    ----------
    states : [n, 5], in the order of the fields of `State`
    """

    def __init__(self, states: IntArray) -> None:
        self.array = states.reshape(-1, len(State._fields)).copy()
        self.array.flags.writeable = False

    @classmethod
    def of(cls, states: Iterable[State]) -> Self:
        """Returns the set of given states, in their order."""
        return cls(np.array([*states], dtype=np.int64))

    @cached_property
    def cells(self) -> IntArray:
        """The distinct cells x, y, layer [m, 3], in the order of their first occurrence."""
        return self.array[self._first_of_cells, :3]

    @property
    def columns(self) -> IntArray:
        """The distinct cells x, y of the map [m, 2], increasing."""
        if len(self) == 1:  # true of most sets
            return self.array[:, :2]
        return np.unique(self.cells[:, :2], axis=0)

    def in_different_cells(self) -> "StartSet":
        """Returns the first state in each cell."""
        return StartSet(self.array[self._first_of_cells])

    @cached_property
    def _first_of_cells(self) -> IntArray:
        if len(self) == 1:
            return np.zeros(1, dtype=np.int64)
        sizes = self.array[:, :3].max(axis=0, initial=0) + 1
        numbers = np.ravel_multi_index(tuple(self.array[:, :3].T), tuple(sizes))
        return np.sort(np.unique(numbers, return_index=True)[1])

    @cached_property
    def _bytes(self) -> bytes:
        return self.array.tobytes()

    def __len__(self) -> int:
        return len(self.array)

    @overload
    def __getitem__(self, k: int) -> State: ...

    @overload
    def __getitem__(self, k: slice) -> "StartSet": ...

    def __getitem__(self, k: int | slice) -> "State | StartSet":
        if isinstance(k, slice):
            return StartSet(self.array[k])
        return State(*self.array[k].tolist())

    def __iter__(self) -> Iterator[State]:
        return starmap(State, self.array.tolist())

    def __contains__(self, state: object) -> bool:
        if not isinstance(state, tuple) or len(state) != self.array.shape[1]:
            return False
        return bool((self.array == state).all(axis=1).any())

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, StartSet):
            return NotImplemented
        return self is other or self._bytes == other._bytes

    def __hash__(self) -> int:
        return hash(self._bytes)

    def __repr__(self) -> str:
        if len(self) <= _SHOWN:
            return repr([*self])
        return f"[{self[0]!r}, ... {len(self):,} states ..., {self[-1]!r}]"


class StartStates(Data, frozen=True, tag="states"):
    """A drone starts in one of these states; planners choose the best.

    Attributes
    ----------
    states : distinct states, in order; each must be free
    """

    states: tuple[State, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(len(self.states) > 0, "states", "must hold at least one state")
        different = len(set(self.states)) == len(self.states)
        require(different, "states", "must all be different")
        with suppress(TypeError):  # if numbers are not numbers, the scene reports it later
            msgspec.structs.force_setattr(self, "states", tuple(sorted(self.states)))

    def holds(self, state: State) -> bool:
        """Returns True if a drone may start in this state."""
        return state in self.states


class StartArea(Data, frozen=True, tag="area"):
    """A drone starts in a free state of an area; planners choose the best.

    A state is free if solid matter, no-fly zones, the ceiling and people leave room for a drone.

    Attributes
    ----------
    cells : (x, y) of the map; None: all
    layers : indices of the drone's flight heights; None: all
    headings : indices of headings, as in `State`; None: all
    pitches : indices of the camera's tilts; None: all
    """

    cells: tuple[tuple[int, int], ...] | None = None
    layers: tuple[int, ...] | None = None
    headings: tuple[int, ...] | None = None
    pitches: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in self.__struct_fields__:
            values: tuple[object, ...] | None = getattr(self, field)
            if values is None:
                continue
            require(len(values) > 0, field, "must hold at least one, or be omitted to allow all")
            require(len(set(values)) == len(values), field, "must all be different")
            for value in values:
                for index in value if isinstance(value, tuple) else (value,):
                    whole(index, field)

    def holds(self, state: State) -> bool:
        """Returns True if a drone may start in this state, provided that it is free."""
        parts = (
            ((state.x, state.y), self.cells), (state.layer, self.layers),
            (state.heading, self.headings), (state.pitch, self.pitches),
        )  # fmt: skip
        return all(allowed is None or value in allowed for value, allowed in parts)

    def places(self, free: BoolArray) -> IntArray:
        """Returns the free places of the area as rows x, y, layer [n, 3], increasing.

        Parameters
        ----------
        free : [layer, X, Y] True if the drone may be in a place
        """
        if self.cells is not None:
            inside = np.zeros(free.shape[1:], dtype=np.bool_)
            inside[tuple(np.array(self.cells).T)] = True
            free = free & inside
        if self.layers is not None:
            flown = np.zeros(len(free), dtype=np.bool_)
            flown[list(self.layers)] = True
            free = free & flown[:, None, None]
        return np.argwhere(free.transpose(1, 2, 0))

    def states_in(self, places: IntArray, headings: int, pitches: int) -> StartSet:
        """Returns all states of the area in the given places x, y, layer [n, 3], in this order.

        Parameters
        ----------
        headings, pitches : number of headings and of pitches that the drone has
        """
        turned = sorted(range(headings) if self.headings is None else self.headings)
        tilted = sorted(range(pitches) if self.pitches is None else self.pitches)
        turns = np.array([(turn, tilt) for turn in turned for tilt in tilted]).reshape(-1, 2)
        return StartSet(
            np.column_stack([
                np.repeat(places, len(turns), axis=0), np.tile(turns, (len(places), 1))
            ])
        )  # fmt: skip


AnyStart = State | StartStates | StartArea
