"""The records of the library: accepted improvements, with date, submitter and file.

Records are only ever added. Their values are what `cocap-check` printed for the file, never a
submitter's claim.
"""

import csv
import gzip
import hashlib
import io
import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec

from cocap_opt.experiments.library.entries import DATA, Entry, read_list
from cocap_opt.experiments.library.judge import PLAN, TIME_LIMIT, Proved, proved
from cocap_opt.files.atomic_write import write_atomically
from cocap_opt.files.documents import (
    FileError,
    PlanFile,
    decode_document,
    problem_digest,
    read_bytes,
)
from cocap_opt.files.users_folder import users_folder
from cocap_opt.formulations.certificates import CertificateError, CertificateFile, ProofFile
from cocap_opt.formulations.independent import instance_of
from cocap_opt.model import compiled
from cocap_opt.output.files import read_text
from cocap_opt.problem import Problem

if sys.platform != "win32":
    import fcntl

RECORDS, DIGESTS, FILES = "records.csv", "digests.csv", "files"
SOLVED = 1e-6  # largest gap of a solved instance, as a share of the bound, or of LEAST if larger
ROUNDED = 1e-6  # units of J: values in records have six decimals
LEAST = 10.0  # units of J; smaller bounds are compared as this one, as values have six decimals
MOST_BYTES = 1_000_000  # bytes of a compressed file
_ONLY_TEXT = 80  # characters of a submitted name; longer ones are cut
_MOST_SECONDS = 1e9
_IN_COQ = " in Coq"


class Digest(NamedTuple):
    """The size of an instance, and the digests that it must have wherever it is made."""

    name: str
    drones: int
    people: int
    steps: int
    digest: str  # digest of the scene
    sha256: str  # SHA-256 of the instance's text


class Record(NamedTuple):
    """An improvement that was accepted.

    Attributes
    ----------
    name : of the instance
    kind : plan or bound
    value : in units of J, as the checker printed it; -inf if no plan exists
    file, sha256 : name of the file without its suffix .gz, and digest of its content
    who : name of the submitter, as submitted
    date : of the submission, UTC
    program : program that found it, as submitted or as in the file
    seconds : time of the search, as submitted or as in the file; nan if neither has it
    checked : version of cocap-opt whose `cocap-check` accepted it; with "in Coq" after it, whose
        `cocap-check-verified` accepted it
    """

    name: str
    kind: str
    value: float
    file: str
    sha256: str
    who: str
    date: str
    program: str
    seconds: float
    checked: str


R = TypeVar("R", Digest, Record)


class Standing(NamedTuple):
    """An instance with its best plan and its best bound."""

    entry: Entry
    digest: Digest | None
    plan: Record | None
    bound: Record | None

    @property
    def has_no_plan(self) -> bool:
        """True if it is proved that there is no plan."""
        return self.bound is not None and self.bound.value < 0  # no J is below 0

    @property
    def gap(self) -> float:
        """(bound - J) / bound; infinite if plan or bound is missing, 0 if no plan exists."""
        if self.plan is None or self.bound is None:
            return 0.0 if self.has_no_plan else math.inf
        left = max(0.0, self.bound.value - self.plan.value)
        return left / self.bound.value if left else 0.0

    @property
    def state(self) -> str:
        """Returns solved, open, or, if plan or bound is missing, none."""
        if self.has_no_plan:
            return "solved"
        if self.plan is None or self.bound is None:
            return "none"
        near = SOLVED * max(self.bound.value, LEAST)
        return "solved" if self.bound.value - self.plan.value <= near else "open"

    @property
    def is_open(self) -> bool:
        """True unless it is solved: there may be a better plan or bound."""
        return self.state != "solved"


class Library:
    """A library in a folder."""

    def __init__(self, folder: Path = DATA) -> None:
        self.folder = folder
        self.version, self.entries = read_list(folder)

    # -- reading -------------------------------------------------------------------------------

    def entry(self, name: str) -> Entry:
        """Returns an instance by its name.

        Raises
        ------
        FileError
            If no instance has this name.
        """
        for entry in self.entries:
            if entry.name == name:
                return entry
        listed = "`cocap-opt library status --all` lists them"
        raise FileError(f"{name}: is not an instance of the library; {listed}")

    def digests(self) -> dict[str, Digest]:
        """Returns the digests of all registered instances, by name."""
        return {row.name: row for row in _rows(self.folder / DIGESTS, Digest)}

    def records(self, name: str | None = None) -> list[Record]:
        """Returns all records, or those of one instance, oldest first."""
        rows = _rows(self.folder / RECORDS, Record)
        return [row for row in rows if name in (None, row.name)]

    def standings(self, name: str | None = None) -> list[Standing]:
        """Returns the best plan and the best bound of each instance, or of one.

        Raises
        ------
        FileError
            If a plan's J exceeds a bound, so that one of them must be wrong.
        """
        digests, plans, bounds = self.digests(), dict[str, Record](), dict[str, Record]()
        for row in self.records(name):
            best = plans if row.kind == PLAN else bounds
            if row.name not in best or _improves(row, best[row.name].value):
                best[row.name] = row
        for plan in plans.values():
            if told := _contradiction(plan, bounds.get(plan.name)):
                raise FileError(f"{self.folder / RECORDS}: {plan.name}: {told}")
        return [
            Standing(e, digests.get(e.name), plans.get(e.name), bounds.get(e.name))
            for e in self.entries
            if name in (None, e.name)
        ]

    def standing(self, name: str) -> Standing:
        """Returns the best plan and the best bound of an instance."""
        self.entry(name)
        (found,) = self.standings(name)
        return found

    def content(self, record: Record) -> bytes:
        """Returns the file of a record.

        Raises
        ------
        FileError
            If it is not the file that was accepted.
        """
        path = self.folder / FILES / f"{record.file}.gz"
        try:
            content = gzip.decompress(read_bytes(path))
        except (OSError, EOFError) as error:
            raise FileError(f"{path}: cannot be read: {error}") from error
        if hashlib.sha256(content).hexdigest() != record.sha256:
            raise FileError(f"{path}: is not the file that was accepted: its SHA-256 differs")
        return content

    # -- instances -----------------------------------------------------------------------------

    def problem(self, entry: Entry, folder: Path | None = None) -> Problem:
        """Makes the scene of an instance, and raises FileError if its digest differs."""
        problem = entry.problem(self.folder, folder)
        known = self.digests().get(entry.name)
        if known is not None and problem_digest(problem) != known.digest:
            raise FileError(f"{entry.name}: digest: the scene made here differs from the library's")
        return problem

    def instance(self, entry: Entry, folder: Path | None = None) -> Path:
        """Returns the file of an instance, and makes it if this machine does not have it.

        Raises
        ------
        FileError
            If it cannot be made, or its digest differs from the library's; one line.
        """
        known = self.digests().get(entry.name)
        path = _kept(entry)
        if known is None:
            raise FileError(f"{entry.name}: has no digest yet; run `cocap-opt study library`")
        if path.is_file() and hashlib.sha256(path.read_bytes()).hexdigest() == known.sha256:
            return path
        text = self.text(self.problem(entry, folder))
        sha256 = hashlib.sha256(text).hexdigest()
        if sha256 != known.sha256:
            words = "the instance made here differs from the library's in rounding"
            raise FileError(f"{entry.name}: sha256: {words}")
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically({path: text})
        return path

    @staticmethod
    def text(problem: Problem) -> bytes:
        """Returns the text of a scene's instance."""
        return instance_of(compiled(problem)).encode()

    def register(self, entry: Entry, folder: Path | None = None) -> Digest:
        """Makes an instance for the first time, and saves its digests."""
        problem = entry.problem(self.folder, folder)
        text = self.text(problem)
        found = Digest(
            entry.name, len(problem.robots), len(problem.actors), problem.horizon,
            problem_digest(problem), hashlib.sha256(text).hexdigest(),
        )  # fmt: skip
        with self._locked():
            digests = self.digests()
            for other in digests.values():
                if (other.name == found.name) != (other.digest == found.digest):
                    words = "has another digest" if other.name == found.name else "is the scene"
                    raise FileError(f"{entry.name}: {words} in the library: {other.name}")
            digests[entry.name] = found
            rows = [digests[e.name] for e in self.entries if e.name in digests]
            write_atomically({self.folder / DIGESTS: _csv(rows, Digest)})
        path = _kept(entry)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically({path: text})
        return found

    # -- submissions ---------------------------------------------------------------------------

    def submit(
        self,
        path: Path,
        who: str = "",
        program: str = "",
        seconds: float | None = None,
        folder: Path | None = None,
        time_limit: float = TIME_LIMIT,
        verified: Path | None = None,
    ) -> Record:
        """Adds a plan, a certificate or a proof, if a checker accepts it and it is better.

        Parameters
        ----------
        who : name of the submitter
        program : program that found it; empty to use the planner or method in the file
        seconds : time of the search; None to use the time in the file
        folder : folder with the instance's files that are not in the library
        time_limit : seconds for the checker; inf for none
        verified : the program `cocap-check-verified`, for bounds; None: `cocap-check` judges

        Raises
        ------
        FileError
            If it is rejected, or contradicts a record; one line. The library is unchanged then.
        """
        content = read_bytes(path)
        told = _told(content, path)
        entry = self._of_digest(str(told.get("digest")), path)
        instance = self.instance(entry, folder)
        judge = None if told.get("format") == "cocap-opt plan" else verified
        found = proved(instance, content, str(path), time_limit, judge)
        # The checker ignores some fields; users of the file need them to be valid, too.
        file = decode_document(content, str(path), PlanFile, CertificateFile, ProofFile)
        if isinstance(file, CertificateFile | ProofFile):
            self._require_own_objective(entry, file, path, folder)
        packed = gzip.compress(content, 9, mtime=0)
        if len(packed) > MOST_BYTES:
            raise FileError(f"{path}: must be at most {MOST_BYTES:,} bytes, compressed")
        sha256 = hashlib.sha256(content).hexdigest()
        taken = told.get("seconds") if seconds is None else seconds
        record = Record(
            entry.name, found.kind, found.value, f"{entry.name}.{found.kind}.{sha256[:12]}.json",
            sha256, _word(who) or "-", f"{datetime.now(UTC):%Y-%m-%d}",
            _word(program or told.get("planner") or told.get("method") or "-"),
            _seconds(taken),
            version("cocap-opt") + _IN_COQ * (judge is not None),
        )  # fmt: skip
        with self._locked():
            self._require_better(entry, found, path)
            rows = [*self.records(), record]
            # The file first: until the records are renamed, nothing points to it.
            write_atomically({
                self.folder / FILES / f"{record.file}.gz": packed,
                self.folder / RECORDS: _csv(rows, Record),
            })  # fmt: skip
        return record

    def recheck(
        self,
        record: Record,
        folder: Path | None = None,
        time_limit: float = math.inf,
        verified: Path | None = None,
    ) -> Proved:
        """Checks a record again, a bound by the program `cocap-check-verified` if it is given;
        `time_limit` is in seconds.

        Raises
        ------
        FileError
            If the file does not prove the record's value.
        """
        instance = self.instance(self.entry(record.name), folder)
        judge = None if record.kind == PLAN else verified
        found = proved(instance, self.content(record), record.file, time_limit, judge)
        # The verified checker proves the claim of the file, and `cocap-check` what follows from its
        # numbers; both round up.
        is_claim = record.checked.endswith(_IN_COQ)
        low, high = record.value, record.value + (1.5 * ROUNDED if judge else 0.0)
        is_same = found.value <= high and (is_claim or found.value >= low)
        if found.kind != record.kind or not is_same:
            raise FileError(f"{record.file}: proves {found.value:.6f}, not {record.value:.6f}")
        return found

    def _of_digest(self, digest: str, path: Path) -> Entry:
        for name, row in self.digests().items():
            if row.digest == digest:
                return self.entry(name)
        raise FileError(f"{path}: digest: does not match any instance of the library")

    def _require_own_objective(
        self, entry: Entry, file: CertificateFile | ProofFile, path: Path, folder: Path | None
    ) -> None:
        """Rejects a bound on another objective, as `verify` would not accept it for the scene."""
        if file.objective is msgspec.UNSET:
            return
        try:
            problem = file.problem_of(self.problem(entry, folder))
            alike = problem_digest(problem) == file.digest
        except CertificateError:
            alike = False
        if not alike:
            raise FileError(f"{path}: refused: objective: must be the objective of {entry.name}")

    def _require_better(self, entry: Entry, found: Proved, path: Path) -> None:
        standing = self.standing(entry.name)
        is_plan = found.kind == PLAN
        best = standing.plan if is_plan else standing.bound
        if best is None or _improves(found, best.value):
            pair = (found, standing.bound) if is_plan else (standing.plan, found)
            if wrong := _contradiction(*pair):
                raise FileError(f"{path}: refused: {entry.name}: {wrong}")
            return
        told = (
            f"{found.value:.6f} equals the record"
            if f"{found.value:.6f}" == f"{best.value:.6f}"
            else f"{found.value:.6f} is not better than the record, {best.value:.6f}"
        )
        raise FileError(f"{path}: refused: {entry.name}: {told}")

    @contextmanager
    def _locked(self) -> Iterator[None]:
        """Keeps other processes from adding records at the same time, if the system has locks."""
        if sys.platform == "win32":
            yield
            return
        folder = os.open(self.folder, os.O_RDONLY)
        try:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(folder, fcntl.LOCK_EX)
            yield
        finally:
            os.close(folder)


def _improves(found: Proved | Record, best: float) -> bool:
    return found.value > best if found.kind == PLAN else found.value < best


def _contradiction(plan: Proved | Record | None, bound: Proved | Record | None) -> str | None:
    """Returns a message if a plan's J exceeds a bound, otherwise None."""
    if plan is None or bound is None or plan.value <= bound.value + ROUNDED:
        return None
    return (
        f"a plan's J is {plan.value:.6f}, above a bound of {bound.value:.6f}: one of them is wrong"
    )


def _kept(entry: Entry) -> Path:
    """Returns the path where this machine keeps the file of an instance."""
    folder = users_folder()
    if folder is None:
        raise FileError(
            "COCAP_OPT_CACHE: must name a folder for instances, as no home folder is known"
        )
    return folder / "library" / f"{entry.name}.instance"


def _told(content: bytes, path: Path) -> dict[str, Any]:
    """Returns the fields of a submitted file; only its digest selects the instance."""
    try:
        told = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise FileError(f"{path}: must be JSON: {error}") from error
    if not isinstance(told, dict):
        raise FileError(f"{path}: must be a plan, a certificate or a proof")
    return told


def _word(text: object) -> str:
    """Returns submitted text as one short line."""
    shown = "".join(c if c.isprintable() else " " for c in str(text))
    return " ".join(shown.split())[:_ONLY_TEXT]


def _seconds(told: object) -> float:
    """Returns a submitted time in seconds; nan if it is not a plausible number."""
    if isinstance(told, int | float) and 0 <= told <= _MOST_SECONDS:
        return round(float(told), 3)
    return math.nan


def _rows(path: Path, kind: type[R]) -> list[R]:
    """Returns the rows of one of the library's tables; none if the file does not exist yet."""
    if not path.exists():
        return []
    table = csv.reader(io.StringIO(read_text(path)))
    try:
        if next(table, []) != list(kind._fields):
            raise ValueError(f"the columns must be {','.join(kind._fields)}")
        return [msgspec.convert(row, kind, strict=False) for row in table]
    except (ValueError, csv.Error) as error:
        raise FileError(f"{path}: line {table.line_num}: {error}") from error


def _csv(rows: Sequence[NamedTuple], kind: type[Digest] | type[Record]) -> bytes:
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(kind._fields)
    writer.writerows(rows)
    return text.getvalue().encode()
