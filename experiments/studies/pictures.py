"""The player in a browser without a window, for its picture in the README and for its tests.

It needs Chromium and its driver from the system's packages, and selenium.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.wait import WebDriverWait

from cocap_opt.experiments.report.player import Player
from cocap_opt.planners import PLANNERS
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never

PLAYER_IS_READY = "document.documentElement.dataset.ready === 'yes'"
_SCENE, _STEP = "bottleneck", 6  # of the picture
_PLANNERS = ("greedy", "cocap")  # a plan with conflicts beside one without
_SIZE = 1280, 800  # px
_PATIENCE = 30.0  # s
_OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--no-first-run", "--hide-scrollbars",
    "--host-resolver-rules=MAP * ~NOTFOUND",  # no network
)  # fmt: skip


class _Programs(NamedTuple):
    browser: str
    driver: str


def write_pictures(folder: Path) -> None:
    """Writes player.html, which plays two plans of the bottleneck, and its picture player.png.

    Raises
    ------
    FileNotFoundError
        If there is no browser, or no driver.
    """
    problem = load_scene(_SCENE, 0)
    plans = {f"{name}.json": PLANNERS[name](problem, never).plan for name in _PLANNERS}
    page = folder / "player.html"
    shown = [(name, plan) for name, plan in plans.items() if plan is not None]
    Player(problem, shown).save(page)
    with opened(page) as driver:
        go_to(driver, _STEP)
        driver.save_screenshot(str(folder / "player.png"))


def has_browser() -> bool:
    """Returns True if the browser and its driver are installed."""
    return _programs() is not None


def _programs() -> _Programs | None:
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    return _Programs(browser, driver) if browser and driver else None


@contextmanager
def opened(
    page: Path, size: tuple[int, int] = _SIZE, ready: str = PLAYER_IS_READY
) -> Iterator[webdriver.Chrome]:
    """Opens a page in a browser of its own that cannot reach any network.

    Parameters
    ----------
    size : px
    ready : an expression that is true in the page once it is loaded

    Raises
    ------
    FileNotFoundError
        If there is no browser, or no driver.
    """
    found = _programs()
    if found is None:
        raise FileNotFoundError("chromium and chromedriver must be installed")
    options = webdriver.ChromeOptions()
    options.binary_location = found.browser
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        for option in (*_OPTIONS, f"--user-data-dir={profile}"):
            options.add_argument(option)
        driver = webdriver.Chrome(options=options, service=Service(found.driver))
        try:
            resize(driver, size)
            driver.get(page.absolute().as_uri())
            WebDriverWait(driver, _PATIENCE).until(lambda d: d.execute_script(f"return {ready}"))
            yield driver
        finally:
            driver.quit()


def resize(driver: webdriver.Chrome, size: tuple[int, int]) -> None:
    """Gives the page a size (px)."""
    width, height = size
    screen = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)


def go_to(driver: webdriver.Chrome, step: int) -> None:
    """Puts the slider to a step, and waits until the page has drawn it."""
    slide = (
        "const [step, done] = arguments, slider = document.getElementById('slider');"
        "slider.value = step; slider.dispatchEvent(new Event('input'));"
        "setTimeout(() => requestAnimationFrame(() => requestAnimationFrame(() => done())), 300);"
    )
    driver.execute_async_script(slide, step)
