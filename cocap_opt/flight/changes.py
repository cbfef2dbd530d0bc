"""The robustness of flights as a table: J, minimum distances and rules under each deviation."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.flight.delays import bearable_delay, bearable_delay_of_people
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Note
from cocap_opt.flight.robustness import Outcome, Robustness
from cocap_opt.problem import CollisionRules, Problem
from cocap_opt.problem.takes import told_take

KEPT, NONE = "kept", "none"
UNLIMITED = "unlimited"  # a delay
TIGHT = 1.0  # s; a crew's clock shows whole seconds, so smaller delays go unnoticed
MOST_ASIDE = 100.0  # m
USUAL_LATE, USUAL_LAG = (1.0, 2.0), (0.5, 1.0, 2.0)  # s
USUAL_ASIDE = (1.0,)  # m
_TOUCH = 1e-6  # cm; smaller values are rounding errors


class ChangeRow(NamedTuple):
    """A deviation from the plan, and the outcome of the flight.

    Attributes
    ----------
    change : the deviation in words
    reward : J between the steps, too
    share : share of the J of the flight as planned; None if that is 0
    least_distance : minimum distance between drones, m; None for one drone
    people_distance : minimum horizontal distance from the middle of a person, m; None if the scene
        requires none
    rules : kept, or to whom drones come too close; none if the scene has no rules between the steps
    ask_drones, ask_people : distance to plan with in m, i.e. that of the scene plus the missing
        distance, rounded up to centimetres; None if none is missing
    """

    change: str
    reward: float
    share: float | None
    least_distance: float | None
    people_distance: float | None
    rules: str
    ask_drones: float | None
    ask_people: float | None

    @classmethod
    def of(
        cls, flight: Flight, words: str, outcome: Outcome, moves: float, planned: float
    ) -> "ChangeRow":
        """Returns the row of a deviation.

        Parameters
        ----------
        moves : rewards for moves, a part of J
        planned : J of the flight as planned
        """
        problem = flight.flown.problem
        asks = problem.airspace.people_aside > 0
        fine = KEPT if asks or problem.rules.separation else NONE
        reward, near = outcome.reward + moves, sorted(outcome.too_near)
        stated = problem.airspace if flight.asked is None else flight.asked
        return cls(
            change=words,
            reward=reward,
            share=reward / planned if planned > 0 else None,
            least_distance=_finite(outcome.apart),
            people_distance=_finite(outcome.aside) if asks else None,
            rules=f"too close: {', '.join(near)}" if near else fine,
            ask_drones=_asked(problem.rules.separation, outcome.missing.get("drones")),
            ask_people=_asked(stated.people_aside, outcome.missing.get("people")),
        )


class Changes(NamedTuple):
    """Deviations from a plan, each of which makes a row.

    Attributes
    ----------
    late : time in s by which people are late, and early
    aside : distance in m by which people are displaced to the left, and to the right
    lag : time in s by which any one drone is late
    """

    late: Sequence[float]
    aside: Sequence[float]
    lag: Sequence[float]

    @classmethod
    def of(
        cls,
        flight: Flight,
        late: Sequence[float] | None = None,
        aside: Sequence[float] | None = None,
        lag: Sequence[float] | None = None,
    ) -> "Changes":
        """Returns the deviations to look at; None: the usual ones that are no longer than the
        flight.
        """
        lasts = flight.flown.seconds
        return cls(
            [time for time in USUAL_LATE if time <= lasts] if late is None else late,
            USUAL_ASIDE if aside is None else aside,
            [time for time in USUAL_LAG if time <= lasts] if lag is None else lag,
        )

    def rows(self, flight: Flight) -> list[ChangeRow]:
        """Returns a row per deviation, the flight as planned first; for lagging drones, the worst.

        Raises
        ------
        ProblemError
            If a deviation is 0, or longer than the flight; the message is one line.
        """
        self._require(flight.flown.seconds)
        robustness, moves = Robustness(flight.flown), flight.verdict.reward_moves
        return [
            ChangeRow.of(flight, words, outcome, moves, robustness.as_planned.reward + moves)
            for words, outcome in self._outcomes(robustness, flight.flown.problem)
        ]

    def _outcomes(self, robustness: Robustness, problem: Problem) -> Iterator[tuple[str, Outcome]]:
        """Yields each deviation in words, with its outcome; add a line here for another
        deviation.
        """
        yield "as planned", robustness.as_planned
        for k, take in enumerate(problem.takes):
            yield told_take(take.name), robustness.with_take(k)
        for late in self.late:
            yield f"people {late:g} s late", robustness.with_people(late=late)
            yield f"people {late:g} s early", robustness.with_people(late=-late)
        for aside in self.aside:
            yield f"people {aside:g} m left", robustness.with_people(left=aside)
            yield f"people {aside:g} m right", robustness.with_people(left=-aside)
        for lag in self.lag:
            yield f"any drone {lag:g} s late", robustness.with_laggard(lag)

    def _require(self, seconds: float) -> None:
        """Rejects values that are not deviations, or are too large."""
        for name, most, unit in (
            ("late", seconds, "s, as long as the flight"), ("aside", MOST_ASIDE, "m"),
            ("lag", seconds, "s, as long as the flight"),
        ):  # fmt: skip
            for value in getattr(self, name):
                if not 0 < value <= most:  # True for nan, too
                    raise ProblemError(
                        f"{name}: must be more than 0 and at most {most:g} {unit}, not {value:g}"
                    )


def _asked(stated: float, missing: float | None) -> float | None:
    """Returns the distance (m) to plan with instead of the stated one; None if none is missing."""
    return None if missing is None else math.ceil(100 * (stated + missing) - _TOUCH) / 100


def tolerated_delay(flight: Flight, rules: CollisionRules | None = None) -> float | None:
    """Returns the delay in s below which drones may lag behind each other.

    The result is rounded down to hundredths, and inf if delays do not matter. None: there is only
    one drone, or the scene has no separation.

    Parameters
    ----------
    rules : rules with a separation; None: those of the scene
    """
    if rules is None:
        rules = flight.flown.problem.rules
        if not rules.separation or rules.none or len(flight.flown.pieces) == 1:
            return None
    return _rounded_down(bearable_delay(flight.flown, rules))


def tolerated_delay_of_people(flight: Flight) -> float | None:
    """Returns the seconds below which drones may be ahead of people or behind them, rounded down.

    inf: delays do not matter. None: there are no people, or the scene requires no distance from
    people.
    """
    problem = flight.flown.problem
    if not problem.actors or not problem.airspace.people_aside:
        return None
    return _rounded_down(bearable_delay_of_people(flight.flown))


def people_and_delay(flight: Flight, delay: float | None) -> Iterator[Note]:
    """Yields notes on the delays of drones and people relative to each other.

    Parameters
    ----------
    delay : result of `tolerated_delay_of_people`
    """
    problem = flight.flown.problem
    if not problem.actors:
        return
    if delay is None:
        yield Note(
            "the scene requires no distance from people, so how close a late drone comes to "
            "them was not checked",
            remedy="set people under [airspace] of a recipe to require one",
        )
        return
    kept = f"drones keep {problem.airspace.told_people}"
    if math.isinf(delay):
        yield Note(f"{kept} for any delay or lead of drones and people")
    elif delay == 0:
        yield Note(
            f"delay tolerance to people 0: {kept} only if everybody is on time; plan with a "
            "larger distance from people"
        )
    else:
        yield Note(
            f"delay tolerance to people: {kept} while no drone is {delay:.2f} s or more ahead of "
            "them or behind"
        )


def tight_timing(flight: Flight) -> Iterator[str]:
    """Yields warnings about distances that are lost by delays too small for a crew to notice."""
    problem = flight.flown.problem
    for kept, delay, nobody in (
        (f"drones keep the {problem.rules}{',' * bool(problem.rules.vertical)}",
         tolerated_delay(flight),
         "no drone is late by {} or more"),
        (f"drones keep {problem.airspace.told_people}", tolerated_delay_of_people(flight),
         "no drone or person is early or late by {} or more"),
    ):  # fmt: skip
        if delay is not None and delay < TIGHT:
            only = nobody.format(f"{delay:.2f} s") if delay else "everybody is exactly on time"
            yield f"{kept} only if {only}; a crew's clock shows whole seconds only"


def written_delay(delay: float | None) -> float | str | None:
    """Returns a tolerated delay for JSON, which has no infinite numbers."""
    return UNLIMITED if delay is not None and math.isinf(delay) else delay


def _rounded_down(seconds: float) -> float:
    return math.floor(100 * seconds) / 100 if math.isfinite(seconds) else seconds


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
