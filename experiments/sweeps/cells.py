"""Cells of a sweep: what each is, and the file in which it is kept.

A cell is one planner, or the bound, on one scene and seed. Its name in the folder is the digest
of all that its result depends on, so cells of other settings or of other code do not match.
"""

import hashlib
from enum import StrEnum
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

import msgspec

from cocap_opt import data, experiments, formulations
from cocap_opt.experiments.results.files import save_bytes
from cocap_opt.experiments.results.layout import CELLS
from cocap_opt.files.documents import FileError, PlanFile, decode, encode, read_bytes
from cocap_opt.problem.problem import Problem

BOUND = "bound"  # in place of a planner's name
OWN = "own"  # the certificate of a planner that proves a bound itself
RULES, FREE = "rules", "free"  # certificates and traces of the bound with and without rules
KEY_DIGITS = 20
# Code and libraries that cells depend on, besides the packages of planners and bounds.
MODULES = (
    "results/files", "results/gap_table", "results/rendered", "results/rows", "results/trace",
    "sweeps/cells", "sweeps/start", "sweeps/work",
)  # fmt: skip
LIBRARIES = ("clarabel", "embreex", "highspy", "numpy", "ortools", "scipy")


class Status(StrEnum):
    """How a cell ended; what a planner says of its own limit is in the row."""

    FINISHED = "finished"
    ERROR = "error"  # in the code or in its libraries
    EXCEEDED = "exceeded"  # it took longer than a cell may
    DIED = "died"  # its process did


FAILED = (Status.ERROR, Status.EXCEEDED, Status.DIED)


class Cell(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is to be computed, and all that its result depends on."""

    scene: str
    seed: int
    planner: str  # or BOUND
    digest: str  # of the problem
    limit: float  # s, for each computation
    rendered: bool  # J of the rendered pixels is wanted, too
    start: str = ""  # of BOUND: digest of what it begins with
    code: str  # digest of the code

    @property
    def key(self) -> str:
        """Digest of all of it."""
        return hashlib.sha256(msgspec.json.encode(self)).hexdigest()[:KEY_DIGITS]

    @property
    def words(self) -> str:
        """Its name for people."""
        return f"{self.scene} seed {self.seed}, {self.planner}"


class CellFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What has become of a cell."""

    format: Literal["cocap-opt cell"] = "cocap-opt cell"
    version: Literal[1] = 1
    cell: Cell
    status: Status
    message: str = ""  # why it has no result, in words
    traceback: str = ""  # of an error
    seconds: float = 0.0  # of the whole cell, coverage included
    machine: str = ""  # where it was computed
    row: dict[str, Any] = {}  # its part of the rows of the gap table
    plan: PlanFile | None = None
    certificates: dict[str, msgspec.Raw] = {}  # files: OWN of a planner, RULES and FREE
    traces: dict[str, str] = {}  # files of BOUND: RULES and FREE

    @property
    def is_finished(self) -> bool:
        """Whether there is a result."""
        return self.status is Status.FINISHED

    def certificate(self, name: str) -> bytes:
        """Content of a certificate's file."""
        return msgspec.json.format(bytes(self.certificates[name]), indent=1) + b"\n"


class Store:
    """The cells in a folder; without a folder nothing is kept.

    Parameters
    ----------
    retry : cells that have failed count as missing
    cell_limit : s; cells that have exceeded a lower limit count as missing
    """

    def __init__(self, folder: Path | None, retry: bool = False, cell_limit: float = 0.0) -> None:
        self._folder = None if folder is None else folder / CELLS
        self._retry, self._cell_limit = retry, cell_limit

    def find(self, cell: Cell) -> CellFile | None:
        """What has become of a cell, if that is known."""
        path = self.path(cell)
        if path is None:
            return None
        try:
            found = decode(read_bytes(path), CellFile, str(path))
        except FileError:  # there is none, or it is damaged: either way it is computed
            return None
        if found.cell != cell or self._is_tried_again(found):
            return None
        return found

    def _is_tried_again(self, content: CellFile) -> bool:
        exceeded_less = content.status is Status.EXCEEDED and content.seconds < self._cell_limit
        return exceeded_less or (self._retry and not content.is_finished)

    def save(self, content: CellFile) -> None:
        """Keep what has become of a cell; its file is whole or not there."""
        if (path := self.path(content.cell)) is not None:
            save_bytes(path, encode(content))

    def path(self, cell: Cell) -> Path | None:
        """Where a cell's file is, or would be; None where nothing is kept."""
        return None if self._folder is None else self._folder / f"{cell.key}.json"


@cache
def code_digest() -> str:
    """Digest of the code and the libraries that results depend on."""
    libraries = [version(name) for name in LIBRARIES]
    digest = hashlib.sha256(" ".join(libraries).encode())
    for module in MODULES:
        digest.update((Path(str(experiments.__file__)).parent / f"{module}.py").read_bytes())
    for package in (data, formulations):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def cell_of(
    problem: Problem,
    digest: str,
    seed: int,
    planner: str,
    limit: float,
    rendered: bool = False,
    start: str = "",
) -> Cell:
    """The cell of a planner, or of the bound, on a problem."""
    return Cell(
        scene=problem.name, seed=seed, planner=planner, digest=digest, limit=limit,
        rendered=rendered, start=start, code=code_digest(),
    )  # fmt: skip
