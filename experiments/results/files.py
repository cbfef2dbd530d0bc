"""Files of the command line: plans and certificates in, everything out whole or not at all."""

import csv
import io
import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import msgspec

from cocap_opt.check import check
from cocap_opt.experiments.results.rows import Judged, Row
from cocap_opt.files.atomic_write import UNFINISHED, file_to_write, write_atomically, write_together
from cocap_opt.files.documents import (
    FileError,
    Header,
    PlanFile,
    decode,
    encode,
    problem_digest,
    read_bytes,
)
from cocap_opt.formulations.certificates.certificate import CertificateFile
from cocap_opt.formulations.certificates.proof import ProofFile
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Result
from cocap_opt.scenarios import read_foreign_plan, scene_of_plan

if sys.platform != "win32":
    import fcntl

LEFTOVER = 3600.0  # s, after which nobody is writing a file any more
KINDS: dict[str, type[PlanFile] | type[CertificateFile] | type[ProofFile]] = {
    "cocap-opt plan": PlanFile,
    "cocap-opt certificate": CertificateFile,
    "cocap-opt proof": ProofFile,
}


def save(path: Path, content: msgspec.Struct) -> None:
    """Write a plan, a certificate or a proof."""
    save_together({path: content})


def save_together(contents: Mapping[Path, msgspec.Struct]) -> None:
    """Write files that belong together: all new ones, or the old ones are left."""
    encoded = {path: encode(content) for path, content in contents.items()}
    write(" and ".join(map(str, contents)), lambda: write_together(encoded))


def save_bytes(path: Path, content: bytes) -> None:
    """Write a file whole or not at all."""
    write(path, lambda: write_atomically(path, content))


def save_csv(path: Path, rows: Sequence[Row]) -> None:
    """Write rows that all have the keys of the first as CSV."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    save_bytes(path, text.getvalue().encode())


def plan_file(problem: Problem, planner: str, judged: Judged[Result]) -> PlanFile | None:
    """A plan with the reward that the referee gave it; None where there is no plan."""
    if judged.result.plan is None:
        return None
    return PlanFile(
        scene=problem.name,
        digest=problem_digest(problem),
        planner=planner,
        reward=judged.reward,
        plan=judged.result.plan,
    )


def check_output(path: Path | None) -> None:
    """Refuse a file that cannot be written before the work for it is done."""
    if path is None:
        return
    try:
        folder = file_to_write(path).parent
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error
    if not folder.is_dir():
        raise FileError(f"{path}: the folder {folder} does not exist")
    if not os.access(folder, os.W_OK):
        raise FileError(f"{path}: the folder {folder} cannot be written to")


def make_folder(path: Path | None, *parts: str) -> None:
    """Make a folder for results, with folders inside, before the work for them is done."""
    if path is not None:
        try:
            for part in (".", *parts):
                (path / part).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{path}: cannot be made a folder: {error.strerror}") from error


@contextmanager
def only_writer(folder: Path | None) -> Iterator[None]:
    """Keep other commands from writing into a folder for results, where the system can.

    The lock ends with the process, however that ends.
    """
    if folder is None or sys.platform == "win32":
        yield
        return
    with (folder / ".lock").open("wb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            words = "another command writes there; wait for it, or name another folder"
            raise FileError(f"{folder}: {words}") from None
        except OSError:  # a file system without locks
            pass
        yield


def clear_leftovers(folders: Sequence[Path]) -> None:
    """Remove what processes that were killed while they wrote have left behind."""
    for folder in folders:
        for path in folder.glob(f"{UNFINISHED}*"):
            with suppress(OSError):
                if time.time() - path.stat().st_mtime > LEFTOVER:
                    path.unlink()


def write(name: Path | str, action: Callable[[], None]) -> None:
    """Do what writes files; a failure names them."""
    try:
        action()
    except OSError as error:
        raise FileError(f"{name}: cannot be written: {error.strerror}") from error


def remove(path: Path) -> None:
    """Have no such file."""
    write(path, lambda: path.unlink(missing_ok=True))


def read_text(path: Path) -> str:
    """Content of a file in UTF-8, or a FileError that names it."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: must be text in UTF-8") from error


def read_claim(path: Path, problem: Problem) -> PlanFile | CertificateFile | ProofFile | Plan:
    """A plan, certificate or proof file, or a plan in a foreign format."""
    foreign = read_foreign_plan(path, problem)
    if foreign is not None:
        return foreign
    return _decode_any(read_bytes(path), str(path))


def decode_certificate(content: bytes, name: str) -> CertificateFile | ProofFile:
    """A certificate or a proof from its file's content."""
    found = _decode_any(content, name)
    if isinstance(found, PlanFile):
        raise FileError(f"{name}: must be a certificate or a proof, not a plan")
    return found


def _decode_any(content: bytes, name: str) -> PlanFile | CertificateFile | ProofFile:
    kind = KINDS.get(decode(content, Header, name).format)
    if kind is None:
        raise FileError(f"{name}: format: must be one of {', '.join(KINDS)}")
    return decode(content, kind, name)


def read_plan(path: Path, scene: str, problem: Problem) -> tuple[Problem, Plan]:
    """A plan that can be flown, and the variant of the scene that it was made for."""
    content = read_claim(path, problem)
    if isinstance(content, CertificateFile | ProofFile):
        raise FileError(f"{path}: must be a plan, not a certificate")
    plan = content.plan if isinstance(content, PlanFile) else content
    problem = scene_of_plan(scene, problem, plan)
    verdict = check(problem, plan)
    if verdict.violations:
        raise FileError(f"{path}: {verdict.violations[0]}")
    return problem, plan


def read_plans(paths: Sequence[Path], scene: str, problem: Problem) -> tuple[Problem, list[Plan]]:
    """Plans that can be flown, and the variant of the scene that all of them were made for."""
    found = [read_plan(path, scene, problem) for path in paths]
    variants = [problem_digest(fitting) for fitting, _ in found]
    for path, variant in zip(paths, variants, strict=True):
        if variant != variants[0]:
            raise FileError(
                f"{path}: is for other starts than {paths[0]}; `export` writes the scene with "
                "either (--option start-set=yaml or seed) to plan on"
            )
    return found[0][0] if found else problem, [plan for _, plan in found]
