"""A sweep's folder: one command at a time writes there, beside what earlier commands left.

An earlier row stays if the code that made it does the same as this one, and its scene still is the
same scene. Limits are columns of the rows, so that commands with other limits add to one table; of
a scene, a seed and a planner there is one row, the newest, so that means and differences are over
one row per seed. The cells of both stay, and the earlier command brings its row back at no cost.
An instance that runs again takes its earlier planners along, so that one bound, by the limits of
the newest command, holds for all of its rows. Only where an earlier command has proved a lower
bound on the same scene, and its certificate is there still, is that one kept, with its limits.
"""

import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

import msgspec

from cocap_opt.console.streams import say
from cocap_opt.experiments.sweeps.cells import BOUND, FREE, RULES, CellFile, Status, Store
from cocap_opt.experiments.sweeps.instances import Instance, Key
from cocap_opt.experiments.sweeps.results import RESULTS, load_results
from cocap_opt.experiments.sweeps.run_file import RUN, Run, RunFile
from cocap_opt.experiments.tables.layout import FOLDERS, Paths
from cocap_opt.experiments.tables.rows import BoundColumns, Row
from cocap_opt.files.atomic_write import UNFINISHED
from cocap_opt.files.documents import (
    FileError,
    PlanFile,
    decode_document,
    problem_digest,
    read_bytes,
)
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.output.files import make_folder
from cocap_opt.output.printing import counted
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.judged import ROUNDING

if sys.platform != "win32":
    import fcntl

_LEFTOVER = 3600.0  # s, after which nobody is writing a file any more

# Asked if an instance of an earlier row, which is not run again, still has the digest of that row.
IsSame = Callable[[Key, str], bool]


@contextmanager
def only_writer(folder: Path | None) -> Iterator[None]:
    """Makes the folder, and keeps other commands from writing into it, where the system can.

    The lock ends with the process, however that ends.

    Raises
    ------
    FileError
        If the folder cannot be made, or another command writes there, or its run.json cannot be
        read, as that of a newer version; nothing is changed then.
    """
    if folder is not None and (folder / RUN).exists():
        RunFile.load(folder)
    make_folder(folder, *FOLDERS)
    if folder is None:
        yield
        return
    with (folder / ".lock").open("wb") as file:
        if sys.platform != "win32":
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                words = "another command writes there; wait for it, or name another folder"
                raise FileError(f"{folder}: {words}") from None
            except OSError:  # a file system without locks
                pass
        _clear_leftovers([folder, *(folder / part for part in FOLDERS)])
        yield


def _clear_leftovers(folders: Sequence[Path]) -> None:
    """Removes what processes that were killed while they wrote have left behind."""
    for folder in folders:
        for path in folder.glob(f"{UNFINISHED}*"):
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > _LEFTOVER:
                    path.unlink()


class Earlier(NamedTuple):
    """The rows by instance that earlier commands left and that can stay, and these commands."""

    rows: dict[Key, list[Row]]
    runs: Sequence[Run]

    @classmethod
    def read(cls, folder: Path | None, instances: Sequence[Instance], is_same: IsSame) -> "Earlier":
        """Reads a folder, and gives instances that run again the planners of their earlier rows.

        Rows that cannot be kept are named on standard error, with the reason.

        Raises
        ------
        FileError
            If results.csv is damaged or of another program: it is not overwritten.
        """
        if folder is None:
            return cls({}, [])
        by_key = {instance.key: instance for instance in instances}
        assert len(by_key) == len(instances), "a scene and seed twice"
        found = _of_same_code(folder)._without_other_scenes(folder, by_key, is_same)
        for key, instance in by_key.items():
            if rows := found.rows.get(key):
                _rejoin(instance, rows, folder)
                instance.earlier_bound = _earlier_bound(instance, rows[0], folder)
        return found

    def _without_other_scenes(
        self, folder: Path, instances: dict[Key, Instance], is_same: IsSame
    ) -> "Earlier":
        """Leaves out rows of other scenes that had the names of those that run now.

        A scene that runs now under another seed leaves, too: it is one sample.
        """
        kept = dict(self.rows)
        samples = {(name, instance.digest) for (name, _), instance in instances.items()}
        for key, rows in self.rows.items():
            digest, where = rows[0].digest, f"{folder}: {_words(key)}"
            if key in instances:
                is_the_same = instances[key].digest == digest
            elif (key[0], digest) in samples:
                _tell_leaving(where, kept.pop(key), "a scene that now has another seed")
                continue
            else:
                is_the_same = is_same(key, digest)
            if not is_the_same:
                _tell_leaving(where, kept.pop(key), "another scene of that name")
        return self._replace(rows=kept)


def _of_same_code(folder: Path) -> Earlier:
    nothing = Earlier({}, [])
    if not (folder / RESULTS).exists():
        return nothing
    rows = load_results(folder)
    if not (folder / RUN).exists():  # a command was killed before it wrote that
        _tell_leaving(folder, rows, f"unknown code (there is no {RUN})")
        return nothing
    file = RunFile.load(folder)
    if not file.is_of_this_code:
        _tell_leaving(folder, rows, "another version of the code")
        return nothing
    known: dict[Key, list[Row]] = {}
    for row in rows:
        known.setdefault(row.key, []).append(row)
    return Earlier(known, file.runs)


def _rejoin(instance: Instance, rows: Sequence[Row], folder: Path) -> None:
    """Adds the planners of earlier rows, with their results, to an instance that runs again."""
    store = Store(folder)
    lost = [row for row in rows if not _is_rejoined(instance, row, folder, store)]
    if lost:
        where = f"{folder}: {_words(rows[0].key)}"
        _tell_leaving(where, lost, "cells or plans that are gone or damaged")


def _is_rejoined(instance: Instance, row: Row, folder: Path, store: Store) -> bool:
    name = row.planner or ""
    if name not in SOLVERS and not row.planner_digest:
        return _is_given(instance, name, folder / Paths(row).plan)
    if name in instance.cells:  # what is asked for is computed, if need be
        return True
    for cell in instance.earlier_cells(row):
        if (content := store.find(cell)) is not None:
            instance.take(content)
            return True
    return False


def _is_given(instance: Instance, name: str, path: Path) -> bool:
    """Gives the instance a plan of others that is in the folder still; False if it is not."""
    try:
        found = decode_document(read_bytes(path), str(path), PlanFile)
    except FileError:
        return name in instance.cells
    if name in instance.cells:
        if found.plan != instance.plan(name):
            say(f"{name}: is another plan than that of this name in {path}, which it replaces")
        return True
    if found.digest != instance.digest or check(instance.problem, found.plan).violations:
        return False
    instance.give(name, found)
    return True


def _earlier_bound(instance: Instance, row: Row, folder: Path) -> CellFile | None:
    """Returns the bound of an earlier row with its certificates; None if they do not prove it."""
    problem, paths = instance.problem, Paths(row)
    bounds = {RULES: (problem, row.bound), FREE: (problem.without_rules(), row.bound_free)}
    certificates, traces = {}, {}
    for name, (bounded, value) in bounds.items():
        # One bound is both where there are no rules.
        is_free = name == FREE and bounded is not problem
        content = _proof(folder / paths.certificate(is_free), bounded, value)
        if content is None:
            return None
        if is_free or name == RULES:
            certificates[name] = msgspec.Raw(content)
        with suppress(FileError):
            traces[name] = read_bytes(folder / paths.trace(name == FREE)).decode()
    return CellFile(
        cell=instance.cell(BOUND), status=Status.FINISHED, certificates=certificates, traces=traces,
        columns=BoundColumns(**{
            field: getattr(row, field) for field in BoundColumns.__dataclass_fields__
        } | {"certificate": "", "certificate_free": ""}),
    )  # fmt: skip


def _proof(path: Path, problem: Problem, bound: float | None) -> bytes | None:
    """Returns the content of a certificate's file, if it claims this bound on this problem."""
    try:
        content = read_bytes(path)
        found = decode_document(content, str(path), CertificateFile, ProofFile)
    except FileError:
        return None
    is_of_it = bound is not None and math.isclose(found.proved, bound, rel_tol=ROUNDING)
    return content if is_of_it and found.digest == problem_digest(problem) else None


def _words(key: Key) -> str:
    """Returns the name of an instance for people."""
    return key[0] if key[1] is None else f"{key[0]} seed {key[1]}"


def _tell_leaving(where: object, rows: Sequence[Row], why: str) -> None:
    names = ", ".join(dict.fromkeys(row.planner or "" for row in rows))
    count = counted(len(rows), "row")
    say(f"{where}: {count} ({names}) of {why}: no longer in {RESULTS}; finished cells stay")
