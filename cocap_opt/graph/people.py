"""The people of a problem, to whom drones keep a distance."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.problem import Actor, Airspace


class Meeting(NamedTuple):
    """A person at a step, to whom drones must not come too near from then to the next one."""

    actor: Actor
    airspace: Airspace
    t: int

    @property
    def at(self) -> tuple[float, float]:
        """Where the person is (m)."""
        x, y, *_ = self.actor.poses[self.t].tolist()
        return x, y

    @property
    def reach(self) -> float:
        """Least distance (m), and how far the person walks in the step."""
        here = self.actor.poses[self.t, :2]
        there = self.actor.poses[min(self.t + 1, len(self.actor.poses) - 1), :2]
        return self.airspace.people_aside + math.hypot(*(there - here))

    def near(self, before: FloatArray, after: FloatArray | None = None) -> BoolArray:
        """Returns which drones are too near, as `Airspace.near_person` does."""
        return self.airspace.near_person(self.actor, self.t, before, after)


class People(NamedTuple):
    """The people of a problem, until its horizon."""

    actors: tuple[Actor, ...]
    airspace: Airspace
    horizon: int

    @property
    def meetings(self) -> Iterator[Meeting]:
        """All people at all steps."""
        for actor in self.actors:
            for t in range(self.horizon + 1):
                yield Meeting(actor, self.airspace, t)
