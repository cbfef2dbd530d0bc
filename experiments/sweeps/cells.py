"""Cells of a sweep: the computation of each, and the file that contains its result.

A cell is one planner, or the bound, on one instance. Its file's name is the digest of everything
that affects its result, so cells with other limits or other code have other files.
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
# The result of a cell depends on the code of these modules and of all modules that they import, ...
_WORK = ("cocap_opt.planners", "cocap_opt.formulations", "cocap_opt.experiments.sweeps.work")
# ... except modules that make problems, which have digests, and modules that only show and name
# results. Of `tables.rows` only the part that `_code_of_rows` returns counts.
_SILENT = (
    "cocap_opt.scenarios", "cocap_opt.console", "cocap_opt.experiments.tables",
    "cocap_opt.output.conflicts", "cocap_opt.output.printing",
)  # fmt: skip
# Libraries that affect results; some are optional.
_LIBRARIES = (
    "clarabel", "cvxpy", "embreex", "highspy", "msgspec", "networkx", "numba", "numpy", "ortools",
    "pyscipopt", "scipy", "shapely",
)  # fmt: skip
_EXPLAINED = ast.Module | ast.ClassDef | ast.FunctionDef


class Status(StrEnum):
    """The way in which a cell ended; the row has the limit that stopped its planner, if any."""

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
    digest: str  # digest of the problem
    time_limit: float  # s, for each computation
    work_limit: int | None = None  # units of work, for each computation
    rendered: bool = False  # J of the rendered pixels is computed, too
    # For BOUND: digest of its start. For an exact method: the planner whose plan it starts from.
    start: str = ""
    # Digest of the code of a third-party planner.
    planner_digest: str = msgspec.field(default="", name="own")
    code: str  # digest of the code; empty if the cell is not kept

    @staticmethod
    @cache
    def digest_of_code() -> str:
        """Returns the digest of the code and the libraries on which results of cells depend.

        Comments, layout and docstrings do not count (see `cocap_opt.files.code`), nor do the
        meanings of columns.
        """
        versions = [f"{name} {number}" for name, number in SweepCell.versions().items()]
        parts = [*versions, code_digest(*digested_modules()), _code_of_rows()]
        return hashlib.sha256(" ".join(parts).encode()).hexdigest()

    @staticmethod
    def versions(*more: str) -> dict[str, str]:
        """Returns the versions of the libraries that results depend on, and of further packages.

        Packages that are not installed are omitted.
        """
        found = {}
        for name in sorted({*_LIBRARIES, *more}):
            with suppress(PackageNotFoundError):
                found[name] = version(name)
        return found

    @property
    def key(self) -> str:
        """Digest of all fields, which is the name of the cell's file."""
        return hashlib.sha256(msgspec.json.encode(self)).hexdigest()[:_KEY_DIGITS]

    @property
    def words(self) -> str:
        """The scene, the seed and the planner: the cell's name in messages."""
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
    traceback: str = ""  # traceback of an error
    seconds: float = 0.0  # seconds of the whole cell, including coverage
    coverage_seconds: float | None = None  # time to compute coverage; None if unknown
    machine: str = ""  # name of the machine that computed it
    row: PlannedRow | None = None  # row of a planner
    columns: BoundColumns | None = None  # columns of BOUND
    plan: PlanFile | None = None
    # Files by name: OWN for a planner, RULES and FREE for BOUND.
    certificates: dict[str, msgspec.Raw] = msgspec.field(default_factory=dict)
    traces: dict[str, str] = msgspec.field(default_factory=dict)  # traces of BOUND: RULES and FREE

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
    """The cells in a folder; without a folder, no cell is kept.

    Parameters
    ----------
    retry : True if failed cells count as missing
    cell_limit : s; cells that exceeded a lower limit count as missing
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
        except FileError:  # missing or damaged: the cell is computed either way
            return None
        if found.cell != cell or self._is_tried_again(found):
            return None
        return found

    def _is_tried_again(self, content: CellFile) -> bool:
        exceeded_less = content.status is Status.EXCEEDED and content.seconds < self._cell_limit
        return exceeded_less or (self._retry and not content.is_finished)

    def save(self, content: CellFile) -> None:
        """Writes the file of a cell atomically."""
        if (path := self.path(content.cell)) is not None:
            save_bytes(path, encode(content))

    def path(self, cell: SweepCell) -> Path | None:
        """Returns the path of a cell's file, whether it exists or not; None if nothing is kept."""
        return None if self._folder is None else self._folder / f"{cell.key}.json"


def digested_modules() -> list[str]:
    """Returns the modules, other than `tables.rows`, on which results of cells depend."""
    found = sorted(with_imports(*_WORK))
    return [name for name in found if not f"{name}.".startswith(tuple(f"{s}." for s in _SILENT))]


def _code_of_rows() -> str:
    """Returns the code that makes rows, without docstrings and the meanings of columns.

    A `TableColumn` only describes a field, its unit and its range; it computes nothing.
    """
    tree = ast.parse(Path(rows.__file__).read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "TableColumn":
            node.args, node.keywords = [], []
        if isinstance(node, _EXPLAINED) and ast.get_docstring(node) is not None:
            node.body = node.body[1:] or [ast.Pass()]
    return ast.unparse(tree)
