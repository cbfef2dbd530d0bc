"""Files of the command line: reads plans and certificates; writes files completely or not at
all.
"""

import csv
import io
import logging
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.files.atomic_write import file_to_write, write_atomically
from cocap_opt.files.documents import (
    FileError,
    PlanFile,
    decode_document,
    digest_without_objective,
    problem_digest,
    read_bytes,
)
from cocap_opt.formulations.certificates import CertificateFile, ProofFile
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import UnsupportedError
from cocap_opt.scenarios import files_of, read_foreign_plan, scene_of_plan
from cocap_opt.text import OTHERWISE, other_scene, printable, shortened

log = logging.getLogger(__name__)

SOLUTION = ".sol"  # ending of files that other solvers have written

# -- writing ------------------------------------------------------------------------------


def save_bytes(path: Path, content: bytes) -> None:
    """Writes a file completely or not at all."""
    save_files({path: content})


def save_files(contents: Mapping[Path, bytes] | Mapping[Path, Callable[[BinaryIO], None]]) -> None:
    """Writes files completely or not at all, each from its content or by a function."""
    try:
        write_atomically(contents)
    except OSError as error:
        names = ", ".join(str(path) for path in contents)
        raise FileError(f"{names}: cannot be written: {error.strerror}") from error


def save_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Writes rows that all have the keys of the first as CSV."""
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    save_bytes(path, text.getvalue().encode())


def check_output(path: Path | None, *inputs: str | Path | None) -> None:
    """Raises an error for a file that cannot be written, before the work for it is done.

    Parameters
    ----------
    inputs : files that are read; neither they nor files that such a scene names may be overwritten
    """
    if path is None:
        return
    target = os.path.realpath(path)
    for given in inputs:
        read = [] if given is None else [given, *files_of(str(given))]
        if target in map(os.path.realpath, read):
            raise FileError(f"{path}: must not be an input file")
    try:
        folder = file_to_write(path).parent
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error
    if not folder.is_dir():
        raise FileError(f"{path}: the folder {folder} does not exist")
    if not os.access(folder, os.W_OK):
        raise FileError(f"{path}: the folder {folder} is not writable")


def make_folder(path: Path | None, *parts: str) -> None:
    """Creates a folder for results, with folders inside it, before the work for them is done."""
    if path is not None:
        try:
            for part in (".", *parts):
                (path / part).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{path}: cannot be created as a folder: {error.strerror}") from error


# -- reading ------------------------------------------------------------------------------


def read_text(path: Path) -> str:
    """Returns the text of a file.

    Raises
    ------
    FileError
        If the file cannot be read, or is not UTF-8.
    """
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(f"{path}: must be text in UTF-8") from error


class GivenPlan(NamedTuple):
    """A plan from a file that can be flown.

    Attributes
    ----------
    problem : the variant of the scene for which it was made
    file : all content of its file; None for a foreign format
    """

    problem: Problem
    plan: Plan
    file: PlanFile | None

    @property
    def planner(self) -> str | None:
        """The planner that made it, and the limit that stopped it; foreign files do not contain
        this.
        """
        if self.file is None:
            return None
        stopped = f", stopped by the {self.file.limit} limit" if self.file.limit else ""
        return self.file.planner + stopped

    @property
    def cut_short(self) -> str:
        """Remark on how complete the plan was at a limit; foreign files do not contain it."""
        return "" if self.file is None else self.file.ending.left_of(self.plan)


def read_claim(path: Path) -> PlanFile | CertificateFile | ProofFile:
    """Reads a plan, a certificate or a proof from a file of this project.

    Raises
    ------
    FileError
        If the file is none of these.
    """
    found = decode_document(read_bytes(path), str(path), PlanFile, CertificateFile, ProofFile)
    assert isinstance(found, PlanFile | CertificateFile | ProofFile)
    return found


class PlanReader(NamedTuple):
    """Reads plans and certificates from files, for one scene.

    Attributes
    ----------
    scene : name or file of the scene, as typed
    problem : the scene's problem
    """

    scene: str
    problem: Problem

    @staticmethod
    def titles(paths: Sequence[Path]) -> list[str]:
        """Returns names of plans: those of their files, with folders if names are equal."""
        names = [path.name for path in paths]
        return [printable(str(path) if names.count(path.name) > 1 else path.name) for path in paths]

    def claim(self, path: Path) -> PlanFile | CertificateFile | ProofFile | Plan:
        """Reads a plan, a certificate, a proof, or a plan in a foreign format.

        A foreign format may be a solver's solution of a program that `export` has written.
        """
        if path.suffix.lower() == SOLUTION:
            return self._solution(path)
        foreign = read_foreign_plan(path, self.problem)
        if foreign is not None:
            return foreign
        return read_claim(path)

    def _solution(self, path: Path) -> Plan:
        """Reads the plan in a solver's solution of this scene's program."""
        from cocap_opt.formulations.model_files.solutions import plan_of_solution  # imports solvers

        try:
            return plan_of_solution(self.problem, read_text(path))
        except (ProblemError, UnsupportedError) as error:
            raise FileError(f"{path}: {error}") from error

    def plan(self, path: Path, any_scene: bool = False, any_objective: bool = False) -> GivenPlan:
        """Reads a plan that can be flown, and finds the variant of the scene for which it was made.

        A plan file must belong to the scene, unless `any_scene` is True, or unless `any_objective`
        is True and only the objective differs, which is then logged.
        """
        return self.flown(path, self.claim(path), any_scene, any_objective)

    def flown(
        self,
        path: Path,
        content: PlanFile | CertificateFile | ProofFile | Plan,
        any_scene: bool = False,
        any_objective: bool = False,
    ) -> GivenPlan:
        """Returns the content of a file as a plan that can be flown, with the checks of `plan`."""
        if isinstance(content, CertificateFile | ProofFile):
            raise FileError(f"{path}: must be a plan, not a certificate")
        file = content if isinstance(content, PlanFile) else None
        plan = content.plan if isinstance(content, PlanFile) else content
        problem = scene_of_plan(self.scene, self.problem, plan)
        if file is not None and not any_scene:
            _require_made_for(problem, file, path, any_objective)
        verdict = check(problem, plan)
        if verdict.violations:
            if file is not None:  # it probably belongs to another scene
                _require_made_for(problem, file, path)
            raise FileError(f"{path}: {verdict.violations[0]}")
        return GivenPlan(problem, plan, file)

    def plans(self, paths: Sequence[Path], any_objective: bool = False) -> list[GivenPlan]:
        """Reads plans that can be flown, all of which must be for the same variant of the scene."""
        found = [self.plan(path, any_objective=any_objective) for path in paths]
        variants = [problem_digest(given.problem) for given in found]
        for path, variant in zip(paths, variants, strict=True):
            if variant != variants[0]:
                raise FileError(
                    f"{path}: is for other starts than {paths[0]}; `export` writes the scene with "
                    "either (--option start-set=yaml or seed) to plan on"
                )
        return found


def _require_made_for(
    problem: Problem, file: PlanFile, path: Path, any_objective: bool = False
) -> None:
    """Raises FileError if a plan was made for another scene; if only the name differs, this is
    logged.

    A different objective is logged, too, if it is allowed.
    """
    name, other = shortened(printable(problem.name)), shortened(printable(file.scene))
    if file.digest != problem_digest(problem):
        if any_objective and file.digest_without_objective == digest_without_objective(problem):
            log.warning("%s: was made for another objective; J is that of this scene", path)
            return
        alike = file.scene == problem.name
        field, since = ("digest", ", or its file has changed since") if alike else ("scene", "")
        raise FileError(
            f"{path}: {field}: the plan was made for {other_scene(file.scene, problem.name)}{since}"
            f"; {OTHERWISE}"
        )
    if file.scene != problem.name:
        log.warning("%s: was made for %s, which is the same scene as %s", path, other, name)
