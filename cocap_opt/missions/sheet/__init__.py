"""A printed sheet for the crew (.pdf, A4): maps, a card per drone, cues, and notes on them.

It contains what call sheets and flight plans contain: a head with blanks for the crew to fill in,
the running order by the clock, a map for each phase, cards, who films whom, and what was not
checked.
"""

import io
import warnings
from collections.abc import Iterator, Sequence
from functools import partial

import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_pdf import PdfPages

from cocap_opt.console.streams import without_warnings
from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.flight.touchdowns import Touchdowns
from cocap_opt.flight.urgent import attention
from cocap_opt.flight.ways import has_homes, parts_of_take
from cocap_opt.footage.quality import Quality
from cocap_opt.missions.export import Export
from cocap_opt.missions.sheet.cards import battery_warnings, drone_cards, people_cards
from cocap_opt.missions.sheet.clock import Clock, Phase, phases_of
from cocap_opt.missions.sheet.filmed import (
    STRIP,
    quality_notes,
    quality_of,
    quality_table,
    strips,
    who_films_whom,
)
from cocap_opt.missions.sheet.fonts import families_of
from cocap_opt.missions.sheet.letters import BODY, SMALL, STRONG
from cocap_opt.missions.sheet.maps import draw, draw_legend, ground_of
from cocap_opt.missions.sheet.pages import Inset, Pages
from cocap_opt.missions.sheet.places import degrees
from cocap_opt.missions.sheet.words import (
    running_order,
    sections,
    to_check,
    unchecked,
)
from cocap_opt.problem import Problem
from cocap_opt.text import printable, shortened

# mm, height of a map, and of one that fills a page; the second pair if so many drones and people
# are on it that their numbers hide the rest of a small map
_MAP, _MAP_OF_CROWD = (120.0, 90.0), (200.0, 160.0)
_CROWD = 30
_LEGEND, _TITLE, _HEADING = 14.0, 6.0, 16.0  # mm


def write(flight: Flight, every: float | None) -> Export:
    """Returns the sheet of a flight.

    Parameters
    ----------
    every : time between rows of the tables of all places at the end, s; None: no tables
    """
    families, missing = families_of(_names(flight))
    with (
        warnings.catch_warnings(),
        without_warnings("matplotlib.font_manager"),  # about a font without bold letters
        mpl.rc_context({"pdf.fonttype": 42, "text.parse_math": False}),
    ):
        warnings.filterwarnings("ignore", "Glyph")  # reported below
        pages = pages_of(flight, every, families)
        content = _printed(pages)
    lacking = f"characters missing from all installed fonts are printed as boxes: {missing}"
    return Export(
        {"": content},
        notes=(Note(lacking, Kind.URGENT),) if missing else (),
        facts={"pages": len(pages.figures)},
    )


def pages_of(flight: Flight, every: float | None, families: Sequence[str]) -> Pages:
    """Returns the pages of a sheet, using the given font families."""
    problem = flight.flown.problem
    parts = parts_of_take(problem, flight.plan) if has_homes(problem) else ()
    clock, found = Clock(flight.start, parts, flight.flown.step), quality_of(flight)
    grounds, pages = Touchdowns.of(flight), Pages(families)
    _write_head(pages, flight, clock, grounds)
    phases = phases_of(flight, clock.parts)
    parts_of_page = [
        partial(_draw_maps, pages, flight, clock, phases),
        partial(_write_filmed, pages, flight, clock, phases, found),
    ]
    # Shorter content fills the first page, where maps have no room.
    for write_part in (
        parts_of_page if _has_room_for_maps(pages, problem) else reversed(parts_of_page)
    ):
        write_part()
    checks = [*map(_begun, to_check(flight, bool(parts)))]
    pages.checklist("Check on the spot", checks, "\N{BALLOT BOX}")
    # Rows of cards follow each other: if the number of drones is odd, the last row has the first
    # person's card, too.
    title = "Drones, and people with their cues" if problem.actors else "Drones"
    drones = drone_cards(flight, clock, found, grounds)
    pages.cards(title, [*drones, *people_cards(flight, clock)])
    for title, blocks in sections(flight, clock, grounds, every):
        pages.section(title, blocks)
    others = [*map(_begun, unchecked(flight))]
    pages.checklist("Not checked by the program", others, "\N{BULLET}")
    pages.foot(shortened(printable(problem.name)))
    return pages


def _begun(words: str) -> str:
    """Returns a sentence with a capital first letter."""
    return f"{words[0].upper()}{words[1:]}."


def _names(flight: Flight) -> Iterator[str]:
    """Yields the names in a scene, in any script."""
    problem = flight.flown.problem
    yield problem.name
    yield from (name for actor in problem.actors for name in (actor.name, actor.take) if name)


def _write_head(pages: Pages, flight: Flight, clock: Clock, grounds: Touchdowns) -> None:
    """Writes the head of the first page, with blanks for facts that the scene cannot contain."""
    problem = flight.flown.problem
    pages.title(f"Flight sheet: {printable(problem.name)}")
    middle = np.concatenate([actor.poses[:1, :2] for actor in problem.actors] or [
        flight.flown.at(np.zeros(1)).place[:, :2]
    ]).mean(axis=0)  # fmt: skip
    pages.fields([("Date", clock.date), ("Step 0 (T)", clock.step_0)], 2)
    pages.fields([
        ("Place", ", ".join(degrees(flight, *middle.tolist()))), ("Crew call", ""),
        ("Pilot in command", ""), ("Phone", ""), ("Observers", ""), ("Radio channel", ""),
        ("Wind, weather", ""), ("Sunrise, sunset", ""), ("Nearest hospital", ""),
        ("Abort signal", ""),
    ], 2)  # fmt: skip
    pages.skip(2.0)
    urgent = [f"{note.text}." for note in attention(flight, grounds, clock.parts)]
    urgent += battery_warnings(flight, clock)
    if urgent:
        pages.box(urgent)
    pages.section("Running order", [running_order(flight, clock)], BODY)
    if clock.start is None:
        pages.sentence("T is the time of step 0, when people get their signal.", SMALL)


def _has_room_for_maps(pages: Pages, problem: Problem) -> bool:
    return pages.room - _HEADING - _LEGEND - _TITLE >= _map_heights(problem)[1]


def _draw_maps(pages: Pages, flight: Flight, clock: Clock, phases: Sequence[Phase]) -> None:
    """Draws a map for each phase."""
    problem, ground = flight.flown.problem, ground_of(flight)
    height = _map_height(problem, pages.room - _HEADING - _LEGEND - _TITLE)
    pages.heading("Map" if len(phases) == 1 else "Maps", _LEGEND + height + _TITLE)
    legend = partial(draw_legend, flight=flight, has_homes=bool(clock.parts), ground=ground)
    pages.picture(_LEGEND, legend, Inset(0.0, 0.0))
    actors = enumerate(problem.actors)
    if named := [f"P{number} {actor.name}" for number, actor in actors if actor.name]:
        pages.sentence(f"People: {', '.join(named)}.", SMALL)
    for phase in phases:
        height = _map_height(problem, pages.room - _TITLE)
        pages.need(height + _TITLE)
        pages.sentence(phase.title(clock), STRONG)
        pages.picture(height, partial(draw, flight=flight, phase=phase, ground=ground))


def _write_filmed(
    pages: Pages, flight: Flight, clock: Clock, phases: Sequence[Phase], found: Quality | None
) -> None:
    """Writes who is filmed by whom in the take, and how well; nothing if no view counts."""
    if found is None:
        return
    names = [flight.flown.problem.person(person.actor) for person in found.by_person]
    pages.section("Who films whom", [who_films_whom(found, names, phases, clock)], BODY)
    pages.sentence("Drones that see the person at half of the steps or more; in brackets: drones "
                   "that see the person less often.", SMALL)  # fmt: skip
    pages.section("How people are filmed", [quality_table(found, names, clock)], BODY)
    for words in quality_notes(found):
        pages.sentence(words, SMALL)
    for height, draw_strips in strips(found, clock):
        pages.picture(height, draw_strips, STRIP)


def _map_height(problem: Problem, room: float) -> float:
    """Returns the height (mm) of a map, reduced if that saves a page."""
    most, least = _map_heights(problem)
    return min(most, room) if room >= least else most


def _map_heights(problem: Problem) -> tuple[float, float]:
    """Returns the height (mm) of a map, and the least to which it is reduced."""
    return _MAP_OF_CROWD if len(problem.robots) + len(problem.actors) > _CROWD else _MAP


def _printed(pages: Pages) -> bytes:
    content = io.BytesIO()
    with PdfPages(content, metadata={"CreationDate": None}) as file:
        for figure in pages.figures:
            file.savefig(figure)
    return content.getvalue()
