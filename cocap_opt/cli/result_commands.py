"""The commands that show the results of sweeps."""

import logging
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import (
    FLAG,
    Json,
    OfPlanners,
    OfScenes,
    Output,
    Results,
    Whole,
    chosen,
)
from cocap_opt.experiments.sweeps.results import RunFile, load_results
from cocap_opt.experiments.tables.comparison import paired_tests
from cocap_opt.experiments.tables.comparison_tables import (
    comparison_tables,
    test_records,
    too_few_scenes,
)
from cocap_opt.experiments.tables.rows import COLUMNS, GapRow
from cocap_opt.experiments.tables.tables import AGAINST, DOCUMENTS, Tables
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import check_output, save_bytes, save_csv
from cocap_opt.output.printing import Listing
from cocap_opt.run.options import Option, UsageError

_log = logging.getLogger(__name__)

Against = Annotated[
    str | None, Parameter(help=f"planner to compare the others with (default: {AGAINST})")
]

_PIPED = "markdown"  # format of tables in a pipe, if none is chosen
_ENDINGS = {"markdown": (".md", ".txt"), "latex": (".tex",), "html": (".html",)}


def _table(
    folder: Results,
    /,
    *,
    style: Annotated[
        str | None,
        Parameter(
            name="--format",
            choices=tuple(DOCUMENTS),
            help="format of the tables (default: by the file extension; without a file, plain "
            "text on a terminal, else markdown)",
        ),
    ] = None,
    scene: OfScenes = None,
    planner: OfPlanners = None,
    against: Against = None,
    compare: Annotated[
        bool,
        FLAG(
            help="print paired tests over scenes and performance profiles instead: for all pairs "
            "of planners, or for those with --against; -o FILE.csv writes the tests as numbers"
        ),
    ] = False,
    output: Output = None,
    json: Json = False,
) -> int:
    """Make tables of the results in a folder: planners, differences, prices, times.

    Means over five seeds or more have 95 % bootstrap intervals; times are
    shifted geometric means. --compare uses Wilcoxon's signed-rank test, with
    p values corrected for multiple tests by Holm's method.

    Example: cocap-opt table results -o tables.tex
    """
    check_output(output)
    numbers = output if compare and style is None and output and _is_csv(output) else None
    as_document = DOCUMENTS[_PIPED if numbers else _format(style, output)]
    rows = chosen(load_results(folder), scene, planner)
    with_one = _against(against, rows)
    if compare:
        _require_several(rows)
        if words := too_few_scenes(rows):
            _log.warning("%s: %s", folder, words)
    if numbers:
        save_csv(numbers, test_records(paired_tests(rows, against)))
        print_result({"file": numbers}, json)
        return 0
    tables = comparison_tables(rows, against) if compare else Tables.of(rows, with_one)
    if output is not None:
        save_bytes(output, as_document(tables).encode())
    if json:
        print_result({"tables": tables}, json)
    elif output is None and style is None and sys.stdout.isatty():
        tables.print()
    elif output is None:
        sys.stdout.write(as_document(tables))
    else:
        print_result({"file": output}, json)
    return 0


def _is_csv(path: Path) -> bool:
    return path.suffix.lower() == ".csv"


def _require_several(rows: Sequence[GapRow]) -> None:
    """Rejects results of a single planner, which cannot be compared with anything."""
    if len({row.planner for row in rows}) < 2:
        raise UsageError("--compare: needs the results of two planners or more")


def _format(style: str | None, output: Path | None) -> str:
    """Returns the format of tables: the chosen one, or that of the file's ending."""
    if output is None:
        return style or _PIPED
    endings = {
        end: name for name, ends in _ENDINGS.items() for end in ends if style in (None, name)
    }
    return endings[Option("-o").file(output, tuple(endings)).ending]


def _report(
    folder: Results,
    /,
    *,
    output: Output,
    scene: OfScenes = None,
    planner: OfPlanners = None,
    against: Against = None,
    players: Annotated[Whole, Parameter(help="number of scenes with a player, at most")] = 4,
    json: Json = False,
) -> int:
    """Make one HTML page of a sweep: tables, figures, players, settings and limitations.

    It needs no network and no other file.

    Example: cocap-opt report results -o report.html
    """
    from cocap_opt.experiments.report.report import (
        report_page,  # matplotlib and pandas take long to import
    )

    path = Option("-o").file(output, (".html",)).path
    if players < 0:
        raise UsageError(f"--players: must be at least 0, not {players}")
    check_output(path)
    rows, run = chosen(load_results(folder), scene, planner), RunFile.load(folder)
    content = report_page(folder, rows, run, _against(against, rows), players)
    save_bytes(path, content.encode())
    print_result({"file": path}, json)
    return 0


def _against(planner: str | None, rows: Sequence[GapRow]) -> str:
    """Returns the planner with which others are compared; it must be in the results."""
    if planner is None:
        return AGAINST
    Option("--against").require_one_of(planner, dict.fromkeys(row.planner or "" for row in rows))
    return planner


def _columns(*, json: Json = False) -> int:
    """Print the columns of results.csv: their types, their units and what they mean.

    Example: cocap-opt columns
    """
    rows = [
        {"column": name, "type": c.kind.__name__, "unit": c.unit, "about": c.meaning}
        for name, c in COLUMNS.items()
    ]
    if json:
        print_result({"columns": rows}, json)
    else:
        Listing("columns of results.csv", rows).print()
    return 0


COMMANDS = {"columns": _columns, "table": _table, "report": _report}
