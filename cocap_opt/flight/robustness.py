"""Flights that deviate from the plan: people are late, early or displaced, a drone lags or is lost.

Drones do not react: they fly as planned, and hover before and after. A drone that is lost at a step
is absent from then on; its fall is not modelled. Minimum distances, and whether rules are
obeyed, are computed on the polynomials at every moment until the last drone has finished its
flight, not sampled: if one of two flights is late, their pieces are cut at the ends of both. J is
evaluated at some moments of each step.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cocap_opt.arithmetic import cosines, sines
from cocap_opt.data import FloatArray, IntArray
from cocap_opt.flight.bernstein import parted
from cocap_opt.flight.filming import Film, parts_of
from cocap_opt.flight.safety import come_too_near
from cocap_opt.flight.trajectory import (
    DEGREE,
    Trajectory,
    least_length,
)
from cocap_opt.problem import Actor, Airspace, CollisionRules

_FINE = 1e-4  # m; accuracy of a missing distance


class Outcome(NamedTuple):
    """The outcome of a flight that deviates from the plan.

    Attributes
    ----------
    reward : part of J that views make
    apart : minimum distance between two drones, m; inf for one drone
    aside : minimum horizontal distance between a drone and the middle of a person, m
    missing : amounts in m by which drones come closer than the rules allow, to "drones" and to
        "people"; amounts of 0 are left out
    """

    reward: float
    apart: float
    aside: float
    missing: Mapping[str, float]

    @property
    def too_near(self) -> frozenset[str]:
        """Kinds of things to which drones come closer than the rules allow: "drones", "people"."""
        return frozenset(self.missing)


class Robustness:
    """Flights whose people or drones deviate from the plan.

    Parameters
    ----------
    flown : flights in a scene whose steps have a duration
    """

    def __init__(self, flown: Trajectory) -> None:
        self._flown = flown
        self._problem = flown.problem
        self._parts = parts_of(flown.problem)
        self._ways = flown.pieces[:, :, :3]

    @cached_property
    def as_planned(self) -> Outcome:
        """The outcome if nobody deviates from the plan."""
        return self.with_people()

    def with_people(self, late: float = 0.0, left: float = 0.0) -> Outcome:
        """Returns the outcome if all people are late or displaced.

        Parameters
        ----------
        late : delay of the people in s; negative: they are early. They stand still before and after
            their walks
        left : displacement of the people to their left in m; negative: to their right
        """
        # Without airspace, since people may now stand where a drone starts.
        problem = self._problem.replace(
            actors=tuple(_moved(actor, left) for actor in self._problem.actors),
            airspace=Airspace(),
        )
        film = Film(problem, self._parts, self._lowest, late)
        reward = film.reward(film.coverages(self._flown.at(film.moments)))
        pieces, duration = late / self._flown.piece_seconds, self._ways.shape[1]
        drones = _punctual(self._ways, pieces, duration)
        walks = [_late(self._flown.walk_of(actor), pieces, duration)
                 for actor in problem.actors]  # fmt: skip
        return self._outcome(reward, self._flown.between_drones, drones, walks)

    def with_take(self, k: int) -> Outcome:
        """Returns the outcome if people walk as in a single take, for a scene with takes."""
        return Robustness(replace(self._flown, problem=self._problem.of_take(k))).as_planned

    def with_laggard(self, lag: float) -> Outcome:
        """Returns the worst outcome if any one drone is late by this many seconds (>= 0)."""
        found = [self._lagging(i, lag) for i in range(len(self._ways))]
        return Outcome(
            min(outcome.reward for outcome in found),
            min(outcome.apart for outcome in [self.as_planned, *found]),
            min(outcome.aside for outcome in found),
            {
                whom: max(outcome.missing.get(whom, 0.0) for outcome in found)
                for whom in sorted(frozenset().union(*(outcome.missing for outcome in found)))
            },
        )

    def with_lost(self, robot: int, step: int) -> Outcome:
        """Returns the outcome if a drone is lost at a step, and contributes nothing from then on.

        Its views before that count. All other drones fly as planned.
        """
        coverages = [*self._coverages]
        coverages[robot] = coverages[robot].copy()
        coverages[robot][step * self._parts :] = 0.0
        until = step * self._flown.parts
        way, others = self._ways[robot, :until], np.delete(self._ways, robot, axis=0)
        first, second = np.triu_indices(len(others), 1)
        between = [others[second] - others[first], others[:, :until] - way]
        drones = [*others, way]
        walks = [self._flown.walk_of(actor) for actor in self._problem.actors]
        return self._outcome(
            self._film.reward(coverages),
            np.concatenate([ways.reshape(-1, 3, DEGREE + 1) for ways in between]),
            drones,
            walks,
        )

    def _lagging(self, robot: int, lag: float) -> Outcome:
        """Returns the outcome if a drone is late, without the distances among the other drones."""
        pieces = lag / self._flown.piece_seconds
        way, others = self._ways[robot], np.delete(self._ways, robot, axis=0)
        longer = self._ways.shape[1] + int(np.ceil(pieces))  # until the late drone has finished
        between = _punctual(others, pieces, longer) - _late(way, pieces, longer)
        coverages = [*self._coverages]
        views = self._flown.at(np.maximum(self._film.moments - lag, 0.0))
        coverages[robot] = self._film.coverage(robot, views)
        drones = np.concatenate(
            [_late(way, pieces, longer)[None], _punctual(others, pieces, longer)]
        )
        walks = [_punctual(self._flown.walk_of(actor), pieces, longer)
                 for actor in self._problem.actors]  # fmt: skip
        return self._outcome(
            self._film.reward(coverages), between.reshape(-1, 3, DEGREE + 1), drones, walks
        )

    def _outcome(
        self,
        reward: float,
        between: FloatArray,
        drones: Iterable[FloatArray],
        walks: list[FloatArray],
    ) -> Outcome:
        """Returns the outcome, given vectors [n, 3, 6] between drones, and flights of drones among
        people.

        Parameters
        ----------
        drones : flight [n, 3, 6] of each drone; a lost drone has fewer pieces
        walks : walk [n, 3, 6] of each person
        """
        rules, airspace = self._problem.rules, self._problem.airspace
        missing, aside = dict[str, float](), np.inf
        if rules.separation and not rules.none and (lacks := missing_distance(between, rules)):
            missing["drones"] = lacks
        for actor, walk in zip(self._problem.actors, walks, strict=True):
            ways = np.concatenate([way - walk[: len(way)] for way in drones])
            aside = min(aside, actor.nearest(least_length(ways[:, :2])))
            if not airspace.people_aside:
                continue
            if lacks := missing_distance(ways, airspace.rules_beside(actor)):
                missing["people"] = max(missing.get("people", 0.0), lacks)
        return Outcome(reward, least_length(between), aside, missing)

    @property
    def _lowest(self) -> float:
        return float(self._ways[:, :, 2].min())

    @cached_property
    def _film(self) -> Film:
        return Film(self._problem, self._parts, self._lowest)

    @cached_property
    def _coverages(self) -> list[FloatArray]:
        """Coverage by each drone that does not lag."""
        return self._film.coverages(self._flown.at(self._film.moments))


def missing_distance(ways: FloatArray, rules: CollisionRules) -> float:
    """Returns the distance in m by which vectors [n, 3, 6] violate a separation; 0 if they obey it.

    They obey a separation reduced by this amount, with the same vertical distance. The result is
    too large by up to a tenth of a millimetre.
    """
    ways = ways[come_too_near(ways, rules)]
    kept, broken = 0.0, rules.separation
    while len(ways) and broken - kept > _FINE:
        middle = (kept + broken) / 2
        if come_too_near(ways, rules.replace(separation=middle)).any():
            broken = middle
        else:
            kept = middle
    return rules.separation - kept if len(ways) else 0.0


def _moved(actor: Actor, left: float) -> Actor:
    """Returns a person who walks this many metres to the left of the planned walk."""
    if not left:
        return actor
    poses = actor.poses.copy()
    poses[:, 0] -= left * sines(actor.poses[:, 3])
    poses[:, 1] += left * cosines(actor.poses[:, 3])
    return actor.replace(poses=poses)


def _punctual(pieces: FloatArray, late: float, count: int) -> FloatArray:
    """Returns pieces [.., 2 count, d, n] of flights [.., N, d, n], cut where late flights have
    their cuts.
    """
    return np.concatenate(parted(_at(pieces, np.arange(count)), late % 1), axis=-3)


def _late(pieces: FloatArray, late: float, count: int) -> FloatArray:
    """Returns pieces [.., 2 count, d, n] of late flights, cut like those of `_punctual`."""
    began = np.arange(count) - int(np.floor(late))
    before = parted(_at(pieces, began - 1), 1 - late % 1)[1]
    after = parted(_at(pieces, began), 1 - late % 1)[0]
    return np.concatenate([before, after], axis=-3)


def _at(pieces: FloatArray, numbers: IntArray) -> FloatArray:
    """Returns pieces by number; numbers before and after a flight give its first or last
    position.
    """
    last = pieces.shape[-3] - 1
    found: FloatArray = pieces[..., np.clip(numbers, 0, last), :, :].copy()
    found[..., numbers < 0, :, :] = pieces[..., :1, :, :1]
    found[..., numbers > last, :, :] = pieces[..., -1:, :, -1:]
    return found
