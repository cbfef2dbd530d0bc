"""The commands that fly a plan: `fly` writes its flight, `robustness` what slips leave of it."""

import logging
import math
import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

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
from cocap_opt.flight.changes import (
    ChangeRow,
    Changes,
    people_and_delay,
    tolerated_delay,
    tolerated_delay_of_people,
    written_delay,
)
from cocap_opt.flight.flight_scene import FlightScene
from cocap_opt.flight.flights import Flight, LimitError
from cocap_opt.flight.ways import NOTE, Part, has_homes, parts_of_take, pauses_of, records_of
from cocap_opt.footage.losses import Seen, WhatIf, steps_in_words, what_if
from cocap_opt.missions import FORMATS, Writer
from cocap_opt.output.files import PlanReader, check_output, save_files
from cocap_opt.output.printing import Listing, Record, print_result
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.options import Option, UsageError
from cocap_opt.stop import Interrupt

_log = logging.getLogger(__name__)

_MARGINS = 0.25, 0.5, 1.0  # m, which are tried for a plan that cannot be flown

Smooth = Annotated[bool, FLAG(name="--smooth", help="fly with continuous speed and acceleration")]
StepSeconds = Annotated[
    float | None,
    Parameter(name="--step", help="seconds of a step, if the scene defines none"),
]
Margin = Annotated[
    float | None,
    Parameter(
        help="metres by which drones may come nearer to people than the scene's `people` and "
        "`over_people`"
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class _FlightOptions:
    """The options of commands that fly a plan."""

    step: StepSeconds = None
    smooth: Smooth = False
    margin: Margin = None

    def flight(self, problem: Problem, plan: Plan, is_local: bool) -> Flight:
        """Returns the flight of a plan as the options ask for it.

        Parameters
        ----------
        is_local : nobody asks where it is on the Earth

        Raises
        ------
        ProblemError
            If it breaks a rule or cannot be flown; one line, with what would do.
        """
        flown_in = self._scene(problem)
        try:
            return (flown_in.without_earth if is_local else flown_in).flight(plan, self.smooth)
        except LimitError as error:
            ways = [
                f"set {_longer(problem, error.any_plan)} in the scene's recipe and plan again"
                if self.step is None
                else f"--step {error.step:g} would do"
            ]
            if self.smooth and self.margin is None:
                ways += _margins_that_do(flown_in.problem, plan)
            before = f"{error.way_out}, or " if error.way_out else "; "
            raise ProblemError(f"{error.words}{before}{', or '.join(ways)}") from error

    def _scene(self, problem: Problem) -> FlightScene:
        """Returns the scene that plans of a problem are flown in."""
        if self.step is not None and not Option("--step").require_seconds(self.step) > 0:
            raise UsageError("--step: must be more than 0 seconds")
        try:
            return FlightScene.of(problem, self.step, self.margin)
        except FieldError as error:
            raise UsageError(f"--{error}") from error
        except ProblemError as error:  # it is out of range, or too short for the drones' limits
            raise UsageError(f"--step: {error}") from error


_AS_PLANNED = _FlightOptions()


def _longer(problem: Problem, step: float) -> str:
    """Says which step a recipe must have, and how many of them last as long as those of before."""
    steps = math.floor(problem.horizon * (problem.step or 0.0) / step)
    return f"step = {step:g}" + (f" and steps = {steps}" if steps > 1 else "")


def _margins_that_do(problem: Problem, plan: Plan) -> Iterator[str]:
    """Yields the least margin with which drones can fly a plan smoothly, if there is one."""
    asked = problem.airspace.people_aside
    for margin in _MARGINS:
        if margin > asked / 2:
            return
        nearer = FlightScene.of(problem, None, margin)
        try:
            nearer.flight(plan, smooth=True)
        except ProblemError:
            continue
        kept = nearer.problem.airspace.people_aside
        yield f"fly with --margin {margin:g}, {kept:g} m from people in place of {asked:g} m"
        return


# -- fly --------------------------------------------------------------------------------

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
    flown: _FlightOptions = _AS_PLANNED,
    every: Annotated[
        float | None,
        Parameter(help="seconds between rows (default: one row per step, ten with --smooth)"),
    ] = None,
    start: Annotated[
        str | None,
        Parameter(help="time of step 0, such as 2026-05-01T10:00:00Z, for formats with dates"),
    ] = None,
    autopilot: Annotated[
        Autopilot | None,
        Parameter(
            help="autopilot of the missions (default: px4 for .plan, ardupilot for .waypoints)"
        ),
    ] = None,
    items: Annotated[
        Whole | None,
        Parameter(help="mission items that the board can store (default: that of usual boards)"),
    ] = None,
    local: Annotated[bool, FLAG(name="--local", help="leave out latitudes and longitudes")] = False,
    hovering: Annotated[
        bool, FLAG(name="--hovering", help="also write plans in which no drone moves")
    ] = False,
    json: Json = False,
) -> int:
    """Export a plan as a flight, checked against rules, obstacles and limits.

    A .csv file has t (s), x, y, z (m, coordinates of the map), yaw (degrees, 0 along x,
    counter-clockwise) and pitch (degrees, 0 level, below is negative) of each drone, heights above
    ground and take-off, and latitude and longitude where the scene has a reference system. A
    .geojson or .kml file has tracks, cameras' footprints and people's walks on the Earth; a .glb
    file is an animated scene (glTF) for Blender and viewers in browsers; a .pdf file is a sheet
    for the crew.

    Not checked: wind, deviations from the planned flight, take-off and landing; notes below the
    answer list what else was not checked.

    A plan in which no drone moves is rejected unless you pass --hovering.

    A smooth flight that comes too near to people is rejected; the message tells you how much extra
    distance to plan with and which --margin to fly with.

    Missions of waypoints, a file per drone: .plan (QGroundControl, for PX4, or for ArduPilot with
    --autopilot) and .waypoints (for ArduPilot). Each is for the autopilot in its name only.
    Synchronised flights: .skyc (Skybrush) and .crazyflie.csv (polynomials, with --smooth).

    Cameras, to triangulate what was filmed: .opencv.json, .colmap.zip and .pose2sim.toml have the
    intrinsics of each drone's camera, and its pose at each row's moment; --every 0.04 gives those
    of a video of 25 frames a second. Cones, which have no image, are rejected.

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
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan, any_objective=True)
    problem, planned, cut_short = given.problem, given.plan, given.cut_short
    if FORMATS[suffix].takes_off and problem.begins_in_the_air:
        raise UsageError(
            f"-o: must not end with {suffix}, for these missions take off, and the scene is the "
            "rest of a mission whose drones are in the air; .csv has their places"
        )
    try:
        flight = flown.flight(problem, planned, local)
        flight = flight._replace(start=begins, cut_short=cut_short)
        parts = parts_of_take(flight.flown.problem, planned) if has_homes(problem) else ()
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
    notes += _of_homes(parts, suffix)
    notes += _strays(output, suffix, files)
    if words := pauses_of(parts):
        _log.warning("%s: %s", plan, words)
    for warning in mission.warnings:
        _log.warning("%s", warning)
    with Interrupt.caught():  # who presses Ctrl-C now is told what is written, unless pressed twice
        save_files(files)
        if json:
            rows = {"drones": flight.rows(), "notes": notes}
            if parts:
                rows["from_home"] = records_of(parts)
            print_result({**answer, **rows, "files": [*files]}, json)
        else:
            print_result({**answer, "file": " ".join(map(str, files))}, json)
            shown = [words for words in notes if words != cut_short]  # which stands at the top
            if parts:
                _in_the_air(parts).print()
            _tightest(flight.rows(), shown).print()
    return 0


def _of_homes(parts: Sequence[Part], suffix: str) -> Iterator[str]:
    """Yields what ways from and to home are, and that missions do not hold them."""
    if parts:
        yield NOTE
        if FORMATS[suffix].takes_off:
            yield (
                f"{suffix} holds no ways from and to home: the sheet (.pdf) and --json have them; "
                "missions take off and land straight below their first and last places"
            )


def _in_the_air(parts: Sequence[Part]) -> Listing:
    """Returns the table of each drone's time in the air in each part, and of its battery."""
    rows = [
        {
            **({"steps": part.words} if len(parts) > 1 else {}),
            "drone": drone.drone, "out (s)": drone.out.seconds, "take (s)": drone.filming,
            "back (s)": drone.back.seconds, "waits (s)": drone.out.waits + drone.back.waits,
            "in the air (s)": drone.seconds, "battery (s)": drone.endurance,
        }
        for part in parts
        for drone in part.drones
    ]  # fmt: skip
    return Listing("from take-off to landing", rows)


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
    if field in ("earth", "step") or (field or "").startswith("robots["):
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


# -- robustness ------------------------------------------------------------------------

_USUAL = Changes()


def _robustness(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    seed: Seed = 0,
    flown: _FlightOptions = _AS_PLANNED,
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
    lost: Annotated[
        list[Whole] | None,
        Parameter(
            negative="",
            consume_multiple=True,
            help="steps at which drones are lost, one at a time (default: each at its worst step)",
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Evaluate a plan when people deviate from their walks, or a drone is late or lost.

    Nobody reacts: all others fly as planned. J is computed between the steps, too. Distances are
    the least at any moment, and rules are checked at every moment, on the flights' polynomials.
    If a distance is not kept, the table shows the one to plan with.

    Example: cocap-opt robustness corridor plan.json --step 2 --smooth --late 1 3 --lag 0.5
    """
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan, any_objective=True)
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
        found = what_if(flight, changes, lost)
    except ProblemError as error:
        raise UsageError(f"--{error}") from error
    delay, to_people = tolerated_delay(flight), tolerated_delay_of_people(flight)
    notes = [*_notes(flight, delay, to_people), *_asking(found)]
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
        title = f"{problem.name}, {kind}: what is left of J = {found.changes[0].reward:,.2f}"
        Listing(title, [_shown(row) for row in found.changes], notes).print()
        _losses(found).print()
    return 0


def _losses(found: WhatIf) -> Listing:
    """Returns the table of lost drones below the plan, with who is no longer seen by two."""
    notes = [
        "a drone that is lost at a step contributes nothing from there on, and has left the scene: "
        "what becomes of it is not looked at; its worst step is the last one at which it costs as "
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
    """Returns a row of the losses as people read it."""
    shares = {"J (%)": left.share, "seen by two (%)": seen.by_two, "by none (%)": seen.by_none}
    percents = {name: None if part is None else 100 * part for name, part in shares.items()}
    return {"change": left.change, **percents}


def _shown(row: ChangeRow) -> Record:
    """Returns a row of the changes as people read it."""
    columns: Record = {
        "change": row.change,
        "J (%)": None if row.share is None else 100 * row.share,
        "drones (m)": row.least_distance,
    }
    if row.people_distance is not None:
        columns["people (m)"] = row.people_distance
    asked = [metres for metres in (row.ask_drones, row.ask_people) if metres is not None]
    way_out = f"; plan with {' and '.join(f'{metres:g}' for metres in asked)} m" if asked else ""
    return {**columns, "rules": f"{row.rules}{way_out}"}


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


def _asking(found: WhatIf) -> Iterator[str]:
    """Yields a sentence on the distances to plan with, where there are any."""
    rows = [*found.changes, *(row.left for row in found.losses)]
    if any(row.ask_drones is not None or row.ask_people is not None for row in rows):
        yield (
            "distances to plan with are those of the scene plus the shortfall; they lead to a "
            "different plan: evaluate it again, with --margin larger by the shortfall to people"
        )


COMMANDS = {"fly": _fly, "robustness": _robustness}
