"""The moves of drones with limits that can be flown in any order, so that every plan has a flight.

A drone that rests at each step can fly any move that the plan requires next. So a recipe's moves
are restricted to those that a drone can make from rest to rest within a step
(`cocap_opt.flight.rests`); a smooth flight rests only where it must. Longer moves are left out. If
even the shortest move is too long, cells and headings are divided. If the ground is too steep for
layers to follow it, layers are level, or as steep as drones can climb, and nowhere closer to the
ground than stated.
"""

import logging
import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.flight.rests import LAWS, TURNS, Rests
from cocap_opt.flight.strain import rises
from cocap_opt.problem import Limits, Motion, Stride
from cocap_opt.problem.motion import MOST_MOVED
from cocap_opt.scenarios.maps.raster import MOST_CELLS
from cocap_opt.scenarios.maps.terrain import Terrain
from cocap_opt.scenarios.recipe.drones import DronesTable
from cocap_opt.world.workspace import HeightMap

_MOST_HEADINGS = 360
_UPHILL = 0.97  # share of a stride that a cell may take if the ground is uneven: a slope of 1 : 4
_LESS = 1 - 1e-9

log = logging.getLogger(__name__)


class Strides(NamedTuple):
    """The moves that the drones of all tables can make between rests.

    Attributes
    ----------
    law : time law of these moves
    tables : tables with the remaining motions
    terrain : terrain with the cells and flight heights of these motions
    told : the differences from the recipe, a line for each table, and one for the ground
    """

    law: Rests
    tables: tuple[DronesTable, ...]
    terrain: Terrain
    told: tuple[str, ...]

    @classmethod
    def of(
        cls, tables: Sequence[DronesTable], terrain: Terrain, step: float, follows_ground: bool,
        ceiling: float | None,
    ) -> Self:  # fmt: skip
        """Returns the moves of drones in a terrain.

        Parameters
        ----------
        step : length of a step, s
        follows_ground : True: flight heights are above the ground, however steep it is
        ceiling : ceiling of flight heights, m
        """
        law = max(LAWS, key=lambda law: _merit(tables, terrain, law, step))
        parts = _parts(tables, terrain, law, step)
        finer = terrain.divided(parts)
        motions = [_motion(table, finer, parts, law, step) for table in tables]
        told: list[str] = []
        if not follows_ground and (slope := _slope(motions, finer)) < math.inf:
            lowest = min(motion.layers[0] for motion in motions)
            most = math.inf if ceiling is None else max(ceiling - lowest, 0.0)
            finer = finer.lifted(slope, most)
            told += _lifted(finer, slope)
        changed = []
        for k, (table, motion) in enumerate(zip(tables, motions, strict=True)):
            motion = _unbound(motion, finer.height_map, table.motion.stride)
            changed.append(table.with_motion(motion))
            told += _changed(k, table, motion, terrain, finer, step)
        return cls(law, tuple(changed), finer, tuple(told))

    def say(self) -> None:
        """Logs the differences from the recipe."""
        for words in self.told:
            log.warning("%s", words)


def _merit(
    tables: Sequence[DronesTable], terrain: Terrain, law: Rests, step: float
) -> tuple[int, int, float]:
    """Returns the merit of a law: number of drones that can move, few parts of cells, then long
    moves.
    """
    parts = _parts(tables, terrain, law, step)
    edge = terrain.height_map.resolution / parts
    moving = sum(
        table.size
        for table in tables
        if table.known_limits is None or _farthest(law.stride(table.known_limits, step)) >= edge
    )
    return moving, -parts, sum(_worth(table, terrain, law, step) for table in tables)


def _worth(table: DronesTable, terrain: Terrain, law: Rests, step: float) -> float:
    """Returns the shares of the recipe's longest moves that a table's drones can make with a
    law.
    """
    limits, motion = table.known_limits, table.motion
    if limits is None:
        return 0.0
    stride = law.stride(limits, step)
    aside = motion.radius * terrain.height_map.resolution * math.sqrt(2)
    shares = [
        min(1.0, *(most / asked for most in bounds if most is not None))
        for asked, bounds in (
            (aside, (math.inf, stride.aside, stride.space)),
            (motion.largest_climb, (math.inf, stride.upright, stride.space)),
        )
        if asked > 0
    ]
    return table.size * sum(shares)


def _parts(tables: Sequence[DronesTable], terrain: Terrain, law: Rests, step: float) -> int:
    """Returns the number of parts into which cells are divided, so that each drone can move by a
    cell.
    """
    height_map = terrain.height_map
    most = min(MOST_MOVED, math.isqrt(MOST_CELLS // height_map.heights.size))
    share = _UPHILL if height_map.is_uneven else 1.0
    found = 1
    for table in tables:
        if table.known_limits is None or not table.motion.radius:
            continue
        far = _farthest(law.stride(table.known_limits, step)) * share
        parts = math.ceil(height_map.resolution / far * _LESS)
        if parts <= most:
            found = max(found, parts)
    return found


def _farthest(stride: Stride) -> float:
    """Returns the length (m) of the longest level move; inf if it is unlimited."""
    return min(most for most in (math.inf, stride.aside, stride.space) if most is not None)


def _motion(table: DronesTable, terrain: Terrain, parts: int, law: Rests, step: float) -> Motion:
    """Returns the motion of a table's drones on divided cells."""
    motion, limits = table.motion, table.known_limits
    radius, spacing = motion.radius * parts, motion.spacing * parts
    edge = terrain.height_map.resolution
    if limits is None:
        return motion.replace(radius=_within(radius, spacing), spacing=spacing)
    stride = law.stride(limits, step).within(motion.stride)
    far = _farthest(stride)
    if far < spacing * edge * math.sqrt(2):  # not even to all neighbours of a cell
        spacing = motion.spacing
    if far < radius * edge:
        radius = math.floor(far / edge / _LESS)
    motion = motion.replace(radius=_within(radius, spacing), spacing=spacing)
    found = _turning(motion, limits, step)
    tilts = table.tilts_in_radians
    if limits.gimbal_rate is not None:
        most = limits.gimbal_rate * step / TURNS.rate
        while found.pitch_turn and found.largest_tilt(tilts) > most:
            found = found.replace(pitch_turn=min(found.pitch_turn, len(tilts)) - 1)
    return found.replace(stride=stride)


def _within(radius: int, spacing: int) -> int:
    """Returns the largest multiple of a spacing within the radius that motions may have."""
    return min(radius, MOST_MOVED) // spacing * spacing


def _unbound(motion: Motion, height_map: HeightMap, stated: Stride | None) -> Motion:
    """Returns the motion without a stride, if none of its moves on a map exceeds it."""
    if motion.stride is None or motion.stride == stated:
        return motion
    reaches = rises(height_map, motion)
    if all(motion.stride.allows(aside, np.array(rise)) for aside, rise in reaches):
        return motion.replace(stride=stated)
    return motion


def _turning(motion: Motion, limits: Limits, step: float) -> Motion:
    """Returns a motion with turns that drones can make from rest to rest, and with more
    headings.
    """
    if limits.yaw_rate is None or not motion.turn:
        return motion
    most, unit = limits.yaw_rate * step / TURNS.rate, math.tau / motion.headings
    parts = math.ceil(unit / most * _LESS)
    if motion.headings * parts > _MOST_HEADINGS:
        return motion.replace(turn=0)
    turn = min(motion.turn * parts, math.floor(most / unit * parts / _LESS))
    if parts == 1 and turn >= min(motion.turn, motion.headings // 2):
        return motion
    return motion.replace(headings=motion.headings * parts, turn=turn)


def _slope(motions: Sequence[Motion], terrain: Terrain) -> float:
    """Returns the steepest rise per m that all drones can follow; inf if there is no limit."""
    edge, found = terrain.height_map.resolution, math.inf
    if not terrain.height_map.is_uneven:
        return found
    for motion in motions:
        if motion.stride is None or not motion.radius:
            continue
        if motion.stride.space is not None:
            found = min(found, math.sqrt(max((motion.stride.space / edge) ** 2 - 1, 0.0)))
        if motion.stride.upright is not None:
            longest = min(motion.radius * edge * math.sqrt(2), _farthest(motion.stride))
            found = min(found, motion.stride.upright / longest)
    return found * _LESS


def _lifted(terrain: Terrain, slope: float) -> Iterator[str]:
    lift = terrain.height_map.lift
    if lift is not None:
        share = float((lift > 0).mean())
        yield (
            f"flight: the ground is steeper than the drones can follow, {100 * slope:.3g} %, so "
            f"they fly up to {lift.max():.3g} m higher above it in {100 * share:.2g} % of the "
            'cells; with flight = "above-ground" they follow it, without moves that are too steep'
        )


def _changed(
    k: int, table: DronesTable, motion: Motion, before: Terrain, after: Terrain, step: float
) -> Iterator[str]:
    """Yields the differences between a table's motion and that of the recipe, in words."""
    old, edge = table.motion, after.height_map.resolution
    words = []
    if motion.spacing * edge < old.spacing * before.height_map.resolution:
        words.append(f"cells are {edge:.3g} m, not {before.height_map.resolution:.3g}")
    count, all_ = len(motion.moves_on(after.height_map)), len(old.moves)
    left = f"{count} moves, not {all_}"
    if edge == before.height_map.resolution and count < all_:
        left = f"only {count} of the {all_} moves are so short"
    if motion.stride is not None and motion.stride != old.stride:
        words.append(f"moves are at most {motion.stride} ({left})")
    elif count != all_:
        words.append(f"moves are at most {motion.radius} cells ({left})")
    if motion.headings != old.headings:
        words.append(f"headings are {motion.headings}, not {old.headings}")
    degrees = [360 / m.headings * min(m.turn, m.headings // 2) for m in (motion, old)]
    if abs(degrees[0] - degrees[1]) > 1e-9:
        words.append(f"turns at most {degrees[0]:.4g} degrees, not {degrees[1]:.4g}")
    if motion.pitch_turn != old.pitch_turn:
        words.append(f"tilts by {motion.pitch_turn} in a step, not {old.pitch_turn}")
    if words:
        yield (
            f"drones[{k}]{f' ({table.airframe})' if table.airframe else ''}: so that any plan can "
            f"be flown smoothly in steps of {step:g} s, {', '.join(words)}; "
            'flown = "straight" keeps the moves of the recipe'
        )
        yield from _apart(k, motion, after.height_map, step)


def _apart(k: int, motion: Motion, height_map: HeightMap, step: float) -> Iterator[str]:
    """Yields the layers between which drones cannot change, in words."""
    if motion.stride is None or height_map.is_uneven:
        return
    bounds = motion.stride.upright, motion.stride.space
    most = min((bound for bound in bounds if bound is not None), default=math.inf)
    pairs = [(low, high) for low, high in pairwise(motion.layers) if high - low > most]
    if pairs:
        told = ", ".join(f"{low:g} and {high:g} m" for low, high in pairs)
        yield (
            f"drones[{k}]: cannot change between the layers {told}: in a step of {step:g} s they "
            f"climb at most {most:.3g} m; place layers closer together, or make steps longer"
        )
