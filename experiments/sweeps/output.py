"""What a run makes of its cells: run.json, results.csv, results.parquet, and the files they name.

All of them tell only of scenes and seeds that are whole, and of what earlier runs left.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from cocap_opt.experiments.results.files import remove
from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.sweeps.about import RUN, Run, save_run
from cocap_opt.experiments.sweeps.earlier import Earlier, key_of
from cocap_opt.experiments.sweeps.publish import published
from cocap_opt.experiments.sweeps.results import save_results
from cocap_opt.experiments.sweeps.run import Group, Settings


class Output:
    """Writes results as they come; without a folder it writes nothing.

    Parameters
    ----------
    before : what earlier runs left, all of which holds until it is replaced
    about_run : what run.json says of this run, which is written with the first results
    about : keys that all rows get besides
    """

    def __init__(
        self,
        folder: Path | None,
        groups: Sequence[Group],
        settings: Settings,
        before: Earlier,
        about_run: Callable[[], Run],
        about: Row,
    ) -> None:
        self._folder, self._groups, self._about = folder, groups, about
        self._settings, self._before, self._about_run = settings, before, about_run
        self._kept: dict[Group, list[Row]] = {}

    def update(self) -> None:
        """Write what has become whole since; what Ctrl-C has cut short is not written."""
        if self._folder is None:
            return
        new = [g for g in self._groups if g.is_whole and not g.is_cut and g not in self._kept]
        if not new:
            return
        is_first = not self._kept
        if is_first and not self._before.runs:  # results of other settings, for a moment
            remove(self._folder / RUN)
        if is_first and self._before.runs:
            self._save_run()
        for group in new:
            self._kept[group] = published(self._folder, group, self._rows(group))
        save_results(self._folder, self._all(), whole=len(self._kept) == len(self._groups))
        if is_first and not self._before.runs:
            self._save_run()

    def _save_run(self) -> None:
        assert self._folder is not None
        save_run(self._folder, self._settings, self._before.runs, self._about_run())

    def rows(self) -> list[Row]:
        """All rows that this run was asked for and has, in that order."""
        return [
            row
            for group in self._groups
            if group.is_whole
            for row in self._kept.get(group) or self._rows(group)
            if row["planner"] in group.asked
        ]

    def _all(self) -> list[Row]:
        """Rows of all that the folder has, scene by scene, those of this run last."""
        rest = dict(self._before.rows)
        own = []
        for group in self._groups:
            before = rest.pop(key_of(group, self._about), [])
            own.append(self._kept.get(group, before))
        rows = [row for some in (*rest.values(), *own) for row in some]
        scenes = list(dict.fromkeys(row["scene"] for row in rows))
        return sorted(rows, key=lambda row: scenes.index(row["scene"]))

    def _rows(self, group: Group) -> list[Row]:
        return [row | self._about for row in group.rows()]
