from pathlib import Path

import pytest
from browser import value
from selenium.webdriver.support.wait import WebDriverWait

from cocap_opt.cli import commands
from cocap_opt.experiments.lab.studies.pictures import PLAYER_IS_READY, Browser

SWEEP = ("gap", "tiny-queue", "bottleneck", "--time-limit", "0.5", "--seeds", "0",
         "--planner", "greedy", "--planner", "cocap", "--planner", "sequential")  # fmt: skip


@pytest.mark.slow
def test_a_report_opens_and_plays_without_network(tmp_path: Path) -> None:
    """All sections are there, players in it play, nothing is loaded, nothing is complained of."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    folder, page = tmp_path / "run", tmp_path / "report.html"
    assert commands.run([*SWEEP, "--out", str(folder)]) == 0
    assert commands.run(["report", str(folder), "-o", str(page)]) == 0
    with Browser.opened(page, ready="document.readyState === 'complete'") as browser:
        titles = value(browser, "[...document.querySelectorAll('h2')].map((h) => h.textContent)")
        assert titles == [
            "Results", "Planners compared", "Search for the bounds", "Plans", "Limitations",
            "How it was made",
        ]  # fmt: skip
        images = "[...document.images].every((i) => i.complete && i.naturalWidth > 0)"
        assert value(browser, images)
        assert value(browser, "performance.getEntriesByType('resource').length") == 0
        frames = browser.find_elements("tag name", "iframe")
        assert [frame.get_attribute("title") for frame in frames] == [
            "plans of tiny-queue, seed 0", "plans of bottleneck, seed 0",
        ]  # fmt: skip
        browser.execute_script("arguments[0].scrollIntoView()", frames[1])
        browser.switch_to.frame(frames[1])
        WebDriverWait(browser, 30).until(lambda driver: value(driver, PLAYER_IS_READY))
        browser.find_element("id", "slider").send_keys("\ue014")  # right
        step = "document.getElementById('step').textContent"
        WebDriverWait(browser, 30).until(lambda driver: value(driver, step) != "step 1 of 11")
        assert value(browser, step) == "step 2 of 11"  # it opens at the first that counts
        browser.switch_to.default_content()
        assert browser.get_log("browser") == []
