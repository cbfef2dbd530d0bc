"""The robustness of flights, as a table: J, least distances and rules under each change."""

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
TIGHT = 1.0  # s; a crew's clock counts whole seconds, so nobody sees that somebody is less late
MOST_ASIDE = 100.0  # m
_TOUCH = 1e-6  # cm, less is rounding


class ChangeRow(NamedTuple):
    """A change, and what is left of the flight.

    Attributes
    ----------
    change : in words
    reward : J between the steps, too
    share : of J of the flight as planned; None if that is 0
    least_distance : m, between drones; None for one drone
    people_distance : m, to the middle of anybody, from above; None where the scene asks for none
    rules : kept, or to whom drones come too close; none where the scene has none between the steps
    ask_drones, ask_people : m, the distance to ask for, that of the scene and what is missing,
        rounded up to centimetres; None where none is missing
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
        """Returns the row of a change.

        Parameters
        ----------
        moves : rewards for moves, a part of J
        planned : J as planned
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

    def rows(self, flight: Flight) -> list[ChangeRow]:
        """Returns a row per change, as planned first; of drones that lag it has the worst.

        Raises
        ------
        ProblemError
            If a change is none, or larger than the flight is long; one line.
        """
        self._require(flight.flown.seconds)
        robustness, moves = Robustness(flight.flown), flight.verdict.reward_moves
        return [
            ChangeRow.of(flight, words, outcome, moves, robustness.as_planned.reward + moves)
            for words, outcome in self._outcomes(robustness, flight.flown.problem)
        ]

    def _outcomes(self, robustness: Robustness, problem: Problem) -> Iterator[tuple[str, Outcome]]:
        """Yields each change in words, and what is left; another change is another line here."""
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
        """Refuses values that are not changes, or too large."""
        for name, most, unit in (
            ("late", seconds, "s, as long as the flight"), ("aside", MOST_ASIDE, "m"),
            ("lag", seconds, "s, as long as the flight"),
        ):  # fmt: skip
            for value in getattr(self, name):
                if not 0 < value <= most:  # true for nan, too
                    raise ProblemError(
                        f"{name}: must be more than 0 and at most {most:g} {unit}, not {value:g}"
                    )


def _asked(stated: float, missing: float | None) -> float | None:
    """Returns the distance (m) to ask for, in place of the stated one; None if none is missing."""
    return None if missing is None else math.ceil(100 * (stated + missing) - _TOUCH) / 100


def tolerated_delay(flight: Flight, rules: CollisionRules | None = None) -> float | None:
    """Returns seconds below which drones may be behind each other.

    They are rounded down to hundredths, and inf where any delay will do. None: there is one drone
    only, or the scene has no separation.

    Parameters
    ----------
    rules : have a separation, of several drones; None: the scene's own
    """
    if rules is None:
        rules = flight.flown.problem.rules
        if not rules.separation or rules.none or len(flight.flown.pieces) == 1:
            return None
    return _rounded_down(bearable_delay(flight.flown, rules))


def tolerated_delay_of_people(flight: Flight) -> float | None:
    """Returns seconds below which drones may be ahead of people or behind them, rounded down.

    inf: any delay will do. None: there is nobody, or the scene asks for no distance to people.
    """
    problem = flight.flown.problem
    if not problem.actors or not problem.airspace.people_aside:
        return None
    return _rounded_down(bearable_delay_of_people(flight.flown))


def people_and_delay(flight: Flight, delay: float | None) -> Iterator[Note]:
    """Yields what late drones, or late people, are to each other.

    Parameters
    ----------
    delay : `tolerated_delay_of_people`
    """
    problem = flight.flown.problem
    if not problem.actors:
        return
    if delay is None:
        yield Note(
            "the scene requires no distance to people, so how close a late drone comes to them was "
            "not checked",
            remedy="set people under [airspace] of a recipe to require one",
        )
        return
    kept = f"drones keep {problem.airspace.told_people}"
    if math.isinf(delay):
        yield Note(f"{kept} for any delay or lead of drones and people")
    elif delay == 0:
        yield Note(
            f"delay tolerance to people 0: {kept} only if everybody is on time; plan with a larger "
            "distance to people"
        )
    else:
        yield Note(
            f"delay tolerance to people: {kept} while no drone is {delay:.2f} s or more ahead of "
            "them or behind"
        )


def tight_timing(flight: Flight) -> Iterator[str]:
    """Yields the distances that are lost if somebody is late by less than a crew can see."""
    problem = flight.flown.problem
    for kept, delay, nobody in (
        (f"drones keep the {problem.rules}", tolerated_delay(flight),
         "no drone is late by {} or more"),
        (f"drones keep {problem.airspace.told_people}", tolerated_delay_of_people(flight),
         "no drone or person is early or late by {} or more"),
    ):  # fmt: skip
        if delay is not None and delay < TIGHT:
            only = nobody.format(f"{delay:.2f} s") if delay else "all are exactly on time"
            yield f"{kept} only if {only}; a crew's clock shows whole seconds only"


def written_delay(delay: float | None) -> float | str | None:
    """Returns a tolerated delay as JSON has it, which knows no infinite numbers."""
    return UNLIMITED if delay is not None and math.isinf(delay) else delay


def _rounded_down(seconds: float) -> float:
    return math.floor(100 * seconds) / 100 if math.isfinite(seconds) else seconds


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
