"""The names that a recipe has for drones, which a scene numbers."""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from cocap_opt.scenarios.recipe.drones import DronesTable
from cocap_opt.scenarios.recipe.schema import Recipe

_DRONE = re.compile(r"robots\[(\d+)\](\.start|\.home)?")


class DroneName(NamedTuple):
    """The name of a drone's table, and that of its start."""

    table: str
    start: str


def names_of(recipe: Recipe) -> Iterator[DroneName]:
    """Yields the names of all drones, in the order of their numbers."""
    for k, given in enumerate(recipe.drones):
        yield from names_in_table(k, given)


def names_in_table(k: int, given: DronesTable) -> Iterator[DroneName]:
    """Yields the names of the drones of a table, by its number."""
    table, stated = f"drones[{k}]", len(given.stated)
    yield from (DroneName(table, f"{table}.starts[{n}]") for n in range(stated))
    area = f"{table}.starts" if given.starts is not None and not stated else table
    yield from (DroneName(table, area) for _ in range(given.count or 0))


def renamed(words: str, names: Sequence[DroneName]) -> str:
    """Returns words in which drones, their starts and homes have the recipe's names."""

    def name(found: re.Match[str]) -> str:
        table, start = names[int(found[1])]
        return {".start": start, ".home": f"{table}.homes"}.get(found[2], table)

    return _DRONE.sub(name, words)
