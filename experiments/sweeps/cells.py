"""Cells of a sweep: the computation of each, and the file that contains its result.

A cell is one planner, or the bound, on one instance. Its file is named by the digest of everything
that affects its result, so cells with other limits or other code do not match.
"""

import ast
import hashlib
from contextlib import suppress
from enum import StrEnum
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Literal

import msgspec

from cocap_opt.experiments.tables import rows
from cocap_opt.experiments.tables.layout import CELLS
from cocap_opt.experiments.tables.rows import ERROR, BoundColumns, PlannedRow
from cocap_opt.files.code import code_digest, with_imports
from cocap_opt.files.documents import Document, FileError, PlanFile, encode
from cocap_opt.output.files import save_bytes
from cocap_opt.run.engine import BOUND as BOUND
from cocap_opt.run.options import Allowance

OWN = "own"  # the certificate of a planner that proves a bound itself
RULES, FREE = "rules", "free"  # certificates and traces of the bound with and without rules
_KEY_DIGITS = 20
# Code on which the result of a cell depends is all that these import, ...
_WORK = ("cocap_opt.planners", "cocap_opt.formulations", "cocap_opt.experiments.sweeps.work")
# ... but for what makes problems, which have digests, and for what only shows and names results;
# `tables.rows` counts as `_code_of_rows` says.
_SILENT = (
    "cocap_opt.scenarios", "cocap_opt.console", "cocap_opt.experiments.tables",
    "cocap_opt.output.conflicts", "cocap_opt.output.printing",
)  # fmt: skip
# Libraries that compute something of a result; some are optional.
_LIBRARIES = (
    "clarabel", "cvxpy", "embreex", "highspy", "msgspec", "networkx", "numba", "numpy", "ortools",
    "pyscipopt", "scipy", "shapely",
)  # fmt: skip
_EXPLAINED = ast.Module | ast.ClassDef | ast.FunctionDef


class Status(StrEnum):
    """The way in which a cell ended; a limit that stopped its planner is in the row."""

    FINISHED = "finished"
    ERROR = ERROR  # an error in the code or in its libraries
    EXCEEDED = "exceeded"  # it took longer than a cell may
    DIED = "died"  # its process died


FAILED = (Status.ERROR, Status.EXCEEDED, Status.DIED)


class SweepCell(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One computation, and everything that affects its result."""

    scene: str
    seed: int
    planner: str  # or BOUND
    digest: str  # of the problem
    time_limit: float  # s, for each computation
    work_limit: int | None = None  # units of work, for each computation
    rendered: bool = False  # J of the rendered pixels is computed, too
    # Of BOUND the digest of its start; of an exact method the planner whose plan it begins with.
    start: str = ""
    # Digest of the code of a third-party planner.
    planner_digest: str = msgspec.field(default="", name="own")
    code: str  # digest of the code; empty if the cell is not kept

    @staticmethod
    @cache
    def digest_of_code() -> str:
        """Returns the digest of the code and the libraries on which results of cells depend.

        See `cocap_opt.files.code`: comments, layout and docstrings do not count, and neither do
        meanings of columns.
        """
        versions = [f"{name} {number}" for name, number in SweepCell.versions().items()]
        parts = [*versions, code_digest(*digested_modules()), _code_of_rows()]
        return hashlib.sha256(" ".join(parts).encode()).hexdigest()

    @staticmethod
    def versions(*more: str) -> dict[str, str]:
        """Returns the versions of the libraries that results depend on, and of more packages.

        Packages that are not installed are left out.
        """
        found = {}
        for name in sorted({*_LIBRARIES, *more}):
            with suppress(PackageNotFoundError):
                found[name] = version(name)
        return found

    @property
    def key(self) -> str:
        """Digest of all fields, by which the cell's file is named."""
        return hashlib.sha256(msgspec.json.encode(self)).hexdigest()[:_KEY_DIGITS]

    @property
    def words(self) -> str:
        """The scene, the seed and the planner, as messages name the cell."""
        return f"{self.scene} seed {self.seed}, {self.planner}"

    @property
    def allowance(self) -> Allowance:
        """The limits of each of its computations."""
        return Allowance(self.time_limit, self.work_limit)


class CellFile(Document, frozen=True, kw_only=True):
    """The result of a cell, or the reason why it has none."""

    format: Literal["cocap-opt cell"] = "cocap-opt cell"
    version: Literal[3, 4] = 4
    cell: SweepCell
    status: Status
    message: str = ""  # why it has no result, in words
    traceback: str = ""  # of an error
    seconds: float = 0.0  # of the whole cell, coverage included
    coverage_seconds: float | None = None  # in which it was computed; None: it is not known
    machine: str = ""  # where it was computed
    row: PlannedRow | None = None  # of a planner
    columns: BoundColumns | None = None  # of BOUND
    plan: PlanFile | None = None
    # Files by name: OWN of a planner, RULES and FREE of BOUND.
    certificates: dict[str, msgspec.Raw] = msgspec.field(default_factory=dict)
    traces: dict[str, str] = msgspec.field(default_factory=dict)  # of BOUND: RULES and FREE

    @classmethod
    def failed(
        cls,
        cell: SweepCell,
        status: Status,
        message: str,
        seconds: float = 0.0,
        traceback: str = "",
    ) -> "CellFile":
        """Returns the file of a cell without a result."""
        return cls(cell=cell, status=status, message=message, seconds=seconds, traceback=traceback)

    @property
    def is_finished(self) -> bool:
        """There is a result."""
        return self.status is Status.FINISHED

    def certificate(self, name: str) -> bytes:
        """Returns the content of a certificate's file."""
        return msgspec.json.format(bytes(self.certificates[name]), indent=1) + b"\n"


class Store:
    """The cells in a folder; without a folder, nothing is kept.

    Parameters
    ----------
    retry : True if failed cells count as missing
    cell_limit : s; cells that have exceeded a lower limit count as missing
    """

    def __init__(self, folder: Path | None, retry: bool = False, cell_limit: float = 0.0) -> None:
        self._folder = None if folder is None else folder / CELLS
        self._retry, self._cell_limit = retry, cell_limit

    def find(self, cell: SweepCell) -> CellFile | None:
        """Returns the file of a cell; None if there is none, or it must be recomputed."""
        path = self.path(cell)
        if path is None:
            return None
        try:
            found = CellFile.read(path)
        except FileError:  # there is none, or it is damaged: either way it is computed
            return None
        if found.cell != cell or self._is_tried_again(found):
            return None
        return found

    def _is_tried_again(self, content: CellFile) -> bool:
        exceeded_less = content.status is Status.EXCEEDED and content.seconds < self._cell_limit
        return exceeded_less or (self._retry and not content.is_finished)

    def save(self, content: CellFile) -> None:
        """Writes the file of a cell, completely or not at all."""
        if (path := self.path(content.cell)) is not None:
            save_bytes(path, encode(content))

    def path(self, cell: SweepCell) -> Path | None:
        """Returns the path of a cell's file, existing or not; None if nothing is kept."""
        return None if self._folder is None else self._folder / f"{cell.key}.json"


def digested_modules() -> list[str]:
    """Returns the modules on which results of cells depend, besides `tables.rows`."""
    found = sorted(with_imports(*_WORK))
    return [name for name in found if not f"{name}.".startswith(tuple(f"{s}." for s in _SILENT))]


def _code_of_rows() -> str:
    """Returns the code that makes rows, without docstrings and without what columns mean.

    A `TableColumn` explains a field, with its unit and its range, and computes nothing.
    """
    tree = ast.parse(Path(rows.__file__).read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "TableColumn":
            node.args, node.keywords = [], []
        if isinstance(node, _EXPLAINED) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)
