"""The Earth: reference systems by name, their units, and the place of a scene.

This module contains the names of systems, and checks whether two texts mean the same system.
"""

import re

_SHOWN = 60  # letters of a system's name in a message
# The code of a whole system, at the end of its WKT.
_CODE = re.compile(r'(?:ID|AUTHORITY)\s*\[\s*"(\w+)"\s*,\s*"?(\d+)"?\s*\]\s*\]\s*$')


def short_name(crs: str) -> str:
    """Returns a code unchanged, or the name in WKT."""
    return crs.split('"')[1] if crs.count('"') > 1 else crs[:_SHOWN]


def same_system(crs: str, other: str) -> bool:
    """Returns True if two texts mean the same reference system."""
    crs, other = (text.strip().partition("+")[0] for text in (crs, other))  # without heights
    if _coded(crs).upper() == _coded(other).upper():
        return True
    try:
        import rasterio
        from rasterio.crs import CRS
        from rasterio.errors import CRSError
    except ImportError:
        return False
    try:
        with rasterio.Env():  # prevents GDAL from printing
            return bool(CRS.from_user_input(crs) == CRS.from_user_input(other))
    except CRSError:
        return False


def _coded(crs: str) -> str:
    """Returns the code at the end of WKT; any other text is returned unchanged."""
    found = _CODE.search(crs)
    return f"{found[1]}:{found[2]}" if found else crs


def utm(longitude: float, latitude: float) -> str:
    """Returns the code of the UTM system, in metres, for a place in degrees."""
    zone = min(int((longitude + 180) // 6) + 1, 60)
    return f"EPSG:{(32700 if latitude < 0 else 32600) + zone}"


def wkt_of_code(code: int) -> str | None:
    """Returns the WKT of an EPSG code; None if rasterio is not installed or does not know the
    code.
    """
    try:
        import rasterio
        from rasterio.crs import CRS
        from rasterio.errors import CRSError
    except ImportError:
        return None
    try:
        with rasterio.Env():  # prevents GDAL from printing
            return str(CRS.from_epsg(code).to_wkt())
    except CRSError:
        return None
