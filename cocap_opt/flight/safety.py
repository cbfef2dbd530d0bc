"""Proofs that flights keep away from matter, zones, people and each other, at every moment.

Nothing is sampled. Of drones, and of drones and people, the squared distance is a polynomial, which
is proved to be large enough by its coefficients (`bernstein`). Against matter and zones a piece
of a flight is halved until the box of its coefficients lies in free cells only.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from cocap_opt.data import LARGEST, FloatArray
from cocap_opt.flight.bernstein import elevated, ever_positive, halves, product, squared_length
from cocap_opt.flight.trajectory import DEGREE, Trajectory, between_drones
from cocap_opt.problem import CollisionRules, Motion, Problem
from cocap_opt.problem.rules import TOLERANCE
from cocap_opt.world.columns import Columns

_DEEPEST = 40  # halvings
_TOUCH = 1e-9  # cells


class Danger(NamedTuple):
    """Something that drones do in a step and may not."""

    step: int  # it is between this one and the next
    drones: tuple[int, ...]
    words: str

    def __str__(self) -> str:
        who = " and ".join(map(str, self.drones))
        noun = "drones" if len(self.drones) > 1 else "drone"
        return f"step {self.step} to {self.step + 1}: {noun} {who} {self.words}"


def dangers(flown: Trajectory) -> list[Danger]:
    """Returns the steps in which flights break a rule of their scene; none if they are safe.

    Walls are not looked at for drones that may cut corners (`Motion.corner_cutting`): their plans
    do not keep away from them between the steps either.
    """
    found = [*_between_drones(flown), *_near_people(flown), *_in_matter(flown)]
    return sorted(found, key=lambda danger: (danger.step, danger.drones))


def _between_drones(flown: Trajectory) -> Iterator[Danger]:
    rules, steps = flown.problem.rules, flown.pieces.shape[1]
    ways = between_drones(flown.pieces)
    if rules.none or not rules.separation or not len(ways):
        return
    pairs = list(combinations(range(len(flown.pieces)), 2))
    for k in np.flatnonzero(ever_positive(_nearness(ways, rules))).tolist():
        yield Danger(k % steps, pairs[k // steps], f"come nearer than the {rules}")


def _near_people(flown: Trajectory) -> Iterator[Danger]:
    """Yields where drones come too near to people, who walk straight from step to step."""
    problem = flown.problem
    airspace, steps = problem.airspace, flown.pieces.shape[1]
    if not airspace.people_aside:
        return
    for j, actor in enumerate(problem.actors):
        feet = actor.middles[: steps + 1] - [*problem.height_map.origin, 0.0]
        walk = elevated(np.stack([feet[:-1], feet[1:]], axis=-1), DEGREE)
        ways = (flown.pieces[:, :, :3] - walk).reshape(-1, 3, DEGREE + 1)
        for k in np.flatnonzero(ever_positive(_nearness(ways, airspace.rules_beside(actor)))):
            yield Danger(int(k) % steps, (int(k) // steps,), f"comes too near to actors[{j}]")


def _nearness(ways: FloatArray, rules: CollisionRules) -> list[FloatArray]:
    """Returns polynomials that are positive together while ways [n, 3, 6] break a separation."""
    if not rules.vertical:
        return [(rules.separation - TOLERANCE) ** 2 - squared_length(ways)]
    most, z = rules.vertical - TOLERANCE, ways[:, 2]
    aside = (rules.separation - TOLERANCE) ** 2 - squared_length(ways[:, :2])
    return [aside] if most >= LARGEST / 2 else [aside, most**2 - product(z, z)]


def _in_matter(flown: Trajectory) -> Iterator[Danger]:
    problem = flown.problem
    matter, closed = problem.workspace.columns, problem.workspace.forbidden
    for i, (robot, path) in enumerate(zip(problem.robots, flown.pieces, strict=True)):
        motion = robot.motion
        for t, piece in enumerate(path):
            places = piece[:3]
            if (places == places[:, :1]).all():
                continue  # it stays
            if not _is_free(places, problem, closed, Motion(), True):
                yield Danger(t, (i,), "enters a no-fly zone, or is above the ceiling")
            elif not _is_free(places, problem, matter, motion, not motion.corner_cutting):
                yield Danger(t, (i,), "comes too near to solid matter, or leaves the map")


def _is_free(
    places: FloatArray, problem: Problem, columns: Columns, motion: Motion, looks: bool
) -> bool:
    """Returns True if a piece of a flight is proved to stay where columns are empty.

    Parameters
    ----------
    places : [3, 6] coefficients of x, y (m from the corner of the map) and z
    motion : whose clearance is kept
    looks : False: only that it stays on the map
    """
    size, shape = problem.height_map.resolution, problem.height_map.shape
    scaled = places / np.array([[size], [size], [1.0]])
    parts = [scaled]
    for _ in range(_DEEPEST):
        left = []
        for part in parts:
            low, high = part.min(axis=1), part.max(axis=1)
            if looks and _hits(part[:, 0], part[:, 0], columns, motion, shape):
                return False
            if not _hits(low, high, columns, motion, shape, looks):
                continue
            left += list(halves(part))
        if not left:
            return True
        parts = left
    return False


def _hits(
    low: FloatArray,
    high: FloatArray,
    columns: Columns,
    motion: Motion,
    shape: tuple[int, int],
    looks: bool = True,
) -> bool:
    """Returns True if a box [3], in cells and m, reaches what is solid, or off the map."""
    first = np.floor(low[:2] - _TOUCH).astype(np.int64)
    last = np.floor(high[:2] + _TOUCH).astype(np.int64)
    if (first < 0).any() or (last >= shape).any():
        return True
    if not looks:
        return False
    # By less than the rules' own tolerance, so that touching the limit of a zone is no danger.
    bottom, top = low[2] - motion.clearance, high[2] + motion.clearance
    part = slice(first[0], last[0] + 1), slice(first[1], last[1] + 1)
    found = (columns.low[:, *part] <= top - TOLERANCE) & (
        columns.high[:, *part] >= bottom + TOLERANCE
    )
    return bool(found.any())
