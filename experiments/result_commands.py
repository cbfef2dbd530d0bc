"""The commands that show what sweeps have found."""

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from experiments.files import check_output, save_bytes
from experiments.options import Json, Output, choose
from experiments.printing import print_json
from experiments.sweeps.about import load_run
from experiments.sweeps.results import load_results
from experiments.tables import AGAINST, all_tables

DOCUMENT_STYLES = ("markdown", "latex", "html")


def table(
    folder: Path,
    /,
    *,
    style: Annotated[
        str, Parameter(name="--format", help=f"one of {', '.join(DOCUMENT_STYLES)}")
    ] = "markdown",
    against: Annotated[
        str | None, Parameter(help=f"the planner that others are compared with, else {AGAINST}")
    ] = None,
    output: Output = None,
    json: Json = False,
) -> int:
    """Make tables of the results in a folder: planners, differences, prices, times.

    Means come with 95 % confidence intervals (Student's t), times as
    shifted geometric means.

    Example: cocap-opt table results --format latex -o tables.tex
    """
    from experiments.documents import DOCUMENTS  # pandas is slow to import

    choose("--format", style, DOCUMENTS)
    check_output(output)
    rows = load_results(folder)
    if against is not None:
        choose("--against", against, dict.fromkeys(row["planner"] for row in rows))
    tables = all_tables(rows, load_run(folder).settings.limit, against or AGAINST)
    if json:
        print_json({"tables": tables})
    elif output is None:
        sys.stdout.write(DOCUMENTS[style](tables))
    if output is not None:
        save_bytes(output, DOCUMENTS[style](tables).encode())
    return 0
