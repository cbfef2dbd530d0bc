"""Tables of the library: for the terminal, as CSV, and for the page of results."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence

from cocap_opt.experiments.library.records import Digest, Library, Record, Standing
from cocap_opt.output.printing import Listing
from cocap_opt.output.printing import Record as Row

_PLACES = 2  # decimals of J in tables; --csv has all


def short_rows(standings: Sequence[Standing]) -> list[Row]:
    """Returns a row for each instance, short enough for a line of a terminal."""
    return [
        {
            "instance": found.entry.name,
            "drones": "-" if found.digest is None else f"{found.digest.drones}",
            "J": _number(found.plan, found),
            "bound": _number(found.bound, found),
            "gap": None if found.has_no_plan or math.isinf(found.gap) else found.gap,
            "state": found.state,
        }
        for found in standings
    ]


def by_gap(standings: Iterable[Standing]) -> list[Standing]:
    """Returns instances by gap, largest first; instances without plan or bound come before all."""
    return sorted(standings, key=lambda found: -found.gap)


def full_rows(standings: Sequence[Standing]) -> list[Row]:
    """Returns everything known about each instance as plain values; None if unknown."""
    rows = []
    for found in standings:
        size = found.digest or Digest(found.entry.name, 0, 0, 0, "", "")
        row: Row = {
            "instance": found.entry.name,
            "split": found.entry.split,
            "state": found.state,
            "drones": size.drones or None,
            "people": size.people or None,
            "steps": size.steps or None,
            "reward": None if found.plan is None else found.plan.value,
            "bound": None if found.bound is None or found.has_no_plan else found.bound.value,
            "gap": None if found.has_no_plan or math.isinf(found.gap) else found.gap,
        }
        for kind, best in (("plan", found.plan), ("bound", found.bound)):
            row |= {f"{kind}_{key}": getattr(best, key, None) for key in ("who", "date", "program")}
        row |= {
            "digest": size.digest,
            "sha256": size.sha256,
            "source": found.entry.family.source,
        }
        rows.append(row)
    return rows


def history_rows(records: Sequence[Record]) -> list[Row]:
    """Returns the records of an instance as rows, in the same order."""
    return [
        {
            "date": record.date,
            "kind": record.kind,
            "value": "no plan" if record.kind == "bound" and record.value < 0 else record.value,
            "who": record.who,
            "program": record.program,
            "seconds": None if math.isnan(record.seconds) else record.seconds,
        }
        for record in records
    ]


def in_words(standings: Sequence[Standing]) -> str:
    """States how many instances there are, and how many of them are solved."""
    states, splits = (
        Counter(found.state for found in standings),
        Counter(found.entry.split for found in standings),
    )
    drones = [found.digest.drones for found in standings if found.digest is not None]
    team = f" with {min(drones)} to {max(drones)} drones" if drones else ""
    left = f", {states['none']} without plan or bound" if states["none"] else ""
    return (
        f"{len(standings)} instances{team}, "
        f"{splits['train']} for training and {splits['test']} for tests: {states['solved']} "
        f"solved, {states['open']} open{left}"
    )


def library_in_markdown() -> str:
    """Returns the table of all instances, for the page of results."""
    rows = [
        {
            "instance": found.entry.name,
            "for": found.entry.split,
            "drones": found.digest.drones,
            "people": found.digest.people,
            "steps": found.digest.steps,
            "J": _number(found.plan, found),
            "bound": _number(found.bound, found),
            "gap": None if found.has_no_plan or math.isinf(found.gap) else found.gap,
            "state": found.state,
            "since": max(r.date for r in (found.plan, found.bound) if r is not None),
        }
        for found in Library().standings()
        if found.digest is not None and (found.plan or found.bound)
    ]
    return Listing("", rows).markdown


def library_in_words() -> str:
    """States how many instances the library has, and how many of them are solved."""
    return in_words(Library().standings())


def _number(record: Record | None, found: Standing) -> str:
    if found.has_no_plan:
        return "no plan"
    return "-" if record is None else f"{record.value:,.{_PLACES}f}"
