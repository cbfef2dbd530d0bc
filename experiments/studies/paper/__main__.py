"""The paper, reproduced and answered: cocap-opt study paper --out DIR."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.experiments.cli.options import UsageError, check_workers
from cocap_opt.experiments.cli.program import program, run_app
from cocap_opt.experiments.console.numbers import numbers
from cocap_opt.experiments.sweeps.crew import ClusterError
from cocap_opt.files.documents import FileError

app = program(
    "cocap-opt study paper",
    "Make the paper's experiments again, over many seeds, with bounds beside them.",
)


@app.default
def paper(
    *,
    out: Annotated[Path, Parameter(help="folder for tables, figures, plans and certificates")],
    seeds: Annotated[str, Parameter(help="of each scene")] = "0-29",
    robots: Annotated[str, Parameter(help="team sizes of the scaling experiment")] = "2,4,6,8,12",
    scaling_seeds: Annotated[str, Parameter(help="of each team size")] = "0-4",
    time_limit: Annotated[float, Parameter(help="seconds for each plan and each bound")] = 60.0,
    workers: Annotated[
        int | None, Parameter(help="processes, each on a core of its own; this one if not given")
    ] = None,
) -> int:
    """Make reward curves, tables, the test of giving way, and scaling; answer the paper's claims.

    What is in the folder already is not computed again.

    Example: cocap-opt study paper --out paper --seeds 0-9
    """
    from cocap_opt.experiments.studies.paper.reproduction import reproduce

    if not (time_limit > 0 and math.isfinite(time_limit)):
        raise FileError(f"--time-limit: must be positive, not {time_limit:g}")
    check_workers("--workers", workers)
    sizes = numbers("--robots", robots)
    if min(sizes) < 1:
        raise FileError(f"--robots: must be at least 1, not {min(sizes)}")
    fine = reproduce(
        out, numbers("--seeds", seeds), sizes, numbers("--scaling-seeds", scaling_seeds),
        time_limit, workers,
    )  # fmt: skip
    return 0 if fine else 1


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns 0, 1 after an error in a cell, 2 for wrong input, 130 on Ctrl-C."""
    return run_app(app, arguments, ClusterError, UsageError)


if __name__ == "__main__":
    sys.exit(main())
