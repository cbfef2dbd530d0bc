"""Units of length as files spell them, and their reconciliation with the unit that a recipe names.

Sources: an international foot is 0.3048 m (EPSG 9002), a US survey foot 1200/3937 m (EPSG 9003).
"""

import logging
import math
import re
from typing import NamedTuple

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.tables import PER_METRE, Unit

log = logging.getLogger(__name__)

_UNITS = {
    "m": "m metre metres meter meters mètre mètres metro metros",
    "dm": "dm decimetre decimetres decimeter decimeters",
    "cm": "cm centimetre centimetres centimeter centimeters",
    "mm": "mm millimetre millimetres millimeter millimeters",
    "ft": "ft foot feet '",
    "us-ft": "ftus usft sft usfoot usfeet",
}
_NAMED = {name: unit for unit, names in _UNITS.items() for name in names.split()}
_AMERICAN = {"us", "survey", "american"}
_SAME = {"international", "intl", "int", "sae"}  # words that do not change the meaning of a foot
# The datum of heights does not affect their unit.
_ABOVE = re.compile(
    r"\b(?:above|over|relative|amsl|asl|msl|agl|hae|navd|ngvd|egm|nap|nhn|evrf|dhhn)(?![a-z]).*",
    re.IGNORECASE,
)
_SEPARATORS = re.compile(r"[\s_\-/()\[\]<>,;:]+")
_SAME_UNIT = 1e-4  # relative; a US survey foot is longer than a foot by 2e-6


class Stated(NamedTuple):
    """A unit of length that a file states."""

    name: str  # as the file spells it
    metres: float  # metres per unit


def unit_of_length(text: str) -> str | None:
    """Returns the short name of the unit of length that a text means; None if it is unknown.

    The name is a key of `PER_METRE`, or "dm". Case is ignored: "US survey foot", "us-ft", "ftUS",
    "Foot_US", "FT", "metre".
    """
    words = set(_SEPARATORS.split(text.casefold().replace(".", "").replace("_", " "))) - {""}
    units, others = {_NAMED[word] for word in words & _NAMED.keys()}, words - _NAMED.keys()
    if len(units) != 1 or not others <= _AMERICAN | _SAME:
        return None
    (unit,) = units
    if others and (unit not in ("ft", "us-ft") or (others & _AMERICAN and others & _SAME)):
        return None
    return "us-ft" if others & _AMERICAN else unit


def stated_length(text: str) -> Stated | None:
    """Returns the unit of length that a text means; None if it is unknown."""
    unit = unit_of_length(text)
    if unit is None:
        return None
    return Stated(text.strip(), 0.1 if unit == "dm" else 1 / PER_METRE[unit])


def stated_heights(text: str) -> Stated | None:
    """Returns the unit of heights that a text means; the text may include the datum: "m above
    geoid".
    """
    found = stated_length(_ABOVE.sub("", text.replace(".", "").replace("_", " ")))
    return found and found._replace(name=text.strip())


def metres_of_heights(stated: Stated | None, unit: Unit | None, file: str) -> float:
    """Returns the metres per unit of heights: as stated in the file, else in the recipe, else 1.

    Feet in the recipe mean US survey feet if the file says so. If only the file states a unit other
    than metres, this is logged.

    Raises
    ------
    ProblemError
        If file and recipe state different units.
    """
    if stated is None:
        return 1 / PER_METRE[unit or "m"]
    if unit is None:
        if stated.metres != 1:
            log.warning("%s: its heights are in %s, as the file states", file, stated.name)
        return stated.metres
    if not same_length(stated.metres, 1 / PER_METRE[unit]):
        wanted = "metres" if unit == "m" else f"{unit}, the value of the field unit"
        short = _short(stated.metres)
        way_out = f'set unit = "{short}"' if short else "leave unit out to use the file's own"
        raise ProblemError(f"heights: must be {wanted}, not {stated.name}; {way_out}")
    return 1 / PER_METRE[unit] if unit == "us-ft" else stated.metres


def unknown(name: str) -> ProblemError:
    """Returns the error for heights in an unknown unit."""
    return ProblemError(
        f"heights: must be in {', '.join(PER_METRE)}, or a longer name of these, not in "
        f"{name.strip()[:40]!r}; if a GeoTIFF is in metres, state it with gdal_edit.py -units m"
    )


def _short(metres: float) -> str | None:
    """Returns the short name of a unit, given its length in metres; None if it has none."""
    found = [unit for unit, per_metre in PER_METRE.items() if same_length(metres, 1 / per_metre)]
    return min(found, key=lambda unit: abs(metres * PER_METRE[unit] - 1), default=None)


def same_length(metres: float, other: float) -> bool:
    """Returns True if two units have the same length, in m, but for the kind of foot."""
    return math.isclose(metres, other, rel_tol=_SAME_UNIT)
