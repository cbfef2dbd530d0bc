"""HTML pages put together from the files in the folder `page`."""

from collections.abc import Mapping
from importlib.resources import files


def part(name: str) -> str:
    """Returns the text of a file."""
    return (files("cocap_opt.experiments.report") / "page" / name).read_text(encoding="utf-8")


def filled(name: str, parts: Mapping[str, str]) -> str:
    """Returns the text of a file in which parts have taken the places of their @names@.

    A part may hold anything, @ included.
    """
    return "".join(parts.get(piece, piece) for piece in part(name).split("@"))
