"""The states in which a drone may start: a fixed one, a few, or all that are free in an area."""

from cocap_opt.data import Data, require, whole
from cocap_opt.problem.motion import State


class StartStates(Data, frozen=True, tag="states"):
    """A drone starts in one of these states, whichever is best.

    Attributes
    ----------
    states : all different; each must be free
    """

    states: tuple[State, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        require(len(self.states) > 0, "states", "must hold at least one state")
        different = len(set(self.states)) == len(self.states)
        require(different, "states", "must all be different")

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


AnyStart = State | StartStates | StartArea
