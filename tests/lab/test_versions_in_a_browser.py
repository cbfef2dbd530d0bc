"""The choice of versions above the menu of the site, in a browser."""

import json
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from pages import DOCS
from selenium.webdriver.common.by import By
from selenium.webdriver.support.select import Select
from selenium.webdriver.support.wait import WebDriverWait

from cocap_opt.experiments.lab.studies.pictures import Browser

SCRIPT = (DOCS / "_static" / "versions.js").read_text(encoding="utf-8")
PAGE = (
    '<!doctype html><html data-content_root="{root}"><title>{title}</title>'
    '<a class="sidebar-brand">cocap-opt</a><script>{script}</script></html>'
)
LOADED = "document.readyState === 'complete'"


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Tells nothing of requests."""


@pytest.fixture
def site(tmp_path: Path) -> Iterator[str]:
    """The address of a site of two versions, of which the newer has one page more."""
    for version, names in (("latest", ("index", "how-to/new")), ("0.2.0", ("index",))):
        for name in names:
            path = tmp_path / version / f"{name}.html"
            path.parent.mkdir(parents=True, exist_ok=True)
            root = "./" if name == "index" else "../"
            title = f"{version} {name}"
            path.write_text(PAGE.format(root=root, title=title, script=SCRIPT))
    (tmp_path / "versions.json").write_text(json.dumps(["latest", "0.2.0"]))
    handler = partial(_Quiet, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


@pytest.mark.slow(seconds=8)
def test_a_version_is_chosen(site: str, tmp_path: Path) -> None:
    """The same page of the other version opens, or its first where there is none.

    Where no file names the versions there is no choice, and nothing is said of it.
    """
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    with Browser.opened(f"{site}/latest/how-to/new.html", ready=LOADED) as browser:
        wait = WebDriverWait(browser, 10)
        choice = wait.until(lambda b: b.find_element(By.CSS_SELECTOR, "select.versions"))
        shown = Select(choice)
        assert [option.text for option in shown.options] == ["latest", "0.2.0"]
        assert shown.first_selected_option.text == "latest"
        shown.select_by_visible_text("0.2.0")
        wait.until(lambda b: b.title == "0.2.0 index")
        choice = wait.until(lambda b: b.find_element(By.CSS_SELECTOR, "select.versions"))
        Select(choice).select_by_visible_text("latest")
        wait.until(lambda b: b.title == "latest index")
        (tmp_path / "versions.json").unlink()
        browser.get(f"{site}/0.2.0/index.html")
        browser.execute_async_script("setTimeout(arguments[0], 500)")
        assert browser.find_elements(By.TAG_NAME, "select") == []
