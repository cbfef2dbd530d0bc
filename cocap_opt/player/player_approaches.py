"""Moments of the player's flight at which drones come close to each other or to people.

Distances are computed from the flight's polynomials, as in `cocap-opt fly` and the crew's sheet.
"""

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from cocap_opt.data import BoolArray, FloatArray
from cocap_opt.flight.bernstein import Peak, squared_length
from cocap_opt.flight.safety import Nearest
from cocap_opt.flight.trajectory import DEGREE, Trajectory
from cocap_opt.problem import BODY, SEPARATION, Plan, Problem, VertexConflict

_ROUNDING = 1e-6  # relative tolerance of distances
_DIGITS = 4  # decimals of distances (m)

Data = dict[str, Any]


class Approaches:
    """The closest approaches of two drones, and of a drone and a person, in each step and overall.

    Parameters
    ----------
    there : numbers of the drones that take part
    flown : their flight as it is shown
    """

    def __init__(
        self, problem: Problem, plan: Plan, there: Sequence[int], flown: Trajectory
    ) -> None:
        self._problem, self._plan = problem, plan
        self._there, self._flown = there, flown
        self._pairs = list(combinations(there, 2))
        self._nearness = _nearness(flown, there)

    def near(self) -> list[Data]:
        """Returns moments at which drones are closer to each other or to people than they should.

        Approaches to people have the number of the `person`.
        """
        return [*self._near_each_other(), *self._near_people()]

    def _near_people(self) -> list[Data]:
        """Returns the closest approach of a drone to a person, if it is too close without a rule.

        Too close means closer than drones should fly, seen from above.
        """
        if not self._there:
            return []
        flown = self._flown.with_pieces(self._flown.pieces[list(self._there)])
        found = Nearest.of_people_without_rule(flown, self._problem.airspace)
        if found is None:
            return []
        drone, apart = self._there[found.first], round(found.distance, _DIGITS)
        who = self._problem.person(found.second)
        return [
            {
                "time": round(found.t / flown.step, 3),
                "robots": [drone],
                "person": found.second,
                "apart": apart,
                "words": f"drone {drone} comes within {round(apart, 2):g} m of {who}",
            }
        ]

    def _near_each_other(self) -> list[Data]:
        """Returns the closest approach of two drones in each step in which they nearly touch.

        Nearly touching means closer than the width of a drone, in scenes whose rules have no
        separation; drones that keep a separation are far enough apart. If no drones nearly touch,
        it is the closest approach of all steps, if that is closer than drones should fly. Pairs in
        conflict are left out.
        """
        if not self._pairs or self._problem.rules.separation:
            return []
        free = ~self._in_conflict()
        moments = [
            self._nearest(np.flatnonzero(free[:, t]), t, t + 1)
            for t in np.flatnonzero(free.any(axis=0)).tolist()
        ]
        touching = [moment for moment in moments if _is_less(moment["apart"], BODY)]
        least = sorted(moments, key=lambda moment: float(moment["apart"]))[:1]
        shown = touching or [moment for moment in least if _is_less(moment["apart"], SEPARATION)]
        return [moment | {"words": _words(moment)} for moment in shown]

    def closest(self, straight: Trajectory) -> Data | None:
        """Returns the closest approach of any two drones; None if there are fewer than two.

        `apart` is their distance (m) in the flight that is shown, `straight` that in straight lines
        from step to step. `kept` is the distance (m) that needs no warning, or `above` in height:
        the separation of the scene's rules or, if these let bodies touch, that of scenes that are
        to be flown. `isKept` is true if the drones keep it, as plans without conflicts keep rules.
        `body` is the width of a drone (m).
        """
        if not self._pairs:
            return None
        found = self._nearest(np.arange(len(self._pairs)), 0, self._problem.horizon)
        there = sorted({i for pair in self._pairs for i in pair})
        legs = -Peak.of(_nearness(straight, there).reshape(-1, 2 * DEGREE + 1)).value
        rules = self._problem.rules
        is_wide = rules.separation >= BODY and (not rules.vertical or rules.vertical >= BODY)
        return found | {
            "straight": round(math.sqrt(max(legs, 0.0)), _DIGITS),
            "kept": rules.separation if is_wide else SEPARATION,
            "above": rules.vertical if is_wide else 0.0,
            "isKept": is_wide or not _is_less(found["apart"], SEPARATION),
            "body": BODY,
        }

    def _nearest(self, pairs: Any, begin: int, end: int) -> Data:
        """Returns the closest approach of some pairs between two steps, with its distance (m)."""
        nearness = self._nearness[pairs, begin:end]
        parts = nearness.shape[2]
        peak = Peak.of(nearness.reshape(-1, 2 * DEGREE + 1))
        row, piece = divmod(peak.which, (end - begin) * parts)
        return {
            "time": round(begin + (piece + peak.share) / parts, 3),
            "robots": list(self._pairs[pairs[row]]),
            "apart": round(math.sqrt(max(-peak.value, 0.0)), _DIGITS),
        }

    def _in_conflict(self) -> BoolArray:
        """Returns an array [P, T], true for pairs in conflict during a step or at its ends."""
        found = np.zeros((len(self._pairs), self._problem.horizon), dtype=np.bool_)
        for conflict in self._plan.conflicts(self._problem):
            first = max(conflict.t - 1, 0) if isinstance(conflict, VertexConflict) else conflict.t
            found[self._pairs.index(conflict.robots), first : conflict.t + 1] = True
        return found


def _nearness(flown: Trajectory, there: Sequence[int]) -> FloatArray:
    """Returns minus the squared distances of pairs, as polynomials [P, T, parts, 11]."""
    pieces = flown.pieces[list(there), :, :3]
    first, second = np.triu_indices(len(there), 1)
    nearness: FloatArray = -squared_length(pieces[second] - pieces[first])
    return nearness.reshape(len(first), flown.problem.horizon, flown.parts, 2 * DEGREE + 1)


def _is_less(distance: float, least: float) -> bool:
    """Returns True if a distance (m) is less than another by more than rounding."""
    return distance < least * (1 - _ROUNDING)


def _words(moment: Data) -> str:
    (first, second), apart = moment["robots"], round(moment["apart"], 2)
    if not apart:
        return f"drones {first} and {second} collide"
    return f"drones {first} and {second} come within {apart:g} m of each other"
