"""The command `quality`, which measures how well a plan films people."""

import logging
import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import FLAG, Json, PlanPath, Scene, Seed, Whole, load_planned
from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError, within
from cocap_opt.files.documents import encode
from cocap_opt.footage.quality import Assumptions, Quality
from cocap_opt.footage.summary import OfPerson, whole_percent
from cocap_opt.letters import folded
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import (
    GivenPlan,
    PlanReader,
    check_output,
    make_folder,
    save_bytes,
    save_files,
)
from cocap_opt.output.printing import Listing, Record, line_width, rounded
from cocap_opt.referee import check
from cocap_opt.run.options import Option, UsageError
from cocap_opt.run.quality_bound import QualityBound
from cocap_opt.run.takes import take_rows
from cocap_opt.stop import Interrupt
from cocap_opt.text import printable

_log = logging.getLogger(__name__)

_MOST_PEOPLE = 12  # people listed in a terminal
_WIDTH = 80  # characters per line
_USUAL = Assumptions()


def _quality(
    scene: Scene,
    plan: PlanPath,
    /,
    *,
    seed: Seed = 0,
    at_least: Annotated[
        float | None,
        Parameter(
            help="share of a person, by unhidden solid angle, that a drone must see (default: the "
            "scene's share, or 0.3)"
        ),
    ] = None,
    pixel_error: Annotated[
        float, Parameter(help="error of a detected point in pixels, along each image axis")
    ] = _USUAL.pixel_error,
    position_error: Annotated[
        float, Parameter(help="error of a drone's position in metres, along each axis")
    ] = _USUAL.position_error,
    attitude_error: Annotated[
        float, Parameter(help="error of a camera's direction in degrees, about each axis")
    ] = math.degrees(_USUAL.attitude_error),
    exposure: Annotated[
        float, Parameter(help="exposure time of an image in seconds")
    ] = _USUAL.exposure,
    drone_size: Annotated[float, Parameter(help="width of a drone in metres")] = _USUAL.drone_size,
    drone_pixels: Annotated[
        float,
        Parameter(help="smallest width in px at which a drone is visible in another's image"),
    ] = _USUAL.drone_pixels,
    csv: Annotated[
        Path | None, Parameter(help="file to write, with a row per person and step")
    ] = None,
    bound: Annotated[
        bool, FLAG(help="also prove upper bounds on these shares for all plans")
    ] = False,
    cameras: Annotated[
        Whole | None,
        Parameter(help="with --bound: prove shares for up to this many drones (default: 2)"),
    ] = None,
    seconds: Annotated[
        float | None,
        Parameter(
            name="--seconds",
            help="with --bound: seconds for each number of drones, excluding coverage (default: "
            "10)",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        Parameter(
            name=["-o", "--output"],
            help="with --bound: folder for the certificates and their scenes",
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Show how well a plan films people: by how many drones, how accurately, how sharply.

    It prints the shares of person-steps seen by two drones, by three, and by two at least 30
    degrees apart; the error of a point triangulated from these views; motion blur, if the scene
    defines a step length; the worst moments; and a line per person. Errors are standard deviations.
    With --bound it also proves how large the shares can be in any plan of these drones.

    Example: cocap-opt quality corridor plan.json --bound --cameras 2 -o certificates
    """
    numbers = {
        "at_least": _USUAL.at_least if at_least is None else at_least, "pixel_error": pixel_error,
        "position_error": position_error, "attitude_error": attitude_error, "exposure": exposure,
        "drone_size": drone_size, "drone_pixels": drone_pixels,
    }  # fmt: skip
    assumptions = _assumptions(numbers)
    if csv is not None:
        check_output(csv, scene, plan)
        Option("--csv").file(csv, (".csv",))
    for option, value in (("-o", output), ("--cameras", cameras), ("--seconds", seconds)):
        if value is not None and not bound:
            raise UsageError(f"{option}: applies to bounds; add --bound")
    seconds = 10.0 if seconds is None else seconds
    Option("--seconds").require_duration(seconds)
    given = PlanReader(scene, load_planned(scene, seed)).plan(plan, any_objective=True)
    if cut_short := given.cut_short:
        _log.warning("%s: %s", plan, cut_short)
    try:
        limits = QualityBound.of(given.problem, cameras, at_least) if bound else None
    except ProblemError as error:
        raise Option.refused(error) from error
    if at_least is None:
        numbers["at_least"] = Assumptions.of(given.problem).at_least
        assumptions = assumptions.replace(at_least=numbers["at_least"])
    found = Quality.of(given.problem, given.plan, assumptions=assumptions)
    make_folder(output)
    if csv is not None:
        save_bytes(csv, found.table.to_csv(index=False, lineterminator="\n").encode())
    obeys_rules = check(given.problem, given.plan).valid
    if limits is not None:
        limits = _proved(limits, given, seconds, output)
    if json:
        answer = {"scene": given.problem.name, "seed": seed, **_record(found)}
        if rows := take_rows(given.problem, given.plan):
            answer["takes"] = [
                row | summary._asdict() for row, summary in zip(rows, found.by_take, strict=True)
            ]
        first: Record = {"cut_short": cut_short} if cut_short else {}
        last = {} if limits is None else {"bound": _bound_record(limits, found, obeys_rules)}
        print_result({**first, **answer, "assumptions": numbers, "file": csv, **last}, json)
    else:
        width = min(line_width(), _WIDTH)
        sys.stdout.write(f"{printable(found.words(width), chr(10))}\n\n")
        if rows := take_rows(given.problem, given.plan):
            by_take = ", ".join(f"{row['take']} {rounded(row['reward'])}" for row in rows)
            words = folded(f"J take by take: {by_take}", width)
            sys.stdout.write(f"{printable(words, chr(10))}\n\n")
        if limits is not None:
            for words in limits.sentences(found, obeys_rules):
                sys.stdout.write(f"{folded(words, width)}\n")
            sys.stdout.write("\n")
        _people(found).print()
    return 0


def _proved(
    limits: QualityBound, given: GivenPlan, seconds: float, output: Path | None
) -> QualityBound:
    """Returns the proved bounds, within the given seconds each, and writes their files."""
    with Interrupt.caught() as interrupt, Watch.on_terminal(given.problem.name) as watch:
        limits = limits.proved(interrupt, seconds, given.plan, watch=watch)
    if output is not None:
        contents = {}
        for number, result in enumerate(limits.results, 1):
            if (file := result.certificate) is not None:
                file = file.with_objective(limits.scene(number).objective)
                contents[output / f"seen-by-{number}.bound.json"] = encode(file)
        save_files(contents)
        for old in output.glob("seen-by-*.json"):
            if old not in contents:  # from more drones, or from another scene
                old.unlink()
    return limits


def _bound_record(limits: QualityBound, found: Quality, obeys_rules: bool) -> Record:
    """Returns bounds on quality as plain data; shares are 0 to 1."""
    numbers = range(1, limits.cameras + 1) if limits.person_steps else ()
    return {
        "person_steps": limits.person_steps,
        "weighted": limits.is_weighted,
        "no_plan": limits.no_plan,
        "obeys_rules": obeys_rules,
        "most": [
            {**limits.most(m)._asdict(), "share_of_plan": limits.share(found, m)} for m in numbers
        ],
        "sums": [result.bound for result in limits.results],
        "seconds": math.fsum(result.seconds for result in limits.results),
        "words": list(limits.sentences(found, obeys_rules)),
    }


def _assumptions(options: Mapping[str, float]) -> Assumptions:
    """Returns the assumptions given by options; a UsageError names the option that is out of
    range.
    """
    try:
        within(options["attitude_error"], 0, 180, "attitude_error", "degrees")
        attitude = math.radians(options["attitude_error"])
        return Assumptions(**{**options, "attitude_error": attitude})
    except ProblemError as error:
        raise Option.refused(error) from error


def _record(found: Quality) -> Record:
    """Returns a plan's quality as plain data; shares are 0 to 1."""
    return {
        **found.summary._asdict(),
        "worst": found.worst,
        "people": [person._asdict() for person in found.by_person],
        "table": found.table.to_dict("records"),
    }


def _people(found: Quality) -> Listing:
    """Returns a table with a line per person; if there are many, of those who are seen least."""
    people = found.by_person
    if len(people) > _MOST_PEOPLE:
        people = sorted(people, key=lambda person: (person.by_two, person.by_three))
    notes = [
        "two, three: % of steps at which at least that many drones see the person",
        "apart: % of steps at which two drones see the person from at least 30 degrees apart",
        "mm: median RMS error of a point",
    ]
    listing = Listing("person by person", [_shown(person) for person in people], notes)
    return listing.first(_MOST_PEOPLE, "people whom two drones see least often")


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
