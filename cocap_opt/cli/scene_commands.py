"""The commands about scenes: listing them, an example of a recipe, and scenes as files."""

import hashlib
import os
import sys
from typing import Annotated, Literal

from cyclopts import Parameter

from cocap_opt.cli.options import FLAG, Json, Output, Scene, Seed, Whole, load
from cocap_opt.compiling import ALL_SECONDS, CompilingError, Kernel, is_there
from cocap_opt.console.progress import Watch
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import SceneFile, encode, problem_digest
from cocap_opt.formulations.independent import instance_of
from cocap_opt.model import compiled
from cocap_opt.output.files import check_output, save_bytes
from cocap_opt.output.graphml import graphml
from cocap_opt.output.known_scenes import known_scenes
from cocap_opt.output.printing import Listing, Record, print_result
from cocap_opt.problem import Problem
from cocap_opt.run.options import Option, UsageError
from cocap_opt.scenarios.hardware import with_cameras
from cocap_opt.stop import Clock
from cocap_opt.vision.default_weights import with_views

_GRAPH, _INSTANCE = ".graphml", ".instance"


def _scenes(*, json: Json = False) -> int:
    """List the built-in scenes, the file formats that can be read, their options, and cameras.

    Example: cocap-opt scenes
    """
    known = known_scenes()
    if json:
        print_result(known, json)
    else:
        Listing("built-in scenes", known["scenes"]).print()
        Listing("files that can be read in place of a scene's name", known["formats"]).print()
        Listing("options of `export`, as in --option triangles=no", known["options"]).print()
        Listing("cameras that `export` can put on a scene's drones (px)", known["cameras"]).print()
        Listing("airframes of recipes (m/s, m/s2, degrees/s)", known["airframes"]).print()
    return 0


def _recipe(*, json: Json = False) -> int:
    """Print a recipe with every table: a scene made of maps, meshes, tracks and drones.

    Example: cocap-opt recipe > scene.toml
    """
    from cocap_opt.scenarios.recipe import EXAMPLE  # its readers are slow to import

    if json:
        print_result({"recipe": EXAMPLE}, json)
    else:
        sys.stdout.write(EXAMPLE)
    return 0


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
        Parameter(help="so many drones, such as 2, are to see each person, besides pixels"),
    ] = None,
    views_weight: Annotated[
        float | Literal["first"] | None,
        Parameter(
            help="px^0.5/m, of a drone that sees a person at a step; if not given, half of what "
            "a view pays from where the person fills a third of the image's height; first: more "
            "than all pixels can pay"
        ),
    ] = None,
    views_share: Annotated[
        float | None,
        Parameter(
            help="share of all views that there could be, such as 0.95, that plans are to keep"
        ),
    ] = None,
    camera: Annotated[
        str | None, Parameter(help="another camera on all drones; `cocap-opt scenes` lists them")
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
    drone: Annotated[
        Whole | None, Parameter(help="whose graph is written as GraphML; 0 if not given")
    ] = None,
    json: Json = False,
) -> int:
    """Write any scene as a cocap-opt scene file, as a drone's graph, or as an instance.

    A file whose name ends with .graphml gets the graph: one node for each state at each step that a
    path of the drone can pass, with step, x, y, z (m), heading, tilt (rad) and reward. One whose
    name ends with .instance gets all that a bound needs and no geometry, in exact numbers:
    `cocap-check` checks plans, certificates and proofs with it.

    Example: cocap-opt export corridor --seed 3 -o corridor-3.json
    """
    if output is not None:
        check_output(output, scene)
    ending = Option("-o").ending(output, (".json", _GRAPH, _INSTANCE))
    assert output is not None
    if drone is not None and ending != _GRAPH:
        raise UsageError(f"--drone: is for a file whose name ends with {_GRAPH}")
    problem = load(scene, seed, Option("--option").values(option or []))
    if camera is not None or tilts is not None:
        degrees = None if tilts is None else _angles("--tilts", tilts)
        problem = with_cameras(problem, camera, degrees)
    if over_time:
        objective = problem.objective.replace(over_time=True)
        problem = problem.replace(name=f"{problem.name}-over-time", objective=objective)
    # The default weight is by the cameras, so after these.
    problem = _counting(problem, views, views_weight, views_share)
    answer: Record = {"scene": problem.name, "seed": seed, "digest": problem_digest(problem)}
    if ending == _GRAPH:
        answer["drone"] = _drone(drone or 0, problem)
        with Watch.on_terminal(f"{problem.name} seed {seed}") as watch:
            content = graphml(problem, answer["drone"], watch.counter)
        save_bytes(output, content)
    elif ending == _INSTANCE:
        model = compiled(problem)
        with Watch.on_terminal(f"{problem.name} seed {seed}") as watch:
            model.prepare_all(progress=watch.counter("coverage"))
        text = instance_of(model).encode()
        answer["sha256"] = hashlib.sha256(text).hexdigest()
        save_bytes(output, text)
    else:
        save_bytes(output, encode(SceneFile.of(problem)))
    print_result({**answer, "file": output}, json)
    return 0


def _counting(
    problem: Problem, cameras: int | None, weight: float | Literal["first"] | None,
    share: float | None,
) -> Problem:  # fmt: skip
    """Returns the problem as `--views` and what belongs to it ask for it; its name tells it."""
    for option, value in (("--views-weight", weight), ("--views-share", share)):
        if cameras is None and value is not None:
            raise UsageError(f"{option}: is for a scene with --views")
    if cameras is None:
        return problem
    try:
        found = with_views(problem, cameras, weight, share=share)
    except ProblemError as error:
        field, _, words = str(error).partition(": ")
        option = {"cameras": "--views", "share": "--views-share"}.get(field, "--views-weight")
        raise UsageError(f"{option}: {words}") from error
    return found.replace(name=f"{problem.name}-views{cameras}")


def _drone(number: int, problem: Problem) -> int:
    """Returns the number of a drone, if the scene has it."""
    last = len(problem.robots) - 1
    if not 0 <= number <= last:
        raise UsageError(f"--drone: must be 0..{last}, not {number}")
    return number


def _angles(option: str, text: str) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise UsageError(f"{option}: must be numbers such as 10,30,60, not {text!r}") from None


def kernels() -> tuple[Kernel, ...]:
    """Returns all kernels of this project."""
    from cocap_opt.coordination import restricted_value_iteration
    from cocap_opt.formulations.certificates.staged import compiled_search
    from cocap_opt.formulations.column_generation.step_envelopes import known_states
    from cocap_opt.graph import value_iteration
    from cocap_opt.vision import sights

    modules = sights, value_iteration, restricted_value_iteration, compiled_search, known_states
    return tuple(module.KERNEL for module in modules)


def _compile() -> int:
    """Compile all that is compiled ahead, so that no first run on a machine waits for it.

    It is coverage, value iteration, and the searches of the gap.

    Example: cocap-opt compile
    """
    if not is_there():
        raise UsageError("numba is not installed; `pip install -e '.[fast]'` installs it")
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        raise UsageError("NUMBA_DISABLE_JIT: is set, so that numba compiles nothing")
    clock = Clock()
    title = f"compiling, some {ALL_SECONDS:.0f} s, once on a machine"
    with Watch.on_terminal(title) as watch:
        for done, kernel in enumerate(kernels()):
            watch.show(f"{kernel.name}, {done + 1} of {len(kernels())}")
            try:
                kernel.load()
            except CompilingError as error:
                raise UsageError(f"{error}; what it had kept is removed: try again") from error
    if not all(kernel.is_kept for kernel in kernels()):
        raise UsageError(
            "nothing could be kept: set NUMBA_CACHE_DIR to a folder that can be written"
        )
    names = [kernel.name for kernel in kernels()]
    told = f"{', '.join(names[:-1])} and {names[-1]} are compiled, and kept for all later runs"
    print_result({"seconds": clock.seconds, "message": told}, json=False)
    return 0


COMMANDS = {"scenes": _scenes, "recipe": _recipe, "export": _export, "compile": _compile}
