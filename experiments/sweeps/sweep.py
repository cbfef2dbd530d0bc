"""A sweep from begin to end: workers hired, progress shown, results written."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from cocap_opt.stop import Stop, catch_interrupt
from experiments.files import make_folder
from experiments.progress import Watch, watching
from experiments.rows import Row
from experiments.streams import say
from experiments.sweeps.about import about_run, save_run
from experiments.sweeps.cells import BOUND, CellFile, Store
from experiments.sweeps.crew import Alone, Crew
from experiments.sweeps.results import save_results
from experiments.sweeps.run import Group, Settings, recall, run

NOTHING: Row = {}
PARTS = ("cells", "certificates", "plans")  # folders in a sweep's folder


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


def sweep(
    groups: Sequence[Group],
    settings: Settings,
    folder: Path | None,
    hired: Hired,
    retry: bool = False,
    about: Row = NOTHING,
) -> list[Row]:
    """Compute what is missing and write run.json, results.csv and results.parquet.

    Parameters
    ----------
    settings : that all groups share
    retry : cells in the folder that have failed are computed, too
    about : keys that all rows get besides

    Returns
    -------
    The rows of all scenes and seeds that are whole.
    """
    make_folder(folder, *PARTS)
    if folder is not None:
        scenes = list(dict.fromkeys(group.problem.name for group in groups))
        seeds = sorted({group.seed for group in groups})
        save_run(folder, about_run(settings, scenes, seeds, hired.words))
    store = Store(folder, retry)
    missing, known = recall(groups, store)
    if known:
        say(f"{known} of {known + missing} cells are in {folder} already")
    with catch_interrupt() as interrupt, watching("gap", parts=missing) as watch:

        def told(content: CellFile) -> None:
            watch.finish()
            watch.show(f"done: {content.cell.words}")
            if not content.is_finished:
                say(f"{content.cell.words}: {content.status}: {content.message}")
            if content.cell.planner == BOUND:
                save_results(folder, rows_of(groups, about))

        nobody = Hired(None, None, hired.cell_limit)
        with _crew(hired if missing else nobody, interrupt, watch) as crew:
            run(groups, crew, store, folder, interrupt, told)
    rows = rows_of(groups, about)
    save_results(folder, rows, whole=True)
    return rows


def rows_of(groups: Sequence[Group], about: Row) -> list[Row]:
    """Rows of all scenes and seeds that are whole, in the order in which they were asked for."""
    return [row | about for group in groups if group.is_whole for row in group.rows()]


@contextmanager
def _crew(hired: Hired, stop: Stop, watch: Watch) -> Iterator[Crew]:
    if hired.scheduler is None and hired.workers is None:
        yield Alone(stop, watch)
        return
    from experiments.sweeps.cluster import existing, local  # dask is slow to import

    if hired.scheduler is not None:
        with existing(hired.scheduler, stop, hired.cell_limit) as cluster:
            yield cluster
    else:
        assert hired.workers is not None
        with local(hired.workers, stop, hired.cell_limit) as cluster:
            yield cluster
