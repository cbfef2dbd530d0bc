"""Cells of a sweep: what each is, and the file in which it is kept.

A cell is one planner, or the bound, on one scene and seed. Its name in the folder is the digest
of all that its result depends on, so cells of other settings or of other code do not match.
"""

import hashlib
from enum import StrEnum
from functools import cache
from pathlib import Path
from typing import Any, Literal

import msgspec

import cocap_opt
import formulations
from cocap_opt.io import FileError, PlanFile, decode, encode, read_bytes
from cocap_opt.problem import Problem
from experiments.files import save_bytes

BOUND = "bound"  # in place of a planner's name
KEY_DIGITS = 20


class Status(StrEnum):
    """How a cell ended; what a planner says of its own limit is in the row."""

    FINISHED = "finished"
    ERROR = "error"  # in the code or in its libraries
    EXCEEDED = "exceeded"  # it took longer than a cell may
    DIED = "died"  # its process did


class Cell(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is to be computed, and all that its result depends on."""

    scene: str
    seed: int
    planner: str  # or BOUND
    digest: str  # of the problem
    limit: float  # s, for each computation
    rendered: bool  # J of the rendered pixels is wanted, too
    planners: tuple[str, ...] = ()  # of BOUND: whose plans it begins with
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
    seconds: float = 0.0  # of the whole cell, coverage included
    machine: str = ""  # where it was computed
    row: dict[str, Any] = {}  # its part of the rows of the gap table
    plan: PlanFile | None = None
    certificates: dict[str, msgspec.Raw] = {}  # files, by the name that the row has for each

    @property
    def is_finished(self) -> bool:
        """Whether there is a result."""
        return self.status is Status.FINISHED


class Store:
    """The cells in a folder; without a folder nothing is kept.

    Parameters
    ----------
    retry : cells that have failed count as missing
    """

    def __init__(self, folder: Path | None, retry: bool = False) -> None:
        self._folder = None if folder is None else folder / "cells"
        self._retry = retry

    def find(self, cell: Cell) -> CellFile | None:
        """What has become of a cell, if that is known."""
        if self._folder is None:
            return None
        path = self._path(cell)
        try:
            found = decode(read_bytes(path), CellFile, str(path))
        except FileError:  # there is none, or it is damaged: either way it is computed
            return None
        if found.cell != cell or (self._retry and not found.is_finished):
            return None
        return found

    def save(self, content: CellFile) -> None:
        """Keep what has become of a cell; its file is whole or not there."""
        if self._folder is not None:
            save_bytes(self._path(content.cell), encode(content))

    def _path(self, cell: Cell) -> Path:
        assert self._folder is not None
        return self._folder / f"{cell.key}.json"


@cache
def code_digest() -> str:
    """Digest of the code that results depend on: planners, bounds and what they share."""
    digest = hashlib.sha256()
    for package in (cocap_opt, formulations):
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
    planners: tuple[str, ...] = (),
) -> Cell:
    """The cell of a planner, or of the bound, on a problem."""
    return Cell(
        scene=problem.name, seed=seed, planner=planner, digest=digest, limit=limit,
        rendered=rendered, planners=planners, code=code_digest(),
    )  # fmt: skip
