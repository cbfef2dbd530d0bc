"""Chooses a place for each drone among several, such that all obey the collision rules.

This is a search for an independent set with one place per drone. Few scenes need more than the
first try; if no choice exists, counting usually proves it.
"""

from collections.abc import Sequence

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.problem.rules import CollisionRules

_MOST_TRIES = 2_000


class UndecidedError(Exception):
    """The search has found neither places nor a proof that none exist, after too many tries."""


def places_apart(rules: CollisionRules, places: Sequence[FloatArray]) -> list[int] | None:
    """Returns the number of a place for each robot, so that no two robots break a rule.

    Parameters
    ----------
    places : for each robot, the positions [n, 3] (m) that it may take

    Returns
    -------
    The first such choice that is found; None if none exists.

    Raises
    ------
    UndecidedError
        If the search gives up.
    """
    if rules.none:
        return [0] * len(places)
    return _Search(rules, places).found([np.ones(len(at), dtype=np.bool_) for at in places])


class _Search:
    """Depth-first search: the robot with the fewest places left is placed next."""

    def __init__(self, rules: CollisionRules, places: Sequence[FloatArray]) -> None:
        self._rules, self._places = rules, places
        # Robots with the same places are interchangeable: the numbers of their places increase.
        kinds = [at.tobytes() for at in places]
        self._alike = [
            [k for k, kind in enumerate(kinds) if kind == of_robot] for of_robot in kinds
        ]
        self._chosen: list[int | None] = [None] * len(places)
        self._tries = 0

    def found(self, left: list[BoolArray]) -> list[int] | None:
        """Returns a choice among the places left for each robot; None if there is none."""
        waiting = [robot for robot, place in enumerate(self._chosen) if place is None]
        if not waiting:
            return [place for place in self._chosen if place is not None]
        counts = [np.count_nonzero(left[robot]) for robot in waiting]
        for robot, count in zip(waiting, counts, strict=True):
            if count < sum(self._chosen[k] is None for k in self._alike[robot]):
                return None
        robot = waiting[int(np.argmin(counts))]
        for place in np.flatnonzero(left[robot]).tolist():
            self._tries += 1
            if self._tries > _MOST_TRIES:
                raise UndecidedError
            self._chosen[robot] = place
            found = self.found(self._beside(robot, place, left))
            if found is not None:
                return found
            self._chosen[robot] = None
        return None

    def _beside(self, robot: int, place: int, left: list[BoolArray]) -> list[BoolArray]:
        """Returns the places left for each robot once one of them is placed."""
        at, result = self._places[robot][place], list(left)
        for other, chosen in enumerate(self._chosen):
            if chosen is not None:
                continue
            open_ = left[other] & ~self._rules.too_near(self._places[other] - at)
            if other in self._alike[robot]:
                open_[: place + 1] = False
            result[other] = open_
        return result
