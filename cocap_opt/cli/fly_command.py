"""The command `fly`, which writes the flight of a plan in the formats of other programs."""

import logging
import re
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from cocap_opt.cli.flight_answer import FlightAnswer
from cocap_opt.cli.flight_options import (
    AS_PLANNED,
    Every,
    FlightOptions,
    Hovering,
    Landed,
    Local,
    Start,
)
from cocap_opt.cli.flown_plan import Order
from cocap_opt.cli.options import FLAG, Json, Output, PlanPath, Scene, Seed, Whole
from cocap_opt.flight.notes import Kind, Note, notes_of
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.flight.urgent import attention
from cocap_opt.flight.ways import NOTE, Part, has_homes, parts_of_take, pauses_of, records_of
from cocap_opt.missions import FORMATS, Writer
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import check_output, save_files
from cocap_opt.output.printing import Record
from cocap_opt.run.options import Option, UsageError
from cocap_opt.stop import Interrupt

_log = logging.getLogger(__name__)

Autopilot = Literal["px4", "ardupilot"]


def _fly(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    output: Output = None,
    seed: Seed = 0,
    flown: FlightOptions = AS_PLANNED,
    every: Every = None,
    start: Start = None,
    autopilot: Annotated[
        Autopilot | None,
        Parameter(
            help="autopilot of the missions (default: px4 for .plan, ardupilot for .waypoints)"
        ),
    ] = None,
    items: Annotated[
        Whole | None,
        Parameter(help="mission items that the board can store (default: that of common boards)"),
    ] = None,
    local: Local = False,
    hovering: Hovering = False,
    landed: Landed = False,
    json: Json = False,
    verbose: Annotated[
        bool,
        FLAG(
            name="--verbose",
            help="also print all numbers, tables of all drones, and how to read the file",
        ),
    ] = False,
) -> int:
    """Export a plan as a flight, checked against rules, obstacles and limits.

    The file extension selects the format: a table, tracks, missions, a drone show, the cameras of
    a film, an animated scene, or a sheet for the crew. Wind, deviations from the planned flight,
    take-off and landing are not checked.

    A .csv file has t (s), x, y, z (m, coordinates of the map), yaw (degrees, 0 along x,
    counter-clockwise) and pitch (degrees, 0 level, below is negative) of each drone, heights above
    ground and take-off, and latitude and longitude where the scene has a reference system. A
    .geojson or .kml file has tracks, cameras' footprints and people's walks by latitude and
    longitude; a .glb file is an animated scene (glTF) for Blender and viewers in browsers; a .pdf
    file is a sheet for the crew.

    The answer begins with warnings: drones that come close to each other or to people where no rule
    forbids it; take-offs and landings on roofs, obstacles or water, or close to each other; people
    who walk through obstacles, off the map or in the air; and timing that is too tight to follow on
    a clock. It ends with instructions for the crew and a list of what was not checked.

    A plan in which no drone moves is rejected unless you pass --hovering.

    A smooth flight that comes too close to people is rejected; the message tells you how much extra
    distance to plan with and which --margin to fly with.

    Waypoint missions, a file per drone: .plan (QGroundControl, for PX4, or for ArduPilot with
    --autopilot) and .waypoints (for ArduPilot). The file name includes the autopilot, the only one
    that the file is for.
    Synchronised flights: .skyc (Skybrush) and .crazyflie.csv (polynomials, with --smooth).

    Cameras, to triangulate points in the footage: .opencv.json, .colmap.zip and .pose2sim.toml
    contain the intrinsics of each drone's camera, and its pose every --every seconds, e.g. 0.04 for
    a video of 25 frames per second. Cones have no image, so scenes with cone cameras are rejected.

    Example: cocap-opt fly corridor plan.json --step 1 --smooth -o flight.csv
    """
    output, suffix = Option("-o").file(output, tuple(FORMATS))
    write = _writer(suffix, autopilot, items)
    order = Order(scene, seed, plan, output, suffix, flown, start, every, local, hovering, landed)
    given, flight, mission = order.carried_out(write)
    problem, cut_short = given.problem, given.cut_short
    with order.in_words():
        parts = parts_of_take(flight.flown.problem, given.plan) if has_homes(problem) else ()
    record = flight.record()
    files = {_named(output, suffix, part): content for part, content in mission.files.items()}
    for path in files:
        check_output(path, scene, plan)
    first: Record = {"cut_short": cut_short} if cut_short else {}
    answer: Record = {**first, "scene": problem.name, "seed": seed, **record, **mission.facts}
    notes = [
        *attention(flight, Touchdowns.of(flight), parts), *flight.notes(), *mission.notes,
        *_of_homes(parts, suffix), *_strays(output, suffix, files),
    ]  # fmt: skip
    if json:
        urgent = notes_of(mission.notes, Kind.URGENT)
        for words in (*urgent, *filter(None, [pauses_of(parts)])):
            _log.warning("%s: %s", plan, words)
    with Interrupt.caught():  # after one Ctrl-C, the answer still lists the written files
        save_files(files)
        if json:
            rows = {"drones": flight.rows(), "notes": [*map(str, notes)]}
            if parts:
                rows["from_home"] = records_of(parts)
            print_result({**answer, **rows, "files": [*files]}, json)
            return 0
        shown = FlightAnswer(flight, parts, [*files], answer | {"cut_short": None}, notes)
        if verbose:
            shown.print_all()
        else:
            shown.print()
    return 0


def _of_homes(parts: Sequence[Part], suffix: str) -> Iterator[Note]:
    """Yields what flights from and to home are, and that missions do not contain them."""
    if parts:
        yield Note(NOTE)
        if FORMATS[suffix].takes_off:
            yield Note(
                f"{suffix} contains no flights from and to home: see the sheet (.pdf) or --json; "
                "missions take off and land straight below their first and last places"
            )


def _writer(suffix: str, autopilot: str | None, items: int | None) -> Writer:
    """Returns the function that writes files of an ending, for an autopilot and its board."""
    autopilots = FORMATS[suffix].autopilots
    if not autopilots:
        for name, value in (("--autopilot", autopilot), ("--items", items)):
            if value is not None:
                raise UsageError(f"{name}: must be left out for {suffix}, which holds no mission")
    elif autopilot is not None and autopilot not in autopilots:
        others = " or ".join(autopilots)
        raise UsageError(
            f"--autopilot: must be {others} for {suffix}, not {autopilot}; .plan is for both"
        )
    if items is not None and not items > 0:
        raise UsageError(f"--items: must be more than 0, not {items}")
    return FORMATS[suffix].writer(autopilot, items)


def _named(output: Path, suffix: str, part: str) -> Path:
    """Returns the name of a part of the output."""
    first, last = output.name[: -len(suffix)], output.name[-len(suffix) :]
    return output.with_name(f"{first}.{part}{last}") if part else output


def _strays(output: Path, suffix: str, files: Collection[Path]) -> Iterator[Note]:
    """Yields a note on files beside those of the drones that are of another flight."""
    if set(files) == {output}:
        return
    pattern = re.compile(rf"{re.escape(output.name[: -len(suffix)])}\..*{re.escape(suffix)}")
    names = (path.name for path in output.parent.iterdir() if path not in files)
    if strays := sorted(name for name in names if pattern.fullmatch(name)):
        yield Note(
            f"files of another flight, not written now: {', '.join(strays)}; do not fly them "
            "together"
        )


COMMANDS = {"fly": _fly}
