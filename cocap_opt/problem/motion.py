"""Motion of a robot: its states, and the moves between states."""

import math
from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np

from cocap_opt.data import (
    LARGEST,
    MOST_TURN,
    BoolArray,
    Data,
    FloatArray,
    require,
    whole,
    within,
)
from cocap_opt.world.workspace import HeightMap, Workspace

MOST_MOVED = 16  # cells of a move along an axis
ROUNDING = 1e-9  # relative amount by which motion may exceed a limit
Move = tuple[int, int, int]  # (layers, cells along x, cells along y)


class State(NamedTuple):
    """The motion state of one robot: grid cell, layer, heading and gimbal pitch, all indices.

    Attributes
    ----------
    x, y : the cell of the height map
    layer : index into `Motion.layers`, the flight heights
    heading : 0 looks along +x; headings are numbered counter-clockwise, `Motion.headings` in a full
        turn
    pitch : index into `Camera.tilts`
    """

    x: int
    y: int
    layer: int = 0
    heading: int = 0
    pitch: int = 0


class Cell(NamedTuple):
    """The place of a robot without its orientation; `layer` is the number of its height among those
    of all robots, from the lowest.
    """

    x: int
    y: int
    layer: int = 0


class Stride(Data, frozen=True):
    """The largest distances that a robot may move in one step; None: unlimited.

    Attributes
    ----------
    aside : horizontally, m
    upright : up or down, m
    space : in space, m
    """

    aside: float | None = None
    upright: float | None = None
    space: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in self.__struct_fields__:
            if getattr(self, field) is not None:
                within(getattr(self, field), 0, LARGEST, field, "m")

    def __str__(self) -> str:
        """The distances in words, without those that the distance in space makes redundant."""
        parts = (self.aside, "horizontally"), (self.upright, "up or down")
        space = math.inf if self.space is None else self.space
        bounds = [
            f"{most:.3g} m {told}" for most, told in parts if most is not None and most < space
        ]
        return ", ".join(([f"{space:.3g} m long"] if self.space is not None else []) + bounds)

    def within(self, other: "Stride | None") -> "Stride":
        """Returns the stride with the bounds of both."""
        if other is None:
            return self
        bounds = {}
        for field in self.__struct_fields__:
            both = getattr(self, field), getattr(other, field)
            bounds[field] = min((most for most in both if most is not None), default=None)
        return Stride(**bounds)

    def allows(self, aside: float, rise: FloatArray) -> BoolArray:
        """Returns an array [..], True for moves of allowed horizontal length and rise."""
        space = np.hypot(aside, rise)
        bounds = (self.aside, aside), (self.upright, np.abs(rise)), (self.space, space)
        allowed = np.ones(rise.shape, dtype=np.bool_)
        for most, length in bounds:
            if most is not None:
                allowed &= length <= most * (1 + ROUNDING)
        return allowed


class Motion(Data, frozen=True):
    """The moves of a robot in one step: up to `radius` cells along each axis, and a turn.

    The default is the action set of Greedy Perspectives: 3x3 cells times yaw -45, 0, +45 degrees.

    Attributes
    ----------
    radius : cells along each axis per step
    headings : number of headings in a full turn
    turn : heading indices per step, either way
    layers : flight heights in m above the map's datum, increasing
    climb : layers per step, either way
    pitch_turn : gimbal pitch indices per step, either way
    clearance : distance from solid matter above and below, m; touching it is too close
    corner_cutting : True: only the end cells of a move must be free, as in the papers
    spacing : moves along each axis are multiples of this number of cells
    stride : largest distances of one step; None: all moves within the limits above are allowed
    """

    radius: int = 1
    headings: int = 8
    turn: int = 1
    layers: tuple[float, ...] = (5.0,)
    climb: int = 1
    pitch_turn: int = 1
    clearance: float = 0.0
    corner_cutting: bool = False
    spacing: int = 1
    stride: Stride | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("radius", "headings", "turn", "climb", "pitch_turn", "spacing"):
            whole(getattr(self, field), field)
        within(self.radius, 0, MOST_MOVED, "radius", "cells")
        within(self.headings, 1, 360, "headings", "directions")
        within(self.spacing, 1, MOST_MOVED, "spacing", "cells")
        for field in ("turn", "climb", "pitch_turn"):
            within(getattr(self, field), 0, MOST_TURN, field, "indices per step")
        within(self.clearance, 0, LARGEST, "clearance", "m")
        require(len(self.layers) > 0, "layers", "must name at least one flight height")
        for height in self.layers:
            within(height, -LARGEST, LARGEST, "layers", "m")
        increasing = all(a < b for a, b in zip(self.layers, self.layers[1:], strict=False))
        require(increasing, "layers", "flight heights must increase")

    @property
    def moves(self) -> list[Move]:
        """All cell moves of one step; the first one stays in the cell."""
        climb = min(self.climb, len(self.layers) - 1)
        most = self.radius - self.radius % self.spacing
        reach, climbs = range(-most, most + 1, self.spacing), range(-climb, climb + 1)
        return sorted(product(climbs, reach, reach), key=lambda move: (move != (0, 0, 0), move))

    def moves_on(self, height_map: HeightMap) -> list[Move]:
        """Returns the moves of one step that are within the stride at some place of a map."""
        if self.stride is None:
            return self.moves
        layers, uneven = np.array(self.layers), height_map.is_uneven
        found = []
        for move in self.moves:
            climb, aside = abs(move[0]), height_map.resolution * math.hypot(*move[1:])
            # If layers follow the ground, a climb may be smaller, or none at all.
            rises = np.zeros(1) if uneven else layers[climb:] - layers[: len(layers) - climb]
            if self.stride.allows(aside, rises).any():
                found.append(move)
        return found

    def longest_aside(self, resolution: float) -> float:
        """Returns the length (m) of the longest move of one step, seen from above."""
        stride = self.stride or Stride()
        most = self.radius // self.spacing
        lengths = (
            resolution * self.spacing * math.hypot(i, j)
            for i in range(most + 1)
            for j in range(i + 1)
        )
        level = np.zeros(())
        return max(length for length in lengths if stride.allows(length, level))

    @property
    def largest_climb(self) -> float:
        """The largest difference in height (m) between layers that one step can connect."""
        layers, reach = self.layers, self.climb
        return max(b - a for k, a in enumerate(layers) for b in layers[k : k + reach + 1])

    def largest_tilt(self, tilts: Sequence[float]) -> float:
        """Returns the largest change of a camera's tilt (rad) in one step."""
        reach = self.pitch_turn
        return max(abs(a - b) for k, a in enumerate(tilts) for b in tilts[k : k + reach + 1])

    def shortest_move(self, resolution: float) -> float:
        """Returns the length (m) of the shortest move to another place; inf if there is none."""
        climbs = [b - a for a, b in zip(self.layers, self.layers[1:], strict=False)]
        lengths = [self.spacing * resolution] if self.radius >= self.spacing else []
        return min([*lengths, *(climbs if self.climb else [])], default=math.inf)

    def headings_after(self, heading: int) -> set[int]:
        """Returns the headings, which form a ring, to which one step can turn from `heading`."""
        most = min(self.turn, self.headings // 2)
        return {k % self.headings for k in range(heading - most, heading + most + 1)}

    def pitches_after(self, pitch: int, pitches: int) -> set[int]:
        """Returns the pitches, out of `pitches`, to which one step can tilt from `pitch`."""
        most = self.pitch_turn
        return set(range(max(0, pitch - most), min(pitches, pitch + most + 1)))

    def free_places(self, workspace: Workspace) -> BoolArray:
        """Returns an array [layer, X, Y], True for places with no solid matter within the
        clearance.

        Places in a no-fly zone or above the ceiling are not free, either.
        """
        altitudes = workspace.height_map.altitudes(self.layers)
        low, high = altitudes - self.clearance, altitudes + self.clearance
        return ~(
            workspace.columns.solid(low, high) | workspace.forbidden.solid(altitudes, altitudes)
        )

    @staticmethod
    def swept_cells(dx: int, dy: int) -> list[tuple[int, int]]:
        """Returns the cells, relative to the first, that the line between two cell centres touches.

        A diagonal move touches the two cells at whose corner it passes.
        """
        # The line meets the closed unit square around (i, j) unless the square lies wholly on
        # one side of it (separating axis). With integers the test is exact.
        return [
            (i, j)
            for i in range(min(0, dx), max(0, dx) + 1)
            for j in range(min(0, dy), max(0, dy) + 1)
            if 2 * abs(dx * j - dy * i) <= abs(dx) + abs(dy)
        ]
