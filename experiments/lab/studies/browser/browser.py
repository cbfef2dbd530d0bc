"""The speed of cocap-check in a browser, compared with the command.

Both check an instance, a plan and a certificate. Times are CPU times: of the command's process from
its start, and of all processes of the browser from the choice of files until the page shows the
answer; Python is already loaded. Both are measured several times, in turn.
"""

import math
import platform
import statistics
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

import psutil

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results, load_csv, markdown
from cocap_opt.experiments.lab.studies.browser.files import (
    PYODIDE,
    certified,
    instance,
    pyodide,
)
from cocap_opt.experiments.lab.studies.options import Out, Scenes, chromium
from cocap_opt.experiments.lab.studies.runs import childrens_seconds
from cocap_opt.files.documents import FileError
from cocap_opt.formulations.independent import cocap_check
from cocap_opt.output.files import save_files
from cocap_opt.output.printing import Listing, Record

if TYPE_CHECKING:
    from cocap_opt.experiments.lab.studies.browser.page import CheckPage

_TABLE = "browser.csv"
_SCENES = ["corridor", "bottleneck", "passage"]
_REPEATS = 5


class BrowserRow(NamedTuple):
    """The time to check the files of a scene with seed 0.

    Attributes
    ----------
    command_seconds, page_seconds : medians of CPU time
    python : version of the command's Python
    pyodide, megabytes : version of the page's Python, and its download size
    """

    scene: str
    command_seconds: float
    page_seconds: float
    python: str
    pyodide: str
    megabytes: float


def browser(*, scene: Scenes = None, out: Out = None) -> None:
    """Measures built-in scenes, prints a table, and writes it (browser.csv)."""
    results, rows = Results.into(out), list[BrowserRow]()
    with chromium("browser"), TemporaryDirectory() as folder:
        from cocap_opt.experiments.lab.studies.browser.page import CheckPage

        with CheckPage.opened() as page:
            for name in scene or _SCENES:
                rows.append(_measured(page, name, _written(name, Path(folder))))
                say(f"{name}: {rows[-1].page_seconds:.2f} s")
                results.save(_TABLE, rows)
    Listing("cocap-check in a browser", _shown(rows)).print()


def _written(scene: str, folder: Path) -> list[Path]:
    """Writes an instance, a plan and a certificate; returns their paths."""
    found = certified(scene)
    contents = {
        folder / f"{scene}.instance": instance(found.problem),
        folder / f"{scene}-plan.json": found.plan_content,
        folder / f"{scene}.json": found.content,
    }
    save_files(contents)
    return list(contents)


def _measured(page: "CheckPage", scene: str, paths: Sequence[Path]) -> BrowserRow:
    """Checks the files with both in turn, and compares the answers.

    Raises
    ------
    FileError
        If the page's answer differs from the command's.
    """
    command, shown = list[float](), list[float]()
    page.check(paths)  # loads Python
    for _ in range(_REPEATS):
        begin = childrens_seconds()
        text = printed(paths)
        command.append(childrens_seconds() - begin)
        begin = _of_browser(page)
        answer = page.check(paths)
        shown.append(_of_browser(page) - begin)
        if answer.lines != text:
            raise FileError(f"{scene}: the page prints {answer.lines}, the command {text}")
    loaded = sum(map(len, (pyodide() or {}).values())) / 1e6
    return BrowserRow(
        scene, statistics.median(command), statistics.median(shown), platform.python_version(),
        PYODIDE, loaded,
    )  # fmt: skip


def printed(paths: Sequence[Path]) -> list[str]:
    """Returns the lines that the command prints for files, when run in their folder."""
    command = [sys.executable, "-I", cocap_check.__file__, *(path.name for path in paths)]
    done = subprocess.run(command, cwd=paths[0].parent, capture_output=True, text=True, check=False)
    return done.stdout.splitlines()


def _of_browser(page: "CheckPage") -> float:
    """Returns the CPU time (s) of all processes of the browser."""
    driver = page.browser.service.process
    assert driver is not None
    processes = psutil.Process(driver.pid).children(recursive=True)
    return math.fsum(sum(process.cpu_times()[:2]) for process in processes)


def browser_in_markdown() -> str:
    """Returns the stored times as a table in Markdown, below a sentence with their ratio."""
    rows = load_csv(STORED / _TABLE, BrowserRow, "browser")
    ratios = [row.page_seconds / row.command_seconds for row in rows]
    words = (
        f"It takes {min(ratios):.1f} to {max(ratios):.1f} times as long as the command: medians of "
        f"{_REPEATS} measurements of CPU time, in Chromium with Pyodide {rows[0].pyodide}, "
        f"and with CPython {rows[0].python} on the same machine. For each scene with seed 0, "
        "both check an instance, a plan and a staged certificate that proves it optimal."
    )
    return f"{words}\n\n{markdown(_shown(rows))}"


def size_in_words() -> str:
    """Returns the size of the Python that a browser loads."""
    return f"{load_csv(STORED / _TABLE, BrowserRow, 'browser')[0].megabytes:.0f} MB"


def _shown(rows: Sequence[BrowserRow]) -> list[Record]:
    """Returns the rows of the table."""
    return [
        {
            "scene": row.scene,
            "command": f"{row.command_seconds:.2f} s",
            "in the browser": f"{row.page_seconds:.2f} s",
            "ratio": f"{row.page_seconds / row.command_seconds:.1f}",
        }
        for row in rows
    ]
