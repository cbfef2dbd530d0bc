"""The base and the field types of a recipe's tables."""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from cocap_opt.data import LARGEST, MOST_WEIGHT, SMALLEST

Flight = Literal["above-ground", "above-sea"]
ABOVE_GROUND: Flight = "above-ground"
Unit = Literal["m", "cm", "mm", "ft", "us-ft"]
TimeUnit = Literal["s", "ms", "us", "ns"]
PER_METRE: dict[str, float] = {
    "m": 1.0, "cm": 100.0, "mm": 1000.0, "ft": 1 / 0.3048, "us-ft": 3937 / 1200,
}  # fmt: skip
PER_SECOND: dict[str, int] = {"s": 1, "ms": 10**3, "us": 10**6, "ns": 10**9}
Coordinate = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]  # m, or degrees
Length = Annotated[float, Meta(ge=SMALLEST, le=LARGEST)]  # m
Size = Annotated[float, Meta(ge=0, le=LARGEST)]  # m, or m/s
Factor = Annotated[float, Meta(ge=0, le=MOST_WEIGHT)]
Count = Annotated[int, Meta(ge=1, le=1000)]
Heading = Annotated[float, Meta(ge=-360, le=360)]  # degrees from +x, counter-clockwise
Point = tuple[Coordinate, Coordinate]


class Table(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """Base of all tables of a recipe, in which a misspelt field is an error."""
