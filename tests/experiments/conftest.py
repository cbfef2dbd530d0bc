"""A sweep with which others are compared, and a cluster for all whose cells go to workers."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import dask
import pytest
from sweeps import csv_rows, small_sweep

from cocap_opt.cli import commands
from cocap_opt.experiments.sweeps.cluster import Cluster
from cocap_opt.stop import never

# Ten samples of all threads each 0.1 s, and fifty ticks a second, take a twentieth of a core.
UNWATCHED = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500ms",
}


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a sweep that nobody disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    assert commands.run(small_sweep("--out", folder)) == 0
    assert len({row["bound"] for row in csv_rows(folder)}) == 1 + 2  # each seed another scene
    return folder


@pytest.fixture(scope="session")
def local() -> Iterator[Cluster]:
    """One worker, in a process of its own; dask does not watch how busy both are, to the end."""
    with ExitStack() as stack:
        with dask.config.set(UNWATCHED):
            cluster = stack.enter_context(Cluster.local(1, never, cell_limit=60.0))
        yield cluster
