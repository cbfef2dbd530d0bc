"""The demands that smooth flights may put on drones, whatever plan they fly.

The coefficients of a smooth flight (`smooth`) between two steps are linear in the moves before, in
and after that step. So its rates are largest if each of the three moves is as long as possible, and
are then the same for all drones, up to that length. The largest demand arises when a drone stops at
both ends of its longest move: 15/8 of the average rate, and an acceleration of 10 / sqrt(3) moves
per squared step. If blends are shorter, near people who walk, rates grow further, and accelerations
have no useful bound.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from cocap_opt.data import LARGEST
from cocap_opt.flight.rests import LAWS, TURNS, Rests
from cocap_opt.problem import Limits, Motion, Robot, SceneData, Stride
from cocap_opt.problem.motion import ROUNDING
from cocap_opt.problem.robot import rounded_up
from cocap_opt.world.workspace import HeightMap

RATE, ACCELERATION = 15 / 8, 10 / math.sqrt(3)  # peaks if a drone stops at both ends
# peak relative to the average rate, from a stop to a sharp turn, one of them shortened
SHORTENED = 2.94
_ANGLES = "yaw_rate", "gimbal_rate"
_UPRIGHT = "climb", "descent"


class _Strain(NamedTuple):
    """The largest demand of any smooth flight on a drone.

    Attributes
    ----------
    kind : a field of `Limits`
    reach : the longest move in a step, m or rad
    limit : limit of its rate, in m, rad and s
    """

    kind: str
    reach: float
    limit: float

    def even(self, step: float) -> float:
        """Returns the rate of a straight flight, which is constant; for accelerations, none."""
        return 0.0 if self.kind == "acceleration" else self.reach / step

    def most(self, step: float) -> float:
        """Returns the largest rate or acceleration, for steps of the given length in s."""
        if self.kind == "acceleration":
            return ACCELERATION * self.reach / step**2
        return RATE * self.reach / step

    @property
    def step(self) -> float:
        """Shortest step (s) that obeys the limit."""
        if self.kind == "acceleration":
            return math.sqrt(ACCELERATION * self.reach / self.limit)
        return RATE * self.reach / self.limit


def sufficient_step(problem: SceneData, is_smooth: bool, shortened: bool = False) -> float:
    """Returns the length of a step (s) with which flights of any plan obey all limits.

    Parameters
    ----------
    is_smooth : False: straight flights, which have a constant speed in each step and no known
        accelerations
    shortened : True: also smooth flights with shortened blends, except for their accelerations
    """
    found = [strain for robot in problem.robots for strain in _strains(problem, robot)]
    rates = [strain for strain in found if strain.kind != "acceleration"]
    even = [strain.reach / strain.limit for strain in rates]
    steps = [strain.step for strain in found] if is_smooth else even
    if shortened:
        steps += [SHORTENED * strain.reach / strain.limit for strain in rates]
    return rounded_up(max(steps, default=0.0))


def strains(problem: SceneData) -> list[str]:
    """Returns a line for each kind of drone that may exceed limits in smooth flights.

    This is not a proof that a plan cannot be flown: smooth flights are checked individually. If
    all drones can rest at each step, there are no lines.
    """
    if problem.step is None or any(_may_rest(problem, law) for law in LAWS):
        return []
    kinds = dict[tuple[Motion, Limits | None, tuple[float, ...]], list[int]]()
    for i, robot in enumerate(problem.robots):
        kinds.setdefault((robot.motion, robot.limits, robot.camera.tilts), []).append(i)
    words = ((_words(problem, problem.robots[who[0]]), who) for who in kinds.values())
    return [f"{_who(who)} {told}" for told, who in words if told]


def _may_rest(problem: SceneData, law: Rests) -> bool:
    """Returns True if all drones can make all their moves from rest to rest, by some law."""
    for robot in problem.robots:
        stride = law.stride(robot.limits or Limits(), problem.step or 0.0)
        moves = rises(problem.height_map, robot.motion)
        within = robot.motion.stride or Stride()
        if within.within(stride) != within and not all(
            stride.allows(aside, np.array(rise)) for aside, rise in moves
        ):
            return False
        turns = (strain for strain in _strains(problem, robot) if strain.kind in _ANGLES)
        if any(TURNS.rate * turn.even(problem.step or 0.0) > turn.limit for turn in turns):
            return False
    return True


def _strains(problem: SceneData, robot: Robot) -> Iterator[_Strain]:
    """Yields the strain of each kind with a known limit."""
    motion, tilts = robot.motion, robot.camera.tilts
    rise = _highest_move(problem, motion)
    reaches = {
        "speed": motion.radius * problem.height_map.resolution * math.sqrt(2),
        "climb": rise,
        "descent": rise,
        "acceleration": longest_move(problem, motion),
        "yaw_rate": min(motion.turn, motion.headings // 2) * math.tau / motion.headings,
        "gimbal_rate": motion.largest_tilt(tilts),
    }
    for kind, reach in reaches.items():
        limit = getattr(robot.limits, kind, None)
        if limit is not None and reach > 0:
            yield _Strain(kind, reach, limit)


def _words(problem: SceneData, robot: Robot) -> str:
    """Returns a message that names the limits that a drone may exceed in smooth flights, and
    sufficient steps.
    """
    step = problem.step or 0.0
    beyond = [
        strain
        for strain in _strains(problem, robot)
        if strain.most(step) > strain.limit * (1 + ROUNDING)
    ]
    if not beyond:
        return ""
    steep = next(
        filter(None, (steep_ground(problem, robot, strain.kind, True) for strain in beyond)), ""
    )
    asks = " and ".join(_ask(strain, step) for strain in beyond)
    motion, limits = robot.motion, robot.limits or Limits()
    acceleration = limits.acceleration
    shortest = motion.shortest_move(problem.height_map.resolution)
    heavy = acceleration is not None and 2 * shortest > acceleration * step**2 * (1 + ROUNDING)
    start = (
        f"cannot move from rest within a step: the shortest move, {shortest:.4g} m, needs "
        f"{2 * shortest / step**2:.4g} m/s2; "
        if heavy and math.isfinite(shortest)
        else ""
    )
    straight = any(strain.even(step) > strain.limit * (1 + ROUNDING) for strain in beyond)
    flights = "even in straight flights; in smooth ones" if straight else "in smooth flights:"
    return (
        f"{start}may exceed limits {flights} up to {asks}; steps of "
        f"{rounded_up(max(strain.step for strain in beyond)):g} s"
        f"{_nearer_layers(beyond, step, motion)} "
        f"suffice for all flights but those that change speed faster near people{steep}"
    )


def _ask(strain: _Strain, step: float) -> str:
    scale, unit = (180 / math.pi, "deg/s") if strain.kind in _ANGLES else (1.0, "m/s")
    unit = "m/s2" if strain.kind == "acceleration" else unit
    kind = strain.kind.replace("_", " ")
    return f"{kind} {strain.most(step) * scale:.3g} {unit} (limit {strain.limit * scale:.3g})"


def steep_ground(problem: SceneData, robot: Robot, kind: str, is_smooth: bool) -> str:
    """Returns a message if the ground causes a climb or a descent that is too fast, with a remedy.

    It is empty if layers do not follow the ground, or if the distance between layers is itself too
    large.

    Parameters
    ----------
    is_smooth : False: a straight flight, which climbs at a constant rate from step to step
    """
    rate = RATE if is_smooth else 1.0
    limit = getattr(robot.limits, kind, None)
    if kind not in _UPRIGHT or limit is None or not problem.height_map.is_uneven:
        return ""
    layers = robot.motion.largest_climb
    ground = _highest_move(problem, robot.motion) - layers
    if ground <= 0 or rate * layers > limit * (problem.step or 0.0) * (1 + ROUNDING):
        return ""
    return (
        f"; the cause is the ground: layers above it rise or fall with it, by up to {ground:.3g} m "
        'per move; flight = "above-sea" in a recipe makes them level'
    )


def _nearer_layers(beyond: list[_Strain], step: float, motion: Motion) -> str:
    """Returns advice to place layers closer together, if only climbs and descents are too fast;
    else empty.
    """
    if any(strain.kind not in _UPRIGHT for strain in beyond):
        return ""
    ground = max(strain.reach for strain in beyond) - motion.largest_climb
    apart = min(strain.limit for strain in beyond) * step / RATE - ground
    if apart <= 0 or not motion.largest_climb:
        return ""
    return f", or layers at most {math.floor(100 * apart) / 100:g} m apart,"


def _who(drones: list[int]) -> str:
    *most, last = map(str, drones)
    return f"drones {', '.join(most)} and {last}" if most else f"drone {last}"


def longest_move(problem: SceneData, motion: Motion) -> float:
    """Returns the length (m) in space of the longest move of a motion.

    It may be a move that no drone can make, e.g. down from the lowest layer, or into a wall. Layers
    above the ground follow the ground.
    """
    space = (motion.stride or Stride()).space
    longest = max(math.hypot(aside, rise) for aside, rise in _moves(problem, motion))
    return longest if space is None else min(longest, space)


def rises(height_map: HeightMap, motion: Motion) -> Iterator[tuple[float, float]]:
    """Yields the horizontal length (m) of moves, and the largest amount by which they rise or fall.

    These are all moves that cells and layers allow, regardless of the stride.
    """
    edge, ground = height_map.resolution, height_map.flight_datum
    climb, radius = motion.largest_climb, motion.radius
    if ground is None:
        yield radius // motion.spacing * motion.spacing * edge * math.sqrt(2), climb
        return
    width, depth = ground.shape
    for i in range(0, min(radius, width - 1) + 1, motion.spacing):
        for j in range(0, min(radius, depth - 1) + 1, motion.spacing):
            ahead = ground[i:, j:] - ground[: width - i, : depth - j]
            across = ground[i:, : depth - j] - ground[: width - i, j:]
            slope = max(float(np.abs(ahead).max()), float(np.abs(across).max()))
            yield math.hypot(i * edge, j * edge), slope + climb


def _highest_move(problem: SceneData, motion: Motion) -> float:
    """Returns the largest height (m) by which a motion's moves rise or fall."""
    return max(rise for _, rise in _moves(problem, motion))


def _moves(problem: SceneData, motion: Motion) -> Iterator[tuple[float, float]]:
    """Yields the moves of `rises`, no longer than the stride."""
    stride = motion.stride or Stride()
    bounds = [LARGEST if most is None else most for most in (stride.aside, stride.upright)]
    space = LARGEST if stride.space is None else stride.space
    for aside, rise in rises(problem.height_map, motion):
        yield min(aside, bounds[0], space), min(rise, bounds[1], space)
