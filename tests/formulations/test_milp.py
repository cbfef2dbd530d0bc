import importlib.util
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing, nullcontext
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brute_force import all_paths, objective_from_scratch, optimum
from counting import either
from hypothesis import given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import Calls, examples, tiny

from cocap_opt.formulations.certificates import verify
from cocap_opt.formulations.column_generation.branch_and_price import column_generation
from cocap_opt.formulations.integer_programs import mathopt
from cocap_opt.formulations.integer_programs.cp_sat import cp_sat
from cocap_opt.formulations.integer_programs.mathopt import (
    _answer,
    _request,
    _SolverProcess,
    highs,
    scip,
)
from cocap_opt.formulations.integer_programs.outer_approximation import (
    OuterApproximation,
)
from cocap_opt.formulations.integer_programs.program import Answer, Call, Program, Solver
from cocap_opt.formulations.integer_programs.scip_nonlinear import scip_nonlinear
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Snapshot, silent
from cocap_opt.model import compiled
from cocap_opt.problem import NO_RULES, Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, UnsupportedError
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Interrupt, Limit, Stop, TimeLimit, never

MILPS: dict[str, Any] = {"highs": highs, "scip": scip, "cp-sat": cp_sat}
needs_pyscipopt = pytest.mark.skipif(
    importlib.util.find_spec("pyscipopt") is None,
    reason="PySCIPOpt is not installed (extra pyscipopt)",
)


def slow(value: object) -> object:
    """A parameter whose test takes long."""
    return pytest.param(value, marks=pytest.mark.slow)


ALL = [*MILPS, pytest.param("scip-nonlinear", marks=needs_pyscipopt)]
METHODS = MILPS | {"scip-nonlinear": scip_nonlinear}


@pytest.mark.slow
@pytest.mark.parametrize(
    "method",
    [pytest.param(m, marks=pytest.mark.slow) if m in ("highs", "scip") else m for m in ALL],
)
@examples(8)
@given(problem=either(st.one_of(problems(), problems(over_time=True), meetings(), meetings(3))))
def test_milps_equal_brute_force(method: str, problem: Problem) -> None:
    """plan <= optimum <= bound; "optimal" is optimal and "infeasible" is infeasible."""
    best, result = optimum(problem), METHODS[method](problem)
    assert result.reason is (Reason.INFEASIBLE if best.plan is None else Reason.OPTIMAL)
    assert result.bound >= best.value
    if best.plan is None:
        assert result.plan is None and result.value == -math.inf
    else:
        assert result.value == pytest.approx(best.value, rel=OPTIMALITY, abs=1e-9)
        assert check(problem, result.plan).valid
        assert objective_from_scratch(problem, result.plan) == pytest.approx(result.value)
        # CP-SAT's numbers are rounded up; those of the others are real.
        slack = 0.0 if method == "cp-sat" else 1e-6
        assert best.value * (1 - slack) <= result.statistics.get("solver_bound", math.inf) + 1e-9
    if result.certificate:
        assert verify(problem, result.certificate).bound == result.bound


@pytest.mark.long
@examples(10)
@given(problem=either(st.one_of(problems(), meetings(3))))
def test_one_flow_per_class_has_the_optimum_of_one_per_robot(problem: Problem) -> None:
    """Aggregating the robots of a class changes no optimum; nor does the generic way."""
    results = [
        replace(cp_sat, compile_=compile_)(problem, root=None)
        for compile_ in (compiled, lambda problem: compiled(problem).disaggregated())
    ]
    assert results[0].reason is results[1].reason
    assert results[0].value == pytest.approx(results[1].value, rel=2 * OPTIMALITY, abs=1e-8)
    assert results[0].bound == math.inf and results[0].certificate is None


# -- starts ------------------------------------------------------------------------------------


def stay(problem: Problem) -> Plan:
    """Nobody moves."""
    return Plan(paths=tuple((robot.start,) * (problem.horizon + 1) for robot in problem.robots))


@pytest.mark.parametrize("method", ALL)
def test_a_start_is_where_it_begins(method: str) -> None:
    """A plan that is given is the first value that is reported, and the optimum is found."""
    problem, seen = load_scene("tiny-trap"), list[Snapshot]()
    result = METHODS[method](problem, never, stay(problem), seen.append)
    assert seen[0].value == check(problem, stay(problem)).reward
    assert [s.value for s in seen] == sorted(s.value for s in seen)
    assert (result.reason, result.message) == (Reason.OPTIMAL, "")
    assert result.value == pytest.approx(optimum(problem).value)


@pytest.mark.parametrize("method", ALL)
def test_a_start_that_breaks_a_rule_is_rejected_in_words(method: str) -> None:
    """The message says what is wrong with it; the solver goes on without."""
    problem = load_scene("tiny-trap")
    path = (problem.robots[0].start, problem.robots[1].start)
    crash = Plan(paths=(path, (problem.robots[1].start,) * 2))
    result = METHODS[method](problem, never, crash)
    assert result.message.startswith("start rejected: ")
    assert result.reason is Reason.OPTIMAL
    assert result.value == pytest.approx(optimum(problem).value)


# -- limits ------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ALL)
def test_no_time_at_all(method: str) -> None:
    """A time limit of 0 gives the start back, or that nobody moves, and no exception."""
    problem = tiny()
    start = optimum(problem).plan
    for given_, expected in ((None, stay(problem)), (start, start)):
        result = METHODS[method](problem, TimeLimit(0), given_)
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
        assert result.plan == expected
        assert result.value == pytest.approx(check(problem, expected).reward)
        assert result.bound >= optimum(problem).value


class After(Stop):
    """Ctrl-C so many seconds after the first question."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._begin = seconds, math.inf

    def reached(self) -> Limit | None:
        """Return `Limit.INTERRUPT` once it is late enough."""
        self._begin = min(self._begin, time.monotonic())
        late = time.monotonic() > self._begin + self._seconds
        return Limit.INTERRUPT if late else None


def call_of(stop: Stop, tick: Callable[[], None] = lambda: None) -> Call:
    """A request without a hint, whose solutions go nowhere."""
    return Call(None, 0.0, stop, tick, lambda found: None)


def test_work_that_is_attended_hears_of_a_limit() -> None:
    """Work goes on until a limit is reached, then it is told to end, and its outcome counts."""
    told, ticks = threading.Event(), list[float]()

    def work() -> str:
        assert told.wait(10.0)
        return "so far"

    outcome = call_of(Calls(2), lambda: ticks.append(0.0)).attend(work, told.set)
    assert outcome == "so far" and len(ticks) >= 3
    assert call_of(never).attend(lambda: "at once", told.clear) == "at once"
    assert told.is_set()


def covered(problem: Problem) -> None:
    """Compute the coverage of a problem now, so that later calls do not."""
    model = compiled(problem)
    for robot_class in model.classes:
        model.prepare(robot_class)


def press_when_it_has_begun(others: set[threading.Thread], over: threading.Event) -> None:
    """Press Ctrl-C half a second after a solver has begun, which it does in another thread."""
    while not any("ThreadPool" in one.name for one in set(threading.enumerate()) - others):
        if over.wait(0.05):
            return
    if not over.wait(0.5):
        os.kill(os.getpid(), signal.SIGINT)


@pytest.mark.parametrize(
    ("code", "limit", "words"),
    [
        ("import os; os.kill(os.getpid(), 9)", Limit.MEMORY, "was there too little memory?"),
        ("raise ImportError('too old')", Limit.NUMERICS, "code 1: ImportError: too old"),
    ],
)
def test_a_solver_whose_process_ends_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, limit: Limit, words: str
) -> None:
    """The kernel kills processes when memory is short; libraries may be broken."""
    (tmp_path / "mathopt_worker.py").write_text(code)
    monkeypatch.setattr(mathopt, "__file__", str(tmp_path / "mathopt.py"))
    result = highs(tiny())
    assert result.limit == limit
    assert words in result.message


@pytest.mark.long
@pytest.mark.parametrize("method", MILPS)
def test_ctrl_c_ends_a_long_solve(method: str) -> None:
    """Ctrl-C gives the best plan so far, soon, though solvers have signal handlers of their own."""
    problem = load_scene("bottleneck").replace(horizon=9)  # far more than they close in seconds
    covered(problem)
    over = threading.Event()
    press = partial(press_when_it_has_begun, {*threading.enumerate()}, over)
    begin = time.monotonic()
    with Interrupt.caught() as interrupt:
        threading.Thread(target=press, daemon=True).start()
        result = METHODS[method](problem, interrupt, stay(problem), root=None)
        over.set()
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.INTERRUPT)
    assert result.statistics["rounds"] >= 1  # the solver had begun
    assert time.monotonic() - begin < 60.0  # minutes would be needed to the end
    assert result.plan is not None and check(problem, result.plan).valid
    assert result.value >= check(problem, stay(problem)).reward


SYMMETRIC = """
import numpy as np
from cocap_opt.formulations import EXACT
from cocap_opt.problem import Actor, Airspace, Camera, CollisionRules, Motion, Problem, Robot, State
from cocap_opt.world.workspace import HeightMap

motion, camera = Motion(radius=2, headings=1, layers=(3.0, 5.0), climb=0), Camera(tilts=(1.5,))
camera = camera.replace(width=500, height=400, focal=100.0)
problem = Problem(
    name="symmetric",
    height_map=HeightMap(heights=np.array([[20.0], [0.0], [0.0], [0.0]]), resolution=2.0),
    robots=tuple(Robot(State(2, 0, k), motion, camera, goal=(2, 0)) for k in (0, 1)),
    actors=(Actor(np.array([[x, 3.0, 0.0, 0.0] for x in (-1.0, 3.0, 7.0, 11.0)])),),
    horizon=3,
    rules=CollisionRules(separation=4.0, vertical=2.0),
    airspace=Airspace(people_aside=0.8**0.5, people_above=2.2),
    face_samples=1,
)
print(EXACT["scip-nonlinear"](problem).reason)
"""


@pytest.mark.long
def test_symmetric_programs_come_to_an_end() -> None:
    """SCIP's search for symmetries went on for ever here, without hearing of a limit."""
    said = subprocess.run(
        [sys.executable, "-c", SYMMETRIC], check=True, capture_output=True, text=True, timeout=120
    ).stdout
    assert said == "optimal\n"


@pytest.mark.slow
@pytest.mark.parametrize("method", ALL)
def test_an_interrupt_in_the_root_keeps_its_bound(method: str) -> None:
    """Before the solver has begun, the bound is that of the root so far."""
    problem = load_scene("bottleneck")
    covered(problem)
    result = METHODS[method](problem, After(0.05), stay(problem))
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.INTERRUPT)
    assert result.value <= result.bound < math.inf


@pytest.mark.slow
@pytest.mark.parametrize("method", ["highs", "scip"])
def test_a_time_limit_ends_a_solve(method: str) -> None:
    """Solvers get the time that is left, and the result says that it was too little."""
    problem = load_scene("bottleneck").replace(horizon=9)  # far more than they close in seconds
    covered(problem)
    result = METHODS[method](problem, TimeLimit(1.0), stay(problem), root=None)
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
    assert result.statistics["rounds"] >= 1  # the solver had begun
    assert result.plan is not None


# -- solvers that fail or lie ------------------------------------------------------------------


def solved_by(solver: Solver, problem: Problem, start: Plan | None = None) -> CertifiedResult:
    """Result of outer approximation with some function as its solver."""
    return OuterApproximation(partial(nullcontext, solver))(problem, start=start, root=None)


def test_a_bound_below_a_known_plan_is_not_believed() -> None:
    """What a solver claims is refuted by any plan that has more."""
    problem = load_scene("tiny-trap")

    def liar(program: Program, call: Call) -> Answer:
        return Answer(None, 1.0)

    def denier(program: Program, call: Call) -> Answer:
        return Answer(None, -math.inf)

    for solver in (liar, denier):
        result = solved_by(solver, problem, stay(problem))
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.NUMERICS)
        assert "a plan has J" in result.message
    # The root's own plan refutes as well, though it is not taken over.
    result = OuterApproximation(partial(nullcontext, denier))(problem)
    assert (result.reason, result.plan) == (Reason.STOPPED, stay(problem))


def test_solutions_that_are_none_are_dropped() -> None:
    """A solution that is not integral, or whose robots collide, is no plan."""
    problem = load_scene("tiny-queue")
    model = compiled(problem)

    def half(program: Program, call: Call) -> Answer:
        flow = program.flow
        solution = np.full(flow.n_nodes, 0.4), np.full(flow.n_edges, 0.4)
        return Answer(solution, 1e6, Limit.NUMERICS, message="half a robot")

    def crash(program: Program, call: Call) -> Answer:
        paths = product(*(all_paths(problem, robot) for robot in range(2)))
        plans = (Plan(paths=pair) for pair in paths)
        colliding = next(plan for plan in plans if check(problem, plan).conflicts)
        solution = program.flow.amounts(model.paths(colliding))
        return Answer(solution, 1e6, Limit.NUMERICS)

    for solver in (half, crash):
        result = solved_by(solver, problem)
        assert (result.reason, result.limit) == (Reason.STOPPED, Limit.NUMERICS)
        assert result.plan == stay(problem)


def test_a_gap_that_does_not_close_ends_the_search() -> None:
    """A solver whose bound stays open at its own solution is not asked for ever."""
    problem, asked = load_scene("tiny-trap"), []

    def lazy(program: Program, call: Call) -> Answer:
        asked.append(call.tolerance)
        return Answer(program.flow.amounts(compiled(problem).paths(stay(problem))), 1e6)

    result = solved_by(lazy, problem)
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.NUMERICS)
    assert result.plan == stay(problem)
    assert asked == sorted(asked, reverse=True) and len(asked) < 30


def test_what_goes_wrong_in_the_solvers_process_is_told() -> None:
    """A request that no solver takes is an answer, and the process goes on."""
    from ortools.math_opt import parameters_pb2, rpc_pb2

    unknown = rpc_pb2.SolveRequest(
        solver_type=parameters_pb2.SolverTypeProto.Value("SOLVER_TYPE_GUROBI")
    )
    problem = load_scene("tiny-trap")
    with closing(_SolverProcess()) as process:
        for _ in range(2):
            data = process.solve(unknown.SerializeToString(), call_of(never))

            assert data is not None

            def told(program: Program, call: Call, data: bytes = data) -> Answer:
                return _answer("HIGHS", program, data, late=False)

            result = solved_by(told, problem)
            assert result.limit is Limit.NUMERICS and "the solver failed" in result.message
        # And one that ends the process.
        assert process.solve(b"\xff", call_of(never)) is None
        assert "without an answer" in process.failure(None).message


def test_a_proof_at_the_time_limit_is_not_believed() -> None:
    """HiGHS calls its start optimal, with no bound, where its time ends in the root node."""
    problem, answers = load_scene("tiny-trap"), list[Answer]()
    with closing(_SolverProcess()) as process:

        def solver(program: Program, call: Call) -> Answer:
            request = _request("HIGHS", program, call)
            data = process.solve(request, call._replace(stop=never))
            late = _answer("HIGHS", program, data, late=True)
            answers.append(late)
            return late

        result = solved_by(solver, problem, stay(problem))
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.TIME)
    assert answers[0].bound == math.inf and answers[0].solution is not None
    assert result.value > check(problem, stay(problem)).reward


@pytest.mark.slow
def test_cp_sat_does_not_cut_the_optimum_off() -> None:
    """Presolve of CP-SAT 9.15 does, with its default parameters: or-tools issue 5293."""
    problem = load_scene("corridor").replace(horizon=2)
    result = cp_sat(problem, root=None)
    assert result.reason is Reason.OPTIMAL
    assert result.value == pytest.approx(column_generation(problem).value, rel=OPTIMALITY)


# -- special cases -----------------------------------------------------------------------------


@pytest.mark.parametrize("method", ALL)
def test_a_robot_without_a_path_is_a_proof(method: str) -> None:
    """There is no plan where one robot cannot reach its goal; the certificate says so."""
    problem = tiny().replace(horizon=1)
    robots = tuple(robot.replace(goal=(0, 0)) for robot in problem.robots)
    result = METHODS[method](problem.replace(robots=robots))
    assert (result.reason, result.bound) == (Reason.INFEASIBLE, -math.inf)
    alone = METHODS[method](problem.replace(robots=robots), root=None)
    assert alone.reason is Reason.INFEASIBLE


@pytest.mark.slow
@pytest.mark.parametrize("method", ALL)
def test_several_robots_in_one_state(method: str) -> None:
    """Without rules any number of robots may share a state, from the start on."""
    problem = tiny().replace(rules=NO_RULES)
    crowd = problem.replace(robots=(problem.robots[0],) * 3)
    result = METHODS[method](crowd)
    assert result.value == pytest.approx(optimum(crowd).value, rel=OPTIMALITY)


def test_a_coarse_gap_is_enough_where_it_is_asked_for() -> None:
    """`gap` says when to stop."""
    problem = load_scene("tiny-trap")
    result = cp_sat(problem, never, stay(problem), silent, 0.9)
    assert result.value >= 0.1 * result.bound
    proved = result.gap <= OPTIMALITY
    assert result.reason is (Reason.OPTIMAL if proved else Reason.FINISHED)


@pytest.mark.slow
@needs_pyscipopt
def test_scip_nonlinear_leaves_large_scenes_alone() -> None:
    """It might not hear of a limit for minutes: the root's bound and the start are returned."""
    problem = load_scene("bottleneck")
    result = METHODS["scip-nonlinear"](problem, TimeLimit(20.0), stay(problem))
    assert (result.reason, result.limit) == (Reason.STOPPED, Limit.MEMORY)
    assert "at most" in result.message
    assert result.value <= result.bound < math.inf


def test_scip_nonlinear_says_what_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without PySCIPOpt the method is refused in words."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(UnsupportedError, match="pyscipopt"):
        scip_nonlinear(tiny())


IMPORTS = {
    "cvxpy": "import cvxpy as cp; x = cp.Variable(2, nonneg=True); "
    "p = cp.Problem(cp.Maximize(cp.sum(x)), [x <= 3]); "
    "assert abs(p.solve(solver=cp.HIGHS) - 6) < 1e-6; "
    "assert abs(p.solve(solver=cp.CLARABEL) - 6) < 1e-6",
    "ortools": "from ortools.math_opt.python import mathopt as m; q = m.Model(); "
    "y = q.add_integer_variable(lb=0, ub=2.5); q.maximize(y); "
    "assert m.solve(q, m.SolverType.HIGHS).objective_value() == 2; "
    "assert m.solve(q, m.SolverType.GSCIP).objective_value() == 2; "
    "from ortools.sat.python import cp_model; c = cp_model.CpModel(); v = c.new_int_var(0, 5, ''); "
    "c.maximize(v); s = cp_model.CpSolver(); s.solve(c); assert s.objective_value == 5",
    "highspy": "import highspy; h = highspy.Highs(); h.setOptionValue('output_flag', False); "
    "z = h.addVariable(ub=4.0); h.maximize(z); assert h.getObjectiveValue() == 4",
}


@pytest.mark.long
@pytest.mark.parametrize(
    "order", [("cvxpy", "highspy", "ortools"), ("ortools", "highspy", "cvxpy")]
)
def test_solvers_bear_one_another_in_one_process(order: tuple[str, ...]) -> None:
    """cvxpy's HiGHS and OR-tools' clashed where highspy was 1.15; hence the pin."""
    script = "\n".join(IMPORTS[name] for name in (*order, *order))
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
