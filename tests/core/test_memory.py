"""What does not fit into memory is refused before it is taken, in one line with what to change."""

from functools import partial

import numpy as np
import pytest
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
    with pytest.raises(ProblemError, match=r"^the graph of 60 x 60 cells .*; use larger cells"):
        TimeGraph.of(workspace, Motion(), 1)


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
        assert "GB of memory, of which 0.0 GB are free; use larger cells" in words
