"""The command `quality`, which tells how well a plan films people."""

import logging
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import Json, PlanPath, Scene, Seed, load_planned
from cocap_opt.data import ProblemError, within
from cocap_opt.footage.quality import Assumptions, Quality
from cocap_opt.footage.summary import OfPerson, whole_percent
from cocap_opt.output.files import PlanReader, check_output, save_bytes
from cocap_opt.output.printing import Listing, Record, print_result
from cocap_opt.run.options import Option, UsageError
from cocap_opt.text import printable

_log = logging.getLogger(__name__)

_MOST_PEOPLE = 12  # in a terminal
_USUAL = Assumptions()


def _quality(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    seed: Seed = 0,
    at_least: Annotated[
        float,
        Parameter(help="share of a person that a drone must see, of their unhidden solid angle"),
    ] = _USUAL.at_least,
    pixel_error: Annotated[
        float, Parameter(help="pixels by which a point is found wrongly, along each axis")
    ] = _USUAL.pixel_error,
    position_error: Annotated[
        float, Parameter(help="metres by which a drone is elsewhere, along each axis")
    ] = _USUAL.position_error,
    attitude_error: Annotated[
        float, Parameter(help="degrees by which a camera looks elsewhere, about each axis")
    ] = math.degrees(_USUAL.attitude_error),
    exposure: Annotated[
        float, Parameter(help="seconds for which the shutter is open")
    ] = _USUAL.exposure,
    drone_size: Annotated[
        float, Parameter(help="metres of a drone from side to side")
    ] = _USUAL.drone_size,
    drone_pixels: Annotated[
        float, Parameter(help="pixels from which on a drone counts in the picture of another")
    ] = _USUAL.drone_pixels,
    csv: Annotated[
        Path | None, Parameter(help="file to write, with a row per person and step")
    ] = None,
    json: Json = False,
) -> int:
    """Tell how well a plan films people: by how many drones, how accurately, how sharply.

    Of all person-steps that count: the shares that two drones see, and three, and two at least 30
    degrees apart; the error of a point that is triangulated from them; blur, where the scene says
    how long a step lasts; the worst moments by name; and a line per person. Errors are standard
    deviations.

    Example: cocap-opt quality corridor plan.json --at-least 0.5 --csv quality.csv
    """
    given_options = {
        "at_least": at_least, "pixel_error": pixel_error, "position_error": position_error,
        "attitude_error": attitude_error, "exposure": exposure, "drone_size": drone_size,
        "drone_pixels": drone_pixels,
    }  # fmt: skip
    assumptions = _assumptions(given_options)
    if csv is not None:
        check_output(csv, scene, plan)
        Option("--csv").ending(csv, (".csv",))
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan)
    if cut_short := given.cut_short:
        _log.warning("%s: %s", plan, cut_short)
    found = Quality.of(given.problem, given.plan, assumptions=assumptions)
    if csv is not None:
        save_bytes(csv, found.table.to_csv(index=False, lineterminator="\n").encode())
    if json:
        answer = {"scene": given.problem.name, "seed": seed, **_record(found)}
        first: Record = {"cut_short": cut_short} if cut_short else {}
        print_result({**first, **answer, "assumptions": given_options, "file": csv}, json)
    else:
        sys.stdout.write(f"{printable(str(found), chr(10))}\n\n")
        _people(found).print()
    return 0


def _assumptions(options: Mapping[str, float]) -> Assumptions:
    """Returns the assumptions of options; a UsageError names the one that is out of range."""
    try:
        within(options["attitude_error"], 0, 180, "attitude_error", "degrees")
        attitude = math.radians(options["attitude_error"])
        return Assumptions(**{**options, "attitude_error": attitude})
    except ProblemError as error:
        field, words = str(error).split(":", 1)
        raise UsageError(f"--{field.replace('_', '-')}:{words}") from error


def _record(found: Quality) -> Record:
    """Returns a plan's quality as plain data, in which shares are parts of 1."""
    return {
        **found.summary._asdict(),
        "worst": found.worst,
        "people": [person._asdict() for person in found.by_person],
        "table": found.table.to_dict("records"),
    }


def _people(found: Quality) -> Listing:
    """Returns a table with a line per person, of many of those who are seen least."""
    people = found.by_person
    if len(people) > _MOST_PEOPLE:
        people = sorted(people, key=lambda person: (person.by_two, person.by_three))
    notes = [
        "two, three: % of steps at which so many drones or more see the person; apart: two at "
        "least 30 degrees apart; mm: RMS error that half of the steps do not exceed"
    ]
    listing = Listing("person by person", [_shown(person) for person in people], notes)
    return listing.first(_MOST_PEOPLE, "those whom two drones see least")


def _shown(person: OfPerson) -> Record:
    """Returns a line of the table of people."""
    parts = (person.by_two, person.by_three, person.apart)
    whole = (whole_percent(part).removesuffix(" %") for part in parts)
    median = "-" if math.isnan(person.median) else f"{person.median:,.0f}"
    return {
        "person": person.person,
        **dict(zip(("two", "three", "apart"), whole, strict=True)),
        "mm": median,
        "worst moment": person.worst,
    }


COMMANDS = {"quality": _quality}
