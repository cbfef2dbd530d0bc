"""The Earth: reference systems by name, their units, and the place of a scene.

This module contains the names of systems, and checks whether two texts mean the same system.
"""

import re

from cocap_opt.data import ProblemError

_SHOWN = 60  # letters of a system's name in a message
_ONE_CODE = re.compile(r"EPSG:(\d+)", re.I)  # may be of a compound system
_TWO_CODES = re.compile(r"(\w+:\d+)\s*\+\s*(?:\w+:)?(\d+)")
# A compound system in WKT, up to the bracket behind the keyword of its first part.
_COMPOUND = re.compile(r'(?:COMPD_CS|COMPOUNDCRS)\s*[\[(]\s*"[^"]*"\s*,\s*(\w+\s*[\[(])', re.I)
# The name of the zero of heights in WKT.
_ZERO = re.compile(r'\b(?:VERT_DATUM|VDATUM|VRF)\s*[\[(]\s*"([^"]+)"', re.I)
# The code of a whole system, at the end of its WKT.
_CODE = re.compile(r'(?:ID|AUTHORITY)\s*\[\s*"(\w+)"\s*,\s*"?(\d+)"?\s*\]\s*\]\s*$')


def short_name(crs: str) -> str:
    """Returns a code unchanged, or the name in WKT."""
    return crs.split('"')[1] if crs.count('"') > 1 else crs[:_SHOWN]


def same_system(crs: str, other: str) -> bool:
    """Returns True if two texts mean the same reference system, apart from heights."""
    crs, other = _horizontal(crs), _horizontal(other)
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


def has_heights(crs: str) -> bool:
    """Returns True if a text of a reference system names a system of heights above the sea, too."""
    return _horizontal(crs) != crs.strip()


def zero_of_heights(crs: str) -> str | None:
    """Returns the name of the zero from which a system's heights above the sea count.

    Returns None if it has none, or if rasterio is needed to tell and not installed.
    """
    crs = crs.strip()
    codes, code = _TWO_CODES.fullmatch(crs), _ONE_CODE.fullmatch(crs)
    if codes is not None:
        crs = wkt_of_code(int(codes[2])) or crs
    elif code is not None:
        crs = wkt_of_code(int(code[1])) or crs
    found = _ZERO.search(crs)
    return found[1] if found else None


def require_system_of_map(
    crs: str | None, of_map: str | None, *, has_altitudes: bool = False
) -> None:
    """Raises ProblemError if a file is in another reference system than the map.

    Parameters
    ----------
    crs, of_map : systems that the files state; None: none
    has_altitudes : True: altitudes in both must count from the same zero, too
    """
    if crs and of_map and not same_system(crs, of_map):
        raise ProblemError(
            f"must be in the reference system of the map, {short_name(of_map)}, not in "
            f"{short_name(crs)}; convert it with gdalwarp -t_srs"
        )
    if not has_altitudes:
        return
    zeros = [zero_of_heights(text) if text else None for text in (crs, of_map)]
    if None not in zeros and zeros[0] != zeros[1]:
        raise ProblemError(
            f"must have heights from the same zero as the map, {zeros[1]!r}, not from "
            f"{zeros[0]!r}; convert it with gdalwarp -t_srs"
        )


def _horizontal(crs: str) -> str:
    """Returns a text of a reference system without its system of heights."""
    crs = crs.strip()
    if codes := _TWO_CODES.fullmatch(crs):
        return codes[1]
    code = _ONE_CODE.fullmatch(crs)
    text = crs if code is None else wkt_of_code(int(code[1])) or crs
    compound = _COMPOUND.match(text)
    if compound is None:
        return crs
    depth, is_quoted = 0, False
    for k in range(compound.end() - 1, len(text)):
        is_quoted ^= text[k] == '"'
        depth += 0 if is_quoted else (text[k] in "[(") - (text[k] in "])")
        if depth == 0:
            return text[compound.start(1) : k + 1]
    return crs


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
