"""Maps of where drones may start, as pictures and as a page on which starts are chosen."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cocap_opt.cli.commands import run
from cocap_opt.data import FloatArray
from cocap_opt.pictures.start_map import ABOVE, BLOCKED, CLOSED, FREE, PEOPLE, levels
from cocap_opt.player.start_page import start_data, start_page
from cocap_opt.scenarios import Site, load_site

MAP = """
name = "</script><b>street"
steps = 2
[map]
file = "town.asc"
[[walk]]
points = [[2.5, 2.5], [4.5, 2.5]]
name = "Ada"
speed = 1.0
[[no_fly]]
polygon = [[8, 0], [10, 0], [10, 3], [8, 3]]
top = 6.0
[airspace]
people = 1.2
"""
BLOCKED_STARTS = """
[[drones]]
starts = [{ x = 6.5, y = 1.5, height = 4 }, { x = 0.5, y = 4.5, heading = 90 }]
motion = { layers = [4, 9], clearance = 0.5 }
"""


def town(folder: Path, heights: FloatArray) -> None:
    """The file of a map of cells of 1 m."""
    rows = "\n".join(" ".join(f"{v:g}" for v in row) for row in heights.T[::-1])
    width, depth = heights.shape
    head = f"ncols {width}\nnrows {depth}\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    (folder / "town.asc").write_text(head + rows + "\n")


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    """A recipe without drones: a house, a low wall, a zone and a person on 10 x 6 cells."""
    heights = np.zeros((10, 6))
    heights[6, :3], heights[5, 5] = 7.0, 2.0
    town(tmp_path, heights)
    path = tmp_path / "scene.toml"
    path.write_text(MAP)
    return path


def site_of(path: Path) -> Site:
    """The site of a recipe."""
    found = load_site(str(path))
    assert found is not None
    return found


def data_of(page: str) -> Any:
    """The data in a page."""
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found is not None
    return json.loads(found[1])


def test_cells_are_told_apart(recipe: Path) -> None:
    """Free, over a wall, near a person, in a zone, in a house: each by itself."""
    recipe.write_text(MAP + BLOCKED_STARTS)
    low, high = levels(site_of(recipe))
    assert (low.height, high.height) == (4.0, 9.0)
    kinds = {(x, y): int(low.kinds[x, y]) for x in range(10) for y in range(6)}
    for (x, y), kind in kinds.items():
        near = np.hypot(x + 0.5 - 2.5, y + 0.5 - 2.5) < 1.2
        expected = (
            BLOCKED if x == 6 and y < 3 else CLOSED if x >= 8 and y < 3
            else PEOPLE if near else ABOVE if (x, y) == (5, 5) else FREE
        )  # fmt: skip
        assert kind == expected, (x, y)
    assert (high.kinds[6, 0], high.kinds[9, 0], high.kinds[2, 2]) == (ABOVE, FREE, PEOPLE)


def test_a_recipe_without_drones_is_drawn(
    recipe: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a picture and as a page; all other commands say what is missing."""
    for name in ("site.png", "site.svg", "site.html"):
        assert run(["show", str(recipe), "-o", str(tmp_path / name)]) == 0
    with Image.open(tmp_path / "site.png") as image:
        assert image.size[0] == 1404
    page = (tmp_path / "site.html").read_text()
    assert page.count("</script>") == 2 and "<b>street" not in page
    data = data_of(page)
    assert [level["height"] for level in data["levels"]] == [5.0]
    assert (data["cells"], data["starts"], data["people"][0]["called"]) == ([10, 6], [], "Ada")
    capsys.readouterr()
    assert run(["plan", str(recipe)]) == 2
    words = "drones: must have a table [[drones]]; `cocap-opt show` draws the map without any"
    assert words in capsys.readouterr().err


def test_refused_starts_are_drawn_and_said(
    recipe: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The page has the reason and the nearest free place, which the line has, too."""
    recipe.write_text(MAP + BLOCKED_STARTS)
    page = tmp_path / "site.html"
    assert run(["show", str(recipe), "-o", str(page), "--json"]) == 0
    out = capsys.readouterr().out
    words = (
        "drones[0].starts[0]: cell (6, 1) is blocked: height 7 m, flight height 4 m; the nearest "
        "free place, 1 m away, is x = 5.5, y = 1.5, cell (5, 1); here it is free at 9 m"
    )
    assert words in caplog.text
    assert json.loads(out)["refused"] == 1
    refused, free = data_of(page.read_text())["starts"]
    assert (refused["why"], refused["free"], refused["at"]) == (
        words.partition(": ")[2], [5.5, 1.5], [6.5, 1.5],
    )  # fmt: skip
    assert (free["why"], free["free"], free["heading"]) == (None, None, 90.0)
    assert run(["plan", str(recipe)]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("takes", [False, True])
def test_people_in_a_house_are_said_before_drones_have_places(
    recipe: Path, takes: bool, caplog: pytest.LogCaptureFixture
) -> None:
    """In the words in which they are said of the scene, without drones and with refused starts."""
    walks = MAP + '[[walk]]\npoints = [[6.5, 4.5], [6.5, 0.5]]\nname = "Bo"\n'
    if takes:
        for name in ("late", "early"):
            walks += f'[[take]]\nname = "{name}"\nprobability = 0.5\n'
    said = []
    for drones in ("", BLOCKED_STARTS, BLOCKED_STARTS.replace("x = 6.5", "x = 5.5")):
        recipe.write_text(walks + drones)
        caplog.clear()
        assert run(["show", str(recipe), "-o", str(recipe.with_suffix(".png"))]) == 0
        lines = [record.getMessage().partition(": ")[2] for record in caplog.records]
        said.append([line for line in lines if line.startswith("Bo (")])
    assert "is inside an obstacle at" in said[0][0]
    assert said[0] == said[1] == said[2]


def test_tables_without_room_are_said(recipe: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Drones off the map, too many of them, and areas that are all closed, are drawn without."""
    out = str(recipe.with_suffix(".png"))
    for starts, words in (
        (
            "starts = [{ x = 90, y = 4 }]",
            "drones[0].starts[0]: must lie on the map, x 0..10 and y",
        ),
        ("count = 99", "drones[0].count: must be at most"),
        (
            "count = 1\nstarts = { area = [[8, 0], [10, 0], [10, 2]] }",
            "starts: must have a cell in",
        ),
    ):
        recipe.write_text(f"{MAP}[[drones]]\n{starts}\n[drones.motion]\nlayers = [4]\n")
        assert run(["show", str(recipe), "-o", out]) == 0
        assert words in caplog.text, starts
        assert run(["plan", str(recipe)]) == 2


def test_heights_are_asked_for(recipe: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Also where all starts are free, as otherwise drones at their starts are shown."""
    recipe.write_text(MAP + BLOCKED_STARTS.replace("x = 6.5", "x = 5.5"))
    page = recipe.with_suffix(".html")
    assert run(["show", str(recipe), "-o", str(page)]) == 0
    assert "where drones may start" not in page.read_text()
    assert run(["show", str(recipe), "--heights", "8,4,8", "-o", str(page)]) == 0
    data = data_of(page.read_text())
    assert [level["height"] for level in data["levels"]] == [4.0, 8.0]
    assert [start["why"] for start in data["starts"]] == [None, None]
    capsys.readouterr()
    for words, message in (
        (["--heights", "high"], "--heights: must be numbers such as 4,6, not 'high'"),
        (["--heights", "inf"], "--heights: must be within"),
    ):
        assert run(["show", str(recipe), *words, "-o", str(page)]) == 2
        assert message in capsys.readouterr().err
    assert run(["show", "corridor", "--heights", "4", "-o", str(page)]) == 2
    assert "--heights: requires a recipe" in capsys.readouterr().err


def test_the_data_of_a_site_is_what_is_drawn(recipe: Path) -> None:
    """Cells column by column; heights above the ground; what chosen starts must keep."""
    site = site_of(recipe)
    data = start_data(site, levels(site, (4.0,)))
    kinds = np.array([int(digit) for digit in data["levels"][0]["kinds"]]).reshape(10, 6)
    np.testing.assert_array_equal(kinds, levels(site, (4.0,))[0].kinds)
    assert data["above"][6 * 6 + 1] == 7.0
    assert (data["separation"], data["headings"]) == (2.0, 8)
    assert start_page(site).startswith("<!doctype html>")
