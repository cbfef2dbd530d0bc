"""What earlier commands left in a folder, as far as it can stand beside what runs now.

Rows stay that were made with the same settings and by the same code. A scene and seed that runs
again takes its earlier planners along, so that one bound holds for all of its rows.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from cocap_opt.io import FileError, PlanFile, decode, read_bytes
from experiments.printing import counted
from experiments.rows import SOLVERS, Row
from experiments.streams import say
from experiments.sweeps.about import Run, load_run
from experiments.sweeps.cells import Store, code_digest
from experiments.sweeps.layout import plan_path
from experiments.sweeps.results import load_results
from experiments.sweeps.run import Group, Settings

Key = tuple[str, int | None]  # a scene and a seed; None where the starts are the scene file's own


class Earlier(NamedTuple):
    """Rows by scene and seed, and the commands that made them."""

    rows: dict[Key, list[Row]]
    runs: Sequence[Run]


def key_of(group: Group, about: Row) -> Key:
    """The key of a group's rows, which get some keys besides."""
    return group.problem.name, about.get("seed", group.seed)


def earlier(
    folder: Path | None, groups: Sequence[Group], settings: Settings, about: Row
) -> Earlier:
    """What is in a folder and can stay; what cannot is said.

    The groups get the planners that they had before.

    Parameters
    ----------
    about : keys that all rows of the groups get besides
    """
    found = Earlier({}, []) if folder is None else _standing(folder, settings)
    rows = dict(found.rows)
    for group in groups:
        key = key_of(group, about)
        if folder is not None and key in rows and not _rejoined(group, rows[key], folder):
            del rows[key]
    return found._replace(rows=rows)


def seeds_known(folder: Path | None) -> dict[tuple[str, str], int]:
    """By a scene's name and digest, the seed under which the folder has it.

    A scene that does not depend on the seed is the same sample under any.
    """
    if folder is None:
        return {}
    try:
        rows = load_results(folder)
    except FileError:  # there are none
        return {}
    known: dict[tuple[str, str], int] = {}
    for row in rows:
        if row["seed"] is not None and (found := _plan(folder, row)) is not None:
            known.setdefault((row["scene"], found.digest), row["seed"])
    return known


def _standing(folder: Path, settings: Settings) -> Earlier:
    """Rows that have the settings and the code of those that are to come."""
    nothing = Earlier({}, [])
    try:
        rows = load_results(folder)
    except FileError:  # there are none
        return nothing
    try:
        about = load_run(folder)
    except FileError as error:
        _tell_leaving(folder, len(rows), f"are of unknown settings ({error})")
        return nothing
    if about.settings != settings:
        _tell_leaving(folder, len(rows), "were made with other limits or settings")
        return nothing
    if about.code != code_digest():
        _tell_leaving(folder, len(rows), "were made by another version of the code")
        return nothing
    known: dict[Key, list[Row]] = {}
    for row in rows:
        known.setdefault((row["scene"], row["seed"]), []).append(row)
    return Earlier(known, about.runs)


def _rejoined(group: Group, rows: Sequence[Row], folder: Path) -> bool:
    """Give a group the planners of its earlier rows; whether all of these rows still hold."""
    store = Store(folder)
    gone = [row for row in rows if not _is_rejoined(group, row, folder, store)]
    if gone:
        words = ", ".join(row["planner"] for row in gone)
        where = f"{folder}: {group.problem.name} seed {group.seed}"
        _tell_leaving(where, len(gone), f"({words}) are of another scene of that name, or damaged")
    return not gone


def _is_rejoined(group: Group, row: Row, folder: Path, store: Store) -> bool:
    """Whether what a row tells of is known, and is of the group's own problem."""
    name = row["planner"]
    if name not in SOLVERS:
        return name in group.cells or _is_given(group, row, folder)
    if store.find(group.cell(name)) is None:
        return False
    if name not in group.cells:
        group.join(name)
    return True


def _is_given(group: Group, row: Row, folder: Path) -> bool:
    """Whether a plan of others is in the folder still; if so, the group gets it."""
    found = _plan(folder, row)
    if found is None or found.digest != group.digest:
        return False
    group.give(row["planner"], found.plan)
    return True


def _plan(folder: Path, row: Row) -> PlanFile | None:
    """A row's plan, if it is there."""
    path = folder / plan_path(row)
    try:
        return decode(read_bytes(path), PlanFile, str(path))
    except FileError:
        return None


def _tell_leaving(where: object, count: int, why: str) -> None:
    rows = counted(count, "row")
    say(f"{where}: {rows} of earlier commands {why}; they leave results.csv, their cells stay")
