"""Files of the command line: plans and certificates in, everything out whole or not at all."""

import os
from collections.abc import Callable
from pathlib import Path

import msgspec

from cocap_opt.cache import file_to_write, write_atomically
from cocap_opt.check import check
from cocap_opt.io import (
    FileError,
    Header,
    PlanFile,
    decode,
    encode,
    problem_digest,
    read_bytes,
)
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from cocap_opt.result import Result
from experiments.report import Judged
from formulations.certificate import CertificateFile
from formulations.proof import ProofFile
from scenarios import read_foreign_plan, scene_of_plan

KINDS: dict[str, type[PlanFile] | type[CertificateFile] | type[ProofFile]] = {
    "cocap-opt plan": PlanFile,
    "cocap-opt certificate": CertificateFile,
    "cocap-opt proof": ProofFile,
}


def save(path: Path, content: msgspec.Struct) -> None:
    """Write a plan, a certificate or a proof."""
    write(path, lambda: write_atomically(path, encode(content)))


def save_plan(path: Path, problem: Problem, planner: str, judged: Judged[Result]) -> None:
    """Write a plan with the reward that the referee gave it."""
    assert judged.result.plan is not None
    content = PlanFile(
        scene=problem.name,
        digest=problem_digest(problem),
        planner=planner,
        reward=judged.reward,
        plan=judged.result.plan,
    )
    save(path, content)


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


def make_folder(path: Path | None) -> None:
    """Make the folder of a gap table, with its two folders inside."""
    if path is not None:
        try:
            for part in ("certificates", "plans"):
                (path / part).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{path}: cannot be made a folder: {error.strerror}") from error


def write(path: Path, action: Callable[[], None]) -> None:
    """Do what writes a file; a failure names the file."""
    try:
        action()
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error


def read_claim(path: Path, problem: Problem) -> PlanFile | CertificateFile | ProofFile | Plan:
    """A plan, certificate or proof file, or a plan in a foreign format."""
    foreign = read_foreign_plan(path, problem)
    if foreign is not None:
        return foreign
    content = read_bytes(path)
    kind = KINDS.get(decode(content, Header, str(path)).format)
    if kind is None:
        raise FileError(f"{path}: format: must be one of {', '.join(KINDS)}")
    return decode(content, kind, str(path))


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
