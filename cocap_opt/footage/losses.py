"""Flights in which a drone is lost: the remaining J, and people who are no longer seen by two
drones.

A drone that is lost at a step contributes nothing from that step on; all others fly as planned. The
earlier it is lost, the larger the loss. Its worst step is the last step at which the loss equals
that of a drone that never flew.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cocap_opt.data import BoolArray, ProblemError
from cocap_opt.flight.changes import ChangeRow, Changes
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.robustness import Outcome, Robustness
from cocap_opt.footage.quality import Quality
from cocap_opt.footage.summary import share
from cocap_opt.referee import rewards_of_move
from cocap_opt.text import in_ranges

_ROUNDING = 1e-12  # relative


class NoLonger(NamedTuple):
    """A person, in words, and the steps at which two drones see the person only in the original
    plan.
    """

    person: str
    steps: list[int]


class Seen(NamedTuple):
    """The people whom drones see.

    Attributes
    ----------
    by_two, by_none : shares of person-steps seen by two or more drones, and by none; None if nobody
        counts
    no_longer : people who are seen by two drones as planned, but not now
    """

    by_two: float | None
    by_none: float | None
    no_longer: list[NoLonger]

    def record(self) -> dict[str, Any]:
        """Returns plain data."""
        return {**self._asdict(), "no_longer": [found._asdict() for found in self.no_longer]}


class LossRow(NamedTuple):
    """The loss of a drone at a step, and the rest of the flight."""

    lost_drone: int
    lost_step: int
    left: ChangeRow
    seen: Seen


_NOTHING = dict.fromkeys(("lost_drone", "lost_step", *Seen._fields))


class WhatIf(NamedTuple):
    """The changes of a flight, and the losses of its drones.

    Attributes
    ----------
    changes : rows of the changes; the first is the flight as planned
    seen : people who are seen in the flight as planned
    losses : rows of the losses, drone by drone, each at its worst step or at the requested steps
    """

    changes: list[ChangeRow]
    seen: Seen
    losses: list[LossRow]

    def records(self) -> list[dict[str, Any]]:
        """Returns plain data: a row per change, followed by a row per loss.

        Columns are those of `ChangeRow`, then `lost_drone` and `lost_step`, and those of `Seen`.
        They are None except in rows of lost drones; those of `Seen` are also given for the flight
        as planned.
        """
        planned, *others = ({**row._asdict(), **_NOTHING} for row in self.changes)
        lost = (
            {
                **row.left._asdict(), "lost_drone": row.lost_drone, "lost_step": row.lost_step,
                **row.seen.record(),
            }
            for row in self.losses
        )  # fmt: skip
        return [{**planned, **self.seen.record()}, *others, *lost]


def what_if(flight: Flight, changes: Changes, lost: Sequence[int] | None = None) -> WhatIf:
    """Returns the rows of a flight under each change, and with each drone lost.

    Parameters
    ----------
    lost : steps at which drones are lost; None: each at its worst step

    Raises
    ------
    ProblemError
        If a change is 0, or longer than the flight; the message is one line.
    """
    losses = Losses(flight)
    return WhatIf(changes.rows(flight), losses.seen(losses.as_planned), list(losses.rows(lost)))


def steps_in_words(steps: Sequence[int]) -> str:
    """Returns increasing steps in words, e.g. "step 3" or "steps 3-5, 8"."""
    return f"step{'' if len(steps) == 1 else 's'} {in_ranges(steps)}"


class Losses:
    """The losses of each drone of a flight.

    Parameters
    ----------
    flight : flight of a plan that obeys the rules
    """

    def __init__(self, flight: Flight) -> None:
        self._flight, self._problem = flight, flight.flown.problem
        self._robustness = Robustness(flight.flown)

    def rows(self, steps: Sequence[int] | None = None) -> Iterator[LossRow]:
        """Yields a row for each drone and step at which it is lost; None: its worst step.

        Raises
        ------
        ProblemError
            If a step does not exist.
        """
        last = self._problem.horizon
        for step in steps or ():
            if not 0 <= step <= last:
                raise ProblemError(f"lost: must be steps of the plan, 0..{last}, not {step}")
        planned = self._robustness.as_planned.reward + self._flight.verdict.reward_moves
        for robot in range(len(self._problem.robots)):
            for step in [self.worst_step(robot)] if steps is None else steps:
                words = f"drone {robot} lost at step {step}"
                outcome, moves = self._lost(robot, step)
                left = ChangeRow.of(self._flight, words, outcome, moves, planned)
                yield LossRow(robot, step, left, self.seen(self._seen_without(robot, step)))

    def worst_step(self, robot: int) -> int:
        """Returns the last step at which the loss of a drone costs as much as at any other step."""
        first, last = 0, self._problem.horizon
        least = self._reward(robot, 0)
        # The remaining J does not fall from step to step, as rewards of views and moves are >= 0.
        while first < last:
            middle = (first + last + 1) // 2
            if self._reward(robot, middle) <= least + _ROUNDING * abs(least):
                first = middle
            else:
                last = middle - 1
        return first

    def _reward(self, robot: int, step: int) -> float:
        outcome, moves = self._lost(robot, step)
        return outcome.reward + moves

    def _lost(self, robot: int, step: int) -> tuple[Outcome, float]:
        """Returns the outcome if a drone is lost at a step, and its rewards for moves before that
        step.
        """
        path, objective = self._flight.plan.paths[robot], self._problem.objective
        after = zip(path[step:], path[step + 1 :], strict=False)
        gone = sum(sum(rewards_of_move(objective, a, b)) for a, b in after)
        outcome = self._robustness.with_lost(robot, step)
        return outcome, self._flight.verdict.reward_moves - gone

    @cached_property
    def _quality(self) -> Quality:
        return Quality.of(self._problem, self._flight.plan)

    @property
    def as_planned(self) -> BoolArray:
        """An array [T+1, R, A], True if a drone sees a person."""
        return self._quality.seen

    def _seen_without(self, robot: int, step: int) -> BoolArray:
        seen = self._quality.seen.copy()
        seen[step:, robot] = False
        return seen

    def seen(self, seen: BoolArray) -> Seen:
        """Returns who is seen, given which drones see which people [T+1, R, A]."""
        counts, views = self._quality.counts, seen.sum(axis=1)
        counted = views[counts]
        chances = np.broadcast_to(self._quality.chances, counts.shape)[counts]
        gone = counts & (self._quality.views >= 2) & (views < 2)
        return Seen(
            by_two=share(counted >= 2, chances) if len(counted) else None,
            by_none=share(counted == 0, chances) if len(counted) else None,
            no_longer=[
                NoLonger(self._quality.people[j], np.flatnonzero(gone[:, j]).tolist())
                for j in np.flatnonzero(gone.any(axis=0)).tolist()
            ],
        )
