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
        '<span class="line" style="--depth: 4">    f(<wbr><span class="n">b</span>)\n</span>',
    )


def test_output_in_columns_stays_as_it_is() -> None:
    """Folded, its columns would be lost; output in sentences is folded.

    The rest of a sentence after a label goes on below the sentence.
    """
    table = block("text", "scene     gap      bound\ncorridor  0.000 %  12")
    assert with_lines(table) == table
    labelled = with_lines(block("text", "valid    yes\ncameras  two see 100 % of them"))
    assert labelled.count('<span class="line" style="--depth: 7">') == 2
    assert 'class="line"' in with_lines(block("text", "give people their signal at step 0"))
    assert 'class="line"' in with_lines(block("toml", "steps = 12                  # of 1 s"))


def test_options_are_whole() -> None:
    """A line is folded neither within an option nor before its short value; minus stays minus."""
    gap = '<span class="w"> </span>'
    code = f'show plan.json{gap}--steps{gap}<span class="m">1</span>{gap}-o{gap}x-1.json{gap}--a-b'
    found = with_lines(block("sh", code))
    for name in (f'--steps{gap}<span class="m">1</span>', f"-o{gap}x-1.json", "--a-b"):
        assert f'<span class="option">{name}</span>' in found
    assert found.count('class="option"') == 3
    inline = '<code><span class="pre">--start-set</span> <span class="pre">FILE</span></code>'
    assert with_lines(inline).count('class="pre option"') == 1


@pytest.mark.slow(seconds=4)
def test_options_are_on_one_line_on_a_phone(tmp_path: Path) -> None:
    """In commands and in tables, at every width."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    style = (DOCS / "_static" / "pages.css").read_text(encoding="utf-8")
    command = "cocap-opt plan corridor" + "".join(f" --option-{k} v{'v' * k}" for k in range(12))
    inline = '<code class="literal"><span class="pre">--output-of-it</span></code>'
    table = f"<table class=docutils><tr><td>{inline}<td>{'words ' * 40}</table><p>{inline * 3}"
    page = tmp_path / "page.html"
    page.write_text(
        "<!doctype html><meta name=viewport content='width=device-width'>"
        f"<style>{style}</style>{with_lines(block('sh', command) + table)}"
    )
    high = "return [...document.querySelectorAll('.option')].map((e) => e.getClientRects().length)"
    with Browser.opened(page, PHONE, ready=LOADED) as browser:
        assert browser.execute_script(high) == [1] * 16


@pytest.mark.slow(seconds=4)
def test_code_does_not_scroll_on_a_phone(tmp_path: Path) -> None:
    """Lines of 88 characters fit; a table in columns scrolls in its own box, never the page."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    style = (DOCS / "_static" / "pages.css").read_text(encoding="utf-8")
    code = [("sh", "cocap-opt plan " + "scene.toml " * 6), ("py", "    a: " + "x" * 80)]
    code += [("text", "  ".join("a" * 30 for _ in range(3)))]
    blocks = [with_lines(block(*each)) for each in code]
    page = tmp_path / "page.html"
    page.write_text(
        "<!doctype html><meta name=viewport content='width=device-width'>"
        f"<style>pre {{ overflow: auto; }} {style}</style>{''.join(blocks)}"
    )
    with Browser.opened(page, PHONE, ready=LOADED) as browser:
        assert browser.execute_script(OVERFLOWING) == [False, False, True]
        wide = browser.execute_script("return document.documentElement.scrollWidth > innerWidth")
        assert not wide
