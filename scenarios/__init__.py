"""Built-in scenes and readers of scene files. To add one: one file, one line below."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.files.documents import FileError, load_problem
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem, State
from cocap_opt.scenarios.built_in.bottleneck import bottleneck, bottleneck_tight
from cocap_opt.scenarios.built_in.bridge import bridge
from cocap_opt.scenarios.built_in.corridor import corridor, corridor_tight
from cocap_opt.scenarios.built_in.field import field_large, field_long, field_small
from cocap_opt.scenarios.built_in.passage import passage
from cocap_opt.scenarios.built_in.tiny import TINY
from cocap_opt.scenarios.formats import conventions, hughes

SCENES: dict[str, Callable[[int], Problem]] = {
    "corridor": corridor,
    "corridor-tight": corridor_tight,
    "bottleneck": bottleneck,
    "bottleneck-tight": bottleneck_tight,
    "passage": passage,
    "bridge": bridge,
    "field": field_small,
    "field-long": field_long,
    "field-large": field_large,
    **TINY,
}


NOTHING: Mapping[str, str] = MappingProxyType({})


class Options(NamedTuple):
    """What can be chosen about how a kind of scene file is read."""

    allowed: Mapping[str, tuple[str, ...]]  # values in words by name
    read: Callable[[Path, int, Mapping[str, str]], Problem]  # path, seed, values by name


class Format(NamedTuple):
    """A kind of scene file."""

    description: str
    matches: Callable[[Path], bool]  # by the file's name
    read: Callable[[Path, int], Problem]  # path, seed
    # Plan in a file that goes with such a scene; None where it is no such file, by its name.
    read_plan: Callable[[Path, Problem], Plan | None] = lambda path, problem: None
    # The scene with the starts that its own file names, where a seed chooses others.
    read_own_starts: Callable[[Path], Problem] | None = None
    options: Options | None = None


def _ends(*suffixes: str) -> Callable[[Path], bool]:
    return lambda path: path.suffix.lower() in suffixes


# The readers are imported where a file needs them: not everyone needs PyYAML.


def _read_greedy_perspectives(path: Path, seed: int) -> Problem:
    from cocap_opt.scenarios.formats import greedy_perspectives

    return greedy_perspectives.read(path, seed)


def _read_greedy_perspectives_as(path: Path, seed: int, options: Mapping[str, str]) -> Problem:
    from cocap_opt.scenarios.formats import greedy_perspectives

    return greedy_perspectives.read(path, seed, conventions.conventions_of(options))


def _read_greedy_perspectives_own_starts(path: Path) -> Problem:
    from cocap_opt.scenarios.formats import greedy_perspectives

    return greedy_perspectives.read(path, conventions=conventions.OWN_STARTS)


def _read_greedy_perspectives_plan(path: Path, problem: Problem) -> Plan | None:
    if not _ends(".csv")(path):
        return None
    from cocap_opt.scenarios.formats import greedy_perspectives

    return Plan(paths=greedy_perspectives.read_plan(path, problem))


def _read_movingai(path: Path, seed: int) -> Problem:
    from cocap_opt.scenarios.formats import movingai

    return movingai.read(path, seed)


def _read_hughes_plan(path: Path, problem: Problem) -> Plan | None:
    paths = hughes.read_plan(path)
    return None if paths is None else Plan(paths=paths)


def _read_recipe(path: Path, seed: int) -> Problem:
    from cocap_opt.scenarios.recipe import recipe

    return recipe.read(path, seed)


FORMATS: dict[str, Format] = {
    "recipe": Format(
        "*.toml, a scene of maps, meshes, tracks and drones (the seed places the drones)",
        _ends(".toml"),
        _read_recipe,
    ),
    "hughes": Format(
        "scene.json, a scene of Hughes et al. with a solution_*.json beside it (no seed)",
        hughes.is_scene,
        lambda path, seed: hughes.read(path),
        _read_hughes_plan,
        options=Options(hughes.ALLOWED, lambda path, seed, options: hughes.read(path, options)),
    ),
    "cocap-opt": Format(
        "*.json, cocap-opt's own scene file (no seed)",
        _ends(".json"),
        lambda path, seed: load_problem(path),
    ),
    "greedy-perspectives": Format(
        "*.yaml, *.yml, a seq.yaml of Greedy Perspectives (the seed is the start set)",
        _ends(".yaml", ".yml"),
        _read_greedy_perspectives,
        _read_greedy_perspectives_plan,
        _read_greedy_perspectives_own_starts,
        Options(conventions.ALLOWED, _read_greedy_perspectives_as),
    ),
    "movingai": Format(
        "*.scen, a scenario of the MovingAI benchmark (the seed orders its rows)",
        _ends(".scen"),
        _read_movingai,
    ),
}


def load_scene(name_or_path: str, seed: int = 0, options: Mapping[str, str] = NOTHING) -> Problem:
    """Build a built-in scene, or read a scene file or a folder that holds a seq.yaml.

    A file whose name is that of a built-in scene is reached as ./NAME.

    Parameters
    ----------
    options
        Values by name, of those that the file's format has (`Format.options`).

    Raises
    ------
    FileError
        If there is no such scene or file, or it cannot be used, or takes no such options;
        one line.
    """
    if seed < 0:
        raise FileError(f"seed: must be >= 0, not {seed}")
    if build := SCENES.get(name_or_path):
        _refuse(options, name_or_path)
        return build(seed)
    path, kind = _find_file(name_or_path)
    if kind.options is None:
        _refuse(options, name_or_path)
    try:
        if options and kind.options is not None:
            return kind.options.read(path, seed, options)
        return kind.read(path, seed)
    except ProblemError as error:
        raise FileError(str(error)) from error


def _refuse(options: Mapping[str, str], scene: str) -> None:
    """Refuse options, of which a scene has none."""
    if options:
        takers = ", ".join(key for key, kind in FORMATS.items() if kind.options is not None)
        raise FileError(f"option {next(iter(options))!r}: {scene} takes none, only {takers} files")


def scene_of_plan(name_or_path: str, problem: Problem, plan: Plan) -> Problem:
    """Find the variant of a scene that a foreign plan was made for, by where it starts.

    Plans of other projects do not say which start set they belong to: it is the one that
    the seed chose (`problem`), or the one in the scene's own file.
    """
    if name_or_path in SCENES or _starts(plan) == _problem_starts(problem):
        return problem
    path, kind = _find_file(name_or_path)
    if kind.read_own_starts is not None:
        try:
            own = kind.read_own_starts(path)
        except ProblemError:  # a file whose own starts are not usable
            return problem
        if _starts(plan) == _problem_starts(own):
            return own
    return problem


def _starts(plan: Plan) -> list[State | None]:
    return [path[0] if path else None for path in plan.paths]


def _problem_starts(problem: Problem) -> list[State]:
    return [robot.start for robot in problem.robots]


def _find_file(name_or_path: str) -> tuple[Path, Format]:
    """Scene file of this name, or in the folder of this name, and its format."""
    path = Path(name_or_path)
    if os.path.isdir(path):
        if not os.path.exists(path / "seq.yaml"):
            raise FileError(f"{path}: must be a file, or a folder that holds a seq.yaml")
        path = path / "seq.yaml"
    # Unlike Path.exists, os.path.exists is false, too, for names that no file can have.
    if not os.path.exists(path):
        if path.suffix or len(path.parts) > 1:
            raise FileError(f"{name_or_path}: no such file")
        raise FileError(f"{name_or_path}: no such scene or file; scenes: {', '.join(SCENES)}")
    found = next((kind for kind in FORMATS.values() if kind.matches(path)), None)
    if found is None:
        raise FileError(f"{path}: unknown kind of file, must be one of: {_known_files()}")
    return path, found


def read_foreign_plan(path: Path, problem: Problem) -> Plan | None:
    """Read a plan in the file format of another project; None where it is not known as one.

    Whether the plan can be flown is for the referee to say.

    Raises
    ------
    FileError
        If the file cannot be used; one line.
    """
    for kind in FORMATS.values():
        try:
            plan = kind.read_plan(path, problem)
        except ProblemError as error:
            raise FileError(str(error)) from error
        if plan is not None:
            return plan
    return None


def _known_files() -> str:
    return "; ".join(kind.description for kind in FORMATS.values())
