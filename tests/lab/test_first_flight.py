"""The tutorial on the first flight: its commands work, and its pictures are of what they make."""

from importlib.util import find_spec
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from pages import DOCS, blocks
from PIL import Image
from test_docs import Reader

from cocap_opt.experiments.lab.studies import pictures
from cocap_opt.experiments.lab.studies.first_flight import FILM, PAGE, STILLS, digest
from cocap_opt.experiments.lab.studies.pictures import Browser
from cocap_opt.experiments.lab.studies.stamped import stamp
from cocap_opt.player.player import Player
from cocap_opt.problem import LandCover, Problem
from cocap_opt.scenarios import load_scene

PICTURES = DOCS / "pictures"
FILM_BYTES = 500_000  # at most


@pytest.mark.long(seconds=60)
def test_the_first_flight_runs_as_it_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its blocks work one after the other, print what it shows, and leave a mission per drone."""
    pytest.importorskip("pyproj")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")  # the page's lines are not folded
    reader = Reader(capsys)
    for language, text in blocks(PAGE.read_text(encoding="utf-8")):
        if "pymavlink" not in text or find_spec("pymavlink"):  # which is no requirement of tests
            reader.follow(language, text)
    for name in ("scene.png", "steps.png", "flight.html", "sheet.pdf", "flight.kml"):
        assert Path(name).stat().st_size > 0
    assert len(list(Path().glob("mission.*.waypoints"))) == 5


@pytest.mark.parametrize("name", [*STILLS, FILM])
def test_pictures_are_made_of_what_there_is(name: str) -> None:
    """A picture has the digest of the place, of what draws it, and of the commands of the page."""
    assert stamp(PICTURES / name) == digest(), "python docs/write.py player"
    assert name == FILM or f"](../pictures/{name})" in PAGE.read_text(encoding="utf-8")


def test_the_picture_of_two_plans_is_of_the_player_as_it_is() -> None:
    """It is made with the others."""
    assert stamp(PICTURES / "player.png") == pictures.digest(), "python docs/write.py player"


def test_the_film_is_small_and_moves() -> None:
    """The README's picture loads quickly, and can be read on a telephone."""
    with Image.open(PICTURES / FILM) as film:
        assert film.n_frames > 15
        assert 640 <= film.width <= 900
    assert (PICTURES / FILM).stat().st_size < FILM_BYTES


def blue_share(problem: Problem, page: Path) -> float:
    """Share of the player's picture of a scene that is rather blue."""
    Player(problem).save(page)
    with Browser.opened(page) as browser:
        shot = browser.find_element("css selector", "canvas.view").screenshot_as_png
        assert browser.get_log("browser") == []
    red, _, blue = np.moveaxis(np.array(Image.open(BytesIO(shot)).convert("RGB"), dtype=int), 2, 0)
    return float((blue > red + 30).mean())


@pytest.mark.slow(seconds=8)
def test_the_player_draws_the_land(tmp_path: Path) -> None:
    """Water is blue on the ground of the page, and its name does no harm there."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    dry = load_scene("field")
    rim = np.array([[0.0, 0.0], [30.0, 0.0], [30.0, 30.0], [0.0, 30.0]])
    lake = LandCover(kind="water", outline=rim, name='<b>"lake"')
    before = blue_share(dry, tmp_path / "dry.html")
    after = blue_share(dry.replace(land_cover=(lake,)), tmp_path / "wet.html")
    assert before < 0.15 < after - 0.15
