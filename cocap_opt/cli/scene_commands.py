"""The commands about scenes: lists of them, an example recipe, and compilation in advance."""

import os
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.cli.options import Json
from cocap_opt.compiling import ALL_SECONDS, CompilingError, Kernel, is_there
from cocap_opt.console.progress import Watch
from cocap_opt.output.answer import print_result
from cocap_opt.output.files import make_folder, save_files
from cocap_opt.output.known_scenes import known_scenes
from cocap_opt.output.printing import Listing
from cocap_opt.run.options import UsageError
from cocap_opt.scenarios.built_in import places
from cocap_opt.stop import Clock


def _scenes(*, json: Json = False) -> int:
    """List the built-in scenes, the file formats that can be read, their options, and cameras.

    Example: cocap-opt scenes
    """
    known = known_scenes()
    if json:
        print_result(known, json)
    else:
        Listing("built-in scenes", known["scenes"]).print()
        Listing("files that can be passed instead of a scene name", known["formats"]).print()
        Listing("options of `export`, as in --option triangles=no", known["options"]).print()
        Listing("cameras (px)", known["cameras"]).print()
        Listing("airframes of recipes (m/s, m/s2, degrees/s)", known["airframes"]).print()
    return 0


def _recipe(
    place: Annotated[
        str | None,
        Parameter(help="built-in place, e.g. delft, whose recipe and files to copy"),
    ] = None,
    /,
    *,
    output: Annotated[
        Path | None, Parameter(name=["--output", "-o"], help="folder for the files of a place")
    ] = None,
    json: Json = False,
) -> int:
    """Print a recipe with every table, or copy the recipe and the maps of a built-in place.

    A recipe is a scene file in TOML that combines maps, meshes, tracks and drones. The printed
    recipe explains every key, but names files that you must supply, so you cannot plan it
    unchanged. For a scene that you can plan at once, copy a place, or write the shortest recipe,
    which needs no other file: docs/how-to/shortest-recipe.md.

    Example: cocap-opt recipe delft -o shoot
    """
    if place is None:
        if output is not None:
            raise UsageError(f"--output: needs a PLACE, one of {', '.join(places.SCENES)}")
        return _print_example(json)
    if place not in places.SCENES:
        raise UsageError(f"PLACE: must be one of {', '.join(places.SCENES)}, not {place}")
    if output is None:
        raise UsageError(f"--output: must name a folder for the files of {place}")
    copies = {output / name: content for name, content in places.files(place).items()}
    for path, content in copies.items():
        if path.exists() and not (path.is_file() and path.read_bytes() == content):
            raise UsageError(f"{path}: exists and has been changed; name another folder")
    make_folder(output)
    save_files(copies)
    print_result({"recipe": output / f"{place}.toml", "files": list(copies)}, json)
    return 0


def _print_example(json: bool) -> int:
    from cocap_opt.scenarios.recipe import EXAMPLE  # its readers take long to import

    if json:
        print_result({"recipe": EXAMPLE}, json)
    else:
        sys.stdout.write(EXAMPLE)
    return 0


def kernels() -> tuple[Kernel, ...]:
    """Returns all kernels of this project."""
    from cocap_opt.coordination import kept_graph
    from cocap_opt.formulations.certificates.staged import compiled_search
    from cocap_opt.formulations.column_generation.master import state_cuts
    from cocap_opt.formulations.column_generation.step_envelopes import local_optima
    from cocap_opt.graph import value_iteration
    from cocap_opt.vision import sights

    modules = sights, value_iteration, kept_graph, compiled_search, local_optima, state_cuts
    return tuple(module.KERNEL for module in modules)


def _compile() -> int:
    """Compile coverage and searches now, so that no later run has to.

    The searches are value iteration, and those behind bounds and proofs.

    Example: cocap-opt compile
    """
    if not is_there():
        raise UsageError("numba is not installed; `pip install -e '.[fast]'` installs it")
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        raise UsageError("NUMBA_DISABLE_JIT: is set, so numba compiles nothing")
    clock = Clock()
    title = f"compiling: about {ALL_SECONDS:.0f} s, once per machine"
    with Watch.on_terminal(title) as watch:
        for done, kernel in enumerate(kernels()):
            watch.show(f"{kernel.name}, {done + 1} of {len(kernels())}")
            try:
                kernel.load()
            except CompilingError as error:
                raise UsageError(f"{error}; the stored code was removed: try again") from error
    if not all(kernel.is_kept for kernel in kernels()):
        raise UsageError(
            "the compiled code could not be stored: set NUMBA_CACHE_DIR to a writable folder"
        )
    names = [kernel.name for kernel in kernels()]
    told = f"{', '.join(names[:-1])} and {names[-1]} are compiled, and stored for all later runs"
    print_result({"seconds": clock.seconds, "message": told}, json=False)
    return 0


COMMANDS = {"scenes": _scenes, "recipe": _recipe, "compile": _compile}
