"""A sweep's folder: one command at a time writes there, and keeps results of earlier commands.

An earlier row is kept if the code that made it does the same as the present code, and its scene is
unchanged. Limits are columns of the rows, so commands with other limits add to the same table. Each
scene, seed and planner has one row, the newest, so means and differences are over one row per seed.
The cells of both commands stay in the folder, so running the earlier command again restores its row
without recomputing it.

An instance that runs again includes its earlier planners, so all of its rows have the same bound,
searched for with the limits of the newest command. If an earlier command proved a lower bound on
the same scene, and its certificate is still in the folder, that bound is kept, with its limits.

A command writes run.json, results.csv, results.parquet, and the files that rows name. The Parquet
file has typed columns; missing values are null. The tables contain only complete instances, and
rows that were kept. The files that rows name (scene, plans, certificates and traces) are written
again with each row of a run, computed or recalled, so they match its rows whatever ran in the
folder before.
"""

import io
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import msgspec

from cocap_opt.console.streams import say
from cocap_opt.experiments.sweeps.cells import BOUND, FREE, RULES, CellFile, Status, Store
from cocap_opt.experiments.sweeps.instances import Instance, Key
from cocap_opt.experiments.sweeps.results import RESULTS, RUN, CommandRun, RunFile, load_results
from cocap_opt.experiments.tables.layout import FOLDERS, Paths
from cocap_opt.experiments.tables.rows import COLUMNS, BoundColumns, GapRow
from cocap_opt.files.atomic_write import UNFINISHED
from cocap_opt.files.documents import (
    FileError,
    PlanFile,
    SceneFile,
    decode_document,
    encode,
    problem_digest,
    read_bytes,
)
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.output.files import make_folder, save_bytes, save_csv
from cocap_opt.output.printing import Record
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.run.engine import SOLVERS
from cocap_opt.run.judged import ROUNDING
from cocap_opt.text import counted

if sys.platform != "win32":
    import fcntl

_LEFTOVER = 3600.0  # s; unfinished files that are older are no longer being written

# Returns True if the scene of an earlier row, which does not run again, still has this digest.
IsSame = Callable[[Key, str], bool]
_PARQUET = "results.parquet"
_Files = dict[Path, bytes | None]  # contents by path; None if the file must not exist


@contextmanager
def only_writer(folder: Path | None) -> Iterator[None]:
    """Makes the folder, and keeps other commands from writing into it, if the system has locks.

    The lock ends with the process, however the process ends.

    Raises
    ------
    FileError
        If the folder cannot be made, another command is writing there, or run.json cannot be read,
        e.g. because a newer version wrote it; nothing is changed then.
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
                words = "another command is writing here; wait for it, or name another folder"
                raise FileError(f"{folder}: {words}") from None
            except OSError:  # a file system without locks
                pass
        _clear_leftovers([folder, *(folder / part for part in FOLDERS)])
        yield


def _clear_leftovers(folders: Sequence[Path]) -> None:
    """Removes unfinished files of processes that were killed while writing."""
    for folder in folders:
        for path in folder.glob(f"{UNFINISHED}*"):
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > _LEFTOVER:
                    path.unlink()


class Earlier(NamedTuple):
    """The rows of earlier commands that can be kept, by instance, and these commands."""

    rows: dict[Key, list[GapRow]]
    runs: Sequence[CommandRun]

    @classmethod
    def read(cls, folder: Path | None, instances: Sequence[Instance], is_same: IsSame) -> "Earlier":
        """Reads a folder, and adds the planners of earlier rows to instances that run again.

        Rows that cannot be kept are named on standard error, with the reason.

        Raises
        ------
        FileError
            If results.csv is damaged or another program wrote it; it is not overwritten then.
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
        """Removes rows whose scene has changed: its name now belongs to another scene.

        Rows of a scene that now runs under another seed are removed, too, as it is one sample.
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
    if not (folder / RUN).exists():  # a command was killed before it wrote run.json
        _tell_leaving(folder, rows, f"unknown code (there is no {RUN})")
        return nothing
    file = RunFile.load(folder)
    if not file.is_of_this_code:
        _tell_leaving(folder, rows, "another version of the code")
        return nothing
    return Earlier(
        {group[0].key: group for group in GapRow.grouped(rows, "scene", "seed").values()}, file.runs
    )


def _rejoin(instance: Instance, rows: Sequence[GapRow], folder: Path) -> None:
    """Adds the planners of earlier rows, with their results, to an instance that runs again."""
    store = Store(folder)
    lost = [row for row in rows if not _is_rejoined(instance, row, folder, store)]
    if lost:
        where = f"{folder}: {_words(rows[0].key)}"
        _tell_leaving(where, lost, "cells or plans that are gone or damaged")


def _is_rejoined(instance: Instance, row: GapRow, folder: Path, store: Store) -> bool:
    name = row.planner or ""
    if name not in SOLVERS and not row.planner_digest:
        return _is_given(instance, name, folder / Paths(row).plan)
    if name in instance.cells:  # a requested planner runs if its cell is missing
        return True
    for cell in instance.earlier_cells(row):
        if (content := store.find(cell)) is not None:
            instance.take(content)
            return True
    return False


def _is_given(instance: Instance, name: str, path: Path) -> bool:
    """Adds an earlier given plan from the folder to the instance; returns False if impossible."""
    try:
        found = decode_document(read_bytes(path), str(path), PlanFile)
    except FileError:
        return name in instance.cells
    if name in instance.cells:
        if found.plan != instance.plan(name):
            say(f"{name}: replaces a different plan of the same name, {path}")
        return True
    if found.digest != instance.digest or check(instance.problem, found.plan).violations:
        return False
    instance.give(name, found)
    return True


def _earlier_bound(instance: Instance, row: GapRow, folder: Path) -> CellFile | None:
    """Returns the bound of an earlier row with its certificates; None if they do not prove it."""
    problem, paths = instance.problem, Paths(row)
    bounds = {RULES: (problem, row.bound), FREE: (problem.without_rules(), row.bound_free)}
    certificates, traces = {}, {}
    for name, (bounded, value) in bounds.items():
        # Without rules, both bounds are the same.
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
    """Returns the content of a certificate's file, if its bound on the problem is this one."""
    try:
        content = read_bytes(path)
        found = decode_document(content, str(path), CertificateFile, ProofFile)
    except FileError:
        return None
    is_of_it = bound is not None and math.isclose(found.proved, bound, rel_tol=ROUNDING)
    return content if is_of_it and found.digest == problem_digest(problem) else None


def _words(key: Key) -> str:
    """Returns the name of an instance for messages."""
    return key[0] if key[1] is None else f"{key[0]} seed {key[1]}"


def _tell_leaving(where: object, rows: Sequence[GapRow], why: str) -> None:
    names = ", ".join(dict.fromkeys(row.planner or "" for row in rows))
    count = counted(len(rows), "row")
    say(f"{where}: {count} ({names}) of {why}: removed from {RESULTS}; finished cells are kept")


class Output:
    """Writes results as soon as they are complete; writes nothing without a folder.

    Parameters
    ----------
    before : rows of earlier runs, which are valid until they are replaced
    about_run : returns the entry of this run in run.json, which is written with the first results
    """

    def __init__(
        self,
        folder: Path | None,
        instances: Sequence[Instance],
        before: Earlier,
        about_run: Callable[[], CommandRun],
    ) -> None:
        self._folder, self._instances = folder, instances
        self._before, self._about_run = before, about_run
        self._kept: dict[Instance, list[GapRow]] = {}

    def update(self) -> None:
        """Writes instances that are newly complete, except any that Ctrl-C cut short."""
        if self._folder is None:
            return
        new = [i for i in self._instances if i.is_finished and i not in self._kept]
        if not new:
            return
        is_first = not self._kept
        if is_first and not self._before.runs:  # results.csv is other code's until replaced
            _remove(self._folder / RUN)
        if is_first and self._before.runs:
            self._save_run(self._folder)
        for instance in new:
            self._kept[instance] = _published(self._folder, instance)
        _save_results(self._folder, self._all(), whole=len(self._kept) == len(self._instances))
        if is_first and not self._before.runs:
            self._save_run(self._folder)

    def _save_run(self, folder: Path) -> None:
        RunFile.add_run(folder, self._before.runs, self._about_run())

    def rows(self) -> list[GapRow]:
        """Returns all rows that this run was asked for and has computed, in the order asked."""
        return [
            row
            for instance in self._instances
            if instance.is_whole
            for row in self._kept.get(instance) or instance.rows()
            if row.planner in instance.asked
        ]

    def _all(self) -> list[GapRow]:
        """Returns all rows of the folder by scene; those of this run come last in each scene."""
        rest = dict(self._before.rows)
        asked = []
        for instance in self._instances:
            before = rest.pop(instance.key, [])
            asked.append(self._kept.get(instance, before))
        rows = [row for group in (*rest.values(), *asked) for row in group]
        scenes = list(dict.fromkeys(row.scene for row in rows))
        return sorted(rows, key=lambda row: scenes.index(row.scene))


def _published(folder: Path, instance: Instance) -> list[GapRow]:
    """Writes the files of a complete instance; returns its rows, which name the files."""
    rows, bound = instance.rows(), instance.proved()
    files: _Files = {Paths(rows[0]).scene: encode(SceneFile.of(instance.problem))}
    for row, cell in zip(rows, instance.cells.values(), strict=True):
        plan = instance.found[cell].plan
        files[Paths(row).plan] = None if plan is None else encode(plan)
    named, files_of_bound = _certificates(instance.problem, bound, Paths(rows[0]))
    for path, content in (files | files_of_bound).items():
        _put(folder / path, content)
    # Proofs can be large, and are on disk now.
    instance.bound = msgspec.structs.replace(bound, certificates={}, traces={})
    instance.earlier_bound = None
    return [
        replace(row, certificate=named[RULES], certificate_free=named[FREE]) for row in rows
    ]  # fmt: skip


def _certificates(problem: Problem, bound: CellFile, paths: Paths) -> tuple[dict[str, str], _Files]:
    """Returns the names of the certificates, and the files of the bound."""
    files: _Files = {}
    named = {}
    for name in (RULES, FREE):
        is_free, known = name == FREE, name in bound.certificates
        path, text = paths.certificate(free=is_free), bound.traces.get(name)
        files[path] = bound.certificate(name) if known else None
        files[paths.trace(free=is_free)] = None if text is None else text.encode()
        named[name] = path.as_posix() if known else ""
    if problem.without_rules() is problem:  # both bounds are the same
        named[FREE] = named[RULES]
    return named, files


def _put(path: Path, content: bytes | None) -> None:
    """Writes a file if its content differs, or removes it if there is no content."""
    if content is None:
        _remove(path)
    elif not (path.is_file() and path.read_bytes() == content):
        save_bytes(path, content)


def _remove(path: Path) -> None:
    """Removes a file, if it exists."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error


def _save_results(folder: Path, rows: Sequence[GapRow], whole: bool) -> None:
    """Writes a table as CSV, and as Parquet once it is complete."""
    table = GapRow.records(rows)
    if not whole:
        _remove(folder / _PARQUET)
    save_csv(folder / RESULTS, table)
    if whole:
        save_bytes(folder / _PARQUET, _parquet(table))


def _parquet(table: Sequence[Record]) -> bytes:
    """Returns rows as a Parquet file; all rows have the same keys."""
    import pyarrow as pa  # slow to import
    from pyarrow.parquet import write_table

    types = {int: pa.int64(), float: pa.float64(), str: pa.string()}
    schema = pa.schema([(name, types[COLUMNS[name].kind]) for name in table[0]])
    content = io.BytesIO()
    write_table(pa.Table.from_pylist(list(table), schema=schema), content)
    return content.getvalue()
