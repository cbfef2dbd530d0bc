"""Everything on the pages that is generated: text between marks, pictures, and schemas of files.

The pages are committed with it, so that they are complete wherever they are read.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import count
from pathlib import Path

import matplotlib as mpl

from cocap_opt.experiments.lab.manual.diagrams import DIAGRAMS
from cocap_opt.experiments.lab.manual.formats import schemas
from cocap_opt.experiments.lab.manual.marks import filled
from cocap_opt.experiments.lab.studies.drawings import DRAWINGS
from cocap_opt.experiments.lab.studies.first_flight import FILM, STILLS
from cocap_opt.files.documents import FileError
from cocap_opt.output.files import make_folder, read_text, save_bytes
from cocap_opt.pictures.figures import picture

ROOT = Path(__file__).resolve().parents[3]
DOCS = ROOT / "docs"
PICTURES = DOCS / "pictures"
SCHEMAS = DOCS / "reference" / "schemas"
_OTHERS = ("README.md", "formulations/certificates/coq/README.md")  # pages outside of docs
_DATED = re.compile(rb"\s*<metadata>.*?</metadata>", re.DOTALL)
_HASHED = re.compile(rb"\b([a-z])[0-9a-f]{10}\b")
_PLACES = re.compile(
    rb'\b(?:d|x|y|points|width|height|viewBox)="[^"]*"|\b(?:translate|rotate)\([^)]*\)'
)  # not scales, which need more digits: the scale of letters is 1/64
_DECIMAL = re.compile(rb"-?\d+(?:\.\d+)?")


def _diagram(name: str) -> bytes:
    return picture(DIAGRAMS[name](), ".svg")


# The functions that draw, each by the name of its file.
DRAWN: Mapping[str, Callable[[], bytes]] = {
    **DRAWINGS,
    **{f"{name}.svg": partial(_diagram, name) for name in DIAGRAMS},
}
# Taken with a browser and PDFium, whose releases draw differently, so no test compares pixels.
PHOTOGRAPHED = ("player.png", FILM, *STILLS)


def pages() -> list[Path]:
    """Returns all Markdown files that may have marks."""
    return [*(ROOT / name for name in _OTHERS), *sorted(DOCS.rglob("*.md"))]


def rewritten(page: Path, entry: Callable[[str], str]) -> str:
    """Returns a page as it should be.

    Raises
    ------
    FileError
        If a mark is wrong; the message begins with the name of the page.
    """
    try:
        return filled(read_text(page), entry)
    except FileError as error:
        raise FileError(f"{page.relative_to(ROOT)}: {error}") from error


def write_text(entry: Callable[[str], str]) -> Iterator[Path]:
    """Writes text between marks on all pages, and schemas; yields the files that changed."""
    files = {page: rewritten(page, entry) for page in pages()}
    files |= {SCHEMAS / name: text for name, text in schemas().items()}
    make_folder(SCHEMAS)
    for path, text in files.items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            save_bytes(path, text.encode())
            yield path


def write_pictures() -> Iterator[Path]:
    """Draws all pictures; yields the files that changed.

    Raises
    ------
    FileError
        If the folder has a file that is not drawn here, as it may be somebody's work.
    """
    make_folder(PICTURES)
    listed = {*DRAWN, *PHOTOGRAPHED}
    if others := sorted(path.name for path in PICTURES.iterdir() if path.name not in listed):
        raise FileError(
            f"{PICTURES}: {', '.join(others)}: unlisted; delete it, or add it to DRAWN or "
            f"PHOTOGRAPHED of {__name__}"
        )
    for name in DRAWN:
        path, content = PICTURES / name, drawn(name)
        if not path.exists() or path.read_bytes() != content:
            save_bytes(path, content)
            yield path


def drawn(name: str) -> bytes:
    """Returns a picture as it is committed: an SVG without dates and with short numbers."""
    with mpl.rc_context({"svg.hashsalt": "cocap-opt"}):
        content = DRAWN[name]()
    return _settled(content) if name.endswith(".svg") else content


def _settled(svg: bytes) -> bytes:
    """Returns an SVG that is the same each time it is drawn, with positions to 0.01 points.

    Numbers replace its identifiers, which are digests of all digits and differ between processors.
    """
    numbers = count(1)
    known: dict[bytes, bytes] = {}

    def numbered(found: re.Match[bytes]) -> bytes:
        if found[0] not in known:
            known[found[0]] = found[1] + str(next(numbers)).encode()
        return known[found[0]]

    text = _HASHED.sub(numbered, _DATED.sub(b"", svg))
    return _PLACES.sub(lambda found: _DECIMAL.sub(_rounded, found[0]), text)


def _rounded(number: re.Match[bytes]) -> bytes:
    """Returns a number with at most two decimals, without trailing zeros, and never -0."""
    return f"{round(float(number[0]), 2) + 0.0:.2f}".rstrip("0").rstrip(".").encode()
