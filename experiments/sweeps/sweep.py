"""A sweep from begin to end: workers hired, progress shown, results written."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from cocap_opt.stop import Stop, catch_interrupt
from experiments.progress import Watch, watching
from experiments.report import Row
from experiments.streams import say
from experiments.sweeps.cells import CellFile, Store
from experiments.sweeps.crew import Alone, Crew
from experiments.sweeps.results import save_results
from experiments.sweeps.run import Group, recall, run

PARTS = ("cells", "certificates", "plans")  # folders in a sweep's folder


class Hired(NamedTuple):
    """Who computes: this process, so many workers of its own, or those of a scheduler."""

    workers: int | None
    scheduler: str | None
    cell_limit: float  # s


def sweep(
    groups: Sequence[Group], store: Store, folder: Path | None, hired: Hired, about: Row
) -> list[Row]:
    """Compute what is missing and write results.csv and results.parquet.

    Parameters
    ----------
    about : keys that all rows get besides

    Returns
    -------
    The rows of all scenes and seeds that are whole.
    """
    missing, known = recall(groups, store)
    if known:
        say(f"{known} of {known + missing} cells are in {folder} already")
    with catch_interrupt() as interrupt, watching("gap", parts=missing) as watch:

        def told(content: CellFile) -> None:
            watch.finish()
            watch.show(f"done: {content.cell.words}")
            if not content.is_finished:
                say(f"{content.cell.words}: {content.status}: {content.message}")
            if content.cell in wholes:
                save_results(folder, rows_of(groups, about))

        wholes = {group.bound for group in groups}
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
