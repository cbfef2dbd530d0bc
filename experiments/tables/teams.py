"""Rows that compare teams: what each team's plans reach, and what no plan of the team exceeds."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from cocap_opt.experiments.tables.columns import TableColumn, read_rows
from cocap_opt.experiments.tables.rows import ERROR
from cocap_opt.output.printing import Listing, Record
from cocap_opt.text import counted, in_ranges, number_in_words, rounded_up

TEAMS = "teams.csv"  # in a sweep's folder
_REWARD = {"unit": "px^0.5/m", "least": -(2**63 - 1)}
_PART = {"unit": "1", "most": 1}
_ROUNDING = 1e-9


@dataclass(frozen=True, kw_only=True)
class TeamRow:
    """A team: its plans for the highest J and for the most views, and the bounds on both."""

    scene: Annotated[str, TableColumn("The scene's name.")]
    seed: Annotated[int, TableColumn("The seed.")]
    drones: Annotated[int, TableColumn("Drones of the team.")]
    camera: Annotated[str, TableColumn("Camera of the drones; empty: as in the scene.")]
    height: Annotated[
        float | None,
        TableColumn("Flight height; empty: as in the scene.", unit="m"),
    ]
    reward: Annotated[float | None, TableColumn("J of the best plan found.", **_REWARD)] = None
    bound: Annotated[
        float | None, TableColumn("A certified number that no plan's J exceeds.", **_REWARD)
    ] = None
    gap: Annotated[float | None, TableColumn("(bound - reward) / bound.", **_PART)] = None
    gain: Annotated[
        float | None,
        TableColumn("Gain of J over the best plan found with one drone fewer.", **_REWARD),
    ] = None
    gain_bound: Annotated[
        float | None,
        TableColumn("Bound on that gain: bound minus J of the best plan with one drone fewer.",
                    **_REWARD),
    ] = None  # fmt: skip
    cameras: Annotated[
        int, TableColumn("Number of drones that must see a person for the person to count.")
    ] = 2
    seen: Annotated[
        float | None,
        TableColumn(
            "Share of person-steps at which the person counts, in the plan of largest J.",
            **_PART,
        ),
    ] = None
    seen_most: Annotated[
        float | None, TableColumn("The same share in the plan made for views alone.", **_PART)
    ] = None
    seen_bound: Annotated[
        float | None, TableColumn("A certified share that no plan exceeds.", **_PART)
    ] = None
    apart: Annotated[
        float | None,
        TableColumn("Share of person-steps that two drones see from at least 30 degrees apart, in "
                    "the plan of largest J.", **_PART),
    ] = None  # fmt: skip
    median_error: Annotated[
        float | None,
        TableColumn(
            "Median over person-steps of the RMS error of a point, not interpolated, in the plan "
            "of largest J; empty if the error is infinite for more than half.",
            unit="mm",
        ),
    ] = None
    flight_seconds: Annotated[
        float | None,
        TableColumn("Duration of the take; empty if the duration of steps is unknown.", unit="s"),
    ] = None
    metres: Annotated[
        float | None,
        TableColumn("The longest path of a drone, in the plan of largest J.", unit="m"),
    ] = None
    reason: Annotated[
        str,
        TableColumn("Why the search for J stopped. optimal: the plan is the best; error, exceeded "
                    "or died: there is no result."),
    ] = ""  # fmt: skip
    reason_seen: Annotated[
        str, TableColumn("Why the search for views stopped; empty if such a team is impossible.")
    ] = ""
    digest: Annotated[str, TableColumn("Digest of the team's scene.")] = ""
    plan: Annotated[str, TableColumn("File of the plan of largest J.")] = ""
    certificate: Annotated[str, TableColumn("File that proves bound.")] = ""
    plan_seen: Annotated[str, TableColumn("File of the plan made for views alone.")] = ""
    certificate_seen: Annotated[
        str, TableColumn("File that proves seen_bound: a bound on the views of any plan.")
    ] = ""
    message: Annotated[str, TableColumn("Why there is no plan, in words.")] = ""

    @property
    def failed(self) -> bool:
        """A computation ended with an error, which is not a result."""
        return ERROR in (self.reason, self.reason_seen)

    @property
    def reached(self) -> float:
        """The larger share of the two plans; -1 without a plan."""
        return max([-1.0, *(s for s in (self.seen, self.seen_most) if s is not None)])

    @property
    def told_bound(self) -> str | None:
        """The share that no plan exceeds, in %; the best plan's share if the two are equal."""
        if self.seen_bound is None:
            return None
        attains = self.reached >= self.seen_bound - _ROUNDING
        return rounded_up(100 * min(self.reached if attains else self.seen_bound, 1.0), 1)

    @property
    def most(self) -> float:
        """The share that no plan exceeds; 1 if nothing is proved."""
        return 1.0 if self.seen_bound is None else self.seen_bound


COLUMNS = TableColumn.all_of(TeamRow)


def load_teams(folder: Path) -> list[TeamRow]:
    """Reads teams.csv.

    Raises
    ------
    FileError
        If it is not such a table, has no rows, or has a number that is out of range.
    """
    return [TeamRow(**values) for values in read_rows(folder / TEAMS, COLUMNS)]


def records(rows: Sequence[TeamRow]) -> list[dict[str, Any]]:
    """Returns rows as plain data."""
    return [asdict(row) for row in rows]


def teams_table(rows: Sequence[TeamRow]) -> Listing:
    """Returns the table for a terminal; shares are in %."""
    cameras = number_in_words(rows[0].cameras)
    asked = {
        name: any(getattr(row, name) not in ("", None) for row in rows)
        for name in ("camera", "height")
    }
    table: list[Record] = []
    for row in rows:
        record: Record = {"drones": row.drones}
        record |= {name: getattr(row, name) for name, is_asked in asked.items() if is_asked}
        record |= {
            "J": row.reward,
            "at most": row.bound,
            "gain": row.gain,
            cameras: percent(row.seen),
            "best": percent(row.seen_most),
            "none above": row.told_bound,
            "apart": percent(row.apart),
            "mm": None if row.median_error is None else f"{row.median_error:,.0f}",
        }
        table.append(record)
    notes = [
        f"J, {cameras}, apart and mm describe the plan with the highest J",
        "at most: no plan has a higher J; gain: J compared with one drone fewer",
        f"{cameras}: % of person-steps that at least {cameras} drones see",
        "best: the same in the plan made for these views; none above: no plan exceeds this",
        "apart: % of person-steps that two drones see from at least 30 degrees apart",
        "mm: median RMS error of a point over person-steps",
    ]
    refused = [row.message for row in rows if row.message]
    return Listing("teams", table, [*notes, *dict.fromkeys(refused)])


def sentences(rows: Sequence[TeamRow], share: float) -> Iterator[str]:
    """Yields, by camera and height, the smallest team found, and what is proved of smaller ones.

    Parameters
    ----------
    share : share of person-steps that at least `cameras` drones must see
    """
    solved = []
    for asked in grouped(rows):
        group = [row for row in asked if row.reason_seen]
        if group:
            words, text = kind_words(group[0]), " ".join(_about(group, asked, share))
            yield f"{words}: {text}" if words else text
            solved.append(group)
    if len(solved) > 1:
        yield from _best_of_all([row for group in solved for row in group], share)


def _best_of_all(rows: Sequence[TeamRow], share: float) -> Iterator[str]:
    """Yields the camera and height that need the fewest drones; if none suffice, see the most."""
    enough = [row for row in rows if row.reached >= share - _ROUNDING]
    if enough:
        best = min(enough, key=lambda row: (row.drones, -row.reached))
        words = "The smallest of all these teams"
    else:
        best = max(rows, key=lambda row: (row.reached, -row.drones))
        words = "The best of all these teams"
    if best.reached >= 0:
        team = f"{counted(best.drones, 'drone')}, {kind_words(best)}"
        yield f"{words}: {team} ({percent(best.reached)} %)."


def kind_words(row: TeamRow) -> str:
    """Returns words for a camera and a height, e.g. "skydio-2, at 9 m"; empty without both."""
    height = "" if row.height is None else f"at {row.height:g} m"
    return ", ".join(filter(None, (row.camera, height)))


def grouped(rows: Sequence[TeamRow]) -> list[list[TeamRow]]:
    """Returns rows grouped by camera and height; each group is sorted by the number of drones."""
    found: dict[tuple[str, float | None], list[TeamRow]] = {}
    for row in rows:
        found.setdefault((row.camera, row.height), []).append(row)
    return [sorted(group, key=lambda row: row.drones) for group in found.values()]


def _about(group: Sequence[TeamRow], asked_for: Sequence[TeamRow], share: float) -> Iterator[str]:
    """Yields sentences about teams of one kind.

    Parameters
    ----------
    group : teams with a search for views
    asked_for : all teams of the kind, including those without room for all drones
    """
    cameras = group[0].cameras
    asked = f"{100 * share:g} % of person-steps by {number_in_words(cameras)} drones"
    enough = [row for row in group if row.reached >= share - _ROUNDING]
    if enough:
        fewest, reached = enough[0].drones, percent(enough[0].reached)
        yield f"The smallest team found to film {asked}: {counted(fewest, 'drone')} ({reached} %)."
    else:
        fewest, best = group[-1].drones + 1, max(group, key=lambda row: row.reached)
        yield f"No team was found that films {asked}."
        if best.reached >= 0:
            yield f"The most is {percent(best.reached)} %, with {counted(best.drones, 'drone')}."
    fewer = [row for row in group if cameras <= row.drones < fewest]
    missing = sorted(set(range(cameras, fewest)) - {row.drones for row in group})
    if fewer:
        yield _limit(fewer, share, "" if missing else " or fewer")
    failed = [row.drones for row in asked_for if row.drones in missing]
    unasked = [number for number in missing if number not in failed]
    for words, numbers in (("No answer for", failed), ("Not asked about", unasked)):
        if numbers:
            yield f"{words}: {in_ranges(numbers)}."


def _limit(group: Sequence[TeamRow], share: float, fewer: str) -> str:
    """Returns a sentence on the share that no plan of these teams exceeds."""
    numbers = [str(row.drones) for row in group]
    if fewer:
        words = f"{counted(group[-1].drones, 'drone')}{fewer if numbers[1:] else ''}"
    else:
        words = f"{' or '.join(filter(None, (', '.join(numbers[:-1]), numbers[-1])))} drones"
    most = max(group, key=lambda row: row.most)
    if most.most >= 1:
        return f"Open: {words} may be able to film all person-steps like this."
    told = f"Proved: no plan of {words} exceeds {most.told_bound} %"
    return f"{told}." if most.most < share else f"{told}, which does not rule out such a team."


def percent(part: float | None) -> str | None:
    """Returns a share in % with one decimal; only a share of 1 is 100."""
    if part is None or math.isnan(part):
        return None
    return "100" if part >= 1 else f"{min(100 * part, 99.9):.1f}"
