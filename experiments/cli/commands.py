"""The commands of `cocap-opt`: reading options, doing the work, printing, writing files."""

import logging
import math
import os
import sys
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, NamedTuple

import msgspec
from cyclopts import App, CycloptsError, Parameter

from cocap_opt.data import ProblemError
from cocap_opt.experiments.cli.gap_command import gap
from cocap_opt.experiments.cli.options import (
    DEFAULT_SECONDS,
    OWN_STARTS,
    Json,
    Output,
    Seconds,
    Seed,
    UsageError,
    angles,
    choose,
    load,
    positive,
)
from cocap_opt.experiments.cli.picture_commands import render, show
from cocap_opt.experiments.cli.result_commands import report, table
from cocap_opt.experiments.console.numbers import values
from cocap_opt.experiments.console.progress import watching
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.results.claims import conclude, reward_parts, verify_bound, verify_plan
from cocap_opt.experiments.results.files import (
    check_output,
    plan_file,
    read_claim,
    read_plan,
    save_bytes,
    save_together,
    write,
)
from cocap_opt.experiments.results.gap_table import Limits
from cocap_opt.experiments.results.printing import path_text, print_json, print_result, print_table
from cocap_opt.experiments.results.rows import (
    SOLVERS,
    Judged,
    Row,
    certified_row,
    plan_row,
    run_certified,
    run_planner,
    without_rules,
)
from cocap_opt.experiments.results.trace import Trace, both, trace_text
from cocap_opt.experiments.sweeps.crew import ClusterError
from cocap_opt.files.documents import FileError, PlanFile, save_problem
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates.certificate import CertificateFile
from cocap_opt.formulations.certificates.proof import ProofFile
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult
from cocap_opt.model import compiled
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.scenarios import FORMATS, SCENES, scene_of_plan
from cocap_opt.scenarios.cameras import CAMERAS, with_camera, with_tilts
from cocap_opt.stop import FirstOf, Limit, Stop, TimeLimit, catch_interrupt

AT_THE_ROOT = "column-generation"  # a bound that comes with a plan
LAZY = ("cocap-vs", "formation", "one-step")  # planners that see only the views they touch
SOLVE_METHODS = (*EXACT, AT_THE_ROOT)

app = App(
    name="cocap-opt",
    help="Plan the views of several camera drones, and prove how good the plans are.",
    help_format="plaintext",
    version=lambda: version("cocap-opt"),
    version_flags=["--version"],
    suppress_keyboard_interrupt=False,
)
Free = Annotated[bool, Parameter(negative="", help="the scene without inter-robot collisions")]
Start = Annotated[Path | None, Parameter(help="file of a plan to start from")]
TraceFile = Annotated[
    Path | None, Parameter(name="--trace", help="CSV to write value and bound over time to")
]


@app.command
def scenes(*, json: Json = False) -> int:
    """List the built-in scenes, the file formats that can be read, their options, and cameras.

    Example: cocap-opt scenes
    """
    rows = [{"scene": name, "about": _first_line(build)} for name, build in SCENES.items()]
    formats = [{"format": name, "about": f.description} for name, f in FORMATS.items()]
    cameras = [
        {
            "camera": name, "width": camera.width, "height": camera.height, "focal": camera.focal,
            "angle of view (deg)": 2 * math.degrees(camera.half_angle),
        }
        for name, camera in CAMERAS.items()
    ]  # fmt: skip
    options = [
        {"option": name, "values": ", ".join(words), "of files": key}
        for key, kind in FORMATS.items() if kind.options is not None
        for name, words in kind.options.allowed.items()
    ]  # fmt: skip
    if json:
        print_json({"scenes": rows, "formats": formats, "cameras": cameras, "options": options})
    else:
        print_table("built-in scenes", rows)
        print_table("files that can be read in place of a scene's name", formats)
        print_table("options of `export`, as in --option triangles=no", options)
        print_table("cameras that `export` can put on a scene's robots (px)", cameras)
    return 0


@app.command
def recipe(*, json: Json = False) -> int:
    """Print a recipe with every table: a scene made of maps, meshes, tracks and drones.

    Example: cocap-opt recipe > scene.toml
    """
    from cocap_opt.scenarios.recipe.recipe import EXAMPLE  # its readers are slow to import

    if json:
        print_json({"recipe": EXAMPLE})
    else:
        sys.stdout.write(EXAMPLE)
    return 0


@app.command
def export(
    scene: str,
    /,
    *,
    output: Output,
    seed: Seed = 0,
    over_time: Annotated[
        bool, Parameter(negative="", help="pixels add up over time as well as over robots")
    ] = False,
    camera: Annotated[
        str | None, Parameter(help="another camera on all robots; `cocap-opt scenes` lists them")
    ] = None,
    tilts: Annotated[
        str | None,
        Parameter(help="degrees below the horizon, such as 10 or, for a gimbal, 10,30,60"),
    ] = None,
    option: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="NAME=VALUE, how a file is read; may be repeated; `cocap-opt scenes` lists them",
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Write any scene as a cocap-opt scene file.

    Example: cocap-opt export corridor --seed 3 -o corridor-3.json
    """
    if output is None:
        raise UsageError("-o: name the file to write")
    check_output(output)
    problem = load(scene, seed, values("--option", option or []))
    if over_time:
        objective = problem.objective.replace(over_time=True)
        problem = problem.replace(name=f"{problem.name}-over-time", objective=objective)
    if camera is not None:
        problem = with_camera(problem, camera)
    if tilts is not None:
        problem = with_tilts(problem, angles("--tilts", tilts))
    write(output, lambda: save_problem(output, problem))
    print_result({"scene": problem.name, "seed": seed, "file": path_text(output)}, json)
    return 0


@app.command
def plan(
    scene: str,
    /,
    *,
    planner: Annotated[str, Parameter(help=f"one of {', '.join(SOLVERS)}")] = "cocap",
    seed: Seed = 0,
    free: Free = False,
    time_limit: Seconds = DEFAULT_SECONDS,
    output: Output = None,
    json: Json = False,
) -> int:
    """Plan a scene, have the plan checked, and write it to a file.

    Example: cocap-opt plan corridor --planner cocap --seed 0 -o plan.json
    """
    choose("--planner", planner, SOLVERS)
    positive("--time-limit", time_limit)
    check_output(output)
    problem = _variant(load(scene, seed), free)
    with catch_interrupt() as interrupt, watching(f"{problem.name} seed {seed}") as watch:
        watch.coverage_of(problem)
        judged = _planned(problem, planner, lambda: FirstOf(interrupt, TimeLimit(time_limit)))
        if judged.result.reason is Reason.UNSUPPORTED:
            raise UsageError(f"--planner: {judged.result.message}")
        row = plan_row(problem, seed, planner, judged) | _freed(free)
        _save(row, _Wanted("file", output, "plan", plan_file(problem, planner, judged)))
    row |= judged.result.statistics
    if judged.verdict:
        row |= reward_parts(judged.verdict)
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
    start: Start = None,
    free: Free = False,
    time_limit: Seconds = DEFAULT_SECONDS,
    output: Output = None,
    trace: TraceFile = None,
    json: Json = False,
) -> int:
    """Compute an upper bound on J and the certificate that proves it.

    Example: cocap-opt bound corridor --seed 0 -o certificate.json
    """
    choose("--method", method, BOUNDS)
    positive("--time-limit", time_limit)
    _check_outputs(**{"-o": output, "--trace": trace})
    task = _Task.read(scene, seed, free, start)
    with catch_interrupt() as interrupt:
        stop = FirstOf(interrupt, TimeLimit(time_limit))
        judged = _certified(task, seed, method, stop, OPTIMALITY, trace)
        row = certified_row(task.problem, seed, method, judged) | task.about
        _save(row, _Wanted("file", output, "certificate", judged.result.certificate))
    print_result({**row, **judged.result.statistics}, json)
    return 0


@app.command
def solve(
    scene: str,
    /,
    *,
    method: Annotated[
        str, Parameter(help=f"one of {', '.join(SOLVE_METHODS)} (bound and plan at the root)")
    ] = "branch-and-price",
    seed: Seed = 0,
    gap: Annotated[
        float,
        Parameter(help=f"(bound - J) / bound to stop at; 0 means {OPTIMALITY:g}, called optimal"),
    ] = 0.0,
    start: Start = None,
    free: Free = False,
    time_limit: Seconds = DEFAULT_SECONDS,
    output: Output = None,
    certificate: Annotated[Path | None, Parameter(help="file to write the proof to")] = None,
    trace: TraceFile = None,
    json: Json = False,
) -> int:
    """Find the best plan and prove that no other is better by more than the gap.

    At the time limit or Ctrl-C it gives the best plan and bound so far.
    `verify` checks the file of --certificate, which proves the bound;
    brute-force has none: its bound is what trying all plans proves.

    Example: cocap-opt solve corridor --seed 0 -o plan.json --certificate proof.json
    """
    choose("--method", method, SOLVE_METHODS)
    if not 0 <= gap < 1:
        raise UsageError(f"--gap: must be at least 0 and less than 1, such as 0.01, not {gap}")
    if gap and method not in EXACT:
        raise UsageError(f"--gap: {method} stops at the root at any gap; leave the option out")
    positive("--time-limit", time_limit)
    _check_outputs(**{"-o": output, "--certificate": certificate, "--trace": trace})
    task = _Task.read(scene, seed, free, start)
    with catch_interrupt() as interrupt:
        stop = FirstOf(interrupt, TimeLimit(time_limit))
        judged = _certified(task, seed, method, stop, max(gap, OPTIMALITY), trace)
        row = certified_row(task.problem, seed, method, judged) | task.about
        _save(
            row,
            _Wanted("file", output, "plan", plan_file(task.problem, method, judged)),
            _Wanted("certificate", certificate, "certificate", judged.result.certificate),
        )
    print_result({**row, **judged.result.statistics}, json)
    return 0


@app.command(name="verify")
def verify_files(
    scene: str,
    /,
    *file: Path,
    seed: Seed = 0,
    free: Free = False,
    json: Json = False,
) -> int:
    """Check a plan, certificates and proofs, trusting nobody: exit 0 only if all claims hold.

    The plan may also be in a scene format's own plan format. Of several
    bounds the lowest is shown.

    Example: cocap-opt verify corridor plan.json certificate.json --seed 0
    """
    if not file:
        raise UsageError("FILE: name a plan, a certificate or a proof")
    claims = _Claims.read(scene, seed, free, file)
    problem = claims.problem
    answer: Row = {"scene": problem.name, "seed": seed, "valid": True, "violations": []}
    answer |= claims.about
    if claims.plan is not None:
        verify_plan(problem, claims.plan, answer)
    for path, content in claims.bounds.items():
        with watching(path_text(path)) as watch:
            verify_bound(
                problem, content, path_text(path), answer,
                lambda done, all_: watch.count("leaf", done, all_),
            )  # fmt: skip
    conclude(answer)
    print_result(answer, json)
    return 0 if answer["valid"] else 1


# -- parts of commands --------------------------------------------------------------------


def _planned(problem: Problem, planner: str, limits: Limits) -> Judged[Result]:
    """Plan; coverage comes before, so that the planner's seconds hold none of it.

    Who has no coverage in time has no time left to plan.
    """
    stop = limits()
    if planner not in LAZY and compiled(problem).prepare_all(stop) is Limit.NONE:
        stop = limits()
    return run_planner(problem, planner, stop)


class _Task(NamedTuple):
    """What `bound` and `solve` work on: with a start, the variant of the scene that it fits."""

    problem: Problem
    start: Plan | None
    about: Row  # keys for the row that is printed

    @classmethod
    def read(cls, scene: str, seed: int, free: bool, path: Path | None) -> "_Task":
        problem, start, about = load(scene, seed), None, _freed(free)
        if path is not None:
            fitting, start = read_plan(path, scene, problem)
            about |= OWN_STARTS if fitting is not problem else {}
            problem = fitting
        return cls(_variant(problem, free), start, about)


class _Claims(NamedTuple):
    """What `verify` checks: with a plan, the variant of the scene that it was made for."""

    problem: Problem
    plan: PlanFile | Plan | None
    bounds: dict[Path, CertificateFile | ProofFile]
    about: Row  # keys for the answer

    @classmethod
    def read(cls, scene: str, seed: int, free: bool, files: Sequence[Path]) -> "_Claims":
        """All files are read, in an order of their own, before any is held against the scene."""
        problem, about = load(scene, seed), _freed(free)
        content: PlanFile | Plan | None = None
        bounds = {}
        for path in sorted(set(files)):
            claim = read_claim(path, problem)
            if isinstance(claim, CertificateFile | ProofFile):
                bounds[path] = claim
            elif content is not None:
                raise FileError(f"{path}: must be a certificate or a proof, not a second plan")
            else:
                content = claim
        if content is not None:
            plan = content.plan if isinstance(content, PlanFile) else content
            fitting = scene_of_plan(scene, problem, plan)
            about |= OWN_STARTS if fitting is not problem else {}
            problem = fitting
        return cls(_variant(problem, free), content, bounds, about)


def _certified(
    task: _Task, seed: int, method: str, stop: Stop, gap: float, path: Path | None
) -> Judged[CertifiedResult]:
    """Run a bound or an exact method, show how far it is, and write that to a file if asked."""
    problem, trace = task.problem, Trace()
    with watching(f"{problem.name} seed {seed}") as watch:
        watch.coverage_of(problem)
        report = both(watch.report(), trace.report)
        try:
            judged = run_certified(problem, method, stop, task.start, report, gap)
        except UnsupportedError as error:
            raise UsageError(f"--method {method}: {error}") from error
    if path is not None:
        trace.end(judged.result)
        save_bytes(path, trace_text(trace).encode())
    return judged


def _check_outputs(**paths: Path | None) -> None:
    """Refuse files that cannot be written, and one file for two things."""
    used: dict[str, str] = {}
    for option, path in paths.items():
        if path is None:
            continue
        check_output(path)
        other = used.setdefault(os.path.realpath(path), option)
        if other != option:
            raise UsageError(f"{option}: must be another file than {other}, not {path}")


class _Wanted(NamedTuple):
    """A file that an option names, and what is to be in it, if there is that."""

    key: str  # of the row, which says where the file is
    path: Path | None
    kind: str
    content: msgspec.Struct | None


def _save(row: Row, *files: _Wanted) -> None:
    """Write the files together; the row says where each is, or that it is not."""
    contents = {}
    for key, path, kind, content in files:
        row[key] = None
        if path is not None and content is not None:
            contents[path] = content
            row[key] = path_text(path)
        elif path is not None:
            _add_message(row, f"{path} was not written: there is no {kind}")
    save_together(contents)


def _add_message(row: Row, message: str) -> None:
    row["message"] = "; ".join(filter(None, (row["message"], message)))


for _command in (gap, table, report, show, render):
    app.command(_command)
app.command(  # by name: matplotlib is slow to import
    "cocap_opt.experiments.cli.figure_commands:app",
    name="figure",
    help="Draw charts of results for papers.",
)


def _variant(problem: Problem, free: bool) -> Problem:
    return without_rules(problem) if free else problem


def _freed(free: bool) -> Row:
    return {"free": True} if free else {}


class _Once(logging.Filter):
    """Lets a message through once: every seed of a scene has the same doubts."""

    def __init__(self) -> None:
        super().__init__()
        self._seen: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        message = record.getMessage()
        new = message not in self._seen
        self._seen.add(message)
        return new


def _log_to_stderr() -> None:
    handler = logging.StreamHandler(sys.stderr)
    handler.addFilter(_Once())
    logging.basicConfig(handlers=[handler], level=logging.WARNING, format="cocap-opt: %(message)s")


def _first_line(build: Callable[..., Problem]) -> str:
    return (build.__doc__ or "").strip().splitlines()[0]


# -- running ------------------------------------------------------------------------------


def run(arguments: Sequence[str] | None) -> int:
    """Run one command and return its exit code; wrong input is one line on standard error."""
    _log_to_stderr()
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except (CycloptsError, UsageError, FileError, ProblemError, ClusterError) as error:
        say(str(error))
        return 2
    except MemoryError:
        say("out of memory: the scene is too large for this method")
        return 2
    return int(code or 0)
