"""Files of programs are read back by other solvers, whose plans are the referee's optima."""

import importlib.util
import io
import math
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import highspy
import numpy as np
import pytest
from brute_force import optimum
from cbf import Cbf
from counting import either
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import meetings, problems
from strategies import examples, tiny

from cocap_opt.data import ProblemError
from cocap_opt.formulations import EXACT
from cocap_opt.formulations.model_files.conic import write_cones
from cocap_opt.formulations.model_files.linear import write_linear
from cocap_opt.formulations.model_files.model import ModelFile
from cocap_opt.formulations.model_files.nonlinear import nonlinear_files
from cocap_opt.formulations.model_files.solutions import plan_of_solution
from cocap_opt.formulations.model_files.tangents import MOST_SUMS, Tangents
from cocap_opt.formulations.relaxations.cone_program import single_view
from cocap_opt.formulations.relaxations.flow import Flow, Roots
from cocap_opt.model import compiled
from cocap_opt.problem import CollisionRules, Problem
from cocap_opt.referee import check
from cocap_opt.result import UnsupportedError
from cocap_opt.scenarios import load_scene
from cocap_opt.vision.default_weights import with_views


def without(module: str, extra: str) -> pytest.MarkDecorator:
    """Skips a test where a module is not installed."""
    return pytest.mark.skipif(
        importlib.util.find_spec(module) is None, reason=f"{module} is missing (extra {extra})"
    )


needs_scip, needs_pyomo = without("pyscipopt", "pyscipopt"), without("pyomo", "nl")


def _free_starts() -> Problem:
    problem = tiny()
    first, second = problem.robots
    starts = [first.start, first.start._replace(x=1), first.start._replace(heading=1)]
    return problem.replace(robots=(first.replace(start=starts), second), name="free starts")


def _separated() -> Problem:
    problem = load_scene("corridor", 0).until(2)
    return problem.replace(rules=CollisionRules(separation=3.0), name="separated")


def _over_time() -> Problem:
    problem = tiny()
    objective = problem.objective.replace(over_time=True)
    return problem.replace(objective=objective, name="over time")


SCENES: dict[str, Callable[[], Problem]] = {
    "tiny-doorway": lambda: load_scene("tiny-doorway", 0),
    "tiny-trap": lambda: load_scene("tiny-trap", 0),
    "corridor": lambda: load_scene("corridor", 0).until(2),
    "views": lambda: with_views(load_scene("corridor", 0).until(2), 2, None),
    "separation": _separated,
    "free starts": _free_starts,
    "over time": _over_time,
}
each_scene = pytest.mark.parametrize("name", SCENES)


@lru_cache
def scene(name: str) -> tuple[Problem, float]:
    """A scene, and its optimum by a method that knows no such file."""
    problem = SCENES[name]()
    result = EXACT["branch-and-price"](problem, gap=1e-9)
    assert result.gap <= 1e-7
    return problem, result.value


def linear(problem: Problem, folder: Path, ending: str, error: float = 1e-7) -> Path:
    """The file of a linear program."""
    path = folder / f"program{ending}"
    with path.open("wb") as file:
        write_linear(file, ModelFile.with_tangents(compiled(problem), error), ending)
    return path


def by_highs(path: Path) -> tuple[float, str]:
    """HiGHS' optimum of J in a file, and its solution file."""
    solver = highspy.Highs()
    for name, value in (("output_flag", False), ("threads", 1), ("mip_rel_gap", 0.0)):
        solver.setOptionValue(name, value)
    assert solver.readModel(str(path)) == highspy.HighsStatus.kOk
    solver.run()
    assert solver.getModelStatus() == highspy.HighsModelStatus.kOptimal
    found = path.with_suffix(".highs")
    solver.writeSolution(str(found), 0)
    return _j(path, solver.getInfo().objective_function_value), found.read_text()


def _j(path: Path, objective: float) -> float:
    """J by an objective: MPS has -J, to be minimised."""
    return -objective if path.suffix == ".mps" else objective


def by_scip(path: Path) -> tuple[float, str]:
    """SCIP's optimum of J in a file, and its solution file."""
    import pyscipopt

    model = pyscipopt.Model()
    model.hideOutput()
    model.setParam("misc/usesymmetry", 0)
    model.readProblem(str(path))
    model.optimize()
    assert model.getStatus() == "optimal"
    found = path.with_suffix(".scip")
    model.writeBestSol(str(found))
    return _j(path, model.getObjVal()), found.read_text()


def require_optimum(problem: Problem, best: float, objective: float, solution: str) -> None:
    """A solver's plan is worth the optimum, by the referee, and by its objective about as much."""
    verdict = check(problem, plan_of_solution(problem, solution))
    assert verdict.valid
    assert verdict.reward == pytest.approx(best, rel=1e-9)
    assert objective == pytest.approx(best, rel=1e-5)


SOLVERS = {"highs": by_highs, "scip": by_scip}


# Solvers that take seconds, each with a scene whose files the other one reads at once.
LONG = {("corridor", "highs"), ("views", "highs"), ("over time", "scip")}
each_solver = pytest.mark.parametrize(
    ("name", "solver"),
    [
        pytest.param(
            name, solver,
            marks=[needs_scip] * (solver == "scip") + [pytest.mark.long] * ((name, solver) in LONG),
        )
        for name in SCENES for solver in SOLVERS
    ],
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("ending", [".mps", ".lp"])
@each_solver
def test_linear_programs_have_the_optimum(
    name: str, ending: str, solver: str, tmp_path: Path
) -> None:
    """HiGHS and SCIP read MPS and LP back; their plans are optima, their objectives close to J."""
    problem, best = scene(name)
    require_optimum(problem, best, *SOLVERS[solver](linear(problem, tmp_path, ending)))


@pytest.mark.long
@needs_scip
@each_scene
def test_cone_programs_have_the_optimum(name: str) -> None:
    """A reader of CBF of its own gives SCIP the same program; x0, x1, .. are read, too."""
    problem, best = scene(name)
    program = cone_file(problem)
    objective, values = program.scip()
    named = "".join(f"{key} {value!r}\n" for key, value in values.items())
    numbered = "".join(f"x{k} {value!r}\n" for k, value in enumerate(values.values()))
    require_optimum(problem, best, objective, named)
    assert plan_of_solution(problem, numbered) == plan_of_solution(problem, named)


def cone_file(problem: Problem) -> Cbf:
    """A problem's file in CBF, written and read."""
    file = io.BytesIO()
    write_cones(file, ModelFile.with_cones(compiled(problem)))
    return Cbf.read(file.getvalue().decode())


@pytest.mark.slow
@each_scene
def test_the_relaxation_of_cone_programs_is_the_single_view_bound(name: str) -> None:
    """Without whole drones Clarabel has the value of our own relaxation, which is above J."""
    problem, best = scene(name)
    ours = single_view(problem)
    value = cone_file(problem).clarabel()
    assert value == pytest.approx(ours.statistics["solver_value"], rel=1e-6)
    assert best <= value * (1 + 1e-7)


@pytest.mark.slow
@needs_scip
@needs_pyomo
@each_scene
def test_nonlinear_programs_have_the_optimum(name: str, tmp_path: Path) -> None:
    """SCIP reads NL back, with the names in the file beside it."""
    problem, best = scene(name)
    for ending, text in nonlinear_files(ModelFile.with_cones(compiled(problem))).items():
        (tmp_path / f"program{ending}").write_bytes(text)
    require_optimum(problem, best, *by_scip(tmp_path / "program.nl"))


@pytest.mark.slow
@examples(30)
@given(problem=either(st.one_of(problems(), problems(over_time=True), meetings(), meetings(3))))
def test_random_programs_have_the_optimum(
    tmp_path_factory: pytest.TempPathFactory, problem: Problem
) -> None:
    """Brute force, HiGHS and the referee agree."""
    best = optimum(problem)
    assume(best.plan is not None)
    objective, solution = by_highs(linear(problem, tmp_path_factory.mktemp("program"), ".mps"))
    verdict = check(problem, plan_of_solution(problem, solution))
    assert verdict.valid
    # Two plans may differ by less than HiGHS' tolerance of rows, 1e-6.
    assert verdict.reward == pytest.approx(best.value, rel=2e-6, abs=1e-6)
    assert objective == pytest.approx(best.value, rel=1e-5, abs=1e-5)


@pytest.mark.slow
@needs_scip
@examples(20)
@given(problem=either(st.one_of(problems(), problems(over_time=True), meetings(), meetings(3))))
def test_random_cone_programs_have_the_optimum(problem: Problem) -> None:
    """Brute force and SCIP agree; the relaxation's optimum is the single-view bound."""
    best = optimum(problem)
    assume(best.plan is not None)
    program = cone_file(problem)
    objective, values = program.scip()
    text = "".join(f"{key} {value!r}\n" for key, value in values.items())
    verdict = check(problem, plan_of_solution(problem, text))
    assert verdict.valid
    # SCIP keeps u^2 <= z to 1e-6 only.
    assert verdict.reward == pytest.approx(best.value, rel=1e-4, abs=1e-4)
    assert objective == pytest.approx(best.value, rel=1e-4, abs=1e-4)
    relaxed = program.clarabel()
    assert relaxed >= best.value - 1e-5 * (1 + abs(best.value))
    assert relaxed == pytest.approx(
        single_view(problem).statistics["solver_value"], rel=1e-5, abs=1e-5
    )


@each_scene
def test_plans_satisfy_the_program_and_are_worth_their_j(name: str) -> None:
    """At a plan's numbers all rows hold; the objective is J or a little more, as is promised."""
    problem, _ = scene(name)
    model = compiled(problem)
    plan = EXACT["branch-and-price"](problem).plan
    assert plan is not None
    for error in (1e-3, 1e-5, 1e-7):
        file = ModelFile.with_tangents(model, error)
        assert file.error <= error
        v = file.program.point(file.program.flow.amounts(model.paths(plan)))
        program = file.linear
        rows = program.rows @ v
        assert (program.low <= v).all() and (v <= program.high).all()
        assert (rows >= program.row_low - 1e-9).all() and (rows <= program.row_high + 1e-9).all()
        reward = check(problem, plan).reward
        assert reward * (1 - 1e-12) <= program.gain @ v <= reward * (1 + file.error + 1e-12)


def test_lp_and_mps_are_such_that_others_read_them(tmp_path: Path) -> None:
    """No long lines and no empty section in LP; a name, and no direction, in MPS."""
    problem, _ = scene("corridor")
    lines = linear(problem, tmp_path, ".lp").read_text().splitlines()
    assert max(map(len, lines)) <= 255  # of CPLEX's 560
    assert lines[-1] == "end" and "semi" not in lines
    named = problem.replace(name="été\nEND")
    text = linear(named, tmp_path, ".mps").read_bytes()
    assert text.isascii() and b"cocap-opt: \\xe9t\\xe9" in text
    lines = linear(problem, tmp_path, ".mps").read_text().splitlines()
    first = next(k for k, line in enumerate(lines) if line[0] != "*")
    assert lines[first].split() == ["NAME", "cocap-opt"]
    assert not any(line.startswith("OBJSENSE") for line in lines)
    assert "* minimise -J (px^0.5/m)" in lines


@each_scene
def test_names_are_names(name: str) -> None:
    """No two variables or rows have one name, and each format takes all of them."""
    file = ModelFile.with_tangents(compiled(scene(name)[0]))
    m, n = file.linear.rows.shape
    for names, number in ((file.variables, n), (file.rows, m)):
        assert len(set(names)) == len(names) == number
        assert all(len(word) < 256 and word.isidentifier() for word in names)


@pytest.mark.parametrize("error", [1e-2, 1e-4, 1e-6])
def test_tangents_keep_their_error_and_are_no_more_than_it_takes(error: float) -> None:
    """At all sums of two views a tangent is as near as asked for; a smaller error needs more."""
    problem, _ = scene("corridor")
    flow = Flow.of(compiled(problem))
    roots = Roots.of(flow)
    found = Tangents.of(flow, roots, error)
    worst = 0.0
    for z in range(roots.returns.n_roots):
        touching = found.z0[found.at == z]
        views = roots.pixels[[z]].data
        sums = np.unique(np.add.outer(views, views))
        if not len(touching):
            continue
        lines = sums[:, None] / (2 * np.sqrt(touching)) + np.sqrt(touching) / 2
        over = lines.min(axis=1) / np.sqrt(sums) - 1
        assert over.min() >= -1e-12
        worst = max(worst, float(over.max()))
    assert worst <= error * (1 + 1e-6) + 1e-12
    assert len(found.z0) > len(Tangents.of(flow, roots, 10 * error).z0)
    assert len(found.z0) <= len(Tangents.of(flow, roots, 0.0).z0)


def test_no_error_at_all_is_refused_where_sums_are_too_many() -> None:
    """Pixels that add up over time have any sums; an error of 0 asks for a tangent at each."""
    problem, _ = scene("over time")
    with pytest.raises(UnsupportedError, match=f"more than {MOST_SUMS:,} sums"):
        ModelFile.with_tangents(compiled(problem), 0.0)
    assert ModelFile.with_tangents(compiled(problem), 1e-4).error == 1e-4


WAYS = {
    "scip": "{name}      {value} \t(obj:0)\n",
    "gurobi": "{name} {value}\n",
    "cbc": "   12 {name}    {value}    0\n",
    "cplex": '<variable name="{name}" index="3" value="{value}"/>\n',
    "glpk": "    12 {name}\n                    *              {value}             0\n",
    "mosek": "12  {name}  BS  {value}  0.0  1.0  0.0  0.0\n",
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", ["tiny-doorway", "free starts"])
def test_solutions_of_many_solvers_are_read(name: str, way: str) -> None:
    """The files of solvers differ, and all of them tell the same plan; zeros may be left out."""
    problem, _ = scene(name)
    model, plan = compiled(problem), EXACT["branch-and-price"](problem).plan
    file = ModelFile.with_cones(model)
    values = file.program.point(file.program.flow.amounts(model.paths(plan)))
    lines = [
        WAYS[way].format(name=variable, value=value + 1e-9)
        for variable, value in zip(file.variables, values.tolist(), strict=True)
        if value
    ]
    again = plan_of_solution(problem, "status: optimal, J = 12.5\n" + "".join(lines))
    assert check(problem, again).reward == check(problem, plan).reward


def test_solutions_that_are_none_are_refused() -> None:
    """Fractions, other scenes, and files without any variable are told in a line."""
    problem, _ = scene("tiny-doorway")
    names = ModelFile.with_cones(compiled(problem)).variables
    for text, words in (
        ("Optimal\n", "contains no variables of a program"),
        ("".join(f"{name} 0.5\n" for name in names), "fractional drones"),
        ("x_d0_t9_x0_y0_l0_h0_p0 1\n", "has 0 drones at step 0"),
        ("".join(f"{name} 1\n" for name in names if "_t0_" in name), "no paths"),
        ("".join(f"{name} 1\n" for name in names if name[0] == "x"), "no paths"),
    ):
        with pytest.raises(ProblemError, match=words):
            plan_of_solution(problem, text)


def test_scenes_without_a_plan_have_no_program() -> None:
    """A drone that cannot reach its goal is told before coverage is computed."""
    problem = tiny()
    robots = (problem.robots[0].replace(goal=(3, 2)), problem.robots[1])
    with pytest.raises(UnsupportedError, match="a drone has no path"):
        ModelFile.with_cones(compiled(problem.replace(robots=robots, horizon=1)))


def test_scenes_that_end_earlier() -> None:
    """A scene that is cut has the first steps of the whole one, and nothing else is changed."""
    whole = load_scene("corridor", 0)
    cut = whole.until(3)
    assert (cut.horizon, cut.name) == (3, "corridor-steps3")
    assert whole.until(whole.horizon) is whole
    for before, after in zip(whole.actors, cut.actors, strict=True):
        assert np.array_equal(after.poses, before.poses[:4])
    plan = EXACT["branch-and-price"](cut).plan
    longer = type(plan)(paths=tuple(path + path[-1:] * 5 for path in plan.paths))
    assert check(whole, longer).reward > check(cut, plan).reward
    assert math.isfinite(check(cut, plan).reward)
    for steps in (0, -1, whole.horizon + 1):
        with pytest.raises(ProblemError, match=rf"steps: must be 1..{whole.horizon}, not {steps}"):
            whole.until(steps)
