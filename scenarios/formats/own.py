"""Reader of the project's own scene files, in the contract of all formats."""

from pathlib import Path

from cocap_opt.files.documents import load_problem
from cocap_opt.problem import Problem


def read(path: Path, seed: int = 0) -> Problem:
    """Reads a scene that `cocap_opt.files.documents.save_problem` wrote; it has no seed.

    Raises
    ------
    FileError
        If the file cannot be used; one line, naming the file.
    """
    return load_problem(path)
