"""The value and bound of a method over time, and the file in which they are stored.

The file is a CSV with the columns value, bound (in units of J), seconds, columns, nodes; a value or
bound that was not known yet is an empty field.
"""

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path

from cocap_opt.files.documents import FileError
from cocap_opt.formulations.result import CertifiedResult, Report, Snapshot
from cocap_opt.output.files import read_text

_COLUMNS = Snapshot._fields
_MOST = 1e100  # larger than any J


class Trace:
    """Stores what a method reports: its best value and bound, whenever one has improved.

    Examples
    --------
    >>> trace = Trace()
    >>> result = EXACT["branch-and-price"](problem, report=trace.report)
    >>> trace.end(result)
    """

    def __init__(self, snapshots: Sequence[Snapshot] = ()) -> None:
        self._snapshots = list(snapshots)

    @classmethod
    def load(cls, path: Path) -> "Trace":
        """Reads a trace from a file.

        Raises
        ------
        FileError
            If the file cannot be read, or is not such a CSV.
        """
        rows = csv.DictReader(io.StringIO(read_text(path)))
        if tuple(rows.fieldnames or ()) != _COLUMNS:
            raise FileError(f"{path}: must be a CSV with the columns {', '.join(_COLUMNS)}")
        return cls([_snapshot(row, f"{path}: line {rows.line_num}") for row in rows])

    @property
    def snapshots(self) -> tuple[Snapshot, ...]:
        """All stored snapshots, in order of time."""
        return tuple(self._snapshots)

    @property
    def text(self) -> str:
        """The trace as CSV.

        A search reports the bound of its open part. If that is below the best value, this value is
        the bound.
        """
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(_COLUMNS)
        for kept in self._snapshots:
            snapshot = kept._replace(bound=max(kept.bound, kept.value))
            writer.writerow("" if math.isinf(number) else number for number in snapshot)
        return text.getvalue()

    def report(self, snapshot: Snapshot) -> None:
        """Stores a snapshot that is better than those before."""
        if self._snapshots:
            last = self._snapshots[-1]
            better = max(last.value, snapshot.value), min(last.bound, snapshot.bound)
            if better == (last.value, last.bound):
                return
            snapshot = snapshot._replace(value=better[0], bound=better[1])
        self._snapshots.append(snapshot)

    def beside(self, other: Report) -> Report:
        """Returns a report function that passes snapshots on to another one, and to this trace."""

        def report(snapshot: Snapshot) -> None:
            other(snapshot)
            self.report(snapshot)

        return report

    def end(self, result: CertifiedResult) -> None:
        """Stores how the method ended, even if nothing has improved since the last snapshot."""
        last = self._snapshots[-1] if self._snapshots else Snapshot(-math.inf, math.inf, 0.0)
        self._snapshots.append(
            last._replace(value=result.value, bound=result.bound, seconds=result.seconds)
        )


def _snapshot(row: dict[str, str], where: str) -> Snapshot:
    try:
        if None in row.values() or None in row:  # too few or too many
            raise ValueError
        value = float(row["value"] or -math.inf)
        # Earlier versions stored the bound of the open part, which may be lower.
        bound = max(float(row["bound"] or math.inf), value)
        found = Snapshot(
            value, bound, float(row["seconds"]), int(row["columns"]), int(row["nodes"])
        )
    except (TypeError, ValueError) as error:
        raise FileError(f"{where}: must be five numbers") from error
    if not (0 <= found.seconds < math.inf and value <= bound):  # False for nan, too
        raise FileError(f"{where}: must be five numbers, seconds >= 0")
    if any(row[key] and abs(float(row[key])) > _MOST for key in ("value", "bound")):
        raise FileError(f"{where}: value and bound must be at most {_MOST:g}, or empty")
    return found
