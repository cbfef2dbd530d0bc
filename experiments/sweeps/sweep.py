"""A sweep from begin to end: workers hired, progress shown, results written."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

from cocap_opt.experiments.console.progress import Watch, watching
from cocap_opt.experiments.console.streams import say
from cocap_opt.experiments.results.files import clear_leftovers, make_folder, only_writer
from cocap_opt.experiments.results.layout import FOLDERS
from cocap_opt.experiments.results.rows import Row
from cocap_opt.experiments.sweeps.about import about_run
from cocap_opt.experiments.sweeps.cells import CellFile, Status, Store
from cocap_opt.experiments.sweeps.crew import Alone, Crew
from cocap_opt.experiments.sweeps.earlier import Earlier, IsSame, Key, earlier
from cocap_opt.experiments.sweeps.output import Output
from cocap_opt.experiments.sweeps.run import Group, Settings, recall, run
from cocap_opt.stop import Limit, Stop, catch_interrupt

NOTHING: Row = {}


class Hired(NamedTuple):
    """Who computes: this process, so many workers of its own, or those of a scheduler."""

    workers: int | None
    scheduler: str | None
    cell_limit: float  # s

    @property
    def words(self) -> str:
        """Who, in words."""
        if self.scheduler is not None:
            return self.scheduler
        return "this process" if self.workers is None else f"{self.workers} processes"


def _still_the_same(key: Key, digest: str) -> bool:
    """Of scenes that come with the code, whose rows leave when it changes."""
    return True


def sweep(
    groups: Sequence[Group],
    settings: Settings,
    folder: Path | None,
    hired: Hired,
    retry: bool = False,
    about: Row = NOTHING,
    is_same: IsSame = _still_the_same,
) -> list[Row]:
    """Compute what is missing; write run.json, results.csv, results.parquet, and what they name.

    Rows of earlier runs stay in them, if settings and code are the same.

    Parameters
    ----------
    settings : that all groups share
    retry : cells in the folder that have failed are computed, too
    about : keys that all rows get besides
    is_same : whether a scene and seed of an earlier row, which is not among the groups, still has
        the digest that the row says

    Returns
    -------
    The rows that were asked for, of scenes and seeds that are whole, and of one that Ctrl-C has
    cut short.
    """
    make_folder(folder, *FOLDERS)
    with only_writer(folder):
        if folder is not None:
            clear_leftovers([folder, *(folder / part for part in FOLDERS)])
        before = earlier(folder, groups, settings, about, is_same)
        return _sweep(groups, settings, folder, hired, retry, about, before)


def _sweep(
    groups: Sequence[Group],
    settings: Settings,
    folder: Path | None,
    hired: Hired,
    retry: bool,
    about: Row,
    before: Earlier,
) -> list[Row]:
    scenes = list(dict.fromkeys(group.problem.name for group in groups))
    seeds = sorted({group.seed for group in groups})
    begun = partial(about_run, scenes, seeds, hired.words)
    output = Output(folder, groups, settings, before, begun, about)
    store = Store(folder, retry, hired.cell_limit)
    missing, known = recall(groups, store)
    if known:
        say(f"{known} of {known + missing} cells are in {folder} already")
    for group in groups:
        for content in group.contents:
            _tell_failure(content, store)
    output.update()
    with catch_interrupt() as interrupt, watching("gap", parts=missing) as watch:

        def told(content: CellFile) -> None:
            watch.finish()
            watch.show(f"done: {content.cell.words}")
            _tell_failure(content, store)
            output.update()

        nobody = Hired(None, None, hired.cell_limit)
        with _crew(hired if missing else nobody, interrupt, watch) as crew:
            run(groups, crew, store, interrupt, told)
        cut = interrupt() is not Limit.NONE
    rows = output.rows()
    if cut and not rows:  # there is nothing to give
        raise KeyboardInterrupt
    if cut:
        whole = sum(group.is_whole and not group.is_cut for group in groups)
        again = "; the same command goes on" if folder is not None else ""
        say(f"interrupted: {whole} of {len(groups)} scenes and seeds are whole{again}")
    return rows


def has_error(row: Row) -> bool:
    """Whether the planner or the bound of a row ended by an error, which is no result."""
    return Status.ERROR in (row["reason"], row["bound_reason"])


def _tell_failure(content: CellFile, store: Store) -> None:
    """Say why a cell has no result, and where the traceback of an error is."""
    if content.is_finished:
        return
    path = store.path(content.cell) if content.traceback else None
    where = "" if path is None else f"; traceback: {path}"
    say(f"{content.cell.words}: {content.status}: {content.message}{where}")


@contextmanager
def _crew(hired: Hired, stop: Stop, watch: Watch) -> Iterator[Crew]:
    if hired.scheduler is None and hired.workers is None:
        yield Alone(stop, watch)
        return
    from cocap_opt.experiments.sweeps.cluster import existing, local  # dask is slow to import

    if hired.scheduler is not None:
        with existing(hired.scheduler, stop, hired.cell_limit) as cluster:
            yield cluster
    else:
        assert hired.workers is not None
        with local(hired.workers, stop, hired.cell_limit) as cluster:
            yield cluster
