"""Code on the built site, whose lines are folded on a phone."""

from pathlib import Path

import pytest
from pages import DOCS

from cocap_opt.experiments.lab.manual.code_lines import with_lines
from cocap_opt.experiments.lab.studies.pictures import Browser

PHONE = (390, 844)  # px
LOADED = "document.readyState === 'complete'"
OVERFLOWING = """
return [...document.querySelectorAll("pre")].map(box => box.scrollWidth > box.clientWidth);
"""


def block(language: str, code: str) -> str:
    """Returns a block of code as Sphinx writes it."""
    return (
        f'<div class="highlight-{language} notranslate"><div class="highlight"><pre>'
        f"<span></span>{code}\n</pre></div>\n</div>"
    )


def test_each_line_of_code_is_an_element() -> None:
    """It knows its depth, so that the rest of a folded line goes on below its beginning."""
    code = '<span class="k">if</span> a &lt; b:\n\n    f(<span class="n">b</span>)'
    assert with_lines(block("python", code)) == block("python", "LINES").replace(
        "LINES\n",
        '<span class="line"><span class="k">if</span> a &lt; b:\n</span>'
        '<span class="line">\n</span>'
        '<span class="line" style="--depth: 4">    f(<span class="n">b</span>)\n</span>',
    )


def test_output_in_columns_stays_as_it_is() -> None:
    """Folded, its columns would be lost; output in sentences is folded."""
    table = block("text", "valid    yes\ngap      0.000 %")
    assert with_lines(table) == table
    assert 'class="line"' in with_lines(block("text", "give people their signal at step 0"))
    assert 'class="line"' in with_lines(block("toml", "steps = 12                  # of 1 s"))


@pytest.mark.slow(seconds=4)
def test_code_does_not_scroll_on_a_phone(tmp_path: Path) -> None:
    """Lines of 88 characters fit; a table in columns scrolls in its own box, never the page."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    style = (DOCS / "_static" / "pages.css").read_text(encoding="utf-8")
    code = [("sh", "cocap-opt plan " + "scene.toml " * 6), ("py", "    a: " + "x" * 80)]
    blocks = [with_lines(block(*each)) for each in (*code, ("text", "a" * 40 + "   " + "b" * 40))]
    page = tmp_path / "page.html"
    page.write_text(
        "<!doctype html><meta name=viewport content='width=device-width'>"
        f"<style>pre {{ overflow: auto; }} {style}</style>{''.join(blocks)}"
    )
    with Browser.opened(page, PHONE, ready=LOADED) as browser:
        assert browser.execute_script(OVERFLOWING) == [False, False, True]
        wide = browser.execute_script("return document.documentElement.scrollWidth > innerWidth")
        assert not wide
