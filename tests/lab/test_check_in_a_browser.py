"""The page that checks files, in a browser: it says what the command says, or why it cannot."""

import gzip
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from cocap_opt.cli.commands import run
from cocap_opt.experiments.lab.studies.browser import files
from cocap_opt.experiments.lab.studies.browser.browser import (
    BrowserRow,
    browser,
    browser_in_markdown,
    printed,
    size_in_words,
)
from cocap_opt.experiments.lab.studies.browser.files import EXAMPLE, checker, examples, write_check
from cocap_opt.experiments.lab.studies.browser.page import STATIC, CheckPage
from cocap_opt.experiments.lab.studies.pictures import Browser
from cocap_opt.formulations.independent import cocap_check
from cocap_opt.output.files import save_files

ODD = 'it\'s <b>no<br> "plan" & so on.json'


@pytest.fixture(scope="module")
def page() -> Iterator[CheckPage]:
    """The page in a browser."""
    if not Browser.is_installed():
        pytest.skip("needs chromium and chromedriver")
    if files.pyodide() is None:
        pytest.skip("needs npm, and Pyodide from its registry or cache")
    with CheckPage.opened() as opened:
        yield opened


@pytest.fixture
def example(tmp_path: Path) -> dict[str, Path]:
    """The files that the page has as examples, by their names."""
    save_files({tmp_path / name: content for name, content in examples().items()})
    return {name: tmp_path / name for name in examples()}


def paths(example: dict[str, Path], *names: str) -> list[Path]:
    """The instance and other files of the example."""
    return [example[name] for name in (f"{EXAMPLE}.instance", *names)]


# -- in a browser -------------------------------------------------------------------------


@pytest.mark.long(seconds=10)
def test_the_examples_are_checked_as_by_the_command(
    page: CheckPage, example: dict[str, Path]
) -> None:
    """A press loads each; its text is the command's, and the exit code is told in words."""
    page.button("its plan").click()
    answer = page.answer()
    assert answer.verdict == "Checked: all that the files claim holds."
    given = paths(example, f"{EXAMPLE}-plan.json", f"{EXAMPLE}.json")
    assert (answer.code, answer.lines) == (0, printed(given))
    assert hashlib.sha256(checker()).hexdigest() in answer.facts
    page.button("altered").click()
    page.wait("document.querySelectorAll('#check li').length === 2")
    page.wait("document.getElementById('check').ariaBusy === 'false'")
    answer = page.answer()
    assert answer.verdict == (
        f"Refused: {EXAMPLE}-altered.json: bound: claims less than its numbers prove."
    )
    assert (answer.code, answer.lines) == (1, printed(paths(example, f"{EXAMPLE}-altered.json")))


@pytest.mark.long(seconds=10)
def test_files_stay_in_the_browser(page: CheckPage, example: dict[str, Path]) -> None:
    """Once Python is loaded, nothing is asked of the server, nor was anything ever sent to it."""
    given = paths(example, f"{EXAMPLE}.json")
    page.check(given)
    before = list(page.asked)
    answer = page.check(given)
    assert (answer.code, page.asked) == (0, before)
    assert all(line.startswith('"GET ') for line in before)


@pytest.mark.long(seconds=10)
def test_files_may_come_in_any_order_and_by_dropping(
    page: CheckPage, example: dict[str, Path]
) -> None:
    """The instance is found among them; what is added later is checked with it."""
    page.forget()
    page.choose([example[f"{EXAMPLE}.json"]])
    assert page.answer().verdict.startswith("The instance is missing. ")
    text = example[f"{EXAMPLE}.instance"].read_text()
    page.browser.execute_script(
        """
        const transfer = new DataTransfer();
        transfer.items.add(new File([arguments[0]], "dropped"));
        document.body.dispatchEvent(new DragEvent("drop", {
          dataTransfer: transfer, bubbles: true, cancelable: true }));
        """,
        text,
    )
    page.wait("document.getElementById('check').ariaBusy === 'false'")
    page.wait("/^Checked/.test(document.querySelector('.verdict').textContent)")
    kinds = page.value("[...document.querySelectorAll('#check .kind')].map((e) => e.textContent)")
    assert [kind.split(",")[0] for kind in kinds] == ["certificate", "instance"]
    assert page.text("#check pre").startswith(f"$ python cocap_check.py dropped {EXAMPLE}.json\n")


@pytest.mark.long(seconds=10)
def test_damaged_files_have_one_line_each(
    page: CheckPage, example: dict[str, Path], tmp_path: Path
) -> None:
    """A cut or compressed instance, no JSON, odd names: as by the command; too deep ones likewise.

    There browsers have less room than the command, and Python breaks off; the page goes on.
    """
    instance, certificate = paths(example, f"{EXAMPLE}.json")
    cut, packed, odd = tmp_path / "cut.instance", tmp_path / "packed.gz", tmp_path / ODD
    cut.write_text(instance.read_text()[:5000])
    packed.write_bytes(gzip.compress(instance.read_bytes()))
    odd.write_text("{")
    deep = tmp_path / "deep.json"
    deep.write_text('{"a":' * 100_000)
    answer = page.check([packed, certificate])
    assert (answer.code, answer.lines) == (2, printed([packed, certificate]))
    assert answer.verdict == f"Not checked: {answer.lines[0]}."
    for given in ([cut, certificate], [instance, odd, certificate]):
        answer, text = page.check(given), printed(given)
        assert (answer.code, answer.lines) == (1, text)
        line = next(line for line in text if ": refused: " in line)
        assert answer.verdict.startswith(f"Refused: {line.replace(': refused: ', ': ')}.")
    assert answer.verdict.endswith(" The other files were checked all the same.")
    answer = page.check([instance, deep])
    assert answer.code in (-1, 1)
    assert re.match(
        "Not checked: the check broke off, as a file is nested too deeply for a browser: "
        "|Refused: deep.json: is nested too deeply", answer.verdict,
    )  # fmt: skip
    assert len(answer.lines) <= 2
    assert page.check([instance, certificate]).code == 0


@pytest.mark.long(seconds=10)
def test_a_check_is_cancelled(page: CheckPage, example: dict[str, Path], tmp_path: Path) -> None:
    """The page stays alive meanwhile; what was printed stands, and the next check is as ever."""
    given = paths(example, f"{EXAMPLE}.json")
    page.check(given)
    copies = [tmp_path / f"copy-{n}.json" for n in range(150)]
    save_files({path: given[1].read_bytes() for path in copies})
    page.forget()
    page.choose([given[0], *copies])
    page.wait("document.querySelector('#check pre').textContent.split('\\n').length > 3")
    assert page.text("#check .told").startswith("checking copy-")
    page.button("Cancel").click()
    answer = page.answer()
    assert answer.verdict == "Cancelled: what was not printed yet was not checked."
    assert 2 < len(answer.lines) < len(copies)
    assert page.value("document.activeElement.textContent") == "Check"
    assert page.check(given).code == 0


@pytest.mark.long(seconds=10)
def test_too_long_searches_and_lost_pages_are_told(example: dict[str, Path]) -> None:
    """Exit code 3 has its words; a site without Python says what is missing."""
    if not Browser.is_installed() or files.pyodide() is None:
        pytest.skip("needs chromium, chromedriver, and Pyodide from npm")
    given = paths(example, f"{EXAMPLE}.json")
    with CheckPage.opened() as page:
        served = page.folder / "check" / "cocap_check.py"
        text = served.read_text(encoding="utf-8")
        assert "MOST_BRANCHES, TRIES = 1_000_000, 40" in text
        served.write_text(text.replace("TRIES = 1_000_000, 40", "TRIES = 0, 40"), encoding="utf-8")
        answer = page.check(given)
        assert (answer.code, answer.verdict.split(":")[0]) == (3, "Too long")
        assert hashlib.sha256(served.read_bytes()).hexdigest() in answer.facts
    with CheckPage.opened() as page:
        (page.folder / "check" / "files.json").unlink()
        answer = page.check(given)
        assert answer.verdict == ("Not checked: Python could not be loaded: /check/files.json: 404")


@pytest.mark.long(seconds=20)
def test_the_study_measures_what_both_say_alike(
    page: CheckPage, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row for the scene, of which both times are positive."""
    browser(scene=["corridor"], out=tmp_path)
    head, row = (tmp_path / "browser.csv").read_text().splitlines()
    assert head == ",".join(BrowserRow._fields)
    assert all(float(field) > 0 for field in row.split(",")[1:3])
    assert "corridor" in capsys.readouterr().out


# -- files --------------------------------------------------------------------------------


@pytest.mark.slow(seconds=5)
def test_the_examples_are_what_the_program_writes(
    example: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Instance and certificate to the byte, a plan but for its time; who is altered is refused."""
    names = "its.instance", "its-plan.json", "its.json"
    instance, plan, certificate = (tmp_path / name for name in names)
    assert run(["export", EXAMPLE, "-o", str(instance)]) == 0
    assert run(["plan", EXAMPLE, "-o", str(plan)]) == 0
    assert run(["bound", EXAMPLE, "--start", str(plan), "-o", str(certificate)]) == 0
    assert instance.read_bytes() == example[f"{EXAMPLE}.instance"].read_bytes()
    assert certificate.read_bytes() == example[f"{EXAMPLE}.json"].read_bytes()
    written, shown = (
        json.loads(path.read_text()) for path in (plan, example[f"{EXAMPLE}-plan.json"])
    )
    for name in ("plan", "reward", "digest", "planner", "version"):
        assert written[name] == shown[name]
    capsys.readouterr()
    good = paths(example, f"{EXAMPLE}-plan.json", f"{EXAMPLE}.json")
    assert cocap_check.main([*map(str, good)]) == 0
    assert cocap_check.main([*map(str, paths(example, f"{EXAMPLE}-altered.json"))]) == 1
    altered, exact = (
        json.loads(example[f"{EXAMPLE}{kind}.json"].read_text()) for kind in ("-altered", "")
    )
    assert altered.pop("bound") == pytest.approx(0.99 * exact.pop("bound"))
    assert altered == exact


def test_the_script_loads_the_examples_that_are_written() -> None:
    """Names in the page's script are those of the files beside it, all of them."""
    text = (STATIC / "check.js").read_text(encoding="utf-8")
    assert {name for name in examples() if f'"{name}"' in text} == set(examples())


def test_without_npm_the_pages_have_no_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The checker and the examples are written all the same."""
    monkeypatch.setenv("PATH", str(tmp_path))
    files.pyodide.cache_clear()
    try:
        assert not write_check(tmp_path / "check")
    finally:
        files.pyodide.cache_clear()
    names = {path.name for path in (tmp_path / "check").rglob("*") if path.is_file()}
    assert names == {"cocap_check.py", *examples()}
    assert (tmp_path / "check" / "cocap_check.py").read_bytes() == checker()


def test_another_pyodide_than_the_known_one_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What npm hands over is compared with the digest before anything is taken from it."""
    npm = tmp_path / "npm"
    script = 'import sys\nopen(sys.argv[-1] + "/x.tgz", "w").write("x")\n'
    npm.write_text(f"#!{sys.executable}\n{script}")
    npm.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    files.pyodide.cache_clear()
    try:
        with pytest.raises(ValueError, match=f"pyodide {files.PYODIDE} of npm: its SHA-512 is not"):
            files.pyodide()
    finally:
        files.pyodide.cache_clear()


def test_scripts_are_scripts() -> None:
    """Node reads them without complaint, where it is installed."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("needs node")
    for name, kind in (("check.js", "commonjs"), ("check_worker.js", "module")):
        text = (STATIC / name).read_text(encoding="utf-8")
        done = subprocess.run(
            [node, "--check", f"--input-type={kind}", "-"], input=text, capture_output=True,
            text=True, check=False,
        )  # fmt: skip
        assert (name, done.stderr) == (name, "")


def test_the_page_quotes_the_stored_speed() -> None:
    """The sentence says the least and the largest ratio, the table has a row for each scene."""
    text = browser_in_markdown()
    for scene in ("corridor", "bottleneck", "passage"):
        assert f"| {scene} " in text
    assert f"Pyodide {files.PYODIDE}" in text  # measured with what the pages have
    assert size_in_words().endswith(" MB")
