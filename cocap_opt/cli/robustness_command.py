"""The command `robustness`, which tells what is left of a plan that is not flown as planned."""

import logging
import math
from collections.abc import Iterator
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.flight_options import AS_PLANNED, FlightOptions
from cocap_opt.cli.options import Json, PlanPath, Scene, Seed, load_planned
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.flight.changes import (
    Changes,
    people_and_delay,
    tolerated_delay,
    tolerated_delay_of_people,
    written_delay,
)
from cocap_opt.flight.flights import Flight
from cocap_opt.output.files import PlanReader
from cocap_opt.output.printing import Listing, Record, print_result
from cocap_opt.run.options import UsageError

_log = logging.getLogger(__name__)

_USUAL = Changes()


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
            negative="", consume_multiple=True, help="seconds by which people are late, and early"
        ),
    ] = None,
    aside: Annotated[
        list[float] | None,
        Parameter(negative="", consume_multiple=True, help="metres by which people walk aside"),
    ] = None,
    lag: Annotated[
        list[float] | None,
        Parameter(
            negative="", consume_multiple=True, help="seconds by which any one drone is late"
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Tell what is left of a plan when people are late, early or aside, or a drone lags.

    Nobody reacts: all others fly as planned. J is computed between the steps, too. Distances are
    the least at any moment, and rules are checked at every moment, on the flights' polynomials.

    Example: cocap-opt robustness corridor plan.json --step 2 --smooth --late 1 3 --lag 0.5
    """
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan)
    problem = given.problem
    if cut_short := given.cut_short:
        _log.warning("%s: %s", plan, cut_short)
    changes = Changes(
        _USUAL.late if late is None else late,
        _USUAL.aside if aside is None else aside,
        _USUAL.lag if lag is None else lag,
    )
    try:
        flight = flown.flight(problem, given.plan, is_local=True)  # where it is does not matter
    except ProblemError as error:
        raise FileError(f"{plan}: {error}") from error
    try:
        rows = changes.rows(flight)
    except ProblemError as error:
        raise UsageError(f"--{error}") from error
    delay, to_people = tolerated_delay(flight), tolerated_delay_of_people(flight)
    notes = list(_notes(flight, delay, to_people))
    if json:
        answer: Record = {
            **({"cut_short": cut_short} if cut_short else {}),
            "scene": problem.name,
            "seed": seed,
            "delay_tolerance": written_delay(delay),
            "delay_tolerance_to_people": written_delay(to_people),
        }
        print_result({**answer, "changes": rows, "notes": notes}, json)
    else:
        kind = "smooth" if flown.smooth else "straight"
        title = f"{problem.name}, {kind}: what is left of J = {rows[0]['reward']:,.2f}"
        Listing(title, [_shown(row) for row in rows], notes).print()
    return 0


def _shown(row: Record) -> Record:
    """Returns a row as people read it."""
    share = row["share"]
    columns: Record = {
        "change": row["change"],
        "J (%)": None if share is None else 100 * share,
        "drones (m)": row["least_distance"],
    }
    if row["people_distance"] is not None:
        columns["people (m)"] = row["people_distance"]
    return {**columns, "rules": row["rules"]}


def _notes(flight: Flight, delay: float | None, to_people: float | None) -> Iterator[str]:
    """Yields sentences on what the numbers mean."""
    problem = flight.flown.problem
    yield (
        "J is computed between the steps, too; distances are the least at any moment, those to "
        "people seen from above; people are moved to their own left or right, as they walk; where "
        "any drone may be late, each column has the worst of them"
    )
    yield from flight.nearer_to_people()
    if delay is not None and math.isinf(delay):
        yield f"the {problem.rules} between drones is kept however late any of them is"
    elif delay is not None:
        yield f"the {problem.rules} is kept while no drone is {delay:.2f} s or more behind another"
    elif not problem.rules.separation and len(problem.robots) > 1:
        yield "the scene's rules ask for no distance between drones between the steps"
    yield from people_and_delay(flight, to_people)


COMMANDS = {"robustness": _robustness}
