"""The parts of column generation and branch-and-price one by one."""

import numpy as np
import pytest
from counting import either
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import Calls, examples, tiny

from cocap_opt.formulations.certificates import Decision, Pricing, verify
from cocap_opt.formulations.certificates.resources import (
    Cells,
    Move,
    Swap,
    Visit,
    charges_of,
)
from cocap_opt.formulations.column_generation.branch_and_price import (
    branch_and_price,
    column_generation,
)
from cocap_opt.formulations.column_generation.master.arc_users import users_of
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.master.master_program import _ConicProgram
from cocap_opt.formulations.column_generation.master.pricing import Pricer
from cocap_opt.formulations.column_generation.master.resource_use import ResourceUse, roots_seen
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.local_search import LocalSearch, ResponseLimit
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree import root as root_module
from cocap_opt.formulations.column_generation.tree.diving import dive
from cocap_opt.formulations.column_generation.tree.relaxation import Relaxation
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.result import OPTIMALITY, BoundMethod, Snapshot
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.graph.value_iteration import backward_sweep
from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.model import Model, PathCells, compiled
from cocap_opt.objective import objective
from cocap_opt.problem import Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import FirstOf, Limit, LimitReached, WorkLimit, never


def obeying(model: Model) -> list[Column]:
    """A column for each robot, which together break no rule."""
    plan = LocalSearch(model).from_mixture(Mixture([], np.zeros(0)))
    assert plan is not None
    return list(plan.columns)


def relaxed(search: Search) -> Relaxation:
    """The relaxation at the root, with the columns of robots that are alone."""
    relaxation = Root.of(search, OPTIMALITY).relaxation
    for column in search.alone.columns:
        relaxation.master.add(column)
    return relaxation


def random_path(model: Model, robot: int, rng: np.random.Generator) -> tuple[int, ...]:
    """A random walk of a robot; its goal is ignored, and so is where people leave no way."""
    path = [model.first_start(robot)]
    for t in range(model.problem.horizon):
        heads = model.class_of[robot].graph.successors(t, path[-1])
        path.append(int(rng.choice(heads)) if len(heads) else path[-1])
    return tuple(path)


@examples(15)
@given(problem=st.one_of(problems(robots=[2, 3]), meetings()), seed=st.integers(0, 99))
def test_columns_in_conflict_are_those_that_make_a_conflict(problem: Problem, seed: int) -> None:
    """Two columns conflict if and only if a plan of both has a conflict."""
    model, rng = compiled(problem), np.random.default_rng(seed)
    robots = range(len(problem.robots))
    columns = [Column.of(model, i, random_path(model, i, rng)) for i in robots]
    found = next(model.plan([c.path for c in columns]).conflicts(problem), None) is not None
    pairs = [a.conflicts_with(b, problem) for a in columns for b in columns if a.robot < b.robot]
    assert any(pairs) == found


@examples(15)
@given(problem=problems(robots=[2, 3], goals=False), seed=st.integers(0, 99))
def test_charges_cost_a_path_what_it_uses(problem: Problem, seed: int) -> None:
    """The charge that a sweep takes from a path is the cost of the resources that it uses."""
    model, rng = compiled(problem), np.random.default_rng(seed)
    robot = int(rng.integers(len(problem.robots)))
    robot_class, path = (
        model.class_of[robot],
        PathCells.of(model, robot, random_path(model, robot, rng)),
    )
    number, t = path.class_number, int(rng.integers(problem.horizon))
    here, there = path.cells[t], path.cells[t + 1]
    resources = [Cells(t, (here,)), Cells(t + 1, (there,), number), Cells(t, (here,), number + 1),
                 Visit(t, robot_class.graph.state(path.states[t]), number)]  # fmt: skip
    if here != there:
        resources += [Swap(t, (there, here)), Move(t, (here, there), number),
                      Move(t, (there, here), number)]  # fmt: skip
    costs = rng.uniform(-5, 5, len(resources)).tolist()
    used = sum(c for r, c in zip(resources, costs, strict=True) if r.used_by(model, path))
    # Only this path is open: all other states are closed.
    reward = np.full((problem.horizon + 1, robot_class.graph.n_states), CLOSED)
    reward[np.arange(problem.horizon + 1), list(path.states)] = 1.0
    charges = charges_of(model, number, zip(resources, costs, strict=True))
    value = backward_sweep(robot_class.graph, reward, charges=charges)
    assert value[0, path.states[0]] == pytest.approx(problem.horizon + 1 - used)


@examples(12)
@given(problem=either(problems(over_time=True)))
def test_pricing_and_certificate_agree(problem: Problem) -> None:
    """What pricing calls a bound is what the certificate proves, up to rounding."""
    model = compiled(problem)
    search = Search(model)
    assume(search.alone.bound > -np.inf)
    root = relaxed(search)
    solution = root.master.solve()
    for duals in (solution.duals, solution.duals.blended(root.best.duals, 0.3)):
        bound = Pricer(model)(duals).bound
        assert Pricing.of(model, duals.certificate(model)).bound == pytest.approx(
            bound, rel=1e-9, abs=1e-6
        )
        assert bound >= solution.value - 1e-6 * abs(solution.value) - 1e-6 or solution.slack > 1e-6


def test_the_master_recombines_paths_that_meet() -> None:
    """Arcs of two paths of a robot that cross give all four combinations."""
    problem = load_scene("corridor", 0)
    model = compiled(problem)
    master = Master(model, 1e6)
    columns = [*obeying(model), *Search(model).alone.columns]
    for column in columns:
        master.add(column)
    arcs = {arc for column in columns for arc in column.arcs}
    assert set(master.arcs) == arcs
    assert not master.add(columns[0])
    solution = master.solve()
    assert {arc for c in solution.mixture.columns for arc in c.arcs} <= arcs
    totals = np.bincount([c.robot for c in solution.mixture.columns], solution.mixture.amounts)
    assert totals == pytest.approx(np.ones(len(problem.robots)), abs=1e-5)


def test_idle_arcs_are_dropped_and_the_rest_still_leads_to_the_end() -> None:
    """Without what was not used for long, the master's value is the same."""
    problem = load_scene("bottleneck", 1)
    root = relaxed(Search(compiled(problem)))
    for _ in range(4):
        solution = root.master.solve()
        for column in root.search.pricer(solution.duals).columns:
            root.master.add(column)
    before, arcs = root.master.solve(), len(root.master.arcs)
    root.master.drop_idle(0)
    assert len(root.master.arcs) < arcs
    assert root.master.solve().value == pytest.approx(before.value, rel=1e-5)


def test_a_decision_is_kept_by_the_master_and_by_pricing() -> None:
    """At most none: no column through there; at least one: a robot goes there."""
    problem = load_scene("corridor", 0)
    model, search = compiled(problem), Search(compiled(problem))
    column = obeying(model)[0]
    resource = Cells(3, (column.along.cells[3],))
    closed = Decision(resource, "at most", 0)
    master = Master(model, 1e6, (closed,))
    assert not master.add(column)
    alone = search.alone
    duals = type(alone.duals)(alone.duals.alpha, alone.duals.beta, decisions=np.zeros(1))
    for other in Pricer(model)(duals, (closed,)).columns:
        assert not resource.used_by(model, other.along)
    rewarded = type(alone.duals)(alone.duals.alpha, alone.duals.beta, decisions=np.array([1e6]))
    wanted = Pricer(model)(rewarded, (Decision(resource, "at least", 1),)).columns
    assert any(resource.used_by(model, other.along) for other in wanted)


def test_integral_mixtures_become_paths_with_the_same_reward() -> None:
    """Paths that cross may swap their tails, which changes nothing of J."""
    problem = load_scene("corridor", 0)
    model = compiled(problem)
    columns = obeying(model)
    plan = Incumbent.of_integral(model, Mixture(columns, np.ones(2)))
    assert plan is not None
    assert plan.value == pytest.approx(objective(model, [c.path for c in columns]))
    half = Mixture([*columns, *columns], np.full(4, 0.5))
    split = Incumbent.of_integral(model, half)
    assert split is not None and split.paths == plan.paths
    assert not ResourceUse.of(model, half).fractional()


@examples(15)
@given(problem=st.one_of(problems(), meetings()), seed=st.integers(0, 10_000))
def test_masters_and_paths_agree_on_what_uses_a_resource(problem: Problem, seed: int) -> None:
    """Of a path's arcs exactly one is in a resource's row where the path uses it, else none."""
    model, rng = Model(problem), np.random.default_rng(seed)
    for robot in range(len(problem.robots)):
        path = PathCells.of(model, robot, random_path(model, robot, rng))
        other = PathCells.of(model, robot, random_path(model, robot, rng))
        number, graph = path.class_number, model.class_of[robot].graph
        t = int(rng.integers(problem.horizon))
        moved = (other.cells[t], other.cells[t + 1])
        resources = [
            Cells(t + 1, (other.cells[t + 1],)),
            Cells(t, tuple({path.cells[t], other.cells[t]}), number),
            Visit(t + 1, graph.state(other.states[t + 1]), number),
            Visit(0, graph.state(path.states[0]), number),
        ]
        if moved[0] != moved[1]:
            resources += [Move(t, moved, number), Swap(t, moved), Swap(t, moved[::-1])]
        rows = users_of(model, Column.of(model, robot, path.states).arcs, resources)
        assert [len(row) for row in rows] == [r.used_by(model, path) for r in resources]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "horizon", "is_disaggregated"), [
    pytest.param("bottleneck-tight", 4, True, marks=pytest.mark.long), ("corridor", 6, True),
])  # fmt: skip
def test_robots_are_disaggregated_where_that_pays(
    name: str, horizon: int, is_disaggregated: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With it or without, the bound is no higher than that of robots by class."""
    monkeypatch.setattr(root_module, "step_envelopes", lambda *_, **__: None)  # they come first
    problem = load_scene(name, 0).replace(horizon=horizon)
    aggregated, root = (Root.of(Search(compiled(problem)), OPTIMALITY) for _ in range(2))
    aggregated.solve_aggregated()
    root.solve()
    assert root.search.model.is_disaggregated == is_disaggregated
    bounds = root.relaxation.best.bound, aggregated.relaxation.best.bound
    assert bounds[0] <= bounds[1] * (1 + 1e-6)
    assert root.search.value >= aggregated.search.value


@pytest.mark.slow
def test_fractions_are_found_kind_by_kind() -> None:
    """Cells of all robots come first, states where all cells are used integrally."""
    problem = load_scene("bottleneck", 0)
    search = Search(compiled(problem))
    root = relaxed(search)
    root.solve(lambda: 0.0)
    assert root.solution is not None
    found = ResourceUse.of(search.model, root.solution.mixture).fractional()
    assert found
    assert all(isinstance(resource, Cells) for resource in found)
    assert all(1e-4 < amount % 1 < 1 - 1e-4 for amount in found.values())


@pytest.mark.long
@pytest.mark.parametrize("name", ["corridor-tight", "bottleneck", "passage"])
def test_plans_from_mixtures_obey_the_rules(name: str) -> None:
    """Rounding and diving give plans that the referee accepts."""
    problem = load_scene(name, 1)
    search = Search(compiled(problem))
    root = relaxed(search)
    for _ in range(3):
        solution = root.master.solve()
        for column in search.pricer(solution.duals).columns:
            root.master.add(column)
    search.allow_responses(10)
    found = [
        search.local_search.from_mixture(solution.mixture),
        dive(search, root.master, solution),
    ]
    for plan in found:
        assert plan is not None
        verdict = check(problem, search.model.plan(plan.paths))
        assert verdict.valid
        assert verdict.reward == pytest.approx(plan.value)


def test_a_best_response_avoids_the_others() -> None:
    """It conflicts with none of them, and no other path of the robot is better."""
    problem = tiny()
    model = compiled(problem)
    other = Column.of(model, 1, (model.first_start(1),) * 3)
    answer = LocalSearch(model).best_response(0, [other])
    assert answer is not None
    assert not answer.conflicts_with(other, problem)
    rng = np.random.default_rng(0)
    value = objective(model, [answer.path, other.path])
    for _ in range(50):
        column = Column.of(model, 0, random_path(model, 0, rng))
        if Incumbent.of(model, [column, other]) is not None:
            assert objective(model, [column.path, other.path]) <= value + 1e-9


def test_a_mixture_is_split_by_view_sum() -> None:
    """Every column's roots come with its weight."""
    problem = load_scene("corridor", 0)
    columns = obeying(compiled(problem))
    mixture = np.array([0.25, 0.75])
    parts = {
        view_sum: (seen.roots, seen.amounts)
        for view_sum, seen in roots_seen(Mixture(columns, mixture), problem)
    }
    assert set(parts) == {int(g) for c in columns for g in c.view_sums}
    for robot_class, (roots, amounts) in parts.items():
        total = sum(
            weight * float(np.sqrt(c.pixels[c.view_sums == robot_class]).sum())
            for c, weight in zip(columns, mixture.tolist(), strict=True)
        )
        assert float(roots @ amounts) == pytest.approx(total)
    assert roots_seen(Mixture(columns, np.zeros(2)), problem) == []


@pytest.mark.parametrize("units", [0, 1, pytest.param(5, marks=pytest.mark.slow)])
def test_a_work_limit_makes_the_same_search_every_time(units: int) -> None:
    """Pricing rounds are counted, not seconds: plan, bound and statistics are the same again."""
    problem = load_scene("passage", 0)
    one, other = (column_generation(problem, WorkLimit(units)) for _ in range(2))
    assert (one.reason, one.limit) == (Reason.STOPPED, Limit.WORK)
    assert one.statistics["iterations"] == units
    assert (one.plan, one.bound, one.statistics) == (other.plan, other.bound, other.statistics)
    composed = column_generation(problem, FirstOf(never, WorkLimit(units)))
    assert (composed.plan, composed.bound) == (one.plan, one.bound)


@pytest.mark.slow
def test_few_joint_states_are_tried_before_any_cuts() -> None:
    """The bottleneck is proved by step envelopes, so that its relaxation needs no cuts."""
    problem = load_scene("bottleneck", 1)
    search = Search(compiled(problem))
    root = Root.of(search, 1e-6)
    root.solve()
    assert search.is_proved(root.cutoff())
    assert root.relaxation.cut_rounds == 0 and not root.relaxation.master.cuts


@pytest.mark.parametrize("asked", [1, 3, 20, 60])
@pytest.mark.parametrize("method", [column_generation, branch_and_price])
def test_searches_that_are_stopped_keep_what_they_have(method: BoundMethod, asked: int) -> None:
    """Wherever the limit is reached, plan and bound are there, and are what they claim to be."""
    problem = load_scene("bottleneck", 0).replace(horizon=6)
    compiled(problem).prepare_all(never)
    result = method(problem, Calls(asked))
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
    assert result.plan is not None
    verdict = check(problem, result.plan)
    assert verdict.valid and verdict.reward == pytest.approx(result.value)
    assert result.value <= verify(problem, result.certificate).bound <= result.bound


def test_a_stopped_relaxation_raises_and_keeps_its_best_bound() -> None:
    """`solve` raises; the multipliers priced before are those of the best bound."""
    search = Search(compiled(load_scene("corridor", 0)), WorkLimit(3))
    relaxation = relaxed(search)
    before = relaxation.best.bound
    with pytest.raises(LimitReached) as stopped:
        relaxation.solve(lambda: 0.0)
    assert stopped.value.limit is Limit.WORK
    assert relaxation.iterations == 3 and relaxation.best.bound < before
    assert Pricer(search.model)(relaxation.best.duals).bound == relaxation.best.bound


def test_local_search_that_is_stopped_returns_its_best_plan() -> None:
    """No time at all: the columns as they are; rounding without enough columns has no plan."""
    model = compiled(load_scene("corridor", 0))
    columns = obeying(model)
    stopped = LocalSearch(model, Calls(0))
    plan = stopped.with_best_responses(columns)
    assert plan is not None and plan.columns == tuple(columns)
    assert stopped.from_mixture(Mixture(columns[:1], np.ones(1))) is None


@pytest.mark.parametrize("allowed", [0, 1, 2])
def test_local_search_asks_for_no_more_responses_than_are_allowed(allowed: int) -> None:
    """They are counted, and the plan so far is returned when none is left."""
    model = compiled(load_scene("corridor", 0))
    columns = obeying(model)
    allowance = ResponseLimit(allowed)
    plan = LocalSearch(model, allowance=allowance).with_best_responses(columns)
    before = Incumbent.of(model, columns)
    assert plan is not None and before is not None and plan.value >= before.value
    enough = ResponseLimit(1000)
    LocalSearch(model, allowance=enough).with_best_responses(columns)
    assert enough.left < 1000
    assert allowance.left == max(0, allowed - (1000 - enough.left))


def test_multipliers_are_read_by_the_names_of_rows() -> None:
    """max x + 2 y, x <= 3, y <= 4, written in any order: the prices are 1 and 2."""
    program = _ConicProgram({"x": 1, "y": 1})
    program.add_rows("y is small", np.array([4.0]))
    program.put_diagonal("y is small", "y", 1.0)
    program.add_rows("x is small", np.array([3.0]))
    program.put_diagonal("x is small", "x", 1.0)
    cost = {"y": np.array([-2.0]), "x": np.array([-1.0])}
    value, is_solved, values, multipliers = program.solve(cost, never, 1e-9)
    assert is_solved and value == pytest.approx(-11.0)
    assert values["x"] == pytest.approx(3.0)
    assert values["y"] == pytest.approx(4.0)
    assert multipliers["x is small"] == pytest.approx(1.0)
    assert multipliers["y is small"] == pytest.approx(2.0)


def test_arcs_on_paths_lead_from_a_start_to_the_end() -> None:
    """Arcs that no start reaches, and arcs that lead nowhere, are on no path."""
    arcs = [Arc(0, 0, 1, 2), Arc(0, 1, 2, 3), Arc(0, 0, 1, 7), Arc(0, 1, 8, 3), Arc(1, 1, 2, 9)]
    assert Arc.on_paths(arcs, [(0, 1)], 2) == [arcs[:1], arcs[1:2]]


def test_no_report_has_a_bound_below_its_plan() -> None:
    """While a tree is searched, its bound is that of all plans, the incumbent among them."""
    seen: list[Snapshot] = []
    branch_and_price(load_scene("corridor-tight", 0), report=seen.append)
    assert len(seen) > 2
    assert all(snapshot.bound >= snapshot.value for snapshot in seen)
