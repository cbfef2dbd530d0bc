"""The states in which a drone may start: a fixed one, a few, or all that are free in an area."""

from contextlib import suppress

import msgspec
import numpy as np

from cocap_opt.data import BoolArray, Data, IntArray, require, whole
from cocap_opt.problem.motion import State


class StartStates(Data, frozen=True, tag="states"):
    """A drone starts in one of these states, whichever is best.

    Attributes
    ----------
    states : all different, in order; each must be free
    """

    states: tuple[State, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(len(self.states) > 0, "states", "must hold at least one state")
        different = len(set(self.states)) == len(self.states)
        require(different, "states", "must all be different")
        with suppress(TypeError):  # of numbers that are none, which a scene refuses
            msgspec.structs.force_setattr(self, "states", tuple(sorted(self.states)))

    def holds(self, state: State) -> bool:
        """Returns True if a drone may start in this state."""
        return state in self.states


class StartArea(Data, frozen=True, tag="area"):
    """A drone starts in a free state of an area, whichever is best.

    Free are the states in which solid matter, no-fly zones, the ceiling and people let a drone be.

    Attributes
    ----------
    cells : (x, y) of the map; None: all
    layers : indices into the drone's flight heights; None: all
    headings : indices, as those of `State`; None: all
    pitches : indices into the camera's tilts; None: all
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
            require(len(values) > 0, field, "must hold at least one, or be left out for all")
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
        free : [layer, X, Y] where the drone may be
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

    def states_in(self, places: IntArray, headings: int, pitches: int) -> tuple[State, ...]:
        """Returns all states of the area in some places x, y, layer [n, 3], in this order.

        Parameters
        ----------
        headings, pitches : how many the drone has
        """
        turned = sorted(range(headings) if self.headings is None else self.headings)
        tilted = sorted(range(pitches) if self.pitches is None else self.pitches)
        return tuple(
            State(x, y, layer, heading, pitch)
            for x, y, layer in places.tolist()
            for heading in turned
            for pitch in tilted
        )


AnyStart = State | StartStates | StartArea
