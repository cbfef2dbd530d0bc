"""A sweep from start to end: starts workers, shows progress, writes results."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import NamedTuple

from cocap_opt.console.progress import Watch
from cocap_opt.console.streams import say
from cocap_opt.experiments.sweeps.cells import CellFile, Store
from cocap_opt.experiments.sweeps.crew import Alone, Crew
from cocap_opt.experiments.sweeps.folder import Earlier, IsSame, Output, only_writer
from cocap_opt.experiments.sweeps.instances import Instance, Key
from cocap_opt.experiments.sweeps.results import CommandRun
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.run.forecast import warn_before_limits
from cocap_opt.stop import Interrupt, Stop
from cocap_opt.vision.coverage import usable_cores


class Hired(NamedTuple):
    """The workers of a sweep: this process, new local processes, or a scheduler's workers."""

    workers: int | None = None
    scheduler: str | None = None
    cell_limit: float = 0.0  # s, after which a cell is given up and its worker restarted

    @property
    def is_this_process(self) -> bool:
        """True if this process computes the cells itself."""
        return self.scheduler is None and self.workers is None

    @property
    def words(self) -> str:
        """The workers in words."""
        if self.scheduler is not None:
            return self.scheduler
        return "this process" if self.workers is None else f"{self.workers} processes"


NOBODY = Hired()


def _still_the_same(key: Key, digest: str) -> bool:
    """Returns True: scenes that are part of the code change only with the code's digest."""
    return True


def sweep(
    instances: Sequence[Instance],
    folder: Path | None,
    hired: Hired = NOBODY,
    retry: bool = False,
    is_same: IsSame = _still_the_same,
    quiet: bool = False,
    title: str = "gap",
) -> list[GapRow]:
    """Computes missing cells; writes run.json, results.csv, results.parquet, and their files.

    Earlier rows are kept as described in `cocap_opt.experiments.sweeps.folder`.

    Parameters
    ----------
    folder : folder for results; None to keep nothing
    retry : True to compute failed cells in the folder again
    quiet : True to show neither progress nor failures; rows contain the reasons for failures
    title : title of the progress bar

    Returns
    -------
    The requested rows of all complete instances, and of one that Ctrl-C cut short.

    Raises
    ------
    KeyboardInterrupt
        After Ctrl-C, if there are no rows yet.
    """
    with only_writer(folder):
        before = Earlier.read(folder, instances, is_same)
        store = Store(folder, retry, hired.cell_limit)
        tell = _tell_nobody if quiet else say
        return _sweep(instances, folder, hired, store, before, tell, title)


def _tell_nobody(message: str) -> None:
    pass


def _sweep(
    instances: Sequence[Instance],
    folder: Path | None,
    hired: Hired,
    store: Store,
    before: Earlier,
    tell: Callable[[str], None],
    title: str,
) -> list[GapRow]:
    scenes = list(dict.fromkeys(instance.problem.name for instance in instances))
    seeds = sorted({instance.seed for instance in instances})
    output = Output(folder, instances, before, partial(CommandRun.now, scenes, seeds, hired.words))
    missing, known = _recalled(instances, store)
    if known:
        tell(f"{known} of {known + missing} cells are in {folder} already")
    for instance in instances:
        for content in instance.contents:
            _tell_failure(content, store, tell)
    output.update()
    _warn_of_coverage(instances, hired)
    progress = Watch.on_terminal(title, parts=missing) if tell is say else nullcontext(Watch())
    with Interrupt.caught() as interrupt, progress as watch:

        def told(content: CellFile) -> None:
            watch.finish()
            watch.show(f"done: {content.cell.words}")
            _tell_failure(content, store, tell)
            output.update()

        with _crew(hired if missing else NOBODY, interrupt, watch) as crew:
            crew.run(instances, store, interrupt, told)
    rows = output.rows()
    if interrupt.pressed and not rows:  # there is nothing to give
        raise KeyboardInterrupt
    if interrupt.pressed:
        whole = sum(instance.is_finished for instance in instances)
        again = "; to continue, run the same command" if folder is not None else ""
        tell(f"interrupted: {whole} of {len(instances)} scenes and seeds are complete{again}")
    return rows


def _recalled(instances: Sequence[Instance], store: Store) -> tuple[int, int]:
    """Looks up stored cells; returns the numbers of missing and of stored cells."""
    missing = known = 0
    for instance in instances:
        given = len(instance.contents)  # plans that were not computed here
        instance.recall(store)
        known += len(instance.contents) - given
        missing += len(instance.cells) + 1 - len(instance.contents)
    return missing, known


def _warn_of_coverage(instances: Sequence[Instance], hired: Hired) -> None:
    """Warns of scenes whose coverage takes long, as no time limit ends it; tests the first seed."""
    first = {instance.problem.name: instance for instance in reversed(instances)}
    for instance in first.values():
        if instance.is_whole:
            continue
        if hired.is_this_process:
            warn_before_limits(instance.problem, instance.seed)
        else:  # each worker has one core
            warn_before_limits(instance.problem, instance.seed, hired.cell_limit, usable_cores())


def _tell_failure(content: CellFile, store: Store, tell: Callable[[str], None]) -> None:
    """Reports why a cell has no result, and the file with the traceback of an error."""
    if content.is_finished:
        return
    path = store.path(content.cell) if content.traceback else None
    where = "" if path is None else f"; traceback: {path}"
    tell(f"{content.cell.words}: {content.status}: {content.message}{where}")


@contextmanager
def _crew(hired: Hired, stop: Stop, watch: Watch) -> Iterator[Crew]:
    if hired.is_this_process:
        yield Alone(stop, watch)
        return
    from cocap_opt.experiments.sweeps.cluster import Cluster  # dask is slow to import

    if hired.scheduler is not None:
        with Cluster.existing(hired.scheduler, stop, hired.cell_limit) as cluster:
            yield cluster
    else:
        assert hired.workers is not None
        with Cluster.local(hired.workers, stop, hired.cell_limit) as cluster:
            yield cluster
