"""Relations between robots: conflicts of places, coverage of states, and best responses."""

import numpy as np
from brute_force import all_paths
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import examples, number_of_plans

from cocap_opt.coordination.best_response import best_response, forbid
from cocap_opt.graph.charges import NO_CHARGES
from cocap_opt.model import Model
from cocap_opt.objective import objective
from cocap_opt.problem import (
    Camera,
    CollisionRules,
    Motion,
    Plan,
    Problem,
    Robot,
    State,
    VertexConflict,
)  # fmt: skip
from cocap_opt.world.workspace import HeightMap


@examples(15)
@given(st.one_of(meetings(), problems(robots=[2])), st.integers(0, 99))
def test_places_conflict_where_their_cells_are_too_close(problem: Problem, seed: int) -> None:
    """The matrix says of places of two classes what the rules say of their cells."""
    model, rng = Model(problem, use_cache=False), np.random.default_rng(seed)
    classes = model.class_of[0], model.class_of[1]
    places = [rng.choice(np.flatnonzero(c.graph.free), 12) for c in classes]
    cells = [
        [model.places.cells[c.number][place] for place in own.tolist()]
        for c, own in zip(classes, places, strict=True)
    ]
    expected = [[problem.too_close(p, q) for q in cells[1]] for p in cells[0]]
    assert model.places.conflict_matrix(classes, (places[0], places[1])).tolist() == expected


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


@examples(15)
@given(problems(robots=[1]))
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


@examples(45)
@given(
    st.sampled_from([0.5, 1.0, 1.5, 2.0, 3.0]),
    st.sampled_from([0.0, 0.5, 2.0]),
    st.sampled_from([0.5, 1.0]),
    st.integers(0, 2**32 - 1),
)
def test_either_robot_of_a_conflict_gives_way(
    separation: float, vertical: float, size: float, seed: int
) -> None:
    """What is closed to one robot conflicts with all that is closed to the other.

    So a plan that obeys the rules is in one branch of the constraint tree at least, and the paths
    in conflict are in neither.
    """
    rng = np.random.default_rng(seed)
    motions = [
        Motion(headings=1, turn=0, radius=radius, layers=(2.0, 3.0), climb=1, clearance=0.0)
        for radius in rng.integers(1, 3, 2).tolist()
    ]
    robots = [
        Robot(start=State(x, x), motion=motion, camera=Camera())
        for x, motion in zip((0, 8), motions, strict=True)
    ]
    problem = Problem(
        name="", height_map=HeightMap(heights=np.zeros((9, 9)), resolution=size), robots=robots,
        actors=(), horizon=4, rules=CollisionRules(separation=separation, vertical=vertical),
    )  # fmt: skip
    model = Model(problem, use_cache=False)
    graphs = [model.class_of[i].graph for i in (0, 1)]
    ends = []
    for graph in graphs:
        tails = graph.places_around(4, 4, 1)
        tail = int(rng.choice(tails))
        heads = graph.neighbours(np.array([tail]))[:, 0]
        ends.append((tail, int(rng.choice(heads[heads >= 0]))))
    plan = Plan(
        paths=tuple(
            (robot.start, *(graph.state(place) for place in places), *[graph.state(places[1])] * 2)
            for robot, graph, places in zip(problem.robots, graphs, ends, strict=True)
        )
    )
    conflict = next((one for one in plan.conflicts(problem) if one.t == 1), None)
    assume(conflict is not None)
    assert conflict is not None
    closed = [forbid(model, conflict, which, NO_CHARGES) for which in (0, 1)]
    at = [model.places.where(model.class_of[i], np.arange(graphs[i].n_places)) for i in (0, 1)]
    if isinstance(conflict, VertexConflict):
        for charges, (tail, _) in zip(closed, ends, strict=True):
            assert (1, tail) in charges.places
        places = [np.array([place for _, place in charges.places]) for charges in closed]
        ways = at[0][places[0]][:, None] - at[1][places[1]]
        assert problem.rules.too_near(ways).all()
        return
    for charges, move in zip(closed, ends, strict=True):
        assert (1, *move) in charges.moves
    tails, heads = ([at[i][np.array(list(closed[i].moves))[:, k]] for i in (0, 1)] for k in (1, 2))
    assert problem.rules.moves_conflict(
        (tails[0][:, None], heads[0][:, None]), (tails[1], heads[1])
    ).all()
