"""Value iteration by the compiled kernel finds what NumPy's passes find, to the last bit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from kernels import NotLoaded, of_sweeps
from strategies import examples
from test_timegraph import BONUSES, Case, cases, charges

from cocap_opt import compiling
from cocap_opt.compiling import Kernel
from cocap_opt.data import FloatArray
from cocap_opt.graph import NO_BONUSES, NO_CHARGES, value_iteration
from cocap_opt.graph.frames import Frame
from cocap_opt.graph.value_iteration import backward_sweep

pytestmark = [
    pytest.mark.long,  # the kernel is compiled first, in a fresh environment
    pytest.mark.skipif(not compiling.is_there(), reason="needs the extra [fast]"),
]


@pytest.fixture(scope="module")
def kernel() -> Kernel:
    """A process in which the kernel is loaded."""
    found = of_sweeps()
    found.load()
    return found


@examples(120)
@given(cases(goals=True), st.data())
def test_the_kernel_sweeps_as_numpy_does(kernel: Kernel, case: Case, data: st.DataObject) -> None:
    """With and without bonuses, charges, a goal and frames, and when it is swept again."""
    graph, horizon = case.graph, case.problem.horizon
    goal = case.problem.robots[0].goal if data.draw(st.booleans()) else None
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32)))
    reward = graph.no_reward(horizon) + rng.random((horizon + 1, graph.n_states))
    bonuses = data.draw(st.just(NO_BONUSES) | BONUSES)
    charged = data.draw(st.just(NO_CHARGES) | charges(graph, horizon))
    frames = (
        Frame.all_from(graph, np.array([case.start]), horizon) if data.draw(st.booleans()) else None
    )
    last = int(rng.integers(0, horizon + 1))
    changed = reward.copy()
    changed[: last + 1] *= 0.5
    found: list[tuple[FloatArray, FloatArray]] = []
    for use in (kernel, of_sweeps(NotLoaded)):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(value_iteration, "KERNEL", use)
            value = backward_sweep(graph, reward, bonuses, charged, goal, frames=frames)
            again = backward_sweep(
                graph, changed, bonuses, charged, goal, earlier=(value.copy(), last), frames=frames
            )
        found.append((value, again))
    # In frames all other values mean nothing.
    counts = np.ones_like(reward, dtype=bool)
    if frames is not None:
        counts = graph.reachable([case.start], horizon)
    for ours, theirs in zip(*found, strict=True):
        np.testing.assert_array_equal(ours[counts], theirs[counts])
