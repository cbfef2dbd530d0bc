"""Charts of stored results, as the pages show them; each names the results that it was drawn from.

A PNG file holds the digest of its results in a field of text, so that a test can tell when results
have changed since.
"""

import hashlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from matplotlib.figure import Figure
from PIL import Image, PngImagePlugin

from cocap_opt.experiments.report.charts import gaps_figure
from cocap_opt.experiments.report.figures import picture
from cocap_opt.experiments.results.files import save_bytes
from cocap_opt.experiments.studies.flight.figure import flight_figure
from cocap_opt.experiments.studies.flight.runs import Run as FlightRun
from cocap_opt.experiments.studies.paper.measured import STORED, read_rows
from cocap_opt.experiments.studies.separation.figure import separation_figure
from cocap_opt.experiments.studies.separation.points import Point

_SCENES = ("corridor", "bottleneck")
_PLANNERS = ("greedy", "sequential", "cocap", "cocap-vs", "cocap-lns")
_SOURCE = "Source"  # of PNG's fields of text


class _Drawing(NamedTuple):
    """A chart, and the stored file that it shows."""

    results: str
    draw: Callable[[Path], Figure]

    @property
    def source(self) -> str:
        """The name of the results and their digest."""
        digest = hashlib.sha256((STORED / self.results).read_bytes()).hexdigest()
        return f"{self.results} {digest}"


def _gaps(path: Path) -> Figure:
    rows = read_rows(path)
    return gaps_figure([r for r in rows if r.scene in _SCENES and r.planner in _PLANNERS])


DRAWINGS = {
    "gaps.png": _Drawing("paper.csv", _gaps),
    "separation.png": _Drawing("separation.csv", lambda p: separation_figure(Point.read(p))),
    "flight.png": _Drawing("flight.csv", lambda path: flight_figure(FlightRun.read(path))),
}


def write_drawings(folder: Path) -> None:
    """Draws all charts into a folder."""
    for name, drawing in DRAWINGS.items():
        content = picture(drawing.draw(STORED / drawing.results), ".png")
        save_bytes(folder / name, _with_source(content, drawing.source))


def source_of(path: Path) -> str:
    """Returns the results that a picture says it was drawn from; empty if it says nothing."""
    with Image.open(path) as image:
        return str(image.info.get(_SOURCE, ""))


def _with_source(content: bytes, source: str) -> bytes:
    told, out = PngImagePlugin.PngInfo(), BytesIO()
    told.add_text(_SOURCE, source)
    Image.open(BytesIO(content)).save(out, "png", pnginfo=told, optimize=True)
    return out.getvalue()
