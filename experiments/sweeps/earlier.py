"""What earlier commands left in a folder, as far as it can stand beside what runs now.

Rows stay that were made with the same settings, by the same code, on what still is the same scene.
A scene and seed that runs again takes its earlier planners along, so that one bound holds for all
of its rows.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from cocap_opt.check import check
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.results.layout import plan_path
from cocap_opt.experiments.results.printing import counted
from cocap_opt.experiments.results.rows import SOLVERS, Row
from cocap_opt.experiments.sweeps.about import Run, load_run, rows_digest
from cocap_opt.experiments.sweeps.cells import Store
from cocap_opt.experiments.sweeps.results import RESULTS, load_results
from cocap_opt.experiments.sweeps.run import Group, Settings
from cocap_opt.files.documents import FileError, PlanFile, decode, read_bytes

Key = tuple[str, int | None]  # a scene and a seed; None where the starts are the scene file's own
IsSame = Callable[[Key, str], bool]  # whether a scene and seed still has a digest


class Earlier(NamedTuple):
    """Rows by scene and seed, and the commands that made them."""

    rows: dict[Key, list[Row]]
    runs: Sequence[Run]


def key_of(group: Group, about: Row) -> Key:
    """The key of a group's rows, which get some keys besides."""
    return group.problem.name, about.get("seed", group.seed)


def earlier(
    folder: Path | None, groups: Sequence[Group], settings: Settings, about: Row, is_same: IsSame
) -> Earlier:
    """What earlier commands left that can stay, of which the groups get their planners.

    What cannot stay is said.

    Parameters
    ----------
    about : keys that all rows of the groups get besides
    is_same : asked of scenes and seeds that are not among the groups

    Raises
    ------
    FileError
        If results.csv is damaged or of another program: it is not overwritten.
    """
    if folder is None:
        return Earlier({}, [])
    by_key = {key_of(group, about): group for group in groups}
    assert len(by_key) == len(groups), "a scene and seed twice"
    digests = {key: group.digest for key, group in by_key.items()}
    found = _without_other_scenes(_standing(folder, settings), folder, digests, is_same)
    for key, group in by_key.items():
        _rejoin(group, found.rows.get(key, []), folder)
    return found


def _standing(folder: Path, settings: Settings) -> Earlier:
    """What has the same settings and code."""
    nothing = Earlier({}, [])
    if not (folder / RESULTS).exists():
        return nothing
    rows = load_results(folder)
    try:
        about = load_run(folder)
    except FileError as error:
        _tell_leaving(folder, rows, f"unknown settings ({error})")
        return nothing
    if (old := about.settings) != settings:
        limits = f"{old.limit:g} s for plans, {old.bound_limit:g} s for bounds"
        _tell_leaving(folder, rows, f"other limits or options (there: {limits})")
        return nothing
    if about.code != rows_digest():
        _tell_leaving(folder, rows, "another version of the code")
        return nothing
    known: dict[Key, list[Row]] = {}
    for row in rows:
        known.setdefault((row["scene"], row["seed"]), []).append(row)
    return Earlier(known, about.runs)


def _without_other_scenes(
    found: Earlier, folder: Path, digests: dict[Key, str], is_same: IsSame
) -> Earlier:
    """What is left without rows of other scenes that had the names of those that run now.

    A scene that runs now under another seed leaves, too: it is one sample.
    """
    kept = dict(found.rows)
    samples = {(name, digest) for (name, _), digest in digests.items()}
    for key, rows in found.rows.items():
        digest, where = rows[0]["digest"], f"{folder}: {_words(key)}"
        if key not in digests and (key[0], digest) in samples:
            _tell_leaving(where, kept.pop(key), "a scene that now has another seed")
        elif not (digests[key] == digest if key in digests else is_same(key, digest)):
            _tell_leaving(where, kept.pop(key), "another scene of that name")
    return found._replace(rows=kept)


def _rejoin(group: Group, rows: Sequence[Row], folder: Path) -> None:
    """Give a group the planners of its earlier rows, of which it is known what has become."""
    store = Store(folder)
    lost = [row for row in rows if not _is_rejoined(group, row, folder, store)]
    if lost:
        where = f"{folder}: {_words((group.problem.name, rows[0]['seed']))}"
        _tell_leaving(where, lost, "cells or plans that are gone or damaged")


def _is_rejoined(group: Group, row: Row, folder: Path, store: Store) -> bool:
    name = row["planner"]
    if name not in SOLVERS:
        return _is_given(group, name, folder / plan_path(row))
    if name in group.cells:  # what is asked for is computed, if need be
        return True
    content = store.find(group.cell(name))
    if content is not None:
        group.join(name, content)
    return content is not None


def _is_given(group: Group, name: str, path: Path) -> bool:
    """Whether a plan of others is in the folder still; if so, the group gets it."""
    try:
        found = decode(read_bytes(path), PlanFile, str(path))
    except FileError:
        return name in group.cells
    if name in group.cells:
        if found.plan != group.plan(name):
            say(f"{name}: is another plan than that of this name in {path}, which it replaces")
        return True
    if found.digest != group.digest or check(group.problem, found.plan).violations:
        return False
    group.give(name, found.plan)
    return True


def _words(key: Key) -> str:
    """A scene and seed for people."""
    return key[0] if key[1] is None else f"{key[0]} seed {key[1]}"


def _tell_leaving(where: object, rows: Sequence[Row], why: str) -> None:
    names = ", ".join(dict.fromkeys(row["planner"] for row in rows))
    count = counted(len(rows), "row")
    say(f"{where}: {count} ({names}) of {why}: no longer in {RESULTS}; finished cells stay")
