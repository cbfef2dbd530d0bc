"""The names of drones in a recipe; a scene numbers them."""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from cocap_opt.scenarios.recipe.drones import DronesTable
from cocap_opt.scenarios.recipe.schema import Recipe

_DRONE = re.compile(r"robots\[(\d+)\](\.start|\.home)?")


class DroneName(NamedTuple):
    """The name of a drone's table, and the names of its start and home."""

    table: str
    start: str
    home: str


def names_of(recipe: Recipe) -> Iterator[DroneName]:
    """Yields the names of all drones, in the order of their numbers."""
    for k, given in enumerate(recipe.drones):
        yield from names_in_table(k, given)


def names_in_table(k: int, given: DronesTable) -> Iterator[DroneName]:
    """Yields the names of the drones in a table, given its number."""
    table, stated = f"drones[{k}]", len(given.stated)
    area = f"{table}.starts" if given.starts is not None and not stated else table
    for n in range(stated or given.count or 0):
        start = f"{table}.starts[{n}]" if stated else area
        yield DroneName(table, start, f"{table}.homes[{n}]")


def renamed(words: str, names: Sequence[DroneName]) -> str:
    """Returns a message in which drones, their starts and homes have the recipe's names."""

    def name(found: re.Match[str]) -> str:
        table, start, home = names[int(found[1])]
        return {".start": start, ".home": home}.get(found[2], table)

    return _DRONE.sub(name, words)
