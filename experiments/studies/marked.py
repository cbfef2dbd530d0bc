"""Parts of documents that are made from numbers, between two marks."""

from pathlib import Path

from cocap_opt.experiments.results.files import read_text, save_bytes
from cocap_opt.files.documents import FileError


def write_between(document: Path, begin: str, end: str, text: str) -> None:
    """Replaces what stands in a document between two marks."""
    before, first, rest = read_text(document).partition(begin)
    _, last, after = rest.partition(end)
    if not (first and last):
        raise FileError(f"{document}: must hold the lines {begin} and {end}")
    save_bytes(document, f"{before}{begin}\n\n{text}\n{end}{after}".encode())
