"""Takes drawn at random: the same people are late or early, displaced, faster or slower.

Each person has a separate draw in each take. Draws that lead into an obstacle, off the map or into
somebody of the same take are rejected and repeated; a person for whom all draws fail walks as
given. So if space is limited, the actual spread is slightly smaller than stated. If a given walk is
inside obstacles at some steps, those drawn are at no more steps.
"""

import logging
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.arithmetic import cosines, sines
from cocap_opt.data import FloatArray, ProblemError, require, whole, within
from cocap_opt.plausibility import depths_below
from cocap_opt.problem import Actor
from cocap_opt.problem.takes import PeopleInTakes, equal_chances
from cocap_opt.world.workspace import Workspace

log = logging.getLogger(__name__)

AS_GIVEN = "as given"  # name of the first take, in which everybody walks as given
MOST_TAKES = 100  # takes that are drawn; each adds a copy of the people
_TRIES = 50  # draws per person
_MOST_DELAY, _MOST_ASIDE = 3600.0, 100.0  # s, m: standard deviations
_SLOWEST = 0.1  # smallest speed that is drawn, as a share of the track's speed


class Spread(NamedTuple):
    """The spread of walks: standard deviations of normal distributions.

    Attributes
    ----------
    delay : time in s by which a person is late; early if the draw is negative
    aside : distance in m by which a person is displaced to the left, or to the right
    speed : share by which a person is faster or slower throughout; never below a tenth of the speed
    """

    delay: float = 0.0
    aside: float = 0.0
    speed: float = 0.0

    def require_for(self, step: float | None) -> None:
        """Checks the spread for a scene with steps of this length in s; None if unknown.

        Raises
        ------
        ProblemError
            If a number is out of range, all are 0, or delays require a step length; the message
            names the field.
        """
        within(self.delay, 0, _MOST_DELAY, "delay", "s")
        within(self.aside, 0, _MOST_ASIDE, "aside", "m")
        within(self.speed, 0, 1, "speed")
        require(any(self), "delay", "must be more than 0 if aside and speed are 0")
        if self.delay and step is None:
            raise ProblemError("delay: must be 0 s, as the scene defines no step length")


class _Walk(NamedTuple):
    """A draw: the deviation of one person's walk."""

    late: float  # steps
    left: float  # m
    speed: float  # relative to the track's speed

    def of(self, actor: Actor, workspace: Workspace, horizon: int) -> Actor:
        """Returns the person with this deviation.

        The person stands still before the track begins and after it ends; a track may continue
        after the scene. Feet keep their height above the ground.
        """
        poses = actor.poses.copy()
        poses[:, 3] = np.unwrap(poses[:, 3])  # yaw changes by at most half a turn between steps
        known = np.arange(float(len(poses)))
        then = self.speed * np.arange(horizon + 1.0) - self.late
        walked = np.column_stack([np.interp(then, known, column) for column in poses.T])
        before = _ground(workspace, walked)
        walked[:, 0] -= self.left * sines(walked[:, 3])
        walked[:, 1] += self.left * cosines(walked[:, 3])
        walked[:, 2] += _ground(workspace, walked) - before
        return actor.replace(poses=walked)

    def aside(self, farther: float, apart: float) -> "Iterator[_Walk]":
        """Yields walks outwards from the track, with this spacing (m).

        The last is displaced by the additional distance, so that no obstacle is between it and the
        track if all of them are free.
        """
        far = abs(self.left) + farther
        for share in np.linspace(0.0, 1.0, math.ceil(far / apart) + 1)[1:].tolist():
            yield self._replace(left=math.copysign(share * far, self.left))


def drawn_takes(
    actors: Sequence[Actor],
    workspace: Workspace,
    horizon: int,
    step: float | None,
    spread: Spread,
    count: int,
    rng: np.random.Generator,
    varied: Sequence[int] | None = None,
    barred: Callable[[Actor], bool] = lambda actor: False,
) -> PeopleInTakes:
    """Draws takes of some people, all equally probable; in the first, everybody walks as given.

    Parameters
    ----------
    actors : at least one
    step : length of a step, s; None if unknown
    spread : standard deviations
    count : number of takes, including the first
    varied : numbers of the people who may walk differently; None: all. The others are in all takes
    barred : returns True if a person must not walk this way

    Raises
    ------
    ProblemError
        If a number is out of range; the message names the field.
    """
    within(count, 2, MOST_TAKES, "count", "takes")
    spread.require_for(step)
    chosen = range(len(actors)) if varied is None else varied
    require(varied is None or len(chosen) > 0, "people", "must name a person, or be left out")
    for j in chosen:
        whole(j, "people")
        within(j, 0, len(actors) - 1, "people")
    require(len(set(chosen)) == len(chosen), "people", "must be different numbers")
    names = [AS_GIVEN, *(f"take {k}" for k in range(1, count))]
    fixed = [(j, actor) for j, actor in enumerate(actors) if j not in chosen]
    people = [(j, actors[j].replace(take=AS_GIVEN)) for j in chosen]
    stuck = []
    for name in names[1:]:
        there = [actor for _, actor in fixed]
        for j in chosen:
            found = _drawn(actors[j], there, workspace, horizon, step, spread, rng, barred)
            if found is None:
                stuck.append(f"person {j} in {name}")
            there.append(actors[j] if found is None else found)
            people.append((j, there[-1].replace(take=name)))
    if stuck:
        more = f" and {len(stuck) - 1} more" if len(stuck) > 1 else ""
        log.warning(
            "takes: %s%s walk as given: %d draws led into an obstacle, off the map, into "
            "somebody or too close to a drone's start; use a smaller spread",
            stuck[0], more, _TRIES,
        )  # fmt: skip
    numbers, drawn = zip(*fixed, *people, strict=True)
    return PeopleInTakes(equal_chances(names), drawn, numbers)


def _drawn(
    actor: Actor, there: Sequence[Actor], workspace: Workspace, horizon: int, step: float | None,
    spread: Spread, rng: np.random.Generator, barred: Callable[[Actor], bool],
) -> Actor | None:  # fmt: skip
    """Returns a person with a drawn walk, clear of those present; None if all draws fail."""
    inside = len(depths_below(workspace, actor, horizon))  # steps at which the given walk is, too
    for _ in range(_TRIES):
        late, left, faster = rng.standard_normal(3) * spread
        walk = _Walk(late / (step or 1.0), left, max(1.0 + faster, _SLOWEST))
        found = walk.of(actor, workspace, horizon)
        if barred(found) or any(_meet(found, other, horizon) for other in there):
            continue
        between = walk.aside(_radius(actor), workspace.height_map.resolution / 2)
        sides = (side.of(actor, workspace, horizon) for side in between)
        if all(
            _on_map(workspace, side) and len(depths_below(workspace, side, horizon)) <= inside
            for side in sides
        ):
            return found
    return None


def _meet(actor: Actor, other: Actor, horizon: int) -> bool:
    """Returns True if two people overlap at a step."""
    ways = (actor.poses - other.poses[: len(actor.poses)])[: horizon + 1, :3]
    aside = np.hypot(ways[:, 0], ways[:, 1]) < _radius(actor) + _radius(other)
    tallest = max(actor.shape.height, other.shape.height)
    return bool((aside & (np.abs(ways[:, 2]) < tallest)).any())


def _radius(actor: Actor) -> float:
    """Returns half of the narrower width of a body, in m: people who pass turn their shoulders."""
    corners = np.concatenate(actor.shape.faces())[:, :2]
    return float(np.ptp(corners, axis=0).min()) / 2


def _on_map(workspace: Workspace, actor: Actor) -> bool:
    cells = workspace.height_map.cells_of(actor.poses)
    return bool(((cells >= 0) & (cells < workspace.height_map.shape)).all())


def _ground(workspace: Workspace, poses: FloatArray) -> FloatArray:
    """Returns the altitude of the ground [n] at poses [n, 4]; off the map, that at its edge.

    If a map does not separate ground from obstacles, all altitudes are 0, so that nobody is lifted
    onto an obstacle.
    """
    height_map = workspace.height_map
    if not height_map.knows_ground:
        return np.zeros(len(poses))
    x, y = np.clip(height_map.cells_of(poses), 0, np.array(height_map.shape) - 1).T
    return np.asarray(height_map.ground[x, y])
