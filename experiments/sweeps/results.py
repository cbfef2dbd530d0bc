"""The records in a sweep's folder: run.json, and results.csv as it is read.

`COLUMNS` of `cocap_opt.experiments.tables.rows` explains the columns. Missing values (no plan, no
bound, no gap) are empty fields.
"""

import hashlib
import os
import platform
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Literal

import msgspec

from cocap_opt.experiments.sweeps.cells import SweepCell
from cocap_opt.experiments.tables.columns import read_rows
from cocap_opt.experiments.tables.rows import COLUMNS, GapRow
from cocap_opt.files.code import code_digest
from cocap_opt.files.documents import (
    SAMPLED,
    Document,
    decode_document,
    encode,
    read_bytes,
)
from cocap_opt.output.files import save_bytes
from cocap_opt.vision.coverage import usable_cores

RUN = "run.json"


@cache
def _rows_digest() -> str:
    """Returns the digest of the code that rows depend on: the code of cells and of scenes."""
    parts = SweepCell.digest_of_code() + code_digest("cocap_opt.scenarios")
    return hashlib.sha256(parts.encode()).hexdigest()


class CommandRun(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One command, and where it ran.

    Attributes
    ----------
    command : the program and its arguments
    began : date and time, UTC
    scenes : names of the scenes
    seeds : seeds of the scenes
    workers : the processes or the cluster that computed the cells
    machine : system, processor, cores, memory and Python of the machine that ran the command
    packages : versions of the libraries, by name
    """

    command: list[str]
    began: str
    scenes: list[str]
    seeds: list[int]
    workers: str
    machine: dict[str, str]
    packages: dict[str, str]

    @classmethod
    def now(cls, scenes: list[str], seeds: list[int], workers: str) -> "CommandRun":
        """Returns a description of the run that starts now."""
        return cls(
            command=[*_program(), *sys.argv[1:]],
            began=datetime.now(UTC).isoformat(timespec="seconds"),
            scenes=scenes,
            seeds=seeds,
            workers=workers,
            machine={
                "system": platform.platform(),
                "processor": _processor(),
                "cores": str(usable_cores()),
                "memory": _memory(),
                "python": platform.python_version(),
            },
            packages=SweepCell.versions("cocap-opt", "distributed"),
        )


class RunFile(Document, frozen=True, kw_only=True):
    """The runs that made the results in a folder, all with the same code.

    Attributes
    ----------
    format : the kind of file
    version : of this format
    code : digest of everything that rows depend on, including scenes
    runs : the commands that wrote into the folder, in order
    """

    older = SAMPLED
    format: Literal["cocap-opt run"] = "cocap-opt run"
    version: Literal[4] = 4
    code: str
    runs: list[CommandRun]

    @classmethod
    def load(cls, folder: Path) -> "RunFile":
        """Reads the file of a folder.

        Raises
        ------
        FileError
            If the file is missing or damaged.
        """
        path = folder / RUN
        return decode_document(read_bytes(path), str(path), cls)

    @property
    def is_of_this_code(self) -> bool:
        """The code that made the results does the same as the present code."""
        return self.code == _rows_digest()

    @classmethod
    def add_run(cls, folder: Path, before: Sequence[CommandRun], run: CommandRun) -> None:
        """Writes the file, and adds the run, unless one that differs only in its time is listed."""
        again = any(msgspec.structs.replace(known, began=run.began) == run for known in before)
        runs = [*before] if again else [*before, run]
        save_bytes(folder / RUN, encode(cls(code=_rows_digest(), runs=runs)))


def _program() -> list[str]:
    """Returns the start of the command: `python -m` with a module, or `cocap-opt`."""
    spec = sys.modules["__main__"].__spec__
    if spec is None:
        return ["cocap-opt"]
    return ["python", "-m", spec.name.removesuffix(".__main__")]


def _processor() -> str:
    """Returns the processor's name, or its architecture if the name is unknown."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _memory() -> str:
    if not hasattr(os, "sysconf"):
        return "unknown"
    return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 1e9:.0f} GB"


RESULTS = "results.csv"
# Columns that tables of older versions lack; such tables are read without them.
_NEWER = ("cut_short", "overrun", "seen_by_two", "seen_by_three", "median_error")


def load_results(folder: Path) -> list[GapRow]:
    """Reads results.csv.

    Raises
    ------
    FileError
        If it is not such a table, has no rows, has a number that is out of range, or was written by
        an older version, whose rewards differ.
    """
    if (folder / RUN).exists():
        RunFile.load(folder)
    return [GapRow(**values) for values in read_rows(folder / RESULTS, COLUMNS, _NEWER)]
