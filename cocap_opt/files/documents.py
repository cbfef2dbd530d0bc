"""Scene and plan files: JSON, versioned, read strictly, written whole or not at all."""

import hashlib
from pathlib import Path
from typing import Any, Literal, TypeVar

import msgspec
import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem


class FileError(ValueError):
    """A file cannot be used; the message is one line that names file, field and what is allowed."""


class Header(msgspec.Struct):
    """What all files of this project begin with; other fields are not looked at."""

    format: str


class SceneFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A scene file."""

    format: Literal["cocap-opt scene"] = "cocap-opt scene"
    version: Literal[2] = 2
    problem: Problem


class PlanFile(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A plan file: the plan, what it claims, and the digest of its scene."""

    format: Literal["cocap-opt plan"] = "cocap-opt plan"
    version: Literal[1] = 1
    scene: str  # name
    digest: str  # of the problem
    planner: str
    reward: float  # J claimed
    plan: Plan


T = TypeVar("T")


def _encode_array(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"cannot write {type(value).__name__}")


def _decode_array(kind: type, value: Any) -> Any:
    try:
        rows = msgspec.convert(value, list[list[float]])  # all arrays in files have two axes
    except msgspec.ValidationError as error:
        raise ProblemError(str(error).replace("$", "row, column ")) from error
    if len({len(row) for row in rows}) > 1:
        raise ProblemError("rows must have equal length")
    return np.array(rows, dtype=np.float64).reshape(len(rows), -1)


def encode(content: msgspec.Struct) -> bytes:
    """One JSON line per top-level field, so that files can be read and compared."""
    text = msgspec.json.encode(content, enc_hook=_encode_array)
    return msgspec.json.format(text, indent=1) + b"\n"


def decode(content: bytes, kind: type[T], name: str) -> T:
    """Decode a file's content strictly.

    Raises
    ------
    FileError
        One line with the file's name, the field and what is allowed.
    """
    try:
        return msgspec.json.decode(content, type=kind, dec_hook=_decode_array)
    except (msgspec.MsgspecError, ProblemError, UnicodeDecodeError, RecursionError) as error:
        raise FileError(f"{name}: {' '.join(str(error).split())}") from error


def read_bytes(path: Path) -> bytes:
    """Content of a file, or a FileError that names it."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: {error.strerror}") from error


def load_problem(path: Path) -> Problem:
    """Read a scene file."""
    content = read_bytes(path)
    kind = decode(content, Header, str(path)).format
    if kind != "cocap-opt scene":
        raise FileError(f"{path}: format: must be 'cocap-opt scene', not {kind!r}")
    return decode(content, SceneFile, str(path)).problem


def save_problem(path: Path, problem: Problem) -> None:
    """Write a scene file; reading it gives the same problem, bit for bit."""
    write_atomically(path, encode(SceneFile(problem=problem)))


def problem_digest(problem: Problem) -> str:
    """Digest of everything in a problem but its name."""
    content = msgspec.json.encode(problem.replace(name=""), enc_hook=_encode_array)
    # Read back once: numbers given as 5 and 5.0 are the same.
    again = msgspec.json.decode(content, type=Problem, dec_hook=_decode_array)
    content = msgspec.json.encode(again, enc_hook=_encode_array)
    return hashlib.sha256(content).hexdigest()


def load_plan(path: Path) -> PlanFile:
    """Read a plan file."""
    return decode(read_bytes(path), PlanFile, str(path))


def save_plan(path: Path, content: PlanFile) -> None:
    """Write a plan file."""
    write_atomically(path, encode(content))
