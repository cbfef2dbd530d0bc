"""The output of a run: run.json, results.csv, results.parquet, and the files that rows name.

The Parquet file has the types of columns; a value that does not exist is null there.

All of them tell only of instances that are whole, and of what earlier runs left. The files that
rows name (scene, plans, certificates and traces) are written whenever a run takes their cells, be
they computed or recalled, so they prove what its rows say, whatever ran in the folder before.
"""

import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import msgspec

from cocap_opt.experiments.sweeps.cells import FREE, RULES, CellFile
from cocap_opt.experiments.sweeps.folder import Earlier
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.sweeps.results import RESULTS
from cocap_opt.experiments.sweeps.run_file import RUN, Run, RunFile
from cocap_opt.experiments.tables.layout import Paths
from cocap_opt.experiments.tables.rows import COLUMNS, Row
from cocap_opt.files.documents import FileError, SceneFile, encode
from cocap_opt.output.files import save_bytes, save_csv
from cocap_opt.output.printing import Record
from cocap_opt.problem import Problem

_PARQUET = "results.parquet"
_Files = dict[Path, bytes | None]  # None: there is to be none


class Output:
    """Writes results as they come; without a folder it writes nothing.

    Parameters
    ----------
    before : what earlier runs left, all of which holds until it is replaced
    about_run : returns what run.json says of this run, which is written with the first results
    """

    def __init__(
        self,
        folder: Path | None,
        instances: Sequence[Instance],
        before: Earlier,
        about_run: Callable[[], Run],
    ) -> None:
        self._folder, self._instances = folder, instances
        self._before, self._about_run = before, about_run
        self._kept: dict[Instance, list[Row]] = {}

    def update(self) -> None:
        """Writes what has become whole since; what Ctrl-C has cut short is not written."""
        if self._folder is None:
            return
        new = [i for i in self._instances if i.is_whole and not i.is_cut and i not in self._kept]
        if not new:
            return
        is_first = not self._kept
        if is_first and not self._before.runs:  # results of other code, for a moment
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

    def rows(self) -> list[Row]:
        """Returns all rows that this run was asked for and has, in that order."""
        return [
            row
            for instance in self._instances
            if instance.is_whole
            for row in self._kept.get(instance) or instance.rows()
            if row.planner in instance.asked
        ]

    def _all(self) -> list[Row]:
        """Returns rows of all that the folder has, scene by scene, those of this run last."""
        rest = dict(self._before.rows)
        own = []
        for instance in self._instances:
            before = rest.pop(instance.key, [])
            own.append(self._kept.get(instance, before))
        rows = [row for some in (*rest.values(), *own) for row in some]
        scenes = list(dict.fromkeys(row.scene for row in rows))
        return sorted(rows, key=lambda row: scenes.index(row.scene))


def _published(folder: Path, instance: Instance) -> list[Row]:
    """Writes the files of an instance that is whole; returns its rows, which name them."""
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
    if problem.without_rules() is problem:  # one bound is both
        named[FREE] = named[RULES]
    return named, files


def _put(path: Path, content: bytes | None) -> None:
    """Makes a file have this content, or not be there."""
    if content is None:
        _remove(path)
    elif not (path.is_file() and path.read_bytes() == content):
        save_bytes(path, content)


def _remove(path: Path) -> None:
    """Removes a file, if it is there."""
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error


def _save_results(folder: Path, rows: Sequence[Row], whole: bool) -> None:
    """Writes what there is of a table; as Parquet only once it is whole."""
    table = Row.records(rows)
    if not whole:
        _remove(folder / _PARQUET)
    save_csv(folder / RESULTS, table)
    if whole:
        save_bytes(folder / _PARQUET, _parquet(table))


def _parquet(table: Sequence[Record]) -> bytes:
    """Returns rows that all have the keys of the first as a Parquet file."""
    import pyarrow as pa  # slow to import
    from pyarrow.parquet import write_table

    types = {int: pa.int64(), float: pa.float64(), str: pa.string()}
    schema = pa.schema([(name, types[COLUMNS[name].kind]) for name in table[0]])
    content = io.BytesIO()
    write_table(pa.Table.from_pylist(list(table), schema=schema), content)
    return content.getvalue()
