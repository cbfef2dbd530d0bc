"""A sweep with which others are compared, and a cluster for all whose cells go to workers."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from sweeps import csv_rows, small_sweep

from cocap_opt.cli import commands
from cocap_opt.experiments.sweeps.cluster import Cluster
from cocap_opt.stop import never


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a sweep that nobody disturbed."""
    folder = tmp_path_factory.mktemp("undisturbed") / "run"
    assert commands.run(small_sweep("--out", folder)) == 0
    assert len({row["bound"] for row in csv_rows(folder)}) == 1 + 2  # each seed another scene
    return folder


@pytest.fixture(scope="session")
def local() -> Iterator[Cluster]:
    """One worker, in a process of its own."""
    with Cluster.local(1, never, cell_limit=60.0) as cluster:
        yield cluster
