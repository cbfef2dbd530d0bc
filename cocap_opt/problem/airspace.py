"""Airspace that is closed although it is empty: no-fly zones, above the ceiling, and near
people.
"""

from collections.abc import Iterable

import numpy as np

from cocap_opt.data import LARGEST, BoolArray, Data, FloatArray, require, within
from cocap_opt.problem.actor import Actor
from cocap_opt.problem.rules import TOLERANCE, CollisionRules
from cocap_opt.world.workspace import Mesh


class Airspace(Data, frozen=True):
    """The limits of the airspace in which drones may fly, at every moment.

    No-fly zones and the ceiling are checked like solid matter, cell by cell: a cell that a zone
    covers in part is closed between the zone's lower and upper height, inclusive. People walk
    straight from pose to pose within a step, or leave this walk by no more than their `swerve`, by
    which drones keep a larger distance from them.

    Attributes
    ----------
    no_fly : solids that no drone may enter; they hide nobody
    ceiling : m above the datum of the map, like `Motion.layers`; None: there is none
    people_aside : minimum horizontal distance from the middle of a person, m; 0: none
    people_above : m above the head, or below the feet, beyond which `people_aside` no longer
        applies; None: it applies at any height
    people_stray : share of a move by which drones may be ahead of a constant speed or behind it;
        moves keep a correspondingly larger distance from people
    """

    no_fly: tuple[Mesh, ...] = ()
    ceiling: float | None = None
    people_aside: float = 0.0
    people_above: float | None = None
    people_stray: float = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ceiling is not None:
            within(self.ceiling, -LARGEST, LARGEST, "ceiling", "m")
        within(self.people_aside, 0, LARGEST, "people_aside", "m")
        least = 2 * TOLERANCE
        kept = self.people_aside == 0 or self.people_aside > least
        require(
            kept, "people_aside", f"must be 0 or more than {least:g} m, not {self.people_aside!r}"
        )
        if self.people_above is not None:
            within(self.people_above, 0, LARGEST, "people_above", "m")
            require(self.people_aside > 0, "people_above", "must be None if people_aside is 0")
        within(self.people_stray, 0, 1, "people_stray", "of a move")

    def __str__(self) -> str:
        return ", ".join(self._words())

    def _words(self) -> Iterable[str]:
        if self.no_fly:
            yield f"{len(self.no_fly)} no-fly zone{'s' if len(self.no_fly) > 1 else ''}"
        if self.ceiling is not None:
            yield f"ceiling {self.ceiling:g} m"
        if self.people_aside:
            yield self.told_people

    @property
    def told_people(self) -> str:
        """The required distance from people, in words; empty if there is none."""
        over = "" if self.people_above is None else f" or {self.people_above:g} m above"
        return f"{self.people_aside:g} m from people{over}"

    def near_person(
        self, actor: Actor, t: int, before: FloatArray, after: FloatArray | None = None
    ) -> BoolArray:
        """Returns an array [..], True if drones are too close to a person.

        Parameters
        ----------
        before, after : [.., 3] m, positions of drones at steps t and t+1; without `after`, only
            step t counts
        """
        if not self.people_aside:
            return np.zeros(before.shape[:-1], dtype=np.bool_)
        rules, middles = self.rules_beside(actor), actor.middles
        if after is None:
            return rules.too_near(before - middles[t])
        scale = self._scale(rules, after - before) if self.people_stray else 1.0
        return rules.pass_too_near((before - middles[t]) * scale, (after - middles[t + 1]) * scale)

    def _scale(self, rules: CollisionRules, moves: FloatArray) -> FloatArray:
        """Returns factors [.., 3] by which distances from people shrink if moves [.., 3] (m) may
        stray.

        A drone that keeps its distance in the space shrunk by these factors keeps the true distance
        however its moves stray.
        """
        aside = np.hypot(moves[..., 0], moves[..., 1])
        least = np.array([rules.separation, rules.separation, rules.vertical]) - TOLERANCE
        spare = self.people_stray * np.stack([aside, aside, np.abs(moves[..., 2])], axis=-1)
        return np.asarray(least / (least + spare))

    def rules_beside(self, actor: Actor) -> CollisionRules:
        """Returns the rules between a drone and the middle of a body on its straight walk."""
        half = actor.shape.height / 2
        over = LARGEST if self.people_above is None else self.people_above + half
        return CollisionRules(
            separation=self.people_aside + actor.swerve, vertical=min(over, LARGEST)
        )
