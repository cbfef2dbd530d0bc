"""A row for each release, made from the results that were stored when it was released.

Rows are kept even if a number got worse. The first row always has the results that are stored now,
of the newest release or of the development since then.
"""

import re
from pathlib import Path
from statistics import fmean, median
from typing import Annotated, NamedTuple, Self

from cyclopts import Parameter

from cocap_opt.experiments.lab.results import (
    STORED,
    Results,
    in_unit,
    load_csv,
    read_csv,
)
from cocap_opt.experiments.lab.studies.options import Out
from cocap_opt.experiments.lab.studies.paper.measured import read_rows
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.files.documents import FileError
from cocap_opt.output.printing import markdown_table, print_texts
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import COVERAGE_VERSION

_TABLE = "releases.csv"
DEVELOPMENT = "development"  # in place of a version, for unreleased code


class Release(NamedTuple):
    """The numbers of a release.

    Attributes
    ----------
    version, date : as in the changelog
    coverage : version of coverage, on which J depends
    proved, runs : number of the paper's scenes' optima that were proved in time, and of all
    planner : the planner that was recommended
    gap, worst : its mean and its largest distance below the certified bound, in %
    cocap : the mean distance of CoCap below the bound, in %
    search : s, its median time of search
    proof : s, median CPU time to the proof of an optimum of the bottleneck
    long, large : % left open on field-long after 300 s and on field-large after 120 s, medians
    ratio : CoCap's time over that of sequential planning on the bottleneck, median
    command : s of CPU time, `cocap-opt gap corridor --seeds 0`
    """

    version: str
    date: str
    coverage: int
    proved: int
    runs: int
    planner: str
    gap: float
    worst: float
    cocap: float
    search: float
    proof: float
    long: float
    large: float
    ratio: float
    command: float

    @classmethod
    def of(cls, version: str, date: str, coverage: int, folder: Path, planner: str) -> Self:
        """Makes the row of a version from a folder of stored results."""
        rows = read_rows(folder / "paper.csv")
        best = [row for row in rows if row.planner == planner]
        if not best:
            raise FileError(f"{folder / 'paper.csv'}: has no rows of {planner}")
        gaps, of_cocap = (
            GapRow.percent([r for r in rows if r.planner == name and r.valid], "gap")
            for name in (planner, "cocap")
        )
        speed = {row["figure"]: float(row["measured"]) for row in _read(folder / "speed.csv")}
        solved = {
            (row["row"], row["figure"]): float(row["value"])
            for row in _read(folder / "solver-figures.csv")
        }
        return cls(
            version, date, coverage, sum(row.bound_is_proved for row in best), len(best), planner,
            fmean(gaps), max(gaps), fmean(of_cocap), median(GapRow.values(best, "seconds")),
            solved["bottleneck", "median seconds to proof"],
            solved["field-long", "median gap after 300 s"],
            solved["field-large", "median gap after 120 s"],
            speed["CoCap / sequential, bottleneck, median of 10 seeds"],
            speed["gap corridor --seeds 0"],
        )  # fmt: skip

    @classmethod
    def stored(cls) -> list[Self]:
        """Returns the rows of all releases, newest first."""
        return load_csv(STORED / _TABLE, cls, "releases")

    @property
    def record(self) -> dict[str, str]:
        """Its row of the page, without line breaks between numbers and their units."""
        cells = {
            "release": self.version,
            "date": self.date,
            "proved": f"{self.proved} of {self.runs}",
            "planner": self.planner,
            "gap, worst": f"{self.gap:.3f} %, {self.worst:.2f} %",
            "CoCap's gap": f"{self.cocap:.2f} %",
            "search": in_unit(str(self.search), "s"),
            "proof": in_unit(str(self.proof), "s"),
            "field-long": in_unit(str(self.long), "%"),
            "field-large": in_unit(str(self.large), "%"),
        }
        return {title: re.sub(r" (?=[%s])", "\u00a0", cell) for title, cell in cells.items()}


def releases(
    version: Annotated[str, Parameter(help=f"version, e.g. 0.3.0, or {DEVELOPMENT}")],
    date: Annotated[str, Parameter(help="date of the tag or the results, e.g. 2026-11-26")],
    /,
    *,
    stored: Annotated[
        Path | None, Parameter(help="folder of stored results (default: the repository's)")
    ] = None,
    planner: Annotated[str, Parameter(help="planner that the release recommends")] = RECOMMENDED,
    coverage: Annotated[
        int | None, Parameter(help="version of coverage (default: the current one)")
    ] = None,
    out: Out = None,
) -> None:
    """Makes the row of a release, and inserts it above all others (releases.csv)."""
    law = COVERAGE_VERSION if coverage is None else coverage
    made = Release.of(version, date, law, stored or STORED, planner)
    results = Results.into(out)
    again = {version, DEVELOPMENT}
    rows = [made, *(release for release in Release.stored() if release.version not in again)]
    results.save(_TABLE, rows)
    print_texts([markdown_table([made.record])], [])


def releases_in_markdown() -> str:
    """Returns a row for each release, newest first."""
    return markdown_table([release.record for release in Release.stored()])


def _read(path: Path) -> list[dict[str, str]]:
    return read_csv(path, dict)
