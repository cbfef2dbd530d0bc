"""Public functions for files: load scenes of any format; read and save what this project writes."""

from pathlib import Path
from typing import TypeVar, overload

import msgspec

from cocap_opt.api.arguments import (
    Bound,
    plan_for,
    require,
    require_flown,
    require_path,
    require_whole,
)
from cocap_opt.files.documents import (
    Document,
    FileError,
    PlanFile,
    SceneFile,
    decode_document,
    read_bytes,
)
from cocap_opt.formulations.certificates.format import CertificateFile, ProofFile
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check as judge_plan
from cocap_opt.result import Result
from cocap_opt.run.judged import finite
from cocap_opt.scenarios import load_scene

T = TypeVar("T", Problem, Plan, CertificateFile, ProofFile)

_ELSEWHERE = {  # kinds of files, by their ending, that other functions read
    ".toml": "is a recipe; `load` reads it",
    ".sol": "is a solver's solution; `plan_of_solution` of "
    "`cocap_opt.formulations.model_files.solutions` makes a plan of its text",
}


def load(scene: str | Path, seed: int = 0, **options: str) -> Problem:
    """Load a built-in scene by its name, or a scene file in any supported format.

    Parameters
    ----------
    scene : a name, such as "bottleneck" (`SCENES` has them all), or a file
    seed : >= 0; selects start positions and walks of a built-in scene; ignored by `tiny-*`; its
        meaning for a file depends on the format
    options : conventions of the file's format, such as ``triangles="no"``; a hyphen in the name of
        an option is an underscore here, as in ``start_set="yaml"``

    Returns
    -------
    Problem
        Checked and immutable; its coverage is computed when it is first needed.

    Raises
    ------
    FileError
        If there is no such scene or option, or the file cannot be used; a one-line message says
        why.

    Examples
    --------
    >>> problem = co.load("bottleneck", seed=3)
    """
    words = {name.replace("_", "-"): word for name, word in options.items()}
    require(scene, "scene", "a name or a file", str, Path)
    require_whole(seed, "seed")
    return load_scene(str(scene), int(seed), words)


def save(
    path: str | Path,
    content: Problem | Plan | Result | Bound | None,
    problem: Problem | None = None,
) -> None:
    """Write a problem, a plan, a certificate or a proof to a file, completely or not at all.

    Parameters
    ----------
    path : the file, named .json; an existing one is replaced
    content : the object to write; of a result, its plan
    problem : the problem that a plan is for; not needed for a result, which knows it

    Raises
    ------
    FileError
        If the file cannot be written.
    ValueError
        If a plan comes without its problem, is for another problem or cannot be flown in this one;
        if a result has no plan; if `content` is None, as a missing certificate; or if the name has
        another ending.

    Examples
    --------
    >>> co.save("plan.json", result)
    >>> co.save("certificate.json", best.certificate)
    """
    file = require_path(path, "path")
    if content is None:
        raise ValueError("content: must not be None; the result has no plan or certificate")
    words = "a problem, a plan, a result, a certificate or a proof"
    require(content, "content", words, Problem, Plan, Result, CertificateFile, ProofFile)
    if isinstance(content, Result):
        problem = content.problem if problem is None else problem
    document = (
        SceneFile.of(content) if isinstance(content, Problem)
        else content if isinstance(content, CertificateFile | ProofFile)
        else _plan_file(content, problem)
    )  # fmt: skip
    document.save(_named_json(file))


def _named_json(path: Path) -> Path:
    """Returns the path; refuses names that promise another kind of file than is written."""
    if path.suffix.lower() != ".json":
        words = "must end in .json, as the file is JSON"
        raise ValueError(f"path: {words}, not {path.name!r}")
    return path


@overload
def read(path: str | Path) -> Problem | Plan | Bound: ...


@overload
def read(path: str | Path, kind: type[T]) -> T: ...


def read(path: str | Path, kind: type | None = None) -> Problem | Plan | Bound:
    """Read a file that this project has written: a scene, a plan, a certificate or a proof.

    Parameters
    ----------
    path : the file; `load` reads scenes in other formats
    kind : the type that the content must have: `Problem`, `Plan`, `CertificateFile` or `ProofFile`;
        type checkers then know it, too

    Returns
    -------
    Problem, Plan, CertificateFile or ProofFile
        The content of the file. A plan knows which problem it was made for (`Plan.made_for`), and
        is refused for any other.

    Raises
    ------
    FileError
        If the file holds none of these, or something other than `kind`, or is damaged; a one-line
        message says what is wrong.
    TypeError
        If `kind` is none of the four.

    Examples
    --------
    >>> plan = co.read("plan.json", co.Plan)
    >>> co.check(problem, plan).reward
    """
    name, kinds = require_path(path, "path"), list(_DOCUMENTS.values())
    if kind is not None:
        if not isinstance(kind, type) or kind not in _DOCUMENTS:
            words = ", ".join(known.__name__ for known in _DOCUMENTS)
            raise TypeError(f"kind: must be one of {words}, not {kind!r}")
        kinds = [_DOCUMENTS[kind]]
    if name.suffix.lower() in _ELSEWHERE:
        raise FileError(f"{name}: {_ELSEWHERE[name.suffix.lower()]}")
    found = decode_document(read_bytes(name), str(name), *kinds)
    if isinstance(found, SceneFile):
        return found.problem
    if isinstance(found, PlanFile):
        return found.plan.of_problem(found.digest, found.scene, found.ending)
    assert isinstance(found, CertificateFile | ProofFile)
    return found


# Types that `read` returns, and the documents that contain them.
_DOCUMENTS: dict[type, type[Document]] = {
    Problem: SceneFile, Plan: PlanFile, CertificateFile: CertificateFile, ProofFile: ProofFile
}  # fmt: skip


def _plan_file(content: Plan | Result, problem: Problem | None) -> PlanFile:
    if problem is None:
        raise ValueError("problem: must be given: the problem that the plan is for")
    flown = plan_for(problem, content, "written", "content")
    verdict = judge_plan(problem, flown)
    require_flown("plan", verdict)
    file = PlanFile.of(problem, flown, verdict.reward, planner="", cut_short=content.cut_short)
    if not isinstance(content, Result):
        return file
    return msgspec.structs.replace(
        file, planner=content.method, limit=content.limit, reason=content.reason,
        seconds=finite(content.seconds),
    )  # fmt: skip
