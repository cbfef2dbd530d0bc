"""Files beside a grid that tell its reference system: `.prj`, `.qpj` and `.aux.xml`."""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.earth.lengths import Stated, stated_heights, unknown
from cocap_opt.scenarios.earth.units import (
    NeedsPyprojError,
    NotTrueError,
    Units,
    require_metres,
    units_of,
)
from cocap_opt.scenarios.text import naming, number, xml_root

_PLAIN = {"Scale": 1, "Offset": 0}  # GDAL's, of heights that are stored as they are
_LARGEST = 1 << 20  # bytes; WKT has some thousands


class Beside(NamedTuple):
    """The statements of the files beside a grid whose x and y are metres."""

    crs: str | None = None  # the reference system; None where a file only says its units
    heights: Stated | None = None  # unit of the heights


def beside(path: Path) -> Beside | None:
    """Returns what files beside a grid say of its units, or None if there are none.

    They are named as the grid, with the ending in its place or after it, in large or small letters.

    Raises
    ------
    ProblemError
        If one says that x and y are no metres, or nobody can judge what it says; it is named.
    """
    found = [told for other in _files(path) for told in _read(other)]
    if not found:
        return None
    units = [told.heights for told in found if told.heights is not None]
    if len({unit.metres for unit in units}) > 1:
        raise ProblemError(
            "heights: files beside it must say one unit, not "
            f"{' and '.join(dict.fromkeys(unit.name for unit in units))}"
        )
    systems = [told.crs for told in found if told.crs is not None]
    return Beside(systems[0] if systems else None, units[0] if units else None)


def _files(path: Path) -> list[Path]:
    names = [f"{path.stem}.prj", f"{path.name}.prj", f"{path.stem}.qpj", f"{path.name}.aux.xml"]
    wanted = [name.casefold() for name in names]
    files = [other for other in path.parent.iterdir() if other.name.casefold() in wanted]
    return sorted(files, key=lambda other: (wanted.index(other.name.casefold()), other.name))


def _read(path: Path) -> Iterator[Beside]:
    with naming(path):
        with path.open("rb") as file:
            content = file.read(_LARGEST + 1)
        if len(content) > _LARGEST:
            raise ProblemError(f"must have at most {_LARGEST} bytes")
        if path.suffix.casefold() == ".xml":
            yield from _of_xml(content)
            return
        text = content.decode("utf-8-sig", errors="replace")
        try:
            units = units_of(text)
        except (NeedsPyprojError, NotTrueError):
            raise
        except ProblemError as error:
            raise ProblemError(f"{error}; without this file metres are taken") from error
        yield _of_system(text, units)


def _of_system(text: str, units: Units) -> Beside:
    require_metres(units)
    is_one = not text.strip().casefold().startswith("projection")  # Arc/Info's is for people
    return Beside(text.strip() if is_one else None, units.heights)


def _of_xml(content: bytes) -> Iterator[Beside]:
    """Yields what GDAL and ArcGIS keep beside a raster: a system, a unit of heights."""
    for element in xml_root(content, "XML").iter():
        text = (element.text or "").strip()
        match element.tag.rpartition("}")[2]:
            case "SRS" | "WKT" if text:
                yield _of_system(text, units_of(text))
            case "UnitType" if text:
                unit = stated_heights(text)
                if unit is None:
                    raise unknown(text)
                yield Beside(None, unit)
            case ("Scale" | "Offset") as tag if number(text, tag) != _PLAIN[tag]:
                raise ProblemError(
                    f"{tag}: must be {_PLAIN[tag]} for a grid of text, not {text[:40]}; "
                    "gdal_translate -unscale writes a map without"
                )
