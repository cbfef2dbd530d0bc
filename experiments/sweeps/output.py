"""What a run makes of its cells: run.json, results.csv, results.parquet, and the files they name.

All of them tell only of scenes and seeds that are whole.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from experiments.rows import Row
from experiments.sweeps.about import RunFile, save_run
from experiments.sweeps.publish import published
from experiments.sweeps.results import save_results
from experiments.sweeps.run import Group


class Output:
    """Writes results as they come; without a folder it writes nothing.

    Parameters
    ----------
    about_run : makes the content of run.json, which is written with the first results
    about : keys that all rows get besides
    """

    def __init__(
        self,
        folder: Path | None,
        groups: Sequence[Group],
        about_run: Callable[[], RunFile],
        about: Row,
    ) -> None:
        self._folder, self._groups, self._about = folder, groups, about
        self._about_run = about_run
        self._kept: dict[Group, list[Row]] = {}

    def update(self) -> None:
        """Write what has become whole since; what Ctrl-C has cut short is not written."""
        if self._folder is None:
            return
        new = [g for g in self._groups if g.is_whole and not g.is_cut and g not in self._kept]
        if not new:
            return
        if not self._kept:
            save_run(self._folder, self._about_run())
        for group in new:
            self._kept[group] = published(self._folder, group, self._rows(group))
        rows = [row for group in self._groups for row in self._kept.get(group, [])]
        save_results(self._folder, rows, whole=len(self._kept) == len(self._groups))

    def rows(self) -> list[Row]:
        """All rows that there are, in the order in which they were asked for."""
        return [
            row
            for group in self._groups
            if group.is_whole
            for row in self._kept.get(group) or self._rows(group)
        ]

    def _rows(self, group: Group) -> list[Row]:
        return [row | self._about for row in group.rows()]
