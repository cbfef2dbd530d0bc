"""Documents, the common scheme of all files of this project, such as scene and plan files.

They are JSON with a format and a version, read strictly, and written completely or not at all.
"""

import hashlib
import os
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar, get_args, get_type_hints

import msgspec
import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.messages import in_words
from cocap_opt.files.strict_json import decode_json
from cocap_opt.problem import COVERAGE_VERSION, Ending, Objective, Plan, Problem
from cocap_opt.stop import Limit, Reason
from cocap_opt.text import unread

_Amount = Annotated[float, msgspec.Meta(ge=0)]
_Count = Annotated[int, msgspec.Meta(ge=0)]


class FileError(ValueError):
    """A file cannot be used; the message is one line that names file, field and what is allowed."""


# The reason why older results are rejected: their J is not that of the scene.
SAMPLED = "it is from an older cocap-opt, whose coverage was sampled; create it again"


class Document(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of all files of this project: scenes, plans, certificates, proofs and results.

    A document states its kind in `format` and has a `version`. The type of `version` lists the
    versions that can be read; the default is the version that is written. A new version may add
    fields with a default, which applies to older files; after any other change, older versions
    cannot be read. Unknown fields and files of other versions are rejected with a message.
    """

    older: ClassVar[str] = ""  # why files of older versions are not read

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a file of this kind.

        Raises
        ------
        FileError
            If it cannot be used; one line with its name, the field and what is allowed.
        """
        return decode_document(read_bytes(path), str(path), cls)

    def save(self, path: Path) -> None:
        """Write the file, completely or not at all; reading it gives the same content, bit for bit.

        Raises
        ------
        FileError
            If it cannot be written; one line with its name.
        """
        try:
            write_atomically({path: encode(self)})
        except OSError as error:
            raise FileError(f"{path}: {error.strerror}") from error


class _Header(msgspec.Struct):
    """The fields that identify the kind of a document; others are ignored."""

    format: str
    version: int | None = None


class SceneFile(Document, frozen=True, kw_only=True):
    """A scene file.

    Attributes
    ----------
    format : the kind of file
    version : of this format
    problem : the scene
    """

    format: Literal["cocap-opt scene"] = "cocap-opt scene"
    version: Literal[2] = 2
    problem: Problem

    @classmethod
    def of(cls, problem: Problem) -> Self:
        """Returns the file of a problem; fields that need not be whole numbers have 5.0, not 5."""
        return cls(problem=_read_back(problem))


class PlanFile(Document, frozen=True, kw_only=True):
    """A plan file: the plan, its J, the digest of its scene, and what stopped its search.

    Attributes
    ----------
    format : the kind of file
    version : of this format
    scene : the name of the scene
    digest : of the scene
    digest_without_objective : digest of the scene with the usual objective, to compare plans for
        several objectives; None: not recorded
    planner : the name of the planner
    limit : the limit that stopped the planner; None: none did, or it was not recorded
    reason : why the planner stopped; None: not recorded
    seconds : s, wall-clock time of the search; None: not recorded
    time_limit : s, time limit of the planner; None: it had no limit, or it was not recorded
    work_limit : work limit of the planner; None: as for `time_limit`
    cut_short : effect of the limit on the plan, in words; empty if no limit stopped the planner
    coverage_version : version of the formula for pixels; None: not recorded
    reward : J as the planner claims it
    plan : a path for each drone
    """

    older = SAMPLED
    format: Literal["cocap-opt plan"] = "cocap-opt plan"
    version: Literal[2, 3, 4] = 4
    scene: str
    digest: str
    digest_without_objective: str | None = None
    planner: str
    limit: Limit | None = None
    reason: Reason | None = None
    seconds: _Amount | None = None
    time_limit: _Amount | None = None
    work_limit: _Count | None = None
    cut_short: str = ""
    coverage_version: int | None = None
    reward: float
    plan: Plan

    @classmethod
    def of(
        cls, problem: Problem, plan: Plan, reward: float, planner: str, **more: Any
    ) -> "PlanFile":
        """Returns the file of a plan for a problem; `more` are further fields."""
        return cls(
            scene=problem.name, digest=problem_digest(problem),
            digest_without_objective=digest_without_objective(problem),
            coverage_version=COVERAGE_VERSION, planner=planner, reward=reward, plan=plan, **more,
        )  # fmt: skip

    @property
    def ending(self) -> Ending:
        """The end of the search for the plan; older files have fewer details."""
        stopped = Reason.FINISHED if self.limit is None else Reason.STOPPED
        return Ending(self.reason or stopped, self.limit, told=self.cut_short)


T = TypeVar("T")
D = TypeVar("D", bound=Document)


def _encode_array(value: object) -> object:
    if isinstance(value, np.ndarray):
        return value.tolist()
    raise TypeError(f"cannot write {type(value).__name__}")


def _decode_array(kind: type, value: Any) -> Any:
    try:
        rows = msgspec.convert(value, list[list[float]])  # all arrays in files have two axes
    except msgspec.ValidationError as error:
        words = in_words(error, "array", list[list[float]], value)
        raise ProblemError(f"row, column {words}" if words.startswith("[") else words) from error
    if len({len(row) for row in rows}) > 1:
        raise ProblemError("rows must have equal length")
    if not rows:
        raise ProblemError("must not be empty")
    return np.array(rows, dtype=np.float64).reshape(len(rows), -1)


def encode(content: msgspec.Struct) -> bytes:
    """Returns JSON with one line per top-level field, so that files can be read and compared."""
    text = msgspec.json.encode(content, enc_hook=_encode_array)
    return msgspec.json.format(text, indent=1) + b"\n"


def _decode(content: bytes, kind: type[T], name: str) -> T:
    """Decode a file's content strictly.

    Raises
    ------
    FileError
        One line with the file's name, the field and what is allowed.
    """
    try:
        return decode_json(content, kind, _decode_array)
    except (msgspec.MsgspecError, ProblemError, UnicodeDecodeError, RecursionError) as error:
        raise FileError(f"{name}: {in_words(error, content, kind)}") from error


def decode_document(content: bytes, name: str, *kinds: type[D]) -> D:
    """Decode a document that is one of some kinds.

    Raises
    ------
    FileError
        One line with the file's name, the field and what is allowed: another kind of file, a
        version that is not read, an unknown field, a value out of range.
    """
    header = _decode(content, _Header, name)
    formats = {_default(kind, "format"): kind for kind in kinds}
    if header.format not in formats:
        allowed = " or ".join(repr(known) for known in formats)
        raise FileError(f"{name}: format: must be {allowed}, not {header.format!r}")
    kind = formats[header.format]
    versions = get_args(get_type_hints(kind)["version"])
    if header.version not in versions:
        known = ", ".join(map(str, sorted(versions)))
        if header.version is None:
            raise FileError(f"{name}: version: is missing; must be {known}")
        newer = "it is from a newer cocap-opt" if header.version > max(versions) else kind.older
        why = f": {newer}" if newer else ""
        raise FileError(f"{name}: version: must be {known}, not {header.version}{why}")
    return _decode(content, kind, name)


def other_coverage(version: int | None) -> str:
    """Says that a file was made with another version of coverage; empty if unknown."""
    if version in (None, COVERAGE_VERSION):
        return ""
    return (
        f"it was made with version {version} of coverage, but this is version {COVERAGE_VERSION}, "
        "in which pixels and J differ"
    )


def _default(kind: type[Document], field: str) -> object:
    return next(f.default for f in msgspec.structs.fields(kind) if f.name == field)


def unreadable(path: Path) -> str:
    """Says that a path is not a name, or a pipe or a device, which may not end, if it is so."""
    if "\0" in str(path):
        return "must be the name of a file, in which no character is NUL"
    # Unlike Path.exists, os.path.exists is false, too, for names that no file can have.
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):
        return "must be a regular file, no pipe or device"
    return ""


def read_bytes(path: Path) -> bytes:
    """Content of a file, or a FileError that names it."""
    if words := unreadable(path):
        raise FileError(f"{path}: {words}")
    try:
        return path.read_bytes()
    except OSError as error:
        raise FileError(f"{path}: {unread(error)}") from error


@lru_cache(maxsize=8)
def problem_digest(problem: Problem) -> str:
    """Returns the digest of everything that affects J or the set of possible plans.

    It does not depend on names, places on the Earth, land cover, bare ground, homes, numbers, the
    begin of tracks and the required share of views. The page on files defines it, so that anybody
    can compute it.
    """
    numbers = {take.name: str(k) for k, take in enumerate(problem.takes)}
    actors = tuple(
        actor.replace(name=None, begin=None, take=numbers.get(actor.take or ""))
        for actor in problem.actors
    )
    takes = tuple(take.replace(name=numbers[take.name]) for take in problem.takes)
    robots = tuple(robot.replace(goal=None) for robot in problem.robots)
    nameless = problem.replace(
        name="", robots=robots, actors=actors, earth=None, takes=takes, land_cover=()
    )
    fields = msgspec.to_builtins(_read_back(nameless), enc_hook=_encode_array)
    # Goals contain only whole numbers. They may have many cells, which take long to read back.
    goals = {goal: msgspec.to_builtins(goal) for goal in {robot.goal for robot in problem.robots}}
    for robot, spec in zip(fields["robots"], problem.robots, strict=True):
        robot["goal"] = goals[spec.goal]
    # Fields that are newer than stored digests are left out if they are empty.
    for holder in (fields, *fields["robots"], *fields["actors"]):
        for name in ("step", "earth", "limits", "name", "begin", "take", "takes", "land_cover"):
            if name in holder and holder[name] in (None, [], ()):
                del holder[name]
    del fields["height_map"]["bare"]
    for robot in fields["robots"]:
        del robot["home"], robot["number"]
    for name, nothing in (("pixels", 1.0), ("views", None)):
        if fields["objective"][name] == nothing:
            del fields["objective"][name]
    fields["objective"].get("views", {}).pop("share", None)
    newer = (
        (fields["height_map"], "lift", None), (fields["airspace"], "people_stray", 0.0),
        *((actor, "swerve", 0.0) for actor in fields["actors"]),
        *((robot["motion"], "stride", None) for robot in fields["robots"]),
        *((robot["motion"], "spacing", 1) for robot in fields["robots"]),
    )  # fmt: skip
    for holder, name, nothing in newer:
        if holder[name] == nothing:
            del holder[name]
    return hashlib.sha256(msgspec.json.encode(fields)).hexdigest()


def digest_without_objective(problem: Problem) -> str:
    """Returns the digest that a problem would have with the usual objective."""
    return problem_digest(problem.replace(objective=Objective()))


def _read_back(problem: Problem) -> Problem:
    """Returns the problem as read back from a file, in which 5 and 5.0 are the same number."""
    content = msgspec.json.encode(problem, enc_hook=_encode_array)
    return msgspec.json.decode(content, type=Problem, dec_hook=_decode_array)
