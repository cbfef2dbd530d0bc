"""The unit of lengths that a mesh file states in a comment, as in `# File units = inches`.

These formats have no field for it, but SketchUp writes this comment to OBJ, and other programs
write similar ones. glTF is in metres by definition.
"""

import re
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from cocap_opt.data import ProblemError
from cocap_opt.scenarios.earth.lengths import unit_of_length
from cocap_opt.scenarios.tables import PER_METRE, Unit

# What has the unit, the unit, and how many of one make how many of the other: 1 unit = 2.54 cm.
_STATED = re.compile(
    r"(?:(?P<of>[^\W\d_]+)\s+)?(?:(?<![^\s=:])(?<!\w )(?P<many>\d[\d.,]*)\s+)?"
    r"\bunits?\b(?:\s+of\s+length)?\s*"
    r"(?:[:=]|\bis\b|\bare\b|(?=[^\W\d_]+\s*$))\s*(?P<number>[-+]?[\d.,]*\d(?:e[-+]?\d+)?)?(?P<unit>.*)",
    re.IGNORECASE,
)
# Other words about the unit, as in "coordinates are in feet" or "length unit [ft]".
_ABOUT_LENGTHS = re.compile(
    r"\b(?:units?|coordinates?|vertices|lengths?|dimensions?|measured|metric|"
    r"imperial|(?:ex|im)port\w*)\b",
    re.IGNORECASE,
)
_IN_UNIT = re.compile(
    r"\bin[\s-]+([a-z]+(?:[\s-]+(?:survey[\s-]+)?(?:feet|foot|ft))?)\b"
    r"|[\[(]\s*([^\])]*?)\s*[\])]|\b\d[\d.,]*\s*([a-z]+)\b",
    re.IGNORECASE,
)
_FACTOR = re.compile(
    r"[:=]\s*([-+]?\d[\d.,]*(?:e[-+]?\d+)?)|(\d[\d.,]*)\s*(?=[a-z]*\s*=)", re.IGNORECASE
)
_NO_LENGTHS = {"texture", "textures", "uv", "angle", "angles", "angular", "time", "mass", "colour",
               "color"}  # fmt: skip
# Lengths in which recipes have no coordinates.
_OTHERS = {
    "in", "inch", "inches", "yd", "yard", "yards", "mile", "miles", "km", "kilometer", "kilometers",
    "kilometre", "kilometres", "mil", "mils", "thou", "micron", "microns", "um", "micrometer",
    "micrometers", "micrometre", "micrometres",
}  # fmt: skip
_HEADER = 80  # bytes, of STL
_COMMENT, _PLY_COMMENT = re.compile(rb"#(.*)"), re.compile(rb"^\s*(?:comment|obj_info) (.*)")


def settled_unit(path: Path, unit: Unit | None) -> str:
    """Returns the unit of a file: as a comment states, else as the recipe states, else m.

    Raises
    ------
    ProblemError
        If the file states two units, one that is not supported, or another one than the recipe.
    """
    found: dict[str, str] = {}
    for comment in _comments(path):
        name, is_one = _stated_in(comment)
        if name is None:
            continue
        found.setdefault(name, comment.strip()[:60])
        if not is_one:
            raise ProblemError(
                f"unit: a comment states {comment.strip()[:60]!r}, which is a scale: export "
                f"the mesh in one of {', '.join(PER_METRE)}"
            )
    if len(found) > 1:
        raise ProblemError(f"unit: must be one, but comments state {' and '.join(found)}")
    for name, comment in found.items():
        if name not in PER_METRE:
            raise ProblemError(
                f"unit: must be {', '.join(PER_METRE)}, but a comment states {comment!r}; export "
                "the mesh in one of these units"
            )
        if unit is not None and unit != name:
            raise ProblemError(
                f"unit: must be {name!r} or left out, as a comment states {comment!r}, not {unit!r}"
            )
        return name
    return unit or "m"


def _stated_in(comment: str) -> tuple[str | None, bool]:
    """Returns the unit that a comment states, or None, and True if it is one of one."""
    stated = _STATED.search(comment)
    if stated is not None:
        if (stated["of"] or "").lower() in _NO_LENGTHS:
            return None, True
        if name := _unit_in(stated["unit"]):
            return name, _is_one(stated["many"]) and _is_one(stated["number"])
    if not _ABOUT_LENGTHS.search(comment):
        return None, True
    words = (word for found in _IN_UNIT.findall(comment) for word in found if word)
    names = {name for word in words if (name := _unit_in(word))}
    numbers = (number for found in _FACTOR.findall(comment) for number in found if number)
    return (names.pop(), all(map(_is_one, numbers))) if len(names) == 1 else (None, True)


def _is_one(number: str | None) -> bool:
    """Returns True if a number is 1, or left out."""
    with suppress(ValueError):
        return number is None or float(number.replace(",", ".")) == 1
    return False


def _unit_in(text: str) -> str | None:
    """Returns the unit at the beginning of a text, by its short name; None if there is none."""
    words = re.findall(r"[^\W\d_]+", text)[:3]
    for count in range(len(words), 0, -1):  # "US survey feet" before "US"
        if short := unit_of_length(" ".join(words[:count])):
            return short
    return words[0].lower() if words and words[0].lower() in _OTHERS else None


def _comments(path: Path) -> Iterator[str]:
    """Yields the comments of a file in text, or the header of STL."""
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".off", ".ply", ".stl"):
        return
    with path.open("rb") as file:
        if suffix == ".stl":
            yield file.readline(_HEADER).decode("latin-1")
            return
        comment = _PLY_COMMENT if suffix == ".ply" else _COMMENT
        for line in file:  # as bytes: meshes have millions of lines
            if suffix == ".ply" and line.strip() == b"end_header":
                return
            if found := comment.search(line):
                yield found[1].decode("latin-1")
