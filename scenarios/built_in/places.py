"""Real places, as recipes whose files come with the project: maps, land cover, walks and drones.

Each folder of `scenarios/places` has a recipe, its files, and a README that names their sources.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from cocap_opt.problem import Problem

if TYPE_CHECKING:
    from cocap_opt.scenarios.recipe import Recipe

FOLDER = Path(__file__).parents[1] / "places"
_AHEAD = 3.0  # m, by which a person may be ahead of the recipe
_FASTER = 0.1  # share by which a person may be faster or slower


def files(name: str) -> dict[str, bytes]:
    """Returns the files of a place by name, including the recipe `NAME.toml`."""
    return {file.name: file.read_bytes() for file in sorted((FOLDER / name).iterdir())}


def _delft(seed: int) -> Problem:
    """Four people meet in a lane of old Delft, and five drones film them from 5 m above the ground.

    The map is a real one, with a place on the Earth. Two friends come up the lane from the canal, a
    third comes to meet them, and somebody crosses the lane. Gardens are closed to the drones, which
    stay within their autopilot's limits, keep 4 m from people, and end where they can land. Seed 0
    is the unchanged recipe; other seeds choose the people's pace and how far they have walked at
    step 0.
    """
    return _of_recipe("delft", seed)


def _of_recipe(name: str, seed: int) -> Problem:
    from cocap_opt.scenarios.recipe import read  # its readers take long to import

    return read(FOLDER / name / f"{name}.toml", change=lambda recipe: _set_out(recipe, seed))


def _set_out(recipe: "Recipe", seed: int) -> "Recipe":
    """Returns a recipe whose people walk as the seed chooses; 0: as in the recipe."""
    if seed == 0:
        return recipe
    rng = np.random.default_rng(seed)
    walks = tuple(
        msgspec.structs.replace(
            walk,
            first=walk.first + rng.uniform(0, _AHEAD),
            speed=walk.speed * rng.uniform(1 - _FASTER, 1 + _FASTER),
        )
        for walk in recipe.walk
    )
    return msgspec.structs.replace(recipe, walk=walks)


SCENES: dict[str, Callable[[int], Problem]] = {"delft": _delft}
