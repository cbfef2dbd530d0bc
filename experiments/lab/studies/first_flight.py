"""The pictures of the tutorial on the first flight, and the animated one of the README.

The study runs the tutorial's own commands, and takes pictures of the files that they write: with
the browser, with PDFium, and with MAVProxy's reader of missions. Each picture contains a digest of
what it is made from, so that a test notices if it is out of date.
"""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from cocap_opt.experiments.lab.studies.mission_map import mission_map
from cocap_opt.experiments.lab.studies.stamped import made_from, stamped
from cocap_opt.output.files import save_bytes
from cocap_opt.scenarios import load_scene

if TYPE_CHECKING:
    from cocap_opt.experiments.lab.studies.pictures import Browser

PAGE = Path(__file__).resolve().parents[3] / "docs" / "tutorials" / "first-flight.md"
FILM = "player.webp"
STILLS = tuple(
    f"first-flight-{name}.png" for name in ("scene", "steps", "player", "strip", "sheet", "mission")
)

_STEP = 4  # step of the still; the film starts at it, too
_WIDE, _NARROW = (960, 800), (560, 870)  # px, size of the page for the stills and for the film
_SCALE = 1.4  # px of a picture for each px of its page
_EVERY, _PACE, _QUALITY = 0.5, 300, 70  # steps and ms between images of the film; WebP quality
_SHEET_SCALE = 1.5  # px of a picture for each point of the sheet
_PROGRAM = "import sys; from cocap_opt.cli.main import main; sys.exit(main())"
_STRIP, _PICTURE = ".filmed", "canvas.view"


def write_first_flight(folder: Path) -> Iterator[Path]:
    """Writes all of these pictures into a folder, and yields their paths.

    Raises
    ------
    FileNotFoundError
        If there is no browser, or no driver.
    """
    with TemporaryDirectory() as made:
        shoot = Path(made)
        for words in _commands():
            subprocess.run(
                [sys.executable, "-c", _PROGRAM, *words], cwd=shoot, check=True,
                stdout=subprocess.DEVNULL,
            )  # fmt: skip
        for name, still in zip(STILLS, _stills(shoot), strict=True):
            save_bytes(folder / name, stamped(still, digest()))
            yield folder / name
        save_bytes(folder / FILM, _film(shoot / "flight.html"))
        yield folder / FILM


def digest() -> str:
    """Returns a digest of the tutorial's commands, and of all code that draws their results."""
    return made_from(str(list(_commands())))


def _commands() -> Iterator[list[str]]:
    """Yields the words of each command of the tutorial, without the program's name."""
    for block in re.findall(r"(?ms)^```sh\n(.*?)^```$", PAGE.read_text(encoding="utf-8")):
        for line in block.replace("\\\n", " ").splitlines():
            yield shlex.split(line)[1:]


def _stills(shoot: Path) -> Iterator[Image.Image]:
    """Yields the stills in the order of their names."""
    for name in ("scene.png", "steps.png"):
        yield Image.open(shoot / name)
    from cocap_opt.experiments.lab.studies.pictures import Browser  # of the extra `test`

    with Browser.opened(shoot / "flight.html", _WIDE, scale=_SCALE) as browser:
        browser.go_to(_STEP)
        yield Image.open(BytesIO(browser.get_screenshot_as_png()))
        yield _shot(browser, _STRIP)
    yield _first_page(shoot / "sheet.pdf")
    missions = sorted(shoot.glob("mission.*.waypoints"))
    yield Image.open(BytesIO(mission_map(load_scene("delft"), missions)))


def _first_page(sheet: Path) -> Image.Image:
    import pypdfium2  # of the extra `test`

    document = pypdfium2.PdfDocument(sheet)
    try:
        image: Image.Image = document[0].render(scale=_SHEET_SCALE).to_pil()
        return image
    finally:
        document.close()


def _film(page: Path) -> bytes:
    """Returns an animation of the flight, which starts at the still's step and wraps around."""
    from cocap_opt.experiments.lab.studies.pictures import Browser  # as above

    frames = []
    with Browser.opened(page, _NARROW, scale=_SCALE) as browser:
        last = float(browser.find_element("id", "slider").get_attribute("max") or 0)
        times = np.roll(np.arange(0, last + _EVERY / 2, _EVERY), -round(_STEP / _EVERY))
        for time in times.tolist():
            browser.go_to(time)
            frames.append(_shot(browser, _PICTURE))
    content = BytesIO()
    frames[0].save(
        content, "webp", save_all=True, append_images=frames[1:], duration=_PACE, loop=0,
        quality=_QUALITY, method=6, xmp=digest().encode(),
    )  # fmt: skip
    return content.getvalue()


def _shot(browser: "Browser", part: str) -> Image.Image:
    """Returns a picture of a part of the page, by its CSS selector."""
    found = browser.find_element("css selector", part)
    return Image.open(BytesIO(found.screenshot_as_png)).convert("RGB")
