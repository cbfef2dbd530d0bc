"""The command line of the benchmarks: `cocap-opt study --help`."""

import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.experiments.cli.program import program, run_app
from cocap_opt.experiments.console.numbers import numbers, values
from cocap_opt.files.documents import FileError

app = program(
    "cocap-opt study",
    "Measure what the project promises about speed.",
)
Out = Annotated[Path | None, Parameter(help="folder for the results")]
Seeds = Annotated[str | None, Parameter(help="such as 0-4; without it, each row has its own")]


@app.default
def spine() -> int:
    """Measure coverage, planners and the command line."""
    from cocap_opt.experiments.studies.benchmarks.spine import print_figures

    print_figures()
    return 0


@app.command
def solvers(
    *,
    rows: Annotated[
        list[str] | None,
        Parameter(
            consume_multiple=True,
            negative="",
            help="which of corridor, bottleneck, passage, large, field-long, field-large, "
            "relaxations, cone-program, milp, milp-with-our-root; without it, all: hours",
        ),
    ] = None,
    seeds: Seeds = None,
    limit: Annotated[
        float | None,
        Parameter(help="seconds: cuts the rows' limits short, and sets that of the comparisons"),
    ] = None,
    large: Annotated[
        Path | None, Parameter(help="seq.yaml of Greedy Perspectives' scene `large`")
    ] = None,
    out: Out = None,
) -> int:
    """Measure bounds and exact methods against their targets and against the generic way.

    Example: cocap-opt study solvers --rows corridor cone-program --limit 20
    """
    from cocap_opt.experiments.studies.benchmarks.rows import Options
    from cocap_opt.experiments.studies.benchmarks.solvers import solvers as measure

    wanted = None if seeds is None else numbers("--seeds", seeds)
    if limit is not None:
        _require_positive(limit)
    return 0 if measure(rows or [], Options(wanted, limit, large), out) else 1


@app.command
def growth(
    *,
    robots: str = "2,4,8,16,32,64",
    steps: str = "8,16,32,64,80",
    cells: str = "15,30,48,64,96",
    seeds: Annotated[str, Parameter(help="medians are taken over them")] = "0-4",
    limit: Annotated[float, Parameter(help="seconds for each run")] = 60.0,
    out: Out = None,
) -> int:
    """Measure how column generation grows with robots, steps and cells.

    Example: cocap-opt study growth --seeds 0 --limit 20 --out growth
    """
    from cocap_opt.experiments.studies.benchmarks.growth import growth as measure

    _require_positive(limit)
    sizes = {
        "robots": numbers("--robots", robots),
        "steps": numbers("--steps", steps),
        "cells": numbers("--cells", cells),
    }
    return 0 if measure(sizes, numbers("--seeds", seeds), limit, out) else 1


@app.command
def views(
    *,
    scene: Annotated[
        list[str] | None, Parameter(negative="", consume_multiple=True, help="scenes or files")
    ] = None,
    poses: Annotated[int, Parameter(help="random poses in each scene")] = 1000,
    samples: Annotated[str, Parameter(help="sample points along a triangle of a face")] = "1-6",
    out: Out = None,
) -> int:
    """Measure planned against rendered coverage, and what more sample points cost.

    Example: cocap-opt study views --scene corridor --poses 100 --out views
    """
    from cocap_opt.experiments.studies.benchmarks.views import views as measure

    measure(
        scene or ["corridor", "bottleneck", "passage"], poses, numbers("--samples", samples), out
    )
    return 0


@app.command
def coverage(
    *,
    robots: Annotated[str, Parameter(help="how many, spread over the map")] = "2,6",
    steps: Annotated[int, Parameter(help="horizon T")] = 60,
    out: Out = None,
) -> int:
    """Measure what the coverage of maps of 120 x 120 cells costs.

    Example: cocap-opt study coverage --robots 2 --steps 10
    """
    from cocap_opt.experiments.studies.benchmarks.coverage import coverage as measure

    measure(numbers("--robots", robots), steps, out)
    return 0


@app.command
def peers(
    scene: Path,
    coverage: Path,
    /,
    *,
    states: Annotated[int, Parameter(help="how many random ones are compared")] = 500,
) -> int:
    """Compare coverage with what Greedy Perspectives' program rendered, state by state.

    Example: cocap-opt study peers seq.yaml peer_coverage.csv
    """
    from cocap_opt.experiments.studies.benchmarks.peers import peers as measure

    measure(scene, coverage, states)
    return 0


@app.command(name="start-sets")
def start_sets(
    *scene: str,
    sets: Annotated[str, Parameter(help="seeds of the scenes: start sets, such as 0-9")] = "0-9",
    limit: Annotated[float, Parameter(help="seconds for each plan and each bound")] = 60.0,
    option: Annotated[
        list[str] | None, Parameter(negative="", help="NAME=VALUE, as of cocap-opt export")
    ] = None,
    out: Out = None,
) -> int:
    """Measure planners over start sets, as Greedy Perspectives' Table II, and their plan and ours.

    Runs that are in the folder already are not measured again; those with another limit or
    other options are replaced. Their plan is compared where peer_paths.csv and
    peer_reward.csv lie beside the scene's seq.yaml.

    Example: cocap-opt study start-sets seq.yaml --sets 0-9 --out tables
    """
    from cocap_opt.experiments.studies.benchmarks.start_sets import start_sets as measure

    if not scene:
        raise FileError("SCENE: name at least one, such as a seq.yaml")
    _require_positive(limit)
    options = values("--option", option or [])
    return 0 if measure(scene, numbers("--sets", sets), limit, options, out) else 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns 0, 1 where a row or a run failed, or 2 for wrong input."""
    return run_app(app, arguments)


def _require_positive(limit: float) -> None:
    if not (limit > 0 and math.isfinite(limit)):
        raise FileError(f"--limit: must be positive, not {limit:g}")


if __name__ == "__main__":
    sys.exit(main())
