"""The robustness of flights, as a table: J, least distances and rules under each change."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.experiments.results.flights import Flight
from cocap_opt.experiments.results.printing import Record
from cocap_opt.flight.delays import bearable_delay
from cocap_opt.flight.robustness import Outcome, Robustness
from cocap_opt.problem import CollisionRules

KEPT, NONE = "kept", "none"
MOST_ASIDE = 100.0  # m


class Changes(NamedTuple):
    """Changes of a plan, each of which makes a row.

    Attributes
    ----------
    late : s, by which people are late, and early
    aside : m, by which people walk to the left of where they would, and to the right
    lag : s, by which any one drone is late
    """

    late: Sequence[float] = (1.0, 2.0)
    aside: Sequence[float] = (1.0,)
    lag: Sequence[float] = (0.5, 1.0, 2.0)

    def rows(self, flight: Flight) -> list[Record]:
        """Returns a row per change; of a drone that lags it has the worst, whichever drone it is.

        Columns: `change`, `reward` (J between the steps, too), `share` (of that of the flight as
        planned; None if that is 0), `least_distance` (m, between drones; None for one drone),
        `people_distance` (m, to the middle of anybody, from above; None where the scene asks for
        none), `rules` (kept, or to whom drones come too near; none where the scene has none
        between the steps).

        Raises
        ------
        ProblemError
            If a change is none, or larger than the flight is long; one line.
        """
        self._require(flight.flown.seconds)
        robustness, moves = Robustness(flight.flown), flight.verdict.reward_moves
        planned = robustness.as_planned.reward + moves
        asks = flight.flown.problem.airspace.people_aside > 0
        fine = KEPT if asks or flight.flown.problem.rules.separation else NONE
        rows = []
        for words, outcome in self._outcomes(robustness):
            reward, near = outcome.reward + moves, sorted(outcome.too_near)
            rows.append({
                "change": words,
                "reward": reward,
                "share": reward / planned if planned > 0 else None,
                "least_distance": _finite(outcome.apart),
                "people_distance": _finite(outcome.aside) if asks else None,
                "rules": f"too near: {', '.join(near)}" if near else fine,
            })  # fmt: skip
        return rows

    def _outcomes(self, robustness: Robustness) -> Iterator[tuple[str, Outcome]]:
        yield "as planned", robustness.as_planned
        for late in self.late:
            yield f"people {late:g} s late", robustness.with_people(late=late)
            yield f"people {late:g} s early", robustness.with_people(late=-late)
        for aside in self.aside:
            yield f"people {aside:g} m left", robustness.with_people(left=aside)
            yield f"people {aside:g} m right", robustness.with_people(left=-aside)
        for lag in self.lag:
            yield f"any drone {lag:g} s late", robustness.with_laggard(lag)

    def _require(self, seconds: float) -> None:
        """Refuses what is no change, or no small one."""
        for name, most, unit in (
            ("late", seconds, "s, as long as the flight"), ("aside", MOST_ASIDE, "m"),
            ("lag", seconds, "s, as long as the flight"),
        ):  # fmt: skip
            for value in getattr(self, name):
                if not 0 < value <= most:  # true for nan, too
                    raise ProblemError(
                        f"{name}: must be more than 0 and at most {most:g} {unit}, not {value:g}"
                    )


def tolerated_delay(flight: Flight) -> float | None:
    """Returns what `told_delay` does for the scene's own rules.

    None: the scene has no separation, or any delay will do.
    """
    rules = flight.flown.problem.rules
    if not rules.separation or rules.none:
        return None
    return _finite(told_delay(flight, rules))


def told_delay(flight: Flight, rules: CollisionRules) -> float:
    """Returns seconds below which drones may be behind each other, rounded down to hundredths.

    Parameters
    ----------
    rules : have a separation

    Returns
    -------
    inf where any delay will do.
    """
    delay = bearable_delay(flight.flown, rules)
    return math.floor(100 * delay) / 100 if math.isfinite(delay) else delay


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
