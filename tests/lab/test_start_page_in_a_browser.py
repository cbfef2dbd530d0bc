"""The page on which starts are chosen, in a browser: what is pressed stands there as a recipe."""

from pathlib import Path
from typing import Any

import pytest
from browser import value

from cocap_opt.cli.commands import run
from cocap_opt.experiments.lab.studies.pictures import Browser
from cocap_opt.problem import State
from cocap_opt.scenarios.recipe import read

MAP = """
steps = 2
[map]
size = [20, 12]
origin = [505000, 4790000]
[[no_fly]]
polygon = [[505000, 4790000], [505004, 4790000], [505004, 4790004]]
"""
DRONES = "[[drones]]\nmotion = { layers = [4, 7] }\n"


def press(page: Any, x: float, y: float) -> None:
    """Press on a place of the map (m from its corner)."""
    value(
        page,
        f"""(() => {{
          const view = document.getElementById("view"), box = view.getBoundingClientRect();
          const [px, py] = $starts.screen([505000 + {x}, 4790000 + {y}]);
          view.dispatchEvent(new MouseEvent("click", {{
            clientX: box.left + px, clientY: box.top + py, bubbles: true }}));
        }})()""",
    )


@pytest.mark.slow(seconds=9)
def test_starts_that_are_pressed_are_read(tmp_path: Path) -> None:
    """A press on a free cell adds a drone at the height that is shown, another turns it."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    path, page = tmp_path / "scene.toml", tmp_path / "starts.html"
    path.write_text(MAP + DRONES + "starts = [{ x = 505003.5, y = 4790001.5 }]\n")
    assert run(["show", str(path), "-o", str(page)]) == 0
    with Browser.opened(page, ready="document.readyState === 'complete'") as driver:
        proposed = value(driver, "document.getElementById('toml').textContent")
        assert value(driver, "document.querySelectorAll('#refused li').length") == 1
        press(driver, 10.4, 6.6)
        press(driver, 10.6, 6.4)
        press(driver, 3.5, 1.5)  # closed
        value(driver, "document.querySelectorAll('#heights button')[1].click()")
        press(driver, 15.5, 2.5)
        chosen = value(driver, "document.getElementById('toml').textContent")
        assert value(driver, "document.querySelectorAll('#chosen tr').length") == 3
        assert value(driver, "document.querySelectorAll('#chosen .near').length") == 0
        width = value(driver, "document.documentElement.scrollWidth - window.innerWidth")
        assert width <= 0  # nothing is cut off at the side
    path.write_text(MAP + DRONES + proposed)
    (first,) = (robot.start for robot in read(path).robots)
    assert first in (State(4, 1), State(2, 1), State(3, 0), State(3, 2))
    path.write_text(MAP + DRONES + chosen)
    assert [robot.start for robot in read(path).robots] == [
        first, State(10, 6, 0, 1), State(15, 2, 1, 0),
    ]  # fmt: skip
