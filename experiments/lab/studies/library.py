"""Fills the library: each instance gets a plan and a proof, submitted as by any user."""

import tempfile
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.studies.options import Seconds
from cocap_opt.experiments.library.entries import DATA, Entry
from cocap_opt.experiments.library.judge import BOUND, PLAN
from cocap_opt.experiments.library.records import Library
from cocap_opt.files.documents import FileError, encode
from cocap_opt.output.files import save_bytes
from cocap_opt.problem import Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.run.engine import run
from cocap_opt.run.judged import Judged
from cocap_opt.run.options import Allowance, UsageError
from cocap_opt.stop import TimeLimit


def library(
    *name: Annotated[str, Parameter(help="instances (default: those without plan or bound)")],
    limit: Seconds = 5.0,
    method: Annotated[
        Literal["searchless", "branch-and-price", "column-generation"],
        Parameter(help="exact method; proofs of searchless are checked without a search"),
    ] = "searchless",
    sources: Annotated[
        Path | None,
        Parameter(
            name="--from", help="folder with scenes of other projects, one folder for each family"
        ),
    ] = None,
    folder: Annotated[
        Path | None, Parameter(name="--library", help="folder of another copy of the library")
    ] = None,
) -> int:
    """Makes instances, saves their digests, and submits a plan and a proof for each."""
    known = Library(folder or DATA)
    missing = {s.entry.name for s in known.standings() if s.state == "none"}
    wanted = [known.entry(n) for n in name] or [e for e in known.entries if e.name in missing]
    failed = 0
    for entry in wanted:
        try:
            by_name = None if sources is None else sources / entry.family.name
            files = by_name if entry.is_by_reference else None
            for words in _filled(known, entry, method, limit, files):
                say(f"{entry.name}: {words}")
        except (FileError, UsageError, UnsupportedError) as error:
            failed += 1
            say(str(error))
    return int(failed > 0)


def _filled(
    known: Library, entry: Entry, method: str, limit: float, files: Path | None
) -> Iterator[str]:
    """Solves an instance and submits the plan and the proof; yields the outcome of each."""
    known.register(entry, files)
    problem = known.problem(entry, files)
    program = f"cocap-opt {version('cocap-opt')} {method}"
    judged = run(problem, method, TimeLimit(limit))
    with tempfile.TemporaryDirectory() as folder:
        for kind, content in _files(problem, judged, method, limit).items():
            path = Path(folder) / f"{kind}.json"
            save_bytes(path, content)
            try:
                record = known.submit(path, "cocap-opt", program, judged.result.seconds, files)
                yield f"{kind} {record.value:.6f}"
            except FileError as error:
                yield str(error).removeprefix(f"{path}: ")


def _files(problem: Problem, judged: Judged[Any], method: str, limit: float) -> Mapping[str, bytes]:
    """Returns the files of the plan and of the proof, if they exist."""
    plan = judged.plan_file(problem, method, Allowance(limit))
    found = {PLAN: plan, BOUND: judged.result.certificate}
    return {kind: encode(file) for kind, file in found.items() if file is not None}
