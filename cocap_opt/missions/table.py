"""Flights as a table (.csv), with a row per drone and moment."""

import io

import numpy as np

from cocap_opt.flight.flights import Flight
from cocap_opt.flight.notes import Kind, Note
from cocap_opt.missions.export import Export

_ANGLES = Note(
    "angles in the file are in degrees: yaw is 0 along x and grows counter-clockwise; pitch is "
    "that of the camera, 0 where it is level and negative where it looks down",
    Kind.READING,
)
_DIGITS = {"latitude": 9, "longitude": 9}  # all others have 6


def write(flight: Flight, every: float | None) -> Export:
    """Returns the columns of flights as CSV."""
    columns = flight.columns(every)
    formats = ["%d" if k == "drone" else f"%.{_DIGITS.get(k, 6)}f" for k in columns]
    text = io.StringIO(newline="")
    rows = np.column_stack(list(columns.values())) + 0.0  # turns -0 into 0
    np.savetxt(
        text, rows, fmt=formats, delimiter=",", header=",".join(columns), comments="",
        newline="\n",
    )  # fmt: skip
    return Export({"": text.getvalue().encode()}, (*flight.between_rows(every), _ANGLES))
