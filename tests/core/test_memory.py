"""What does not fit into memory is refused before it is taken, in one line with what to change."""

import re
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import tiny

from cocap_opt import memory
from cocap_opt.data import ProblemError
from cocap_opt.graph.timegraph import TimeGraph
from cocap_opt.model import Model
from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.low_level import SingleRobotTask
from cocap_opt.problem import Motion
from cocap_opt.world.workspace import HeightMap, Workspace


class Little:
    """A machine with little memory left."""

    def __init__(self, free: float) -> None:
        self.available = free


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
