"""Changes of a recipe's fields that reduce the time for coverage, mildest first.

A window affects no view inside it: the line from a drone to a person never leaves a rectangle that
contains both.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from msgspec.structs import replace

from cocap_opt.data import FloatArray
from cocap_opt.problem import Problem
from cocap_opt.scenarios.recipe.drones import DronesTable
from cocap_opt.scenarios.recipe.scenes import read
from cocap_opt.scenarios.recipe.schema import Recipe, decoded

_MARGINS = 30.0, 20.0, 10.0  # m around all people and starts, for windows
_COARSER = 1.5, 2.0, 3.0, 4.0  # factors on the resolution
_ROUND = 5.0  # m, to which windows are rounded
_FEWEST_HEADINGS = 4
# share of the states that drones reach; a window that leaves more is not worth advising
_WORTH_IT = 0.9


class Change(NamedTuple):
    """A change of a recipe.

    Attributes
    ----------
    fields : the changed fields as written, by table
    share : approximate share of the reachable states that remain
    of : function that makes the changed recipe
    note : other effects, in words
    """

    fields: dict[str, tuple[str, ...]]
    share: float
    of: Callable[[Recipe], Recipe]
    note: str = ""

    @classmethod
    def all_of(cls, changes: "Sequence[Change]") -> "Change":
        """Returns several changes combined into one."""
        fields: dict[str, tuple[str, ...]] = {}
        for change in changes:
            for table, words in change.fields.items():
                fields[table] = fields.get(table, ()) + words
        return cls(
            fields,
            math.prod(change.share for change in changes),
            lambda recipe: reduce(lambda found, change: change.of(found), changes, recipe),
            "; ".join(change.note for change in changes if change.note),
        )

    @property
    def words(self) -> str:
        """The changed fields by table; each table is named once."""
        by_table = (f"{', '.join(fields)} in {table}" for table, fields in self.fields.items())
        return " and ".join(by_table) + (f" ({self.note})" if self.note else "")

    def scene(self, path: Path, seed: int) -> Problem:
        """Reads a recipe with this change; a ProblemError says why it does not fit the other
        fields.
        """
        return read(path, seed, self.of)


def lighter(path: Path, problem: Problem) -> list[list[Change]]:
    """Returns changes of a recipe, a list for each kind; kinds that are quick to try come first.

    Parameters
    ----------
    path : path of the recipe
    problem : the recipe's problem
    """
    recipe = decoded(path)
    return [
        list(_resolutions(recipe, problem)),
        list(_fewer(recipe, "layers")),
        list(_windows(recipe, problem)),
        list(_fewer(recipe, "headings")),
        list(_fewer(recipe, "tilts")),
    ]


def _windows(recipe: Recipe, problem: Problem) -> Iterator[Change]:
    """Yields windows around all people and starts, if the map has a file."""
    if recipe.map.file is None:
        return
    low, high = problem.height_map.ends
    people = [actor.poses[: problem.horizon + 1, :2] for actor in problem.actors]
    starts = [
        problem.above(robot.motion, states.cells)[:, :2]
        for robot, states in zip(problem.robots, problem.starts, strict=True)
    ]
    points, reached = np.concatenate([*people, *starts]), _reached(problem, np.concatenate(starts))
    for margin in _MARGINS:
        first = np.floor((points.min(axis=0) - margin) / _ROUND) * _ROUND
        last = np.ceil((points.max(axis=0) + margin) / _ROUND) * _ROUND
        first, last = np.maximum(first, low), np.minimum(last, high)
        if (first > low).any() or (last < high).any():
            window = first[0], first[1], last[0], last[1]
            words = ", ".join(f"{float(x):.10g}" for x in window)
            inside = np.minimum(last, reached[1]) - np.maximum(first, reached[0])
            share = float(np.prod(np.maximum(inside, 0.0) / (reached[1] - reached[0])))
            exact = tuple(float(f"{x:.10g}") for x in window)
            if share <= _WORTH_IT:
                yield _of_map(f"window = [{words}]", share, window=exact)


def _reached(problem: Problem, starts: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the lower left and upper right corner [2] (m) of the area that drones can reach."""
    low, high = problem.height_map.ends
    radius = max(robot.motion.radius for robot in problem.robots)
    far = (radius * problem.horizon + 1) * problem.height_map.resolution
    return np.maximum(starts.min(axis=0) - far, low), np.minimum(starts.max(axis=0) + far, high)


def _resolutions(recipe: Recipe, problem: Problem) -> Iterator[Change]:
    """Yields larger cells, with correspondingly fewer cells per step, so that drones keep their
    speed.

    If the speed cannot be kept exactly, the note says how much farther drones then fly.
    """
    for times in _COARSER:
        edge = float(f"{problem.height_map.resolution * times:.3g}")
        radii = {
            k: round(table.motion.radius / times)
            for k, table in enumerate(recipe.drones)
            if round(table.motion.radius / times) != table.motion.radius
        }
        if not all(radii.values()):
            return
        slower = [
            _of_motion(recipe, k, f"radius = {radius}", radius=radius)
            for k, radius in radii.items()
        ]
        change = Change.all_of(
            [_of_map(f"resolution = {edge:g}", times**-2, resolution=edge), *slower]
        )
        radii_now = [table.motion.radius for table in recipe.drones]
        ratios = (round(radius / times) * times / radius for radius in radii_now if radius)
        farther = max(ratios, default=1.0)
        if farther > 1:
            note = f"drones then fly up to {farther:.2g} times as far in a step"
            change = change._replace(note=note)
        yield change


def _fewer(recipe: Recipe, field: str) -> Iterator[Change]:
    """Yields fewer layers, tilts or headings for the drones that have the most of them."""
    most = max(_count(table, field) for table in recipe.drones)
    tables = [k for k, table in enumerate(recipe.drones) if _count(table, field) == most]
    for count in _counts(field, most):
        changes = [_with(recipe, k, field, count) for k in tables]
        yield Change.all_of(changes)._replace(share=count / most)


def _counts(field: str, most: int) -> Iterator[int]:
    if field != "headings":
        yield from range(most - 1, 0, -1)
        return
    while most % 2 == 0 and most // 2 >= _FEWEST_HEADINGS:
        most //= 2
        yield most


def _count(table: DronesTable, field: str) -> int:
    if field == "headings":
        return table.motion.headings
    return len(table.tilts if field == "tilts" else table.motion.layers)


def _with(recipe: Recipe, k: int, field: str, count: int) -> Change:
    """Returns the change that gives the drones of a table fewer values in a field."""
    table = recipe.drones[k]
    if field == "headings":
        return _of_motion(recipe, k, f"headings = {count}", headings=count)
    if field == "tilts":
        tilts = table.tilts[:count]
        return _of_drones(recipe, k, f"tilts = {_listed(tilts)}", tilts=tilts)
    stated = table.stated_heights
    layers = sorted(table.motion.layers, key=lambda height: (height not in stated, height))
    kept = tuple(sorted(layers[:count]))
    return _of_motion(recipe, k, f"layers = {_listed(kept)}", layers=kept)


def _listed(numbers: Sequence[float]) -> str:
    return f"[{', '.join(f'{number:.10g}' for number in numbers)}]"


def _name(recipe: Recipe, k: int, table: str = "") -> str:
    """Returns the name that a table of drones has in the file."""
    name = f"drones{table}"
    which = "" if len(recipe.drones) == 1 else f" number {k + 1}"
    return f"[{name}]{which}" if table else f"[[{name}]]{which}"


def _of_map(words: str, share: float, **fields: Any) -> Change:
    def changed(recipe: Recipe) -> Recipe:
        return replace(recipe, map=replace(recipe.map, **fields))

    return Change({"[map]": (words,)}, share, changed)


def _of_drones(recipe: Recipe, k: int, words: str, **fields: Any) -> Change:
    def changed(recipe: Recipe) -> Recipe:
        tables = list(recipe.drones)
        tables[k] = replace(tables[k], **fields)
        return replace(recipe, drones=tuple(tables))

    return Change({_name(recipe, k): (words,)}, 1.0, changed)


def _of_motion(recipe: Recipe, k: int, words: str, **fields: Any) -> Change:
    def changed(recipe: Recipe) -> Recipe:
        tables = list(recipe.drones)
        tables[k] = replace(tables[k], motion=tables[k].motion.replace(**fields))
        return replace(recipe, drones=tuple(tables))

    return Change({_name(recipe, k, ".motion"): (words,)}, 1.0, changed)
