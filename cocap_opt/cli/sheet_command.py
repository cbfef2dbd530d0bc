"""The command `sheet`, which writes what the crew of a flight carries."""

import logging
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.flight_options import (
    AS_PLANNED,
    FlightOptions,
    Hovering,
    Local,
    Start,
    in_words,
    require_motion,
    require_spacing,
    start_of,
)
from cocap_opt.cli.options import Json, Output, PlanPath, Scene, Seed, load_planned
from cocap_opt.data import ProblemError
from cocap_opt.missions import FORMATS
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import PlanReader, check_output, save_files
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
    Option("-o").ending(output, (_SUFFIX,))
    begins = None if start is None else start_of(start, _SUFFIX, is_dated=True)
    require_spacing(every)
    check_output(output, scene, plan)
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan, any_objective=True)
    try:
        flight = flown.flight(given.problem, given.plan, local)
        flight = flight._replace(start=begins, cut_short=given.cut_short)
        found = FORMATS[_SUFFIX].writer()(flight, every)
    except ProblemError as error:
        raise in_words(error, scene, plan, _SUFFIX, flown.step is not None) from error
    require_motion(plan, given.plan, given.cut_short, hovering)
    for warning in found.warnings:
        _log.warning("%s", warning)
    save_files(dict.fromkeys([output], found.files[""]))
    answer: Record = {"file": output, **found.facts, "scene": given.problem.name, "seed": seed}
    print_result(answer | ({"cut_short": given.cut_short} if given.cut_short else {}), json)
    return 0


COMMANDS = {"sheet": _sheet}
