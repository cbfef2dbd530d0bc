"""The order of the columns id and frame in files that do not name them: the rows tell it."""

import logging
import math

import numpy as np

from cocap_opt.data import FloatArray, ProblemError
from cocap_opt.scenarios.tracks.rows import Values

log = logging.getLogger(__name__)

_FAR_CLEARER = 10.0  # times farther apart are the rows of one id in the wrong order of columns
_FASTEST = 12.0  # m/s, of people


def in_likely_order(values: Values, metre: float, fps: float) -> Values:
    """Returns the columns with id and frame in the order that the rows tell.

    Of one id, rows that follow in time are near each other and no faster than people are; rows of
    different people at one frame are not.

    Parameters
    ----------
    metre : one metre in the unit of the file

    Raises
    ------
    ProblemError
        If both orders fit.
    """
    if "frame" not in values or "id" not in values:
        return values
    points = np.column_stack([values["x"], values["y"]]) / metre
    orders = [("id", "frame"), ("frame", "id")]
    (own, speed), (other, swapped) = (_pace(values[a], values[b], points) for a, b in orders)
    if own * _FAR_CLEARER <= other or speed * fps <= _FASTEST < swapped * fps:
        return values
    if other * _FAR_CLEARER <= own or swapped * fps <= _FASTEST < speed * fps:
        log.warning("nothing names its columns; by how people move they are frame id x y")
        return values | {"id": values["frame"], "frame": values["id"]}
    raise ProblemError(
        "columns: must be given, for nothing names them and the rows fit both readings: "
        'columns = ["id", "frame", "x", "y"] or ["frame", "id", "x", "y"], with "z" if it is there'
    )


def _pace(ids: FloatArray, frames: FloatArray, points: FloatArray) -> tuple[float, float]:
    """Returns the median way (m) between rows of one id that follow in time, and that per frame.

    Both are infinite if no id has two rows.
    """
    order = np.lexsort([frames, ids])
    same = np.flatnonzero((np.diff(ids[order]) == 0) & (np.diff(frames[order]) > 0))
    if not len(same):
        return math.inf, math.inf
    ways = np.diff(points[order], axis=0)[same]
    lengths = np.hypot(ways[:, 0], ways[:, 1])
    return float(np.median(lengths)), float(np.median(lengths / np.diff(frames[order])[same]))
