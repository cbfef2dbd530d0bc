"""The command line, `cocap-opt`.

Results go to standard output, as a table or with --json as one JSON object and nothing
else; progress and messages go to standard error. Exit codes: 0 done (also when there is no
plan: that is a result), 1 a claim does not hold (verify), 2 wrong input.
"""

import logging
import math
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import msgspec
from cyclopts import App, CycloptsError, Parameter
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from cocap_opt.cache import write_atomically
from cocap_opt.check import check
from cocap_opt.io import (
    FileError,
    PlanFile,
    decode,
    problem_digest,
    read_bytes,
    save_plan,
    save_problem,
)
from cocap_opt.io import encode as encode_file
from cocap_opt.model import compiled
from cocap_opt.plan import Plan
from cocap_opt.problem import Problem, ProblemError
from cocap_opt.result import Limit, Reason, UnsupportedError
from cocap_opt.stop import catch_interrupt
from experiments.report import (
    SOLVERS,
    Judged,
    Row,
    bound_row,
    default_planners,
    gap_row,
    mean_table,
    plan_row,
    run_bound,
    run_planner,
)
from formulations import BOUNDS
from formulations.certificate import CertificateError, CertificateFile, verify
from scenarios import FORMATS, SCENES, load_scene, read_foreign_plan, scene_of_plan

DEFAULT_SECONDS = 60.0

app = App(
    name="cocap-opt",
    help="Plan the views of several camera drones, and prove how good the plans are.",
    help_format="plaintext",
    version_flags=[],
)
# Files and pipes take tables as wide as they are; a terminal has its own width.
out = Console() if sys.stdout.isatty() else Console(width=200)
err = Console(stderr=True)

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
        _print_json({"scenes": rows, "formats": formats})
    else:
        _print_table("built-in scenes", rows)
        _print_table("files that can be read in place of a scene's name", formats)
    return 0


@app.command
def export(scene: str, /, *, output: Output, seed: Seed = 0, json: Json = False) -> int:
    """Write any scene as a cocap-opt scene file.

    Example: cocap-opt export corridor --seed 3 -o corridor-3.json
    """
    if output is None:
        raise UsageError("-o: name the file to write")
    _check_output(output)
    problem = _load(scene, seed)
    _write(output, lambda: save_problem(output, problem))
    _print_result({"scene": problem.name, "seed": seed, "file": str(output)}, json)
    return 0


@app.command
def plan(
    scene: str,
    /,
    *,
    planner: str = "cocap",
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
    _check_output(output)
    problem = _load(scene, seed)
    with catch_interrupt() as interrupt, _coverage_progress(problem):
        judged = run_planner(problem, planner, time_limit, interrupt)
    if judged.result.reason is Reason.UNSUPPORTED:
        raise UsageError(f"--planner: {judged.result.message}")
    written = None
    if output is not None and judged.result.plan is not None:
        _save_plan(output, problem, planner, judged)
        written = str(output)
    row = plan_row(problem, seed, planner, judged)
    row |= {"file": written, **judged.result.statistics}
    if judged.verdict:
        row["reward_per_step"] = judged.verdict.reward_per_step
        row["violations"] = judged.verdict.conflicts
    _print_result(row, json)
    return 0


@app.command
def bound(
    scene: str,
    /,
    *,
    method: str = "column-generation",
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
    _check_output(output)
    problem = _load(scene, seed)
    start = None if plan is None else _start_plan(plan, problem)
    with catch_interrupt() as interrupt, _coverage_progress(problem):
        try:
            result = run_bound(problem, method, time_limit, interrupt, start)
        except UnsupportedError as error:
            raise UsageError(f"--method {method}: {error}") from error
    if output is not None:
        _write(output, lambda: write_atomically(output, encode_file(result.certificate)))
    row = bound_row(problem, seed, result)
    _print_result(row | {"file": None if output is None else str(output)}, json)
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
        content = _read_claim(path, problem)
        if isinstance(content, Plan):
            problem = scene_of_plan(scene, problem, content)
        if isinstance(content, CertificateFile):
            _verify_certificate(problem, content, answer)
        elif path is certificate:
            raise FileError(f"{path}: must be a certificate, not a plan")
        else:
            _verify_plan(problem, content, answer)
    if "reward" in answer and "bound" in answer:
        reward, limit = answer["reward"], answer["bound"]
        if reward is not None and limit is not None and answer["valid"]:
            answer["gap"] = (limit - reward) / limit if limit else 0.0
            if reward > limit * (1 + 1e-12):
                answer["violations"].append("reward: above the bound, one of the two is wrong")
    answer["valid"] = not answer["violations"]
    _print_result(answer, json)
    return 0 if answer["valid"] else 1


@app.command
def gap(
    *scene: str,
    planner: Annotated[list[str] | None, Parameter(negative="")] = None,
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
    cells = [(name, seed) for name in scene for seed in _parse_seeds(seeds)]
    problems = {(name, seed): _load(name, seed) for name, seed in cells}
    _make_folder(out_)
    rows: list[Row] = []
    with catch_interrupt() as interrupt, _progress() as progress:
        task = progress.add_task("gap", total=len(cells))
        for name, seed in cells:
            progress.update(task, description=f"{name} seed {seed}")
            problem = problems[name, seed]
            rows += _gap_cell(problem, seed, planner or default_planners(problem), time_limit,
                              interrupt, out_)  # fmt: skip
            progress.advance(task)
            if interrupt() is not Limit.NONE:
                break
    if out_ is not None:
        _save_rows(out_ / "results.csv", rows)
    if json:
        _print_json({"rows": rows})
    else:
        _print_gap_table(rows)
        if len(rows) > len(mean_table(rows)):
            _print_table("means over seeds", mean_table(rows))
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
    _check_output(output)
    problem = _load(scene, seed)
    content = _read_claim(plan, problem)
    if isinstance(content, CertificateFile):
        raise FileError(f"{plan}: must be a plan, not a certificate")
    shown = content.plan if isinstance(content, PlanFile) else content
    problem = scene_of_plan(scene, problem, shown) if shown is content else problem
    verdict = check(problem, shown)
    if verdict.violations:
        raise FileError(f"{plan}: {verdict.violations[0]}")
    steps = range(problem.horizon + 1)
    if output.suffix.lower() == ".gif":
        picture = gif([plan_figure(problem, shown, verdict, t) for t in steps])
    else:
        picture = png(plan_figure(problem, shown, verdict, problem.horizon))
    _write(output, lambda: write_atomically(output, picture))
    _print_result({"scene": problem.name, "seed": seed, "file": str(output)}, json)
    return 0


# -- one cell of the gap table --------------------------------------------------------------


def _gap_cell(
    problem: Problem,
    seed: int,
    planners: Sequence[str],
    seconds: float,
    interrupt: Callable[[], Limit],
    folder: Path | None,
) -> list[Row]:
    bounded = run_bound(problem, "column-generation", seconds, interrupt)
    path = ""
    if folder is not None:
        path = f"certificates/{problem.name}-{seed}.json"
        target, content = folder / path, encode_file(bounded.certificate)
        _write(target, lambda: write_atomically(target, content))
    rows = []
    for name in planners:
        judged = run_planner(problem, name, seconds, interrupt)
        if folder is not None and judged.result.plan is not None:
            _save_plan(folder / f"plans/{problem.name}-{seed}-{name}.json", problem, name, judged)
        rows.append(gap_row(problem, seed, name, judged, bounded, path))
    return rows


def _save_rows(path: Path, rows: Sequence[Row]) -> None:
    import pandas as pd  # slow to import, and needed only here

    content = pd.DataFrame(rows).to_csv(index=False).encode()
    _write(path, lambda: write_atomically(path, content))


# -- files -----------------------------------------------------------------------------------


def _load(scene: str, seed: int) -> Problem:
    if seed < 0:
        raise UsageError(f"--seed: must be >= 0, not {seed}")
    return load_scene(scene, seed)


def _save_plan(path: Path, problem: Problem, planner: str, judged: Judged) -> None:
    assert judged.result.plan is not None
    content = PlanFile(
        scene=problem.name,
        digest=problem_digest(problem),
        planner=planner,
        reward=judged.reward,
        plan=judged.result.plan,
    )
    _write(path, lambda: save_plan(path, content))


def _check_output(path: Path | None) -> None:
    """Refuse a file that cannot be written before the work for it is done."""
    if path is None:
        return
    if path.is_dir():
        raise FileError(f"{path}: must be a file to write, not a folder")
    if not path.parent.is_dir():
        raise FileError(f"{path}: the folder {path.parent} does not exist")
    if not os.access(path.parent, os.W_OK):
        raise FileError(f"{path}: the folder {path.parent} cannot be written to")


def _make_folder(path: Path | None) -> None:
    if path is not None:
        try:
            for part in ("certificates", "plans"):
                (path / part).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise FileError(f"{path}: cannot be made a folder: {error.strerror}") from error


def _write(path: Path, write: Callable[[], None]) -> None:
    try:
        write()
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error


class _Header(msgspec.Struct):
    format: str


def _read_claim(path: Path, problem: Problem) -> PlanFile | CertificateFile | Plan:
    """A plan file, a certificate file, or a plan in a foreign format."""
    foreign = read_foreign_plan(path, problem)
    if foreign is not None:
        return foreign
    content = read_bytes(path)
    kind = decode(content, _Header, str(path)).format
    if kind == "cocap-opt plan":
        return decode(content, PlanFile, str(path))
    if kind == "cocap-opt certificate":
        return decode(content, CertificateFile, str(path))
    raise FileError(f"{path}: format: must be cocap-opt plan or cocap-opt certificate")


def _start_plan(path: Path, problem: Problem) -> Plan:
    content = _read_claim(path, problem)
    if isinstance(content, CertificateFile):
        raise FileError(f"{path}: must be a plan, not a certificate")
    found = content.plan if isinstance(content, PlanFile) else content
    verdict = check(problem, found)
    if verdict.violations:
        raise FileError(f"{path}: {verdict.violations[0]}")
    return found


# -- verify ----------------------------------------------------------------------------------


def _verify_plan(problem: Problem, content: PlanFile | Plan, answer: Row) -> None:
    claimed = content if isinstance(content, PlanFile) else None
    verdict = check(problem, content.plan if isinstance(content, PlanFile) else content)
    answer["violations"] += [*verdict.violations, *verdict.conflicts]
    answer["planner"] = claimed.planner if claimed else None
    answer["conflicts"] = len(verdict.conflicts)
    answer["reward"] = None if verdict.violations else verdict.reward
    answer["reward_at_start"] = None if verdict.violations else verdict.reward_at_start
    answer["reward_per_step"] = verdict.reward_per_step
    answer["reward_per_face"] = verdict.face_reward
    if claimed is None:
        return
    if claimed.digest != problem_digest(problem):
        answer["violations"].append("digest: the plan belongs to another scene or seed")
    if not math.isclose(claimed.reward, verdict.reward, rel_tol=1e-9, abs_tol=1e-9):
        answer["violations"].append(
            f"reward: the plan claims {claimed.reward!r}, it is {verdict.reward!r}"
        )


def _verify_certificate(problem: Problem, content: CertificateFile, answer: Row) -> None:
    answer["method"], answer["bound"] = content.method, None
    try:
        verify(problem, content)
    except CertificateError as error:
        answer["violations"].append(f"certificate: {error}")
        return
    # What has been proved is what the file claims.
    answer["bound"] = content.bound


# -- printing --------------------------------------------------------------------------------


def _print_json(content: Any) -> None:
    sys.stdout.write(msgspec.json.encode(content).decode() + "\n")


def _print_result(row: Row, json: bool) -> None:
    if json:
        _print_json(row)
        return
    table = Table(show_header=False, box=None)
    for key, value in row.items():
        if value is not None and value != "":
            table.add_row(key, _text(key, value))
    out.print(table)


def _print_table(title: str, rows: Sequence[Row]) -> None:
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for key, value in rows[0].items():
        wraps = key in ("about", "message")
        table.add_column(key, justify="left" if isinstance(value, str) else "right",
                         no_wrap=not wraps)  # fmt: skip
    for row in rows:
        table.add_row(*(_text(key, value) for key, value in row.items()))
    out.print(table)


def _print_gap_table(rows: Sequence[Row]) -> None:
    keys = ["scene", "seed", "planner", "reward", "bound", "gap", "conflicts", "reason"]
    if any(row["limit"] != "none" for row in rows):
        keys.append("limit")
    keys.append("seconds")
    title = f"gap to the certified bound ({rows[0]['bound_method']})" if rows else "no rows"
    _print_table(title, [{key: row[key] for key in keys} for row in rows])
    if any(row["conflicts"] for row in rows):
        out.print(
            "A plan with conflicts breaks the scene's rules: its reward may exceed the bound, "
            "and it has no gap."
        )


def _text(key: str, value: Any) -> str:
    if value is None:
        return "-"
    if key == "gap":
        return f"{100 * value:.3f} %"
    if key == "seconds":
        return f"{value:.3f}"
    if isinstance(value, float):
        return f"{value:,.2f}"
    if isinstance(value, (list, tuple)):
        joint = ", " if all(isinstance(item, float) for item in value) else "\n"
        return joint.join(_text("", item) for item in value) or "none"
    return str(value)


def _progress() -> Progress:
    """Progress on standard error; nothing where that is not a terminal."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=err,
        transient=True,
        disable=not err.is_terminal,
    )


@contextmanager
def _coverage_progress(problem: Problem) -> Iterator[None]:
    """Show how far the coverage of the scene is, while it is being computed."""
    with _progress() as progress:
        task = progress.add_task("coverage", total=problem.horizon + 1)
        compiled(problem).progress = lambda done, total: progress.update(
            task, completed=done, total=total
        )
        yield


# -- options ---------------------------------------------------------------------------------


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
        seeds += range(int(first), int(last or first) + 1)
    if not seeds:
        raise UsageError(f"--seeds: {text!r} holds no seed")
    return seeds


def _first_line(build: Callable[..., Problem]) -> str:
    return (build.__doc__ or "").strip().splitlines()[0]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit."""
    logging.basicConfig(stream=sys.stderr, level=logging.WARNING, format="cocap-opt: %(message)s")
    try:
        code = app(arguments, exit_on_error=False, print_error=False, result_action="return_value")
    except CycloptsError as error:
        code = _refuse(str(error))
    except (UsageError, FileError, ProblemError, CertificateError) as error:
        code = _refuse(str(error))
    except BrokenPipeError:
        # The reader of our output has gone, as with `| head`.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    sys.exit(code or 0)


def _refuse(message: str) -> int:
    sys.stderr.write("cocap-opt: " + " ".join(message.split()) + "\n")
    return 2
