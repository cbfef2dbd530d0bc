"""The command `robustness`, which shows how deviations affect a flight."""

import logging
import math
from collections.abc import Iterator, Sequence
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.flight_options import AS_PLANNED, FlightOptions
from cocap_opt.cli.options import Json, PlanPath, Scene, Seed, Whole, load_planned
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.flight.changes import (
    USUAL_ASIDE,
    USUAL_LAG,
    USUAL_LATE,
    ChangeRow,
    Changes,
    people_and_delay,
    tolerated_delay,
    tolerated_delay_of_people,
    written_delay,
)
from cocap_opt.flight.flights import Flight
from cocap_opt.footage.losses import Seen, WhatIf, steps_in_words, what_if
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import PlanReader
from cocap_opt.output.printing import Listing, Record
from cocap_opt.run.options import UsageError

_log = logging.getLogger(__name__)

_MANY = 12  # drones whose losses are listed


def _listed(numbers: Sequence[float]) -> str:
    """Returns numbers in the form of an option's value."""
    return " ".join(f"{number:g}" for number in numbers)


def _robustness(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    seed: Seed = 0,
    flown: FlightOptions = AS_PLANNED,
    late: Annotated[
        list[float] | None,
        Parameter(
            negative="",
            consume_multiple=True,
            help=f"seconds by which people are late or early (default: {_listed(USUAL_LATE)}, "
            "without those longer than the flight)",
        ),
    ] = None,
    aside: Annotated[
        list[float] | None,
        Parameter(
            negative="",
            consume_multiple=True,
            help="metres by which people walk to the left or right of their walks (default: "
            f"{_listed(USUAL_ASIDE)})",
        ),
    ] = None,
    lag: Annotated[
        list[float] | None,
        Parameter(
            negative="",
            consume_multiple=True,
            help=f"seconds by which one of the drones is late (default: {_listed(USUAL_LAG)}, "
            "without those longer than the flight)",
        ),
    ] = None,
    lost: Annotated[
        list[Whole] | None,
        Parameter(
            negative="",
            consume_multiple=True,
            help="steps at which one of the drones is lost (default: each at its worst step)",
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Evaluate a plan when people deviate from their walks, or a drone is late or lost.

    The drones do not react: all others fly as planned. J includes the time between steps. Distances
    are the smallest at any moment, and rules are checked at every moment, on the flights'
    polynomials. If a distance is not kept, the table shows the distance to plan with.

    Example: cocap-opt robustness corridor plan.json --step 2 --smooth --late 1 3 --lag 0.5
    """
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan, any_objective=True)
    problem = given.problem
    if cut_short := given.cut_short:
        _log.warning("%s: %s", plan, cut_short)
    try:
        # its place on the Earth does not matter
        flight = flown.flight(problem, given.plan, is_local=True)
    except ProblemError as error:
        raise FileError(f"{plan}: {error}") from error
    changes = Changes.of(flight, late, aside, lag)
    try:
        found = what_if(flight, changes, lost)
    except ProblemError as error:
        raise UsageError(f"--{error}") from error
    delay, to_people = tolerated_delay(flight), tolerated_delay_of_people(flight)
    notes = [*_notes(flight, delay, to_people, bool(changes.lag)), *_asking(found)]
    if json:
        answer: Record = {
            **({"cut_short": cut_short} if cut_short else {}),
            "scene": problem.name,
            "seed": seed,
            "delay_tolerance": written_delay(delay),
            "delay_tolerance_to_people": written_delay(to_people),
        }
        print_result({**answer, "changes": found.records(), "notes": notes}, json)
    else:
        kind = "smooth" if flown.smooth else "straight"
        title = f"{problem.name}, {kind}: remaining part of J = {found.changes[0].reward:,.2f}"
        Listing(title, [_shown(row) for row in found.changes], notes).print()
        _losses(found).print()
    return 0


def _losses(found: WhatIf) -> Listing:
    """Returns the table of lost drones below the plan, with people who are no longer seen by
    two.
    """
    notes = [
        "a lost drone films nothing from that step on and has left the scene; where it comes down "
        "was not checked. The table shows its worst step: the last one at which its loss costs as "
        "much as if it had never flown"
    ]
    lost = sorted(found.losses, key=lambda row: row.left.reward)
    for row in lost[:_MANY]:
        gone = [f"{person} at {steps_in_words(steps)}" for person, steps in row.seen.no_longer]
        if gone:
            notes.append(f"{row.left.change}, no longer seen by two: {'; '.join(gone)}")
    rows = [_seen(found.changes[0], found.seen), *(_seen(row.left, row.seen) for row in lost)]
    what = "the plan, and the losses that cost most"
    return Listing("if a drone is lost", rows, notes).first(_MANY + 1, what)


def _seen(left: ChangeRow, seen: Seen) -> Record:
    """Returns a row of the losses for people to read."""
    shares = {"J (%)": left.share, "seen by two (%)": seen.by_two, "by none (%)": seen.by_none}
    percents = {
        name: None if part is None else f"{100 * part:.1f}" for name, part in shares.items()
    }
    return {"change": left.change, **percents}


def _shown(row: ChangeRow) -> Record:
    """Returns a row of the changes for people to read."""
    columns: Record = {
        "change": row.change,
        "J (%)": None if row.share is None else f"{100 * row.share:.1f}",
        "drones (m)": row.least_distance,
    }
    if row.people_distance is not None:
        columns["people (m)"] = row.people_distance
    asked = {"drones": row.ask_drones, "people": row.ask_people}
    ways_out = [
        f"{name}: plan with {metres:.2f} m" for name, metres in asked.items() if metres is not None
    ]
    return {**columns, "rules": "; ".join(ways_out) or row.rules}


def _notes(
    flight: Flight, delay: float | None, to_people: float | None, has_lags: bool
) -> Iterator[str]:
    """Yields sentences that explain the numbers; `has_lags`: of drones that are late, too."""
    problem = flight.flown.problem
    yield "J includes the time between steps"
    yield "distances are the smallest at any moment of the flight, those to people seen from above"
    yield "left and right are those of the person, as they walk"
    if has_lags:
        yield "any drone late: each column shows the drone for which it is worst"
    yield from map(str, flight.nearer_to_people())
    if delay is not None and math.isinf(delay):
        yield f"the {problem.rules} between drones holds for any delay of any drone"
    elif delay is not None:
        yield f"the {problem.rules} holds while no drone is {delay:.2f} s or more behind another"
    elif not problem.rules.separation and len(problem.robots) > 1:
        yield "the scene has no rule on the distance of drones between the steps"
    yield from map(str, people_and_delay(flight, to_people))


def _asking(found: WhatIf) -> Iterator[str]:
    """Yields a sentence on the distances to plan with, if there are any."""
    rows = [*found.changes, *(row.left for row in found.losses)]
    if any(row.ask_drones is not None or row.ask_people is not None for row in rows):
        yield (
            "rules: where a distance is not kept, drones or people and the distance to plan with"
        )
        yield (
            "the distance to plan with is the scene's plus the shortfall: set it in the scene, "
            "plan again, and repeat this command; if the distance from people has grown, add "
            "--margin with its growth, by which drones may then come closer to people"
        )


COMMANDS = {"robustness": _robustness}
