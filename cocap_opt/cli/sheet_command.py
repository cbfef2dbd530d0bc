"""The command `sheet`, which writes a printed sheet for the crew of a flight."""

import logging
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.flight_options import AS_PLANNED, FlightOptions, Hovering, Landed, Local, Start
from cocap_opt.cli.flown_plan import Order
from cocap_opt.cli.options import Json, Output, PlanPath, Scene, Seed
from cocap_opt.flight.notes import Kind, notes_of
from cocap_opt.missions import FORMATS
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import save_files
from cocap_opt.output.printing import Record
from cocap_opt.run.options import Option

_log = logging.getLogger(__name__)

_SUFFIX = ".pdf"


def _sheet(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    output: Output = None,
    start: Start = None,
    seed: Seed = 0,
    flown: FlightOptions = AS_PLANNED,
    every: Annotated[
        float | None,
        Parameter(help="seconds between rows of tables of all places (default: no such tables)"),
    ] = None,
    local: Local = False,
    hovering: Hovering = False,
    landed: Landed = False,
    json: Json = False,
) -> int:
    """Write the crew's sheet of a flight, a PDF of A4 pages: maps, cards and cues.

    It has a head to fill in, the running order by the clock, a map for each phase, a card for each
    drone (camera, battery with its reserve, home, first and last place, cues) and for each person,
    who films whom and how well, distances, and a list of what was not checked.

    Without -o the file is named after the plan.

    Example: cocap-opt sheet scene.toml plan.json --start 2026-05-01T10:00:00+02:00
    """
    output = plan.with_suffix(_SUFFIX) if output is None else output
    Option("-o").file(output, (_SUFFIX,))
    order = Order(scene, seed, plan, output, _SUFFIX, flown, start, every, local, hovering, landed)
    given, _, found = order.carried_out(FORMATS[_SUFFIX].writer())
    for warning in notes_of(found.notes, Kind.URGENT):
        _log.warning("%s", warning)
    save_files(dict.fromkeys([output], found.files[""]))
    answer: Record = {"file": output, **found.facts, "scene": given.problem.name, "seed": seed}
    print_result(answer | ({"cut_short": given.cut_short} if given.cut_short else {}), json)
    return 0


COMMANDS = {"sheet": _sheet}
