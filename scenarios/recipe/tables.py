"""What the tables of a recipe are made of."""

from typing import Annotated

import msgspec
from msgspec import Meta

from cocap_opt.data import LARGEST, SMALLEST

Coordinate = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]  # m, or degrees
Length = Annotated[float, Meta(ge=SMALLEST, le=LARGEST)]  # m
Size = Annotated[float, Meta(ge=0, le=LARGEST)]  # m, or m/s
Count = Annotated[int, Meta(ge=1, le=1000)]
Point = tuple[Coordinate, Coordinate]


class Table(msgspec.Struct, forbid_unknown_fields=True, kw_only=True):
    """Base of all tables: a misspelt field is an error."""
