"""Kinds of texts that a recipe names and that are no scenes themselves, told by all their content.

`cocap_opt.scenarios.foreign` tells files of any kind by their first bytes.
"""

import re
from collections.abc import Mapping
from typing import Any

import msgspec

GEOJSON, WKT, CITYJSON, GROUND_PLAN = "GeoJSON", "WKT", "CityJSON", "a ground plan in JSON"

_GEOMETRIES = (
    "FeatureCollection", "Feature", "GeometryCollection", "Polygon", "MultiPolygon", "LineString",
    "MultiLineString", "Point", "MultiPoint",
)  # fmt: skip
_CURVED = "CurvePolygon", "MultiSurface", "PolyhedralSurface", "Triangle", "TIN"  # of WKT only
_WKT = re.compile(
    rf"\s*(?:SRID\s*=\s*\d+\s*;\s*)?(?:{'|'.join((*_GEOMETRIES[2:], *_CURVED))})"
    r"\s*(?:Z|M|ZM)?\s*(?:\(|EMPTY)",
    re.IGNORECASE,
)

_IN_A_RECIPE = "of a recipe, of which `cocap-opt recipe` prints an example"
_ANY = msgspec.json.Decoder(float_hook=str)  # of numbers that are too large, too
_WALLS = f"name it under [[walls]] {_IN_A_RECIPE}"
WAYS_OUT: Mapping[str, str] = {  # what to do with a file that is named as a scene
    GEOJSON: _WALLS,
    WKT: _WALLS,
    GROUND_PLAN: _WALLS,
    CITYJSON: f"write its buildings as .obj, as cjio does, and name that under [[mesh]] "
    f"{_IN_A_RECIPE}",
}


def is_wkt(text: str) -> bool:
    """Returns True if a text begins as WKT does."""
    return _WKT.match(text) is not None


def kind_of_text(text: str) -> str | None:
    """Returns the kind of a text, one of those in `WAYS_OUT`, or None if it is no such text."""
    if is_wkt(text):
        return WKT
    try:
        content: Any = _ANY.decode(text)
    except (msgspec.MsgspecError, RecursionError):
        return None
    if not isinstance(content, dict):
        return None
    if content.get("type") == "CityJSON":
        return CITYJSON
    if content.get("type") in _GEOMETRIES:
        return GEOJSON
    plans = content.values()
    is_plan = all(isinstance(plan, dict) and "walkable" in plan for plan in plans)
    return GROUND_PLAN if plans and is_plan else None
