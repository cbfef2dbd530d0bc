"""Built-in scenes and readers of scene files. To add one: one file, and one line below.

`load_scene` returns the Problem of a scene, given by name or file. A reader of a format is imported
only when a file needs it, so PyYAML and rasterio are loaded only for files that require them.
"""

import os
from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError
from cocap_opt.problem import Plan, Problem, State
from cocap_opt.scenarios.built_in import field, places, tiny, walled
from cocap_opt.scenarios.formats import NOTHING, Options, conventions, hughes, movingai
from cocap_opt.scenarios.kinds import JSON, WKT, kind_of
from cocap_opt.scenarios.site import Site
from cocap_opt.text import meant

__all__ = ["FORMATS", "NOTHING", "SCENES", "Site", "has_seed", "load_scene", "load_site",
           "read_foreign_plan", "scene_of_plan"]  # fmt: skip

SCENES: Mapping[str, Callable[[int], Problem]] = MappingProxyType(
    {
        **walled.SCENES,  # corridor, bottleneck, both also tight, passage, bridge
        **field.SCENES,  # field, field-long, field-large
        **places.SCENES,  # delft
        **tiny.SCENES,  # tiny-approach and nine others
    }
)


class _Files(NamedTuple):
    """Files that are recognised by their ending and, if others share it, by words inside."""

    suffixes: tuple[str, ...]
    words: tuple[bytes, ...] = ()  # any of these words

    def has(self, path: Path) -> bool:
        """Returns True if a file is one of these."""
        if path.suffix.lower() not in self.suffixes:
            return False
        try:
            if not self.words or not os.path.isfile(path):
                return not self.words
            content = path.read_bytes()
            return any(words in content for words in self.words)
        except OSError:
            return False


class _Format(NamedTuple):
    """A kind of scene file, and its reader, as described in `cocap_opt.scenarios.formats`."""

    description: str
    scenes: _Files
    reader: str  # module, below cocap_opt.scenarios
    plans: _Files = _Files(())
    options: Options = Options()
    # Options that select the starts in the scene's own file; None: it always has these.
    own_starts: Mapping[str, str] | None = None
    is_evaluated: bool = False  # True: states of its plans may lie between cells
    is_seeded: bool = True  # True: the seed selects one of several scenes in a file

    def read(self, path: Path, seed: int, options: Mapping[str, str] = NOTHING) -> Problem:
        """Reads a scene file; `options` maps the names of the format's options to words."""
        more = (options,) if self.options.allowed else ()
        problem: Problem = self._module().read(path, seed, *more)
        return problem

    def rewards_between_cells(self, path: Path, problem: Problem) -> tuple[float, ...] | None:
        """Returns a plan's rewards, step by step, if its states lie between cells; else None."""
        if not self.is_evaluated or not self.plans.has(path):
            return None
        rewards: tuple[float, ...] | None = self._module().rewards_between_cells(path, problem)
        return rewards

    def read_plan(self, path: Path, problem: Problem) -> Plan:
        """Reads a plan file of this format."""
        return Plan(paths=self._module().read_plan(path, problem))

    def parts(self, path: Path) -> list[Path]:
        """Returns the further files of a scene, if its format has any and the file is valid."""
        named: Callable[[Path], list[Path]] | None = getattr(self._module(), "parts", None)
        try:
            return [] if named is None else named(path)
        except (ProblemError, OSError):  # the scene's reader reports why it cannot be read
            return []

    def _module(self) -> Any:
        return import_module(f"{__name__}.{self.reader}")


FORMATS = MappingProxyType(
    {
        "recipe": _Format(
            "*.toml, a scene of maps, meshes, tracks and drones (the seed places the drones)",
            scenes=_Files((".toml",)),
            reader="recipe",
        ),
        "hughes": _Format(
            "*.json, a scene of Hughes et al. with a solution beside it, or a solution (no seed)",
            scenes=_Files((".json",), (hughes.SCENE, hughes.SOLUTION)),
            reader="formats.hughes",
            plans=_Files((".json",), (hughes.SOLUTION,)),
            is_evaluated=True,
            is_seeded=False,
            options=hughes.OPTIONS,
        ),
        "cocap-opt": _Format(
            "*.json, cocap-opt's own scene file (no seed)",
            scenes=_Files((".json",)),
            reader="formats.own",
            is_seeded=False,
        ),
        "greedy-perspectives": _Format(
            "*.yaml, *.yml, a seq.yaml of Greedy Perspectives (the seed is the start set)",
            scenes=_Files((".yaml", ".yml")),
            reader="formats.greedy_perspectives",
            plans=_Files((".csv",)),
            options=conventions.OPTIONS,
            own_starts={"start-set": "yaml"},
        ),
        "movingai": _Format(
            "*.scen, a scenario of the MovingAI benchmark (the seed orders its rows)",
            scenes=_Files((".scen",)),
            reader="formats.movingai",
            options=movingai.OPTIONS,
        ),
    }
)


_SMALL = 1000  # bytes
_IN_A_RECIPE = "name it in a recipe; `cocap-opt recipe` prints an example"
_WAYS_OUT = {  # remedies for a part of a scene that is named as a scene
    **dict.fromkeys((".tif", ".tiff", ".asc"), f"it is a map, for [map]: {_IN_A_RECIPE}"),
    ".map": "pass a .scen file of the MovingAI benchmark that belongs to the map",
    **dict.fromkeys((".txt", ".csv", ".sqlite", ".sqlite3", ".db"),
                    f"it may be people, for [[tracks]]: {_IN_A_RECIPE}"),
    **dict.fromkeys((".h5", ".hdf5"), "write its trajectories as text, and name that in a recipe"),
    ".xml": "write its ground plan as JSON, and name that in [[walls]] of a recipe",
    **dict.fromkeys((".geojson", ".wkt"), f"it may be walls, for [[walls]]: {_IN_A_RECIPE}"),
    **dict.fromkeys((".obj", ".glb", ".gltf", ".stl", ".ply", ".off"),
                    f"it is a mesh, for [[mesh]]: {_IN_A_RECIPE}"),
}  # fmt: skip


def load_scene(name_or_path: str, seed: int = 0, options: Mapping[str, str] = NOTHING) -> Problem:
    """Builds a built-in scene, or reads a scene file or a folder that contains a seq.yaml.

    To read a file that has the name of a built-in scene, write ./NAME.

    Parameters
    ----------
    name_or_path
        One of `SCENES`, or a file of one of `FORMATS`.
    seed
        Selects one of the scenes of this name; `FORMATS` explains what it selects in a file.
    options
        Options of the file's format, and a word for each, that select how the file is interpreted.

    Raises
    ------
    FileError
        If the scene or file does not exist, cannot be used, or does not have the options; the
        message is one line.
    """
    if seed < 0:
        raise FileError(f"seed: must be >= 0, not {seed}")
    if build := SCENES.get(name_or_path):
        _refuse(options, name_or_path)
        return build(seed)
    path, kind = _find_file(name_or_path)
    if not kind.options.allowed:
        _refuse(options, name_or_path)
    try:
        return kind.read(path, seed, options)
    except ProblemError as error:
        raise FileError(str(error)) from error


def load_site(name_or_path: str, seed: int = 0) -> Site | None:
    """Reads a recipe whose drones need not have places yet; None for any other scene.

    Raises
    ------
    FileError
        If the recipe cannot be used; the message is one line.
    """
    if name_or_path in SCENES:
        return None
    path, kind = _find_file(name_or_path)
    if kind is not FORMATS["recipe"]:
        return None
    from cocap_opt.scenarios.recipe import site  # its readers take long to import

    try:
        return site(path, seed)
    except ProblemError as error:
        raise FileError(str(error)) from error


def files_of(name_or_path: str) -> list[Path]:
    """Returns the files from which a scene is read; empty if it is built in or does not exist."""
    if name_or_path in SCENES:
        return []
    try:
        path, kind = _find_file(name_or_path)
    except FileError:
        return []
    return [path, *kind.parts(path)]


def has_seed(name_or_path: str) -> bool:
    """Returns False for a file that contains the same scene for every seed."""
    return name_or_path in SCENES or _find_file(name_or_path)[1].is_seeded


def scene_of_plan(name_or_path: str, problem: Problem, plan: Plan) -> Problem:
    """Finds the variant of a scene for which a foreign plan was made, by the plan's starts.

    Plans of other projects do not name their start set: it is either the one that the seed selected
    (`problem`), or the one in the scene's own file.
    """
    starts = [path[0] if path else None for path in plan.paths]
    if name_or_path in SCENES or starts == _starts(problem):
        return problem
    path, kind = _find_file(name_or_path)
    if kind.own_starts is None:
        return problem
    try:
        stated = kind.read(path, 0, kind.own_starts)
    except ProblemError:  # the starts in the file itself cannot be used
        return problem
    return stated if starts == _starts(stated) else problem


def read_foreign_plan(path: Path, problem: Problem) -> Plan | None:
    """Reads a plan in the file format of another project; None if the format is not recognised.

    The referee, not the reader, decides whether the plan can be flown.

    Raises
    ------
    FileError
        If the file cannot be used; one line.
    """
    for kind in FORMATS.values():
        if kind.plans.has(path):
            try:
                return kind.read_plan(path, problem)
            except ProblemError as error:
                raise FileError(str(error)) from error
    return None


def _refuse(options: Mapping[str, str], scene: str) -> None:
    """Raises FileError if options are given for a scene that has none."""
    if options:
        takers = ", ".join(key for key, kind in FORMATS.items() if kind.options.allowed)
        raise FileError(
            f"option {next(iter(options))!r}: {scene} has no options; only files of these kinds "
            f"have: {takers}"
        )


def _starts(problem: Problem) -> list[State]:
    return list(problem.first_starts)


def _find_file(name_or_path: str) -> tuple[Path, _Format]:
    """Returns the scene file with this name, or in the folder with this name, and its format."""
    if not name_or_path:
        raise FileError("scene: must be a name or a file, not empty")
    path = Path(name_or_path)
    if os.path.isdir(path):
        if not os.path.exists(path / "seq.yaml"):
            raise FileError(f"{path}: must be a file, or a folder that contains a seq.yaml")
        path = path / "seq.yaml"
    # Unlike Path.exists, os.path.exists is also False for names that no file can have.
    if not os.path.exists(path):
        if path.suffix or len(path.parts) > 1:
            raise FileError(f"{name_or_path}: no such file")
        question = meant(str(name_or_path), SCENES)
        raise FileError(
            f"{name_or_path}: no such scene or file; there are {', '.join(SCENES)}{question}"
        )
    if os.path.isfile(path) and _is_blank(path):
        raise FileError(f"{path}: is empty")
    found = next((kind for kind in FORMATS.values() if kind.scenes.has(path)), None)
    foreign = None if found else kind_of(path)
    if foreign is not None and foreign not in (JSON, WKT):  # their names give better messages
        raise FileError(f"{path}: is not a scene, but {foreign.name}; {foreign.way_out}")
    if found is None and (way := _WAYS_OUT.get(path.suffix.lower())):
        raise FileError(f"{path}: is not a scene; {way}")
    if found is None:
        known = "; ".join(kind.description for kind in FORMATS.values())
        raise FileError(f"{path}: unknown kind of file, must be one of: {known}")
    return path, found


def _is_blank(path: Path) -> bool:
    """Returns True if a small file contains only blanks."""
    try:
        return path.stat().st_size < _SMALL and not path.read_bytes().strip()
    except OSError:
        return False  # the reader reports why it cannot be read
