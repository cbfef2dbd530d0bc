"""Makes scenes from recipes."""

import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.problem import Actor, Earth, LandCover, Motion, Objective, Problem, Robot
from cocap_opt.problem.refusals import refused_starts
from cocap_opt.problem.scene import SceneData
from cocap_opt.problem.takes import PeopleInTakes, in_all_takes, least_chance
from cocap_opt.scenarios.earth.place import MapProjection, require_likely
from cocap_opt.scenarios.maps.terrain import Terrain
from cocap_opt.scenarios.recipe.cameras import say_cameras, say_tilts
from cocap_opt.scenarios.recipe.contents import (
    earth_of,
    land_cover_of,
    meshes_of,
    people_of,
    require_on_map,
)
from cocap_opt.scenarios.recipe.drones import Surroundings, say_moved
from cocap_opt.scenarios.recipe.example import EXAMPLE
from cocap_opt.scenarios.recipe.names import DroneName, names_in_table, names_of, renamed
from cocap_opt.scenarios.recipe.schema import Recipe, decoded
from cocap_opt.scenarios.recipe.strides import Strides
from cocap_opt.scenarios.recipe.takes import people_in_takes
from cocap_opt.scenarios.site import Site
from cocap_opt.scenarios.tables import ABOVE_GROUND
from cocap_opt.scenarios.text import naming
from cocap_opt.world.workspace import Mesh, Workspace

_MISSING = re.compile(r"([^/\\\s]+): no such file$")


def read(
    path: Path, seed: int = 0, change: Callable[[Recipe], Recipe] = lambda recipe: recipe
) -> Problem:
    """Reads a recipe and all files that it names.

    Parameters
    ----------
    path
        The TOML file.
    seed
        Chooses the starts of drones that have a `count`.
    change
        Returns a changed recipe, given the one in the file (default: no change).

    Raises
    ------
    ProblemError
        If a file cannot be read, or a value is not allowed or contradicts others; the message is
        one line that names the file and the field.
    """
    with naming(path), _naming_examples():
        place = _Place.of(change(decoded(path)), path)
        return place.problem(place.team(np.random.default_rng(seed)))


@contextmanager
def _naming_examples() -> Iterator[None]:
    """Adds where to find complete recipes to the error if a file named by the example is
    missing.
    """
    try:
        yield
    except ProblemError as error:
        name = _MISSING.search(str(error))
        if name is None or f'"{name[1]}"' not in EXAMPLE:
            raise
        raise ProblemError(
            f"{error}; the recipe of `cocap-opt recipe` names files that you supply: `cocap-opt "
            "recipe delft -o shoot` writes one with all its files; the shortest recipe needs none"
        ) from error


def parts(path: Path) -> list[Path]:
    """Returns the files named in the tables of a recipe, whether or not they exist."""
    tables = msgspec.to_builtins(decoded(path))
    return [path.parent / name for name in _named(tables)]


def _named(value: Any, key: str = "") -> Iterator[str]:
    """Yields the names of files in tables."""
    if isinstance(value, dict):
        for inner, held in value.items():
            yield from _named(held, inner)
    elif isinstance(value, list | tuple):
        for held in value:
            yield from _named(held, key)
    elif key in ("file", "ground") and isinstance(value, str):
        yield value


def site(path: Path, seed: int = 0) -> Site:
    """Reads a recipe whose drones need not have places yet, nor be defined at all.

    Raises
    ------
    ProblemError
        If anything else is wrong; the message is one line that names the file and the field.
    """
    with naming(path), _naming_examples():
        place = _Place.of(decoded(path), path)
        rng, team = np.random.default_rng(seed), list[Robot]()
        names, notes = list[DroneName](), list[str]()
        for k, given in enumerate(place.recipe.drones):
            with naming(f"drones[{k}]"):
                given.require_pace(place.around.height_map.resolution, place.recipe.step)
            try:
                with naming(f"drones[{k}]"):
                    added = given.added_to(team, place.around, rng)[len(team) :]
            except ProblemError as error:
                notes.append(str(error))
                continue
            team += added
            names += names_in_table(k, given)
        fields = place.fields(team)
        people, _ = in_all_takes(fields["takes"], fields["actors"], Objective())
        scene = SceneData(**fields | {"actors": people})
        refusals = tuple(
            found._replace(why=renamed(found.why, names)) for found in refused_starts(scene)
        )
        if not refusals and team:
            try:
                _ = scene.first_starts
            except ProblemError as error:
                notes.append(renamed(str(error), names))
        problem = None if refusals or notes or not team else place.problem(team)
        if problem is not None:
            place.say()
        motions = tuple(dict.fromkeys(given.motion for given in place.recipe.drones)) or (Motion(),)
        starts = tuple(name.start for name in names)
        return Site(problem, scene, motions, refusals, starts, tuple(notes))


class _Place(NamedTuple):
    """Everything that a recipe makes except its drones and the objective, which depends on them."""

    recipe: Recipe
    name: str
    terrain: Terrain
    solid: tuple[Mesh, ...]
    land: tuple[LandCover, ...]
    people: Sequence[tuple[Actor, float | None]]
    filmed: PeopleInTakes
    earth: Earth | None
    around: Surroundings

    @classmethod
    def of(cls, recipe: Recipe, path: Path) -> "_Place":
        """Reads all files named in a recipe."""
        with naming("map"):
            terrain = recipe.map.terrain(path.parent, recipe.flight or ABOVE_GROUND)
        crowns: list[Mesh] = []
        for k, layer in enumerate(recipe.layer):
            with naming(f"layer[{k}]"):
                terrain, bodies = layer.onto(terrain, path.parent)
            crowns += bodies
        earth = earth_of(recipe, terrain)
        projection = MapProjection(earth, terrain.height_map.centre(0, 0))
        zero = 0.0 if earth is None else earth.base
        recipe, terrain, stray = _flyable(recipe, terrain)
        solid = (*crowns, *meshes_of(recipe, path.parent, terrain, projection, zero))
        land = tuple(land_cover_of(recipe, path.parent, terrain, projection))
        people = list(people_of(recipe, path.parent, terrain, projection))
        given = tuple(actor for actor, _ in people)
        with naming("rules"):
            rules = recipe.rules.rules()
        if recipe.earth is not None and earth is not None and terrain.crs is None:
            # errors about walls or tracks off the map come first, as they name the right place
            with naming("earth"):
                require_likely(earth, terrain.height_map)
        airspace = recipe.airspace.airspace(recipe.no_fly, terrain.below, zero)
        if airspace.people_aside:
            airspace = airspace.replace(people_stray=stray)
        for k, zone in enumerate(airspace.no_fly):
            with naming(f"no_fly[{k}]"), naming("polygon"):
                require_on_map([zone], terrain.height_map, "it has coordinates of the map")
        workspace = Workspace(terrain.height_map, solid, airspace.no_fly, airspace.ceiling)
        filmed = people_in_takes(
            recipe.take, recipe.spread, given, workspace, recipe.steps, recipe.step
        )
        around = Surroundings(workspace, filmed.actors, recipe.steps, rules, airspace, land)
        name = recipe.name or path.stem
        return cls(recipe, name, terrain, solid, land, people, filmed, earth, around)

    def team(self, rng: np.random.Generator) -> list[Robot]:
        """Returns the drones of all tables, each clear of those before."""
        recipe, height_map = self.recipe, self.around.height_map
        if not recipe.drones:
            raise ProblemError(
                "drones: must have a table [[drones]]; `cocap-opt show` draws the map without any"
            )
        team: list[Robot] = []
        for k, given in enumerate(recipe.drones):
            with naming(f"drones[{k}]"):
                given.require_pace(height_map.resolution, recipe.step)
                team = given.added_to(team, self.around, rng)
        self.say()
        return team

    def say(self) -> None:
        """Logs doubtful entries in the tables of drones."""
        tables = self.recipe.drones
        say_cameras([given.camera for given in tables])
        say_tilts([given.tilts for given in tables])
        say_moved(tables, self.around.height_map)

    def fields(self, team: Sequence[Robot]) -> dict[str, Any]:
        """Returns the fields of a scene except the objective."""
        return {
            "name": self.name,
            "height_map": self.terrain.height_map,
            "meshes": self.solid,
            "land_cover": self.land,
            "robots": tuple(team),
            "actors": self.around.actors,
            "takes": self.filmed.takes,
            "horizon": self.recipe.steps,
            "rules": self.around.rules,
            "airspace": self.around.airspace,
            "face_samples": self.recipe.face_samples,
            "step": self.recipe.step,
            "earth": self.earth,
        }

    def problem(self, team: Sequence[Robot]) -> Problem:
        """Returns the problem; errors about a drone use the recipe's names."""
        with naming("objective"):
            given, factors = [person for person, _ in self.people], [f for _, f in self.people]
            objective = self.recipe.objective.objective(
                given, factors, team, self.recipe.steps, least_chance(self.filmed.takes)
            )
        try:
            return Problem(**self.fields(team), objective=self.filmed.objective(objective))
        except ProblemError as error:
            raise ProblemError(renamed(str(error), list(names_of(self.recipe)))) from error


def _flyable(recipe: Recipe, terrain: Terrain) -> tuple[Recipe, Terrain, float]:
    """Returns a recipe whose drones can fly all their moves smoothly, in any order.

    Returns
    -------
    recipe, terrain : with other motions, cells and flight heights, if limits require it
    stray : share of a move by which drones may then deviate from constant speed
    """
    for k, given in enumerate(recipe.drones):
        with naming(f"drones[{k}]"):
            given.require_likely(terrain.height_map.resolution, recipe.step)
    limited = any(table.known_limits is not None for table in recipe.drones)
    if recipe.flown == "straight" or not limited:
        return recipe, terrain, 0.0
    ceiling, follows = recipe.airspace.ceiling, recipe.flight is not None
    strides = Strides.of(recipe.drones, terrain, recipe.step, follows, ceiling)
    strides.say()
    changed = msgspec.structs.replace(recipe, drones=strides.tables)
    return changed, strides.terrain, strides.law.stray
