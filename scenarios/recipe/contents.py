"""The contents of a recipe's map: its place on the Earth, meshes, walls, land, and people."""

import logging
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.problem import Actor, Earth, LandCover
from cocap_opt.scenarios.earth.place import MapProjection, of_map_file
from cocap_opt.scenarios.maps.terrain import Terrain
from cocap_opt.scenarios.recipe.people import TracksTable, WalkTable
from cocap_opt.scenarios.recipe.schema import Recipe
from cocap_opt.scenarios.recipe.takes import in_takes
from cocap_opt.scenarios.text import naming, rectangle
from cocap_opt.scenarios.tracks.times import Epoch
from cocap_opt.world.workspace import HeightMap, Mesh

log = logging.getLogger(__name__)

_ROUND = 5.0  # m, to which the corner of a proposed map is rounded


def earth_of(recipe: Recipe, terrain: Terrain) -> Earth | None:
    """Returns the scene's place on the Earth, if the recipe or the map's file defines it."""
    if recipe.earth is None:
        corner = terrain.height_map.centre(0, 0)
        return None if terrain.crs is None else of_map_file(terrain.crs, corner)
    with naming("earth"):
        earth = recipe.earth.earth(terrain.crs, terrain.height_map)
        if recipe.flight == "above-sea" and (earth.base or earth.heights == "ellipsoid"):
            raise ProblemError(
                'height: must be 0 above the sea if flight = "above-sea", as flight heights count '
                "from z = 0"
            )
    return earth


def meshes_of(
    recipe: Recipe, folder: Path, terrain: Terrain, projection: MapProjection, zero: float
) -> Iterator[Mesh]:
    """Yields the meshes of files, part by part, and those of walls; all must be on the map.

    The altitude of z = 0 is `zero` (m).
    """
    for k, given in enumerate(recipe.mesh):
        with naming(f"mesh[{k}]"):
            mesh = given.mesh(folder)
            require_on_map([mesh], terrain.height_map)
        yield from mesh.parts
    for k, plan in enumerate(recipe.walls):
        with naming(f"walls[{k}]"):
            walls = plan.meshes(folder, terrain.below, projection, zero)
            require_on_map(walls, terrain.height_map, _ways_to_walls(recipe, walls))
        yield from walls


def land_cover_of(
    recipe: Recipe, folder: Path, terrain: Terrain, projection: MapProjection
) -> Iterator[LandCover]:
    """Yields the areas of land in files, those of the first file below all others."""
    for k, given in enumerate(recipe.land_cover):
        with naming(f"land_cover[{k}]"):
            areas = given.areas(folder, terrain.height_map, projection)
            if not areas:
                raise ProblemError(
                    f"must have areas on the map, {rectangle(*terrain.height_map.ends)}"
                )
        yield from areas


def _ways_to_walls(recipe: Recipe, walls: list[Mesh]) -> str:
    """Suggests how to align a map and walls that are not on it."""
    if recipe.map.file is not None:
        return "`at` moves them, `unit` scales them"
    low = np.concatenate([wall.vertices for wall in walls]).min(axis=0)
    x, y = np.floor(low[:2] / _ROUND) * _ROUND
    return (
        f"origin = [{x:.10g}, {y:.10g}] in [map] makes the map start there, so that everything "
        "keeps its coordinates; `at` moves only these walls, `unit` scales them"
    )


def require_on_map(
    meshes: list[Mesh], height_map: HeightMap, way_out: str = "`at` moves it, `unit` scales it"
) -> None:
    """Raises ProblemError, with a remedy, if meshes are entirely off the map."""
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    low, high = vertices.min(axis=0)[:2], vertices.max(axis=0)[:2]
    first, last = height_map.ends
    if (high < first).any() or (low > last).any():
        raise ProblemError(
            f"must lie on the map, {rectangle(first, last)}, not at {rectangle(low, high)}; "
            f"{way_out}"
        )


def _say_moments(begins: dict[int, Epoch]) -> None:
    """Warns if tables of dated tracks begin at different moments, or at moments that cannot be
    compared.
    """
    for k, begin in list(begins.items())[1:]:
        first = next(iter(begins))
        if begin.is_universal != begins[first].is_universal:
            log.warning(
                "tracks[%d]: step 0 is %s for its people, but %s for those of tracks[%d]: dates "
                "with and without an offset from UTC cannot be compared; check that both are the "
                "same moment, or write the offset in all files",
                k, begin, begins[first], first,
            )  # fmt: skip
        elif begin != begins[first]:
            log.warning(
                "tracks[%d]: step 0 is %s for its people, but %s for those of tracks[%d]; they are "
                'filmed as if at the same time; file = ["..", ".."] in one table puts files on one '
                "clock",
                k, begin, begins[first], first,
            )  # fmt: skip


def people_of(
    recipe: Recipe, folder: Path, terrain: Terrain, projection: MapProjection
) -> Iterator[tuple[Actor, float | None]]:
    """Yields the people, each with the factor of their weight in the objective's views."""
    begins: dict[int, Epoch] = {}
    for k, given in enumerate(recipe.tracks):
        with naming(f"tracks[{k}]"):
            _require_views(recipe, given)
            actors, begin = given.actors(folder, terrain, recipe.step, recipe.steps, projection)
            actors = [copy for who in actors for copy in in_takes(who, given.take, recipe.take)]
        if begin is not None:
            begins[k] = begin
        yield from ((actor, given.views_weight) for actor in actors)
    _say_moments(begins)
    for k, walk in enumerate(recipe.walk):
        with naming(f"walk[{k}]"):
            _require_views(recipe, walk)
            actor = walk.actor(terrain, recipe.step, recipe.steps)
            actors = in_takes(actor, walk.take, recipe.take)
        yield from ((actor, walk.views_weight) for actor in actors)


def _require_views(recipe: Recipe, table: TracksTable | WalkTable) -> None:
    """Raises ProblemError if people have a factor for views that the objective does not count."""
    if table.views_weight is not None and recipe.objective.views is None:
        raise ProblemError("views_weight: must be left out if [objective] has no views")
