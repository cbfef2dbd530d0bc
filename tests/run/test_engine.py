"""The engine: one room runs all methods, and what it says is the same wherever it is asked."""

import ast
import math
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import numpy as np
import pytest
from sources import ROOT, sources
from sweeps import SETTINGS
from test_cli import Run

import cocap_opt as co
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.sweeps.sweep import sweep
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult
from cocap_opt.method import START_AND_REPORT, Method
from cocap_opt.model import compiled
from cocap_opt.run import engine
from cocap_opt.run.engine import SOLVERS, record_of, run
from cocap_opt.run.judged import RefereeError
from cocap_opt.vision.cache import TableCache

SCENE = "tiny-share"
REGISTRIES = {"PLANNERS", "BOUNDS", "EXACT", "SOLVERS"}
FIELDS = {field.name for field in fields(Method)} - {"call"}


def called(node: ast.expr) -> str:
    """The name of something, of a module's or not; empty if it has none."""
    return getattr(node, "id", "") or getattr(node, "attr", "")


def methods_taken(source: str) -> Iterator[str]:
    """Where code takes a method out of a registry, and not only what its record says."""
    tree = ast.parse(source)
    only_read = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute) and node.attr in FIELDS
    }
    loops = [n for n in ast.walk(tree) if isinstance(n, ast.For | ast.comprehension)]
    members = {
        name.id
        for loop in loops
        if isinstance(loop.iter, ast.Call)
        and isinstance(loop.iter.func, ast.Attribute)
        and called(loop.iter.func.value) in REGISTRIES
        for name in ast.walk(loop.target)
        if isinstance(name, ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and called(node.value) in REGISTRIES:
            if id(node) not in only_read:
                yield f"line {node.lineno}: {ast.unparse(node)}"
        elif isinstance(node, ast.Call) and called(node.func) in members:
            yield f"line {node.lineno}: {ast.unparse(node)}"


@pytest.mark.parametrize("name", [*SOLVERS, *co.BOUNDS])
def test_coverage_is_there_before_a_method_begins(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """So `seconds` are the method's own; those that need no whole coverage never compute it."""
    method, seen = record_of(name), []

    def spy(problem: co.Problem, *_: object, **__: object) -> CertifiedResult:
        seen.append(compiled(problem).covered_steps > problem.horizon)
        return CertifiedResult(None, -math.inf, co.Reason.FAILED)

    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    compiled.cache_clear()
    run(co.load(SCENE), replace(method, call=spy))
    assert seen == [not method.lazy]


class Slow:
    """A clock that stands still, but for what is slow on a machine with much else to do."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.seconds = 1000.0
        clock = SimpleNamespace(monotonic=lambda: self.seconds, perf_counter=lambda: self.seconds)
        monkeypatch.setattr("cocap_opt.stop.time", clock)

    def slowed(self, call: Callable[..., Any], seconds: float) -> Callable[..., Any]:
        """The call, which takes so many seconds."""

        def slow(*args: Any) -> Any:
            self.seconds += seconds
            return call(*args)

        return slow


@pytest.mark.parametrize("name", ["sequential", "cocap-vs", "column-generation"])
def test_a_limit_is_for_coverage_and_search_alone(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What comes before them takes nothing of it, also where no forecast has done it before.

    It is the compiled scene, which lazy methods ask for first, and the key of the cache, for which
    all code is read: under load either took seconds, which no number showed.
    """
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    compiled.cache_clear()
    clock = Slow(monkeypatch)
    scene, limit = co.load(SCENE), co.TimeLimit(10.0)
    monkeypatch.setattr(engine, "compiled", clock.slowed(compiled, 60.0))
    monkeypatch.setattr(TableCache, "key", clock.slowed(TableCache.key, 60.0))
    judged = run(scene, name, co.FirstOf(limit))
    assert clock.seconds >= 1060.0
    assert limit.seconds_left == 10.0
    assert judged.result.limit is None
    assert judged.result.seconds == 0.0


def test_only_the_engine_calls_methods_of_registries() -> None:
    """Others list them and read their records; the engine runs them, and has them judged."""
    taken = list(
        methods_taken("PLANNERS['a'].lazy\nPLANNERS[n](p)\n[f(p) for f in EXACT.values()]")
    )
    assert [words.split(":")[0] for words in taken] == ["line 2", "line 3"]
    others = {
        name: path.read_text(encoding="utf-8")
        for name, path in sources().items()
        if not name.startswith("cocap_opt.run.")
    }
    found = {
        name: list(methods_taken(text))
        for name, text in others.items()
        if any(registry in text for registry in REGISTRIES)
    }
    assert {name: places for name, places in found.items() if places} == {}


@pytest.mark.long
@pytest.mark.parametrize("name", SOLVERS)
def test_a_plan_is_worth_the_same_wherever_it_is_made(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """J and the reason of every method: in Python, on the command line, in a sweep of one cell."""
    problem = co.load(SCENE)
    found = co.plan(problem, name)
    told = Run(capsys, "plan", SCENE, "--planner", name, "--json").json
    (row,) = sweep([Instance(problem, 0, [name], SETTINGS)], None, quiet=True)
    assert found.plan is not None and found.value == co.check(problem, found).reward
    expected = [(found.value, str(found.reason))]
    assert [(told["reward"], told["reason"]), (row.reward, row.reason)] == expected * 2
    if name in co.EXACT:
        best = co.solve(problem, name)
        told = Run(capsys, "solve", SCENE, "--method", name, "--json").json
        assert (told["reward"], told["reason"]) == (best.value, str(best.reason))
        assert told["bound"] == best.bound and [(best.value, str(best.reason))] == expected


@pytest.mark.slow
@pytest.mark.parametrize("name", co.BOUNDS)
def test_a_bound_is_the_same_wherever_it_is_made(
    name: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Bound, reason and J of the plan that comes with it, in Python and on the command line."""
    found = co.bound(co.load(SCENE), name)
    told = Run(capsys, "bound", SCENE, "--method", name, "--json").json
    value = None if found.plan is None else found.value
    assert (told["bound"], told["reason"]) == (found.bound, str(found.reason))
    assert told["reward"] == value
    assert (found.value == -float("inf")) == (found.plan is None)


def test_values_are_the_referees() -> None:
    """Also those of methods of somebody's own; one that claims more is told of in words."""
    problem = co.load(SCENE)
    honest = co.plan(problem, "greedy")

    def near(problem: co.Problem, stop: co.Stop) -> co.Result:
        return replace(honest, value=honest.value * (1 + 1e-12))

    def boasting(problem: co.Problem, stop: co.Stop) -> co.Result:
        return replace(honest, value=honest.value + 1)

    assert co.plan(problem, near).value == co.check(problem, honest).reward
    with pytest.raises(co.RefereeError, match=r"boasting: claims J = .*, but it is "):
        co.plan(problem, boasting)

    def low(
        problem: co.Problem, stop: co.Stop, start: object, report: object
    ) -> co.CertifiedResult:
        found = co.BOUNDS["alone"](problem, stop)
        return replace(found, bound=found.bound / 2)

    with pytest.raises(RefereeError, match=r"low: bound: the result claims .*, its file"):
        co.bound(problem, low)


def test_methods_get_what_they_take() -> None:
    """A record says what its function is handed besides problem and stop."""
    problem, given = co.load(SCENE), {}

    def everything(
        problem: co.Problem, stop: co.Stop, start: object, report: object, *, seed: int, gap: float
    ) -> co.Result:
        given.update(start=start, report=report, seed=seed, gap=gap)
        return co.Result.without_plan(co.Reason.FAILED, "it only looks")

    start = co.plan(problem, "greedy").plan
    method = Method(everything, takes=START_AND_REPORT | {"seed", "gap"})
    judged = run(problem, method, seed=7, start=start, report=print, gap=0.5)
    assert given == {"start": start, "report": print, "seed": 7, "gap": 0.5}
    assert judged.answer(problem, "everything").value == -float("inf")


STAYS = '''"""Nobody moves."""

from cocap_opt.problem import Plan
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result
from cocap_opt.stop import never


def stays(problem, stop=never):
    """Lets all drones wait where they are."""
    plan = Plan.hovering(problem)
    return Result(plan, check(problem, plan).reward, Reason.FINISHED)
'''
AGAIN = '''"""A bound by another name."""

from cocap_opt.formulations.result import silent
from cocap_opt.formulations.simple_bounds import alone
from cocap_opt.stop import never


def again(problem, stop=never, start=None, report=silent):
    """Bounds a problem as if every drone were alone."""
    return alone(problem, stop, start, report)
'''
TRIED = """
import inspect
import cocap_opt as co
from cocap_opt.cli.main import main
from cocap_opt.experiments.lab.studies.paper.planner_table import described_planners_in_markdown

table = " ".join(described_planners_in_markdown().split())
assert "| `stays` | nobody moves | all coverage |" in table
assert list(inspect.signature(co.PLANNERS["stays"]).parameters) == ["problem", "stop"]
problem = co.load("tiny-share")
assert co.plan(problem, "stays").value <= co.bound(problem, "again").bound
assert list(co.gap("tiny-share", ["stays"]).planner) == ["stays"]
for words in ("plan tiny-share --planner stays", "bound tiny-share --method again"):
    try:
        main(words.split())
    except SystemExit as ended:
        assert not ended.code
"""


@pytest.mark.long
def test_a_new_method_is_one_file_and_one_line(tmp_path: Path) -> None:
    """A planner and a bound, added to a copy: commands, Python, sweeps and tables know them."""
    copy = shutil.copytree(ROOT, tmp_path / "cocap_opt")
    planner = 'Method("cocap_opt.planners.stays:stays", "nobody moves")'
    bound = 'Method("cocap_opt.formulations.again:again", takes=START_AND_REPORT)'
    for folder, name, text, registry, line in (
        ("planners", "stays", STAYS, "PLANNERS: ", planner),
        ("formulations", "again", AGAIN, "BOUNDS: ", bound),
    ):
        (copy / folder / f"{name}.py").write_text(text)
        front = copy / folder / "__init__.py"
        before, head, after = front.read_text().partition(f"\n{registry}")
        opened, brace, rest = after.partition("{\n")
        added = f'        "{name}": {line},\n'
        front.write_text(before + head + opened + brace + added + rest)
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "COCAP_OPT_CACHE": str(tmp_path)}
    subprocess.run([sys.executable, "-c", TRIED], check=True, env=environment, cwd=tmp_path)


def test_the_face_takes_a_planner_as_the_gap_table_does() -> None:
    """It hands the planner the seed that it asks for, and says in words what goes wrong in it."""
    problem, seeds = co.load(SCENE), []

    def seeded(problem: co.Problem, stop: co.Stop, seed: int) -> co.Result:
        seeds.append(seed)
        return co.Result.without_plan(co.Reason.FAILED, "it does not try")

    def broken(*_: object, **__: object) -> co.CertifiedResult:
        raise KeyError("battery")

    assert co.plan(problem, seeded).message == "it does not try"
    assert seeds == [0]
    for call in (co.plan, co.bound, co.solve):
        with pytest.raises(ValueError, match=r"^broken raised KeyError: 'battery' \(test_engine"):
            call(problem, broken)
    with pytest.raises(ValueError, match="must be a function of a problem and a stop"):
        co.plan(problem, lambda: None)


def test_a_foreign_bound_is_what_its_certificate_proves() -> None:
    """Without a certificate it counts for nothing, and nothing is called optimal by it."""
    problem = co.load(SCENE)
    best, plan = co.solve(problem), co.plan(problem, "sequential")
    low = replace(best, plan=plan.plan, value=plan.value, bound=plan.value)
    assert best.certificate is not None
    forged = replace(low, certificate=msgspec.structs.replace(best.certificate, bound=plan.value))
    for call in (co.plan, co.bound, co.solve):
        assert call(problem, lambda *_, **__: best).gap <= OPTIMALITY
        found = call(problem, lambda *_, **__: replace(low, certificate=None))
        assert (found.bound, found.reason) == (math.inf, co.Reason.FINISHED)
        if plan.value < best.value:
            with pytest.raises(RefereeError, match="certificate: bound: claims"):
                call(problem, lambda *_, **__: forged)


def test_a_plan_of_tuples_and_numpys_numbers_is_a_plan() -> None:
    """Whoever reads the result finds states; what are none is refused in words."""
    problem = co.load(SCENE)
    known = co.plan(problem, "sequential")
    assert known.plan is not None
    paths = tuple(
        tuple(tuple(np.int64(x) for x in state) for state in path) for path in known.plan.paths
    )
    found = co.plan(problem, lambda *_: replace(known, plan=co.Plan(paths=paths)))
    assert found.plan == known.plan
    with pytest.raises(ValueError, match="wrong plan: plan: paths: must be a list"):
        co.plan(problem, lambda *_: replace(known, plan=co.Plan(paths=5)))
