"""Who films whom, and how well, phase by phase."""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from cocap_opt.data import BoolArray
from cocap_opt.flight.flights import Flight
from cocap_opt.footage.moments import Moment, worst_moments
from cocap_opt.footage.quality import Quality
from cocap_opt.footage.strip import draw_strip
from cocap_opt.footage.summary import whole_percent
from cocap_opt.missions.sheet.clock import TAKE, Clock, Phase
from cocap_opt.missions.sheet.pages import INNER, Inset, Table
from cocap_opt.problem import Problem
from cocap_opt.text import in_ranges, shortened

_OFTEN = 0.5  # share of a phase's steps
_ROW = 5.0  # mm, height of a person's strip
_HALF = 8.0  # mm, half the width of a time below the strips
_MOST_STRIPS = 40  # people in one picture
_MOST_NAMES, _LETTERS = 20, 40  # people on a drone's card, and letters of each name
_TAG = 16  # letters beside a strip; longer names are replaced by the map's P and number
STRIP = Inset(26.0, 9.0, 6.0)  # around the strips of a picture


def quality_of(flight: Flight) -> Quality | None:
    """Returns the quality of the plan; None if nobody counts."""
    found = Quality.of(flight.flown.problem, flight.plan)
    return found if found.by_person else None


def who_films_whom(
    found: Quality, names: Sequence[str], phases: Sequence[Phase], clock: Clock
) -> Table:
    """Returns the table of drones that see each person, in each phase of the take.

    Parameters
    ----------
    names : names of the people who count
    """
    takes = [phase for phase in phases if phase.kind == TAKE]
    step = clock.step
    heads = [
        f"{clock.at(p.first * step, p.part)} to {clock.at(p.last * step, p.part)}" for p in takes
    ]
    rows = [
        (
            name,
            *(_drones(found.seen[p.first : p.last + 1, :, person.actor]) for p in takes),
        )
        for person, name in zip(found.by_person, names, strict=True)
    ]
    return Table(("person", *heads), rows)


def _drones(seen: BoolArray) -> str:
    """Returns the drones that see a person [n, R] at half of the steps or more, and the others in
    brackets.

    Parameters
    ----------
    seen : True if a drone sees the person
    """
    shares = seen.mean(axis=0)
    often = in_ranges(np.flatnonzero(shares >= _OFTEN).tolist())
    rarely = in_ranges(np.flatnonzero((shares > 0) & (shares < _OFTEN)).tolist())
    return " ".join(filter(None, [often, f"({rarely})" if rarely else ""])) or "none"


def filmed_by(found: Quality | None, drone: int, problem: Problem) -> str:
    """Returns the first people whom a drone sees, and the number of steps that count at which it
    does.
    """
    if found is None:
        return ""
    told = []
    for person in found.by_person:
        j = person.actor
        share = float(found.seen[found.counts[:, j], drone, j].mean())
        if share:
            told.append(f"{shortened(problem.person(j), _LETTERS)} {whole_percent(share)}")
    more = len(told) - _MOST_NAMES
    rest = f" and {more} more" if more > 0 else ""
    return ", ".join(told[:_MOST_NAMES]) + rest or "nobody"


def quality_table(found: Quality, names: Sequence[str], clock: Clock) -> Table:
    """Returns the table of people's quality, with the time of each person's worst moment."""
    moments = reversed(worst_moments(found.views, found.angles, found.counts))
    worst = {moment.person: _by_clock(moment, clock) for moment in moments}
    rows = [
        (
            name, whole_percent(person.by_two), whole_percent(person.by_three),
            _millimetres(person.median), worst.get(person.actor, "none"),
        )
        for person, name in zip(found.by_person, names, strict=True)
    ]  # fmt: skip
    if len(rows) > 1:
        all_people = found.summary
        shares = whole_percent(all_people.by_two), whole_percent(all_people.by_three)
        rows.append(("all", *shares, _millimetres(all_people.median), ""))
    heads = ("person", "two cameras", "three cameras", "typical error", "worst moment")
    return Table(heads, rows, frozenset({1, 2, 3}))


def _by_clock(moment: Moment, clock: Clock) -> str:
    begin, end = (clock.time(step * clock.step) for step in (moment.first, moment.last))
    return f"{moment.what} {f'at {begin}' if begin == end else f'from {begin} to {end}'}"


def quality_notes(found: Quality) -> list[str]:
    """Returns the sentences below the table."""
    had, number = found.assumptions, found.summary.in_pictures
    return [
        f"Drones appear in another's image {_times(number)} (at least {had.drone_pixels:g} px "
        "wide, counted at each step).",
        "Two cameras, three cameras: share of the take in which at least that many see at least "
        f"{100 * had.at_least:g} % of the person. Typical error: for half of the take, a point "
        "on the person is located to within this distance, if found in each image to within "
        f"{had.pixel_error:g} px.",
        *_of_pale_steps(found),
    ]


def _times(number: int) -> str:
    return {0: "at no time", 1: "once"}.get(number, f"{number:,} times")


def _of_pale_steps(found: Quality) -> Iterator[str]:
    """Yields what is pale in the strips; nothing if nothing is pale."""
    shown = [person.actor for person in found.by_person]
    counts = found.counts[:, shown]
    if counts.all():
        return
    is_first = found.first_step > 0 and counts[1:].all()
    yield f"Pale: {'the first step, which does' if is_first else 'steps that do'} not count."


def strips(found: Quality, clock: Clock) -> Iterator[tuple[float, Callable[[Axes], None]]]:
    """Yields pictures of strips, each with as many people as fit on a page.

    Yields
    ------
    height (mm), and the function that draws in axes within `STRIP`
    """
    people = [person.actor for person in found.by_person]
    for k in range(0, len(people), _MOST_STRIPS):
        part = people[k : k + _MOST_STRIPS]
        height = STRIP.below + STRIP.above + _ROW * len(part)
        yield height, partial(_draw_strips, found=found, people=part, clock=clock)


def _draw_strips(ax: Axes, found: Quality, people: Sequence[int], clock: Clock) -> None:
    """Draws the number of cameras that see each of some people at each moment."""
    counts = found.counts & np.isin(np.arange(found.counts.shape[1]), people)
    share = found.assumptions.at_least
    draw_strip(ax, found.people, found.views, counts, found.times, share)
    names = {person: found.people[person] for person in people}
    tags = [name if len(name) <= _TAG else f"P{person}" for person, name in names.items()]
    ax.set_yticks(ax.get_yticks(), tags)
    first, last = ax.get_xlim()
    millimetres = (INNER - STRIP.left) / (last - first)
    times = [t for t in ax.get_xticks().tolist() if 0 <= t <= last - _HALF / millimetres]
    ax.set_xticks(times, [clock.time(t) for t in times])
    ax.set_xlabel("")


def _millimetres(error: float) -> str:
    """Returns an error for the table; a dash if it is infinite or unknown."""
    return f"{error:,.0f} mm" if math.isfinite(error) else "-"
