"""The pages of docs and the README: built without a warning, short, and true to what is stored."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from pages import DOCS, ROOT, blocks, pages, words, words_built

from cocap_opt.cli.commands import app
from cocap_opt.experiments.lab.studies.drawings import GALLERY
from cocap_opt.player.player_proof import CHECK_PAGE

README = ROOT / "README.md"
LONGEST = 1500  # words of a page, those of code included
# Folders of built pages; the first is that of the site itself.
SECTIONS = (
    ".", "benchmarks", "concepts", "extend", "how-to", "notebooks", "reference", "results",
    "tutorials",
)  # fmt: skip
_WIDTH = 88  # characters of a line of code on a page


def commands() -> list[str]:
    """Returns all lines of the pages that call cocap-opt, without what shells do with them."""
    lines = [
        line.split("  #")[0].split(" > ")[0]
        for page in (README, ROOT / "CONTRIBUTING.md", *pages())
        for language, text in blocks(page.read_text(encoding="utf-8"))
        if language == "sh"
        for line in text.splitlines()
    ]
    return [line for line in lines if line.startswith("cocap-opt ")]


@pytest.mark.slow(seconds=40)
def test_the_pages_are_built_without_a_warning(tmp_path: Path) -> None:
    """Links lead somewhere, each page is in the index, and each number that is quoted is stored."""
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-d", tmp_path / "trees", DOCS, tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert "bottleneck" in (tmp_path / "results" / "paper.html").read_text(encoding="utf-8")
    gallery = (tmp_path / "gallery.html").read_text(encoding="utf-8")
    players = re.findall(r'<iframe class="player" src="([^"]+)"', gallery)
    pictures = re.findall(r'<img class="small" [^>]*src="[^"]*/gallery-[^>]*><iframe', gallery)
    assert len(players) == len(pictures) == len(GALLERY) == gallery.count("/gallery-")
    named = re.findall(r"\]\((\S+)\)", (tmp_path / "llms.txt").read_text(encoding="utf-8"))
    assert [name for name in (*players, *named) if not (tmp_path / name).is_file()] == []
    page = (tmp_path / f"{CHECK_PAGE}.html").read_text(encoding="utf-8")
    beside = set(re.findall(r'"\.\./((?:check/|_static/check)[^"?]*)[?"]', page))
    has_python = (tmp_path / "check" / "files.json").is_file()
    scripts = {"_static/check.js", "_static/check.css"} if has_python else set[str]()
    assert beside == scripts
    assert (tmp_path / "check" / "cocap_check.py").is_file()
    assert [name for name in beside if not (tmp_path / name).is_file()] == []
    assert ('<div id="check"' in page) == has_python
    assert ("not part of this build" in page) == (not has_python)
    built = [path for folder in SECTIONS for path in sorted((tmp_path / folder).glob("*.html"))]
    assert len(built) > 100
    long = {path.name: words_built(path.read_text(encoding="utf-8")) for path in built}
    assert {name: count for name, count in long.items() if count > LONGEST} == {}


def test_pages_are_short() -> None:
    """Nobody is asked to read more than 1,500 words at once, and the README is two screens.

    Words of code count as others do; the built pages are counted above.
    """
    long = {page.name: words(page.read_text(encoding="utf-8")) for page in pages()}
    assert {name: count for name, count in long.items() if count > LONGEST} == {}
    assert len(README.read_text(encoding="utf-8").splitlines()) <= 100


def test_commands_fit_the_width_of_a_page() -> None:
    """Nobody has to scroll to the side to read a command."""
    wide = [
        f"{page.name}: {line}"
        for page in pages()
        for text in re.findall(r"(?ms)^```sh$\n(.*?)^```$", page.read_text(encoding="utf-8"))
        for line in text.splitlines()
        if len(line) > _WIDTH
    ]
    assert wide == []


def test_words_are_spelt_as_in_dictionaries() -> None:
    """No page has a word that is known to be misspelt."""
    files = [*pages(), README, ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
    command = [sys.executable, "-m", "codespell_lib", *map(str, files)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (0, "")


def test_contributing_says_what_made_the_stored_results() -> None:
    """Every stored file has a command that makes it again."""
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    table = text.partition("| file | made by |")[2].partition("\n\n")[0]
    stored = {path.name for path in (ROOT / "experiments" / "lab" / "stored").iterdir()}
    assert {name for name in stored if f"`{name}`" not in table} == set()


def told() -> list[Path]:
    """Returns the pages whose Python is run here; three are run with their commands elsewhere."""
    return [
        page
        for page in pages()
        if page.name not in ("first-flight.md", "from-a-map-to-a-flight.md", "research.md")
        and any(language == "python" for language, _ in blocks(page.read_text(encoding="utf-8")))
    ]


@pytest.mark.slow
@pytest.mark.parametrize("page", told(), ids=lambda page: page.stem)
def test_python_on_pages_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The blocks of a page work one after the other, in an empty folder, and print something."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for language, text in blocks(page.read_text(encoding="utf-8")):
        if language == "python":
            exec(compile(text, page.name, "exec"), names)
    assert capsys.readouterr().out


def test_commands_on_pages_exist() -> None:
    """Each command that a page shows is understood, with its options."""
    lines = commands()
    assert len(lines) > 20
    for line in lines:
        app.parse_args(line.removeprefix("cocap-opt "), print_error=False, exit_on_error=False)
