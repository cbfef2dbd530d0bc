"""What does not fit into memory is refused before it is taken, in one line with what to change."""

import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import tiny

from cocap_opt import memory
from cocap_opt.coordination.low_level import SingleRobotTask
from cocap_opt.data import ProblemError
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import Model
from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.problem import Motion
from cocap_opt.world.workspace import HeightMap, Workspace


class Little:
    """A machine with little memory left."""

    def __init__(self, free: float) -> None:
        self.available = free


Files = dict[str, str]
STAT = "anon 7\ninactive_file 300\ntotal_inactive_file 200\n"


@pytest.mark.parametrize(
    ("files", "ours", "free"),
    [
        ({}, "", 1e5),
        ({"memory.max": "max\n", "memory.current": "5000\n"}, "0::/", 1e5),
        ({"memory.max": "9000\n", "memory.current": "5000\n"}, "0::/", 4000.0),
        ({"memory.max": "9000", "memory.current": "5000", "memory.stat": STAT}, "0::/", 4300.0),
        ({"memory.max": "9000", "memory.current": "9001"}, "0::/", 0.0),
        ({"memory.max": "900000", "memory.current": "5000"}, "0::/", 1e5),
        ({"memory.max": "9000"}, "0::/", 1e5),
        ({"a/memory.max": "9000", "a/memory.current": "0", "a/b/memory.max": "max",
          "a/b/memory.current": "0"}, "1:cpu:/c\n0::/a/b", 9000.0),
        ({"memory/memory.limit_in_bytes": "9000", "memory/memory.usage_in_bytes": "5000",
          "memory/memory.stat": STAT}, "4:memory:/elsewhere", 4200.0),
        ({"memory/job/memory.limit_in_bytes": "8000", "memory/job/memory.usage_in_bytes": "5000"},
         "4:memory:/job", 3000.0),
    ],
)  # fmt: skip
def test_memory_is_that_of_a_container(
    files: Files, ours: str, free: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where a group of processes may use less than there is; what files take gives way."""
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    (tmp_path / "ours").write_text(ours)
    monkeypatch.setattr(memory, "_GROUPS", tmp_path)
    monkeypatch.setattr(memory, "_OURS", tmp_path / "ours")
    monkeypatch.setattr(memory.psutil, "virtual_memory", lambda: Little(1e5))
    assert memory.free_bytes() == free
    assert memory.fits(0.89 * free) and (not free or not memory.fits(0.91 * free))


def test_a_graph_that_is_too_large_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before it is made; 20,000 x 20,000 cells would need more than 70 gigabytes."""
    monkeypatch.setattr(memory.psutil, "virtual_memory", lambda: Little(1e5))
    workspace = Workspace(HeightMap(heights=np.zeros((60, 60))))
    with pytest.raises(ProblemError, match=r"^the graph of 60 x 60 cells .*; use larger cells or"):
        TimeGraph.of(workspace, Motion(), 1)


@given(
    x=st.integers(1, 6000), y=st.integers(1, 6000), border=st.integers(0, 16),
    count=st.integers(1, 360), share=st.floats(1e-4, 0.89),
)  # fmt: skip
def test_what_is_advised_fits(x: int, y: int, border: int, count: int, share: float) -> None:
    """A part of the map of the size that is named, or so many headings, need no more than is free.

    And they are no smaller than need be: one cell or heading more on each side does not fit.
    """

    def needed(x: int, y: int, count: int) -> float:
        return 1000.0 * (x + 2 * border) * (y + 2 * border) * count

    usable = share * needed(x, y, count)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(memory.psutil, "virtual_memory", lambda: Little(usable / 0.9))
        with pytest.raises(ProblemError) as error:
            memory.require_memory(needed(x, y, count), "it", (x, y), border, {"headings": count})
    advice = str(error.value).split("; ")[1]
    rounding = 1 + 1e-9
    if size := re.search(r"at most (\d+) x (\d+) of them", advice):
        a, b = map(int, size.groups())
        assert 1 <= a <= x and 1 <= b <= y
        assert needed(a, b, count) <= usable * rounding < needed(a + 1, b + 1, count) * rounding**2
    if few := re.search(r"at most (\d+) headings", advice):
        assert needed(x, y, int(few[1])) <= usable * rounding < needed(x, y, int(few[1]) + 1) * 1.1
    assert share * count < 1 or few


def test_coverage_that_is_too_large_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message has the sizes that make it large, what it needs, and what there is."""
    model = Model(tiny(), use_cache=False)
    task = SingleRobotTask(model, 0, tiny().no_pixels())
    monkeypatch.setattr(memory.psutil, "virtual_memory", lambda: Little(1000.0))
    for run in (model.prepare_all, partial(LazyValueIteration(), task)):
        with pytest.raises(ProblemError) as error:
            run()
        words = str(error.value)
        assert words.startswith("coverage and value iteration of ") and "\n" not in words
        assert "GB of memory, of which 0.0 GB are free; use larger cells or a part" in words
