"""The player in a browser without a window, for its pictures on the pages and for its tests.

It needs Chromium and its driver from the system's packages, and selenium.
"""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple, Self

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.wait import WebDriverWait

from cocap_opt.experiments.lab.studies.stamped import made_from, stamped
from cocap_opt.output.files import save_bytes
from cocap_opt.player.player import Player
from cocap_opt.problem import Problem
from cocap_opt.run.engine import run
from cocap_opt.run.explained import gaps_of
from cocap_opt.scenarios import load_scene

PLAYER_IS_READY = "document.documentElement.dataset.ready === 'yes'"
_SCENE, _STEP, _KEYS = "bottleneck", 6, "ddd"  # the picture; its keys pick drone 2
_PLANNERS = ("greedy", "cocap")  # a plan with conflicts beside one without
_SIZE = 1280, 800  # px
_PATIENCE = 30.0  # s
_OPTIONS = (
    "--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--no-first-run", "--hide-scrollbars", "--enable-unsafe-swiftshader",  # WebGL in software
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",  # no network
)  # fmt: skip


class _Programs(NamedTuple):
    browser: str
    driver: str


def digest() -> str:
    """Returns a digest of everything that player.png is made from."""
    return made_from(_SCENE, *_PLANNERS)


def write_pictures(folder: Path) -> list[Path]:
    """Writes player.png, of two plans of the bottleneck, and returns its path.

    Raises
    ------
    FileNotFoundError
        If there is no browser, or no driver.
    """
    still = folder / "player.png"
    with TemporaryDirectory() as made:
        page = Path(made) / "player.html"
        _player(load_scene(_SCENE, 0)).save(page)
        with Browser.opened(page) as browser:
            browser.go_to(_STEP)
            browser.press(_KEYS)
            browser.go_to(_STEP)
            shot = Image.open(BytesIO(browser.get_screenshot_as_png()))
    save_bytes(still, stamped(shot, digest()))
    return [still]


def _player(problem: Problem) -> Player:
    """Returns the player of two plans, with the certificate of a bound."""
    plans = {name: run(problem, name).result.plan for name in _PLANNERS}
    shown = {name: plan for name, plan in plans.items() if plan is not None}
    proof = run(problem, "column-generation").result.certificate
    assert proof is not None
    gaps = gaps_of(problem, list(shown.values()), proof)
    titled = [(f"{name}.json", plan) for name, plan in shown.items()]
    return Player(problem, titled, gaps, list(shown))


class Browser(webdriver.Chrome):
    """Chromium without a window, which cannot reach any network."""

    @staticmethod
    def is_installed() -> bool:
        """Returns True if the browser and its driver are installed."""
        return _programs() is not None

    @classmethod
    @contextmanager
    def opened(
        cls,
        page: Path | str,
        size: tuple[int, int] = _SIZE,
        ready: str = PLAYER_IS_READY,
        scale: float = 1.0,
    ) -> Iterator[Self]:
        """Opens a page in its own browser.

        Parameters
        ----------
        page : its file, or its address on this machine
        size : px
        ready : an expression that is true in the page once it is loaded
        scale : px of a screenshot for each px of the page

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
            browser = cls(options=options, service=Service(found.driver))
            try:
                browser.resize(size, scale)
                browser.get(page if isinstance(page, str) else page.absolute().as_uri())
                loaded = WebDriverWait(browser, _PATIENCE)
                loaded.until(lambda driver: driver.execute_script(f"return {ready}"))
                yield browser
            finally:
                browser.quit()

    def resize(self, size: tuple[int, int], scale: float = 1.0) -> None:
        """Sets the size of the page (px), and the px of a screenshot for each px of the page."""
        width, height = size
        screen = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
        self.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", screen)

    def press(self, keys: str) -> None:
        """Presses keys anywhere on the page."""
        self.find_element(By.TAG_NAME, "body").send_keys(keys)

    def go_to(self, step: float) -> None:
        """Moves the player's slider to a step, or between two, and waits until it is drawn."""
        slide = (
            "const [step, done] = arguments, slider = document.getElementById('slider');"
            "slider.step = 'any'; slider.value = step; slider.dispatchEvent(new Event('input'));"
            "slider.step = '1';"  # as keys need it
            "const drawn = () => requestAnimationFrame(() => requestAnimationFrame(() => done()));"
            "setTimeout(drawn, 230);"  # pictures are fine after 200 ms of rest
        )
        self.execute_async_script(slide, step)


def _programs() -> _Programs | None:
    browser, driver = shutil.which("chromium"), shutil.which("chromedriver")
    return _Programs(browser, driver) if browser and driver else None
