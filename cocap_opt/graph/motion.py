"""Moves of one step on the map, as arrays: places from which each is allowed, and people nearby.

Moving and turning are independent of each other. `networks` provides moves and turns as networkx
graphs; `timegraph` compiles them for planners and bounds, which do not need single edges.
"""

from __future__ import annotations  # methods of Window return windows

import math
from collections.abc import Iterable, Iterator
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.problem import Actor, Airspace, Motion
from cocap_opt.problem.motion import Move
from cocap_opt.world.columns import Columns
from cocap_opt.world.workspace import Workspace

T = TypeVar("T", bound=np.generic)


class Window(NamedTuple):
    """A rectangle of cells on the map: x0 <= x < x1, y0 <= y < y1."""

    x0: int
    y0: int
    x1: int
    y1: int

    @classmethod
    def all_of(cls, workspace: Workspace) -> Window:
        """Returns the whole map."""
        return cls(0, 0, *workspace.height_map.shape)

    @classmethod
    def around(
        cls, cells: Iterable[tuple[int, int]] | IntArray, reach: int, workspace: Workspace
    ) -> Window:
        """Returns the smallest window that contains all cells (x, y) [n, 2], and a margin of
        `reach` on all sides.

        The window ends at the edge of the map, and cells outside the map count as the nearest cell
        on it.
        """
        width, depth = workspace.height_map.shape
        given = cells if isinstance(cells, np.ndarray) else [*cells]
        at = np.clip(given, 0, [width - 1, depth - 1])
        (x0, y0), (x1, y1) = at.min(axis=0), at.max(axis=0)
        return cls(
            max(int(x0) - reach, 0),
            max(int(y0) - reach, 0),
            min(int(x1) + reach + 1, width),
            min(int(y1) + reach + 1, depth),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Numbers of cells along x and y."""
        return self.x1 - self.x0, self.y1 - self.y0

    def covers(self, x: int, y: int) -> bool:
        """Returns True if a cell is in the window."""
        return self.x0 <= x < self.x1 and self.y0 <= y < self.y1

    def of(self, values: NDArray[T]) -> NDArray[T]:
        """Returns the window's part of values [.., X, Y] of the map."""
        part: NDArray[T] = values[..., self.x0 : self.x1, self.y0 : self.y1]
        return part


def allowed_moves(
    workspace: Workspace, motion: Motion, window: Window | None = None
) -> Iterator[tuple[Move, BoolArray]]:
    """Yields each move of one step, and an array [layer, X, Y], True for places from which it is
    allowed.

    Parameters
    ----------
    window : the part of the map, of X x Y cells, to which robots are confined (default: all)
    """
    window = window or Window.all_of(workspace)
    room = (
        workspace.height_map.resolution,
        window.of(motion.free_places(workspace)),
        window.of(workspace.height_map.altitudes(motion.layers)),
        Columns(*map(window.of, workspace.columns)),
        Columns(*map(window.of, workspace.forbidden)),
    )
    forth: dict[Move, BoolArray] = {}
    for move in motion.moves_on(workspace.height_map):
        back = (-move[0], -move[1], -move[2])
        if back in forth:  # the reverse move passes the same cells at the same altitudes
            yield move, _shifted(forth.pop(back), move, False)
        else:
            forth[move] = _allowed_starts(motion, move, *room)
            yield move, forth[move]


def _allowed_starts(
    motion: Motion, move: Move, edge: float, free: BoolArray, altitudes: FloatArray,
    matter: Columns, forbidden: Columns,
) -> BoolArray:  # fmt: skip
    """Returns an array [layer, X, Y], True for free places from which a move is allowed.

    The cells that it passes must be free of solid matter between its two altitudes, and within the
    clearance above and below. With corner cutting, only its two end cells are checked. There must
    also be no forbidden zone in between, and the move must be within the stride.

    Parameters
    ----------
    edge : edge length of a cell, m
    free, altitudes : [layer, X, Y] True if a robot may be there, and its altitude in m
    """
    here, there = altitudes, _shifted(altitudes, move, np.nan)
    low, high = np.minimum(here, there), np.maximum(here, there)
    allowed = ~np.isnan(there)  # the move does not lead off the map
    if motion.stride is not None:
        allowed &= motion.stride.allows(edge * math.hypot(*move[1:]), there - here)
        if not allowed.any():
            return allowed
    allowed &= _clear(forbidden, move, low, high)
    if motion.corner_cutting:
        return allowed & free & _shifted(free, move, False)
    return allowed & _clear(matter, move, low - motion.clearance, high + motion.clearance)


def _clear(columns: Columns, move: Move, low: FloatArray, high: FloatArray) -> BoolArray:
    """Returns True for moves whose cells are empty at altitudes low..high [layer, X, Y]."""
    clear = np.ones(low.shape, dtype=np.bool_)
    if not np.isfinite(columns.high).any() and not np.isfinite(columns.low).any():
        return clear
    for i, j in Motion.swept_cells(*move[1:]):
        below, above = (_shifted(part, (0, i, j), np.nan) for part in columns)
        clear &= ~Columns(below, above).solid(low, high)
    return clear


def _shifted(values: NDArray[T], move: Move, outside: float) -> NDArray[T]:
    """Returns `values` [layer, X, Y] at every place + `move`, and `outside` for ends off the
    map.
    """
    result = np.full_like(values, outside)
    source, target = [], []
    for step, size in zip(move, values.shape, strict=True):
        source.append(slice(max(0, step), max(0, size + min(0, step))))
        target.append(slice(max(0, -step), max(0, size - max(0, step))))
    result[tuple(target)] = values[tuple(source)]
    return result


class People(NamedTuple):
    """The people of a problem, up to its horizon."""

    actors: tuple[Actor, ...]
    airspace: Airspace
    horizon: int
