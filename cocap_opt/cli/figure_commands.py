"""The commands of `cocap-opt figure`: charts for papers, as PNG, PDF or SVG."""

import os
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter
from matplotlib.figure import Figure

from cocap_opt.cli.options import (
    Json,
    OfPlanners,
    OfScenes,
    Output,
    PlanPath,
    Results,
    Scene,
    Seed,
    chosen,
    load_planned,
)
from cocap_opt.console.usage import set_usages
from cocap_opt.experiments.report.charts import conflicts_figure, gaps_figure, progress_figure
from cocap_opt.experiments.report.profiles import profiles_figure
from cocap_opt.experiments.report.teams import teams_figure
from cocap_opt.experiments.sweeps.results import load_results
from cocap_opt.experiments.tables.comparison import profiles
from cocap_opt.experiments.tables.comparison_tables import profile_records
from cocap_opt.experiments.tables.layout import TRACES
from cocap_opt.experiments.tables.teams import load_teams
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import PlanReader, check_output, save_bytes, save_csv
from cocap_opt.output.trace import Trace
from cocap_opt.pictures.figures import PICTURES, picture
from cocap_opt.run.options import Option, OutputFile, UsageError

app = App(name="figure", help="Draw charts of results, as PNG, PDF or SVG.", version_flags=[])


_Trace = Annotated[Path, Parameter(help="file written by `solve --trace`, or folder of a sweep")]


@app.command(name="gaps")
def _gaps(
    folder: Results,
    /,
    *,
    output: Output,
    scene: OfScenes = None,
    planner: OfPlanners = None,
    json: Json = False,
) -> int:
    """Draw the gaps of a sweep's planners: a stroke per seed, mean and 95 % interval.

    Example: cocap-opt figure gaps results -o gaps.pdf
    """
    file = _checked(output)
    return _save(file, gaps_figure(chosen(load_results(folder), scene, planner)), json)


@app.command(name="profiles")
def _profiles(
    folder: Results,
    /,
    *,
    output: Output,
    scene: OfScenes = None,
    planner: OfPlanners = None,
    json: Json = False,
) -> int:
    """Draw performance profiles of a sweep: how near the best each planner is, and how often.

    A file that ends in .csv gets the steps of the staircases as numbers.

    Example: cocap-opt figure profiles results -o profiles.pdf
    """
    file = _checked(output, (*PICTURES, ".csv"))
    found = profiles(chosen(load_results(folder), scene, planner))
    if not found:
        raise UsageError(f"{folder}: has no scene and seed that all of its planners were run on")
    if file.ending != ".csv":
        return _save(file, profiles_figure(found), json)
    save_csv(file.path, profile_records(found))
    print_result({"file": file.path}, json)
    return 0


@app.command(name="teams")
def _teams(
    folder: Annotated[Path, Parameter(help="results folder, written by `team --out`")],
    /,
    *,
    output: Output,
    share: Annotated[
        float | None, Parameter(help="share of person-steps to reach, drawn as a line")
    ] = None,
    json: Json = False,
) -> int:
    """Draw J and the share of person-steps seen, by the number of drones.

    Example: cocap-opt figure teams teams -o teams.pdf
    """
    file = _checked(output)
    if share is not None:
        Option("--share").require_part(share)
    return _save(file, teams_figure(load_teams(folder), share), json)


@app.command(name="progress")
def _progress(*trace: _Trace, output: Output, json: Json = False) -> int:
    """Draw the gap of solver runs over time, from files written by --trace, or from a sweep.

    If you pass the folder of a sweep, all its traces are drawn.

    Example: cocap-opt figure progress trace.csv -o progress.pdf
    """
    file = _checked(output)
    if not trace:
        raise UsageError("TRACE: name a file written by `solve --trace`")
    paths = [path for given in trace for path in _traces(given)]
    traces = [Trace.load(path) for path in paths]
    return _save(
        file, progress_figure(dict(zip(PlanReader.titles(paths), traces, strict=True))), json
    )


def _traces(path: Path) -> list[Path]:
    """Returns the traces of a sweep's folder, or the given file."""
    if not os.path.isdir(path):
        return [path]
    found = sorted((path / TRACES).glob("*.csv"))
    if not found:
        raise UsageError(f"{path}: has no traces of a sweep")
    return found


@app.command(name="conflicts")
def _conflicts(
    scene: Scene, /, *plan: PlanPath, output: Output, seed: Seed = 0, json: Json = False
) -> int:  # fmt: skip
    """Draw which drones collide at which step, in one or more plans.

    Example: cocap-opt figure conflicts bottleneck greedy.json cocap.json -o conflicts.pdf
    """
    file = _checked(output)
    if not plan:
        raise UsageError("PLAN: name a plan, such as plan.json")
    given = PlanReader(scene, load_planned(scene, seed)).plans(plan)
    plans = [given_plan.plan for given_plan in given]
    return _save(
        file,
        conflicts_figure(given[0].problem, dict(zip(PlanReader.titles(plan), plans, strict=True))),
        json,
    )


def _checked(output: Path | None, endings: tuple[str, ...] = PICTURES) -> OutputFile:
    file = Option("-o").file(output, endings)
    check_output(file.path)
    return file


def _save(file: OutputFile, figure: Figure, json: bool) -> int:
    save_bytes(file.path, picture(figure, file.ending))
    print_result({"file": file.path}, json)
    return 0


set_usages(app, "cocap-opt figure")
