"""The files of the built-in scene delft, cut out of a surface, a ground and a map of its land.

They are cut to 128 x 128 m, so that the player draws each cell of 1 m. Heights are rounded to
0.1 m, positions to 0.01 m. The ground is the median of 5 x 5 cells, which removes single cells of
trees and lamp posts from the source's ground; houses are as in the source.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import msgspec
import numpy as np
import shapely
from cyclopts import Parameter
from scipy.ndimage import median_filter
from shapely import Point, box

from cocap_opt.data import FloatArray
from cocap_opt.files.documents import FileError
from cocap_opt.flight.earth import Geodesy
from cocap_opt.output.files import make_folder, read_text, save_files
from cocap_opt.problem import Earth
from cocap_opt.scenarios.earth import wkt_of_code
from cocap_opt.scenarios.maps.geojson import read_geojson
from cocap_opt.scenarios.maps.parts import polygons_of
from cocap_opt.scenarios.maps.raster_files import read_raster

WINDOW = 84888.0, 447474.0, 85016.0, 447602.0  # m of RD New: x0, y0, x1, y1
_CODE = 28992  # EPSG code of RD New
_LEAST_HOUSE = 0.5  # m above the ground
_MEDIAN = 5  # cells
_LEAST_AREA = 0.5  # m2; smaller parts are left out
# Words of the map for which the project has no kind with the same name.
_KINDS = {"pedestrian area": "footway", "parking": "paved", "bridge": "street", "wall": "other"}


class _Name(NamedTuple):
    """A name that is written on the map, and a point (m) in the area with this name."""

    name: str
    at: tuple[float, float]
    certainty: str | None = None  # of a name that is not in the source map; None: a description


# The source map has no names, but the numbers of its houses, which published descriptions of this
# part of the town mention: README.md of the place tells how. The others describe what is there.
_NAMES = (
    _Name("Rijn-Schie canal", (85012.0, 447595.0), "settled"),
    _Name("Oosteinde", (84910.0, 447485.0), "settled"),
    _Name("Oranje Plantage", (85000.0, 447560.0), "practically settled"),
    _Name("'t Carto", (84988.0, 447511.0), "strong"),
    _Name("Klaeuwshofje", (85015.0, 447506.0), "strong"),
    _Name("lane", (84940.0, 447543.5)),
    _Name("courtyard", (84902.0, 447555.0)),
    _Name("mound", (84972.0, 447514.0)),
)


def place(
    source: Annotated[Path, Parameter(help="folder with surface.tif, ground.tif and map.geojson")],
    /,
    *,
    out: Annotated[Path, Parameter(help="folder for the files")],
) -> None:
    """Writes surface.asc, ground.asc, the reference system of each, and land.geojson."""
    make_folder(out)
    surface, ground = (_cut(source / f"{name}.tif") for name in ("surface", "ground"))
    bare = median_filter(ground, size=_MEDIAN)
    tops = np.where(surface - ground > _LEAST_HOUSE, np.maximum(surface, bare), bare)
    system = wkt_of_code(_CODE)
    assert system is not None, "rasterio is installed, as the source is GeoTIFF"
    files = {"surface.asc": _grid(tops), "ground.asc": _grid(bare), "land.geojson": _land(source)}
    files |= {f"{name}.prj": f"{system}\n" for name in ("surface", "ground")}
    save_files({out / name: text.encode() for name, text in files.items()})


def _cut(path: Path) -> FloatArray:
    """Returns the heights (m) of a map in the window, [X, Y]."""
    raster, (x0, y0, x1, y1) = read_raster(path, window=WINDOW), WINDOW
    if raster.cell != (1.0, 1.0) or raster.values.shape != (x1 - x0, y1 - y0):
        raise FileError(f"{path}: must have cells of 1 m in all of {WINDOW}")
    return np.array(raster.values)


def _grid(heights: FloatArray) -> str:
    """Returns heights [X, Y] as an ESRI ASCII grid."""
    x0, y0, *_ = WINDOW
    width, depth = heights.shape
    head = f"ncols {width}\nnrows {depth}\nxllcorner {x0:g}\nyllcorner {y0:g}\ncellsize 1\n"
    rows = (heights.round(1) + 0.0).T[::-1]
    return head + "".join(" ".join(f"{height:g}" for height in row) + "\n" for row in rows)


def _land(source: Path) -> str:
    """Returns the areas of the map in the window, in m, as GeoJSON."""
    features = ",\n".join(msgspec.json.encode(feature).decode() for feature in _features(source))
    system = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{_CODE}"}}
    return (
        f'{{"type": "FeatureCollection", "crs": {msgspec.json.encode(system).decode()}, '
        f'"features": [\n{features}\n]}}\n'
    )


def _features(source: Path) -> Iterator[dict[str, Any]]:
    window, waiting = box(*WINDOW), list(_NAMES)
    geodesy = Geodesy(Earth(crs=f"EPSG:{_CODE}"), (WINDOW[0], WINDOW[1]))
    polygons, _, _ = read_geojson(read_text(source / "map.geojson"))
    for found in polygons:
        whole = shapely.transform(found.polygon, lambda points: geodesy.metres(*points.T[::-1]))
        inside = shapely.set_precision(shapely.make_valid(whole).intersection(window), 0.01)
        kind = str(found.properties["kind"])
        for part in polygons_of(inside):
            if part.area < _LEAST_AREA:
                continue
            name = next((label for label in waiting if part.contains(Point(label.at))), None)
            properties = {"kind": _KINDS.get(kind, kind)}
            if name is not None:
                waiting.remove(name)
                properties["name"] = name.name
                if name.certainty is not None:
                    properties["certainty"] = name.certainty
            rings = [part.exterior, *part.interiors]
            points = [[list(point) for point in ring.coords] for ring in rings]
            geometry = {"type": "Polygon", "coordinates": points}
            yield {"type": "Feature", "properties": properties, "geometry": geometry}
    if waiting:
        raise FileError(f"{source / 'map.geojson'}: must have areas for {waiting}")
