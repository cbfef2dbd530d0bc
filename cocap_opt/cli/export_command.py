"""The command that writes scenes: as files of this project, for other solvers, and as tables."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, TypeVar

from cyclopts import Parameter

from cocap_opt.cli.options import FLAG, Json, Output, Scene, Seed, Whole, load
from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import SceneFile, encode, problem_digest
from cocap_opt.formulations.independent import instance_of
from cocap_opt.formulations.model_files.endings import CONES, LINEAR, NONLINEAR, ROOT_ERROR
from cocap_opt.model import Model, compiled
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import check_output, save_bytes, save_files
from cocap_opt.output.graphml import graphml
from cocap_opt.output.long_tables import TABLES, LongTable
from cocap_opt.output.printing import Record
from cocap_opt.problem import Problem
from cocap_opt.result import UnsupportedError
from cocap_opt.run.options import Option, UsageError
from cocap_opt.scenarios import variants
from cocap_opt.scenarios.hardware import with_cameras
from cocap_opt.vision.coverage import Progress

if TYPE_CHECKING:
    from cocap_opt.formulations.model_files.model import ModelFile

T = TypeVar("T")

_SCENE, _GRAPH, _INSTANCE, _TABLE = ".json", ".graphml", ".instance", ".csv"


def _export(
    scene: Scene,
    /,
    *,
    output: Output,
    seed: Seed = 0,
    over_time: Annotated[
        bool,
        FLAG(help="pixels add up over time as well as over drones"),
    ] = False,
    views: Annotated[
        Whole | None,
        Parameter(help="number of drones that should see each person, e.g. 2; adds to J"),
    ] = None,
    views_weight: Annotated[
        float | Literal["first"] | None,
        Parameter(
            help="reward in J for each drone that sees a person at a step, px^0.5/m: a number, or "
            "`first` to put views before all pixels (default: half the J of a view in which the "
            "person fills a third of the image height)"
        ),
    ] = None,
    views_share: Annotated[
        float | None,
        Parameter(help="smallest share of all possible views that a plan may have, e.g. 0.95"),
    ] = None,
    camera: Annotated[
        str | None, Parameter(help="camera for all drones; `cocap-opt scenes` lists them")
    ] = None,
    tilts: Annotated[
        str | None,
        Parameter(help="degrees below the horizon, e.g. 10 or, for a gimbal, 10,30,60"),
    ] = None,
    option: Annotated[
        list[str] | None,
        Parameter(
            negative="",
            help="NAME=VALUE, an option of the file format; may be repeated; `cocap-opt scenes` "
            "lists them",
        ),
    ] = None,
    steps: Annotated[
        Whole | None, Parameter(help="end the scene after this many moves, e.g. 4")
    ] = None,
    drone: Annotated[
        Whole | None, Parameter(help="drone whose graph is written as GraphML (default: 0)")
    ] = None,
    root_error: Annotated[
        float | None,
        Parameter(
            help="largest relative error of the tangents to roots in MPS and LP; 0: exact at all "
            f"pixel sums that drones can have (default: {ROOT_ERROR:g})"
        ),
    ] = None,
    json: Json = False,
) -> int:
    """Write a scene as a file for this program, other solvers or other programs.

    The file extension selects the format. .json: the scene; .mps, .lp, .cbf, .nl: a mathematical
    program for other solvers; .csv: a long table; .graphml: a drone's graph; .instance: the data
    of a bound.

    .mps, .lp: a mixed-integer linear program, with tangents in place of roots. .cbf: the same with
    roots as cones, in the Conic Benchmark Format. .nl: with roots as quadratic rows, for AMPL's
    solvers; the names are written to .col and .row. Anywhere a plan is accepted, you can pass a
    solver's solution, FILE.sol.

    coverage.csv, views.csv, moves.csv, turns.csv, drones.csv and goals.csv, or file names with
    these endings, are long tables of the views and the moves of each drone.

    .graphml: the graph of a drone: one node for each state at each step that a path of the drone
    can pass, with step, x, y, z (m), heading, tilt (rad) and reward.

    .instance: all data of a bound in exact numbers, without geometry, with which `cocap-check`
    checks plans, certificates and proofs.

    Example: cocap-opt export corridor --steps 4 -o corridor-4.mps
    """
    if output is not None:
        check_output(output, scene)
    kind, output = _Kind.of(output)
    if drone is not None and kind.ending != _GRAPH:
        raise UsageError(f"--drone: applies only to files that end in {_GRAPH}")
    if root_error is not None and kind.ending not in LINEAR:
        raise UsageError(f"--root-error: applies only to files that end in {' or '.join(LINEAR)}")
    error = ROOT_ERROR if root_error is None else Option("--root-error").require_share(root_error)
    problem = load(scene, seed, Option("--option").values(option or []))
    if steps is not None:
        problem = _until(problem, steps)
    if camera is not None or tilts is not None:
        degrees = None if tilts is None else _angles("--tilts", tilts)
        problem = _with_cameras(problem, camera, degrees)
    if over_time:
        problem = variants.over_time(problem)
    # The default weight depends on the cameras, so it is set after these.
    problem = _counting(problem, views, views_weight, views_share)
    if kind.table == "views" and problem.objective.views is None:
        raise UsageError("-o: views.csv requires a scene with --views")
    answer: Record = {"scene": problem.name, "seed": seed, "digest": problem_digest(problem)}
    with Watch.on_terminal(f"{problem.name} seed {seed}") as watch:
        if kind.ending == _SCENE:
            save_bytes(output, encode(SceneFile.of(problem)))
        elif kind.ending == _GRAPH:
            answer["drone"] = _drone(drone or 0, problem)
            save_bytes(output, graphml(problem, answer["drone"], watch.counter))
        else:
            answer |= _written(output, kind, compiled(problem), error, watch.counter("coverage"))
    print_result({**answer, "file": output}, json)
    return 0


def _with_cameras(
    problem: Problem, camera: str | None, degrees: tuple[float, ...] | None
) -> Problem:
    """Returns a scene with other cameras; error messages name the options."""
    try:
        return with_cameras(problem, camera, degrees)
    except ProblemError as error:
        if str(error).startswith(("camera:", "tilts:")):
            raise Option.refused(error) from error
        raise


class _Kind(NamedTuple):
    """The kind of an output file.

    Attributes
    ----------
    ending : ending of its name
    table : name of a long table; empty for other files
    """

    ending: str
    table: str = ""

    @classmethod
    def of(cls, output: Path | None) -> tuple["_Kind", Path]:
        """Returns the kind of a file, given its name, and the file, which must be named."""
        endings = (_SCENE, *LINEAR, CONES, NONLINEAR, _GRAPH, _INSTANCE, _TABLE)
        path, ending = Option("-o").file(output, endings)
        if ending != _TABLE:
            return cls(ending), path
        table = next((name for name in TABLES if path.stem.lower().endswith(name)), None)
        if table is None:
            names = ", ".join(f"{name}{_TABLE}" for name in TABLES)
            raise UsageError(f"-o: name a table: {names}, or a name that ends in one of these")
        return cls(ending, table), path


def _until(problem: Problem, steps: int) -> Problem:
    """Returns a scene that ends after a number of moves."""
    try:
        return problem.until(steps)
    except ProblemError as error:
        raise Option.refused(error) from error


def _written(
    output: Path, kind: _Kind, model: Model, root_error: float, progress: Progress
) -> Record:
    """Writes the file made from a model and its coverage; returns its entries in the answer."""
    if kind.ending == _INSTANCE:
        text = instance_of(model, progress).encode()
        save_bytes(output, text)
        return {"sha256": hashlib.sha256(text).hexdigest()}
    if kind.table:
        model.prepare_all(progress=progress)
        return _table(output, TABLES[kind.table], model)
    from cocap_opt.formulations.model_files.conic import write_cones
    from cocap_opt.formulations.model_files.linear import write_linear
    from cocap_opt.formulations.model_files.nonlinear import nonlinear_files

    program = _require(lambda: _program(kind, model, root_error, progress))
    if kind.ending in LINEAR:
        save_files({output: lambda file: write_linear(file, program, kind.ending)})
    elif kind.ending == CONES:
        save_files({output: lambda file: write_cones(file, program)})
    else:
        contents = nonlinear_files(program)
        save_files({output.with_suffix(ending): text for ending, text in contents.items()})
    return _told(program)


def _program(kind: _Kind, model: Model, root_error: float, progress: Progress) -> "ModelFile":
    from cocap_opt.formulations.model_files.model import ModelFile
    from cocap_opt.formulations.model_files.nonlinear import require_pyomo

    if kind.ending in LINEAR:
        return ModelFile.with_tangents(model, root_error, progress)
    if kind.ending == NONLINEAR:
        require_pyomo()
    return ModelFile.with_cones(model, progress)


def _told(program: "ModelFile") -> Record:
    """Returns the size of a program, and the parts of the scene that it does not contain."""
    words = [program.told_tangents] if program.has_tangents else []
    views = program.problem.objective.views
    if views is not None and views.share is not None:
        words.append("the file does not contain the share of views that plans must keep")
    return {
        "variables": len(program.variables),
        "integers": program.program.n_integral,
        "constraints": len(program.rows),
        **({"message": "; ".join(words)} if words else {}),
    }


def _table(output: Path, table: LongTable, model: Model) -> Record:
    """Writes a long table, and returns the number of its rows."""
    counts = []
    save_files({output: lambda file: counts.append(table.write(file, model))})
    return {"lines": counts[0]}


def _require(make: Callable[[], T]) -> T:
    """Returns the result of a call; rejects scenes for which there is none."""
    try:
        return make()
    except UnsupportedError as error:
        raise UsageError(f"-o: {error}") from error


def _counting(
    problem: Problem, cameras: int | None, weight: float | Literal["first"] | None,
    share: float | None,
) -> Problem:  # fmt: skip
    """Returns the problem as `--views` and related options request it; its name says so."""
    for option, value in (("--views-weight", weight), ("--views-share", share)):
        if cameras is None and value is not None:
            raise UsageError(f"{option}: requires --views")
    if cameras is None:
        return problem
    try:
        return variants.counting_views(problem, cameras, weight, share)
    except ProblemError as error:
        field, _, words = str(error).partition(": ")
        option = {"cameras": "--views", "share": "--views-share"}.get(field, "--views-weight")
        raise UsageError(f"{option}: {words}") from error


def _drone(number: int, problem: Problem) -> int:
    """Returns the number of a drone, which must be in the scene."""
    last = len(problem.robots) - 1
    if not 0 <= number <= last:
        raise UsageError(f"--drone: must be 0..{last}, not {number}")
    return number


def _angles(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"{option}: must be numbers such as 10,30,60, not {text!r}") from None


COMMANDS = {"export": _export}
