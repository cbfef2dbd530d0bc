"""Files of the command line: plans and certificates in, everything out whole or not at all."""

import os
from collections.abc import Callable
from pathlib import Path

from cocap_opt.check import check
from cocap_opt.io import FileError, Header, PlanFile, decode, problem_digest, read_bytes
from cocap_opt.io import save_plan as save_plan_file
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem
from experiments.report import Judged
from formulations.certificate import CertificateFile
from scenarios import read_foreign_plan, scene_of_plan


def save_plan(path: Path, problem: Problem, planner: str, judged: Judged) -> None:
    """Write a plan with the reward that the referee gave it."""
    assert judged.result.plan is not None
    content = PlanFile(
        scene=problem.name,
        digest=problem_digest(problem),
        planner=planner,
        reward=judged.reward,
        plan=judged.result.plan,
    )
    write(path, lambda: save_plan_file(path, content))


def check_output(path: Path | None) -> None:
    """Refuse a file that cannot be written before the work for it is done."""
    if path is None:
        return
    if path.is_dir():
        raise FileError(f"{path}: must be a file to write, not a folder")
    if path.exists() and not path.is_file():
        raise FileError(f"{path}: must be a regular file, not a device or a pipe")
    if not path.parent.is_dir():
        raise FileError(f"{path}: the folder {path.parent} does not exist")
    if not os.access(path.parent, os.W_OK):
        raise FileError(f"{path}: the folder {path.parent} cannot be written to")


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


def read_claim(path: Path, problem: Problem) -> PlanFile | CertificateFile | Plan:
    """A plan file, a certificate file, or a plan in a foreign format."""
    foreign = read_foreign_plan(path, problem)
    if foreign is not None:
        return foreign
    content = read_bytes(path)
    kind = decode(content, Header, str(path)).format
    if kind == "cocap-opt plan":
        return decode(content, PlanFile, str(path))
    if kind == "cocap-opt certificate":
        return decode(content, CertificateFile, str(path))
    raise FileError(f"{path}: format: must be cocap-opt plan or cocap-opt certificate")


def read_plan(path: Path, scene: str, problem: Problem) -> tuple[Problem, Plan]:
    """A plan that can be flown, and the variant of the scene that it was made for."""
    content = read_claim(path, problem)
    if isinstance(content, CertificateFile):
        raise FileError(f"{path}: must be a plan, not a certificate")
    if isinstance(content, PlanFile):
        plan = content.plan
    else:
        plan, problem = content, scene_of_plan(scene, problem, content)
    verdict = check(problem, plan)
    if verdict.violations:
        raise FileError(f"{path}: {verdict.violations[0]}")
    return problem, plan
