"""The commands of `cocap-opt study`: the project's own measurements. Each imports its work late."""

import math
from pathlib import Path
from typing import Annotated

from cyclopts import App, Parameter

from cocap_opt.files.documents import FileError
from cocap_opt.run.options import Option

app = App(
    name="study",
    help="Measure again what the project says of itself.",
    help_format="markdown",  # plain text is shown with the line breaks of the source
    version_flags=[],
)
_Out = Annotated[Path | None, Parameter(help="folder for the results")]
_Scenes = Annotated[
    list[str] | None, Parameter(negative="", consume_multiple=True, help="scenes or files")
]
_Seeds = Annotated[str | None, Parameter(help="such as 0-4; without it, each row has its own")]
_Workers = Annotated[
    int | None, Parameter(help="processes, each on a core of its own; this one if not given")
]
_STORM = 30.0  # m/s, beyond which nobody flies
_INTERRUPTED = 130  # exit code after Ctrl-C


@app.command(name="paper")
def _paper(
    *,
    out: Annotated[Path, Parameter(help="folder for tables, figures, plans and certificates")],
    seeds: Annotated[str, Parameter(help="of each scene")] = "0-29",
    robots: Annotated[str, Parameter(help="team sizes of the scaling experiment")] = "2,4,6,8,12",
    scaling_seeds: Annotated[str, Parameter(help="of each team size")] = "0-4",
    time_limit: Annotated[float, Parameter(help="seconds for each plan")] = 60.0,
    bound_limit: Annotated[float, Parameter(help="seconds for each bound")] = 60.0,
    corridors: Annotated[
        int, Parameter(help="drawn at random in the search for where CoCap gains most")
    ] = 200,
    workers: _Workers = None,
    stored: Annotated[
        bool, Parameter(negative="", help="compute nothing: write the page of the stored results")
    ] = False,
) -> int:
    """Reproduce the paper's experiments over many seeds, and answer its claims with bounds.

    It makes a verdict in sentences, reward curves, tables, an ablation, a search for where CoCap
    gains most, the test of giving way, and scaling. What is in the folder already is not computed
    again.

    Example: cocap-opt study paper --out paper --seeds 0-9
    """
    from cocap_opt.experiments.lab.studies.paper.conditions import Search
    from cocap_opt.experiments.lab.studies.paper.reproduction import reproduce, write_stored_page

    if stored:
        write_stored_page(out)
        return 0
    _require_positive("--time-limit", time_limit)
    _require_positive("--bound-limit", bound_limit)
    Option("--workers").require_cores(workers)
    sizes = Option("--robots").numbers(robots)
    if min(sizes) < 1:
        raise FileError(f"--robots: must be at least 1, not {min(sizes)}")
    fine = reproduce(
        out, Option("--seeds").numbers(seeds), sizes,
        Option("--scaling-seeds").numbers(scaling_seeds), time_limit, bound_limit,
        Search.of(Option("--corridors").require_whole(corridors)), workers,
    )  # fmt: skip
    return 0 if fine else 1


@app.command(name="planners")
def _planners(
    *,
    paper: Annotated[
        Path | None, Parameter(help="folder of `study paper`; the stored results if not given")
    ] = None,
) -> int:
    """Print the table of planners: what each takes and promises, its measured gap and time.

    Example: cocap-opt study planners --paper paper
    """
    from cocap_opt.experiments.lab.studies.paper.measured import MEASURED
    from cocap_opt.experiments.lab.studies.paper.planner_table import planners_in_markdown
    from cocap_opt.output.printing import print_texts

    print_texts([planners_in_markdown(None if paper is None else paper / MEASURED)], [])
    return 0


@app.command(name="quote")
def _quote(
    name: Annotated[str | None, Parameter(help="what is quoted; without it, all names")] = None,
    /,
    *,
    into: Annotated[
        Path | None, Parameter(help="Markdown file in which all that is quoted is replaced")
    ] = None,
) -> int:
    """Print a number, a sentence or a table of the stored results, as the documentation quotes it.

    With --into it writes them between the marks of a file.

    Example: cocap-opt study quote --into README.md
    """
    from cocap_opt.experiments.lab.studies.quotes import QUOTES, quote, requote
    from cocap_opt.output.printing import print_texts

    if into is not None:
        requote(into)
    else:
        print_texts(["\n".join(QUOTES) if name is None else quote(name)], [])
    return 0


@app.command(name="others")
def _others(
    folder: Annotated[
        Path, Parameter(help="with scenes of Greedy Perspectives or of Hughes et al., however deep")
    ],
    /,
    *,
    planner: Annotated[
        list[str] | None,
        Parameter(negative="", consume_multiple=True, help="ours; cocap-lns and cocap if none"),
    ] = None,
    sets: Annotated[
        str | None, Parameter(help="start sets of Greedy Perspectives, such as 0-9; all if none")
    ] = None,
    limit: Annotated[float, Parameter(help="seconds for each plan and each bound")] = 60.0,
    workers: _Workers = None,
    out: _Out = None,
) -> int:
    """Set published plans of other projects against ours, with certified bounds.

    FOLDER holds scenes of Greedy Perspectives (seq.yaml, starts.csv, peer_paths.csv) or of Hughes
    et al. (NAME_data.json or scene.json, solutions, ppa_evaluation.csv), in folders as they are
    published. All plans are judged by one evaluator. What is in --out already is not computed
    again.

    Example: cocap-opt study others greedy_perspectives --limit 30 --out others
    """
    from cocap_opt.experiments.lab.studies.others.others import others
    from cocap_opt.run.engine import SOLVERS

    _require_positive("--limit", limit)
    Option("--workers").require_cores(workers)
    if unknown := [name for name in planner or [] if name not in SOLVERS]:
        raise FileError(f"--planner: must be among {', '.join(SOLVERS)}, not {unknown[0]!r}")
    wanted = None if sets is None else Option("--sets").numbers(sets)
    return 0 if others(folder, planner or [], wanted, limit, workers, out) else _INTERRUPTED


@app.command(name="growth")
def _growth(
    *,
    robots: Annotated[str, Parameter(help="numbers of drones")] = "2,4,8,16,32,64",
    steps: Annotated[str, Parameter(help="numbers of steps")] = "8,16,32,64,80",
    cells: Annotated[str, Parameter(help="along each edge")] = "15,30,48,64,96",
    seeds: Annotated[str, Parameter(help="medians are taken over them")] = "0-4",
    limit: Annotated[float, Parameter(help="seconds for each run")] = 60.0,
    out: _Out = None,
) -> int:
    """Measure how column generation grows with drones, steps and cells.

    Example: cocap-opt study growth --seeds 0 --limit 20 --out growth
    """
    from cocap_opt.experiments.lab.studies.growth.growth import growth

    _require_positive("--limit", limit)
    sizes = {
        "robots": Option("--robots").numbers(robots),
        "steps": Option("--steps").numbers(steps),
        "cells": Option("--cells").numbers(cells),
    }
    return 0 if growth(sizes, Option("--seeds").numbers(seeds), limit, out) else 1


@app.command(name="views")
def _views(
    *,
    scene: _Scenes = None,
    poses: Annotated[int, Parameter(help="random poses in each scene")] = 1000,
    out: _Out = None,
) -> int:
    """Measure planned against rendered coverage.

    Example: cocap-opt study views --scene corridor --poses 100 --out views
    """
    from cocap_opt.experiments.lab.studies.views import views

    views(scene or ["corridor", "bottleneck", "passage"], poses, out)
    return 0


@app.command(name="solvers")
def _solvers(
    *,
    rows: Annotated[
        list[str] | None,
        Parameter(
            consume_multiple=True,
            negative="",
            help="which of corridor, bottleneck, passage, large, field, field-long, field-large, "
            "relaxations, cone-program, milp, milp-with-our-root; without it, all: hours",
        ),
    ] = None,
    seeds: _Seeds = None,
    limit: Annotated[
        float | None,
        Parameter(help="seconds: cuts the rows' limits short, and sets that of the comparisons"),
    ] = None,
    large: Annotated[
        Path | None, Parameter(help="seq.yaml of Greedy Perspectives' scene `large`")
    ] = None,
    out: _Out = None,
) -> int:
    """Measure bounds and exact methods beside their targets and generic solvers.

    Seconds are of processor time, on one thread.

    Example: cocap-opt study solvers --rows corridor cone-program --limit 20
    """
    from cocap_opt.experiments.lab.studies.solvers.rows import Options
    from cocap_opt.experiments.lab.studies.solvers.table import solvers

    wanted = None if seeds is None else Option("--seeds").numbers(seeds)
    if limit is not None:
        _require_positive("--limit", limit)
    return 0 if solvers(rows or [], Options(wanted, limit, large), out) else 1


@app.command(name="steps")
def _steps(
    *,
    steps: Annotated[str, Parameter(help="after which the corridor is cut off")] = "1-8",
    seeds: Annotated[str, Parameter(help="of the corridor")] = "0-4",
    limit: Annotated[float, Parameter(help="seconds for each run")] = 5.0,
    out: Annotated[Path, Parameter(help="folder for solvers.csv and solvers.png")],
) -> int:
    """Measure exact methods against the number of steps: time and bound.

    HiGHS, SCIP, CP-SAT and nonlinear SCIP each have the whole instance as one integer program;
    beside them are joint value iteration, brute force and branch-and-price. About a quarter of an
    hour. The notebook solvers_compared draws what is stored of it.

    Example: cocap-opt study steps --steps 1-4 --seeds 0 --out steps
    """
    from cocap_opt.experiments.lab.studies.steps import steps as measure

    _require_positive("--limit", limit)
    horizons = Option("--steps").numbers(steps)
    if min(horizons) < 1:
        raise FileError(f"--steps: must be at least 1, not {min(horizons)}")
    return 0 if measure(sorted(horizons), Option("--seeds").numbers(seeds), limit, out) else 1


@app.command(name="coverage")
def _coverage(
    *,
    robots: Annotated[str, Parameter(help="how many, spread over the map")] = "2,6",
    steps: Annotated[int, Parameter(help="horizon T")] = 60,
    out: _Out = None,
) -> int:
    """Measure the cost of coverage on maps of 120 x 120 cells.

    Example: cocap-opt study coverage --robots 2 --steps 10
    """
    from cocap_opt.experiments.lab.studies.coverage.coverage import coverage

    coverage(Option("--robots").numbers(robots), steps, out)
    return 0


@app.command(name="gamma")
def _gamma(
    *,
    scene: _Scenes = None,
    seeds: Annotated[str, Parameter(help="of each scene")] = "0-4",
    limit: Annotated[float, Parameter(help="seconds for each run")] = 60.0,
    out: _Out = None,
) -> int:
    """Measure the discount of view search: rewards kept and views saved.

    Example: cocap-opt study gamma --scene corridor --seeds 0-1
    """
    from cocap_opt.experiments.lab.studies.gamma import gamma

    _require_positive("--limit", limit)
    gamma(scene or ["corridor", "bottleneck"], Option("--seeds").numbers(seeds), limit, out)
    return 0


@app.command(name="lazy")
def _lazy(
    *,
    scene: _Scenes = None,
    seeds: Annotated[str, Parameter(help="of each scene")] = "0",
    out: _Out = None,
) -> int:
    """Measure lazy value iteration: views, rewards and time against all coverage.

    Without scenes it takes some with cheap views and some with dear ones, which takes minutes.

    Example: cocap-opt study lazy --scene corridor bridge --seeds 0
    """
    from cocap_opt.experiments.lab.studies.lazy import ALL, lazy

    lazy(scene or ALL, Option("--seeds").numbers(seeds), out)
    return 0


@app.command(name="separation")
def _separation(
    *,
    scene: _Scenes = None,
    seeds: Annotated[str, Parameter(help="of each scene")] = "0-2",
    metres: Annotated[
        list[float] | None,
        Parameter(
            negative="", consume_multiple=True, help="separations; 0.5, 1, 2, 3 if not given"
        ),
    ] = None,
    limit: Annotated[float, Parameter(help="seconds for each plan and each proof")] = 60.0,
    out: _Out = None,
    stored: Annotated[
        bool, Parameter(negative="", help="compute nothing: tables and figure of the stored runs")
    ] = False,
) -> int:
    """Measure what it costs that drones keep apart at every moment, certified.

    Example: cocap-opt study separation --scene corridor --seeds 0 --metres 1 2 --limit 20
    """
    from cocap_opt.experiments.lab.studies.separation.separation import separation, tell_stored

    if stored:
        tell_stored(out)
        return 0
    _require_positive("--limit", limit)
    wanted = metres or [0.5, 1.0, 2.0, 3.0]
    if not all(apart > 0 and math.isfinite(apart) for apart in wanted):
        raise FileError("--metres: must be positive numbers")
    scenes = scene or [
        "corridor", "corridor-tight", "bottleneck", "bottleneck-tight", "passage", "field",
    ]  # fmt: skip
    seeds_ = Option("--seeds").numbers(seeds)
    return 0 if separation(scenes, seeds_, wanted, limit, out) else 1


@app.command(name="flight")
def _flight(
    *scenes: Annotated[str, Parameter(help="scenes or recipes; bridge and passage if none")],
    seeds: Annotated[str, Parameter(help="of each scene, of the wind's gusts, too")] = "0-2",
    wind: Annotated[
        list[float] | None,
        Parameter(negative="", consume_multiple=True, help="m/s; 0, 5 and 10 if not given"),
    ] = None,
    step: Annotated[
        float | None,
        Parameter(help="seconds of a step, of scenes that do not say it; else as PX4's limits ask"),
    ] = None,
    out: _Out = None,
    stored: Annotated[
        bool, Parameter(negative="", help="simulate nothing: take the stored results")
    ] = False,
) -> int:
    """Fly plans in RotorPy, a simulator by others: errors, distances, and J of what is filmed.

    Smooth and straight flights, in still air and in wind. It needs the extra `flight`, and a
    quarter of an hour without scenes; what is stored needs neither.

    Example: cocap-opt study flight bridge --seeds 0 --wind 0 --out flown
    """
    from cocap_opt.experiments.lab.stored_results import STORED
    from cocap_opt.experiments.lab.studies.flight.flight import SCENES, TABLE, flight, tell
    from cocap_opt.experiments.lab.studies.flight.runs import Run

    winds = [0.0, 5.0, 10.0] if wind is None else wind
    if not all(0 <= speed <= _STORM for speed in winds):
        raise FileError(f"--wind: must be 0..{_STORM:g} m/s")
    if step is not None:
        _require_positive("--step", step)
    chosen = Option("--seeds").numbers(seeds)
    if stored and scenes:
        raise FileError(
            "--stored: must be given without scenes, for it takes those that are stored"
        )
    runs = (
        Run.read(STORED / TABLE) if stored else flight(scenes or SCENES, chosen, winds, step, out)
    )
    tell(runs, out)
    return 0


@app.command(name="peers")
def _peers(
    scene: Annotated[Path, Parameter(help="their seq.yaml")],
    coverage: Annotated[Path, Parameter(help="their CSV of pixels")],
    /,
    *,
    states: Annotated[int, Parameter(help="how many random ones are compared")] = 500,
) -> int:
    """Compare coverage with the pixels that Greedy Perspectives' program rendered.

    Example: cocap-opt study peers seq.yaml peer_coverage.csv
    """
    from cocap_opt.experiments.lab.studies.coverage.peers import peers

    peers(scene, coverage, states)
    return 0


@app.command(name="speed")
def _speed(*, out: _Out = None) -> int:
    """Measure the speed of coverage, planners and the command line.

    Example: cocap-opt study speed --out speed
    """
    from cocap_opt.experiments.lab.studies.speed import speed

    speed(out)
    return 0


@app.command(name="pictures")
def _pictures(folder: Annotated[Path, Parameter(help="folder for the pictures")], /) -> int:
    """Draw all pictures of README and pages; those of the player need Chromium.

    Example: cocap-opt study pictures pictures
    """
    from cocap_opt.experiments.lab.studies.drawings import write_drawings

    write_drawings(folder)
    try:
        from cocap_opt.experiments.lab.studies.pictures import write_pictures
    except ModuleNotFoundError as error:
        raise FileError(f"{error.name} is not installed: pip install -e '.[test]'") from error
    try:
        write_pictures(folder)
    except FileNotFoundError as error:
        raise FileError(f"player.png: {error}") from error
    return 0


@app.command(name="frames")
def _frames(
    scene: Annotated[str, Parameter(help="built-in scene")] = "field-large",
    *,
    planner: Annotated[str, Parameter(help="of the plan that is played")] = "greedy",
) -> int:
    """Measure how fast the player draws a plan; needs Chromium.

    Example: cocap-opt study frames field --planner cocap-lns
    """
    try:
        from cocap_opt.experiments.lab.studies.frames import frames
    except ModuleNotFoundError as error:
        raise FileError(f"{error.name} is not installed: pip install -e '.[test]'") from error
    try:
        frames(scene, planner)
    except FileNotFoundError as error:
        raise FileError(f"frames: {error}") from error
    return 0


@app.command(name="notebooks")
def _notebooks(
    *names: Annotated[str, Parameter(help="such as first_tour; all if none is given")],
) -> int:
    """Run the project's notebooks from start to end and store them with their outputs.

    A notebook of which a cell fails is left as it is.

    Example: cocap-opt study notebooks first_tour
    """
    try:
        from cocap_opt.experiments.lab.studies.notebooks import Notebook
    except ModuleNotFoundError as error:
        raise FileError(f"{error.name} is not installed: pip install -e '.[notebooks]'") from error

    Notebook.store_all(names)
    return 0


def _require_positive(option: str, seconds: float) -> None:
    if not (seconds > 0 and math.isfinite(seconds)):
        raise FileError(f"{option}: must be a positive number of seconds, not {seconds:g}")
