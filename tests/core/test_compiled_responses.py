"""Best responses over few states by the compiled kernel are NumPy's, to the last bit."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from kernels import NotLoaded, of_responses
from pool import meetings, problems
from strategies import examples

from cocap_opt import compiling
from cocap_opt.compiling import Kernel
from cocap_opt.coordination import kept_graph
from cocap_opt.coordination.low_level import SingleRobotTask, value_iteration
from cocap_opt.coordination.responses import Responses, followed, one_by_one
from cocap_opt.coordination.restricted_value_iteration import RestrictedValueIteration
from cocap_opt.graph.charges import NO_CHARGES, Charges
from cocap_opt.problem import Problem
from cocap_opt.stop import never

pytestmark = [
    pytest.mark.long,  # the kernel is compiled first, in a fresh environment
    pytest.mark.skipif(not compiling.is_there(), reason="needs the extra [fast]"),
]


@pytest.fixture(scope="module")
def kernel() -> Kernel:
    """A process in which the kernel is loaded."""
    found = of_responses()
    found.load()
    return found


@examples(60)
@given(
    problem=st.one_of(problems(), meetings(team=3)),
    width=st.sampled_from([2, 10, 10_000]),
    seed=st.integers(0, 2**32),
)
def test_the_kernel_finds_the_paths_that_numpy_finds(
    kernel: Kernel, problem: Problem, width: int, seed: int
) -> None:
    """With what others see, charges that close, and charges that cost or attract."""
    responses = Responses(value_iteration, never)
    team, _ = followed(responses.nobody(problem), one_by_one(responses.nobody(problem), responses))
    assume(team.is_whole)
    low_level = RestrictedValueIteration.beside(team, never, width)
    rng = np.random.default_rng(seed)
    for robot, robot_class in enumerate(team.model.class_of):
        n = robot_class.graph.n_places
        steps = rng.integers(0, problem.horizon, 20)
        ends = rng.integers(0, n, (20, 2))
        costs = rng.normal(size=20)
        of_moves = (np.column_stack([steps, ends]), costs)
        priced = Charges.of(
            (np.column_stack([steps + 1, ends[:, 0]]), costs), of_moves,
            (np.zeros((0, 2), dtype=np.int64), np.zeros(0)),
        )  # fmt: skip
        seen = team.pixels(without=robot) * rng.random()
        for charges in (NO_CHARGES, team.avoiding(robot), priced):
            task, found = SingleRobotTask(team.model, robot, seen, charges, never), []
            for use in (kernel, of_responses(NotLoaded)):
                with pytest.MonkeyPatch.context() as patch:
                    patch.setattr(kept_graph, "KERNEL", use)
                    found.append(low_level(task).path)
            assert found[0] == found[1]
