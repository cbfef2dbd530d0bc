import hashlib
import inspect
import math
import os
import pydoc
import re
import subprocess
import sys
from functools import cache
from itertools import pairwise

import msgspec
import numpy as np
import pytest
from brute_force import objective_from_scratch, optimum
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import Calls, examples, tiny

from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates import CertificateFile, verify
from cocap_opt.formulations.column_generation.branch_and_price import branch_and_price
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Snapshot
from cocap_opt.formulations.simple_bounds import METHOD
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import NO_RULES, Motion, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.built_in.tiny import TINY_OPTIMA
from cocap_opt.stop import Limit, TimeLimit, never

TOLERANCE = 1e-9
METHODS = {**BOUNDS, **EXACT}
# Of the others, test_milp.py and test_relaxations.py ask the same.
OWN = ("alone", "online", "column-generation", "brute-force", "branch-and-price")
TAKING_LONG = ("online", "column-generation")


def slow(value: object) -> object:
    """A parameter whose test takes long."""
    return pytest.param(value, marks=pytest.mark.slow)


def proves(problem: Problem, result: CertifiedResult) -> bool:
    """True where a result's file proves the bound that the result states, and exactly that.

    A bound from coverage that was not whole is larger than what its numbers prove.
    """
    file = result.certificate
    if file is None:
        return False
    early = isinstance(file, CertificateFile) and file.method == METHOD
    proved = verify(problem, file).bound
    return proved <= result.bound if early else proved == result.bound


def assert_sandwich(problem: Problem, result: CertifiedResult) -> None:
    """plan <= optimum <= bound, and every word of a result holds against brute force."""
    best = optimum(problem)
    assert result.bound >= best.value
    if result.plan is not None:
        assert check(problem, result.plan).valid
        value = objective_from_scratch(problem, result.plan)
        assert result.value == pytest.approx(value, rel=TOLERANCE, abs=TOLERANCE)
        assert result.value <= best.value + TOLERANCE * abs(best.value)
    if result.reason is Reason.OPTIMAL:
        assert result.value == pytest.approx(best.value, rel=1e-6, abs=1e-9)
    if result.reason is Reason.INFEASIBLE:
        assert best.plan is None
    if result.certificate is not None:
        assert proves(problem, result)


@pytest.mark.parametrize("method", [slow(m) if m in TAKING_LONG else m for m in OWN])
@examples(10)
@given(problem=problems(over_time=True))
def test_sandwich(method: str, problem: Problem) -> None:
    """plan <= optimum <= bound, for every method, rule, class of robots and goal."""
    best = optimum(problem)
    result = METHODS[method](problem, never, best.plan)
    assert_sandwich(problem, result)
    assert not result.message.startswith("start rejected")


@pytest.mark.parametrize("method", [name for name in EXACT if name in OWN])
@examples(10)
@given(problem=st.one_of(problems(over_time=True), meetings(), meetings(team=3)))
def test_exact_methods_find_the_optimum(method: str, problem: Problem) -> None:
    """Whatever the rules, goals and classes: optimal, or proved that there is no plan."""
    result = EXACT[method](problem)
    assert_sandwich(problem, result)
    assert result.reason in (Reason.OPTIMAL, Reason.INFEASIBLE)


@cache
def solved(name: str) -> CertifiedResult:
    """The result of branch-and-price for a built-in scene."""
    return branch_and_price(load_scene(name, 0))


@pytest.mark.parametrize(
    "name", [slow(name) if name == "tiny-give-way" else name for name in TINY_OPTIMA]
)
def test_tiny_scenes_are_solved_by_branch_and_price(name: str) -> None:
    """The optima written in the tiny scenes are proved again."""
    problem, result = load_scene(name, 0), solved(name)
    assert_sandwich(problem, result)
    assert result.reason in (Reason.OPTIMAL, Reason.INFEASIBLE)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, *map(slow, range(1, 4))])
def test_branch_and_price_equals_joint_value_iteration(seed: int) -> None:
    """At the paper's size, two robots: two methods that share no search find the same optimum."""
    problem = load_scene("corridor" if seed % 2 else "corridor-tight", seed)
    result, joint = branch_and_price(problem), PLANNERS["joint"](problem, never)
    assert result.reason is Reason.OPTIMAL
    assert result.value == pytest.approx(joint.value, rel=OPTIMALITY)
    assert result.bound >= joint.value


@examples(15)
@given(problem=problems(robots=[1]))
def test_single_view_cuts_are_exact_for_one_robot(problem: Problem) -> None:
    """For one robot the relaxation with single-view cuts is the shortest-path polytope."""
    best = optimum(problem).value
    bound = BOUNDS["column-generation"](problem).bound
    if math.isfinite(best):
        assert bound == pytest.approx(best, rel=1e-5, abs=1e-4)
    else:
        assert bound < 0


@examples(12)
@given(problem=problems())
def test_brute_force_equals_the_independent_oracle(problem: Problem) -> None:
    """The product's brute force and the tests' own, which shares no code with it, agree."""
    best, result = optimum(problem), EXACT["brute-force"](problem)
    assert result.value == pytest.approx(best.value, rel=TOLERANCE, abs=TOLERANCE)
    assert result.reason is (Reason.OPTIMAL if best.plan else Reason.INFEASIBLE)


def test_brute_force_refuses_what_it_cannot_enumerate() -> None:
    """Too many plans is misuse, said in words, not an endless run."""
    problem = tiny()
    poses = problem.actors[0].poses
    longer = problem.actors[0].replace(poses=np.concatenate([poses] * 5))
    with pytest.raises(UnsupportedError, match="at most"):
        EXACT["brute-force"](problem.replace(actors=(longer,), horizon=12))


@pytest.mark.parametrize("method", METHODS)
def test_a_time_limit_still_gives_a_valid_bound(method: str) -> None:
    """With no time at all a method returns a valid bound and says what stopped it."""
    problem = tiny()
    result = METHODS[method](problem, TimeLimit(0))
    assert_sandwich(problem, result)
    if method not in ("alone", "online"):
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", [pytest.param("tiny-give-way", marks=pytest.mark.long), "tiny-head-on"]
)
def test_a_search_stopped_anywhere_has_a_valid_proof(name: str) -> None:
    """Wherever in its tree a limit falls, plan and proof so far are returned and hold."""
    problem, calls = load_scene(name, 0), Calls()
    whole = branch_and_price(problem, calls)
    assert whole.statistics["leaves"] > 2
    nodes = set()
    for most in range(0, calls.asked, max(calls.asked // 5, 1)):
        result = branch_and_price(problem, Calls(most))
        assert_sandwich(problem, result)
        assert result.reason in (Reason.STOPPED, whole.reason)
        nodes.add(result.statistics.get("leaves", 0))
    assert len(nodes) > 2  # it was stopped in trees of several sizes


def test_a_method_shows_its_own_help() -> None:
    """Signature and docstring are the function's, though it is imported at first use only."""
    for name, method in METHODS.items():
        function = method.function
        assert inspect.signature(method) == inspect.signature(function), name
        assert method.__doc__ == function.__doc__
        assert len(method.made_of.splitlines()) == 1
        words = pydoc.plain(pydoc.render_doc(method))
        assert re.search(rf"{method.__name__}\(\s*problem: ", words)
        assert inspect.getdoc(function).splitlines()[0] in words
        required = [
            parameter.name
            for parameter in inspect.signature(method).parameters.values()
            if parameter.default is inspect.Parameter.empty
        ]
        assert required == ["problem"], name
    assert "imported at first use" in inspect.getdoc(type(BOUNDS["alone"]))


def test_summaries_need_no_solver() -> None:
    """The registries say in a line what each method is before any solver is imported."""
    code = (
        "import sys; from cocap_opt.formulations import BOUNDS, EXACT;"
        "print(*(method.made_of for method in (BOUNDS | EXACT).values()));"
        "print({'cvxpy', 'clarabel', 'highspy', 'ortools', 'pyscipopt'} & {*sys.modules})"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True
    ).stdout.splitlines()
    assert said[1] == "set()"
    assert "column generation" in said[0]


@pytest.mark.slow
def test_no_actors_means_a_bound_of_zero() -> None:
    """Where there is nothing to see, every bound is 0."""
    problem = tiny().replace(actors=())
    for method in METHODS.values():
        assert method(problem).bound == pytest.approx(0.0, abs=1e-6)


@examples(10)
@given(problem=problems())
def test_results_are_deterministic(problem: Problem) -> None:
    """The same problem, read anew, gives the same file, number for number."""
    first, second = (branch_and_price(problem.replace()) for _ in range(2))
    assert first.certificate == second.certificate
    assert first.plan == second.plan


@pytest.mark.long
def test_results_do_not_depend_on_the_process() -> None:
    """Nor on the order of sets and dictionaries of one: a tree comes out the same in two."""
    code = (
        "import hashlib, msgspec; from cocap_opt.scenarios import load_scene;"
        "from cocap_opt.formulations import EXACT;"
        "result = EXACT['branch-and-price'](load_scene('tiny-give-way'));"
        "assert result.statistics['nodes'] > 1;"
        "print(hashlib.sha256(msgspec.json.encode(result.certificate)).hexdigest())"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"PYTHONHASHSEED": "2"}, check=True,
        capture_output=True, text=True,
    ).stdout  # fmt: skip
    here = solved("tiny-give-way").certificate
    assert said.strip() == hashlib.sha256(msgspec.json.encode(here)).hexdigest()


def test_a_start_that_breaks_a_rule_is_rejected_in_words() -> None:
    """A plan with conflicts cannot be a start; the result says why and is none the worse."""
    problem = load_scene("corridor-tight", 0)
    greedy = PLANNERS["greedy"](problem, never).plan
    result = branch_and_price(problem, start=greedy)
    assert result.message.startswith("start rejected: step")
    assert result.reason is Reason.OPTIMAL


@pytest.mark.slow
def test_a_good_start_is_kept() -> None:
    """With no time, the plan that was given is what is returned."""
    problem = load_scene("corridor", 0)
    start = PLANNERS["joint"](problem, never)
    result = branch_and_price(problem, TimeLimit(0.0), start.plan)
    assert result.value == pytest.approx(start.value)
    assert result.plan == start.plan
    again = branch_and_price(problem, never, start.plan)
    assert again.value == pytest.approx(start.value)


def test_progress_is_reported_and_monotone() -> None:
    """Values only rise, bounds only fall, and the last ones are the result's."""
    problem = load_scene("corridor", 2)
    seen: list[Snapshot] = []
    result = branch_and_price(problem, report=seen.append)
    assert len(seen) > 3
    assert all(a.value <= b.value for a, b in pairwise(seen))
    assert all(a.bound >= b.bound for a, b in pairwise(seen))
    assert result.bound == pytest.approx(seen[-1].bound, rel=1e-9)


def test_a_wanted_gap_ends_the_search_early() -> None:
    """With a gap to reach, the search stops there; optimal is only said of an optimum."""
    problem = load_scene("corridor", 0)
    rough, best = branch_and_price(problem, gap=0.01), branch_and_price(problem)
    assert OPTIMALITY < rough.gap <= 0.01
    assert (rough.reason, best.reason) == (Reason.FINISHED, Reason.OPTIMAL)
    assert rough.statistics["iterations"] < best.statistics["iterations"]


@examples(10)
@given(problem=problems())
def test_dropping_the_rules_never_lowers_the_optimum(problem: Problem) -> None:
    """The optimum without collision rules is at least the one with them."""
    free = branch_and_price(problem.replace(rules=NO_RULES))
    bound = branch_and_price(problem)
    assume(bound.plan is not None)
    assert free.bound >= bound.value
    assert free.value >= bound.value * (1 - 2 * OPTIMALITY) - TOLERANCE


def test_online_bound_is_tight_where_nothing_can_be_gained() -> None:
    """One robot that nobody can see more than: its online bound is its J."""
    problem = tiny()
    problem = problem.replace(robots=problem.robots[:1])
    turn = Motion(radius=0, turn=0)  # it stays as it is, there is nothing to gain
    still = problem.replace(robots=(problem.robots[0].replace(motion=turn),))
    for one in (problem, still):
        best = PLANNERS["greedy"](one, never)
        assert BOUNDS["alone"](one).bound == pytest.approx(best.value)
        online = BOUNDS["online"](one, never, best.plan).bound
        assert online == pytest.approx(best.value)


def test_a_robot_that_cannot_reach_its_goal_is_a_proof() -> None:
    """Where one robot of a class has no path, every bound says that there is no plan."""
    problem = tiny().replace(horizon=1)
    robots = tuple(robot.replace(goal=(0, 0)) for robot in problem.robots)
    for method in METHODS.values():
        result = method(problem.replace(robots=robots))
        assert result.bound == -math.inf
        assert result.reason is Reason.INFEASIBLE
