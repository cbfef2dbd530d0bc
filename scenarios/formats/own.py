"""Reader of the project's own scene files, with the interface of all formats.

It receives every JSON file that is not a scene of another program, and its errors say what the file
is instead.
"""

from pathlib import Path

import msgspec

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import SceneFile
from cocap_opt.problem import Problem
from cocap_opt.scenarios.kinds import JSON, WKT, kind_of_text
from cocap_opt.scenarios.text import naming, read_text


def read(path: Path, seed: int = 0) -> Problem:
    """Reads a scene that `SceneFile.save` wrote; the seed has no effect.

    Raises
    ------
    FileError, ProblemError
        If the file cannot be used; one line, naming the file.
    """
    with naming(path):
        _require_own(read_text(path, (JSON, WKT)))
    return SceneFile.read(path).problem


def _require_own(text: str) -> None:
    """Raises a ProblemError if a text is valid JSON but not a document of this project."""
    if kind := kind_of_text(text):
        raise ProblemError(f"is {kind.name}, which is not a scene: {kind.way_out}")
    try:
        content = msgspec.json.decode(text)
    except (msgspec.MsgspecError, RecursionError):
        return  # the reader of the scene reports where the text is damaged
    if not isinstance(content, dict) or "format" not in content:
        raise ProblemError(
            "is JSON, but not a scene: scenes of cocap-opt, which `cocap-opt export` writes, have "
            "the field format, and scenes of Hughes et al. the field actor_positions"
        )
