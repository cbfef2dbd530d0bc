"""Moments at which drones of a plan come close to each other, as they fly in the player."""

from collections.abc import Sequence
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.flight.trajectory import Trajectory
from cocap_opt.problem import Plan, Problem, VertexConflict

_ROUNDING = 1e-6  # of distances
_PARTS = 8  # of a step, between which smooth flights are taken to be straight

Data = dict[str, Any]


class Approaches:
    """The nearest that two drones come, at any moment and in each step.

    Parameters
    ----------
    there : numbers of the drones that are there
    flown : their smooth flight, None if they fly straight from step to step
    """

    def __init__(
        self, problem: Problem, plan: Plan, there: Sequence[int], flown: Trajectory | None
    ) -> None:
        self._problem, self._plan, self._there, self._flown = problem, plan, there, flown
        self._pairs = list(combinations(there, 2))

    def near(self) -> list[Data]:
        """Returns the nearest that two drones come in each step, where that is close.

        Close is nearer than half a cell, in scenes whose rules have no separation; who keeps one
        is far enough. Pairs in conflict are not told.
        """
        cell = self._problem.height_map.resolution
        if not self._pairs or self._problem.rules.separation:
            return []
        shares, distances = self._nearest
        apart = np.where(self._in_conflict(), np.inf, distances)
        close = cell / 2 * (1 - _ROUNDING)
        return [
            _approach(self._pairs[k], t + float(shares[k, t]), float(apart[k, t]))
            for t, k in enumerate(apart.argmin(axis=0).tolist())
            if apart[k, t] < close
        ]

    def closest(self) -> float | None:
        """Returns the least distance (m) of two drones at any time; None if there are no two."""
        return float(self._nearest[1].min()) if self._pairs else None

    @cached_property
    def _nearest(self) -> tuple[FloatArray, FloatArray]:
        """When pairs are nearest in each step, as shares of it, and how near (m): [P, T] each."""
        at, parts = self._places()
        found = []
        for k, i in enumerate(self._there[:-1]):
            ways = at[self._there[k + 1 :]] - at[i]
            found.append(self._problem.rules.closest(ways[:, :-1], ways[:, 1:]))
        shares, distances = (
            np.concatenate(rows).reshape(-1, self._problem.horizon, parts)
            for rows in zip(*found, strict=True)
        )
        part = distances.argmin(axis=2)[..., None]
        share = (part + np.take_along_axis(shares, part, axis=2)) / parts
        return share[..., 0], np.take_along_axis(distances, part, axis=2)[..., 0]

    def _places(self) -> tuple[FloatArray, int]:
        """Returns where drones are [R, T parts + 1, 3] (m), and in how many parts a step is cut.

        Between those moments a smooth flight is nearly straight.
        """
        paths = self._plan.paths
        if self._flown is None:
            flights = zip(self._problem.robots, paths, strict=True)
            return np.array([self._problem.where(*flight) for flight in flights]), 1
        moments = np.linspace(0.0, self._flown.seconds, self._problem.horizon * _PARTS + 1)
        return self._flown.at(moments).place.reshape(len(paths), -1, 3), _PARTS

    def _in_conflict(self) -> BoolArray:
        """Returns an array [P, T], true for pairs in conflict in a step, or at its ends."""
        found = np.zeros((len(self._pairs), self._problem.horizon), dtype=np.bool_)
        for conflict in self._plan.conflicts(self._problem):
            first = max(conflict.t - 1, 0) if isinstance(conflict, VertexConflict) else conflict.t
            found[self._pairs.index(conflict.robots), first : conflict.t + 1] = True
        return found


def _approach(pair: tuple[int, int], time: float, apart: float) -> Data:
    words = f"drones {pair[0]} and {pair[1]} come within {apart:.2g} m of each other"
    return {"time": round(time, 3), "robots": list(pair), "words": words}
