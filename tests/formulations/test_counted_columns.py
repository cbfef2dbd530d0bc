"""Column generation, part by part, in scenes that count the drones that see people."""

from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from brute_force import optimum
from counting import counting
from hypothesis import given, reject
from pool import meetings, problems
from random_certificates import random_resource
from scipy import sparse
from strategies import examples

from cocap_opt.formulations.certificates import Decision, Pricing, verify
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.master.pricing import Pricer
from cocap_opt.formulations.column_generation.master.resource_use import roots_seen
from cocap_opt.formulations.column_generation.master.ruled_program import RuledProgram
from cocap_opt.formulations.column_generation.parameters import (
    DEFAULTS,
    LargeRootParameters,
    Parameters,
)
from cocap_opt.formulations.column_generation.primal.arc_search import ArcSearch
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.relaxation import Relaxation
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.mixture_ascent import (
    MixtureProgram,
)
from cocap_opt.model import Model, PathCells, compiled
from cocap_opt.objective import objective
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem, Views
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never

COUNTED = counting(problems(over_time=True))
CROWDED = counting(st.one_of(meetings(), problems(robots=[2, 3])))
SEEDS = st.integers(0, 10_000)
AS_LARGE = Parameters(large_root=LargeRootParameters(many_robot_steps=0))


def random_columns(model: Model, rng: np.random.Generator) -> list[Column]:
    """A path of each robot that random rewards make the best; none where a robot has no path."""
    columns = []
    for robot, robot_class in enumerate(model.class_of):
        rewards = robot_class.graph.no_reward(model.problem.horizon)  # walls are closed there
        rewards += rng.uniform(size=rewards.shape)
        value = backward_sweep(robot_class.graph, rewards, goal=robot_class.goal)
        path = best_path(robot_class.graph, value, model.first_start(robot))
        if path is None:
            return []
        columns.append(Column.of(model, robot, tuple(path)))
    return columns


@examples(40)
@given(problem=COUNTED, seed=SEEDS)
def test_whatever_drones_are_paid_pricing_bounds_all_plans(problem: Problem, seed: int) -> None:
    """What pricing calls a bound is what the certificate proves, however the price is made up."""
    model, rng = compiled(problem), np.random.default_rng(seed)
    size, n_roots = len(problem.view_sum_weights), problem.returns.n_roots
    alpha, beta = rng.choice([0.0, 0.3, 1.0, 1.5], (2, size))
    beta[:n_roots] = rng.uniform(1e-4, 1e-2, n_roots)
    seen = [model.coverage(robot_class).view_sums for robot_class in model.classes]
    alpha[np.setdiff1d(np.arange(size), np.concatenate(seen))] = 1.0  # as solvers leave them
    duals = Duals(alpha, beta)
    bound = Pricer(model)(duals).bound
    proved = Pricing.of(model, duals.certificate(model)).bound
    assert proved == pytest.approx(bound, rel=1e-9, abs=1e-6)
    best = optimum(problem).value
    assert proved >= best - 1e-9 * (1 + abs(best))


@examples(40)
@given(problem=COUNTED, seed=SEEDS)
def test_a_master_of_one_path_for_each_drone_is_worth_their_objective(
    problem: Problem, seed: int
) -> None:
    """Neither less, which would cut off plans, nor more: roots and counts are both exact there."""
    model = compiled(problem).disaggregated()
    columns = random_columns(model, np.random.default_rng(seed))
    if not columns:
        reject()
    master = Master(model, penalty=1e6)
    for column in columns:
        master.add(column)
    value = objective(model, [column.path for column in columns])
    assert master.solve().value == pytest.approx(value, rel=1e-6, abs=1e-5)
    amounts, base = np.ones(len(columns)), MixtureProgram(model, columns)
    along, none = [column.along for column in columns], sparse.csr_array((len(columns), 0))
    ruled = RuledProgram(base, along, [], model.n_faces, none, np.zeros(0), 1.0, 1e-6)
    judged, prices = base.judged(amounts)
    assert judged == pytest.approx(value, rel=1e-9, abs=1e-9)
    assert ruled.value(amounts) == pytest.approx(value, rel=1e-9, abs=1e-4)
    for multipliers in (Duals(*prices), Duals(*ruled.multipliers(amounts)[:2])):
        assert not multipliers.beta[problem.returns.n_roots :].any()
        assert Pricer(model)(multipliers).bound >= value - 1e-6 * (1 + abs(value))


@examples(20)
@given(problem=CROWDED, seed=SEEDS)
def test_mixtures_offer_no_counts_to_cuts(problem: Problem, seed: int) -> None:
    """All roots that they see are offered, and nothing else."""
    columns = random_columns(compiled(problem), np.random.default_rng(seed))
    n_roots = problem.returns.n_roots
    seen = [
        view_sum for view_sum, _ in roots_seen(Mixture(columns, np.ones(len(columns))), problem)
    ]
    assert seen == sorted({v for c in columns for v in c.view_sums.tolist() if v < n_roots})


@examples(20)
@given(problem=CROWDED, seed=SEEDS)
def test_moves_over_arcs_are_worth_what_they_add(problem: Problem, seed: int) -> None:
    """J and gains are those of the objective, and no known path is better than the best one."""
    problem = problem.without_rules()
    model, rng = compiled(problem), np.random.default_rng(seed)
    known = [random_columns(model, rng) for _ in range(3)]
    plan = Incumbent.of(model, known[0]) if known[0] else None
    if plan is None:
        reject()
    columns = [column for team in known for column in team]
    arcs = ArcSearch(model, plan, columns, never, lambda: None, DEFAULTS.large_root)
    assert arcs._value() == pytest.approx(plan.value, rel=1e-9, abs=1e-9)
    arcs._take(plan.columns[0])
    path = arcs._best_path(0)
    assert path is not None
    values = {
        column.path: objective(model, [column.path, *plan.paths[1:]])
        for column in (*columns, Column.of(model, 0, path))
        if column.robot == 0
    }
    assert values[path] == pytest.approx(max(values.values()), rel=1e-9, abs=1e-9)
    gains = {path: arcs._gain(Column.of(model, 0, path)) for path in values}
    differences = [value - gains[path] for path, value in values.items()]
    assert differences == pytest.approx([differences[0]] * len(differences), abs=1e-6)


@examples(20)
@given(problem=CROWDED, seed=SEEDS)
def test_nodes_bound_the_plans_that_obey_their_decisions(problem: Problem, seed: int) -> None:
    """Under decisions that the optimum obeys, the bound of a node is no less than the optimum."""
    model, rng, best = compiled(problem), np.random.default_rng(seed), optimum(problem)
    if best.plan is None:
        reject()
    paths = [PathCells.of(model, n, path) for n, path in enumerate(model.paths(best.plan))]
    decisions = []
    for resource in [random_resource(model, rng) for _ in range(int(rng.integers(1, 5)))]:
        used = sum(resource.used_by(model, path) for path in paths)
        decisions.append(Decision(resource, "at most" if rng.integers(2) else "at least", used))
    search = Search(model)
    duals = replace(Duals.alone(problem), decisions=np.zeros(len(decisions)))
    priced = search.pricer(duals, decisions)
    master = Master(model, 2 * search.scale, tuple(decisions))
    for column in priced.columns:
        master.add(column)
    node = Relaxation(search, master, priced, tuple(decisions))
    node.solve(lambda: -np.inf, rounds=1)
    size = 1e-6 * (1 + abs(best.value))
    assert best.value - size <= node.best.bound <= priced.bound
    certificate = node.best.duals.certificate(model)
    proved = Pricing.of(model, certificate, tuple(decisions))
    assert proved.bound - proved.rounding == pytest.approx(node.best.bound, rel=1e-9, abs=1e-6)


@examples(12)
@given(problem=CROWDED)
def test_bounds_without_masters_hold(problem: Problem) -> None:
    """A small scene that is treated as a large one has the same optimum."""
    best, result = optimum(problem).value, branch_and_price(problem, parameters=AS_LARGE)
    assert result.value == pytest.approx(best, rel=1e-4, abs=1e-6)
    assert result.bound >= best - 1e-9 * (1 + abs(best) if np.isfinite(best) else 1)


def test_a_second_drone_that_sees_a_person_adds_nothing_to_a_master() -> None:
    """Where one is enough: the plan of the corridor's drones, which often see the same people."""
    plain = load_scene("corridor", 0)
    views = Views(cameras=1, weight=200.0)
    problem = plain.replace(objective=plain.objective.replace(views=views))
    model = compiled(problem).disaggregated()
    plan = Incumbent.of_plan(model, PLANNERS["cocap-rounds"](problem).plan)
    assert plan is not None
    seen = problem.no_pixels()
    for column in plan.columns:
        column.add_to(seen)
    assert (seen[problem.returns.n_roots :] > 1).any()
    master = Master(model, penalty=1e6)
    for column in plan.columns:
        master.add(column)
    assert master.solve().value == pytest.approx(plan.value, rel=1e-6)


@pytest.mark.parametrize("cameras", [1, 2])
def test_the_tree_proves_the_optimum_of_counts(cameras: int) -> None:
    """The proof of the corridor's optimum is accepted."""
    plain = load_scene("corridor", 0)
    views = Views(cameras=cameras, weight=200.0)
    problem = plain.replace(objective=plain.objective.replace(views=views))
    result = branch_and_price(problem, parameters=DEFAULTS)
    assert result.certificate is not None
    assert verify(problem, result.certificate).bound == result.bound
    assert result.value <= result.bound <= result.value * (1 + 1e-4)
