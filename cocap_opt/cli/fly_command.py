"""The command `fly`, which makes of a plan what drones fly."""

import logging
import re
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from cocap_opt.cli.flight_options import AS_PLANNED, FlightOptions
from cocap_opt.cli.options import (
    FLAG,
    Json,
    Output,
    PlanPath,
    Scene,
    Seed,
    Whole,
    load_planned,
)
from cocap_opt.data import FieldError, ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.missions import FORMATS, Writer
from cocap_opt.output.files import PlanReader, check_output, save_files
from cocap_opt.output.printing import Listing, Record, print_result
from cocap_opt.problem import Plan
from cocap_opt.run.options import Option, UsageError
from cocap_opt.stop import Interrupt

_log = logging.getLogger(__name__)

Autopilot = Literal["px4", "ardupilot"]
_OPTIONS = "every", "smooth", "start"
_PLACES = "earth.crs", "earth.origin"
_MANY, _FEW = 12, 6  # drones of a table that is cut, and rows that it keeps


def _fly(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    output: Output = None,
    seed: Seed = 0,
    flown: FlightOptions = AS_PLANNED,
    every: Annotated[
        float | None,
        Parameter(help="seconds between rows; else a row a step, and ten a step with --smooth"),
    ] = None,
    start: Annotated[
        str | None,
        Parameter(help="when step 0 is, such as 2026-05-01T10:00:00Z, in files that hold dates"),
    ] = None,
    autopilot: Annotated[
        Autopilot | None,
        Parameter(help="that missions are for; px4 for .plan, ardupilot for .waypoints"),
    ] = None,
    items: Annotated[
        Whole | None,
        Parameter(help="items of a mission that its board holds, if that is not as usual"),
    ] = None,
    local: Annotated[bool, FLAG(name="--local", help="leave out latitudes and longitudes")] = False,
    hovering: Annotated[
        bool, FLAG(name="--hovering", help="also write plans in which no drone moves")
    ] = False,
    json: Json = False,
) -> int:
    """Write where each drone is at every moment, checked against rules, obstacles and limits.

    A .csv file has t (s), x, y, z (m, coordinates of the map), yaw (degrees, 0 along x,
    counter-clockwise) and pitch (degrees, 0 level, below is negative) of each drone, heights above
    ground and take-off, and latitude and longitude where the scene has a reference system. A
    .geojson or .kml file has tracks, cameras' footprints and people's walks on the Earth; a .glb
    file is an animated scene (glTF) for Blender and viewers in browsers; a .pdf file is a sheet
    for the crew.

    Not checked: wind and errors of drones, which are to fly exactly so, and take-off and landing;
    notes below the answer say what else the scene leaves open.

    A plan in which no drone moves is refused without --hovering.

    A smooth flight that comes too near to people is refused with the way out: a plan that keeps so
    much more from them, flown with --margin, keeps what it did before.

    Missions of waypoints, a file per drone: .plan (QGroundControl, for PX4, or for ArduPilot with
    --autopilot) and .waypoints (for ArduPilot). Each is for the autopilot in its name only. By one
    clock fly .skyc (Skybrush) and .crazyflie.csv (polynomials, with --smooth).

    Example: cocap-opt fly corridor plan.json --step 1 --smooth -o flight.csv
    """
    suffix = Option("-o").ending(output, tuple(FORMATS))
    assert output is not None
    begins = None if start is None else _start(start, suffix, FORMATS[suffix].has_dates)
    if every is not None and not Option("--every").require_seconds(every) > 0:
        raise UsageError("--every: must be more than 0 seconds")
    if local and FORMATS[suffix].on_earth:
        raise UsageError(f"--local: must be left out for {suffix}, which has places on the Earth")
    write = _writer(suffix, autopilot, items)
    check_output(output, scene, plan)
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan)
    problem, planned, cut_short = given.problem, given.plan, given.cut_short
    try:
        flight = flown.flight(problem, planned, local)
        flight = flight._replace(start=begins, cut_short=cut_short)
        mission = write(flight, every)
    except ProblemError as error:
        raise _in_words(error, scene, plan, suffix, flown.step is not None) from error
    _require_motion(plan, planned, cut_short, hovering)
    record = flight.record()
    files = {_named(output, suffix, part): content for part, content in mission.files.items()}
    for path in files:
        check_output(path, scene, plan)
    first: Record = {"cut_short": cut_short} if cut_short else {}
    answer: Record = {**first, "scene": problem.name, "seed": seed, **record, **mission.facts}
    notes = [*flight.notes(), *mission.notes]
    notes += _strays(output, suffix, files)
    for warning in mission.warnings:
        _log.warning("%s", warning)
    with Interrupt.caught():  # who presses Ctrl-C now is told what is written, unless pressed twice
        save_files(files)
        if json:
            rows = {"drones": flight.rows(), "notes": notes}
            print_result({**answer, **rows, "files": [*files]}, json)
        else:
            print_result({**answer, "file": " ".join(map(str, files))}, json)
            shown = [words for words in notes if words != cut_short]  # which stands at the top
            _tightest(flight.rows(), shown).print()
    return 0


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
        raise UsageError("--items: must be more than 0")
    return FORMATS[suffix].writer(autopilot, items)


def _require_motion(path: Path, plan: Plan, cut_short: str, hovering: bool) -> None:
    """Refuses a plan in which no drone moves, unless that is asked for; warns of one cut short."""
    if plan.stays and not hovering:
        why, longer = cut_short or "all drones stay at their starts", ""
        if cut_short:
            longer = "a longer --time-limit of `plan` may give one that moves, "
        raise FileError(f"{path}: no drone moves ({why}); {longer}--hovering flies it as it is")
    if cut_short:
        _log.warning(
            "%s: %s; a longer --time-limit of `plan` may give a better one", path, cut_short
        )


def _tightest(rows: Sequence[Record], notes: Sequence[str]) -> Listing:
    """Returns the table of the drones' tightest moments; of many drones it has a few."""
    table = Listing("tightest moment of each drone", rows, notes)
    if len(rows) <= _MANY:
        return table
    ranked = sorted(rows, key=_tightness, reverse=True)
    return table._replace(rows=ranked).first(_FEW, "the drones nearest to a limit, or the fastest")


def _tightness(row: Record) -> tuple[float, float]:
    return (row["value"] / row["limit"] if row["limit"] else 0.0, row["value"])


def _named(output: Path, suffix: str, part: str) -> Path:
    """Returns the name of a part of the output."""
    first, last = output.name[: -len(suffix)], output.name[-len(suffix) :]
    return output.with_name(f"{first}.{part}{last}") if part else output


def _strays(output: Path, suffix: str, files: Collection[Path]) -> Iterator[str]:
    """Yields a sentence on files beside those of the drones that are of another flight."""
    if set(files) == {output}:
        return
    pattern = re.compile(rf"{re.escape(output.name[: -len(suffix)])}\..*{re.escape(suffix)}")
    names = (path.name for path in output.parent.iterdir() if path not in files)
    if strays := sorted(name for name in names if pattern.fullmatch(name)):
        yield f"of another flight, and not written now: {', '.join(strays)}; do not fly them along"


def _in_words(
    error: ProblemError, scene: str, plan: Path, suffix: str, by_option: bool
) -> Exception:
    """Returns the error that names the option or the file that is to be changed.

    Parameters
    ----------
    suffix : of the file that is asked for
    by_option : True: `--step` says how long a step lasts, not the scene
    """
    field = error.field if isinstance(error, FieldError) else None
    if field in _OPTIONS or (field == "step" and by_option):
        return UsageError(f"--{error}")
    if field in ("earth", "step"):
        return FileError(f"{scene}: {error}")
    if field == "crs":  # something of the scene is where its system is not defined
        return FileError(f"{scene}: earth.{error}")
    if field in _PLACES:
        way_out = (
            "" if FORMATS[suffix].on_earth else "; --local leaves latitudes and longitudes out"
        )
        return FileError(f"{scene}: {error}{way_out}")
    return FileError(f"{plan}: {error}")


def _start(text: str, suffix: str, is_dated: bool) -> datetime:
    """Returns the time at which a flight starts, for a file of some ending."""
    if not is_dated:
        raise UsageError(f"--start: must be left out for {suffix}, whose times are seconds")
    try:
        found = datetime.fromisoformat(text)
        if found.tzinfo is not None:
            found.astimezone(UTC)  # which may be out of range
            return found
    except (ValueError, OverflowError):
        pass
    raise UsageError(
        f"--start: must be a date and a time with its offset from UTC, such as "
        f"2026-05-01T10:00:00+02:00 or 2026-05-01T08:00:00Z, not {text[:40]!r}"
    )


COMMANDS = {"fly": _fly}
