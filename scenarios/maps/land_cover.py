"""The land cover of a recipe: areas in GeoJSON, drawn on the ground in pictures of the scene."""

import logging
from collections import Counter
from pathlib import Path

import msgspec
import shapely
from shapely import Polygon, box

from cocap_opt.data import ProblemError
from cocap_opt.problem.land_cover import LANDS, Land, LandCover
from cocap_opt.scenarios.earth.place import NOWHERE, MapProjection
from cocap_opt.scenarios.kinds import GEOJSON, JSON
from cocap_opt.scenarios.maps.geojson import read_geojson
from cocap_opt.scenarios.maps.ground_plans import sound
from cocap_opt.scenarios.maps.parts import polygons_of
from cocap_opt.scenarios.maps.plan_systems import StatedSystem, in_metres
from cocap_opt.scenarios.tables import Table, Unit
from cocap_opt.scenarios.text import naming, read_text
from cocap_opt.world.workspace import HeightMap

log = logging.getLogger(__name__)

_MOST_TOLD = 5  # unknown words listed in a warning
_BY_WORD: dict[object, Land] = {land: land for land in LANDS}


class LandCoverTable(Table):
    """One of the tables `land_cover` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`.

    The file is GeoJSON, in degrees unless the file or the table states another unit.
    """

    file: str
    property: str = "kind"  # property of the file's features that contains the kind of land
    # The kinds that other words of the file stand for.
    kinds: dict[str, Land] = msgspec.field(default_factory=dict)
    unit: Unit | None = None  # None: as stated in the file, otherwise degrees

    def areas(
        self, folder: Path, height_map: HeightMap, projection: MapProjection = NOWHERE
    ) -> tuple[LandCover, ...]:
        """Reads the areas of the file, cut off at the edges of the map.

        Parameters
        ----------
        folder : of the file that the table names
        projection : converts longitudes and latitudes to metres

        Raises
        ------
        ProblemError
            If the file cannot be read or has no polygon, or if a polygon crosses itself; one line
            that names the file.
        """
        with naming(folder / self.file):
            found, _, crs = read_geojson(read_text(folder / self.file, (JSON,)))
            if not found:
                raise ProblemError("must contain at least one polygon")
            polygons = in_metres(
                [item.polygon for item in found], GEOJSON, StatedSystem.by_crs(crs), self.unit,
                projection,
            )  # fmt: skip
        frame = box(*height_map.ends[0], *height_map.ends[1])
        others = Counter[str]()
        areas: list[LandCover] = []
        for item, polygon in zip(found, polygons, strict=True):
            word, name = item.properties.get(self.property), item.properties.get("name")
            kind = self.kinds.get(str(word)) or _BY_WORD.get(str(word))
            with naming(folder / self.file):
                whole = None if polygon is None else sound(polygon, f"{item.field}geometry")
            shown = () if whole is None else [*polygons_of(whole & frame)]
            if kind is None and shown:
                others[str(word)] += 1
            areas += (
                _area(part, kind or "other", None if name is None else str(name)) for part in shown
            )
        self._say(others)
        return tuple(areas)

    def _say(self, others: Counter[str]) -> None:
        """Logs which words of the file are not kinds of land."""
        if others:
            told = ", ".join(f"{word!r:.30} ({n})" for word, n in others.most_common(_MOST_TOLD))
            more = ", .." if len(others) > _MOST_TOLD else ""
            log.warning(
                "%s: areas whose property %s is not one of %s are drawn as other: %s%s; "
                "translate them with kinds = { WORD = \"green\" } in [[land_cover]]",
                self.file, self.property, ", ".join(LANDS), told, more,
            )  # fmt: skip


def _area(polygon: Polygon, kind: Land, name: str | None) -> LandCover:
    rings = (polygon.exterior, *polygon.interiors)
    outline, *holes = (shapely.get_coordinates(ring)[:-1] for ring in rings)
    return LandCover(kind=kind, outline=outline, holes=tuple(holes), name=name)
