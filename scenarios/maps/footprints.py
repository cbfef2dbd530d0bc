"""The footprints of buildings in a file, of which some are obstacles, and the areas they cover."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import shapely
from shapely.geometry.base import BaseGeometry

from cocap_opt.scenarios.maps.building_heights import (
    is_canopy,
    is_no_building,
    is_outline,
    is_part,
    is_underground,
    may_be_underground,
)

SLIVER = 0.01  # m2; a smaller area is a rounding error

_Says = Callable[[Mapping[str, Any]], bool]  # what properties say


class Footprint(NamedTuple):
    """The area of a feature of a file."""

    area: BaseGeometry  # m
    field: str  # field of the feature, for messages
    properties: Mapping[str, Any]


def obstacles_of(footprints: Sequence[Footprint]) -> tuple[list[Footprint], list[str]]:
    """Returns the footprints that are obstacles, and notes about the others and about doubts."""
    notes = list[str]()

    def note(number: int, words: str) -> None:
        if number:
            notes.append(f"{number} of {len(footprints)} polygons {words}")

    def without(known: Sequence[Footprint], is_left_out: _Says, words: str) -> list[Footprint]:
        kept = [found for found in known if not is_left_out(found.properties)]
        note(len(known) - len(kept), words)
        return kept

    kept = without(footprints, is_underground, "are underground, and are left out")
    kept = without(kept, is_no_building, "have building = no: left out")
    kept, opened = _by_parts(kept)
    note(opened, "are outlines of buildings whose parts (building:part) are in the file, which "
         "count instead")  # fmt: skip
    note(sum(is_canopy(found.properties) for found in kept), "are roofs (building = roof) whose "
         "underside is not stated (min_height): they are solid from the ground")  # fmt: skip
    note(sum(may_be_underground(found.properties) for found in kept), "are buildings with a "
         "negative layer; if they are underground, write location = underground in the "
         "file")  # fmt: skip
    return kept, notes


def _by_parts(footprints: list[Footprint]) -> tuple[list[Footprint], int]:
    """Returns the footprints, of outlines only the area that no part covers, and how many outlines
    have parts.
    """
    parts = [found.area for found in footprints if is_part(found.properties)]
    if not parts:
        return footprints, 0
    covered, result, opened = shapely.union_all(parts), list[Footprint](), 0
    for found in footprints:
        if is_part(found.properties) or not is_outline(found.properties):
            result.append(found)
            continue
        rest = shapely.difference(found.area, covered)
        if found.area.area - rest.area <= SLIVER:  # it has no parts
            result.append(found)
            continue
        opened += 1
        if rest.area > SLIVER * max(found.area.area, 1.0):
            result.append(found._replace(area=rest))
    return result, opened
