"""The schema of a recipe file: its tables, which are defined by kind in the other modules."""

from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from cocap_opt.data import LARGEST, MOST_STEPS, ProblemError
from cocap_opt.files.messages import in_words
from cocap_opt.scenarios.earth.place import EarthTable
from cocap_opt.scenarios.kinds import JSON
from cocap_opt.scenarios.maps.land_cover import LandCoverTable
from cocap_opt.scenarios.maps.layers import LayerTable
from cocap_opt.scenarios.maps.terrain import MapTable
from cocap_opt.scenarios.maps.walls import WallsTable
from cocap_opt.scenarios.meshes import MeshTable
from cocap_opt.scenarios.recipe.drones import DronesTable
from cocap_opt.scenarios.recipe.objective import ObjectiveTable
from cocap_opt.scenarios.recipe.people import TracksTable, WalkTable
from cocap_opt.scenarios.recipe.rules import AirspaceTable, NoFlyTable, RulesTable
from cocap_opt.scenarios.recipe.takes import SpreadTable, TakeTable
from cocap_opt.scenarios.tables import Flight, Table
from cocap_opt.scenarios.text import read_text

MOST_DIGITS = 4300  # digits of a whole number that Python reads


class Recipe(Table):
    """The whole file, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    steps: Annotated[int, Meta(ge=1, le=MOST_STEPS)]
    map: MapTable
    drones: tuple[DronesTable, ...] = ()  # may be empty in a recipe to examine; a problem needs one
    name: str | None = None  # None: the name of the file
    step: Annotated[float, Meta(gt=0, le=LARGEST)] = 1.0
    flight: Flight | None = None  # None: above the ground, and level where that is too steep
    flown: Literal["smooth", "straight"] = "smooth"
    layer: tuple[LayerTable, ...] = ()
    land_cover: tuple[LandCoverTable, ...] = ()
    mesh: tuple[MeshTable, ...] = ()
    walls: tuple[WallsTable, ...] = ()
    tracks: tuple[TracksTable, ...] = ()
    walk: tuple[WalkTable, ...] = ()
    take: tuple[TakeTable, ...] = ()
    spread: SpreadTable | None = None
    no_fly: tuple[NoFlyTable, ...] = ()
    airspace: AirspaceTable = msgspec.field(default_factory=AirspaceTable)
    rules: RulesTable = msgspec.field(default_factory=RulesTable)
    objective: ObjectiveTable = msgspec.field(default_factory=ObjectiveTable)
    face_samples: int = 3
    earth: EarthTable | None = None


def decoded(path: Path) -> Recipe:
    """Returns the content of a recipe file; a ProblemError describes what is wrong with it."""
    text = read_text(path, (JSON,))  # `[[1]]` is valid TOML, too
    try:
        return msgspec.toml.decode(text, type=Recipe)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ProblemError(in_words(error, text, Recipe)) from error
    except ValueError as error:  # raised by Python for numbers with thousands of digits
        raise ProblemError(f"must contain whole numbers of at most {MOST_DIGITS} digits") from error


def without_limits(recipe: Recipe) -> Recipe:
    """Returns a recipe whose drones have no limits."""
    tables = tuple(table.without_limits() for table in recipe.drones)
    return msgspec.structs.replace(recipe, drones=tables)
