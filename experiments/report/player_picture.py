"""The player in a browser without a window: for its tests, and for its picture in the README.

`cocap-opt study player-picture DIR` writes the picture and the page that it shows. It
needs Chromium and its driver from the system's packages, and selenium.
"""

import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.wait import WebDriverWait

from cocap_opt.experiments.report.player import Titled, player_page
from cocap_opt.planners import PLANNERS
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never

SCENE, STEP = "bottleneck", 6
SIZE = 1280, 800  # px
PATIENCE = 30.0  # s
PLAYER = "document.documentElement.dataset.ready === 'yes'"
OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--no-first-run", "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no network
)  # fmt: skip


class Programs(NamedTuple):
    """Where the browser and its driver are."""

    browser: str
    driver: str


def programs() -> Programs | None:
    """The browser and its driver, or None where one is missing."""
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    return Programs(browser, driver) if browser and driver else None


@contextmanager
def opened(
    page: Path, size: tuple[int, int] = SIZE, ready: str = PLAYER
) -> Iterator[webdriver.Chrome]:
    """A page in a browser of its own that cannot reach any network.

    Parameters
    ----------
    ready : what is true in the page once it is there

    Raises
    ------
    FileNotFoundError
        If there is no browser, or no driver.
    """
    found = programs()
    if found is None:
        raise FileNotFoundError("chromium and chromedriver must be installed")
    options = webdriver.ChromeOptions()
    options.binary_location = found.browser
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for option in (*OPTIONS, f"--user-data-dir={profile}"):
            options.add_argument(option)
        driver = webdriver.Chrome(options=options, service=Service(found.driver))
        try:
            resize(driver, size)
            driver.get(page.absolute().as_uri())
            WebDriverWait(driver, PATIENCE).until(lambda d: d.execute_script(f"return {ready}"))
            yield driver
        finally:
            driver.quit()


def resize(driver: webdriver.Chrome, size: tuple[int, int]) -> None:
    """Give the page this size (px)."""
    width, height = size
    screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)


def go_to(driver: webdriver.Chrome, step: int) -> None:
    """Put the slider to a step, and wait until the page has drawn it."""
    slide = (
        "const [step, done] = arguments, slider = document.getElementById('slider');"
        "slider.value = step; slider.dispatchEvent(new Event('input'));"
        "setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(() => done())), 300);"
    )
    driver.execute_async_script(slide, step)


def example() -> str:
    """The page of which the README has a picture: a plan with conflicts beside one without."""
    problem = load_scene(SCENE, 0)
    plans: list[Titled] = []
    for name in ("greedy", "cocap"):
        plan = PLANNERS[name](problem, never).plan
        if plan is not None:
            plans.append((f"{name}.json", plan))
    return player_page(problem, plans)


def main(folder: Path) -> None:
    """Write player.html and player.png."""
    page = folder / "player.html"
    page.write_text(example(), encoding="utf-8")
    with opened(page) as driver:
        go_to(driver, STEP)
        driver.save_screenshot(str(folder / "player.png"))


if __name__ == "__main__":
    main(Path(*sys.argv[1:]))
