"""Proves that flights keep clear of matter, zones, people and each other; finds closest approaches.

Nothing is sampled. The squared distance between drones, and between drones and people, is a
polynomial, which is proved to be large enough by its coefficients (`bernstein`). For matter and
zones, a piece of a flight is halved until the box of its coefficients contains only free cells.

Proved, for the polynomials of a `Trajectory`, from step 0 to the last step:
- Drones keep the separation, or the vertical distance, of the scene's rules.
- They keep the distance to people that the airspace requires; people walk straight from step to
  step, or leave this walk by no more than their `swerve`.
- They keep their clearance to matter, and stay on the map, out of no-fly zones and below the
  ceiling.

Assumed:
- Drones follow these polynomials exactly, by one clock: no wind, no control error, no delay
  (`delays` and `robustness` evaluate delays).
- Take-off, landing and the flights from and to home are not considered.
- Map, meshes and walks are correct; people's bodies are represented only as the rules measure them.
- Only rules that the scene has are checked: not distances without a rule, and not the walls for
  drones that may cut corners (`Motion.corner_cutting`).
- A micrometre (`TOLERANCE` of the rules) and the rounding of floating-point numbers do not matter.
- Files with points contain points of the polynomials; straight lines between these are different
  flights (`Trajectory.distance_from_chords` bounds the deviation).
"""

import math
from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple, Self

import numpy as np

from cocap_opt.data import LARGEST, BoolArray, FloatArray, IntArray
from cocap_opt.flight.bernstein import Peak, ever_positive, parted, product, squared_length
from cocap_opt.flight.trajectory import DEGREE, Trajectory
from cocap_opt.problem import SEPARATION, Airspace, CollisionRules, Motion, Problem
from cocap_opt.problem.rules import TOLERANCE
from cocap_opt.world.columns import Columns

_DEEPEST = 40  # halvings
_TOUCH = 1e-9  # cells
_Piece = tuple[int, bytes]  # number of a drone, and coefficients


class Danger(NamedTuple):
    """A violation of a rule by drones within a step.

    Attributes
    ----------
    step : the violation is between this step and the next
    part : piece of the step
    person : the person to whom they come too close, if any
    """

    step: int
    drones: tuple[int, ...]
    words: str
    part: int = 0
    person: int | None = None

    def __str__(self) -> str:
        who = " and ".join(map(str, self.drones))
        noun = "drones" if len(self.drones) > 1 else "drone"
        return f"step {self.step} to {self.step + 1}: {noun} {who} {self.words}"


def dangers(flown: Trajectory, known: dict[_Piece, str] | None = None) -> list[Danger]:
    """Returns the pieces in which flights break a rule of their scene; empty if they are safe.

    Walls are not checked for drones that may cut corners (`Motion.corner_cutting`): their plans do
    not keep clear of walls between the steps either.

    Parameters
    ----------
    known : a cache of what pieces of flights in the same scene enter, for flights that share pieces
    """
    matter = _in_matter(flown, {} if known is None else known)
    found = [*_between_drones(flown), *_near_people(flown), *matter]
    return sorted(found, key=lambda danger: (danger.step, danger.part, danger.drones))


def _between_drones(flown: Trajectory) -> Iterator[Danger]:
    rules, count = flown.problem.rules, flown.pieces.shape[1]
    ways = flown.between_drones
    if rules.none or not rules.separation or not len(ways):
        return
    pairs = list(combinations(range(len(flown.pieces)), 2))
    for k in np.flatnonzero(come_too_near(ways, rules)).tolist():
        step, part = divmod(k % count, flown.parts)
        yield Danger(step, pairs[k // count], f"come closer than the {rules}", part)


def _near_people(flown: Trajectory) -> Iterator[Danger]:
    """Yields the violations of the distance from people, wherever their `swerve` lets them be."""
    problem = flown.problem
    airspace, count = problem.airspace, flown.pieces.shape[1]
    if not airspace.people_aside:
        return
    for j, actor in enumerate(problem.actors):
        ways = flown.pieces[:, :, :3] - flown.walk_of(actor)
        near = come_too_near(ways.reshape(-1, 3, DEGREE + 1), airspace.rules_beside(actor))
        for k in np.flatnonzero(near).tolist():
            step, part = divmod(k % count, flown.parts)
            words = f"comes closer than {airspace.people_aside:g} m to {problem.person(j)}"
            yield Danger(step, (k // count,), words, part, j)


def come_too_near(ways: FloatArray, rules: CollisionRules) -> BoolArray:
    """Returns an array [n], True if vectors [n, 3, 6] break a separation at any moment.

    A separation that cannot be proved counts as broken.
    """
    # Polynomials that are all positive if and only if the separation is broken.
    if not rules.vertical:
        return ever_positive([(rules.separation - TOLERANCE) ** 2 - squared_length(ways)])
    most, z = rules.vertical - TOLERANCE, ways[:, 2]
    aside = (rules.separation - TOLERANCE) ** 2 - squared_length(ways[:, :2])
    return ever_positive([aside] if most >= LARGEST / 2 else [aside, most**2 - product(z, z)])


def _in_matter(flown: Trajectory, known: dict[_Piece, str]) -> Iterator[Danger]:
    """Yields the pieces in which drones come too close to matter, or leave the map or the
    airspace.
    """
    for i, (robot, path) in enumerate(zip(flown.problem.robots, flown.pieces, strict=True)):
        for k, piece in enumerate(path[:, :3]):
            key = i, piece.tobytes()
            if key not in known:
                known[key] = _entered(piece, flown.problem, robot.motion)
            if known[key]:
                step, part = divmod(k, flown.parts)
                yield Danger(step, (i,), known[key], part)


def _entered(piece: FloatArray, problem: Problem, motion: Motion) -> str:
    """Returns words for what a piece [3, 6] of a flight enters; empty if nothing, or if the drone
    stays.
    """
    workspace = problem.workspace
    if (piece == piece[:, :1]).all():
        return ""
    if not _is_free(piece, problem, workspace.forbidden, 0.0):
        return "leaves the map, enters a no-fly zone, or is too high"
    walls = workspace.columns
    if not (motion.corner_cutting or _is_free(piece, problem, walls, motion.clearance)):
        return "comes too close to solid matter"
    return ""


def _is_free(piece: FloatArray, problem: Problem, columns: Columns, clearance: float) -> bool:
    """Returns True if a piece of a flight is proved to pass only free cells.

    Parameters
    ----------
    piece : [3, 6] coefficients of x, y (m from the corner of the map) and z
    columns : the columns that close cells
    clearance : clearance above and below, m
    """

    def close(low: FloatArray, high: FloatArray) -> bool:
        """Returns True if a box [3], in cells and m, reaches into closed space, or off the map.

        Less than the tolerance of the rules does not count: a drone may touch the ceiling.
        """
        first = np.floor(low[:2] - _TOUCH).astype(np.int64)
        last = np.floor(high[:2] + _TOUCH).astype(np.int64)
        if (first < 0).any() or (last >= problem.height_map.shape).any():
            return True
        part = slice(None), slice(first[0], last[0] + 1), slice(first[1], last[1] + 1)
        below = columns.low[part] <= high[2] + clearance - TOLERANCE
        above = columns.high[part] >= low[2] - clearance + TOLERANCE
        return bool((below & above).any())

    size = problem.height_map.resolution
    parts = [piece / np.array([[size], [size], [1.0]])]
    for _ in range(_DEEPEST):
        if any(close(part[:, 0], part[:, 0]) for part in parts):
            return False
        open_ = [part for part in parts if close(part.min(axis=1), part.max(axis=1))]
        if not open_:
            return True
        parts = [half for part in open_ for half in parted(part)]
    return False


class Nearest(NamedTuple):
    """The closest approach of two drones, or of a drone and a person."""

    distance: float  # m
    t: float  # s since step 0
    first: int  # number of a drone
    second: int  # number of another drone, or of a person
    place: FloatArray  # [3] m, position of the first

    @property
    def is_too_near(self) -> bool:
        """True if the distance is less than the default for flown scenes."""
        return self.distance < SEPARATION - TOLERANCE

    @classmethod
    def of_people_without_rule(cls, flown: Trajectory, airspace: Airspace) -> Self | None:
        """Returns the closest approach of a drone to a person, if it is too close and no rule
        forbids it.

        Parameters
        ----------
        airspace : the airspace that the scene requires
        """
        nearest = None if airspace.people_aside else cls.of_people(flown)
        return nearest if nearest is not None and nearest.is_too_near else None

    @classmethod
    def of_drones(cls, flown: Trajectory) -> Self | None:
        """Returns the closest approach of two drones; None for one drone."""
        ways = flown.between_drones
        if not len(ways):
            return None
        first, second = (side.astype(np.int64) for side in np.triu_indices(len(flown.pieces), 1))
        return cls._of(flown, ways, first, second)

    @classmethod
    def of_people(cls, flown: Trajectory) -> Self | None:
        """Returns the closest horizontal approach of a drone to the middle of a person.

        The distance is less the `swerve` of that person. Returns None if the scene has no people.
        """
        found = []
        drones = np.arange(len(flown.pieces))
        for j, actor in enumerate(flown.problem.actors):
            ways = flown.pieces[:, :, :2] - flown.walk_of(actor)[:, :2]
            nearest = cls._of(
                flown, ways.reshape(-1, 2, DEGREE + 1), drones, np.full_like(drones, j)
            )
            found.append(nearest._replace(distance=actor.nearest(nearest.distance)))
        return min(found, key=lambda nearest: nearest.distance, default=None)

    @classmethod
    def _of(cls, flown: Trajectory, ways: FloatArray, first: IntArray, second: IntArray) -> Self:
        """Returns the smallest length of vectors [pairs N, d, 6], with its time and place."""
        peak = Peak.of(-squared_length(ways))
        pair, piece = divmod(peak.which, flown.pieces.shape[1])
        t = (piece + peak.share) * flown.piece_seconds
        place = flown.at(np.array([t])).place[int(first[pair])]
        distance = math.sqrt(max(-peak.value, 0.0))
        return cls(distance, t, int(first[pair]), int(second[pair]), place)
