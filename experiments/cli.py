"""The command line, `cocap-opt`.

Results go to standard output, as a table or with --json as one JSON object and nothing
else; progress and messages go to standard error. Exit codes: 0 done (also when there is no
plan: that is a result), 1 a claim does not hold (verify), 2 wrong input.
"""

import logging
import math
import os
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, CycloptsError, Parameter

from cocap_opt.cache import write_atomically
from cocap_opt.check import check
from cocap_opt.io import FileError, encode, save_problem
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem, ProblemError
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.stop import Limit, catch_interrupt
from experiments.claims import conclude, verify_certificate, verify_plan
from experiments.files import check_output, make_folder, read_claim, read_plan, save_plan, write
from experiments.gap_table import gap_cell, save_rows, told_apart
from experiments.printing import (
    coverage_progress,
    print_gap_table,
    print_json,
    print_result,
    print_table,
    progress_bar,
)
from experiments.report import (
    SOLVERS,
    Row,
    bound_row,
    default_planners,
    mean_table,
    plan_row,
    run_bound,
    run_planner,
)
from formulations import BOUNDS
from formulations.certificate import CertificateFile
from scenarios import FORMATS, SCENES, load_scene, scene_of_plan

DEFAULT_SECONDS = 60.0
MOST_SEEDS = 100_000

app = App(
    name="cocap-opt",
    help="Plan the views of several camera drones, and prove how good the plans are.",
    help_format="plaintext",
    version_flags=[],
)
Seed = Annotated[int, Parameter(help="seed of the scene, >= 0")]
Seconds = Annotated[float, Parameter(name="--time-limit", help="seconds for each computation")]
Json = Annotated[bool, Parameter(name="--json", negative="", help="print one JSON object")]
Output = Annotated[Path | None, Parameter(name=["-o", "--output"], help="file to write")]


class UsageError(ValueError):
    """An option has a value that is not allowed; the message names it."""


@app.command
def scenes(*, json: Json = False) -> int:
    """List the built-in scenes and the file formats that can be read.

    Example: cocap-opt scenes
    """
    rows = [{"scene": name, "about": _first_line(build)} for name, build in SCENES.items()]
    formats = [{"format": name, "about": f.description} for name, f in FORMATS.items()]
    if json:
        print_json({"scenes": rows, "formats": formats})
    else:
        print_table("built-in scenes", rows)
        print_table("files that can be read in place of a scene's name", formats)
    return 0


@app.command
def export(scene: str, /, *, output: Output, seed: Seed = 0, json: Json = False) -> int:
    """Write any scene as a cocap-opt scene file.

    Example: cocap-opt export corridor --seed 3 -o corridor-3.json
    """
    if output is None:
        raise UsageError("-o: name the file to write")
    check_output(output)
    problem = _load(scene, seed)
    write(output, lambda: save_problem(output, problem))
    print_result({"scene": problem.name, "seed": seed, "file": str(output)}, json)
    return 0


@app.command
def plan(
    scene: str,
    /,
    *,
    planner: Annotated[str, Parameter(help=f"one of {', '.join(SOLVERS)}")] = "cocap",
    seed: Seed = 0,
    time_limit: Seconds = DEFAULT_SECONDS,
    output: Output = None,
    json: Json = False,
) -> int:
    """Plan a scene, have the plan checked, and write it to a file.

    Example: cocap-opt plan corridor --planner cocap --seed 0 -o plan.json
    """
    _choose("--planner", planner, SOLVERS)
    _positive("--time-limit", time_limit)
    check_output(output)
    problem = _load(scene, seed)
    with catch_interrupt() as interrupt, coverage_progress(problem):
        judged = run_planner(problem, planner, time_limit, interrupt)
    if judged.result.reason is Reason.UNSUPPORTED:
        raise UsageError(f"--planner: {judged.result.message}")
    written = None
    if output is not None and judged.result.plan is not None:
        save_plan(output, problem, planner, judged)
        written = str(output)
    row = plan_row(problem, seed, planner, judged)
    row |= {"file": written, **judged.result.statistics}
    if output is not None and written is None:
        row["message"] += f"; {output} was not written"
    if judged.verdict:
        row["reward_at_start"] = judged.verdict.reward_at_start
        row["reward_per_step"] = judged.verdict.reward_per_step
        row["violations"] = judged.verdict.conflicts
    print_result(row, json)
    return 0


@app.command
def bound(
    scene: str,
    /,
    *,
    method: Annotated[str, Parameter(help=f"one of {', '.join(BOUNDS)}")] = "column-generation",
    seed: Seed = 0,
    plan: Annotated[Path | None, Parameter(help="a plan to start from")] = None,
    time_limit: Seconds = DEFAULT_SECONDS,
    output: Output = None,
    json: Json = False,
) -> int:
    """Compute an upper bound on J and the certificate that proves it.

    Example: cocap-opt bound corridor --seed 0 -o certificate.json
    """
    _choose("--method", method, BOUNDS)
    _positive("--time-limit", time_limit)
    check_output(output)
    problem, start = _load(scene, seed), None
    if plan is not None:
        problem, start = read_plan(plan, scene, problem)
    with catch_interrupt() as interrupt, coverage_progress(problem):
        try:
            result = run_bound(problem, method, time_limit, interrupt, start)
        except UnsupportedError as error:
            raise UsageError(f"--method {method}: {error}") from error
    certificate, written = result.certificate, None
    if output is not None and certificate is not None:
        write(output, lambda: write_atomically(output, encode(certificate)))
        written = str(output)
    print_result(bound_row(problem, seed, result) | {"file": written}, json)
    return 0


@app.command(name="verify")
def verify_files(
    scene: str,
    plan: Path,
    certificate: Path | None = None,
    /,
    *,
    seed: Seed = 0,
    json: Json = False,
) -> int:
    """Check a plan and, if given, a certificate, trusting nobody: exit 0 only if all claims hold.

    The plan may also be in a scene format's own plan format. A certificate alone may stand
    in place of the plan.

    Example: cocap-opt verify corridor plan.json certificate.json --seed 0
    """
    problem = _load(scene, seed)
    answer: Row = {"scene": problem.name, "seed": seed, "valid": True, "violations": []}
    for path in (plan, certificate):
        if path is None:
            continue
        content = read_claim(path, problem)
        if isinstance(content, Plan):
            fitting = scene_of_plan(scene, problem, content)
            if fitting is not problem:
                problem = fitting
                answer |= {"seed": None, "starts": "those in the scene's own file"}
        if isinstance(content, CertificateFile):
            verify_certificate(problem, content, answer)
        elif path is certificate:
            raise FileError(f"{path}: must be a certificate, not a plan")
        else:
            verify_plan(problem, content, answer)
    conclude(answer)
    print_result(answer, json)
    return 0 if answer["valid"] else 1


@app.command
def gap(
    *scene: str,
    planner: Annotated[
        list[str] | None,
        Parameter(negative="", help=f"may be repeated; one of {', '.join(SOLVERS)}"),
    ] = None,
    seeds: Annotated[str, Parameter(help="e.g. 0-9 or 0,3,7")] = "0",
    time_limit: Seconds = DEFAULT_SECONDS,
    out_: Annotated[Path | None, Parameter(name="--out", help="folder for results.csv, plans and "
                                           "certificates")] = None,
    json: Json = False,
) -> int:  # fmt: skip
    """Print the gap table: every planner's J against a certified upper bound.

    Example: cocap-opt gap corridor bottleneck --seeds 0-9 --out results
    """
    if not scene:
        raise UsageError("SCENE: name at least one scene; `cocap-opt scenes` lists them")
    for name in planner or []:
        _choose("--planner", name, SOLVERS)
    _positive("--time-limit", time_limit)
    cells = list(dict.fromkeys((name, seed) for name in scene for seed in _parse_seeds(seeds)))
    problems = told_apart({(name, seed): _load(name, seed) for name, seed in cells})
    make_folder(out_)
    rows: list[Row] = []
    with catch_interrupt() as interrupt, progress_bar() as progress:
        task = progress.add_task("gap", total=len(cells))
        for name, seed in cells:
            progress.update(task, description=f"{name} seed {seed}")
            problem = problems[name, seed]
            rows += gap_cell(problem, seed, planner or default_planners(problem), time_limit,
                              interrupt, out_)  # fmt: skip
            progress.advance(task)
            if interrupt() is not Limit.NONE:
                break
    if out_ is not None:
        save_rows(out_ / "results.csv", rows)
    if json:
        print_json({"rows": rows})
    else:
        print_gap_table(rows)
        if len(rows) > len(mean_table(rows)):
            print_table("means over seeds", mean_table(rows))
    return 0


@app.command
def show(
    scene: str, plan: Path, /, *, output: Output, seed: Seed = 0, json: Json = False
) -> int:  # fmt: skip
    """Draw a plan from above: a PNG of its last step, or a GIF of all steps.

    Example: cocap-opt show corridor plan.json -o plan.gif
    """
    from experiments.figures import gif, plan_figure, png  # matplotlib is slow to import

    if output is None or output.suffix.lower() not in (".png", ".gif"):
        raise UsageError("-o: name a file that ends in .png or .gif")
    check_output(output)
    problem = _load(scene, seed)
    problem, shown = read_plan(plan, scene, problem)
    verdict = check(problem, shown)
    steps = range(problem.horizon + 1)
    if output.suffix.lower() == ".gif":
        picture = gif([plan_figure(problem, shown, verdict, t) for t in steps])
    else:
        picture = png(plan_figure(problem, shown, verdict, problem.horizon))
    write(output, lambda: write_atomically(output, picture))
    print_result({"scene": problem.name, "seed": seed, "file": str(output)}, json)
    return 0


# -- reading options ----------------------------------------------------------------------


def _load(scene: str, seed: int) -> Problem:
    if seed < 0:
        raise UsageError(f"--seed: must be >= 0, not {seed}")
    return load_scene(scene, seed)


def _choose(option: str, value: str, allowed: Any) -> None:
    if value not in allowed:
        raise UsageError(f"{option}: must be one of {', '.join(allowed)}, not {value!r}")


def _positive(option: str, value: float) -> None:
    if not (value >= 0 and math.isfinite(value)):
        raise UsageError(f"{option}: must be a finite number of seconds >= 0, not {value}")


def _parse_seeds(text: str) -> list[int]:
    """Seeds of a list of numbers and ranges, "0-9,12"."""
    seeds: list[int] = []
    for part in text.split(","):
        first, dash, last = part.partition("-")
        if not (first.isdecimal() and (last.isdecimal() or not dash)):
            raise UsageError(f"--seeds: must be numbers and ranges such as 0-9,12, not {text!r}")
        wanted = range(int(first), int(last or first) + 1)
        if len(seeds) + len(wanted) > MOST_SEEDS:
            raise UsageError(f"--seeds: must be at most {MOST_SEEDS} seeds")
        seeds += wanted
    if not seeds:
        raise UsageError(f"--seeds: {text!r} holds no seed")
    return seeds


def _first_line(build: Callable[..., Problem]) -> str:
    return (build.__doc__ or "").strip().splitlines()[0]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit."""
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING, format="cocap-opt: %(message)s")
    if sys.stdout is None:  # closed by the caller: results go nowhere, files are still written
        sys.stdout = open(os.devnull, "w")  # noqa: SIM115 (open until the process ends)
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
    except CycloptsError as error:
        code = _refuse(str(error))
    except (UsageError, FileError, ProblemError) as error:
        code = _refuse(str(error))
    except BrokenPipeError:
        # The reader of our output has gone, as with `| head`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except OSError as error:  # files name themselves; what is left is the output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = _refuse(f"standard output: cannot be written: {error.strerror}")
    except MemoryError:
        code = _refuse("out of memory: the scene is too large for this method")
    except KeyboardInterrupt:  # a second Ctrl-C, or one before there was anything to give
        code = _refuse("interrupted", code=130)
    sys.exit(code or 0)


def _refuse(message: str, code: int = 2) -> int:
    sys.stderr.write("cocap-opt: " + " ".join(message.split()) + "\n")
    return code
