"""The page that checks files, served on this machine and driven as its visitors do."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Thread
from typing import Any, NamedTuple, Self

from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.wait import WebDriverWait

from cocap_opt.experiments.lab.studies.browser.files import write_check
from cocap_opt.experiments.lab.studies.pictures import Browser

STATIC = Path(__file__).resolve().parents[4] / "docs" / "_static"
_READY = "document.getElementById('check').dataset.ready === 'yes'"
_PATIENCE = 300.0  # s, for loading Python and checking files
_PAGE = """<!doctype html>
<meta charset="utf-8">
<link rel="icon" href="data:,">
<link rel="stylesheet" href="../_static/check.css">
<div id="check" class="check"></div>
<script defer src="../_static/check.js"></script>
"""


class Answer(NamedTuple):
    """The answer of the page to some files.

    Attributes
    ----------
    verdict : the exit code in words
    lines : lines that cocap-check printed, without the command
    code : the exit code
    seconds : duration of the check, once Python was loaded
    facts : the sentences below the lines
    """

    verdict: str
    lines: list[str]
    code: int
    seconds: float
    facts: str


class _Handler(SimpleHTTPRequestHandler):
    """Serves a folder, and records the requests."""

    def __init__(self, asked: list[str], *args: Any, **options: Any) -> None:
        self._asked = asked
        super().__init__(*args, **options)

    def log_message(self, form: str, *args: Any) -> None:
        """Records the first line of each request."""
        self._asked.append(form % args)


class CheckPage(NamedTuple):
    """The page in a browser.

    Attributes
    ----------
    asked : a line for each request to the server
    folder : the folder that is served
    """

    browser: Browser
    asked: list[str]
    folder: Path

    @classmethod
    @contextmanager
    def opened(cls) -> Iterator[Self]:
        """Writes the page and its files into a folder, serves the folder, and opens the page.

        Raises
        ------
        FileNotFoundError
            If there is no browser, no driver, or no Pyodide.
        """
        with TemporaryDirectory() as name:
            folder = Path(name)
            shutil.copytree(STATIC, folder / "_static")
            if not write_check(folder / "check"):
                raise FileNotFoundError("npm must be installed, and reach its registry or cache")
            (folder / "how-to").mkdir()
            (folder / "how-to" / "check.html").write_text(_PAGE, encoding="utf-8")
            asked: list[str] = []
            handler = partial(_Handler, asked, directory=name)
            with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
                Thread(target=server.serve_forever, daemon=True).start()
                address = f"http://127.0.0.1:{server.server_port}/how-to/check.html"
                try:
                    with Browser.opened(address, ready=_READY) as browser:
                        yield cls(browser, asked, folder)
                finally:
                    server.shutdown()

    def check(self, paths: Sequence[Path]) -> Answer:
        """Returns the answer to files that are chosen together, after removing all others."""
        self.forget()
        self.choose(paths)
        return self.answer()

    def choose(self, paths: Sequence[Path]) -> None:
        """Chooses files, which starts the check."""
        self.browser.find_element(By.CSS_SELECTOR, "input[type=file]").send_keys(
            "\n".join(map(str, paths))
        )

    def forget(self) -> None:
        """Removes all files from the page."""
        if (button := self.button("Remove all")).is_displayed():
            button.click()

    def button(self, words: str) -> WebElement:
        """Returns the button with these words."""
        return self.browser.find_element(By.XPATH, f"//button[contains(., '{words}')]")

    def answer(self) -> Answer:
        """Waits for the verdict, and returns the page's whole answer."""
        self.wait("document.querySelector('.verdict').textContent !== ''")
        data = self.value("({...document.getElementById('check').dataset})")
        lines = self.text("#check pre").splitlines()
        return Answer(
            self.text(".verdict"), lines[1:], int(data.get("code", -1)),
            float(data.get("seconds", "nan")), self.text(".facts"),
        )  # fmt: skip

    def text(self, selector: str) -> str:
        """Returns the text of an element."""
        found: str = self.value(f"document.querySelector({selector!r}).textContent")
        return found

    def value(self, expression: str) -> Any:
        """Returns the value of an expression in the page."""
        return self.browser.execute_script(f"return {expression}")

    def wait(self, expression: str) -> None:
        """Waits until an expression is true in the page."""
        wait = WebDriverWait(self.browser, _PATIENCE, poll_frequency=0.05)
        wait.until(lambda _: self.value(expression))
