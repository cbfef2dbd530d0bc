"""The cells in which a drone may end: a single one, or any of several."""

from functools import cached_property

import msgspec
import numpy as np

from cocap_opt.data import BoolArray, Data, IntArray, require, whole


class GoalArea(Data, frozen=True, tag="area", dict=True):
    """A drone ends in one of these cells, in any layer and orientation; planners choose the best.

    Attributes
    ----------
    cells : distinct cells (x, y) of the map, in order
    """

    cells: tuple[tuple[int, int], ...]

    def __post_init__(self) -> None:
        # false for cells from files, which may be hundreds of thousands
        if not _are_cells(self.cells):
            super().__post_init__()
            for cell in self.cells:
                for index in cell:
                    whole(index, "cells")
        require(len(self.cells) > 0, "cells", "must hold at least one cell")
        require(len(set(self.cells)) == len(self.cells), "cells", "must all be different")
        msgspec.structs.force_setattr(self, "cells", tuple(sorted(self.cells)))

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """The cached hash, since there may be many cells, and tables are looked up by it
        repeatedly.
        """
        return hash(self.cells)

    @cached_property
    def array(self) -> IntArray:
        """The cells [n, 2]."""
        found = np.array(self.cells, dtype=np.int64)
        found.setflags(write=False)
        return found

    @cached_property
    def inside(self) -> frozenset[tuple[int, int]]:
        """The cells as a set, for look-ups."""
        return frozenset(self.cells)

    def __repr__(self) -> str:
        return f"GoalArea of {len(self.cells):,} cells"


def _are_cells(cells: object) -> bool:
    """Returns True for a tuple of pairs of Python integers, which need no further check."""
    return type(cells) is tuple and all(
        type(cell) is tuple and len(cell) == 2 and type(cell[0]) is type(cell[1]) is int
        for cell in cells
    )


AnyGoal = tuple[int, int] | GoalArea


def goal_cells(goal: AnyGoal) -> IntArray:
    """Returns the cells [n, 2] of a goal."""
    return goal.array if isinstance(goal, GoalArea) else np.array([goal], dtype=np.int64)


def may_end(goal: AnyGoal | None, x: IntArray, y: IntArray) -> BoolArray:
    """Returns an array [n], True for cells x [n], y [n] in which a drone with this goal may end."""
    if goal is None:
        return np.ones(len(x), dtype=np.bool_)
    if not isinstance(goal, GoalArea):
        return np.asarray((x == goal[0]) & (y == goal[1]))
    wide = 1 + max(int(y.max(initial=0)), int(goal.array[:, 1].max()))
    return np.isin(x * wide + y, goal.array[:, 0] * wide + goal.array[:, 1])
