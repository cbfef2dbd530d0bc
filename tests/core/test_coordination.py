"""Relations between robots: conflicts of places, coverage of states, and best responses."""

import numpy as np
from brute_force import all_paths
from hypothesis import assume, given
from hypothesis import strategies as st
from strategies import examples, meetings, number_of_plans, problems

from cocap_opt.coordination.best_response import best_response
from cocap_opt.model import Model
from cocap_opt.objective import objective
from cocap_opt.problem import Problem


@examples(25)
@given(st.one_of(meetings(), problems(robots=st.just(2))), st.integers(0, 99))
def test_places_conflict_where_their_cells_are_too_close(problem: Problem, seed: int) -> None:
    """The matrix says of places of two classes what the rules say of their cells."""
    model, rng = Model(problem, use_cache=False), np.random.default_rng(seed)
    classes = model.class_of[0], model.class_of[1]
    places = [rng.choice(np.flatnonzero(c.graph.free), 12) for c in classes]
    cells = [
        [model.cells[model.classes.index(c)][place] for place in own.tolist()]
        for c, own in zip(classes, places, strict=True)
    ]
    expected = [[problem.too_close(p, q) for q in cells[1]] for p in cells[0]]
    assert model.conflict_matrix(classes, (places[0], places[1])).tolist() == expected


@examples(15)
@given(problems(), st.integers(0, 99))
def test_coverage_of_states_is_that_of_the_table(problem: Problem, seed: int) -> None:
    """Row by row the dense array holds the sparse one's entries, for states seen twice, too."""
    model, rng = Model(problem, use_cache=False), np.random.default_rng(seed)
    robot_class, t = model.class_of[0], int(rng.integers(problem.horizon + 1))
    reached = np.flatnonzero(model.reachable(robot_class)[t])
    states = rng.choice(reached, 8)
    coverage = model.coverage_at(robot_class, t, states)
    table = model.coverage(robot_class)
    for row, state in zip(coverage, states.tolist(), strict=True):
        view_sums, pixels = table.row(t * robot_class.graph.n_states + state)
        expected = np.zeros(model.n_faces)
        expected[view_sums - t * model.n_faces] = pixels
        assert (row == expected).all()


@examples(25)
@given(problems(robots=st.just(1)))
def test_a_best_response_to_nobody_is_the_best_path(problem: Problem) -> None:
    """Against all paths of a robot alone, one by one."""
    assume(number_of_plans(problem) <= 2000)
    model = Model(problem, use_cache=False)
    path = best_response(model, 0, problem.no_pixels())
    graph = model.class_of[0].graph
    found = [tuple(map(graph.index, states)) for states in all_paths(problem, 0)]
    values = [objective(model, [one]) for one in found]
    if path is None:
        assert not values
        return
    assert objective(model, [path]) >= max(values) - 1e-9 * max(values)
