"""Reader of the project's own scene files, in the contract of all formats."""

from pathlib import Path

from cocap_opt.files.documents import SceneFile
from cocap_opt.problem import Problem


def read(path: Path, seed: int = 0) -> Problem:
    """Reads a scene that `SceneFile.save` wrote; it has no seed.

    Raises
    ------
    FileError
        If the file cannot be used; one line, naming the file.
    """
    return SceneFile.read(path).problem
