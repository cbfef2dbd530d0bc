"""Pages made of the files in the folder `page`."""

from collections.abc import Mapping
from importlib.resources import files


def part(name: str) -> str:
    """Text of a file."""
    return (files("cocap_opt.experiments.report") / "page" / name).read_text(encoding="utf-8")


def filled(name: str, parts: Mapping[str, str]) -> str:
    """Text of a file in which @names@ stand for parts; what is in a part stays as it is."""
    return "".join(parts.get(piece, piece) for piece in part(name).split("@"))
