"""Reader of the project's own scene files, in the contract of all formats.

It is handed all JSON that is not a scene of somebody else's, and says what that is.
"""

from pathlib import Path

import msgspec

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import SceneFile
from cocap_opt.problem import Problem
from cocap_opt.scenarios.kinds import JSON, WKT, kind_of_text
from cocap_opt.scenarios.text import naming, read_text


def read(path: Path, seed: int = 0) -> Problem:
    """Reads a scene that `SceneFile.save` wrote; it has no seed.

    Raises
    ------
    FileError, ProblemError
        If the file cannot be used; one line, naming the file.
    """
    with naming(path):
        _require_own(read_text(path, (JSON, WKT)))
    return SceneFile.read(path).problem


def _require_own(text: str) -> None:
    """Raises a ProblemError if a text is sound JSON, but no document of this project."""
    if kind := kind_of_text(text):
        raise ProblemError(f"is {kind.name}, which is not a scene: {kind.way_out}")
    try:
        content = msgspec.json.decode(text)
    except (msgspec.MsgspecError, RecursionError):
        return  # whoever reads it says where it is damaged
    if not isinstance(content, dict) or "format" not in content:
        raise ProblemError(
            "is JSON, but no scene: a scene of cocap-opt has the field format, as "
            "`cocap-opt export` writes it, and one of Hughes et al. the field actor_positions"
        )
