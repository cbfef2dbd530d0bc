"""The face, `import cocap_opt as co`: all that a user, the README and the notebooks need."""

import ast
import inspect
import subprocess
import sys
from pathlib import Path
from typing import get_type_hints

import numpy as np
import pytest

import cocap_opt as co

ROOT = Path(__file__).parents[1]
FUNCTIONS = ("load", "plan", "bound", "solve", "check", "verify", "gap", "show", "save", "read")


def test_every_name_is_what_type_checkers_see() -> None:
    """The lazy table and the imports for type checkers name the same things."""
    tree = ast.parse((ROOT / "cocap_opt" / "__init__.py").read_text())
    typed = {
        alias.name: node.module
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("cocap_opt")
        for alias in node.names
    }
    assert typed == co._HOME
    assert all(getattr(co, name) is not None for name in co.__all__)
    assert set(co.__all__) <= set(dir(co))
    with pytest.raises(AttributeError, match="no attribute 'fly_away'"):
        co.fly_away  # noqa: B018


@pytest.mark.parametrize("name", FUNCTIONS)
def test_help_is_useful(name: str) -> None:
    """Functions of the face have types, and say what they take, return and raise."""
    function = getattr(co, name)
    words = inspect.getdoc(function) or ""
    parameters = inspect.signature(function).parameters
    assert "Parameters\n----" in words or name == "read"
    documented = [p for p in parameters if p not in ("problem", "path")]
    assert all(f"{p} :" in words for p in documented if name != "read"), name
    assert set(function.__annotations__) >= set(parameters)


@pytest.mark.parametrize("registry", ["PLANNERS", "BOUNDS", "EXACT"])
def test_methods_are_described(registry: str) -> None:
    """Each method can be called with a problem alone, and `help` tells what it does."""
    for name, method in getattr(co, registry).items():
        first, *others = inspect.signature(method).parameters.values()
        assert first.name == "problem", name
        assert all(p.default is not inspect.Parameter.empty for p in others), name
        words = inspect.getdoc(method) or ""
        assert len(words) > 30 and "partial(" not in words, name


def test_importing_loads_no_solver() -> None:
    """`import cocap_opt` loads neither NumPy nor a solver; the first use of a name does."""
    code = (
        "import sys, cocap_opt as co;"
        "assert not {'numpy', 'clarabel', 'cvxpy', 'ortools', 'highspy'} & set(sys.modules);"
        "co.load('tiny-queue');"
        "assert not {'clarabel', 'cvxpy', 'ortools', 'highspy', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_a_scene_of_ones_own_in_fifteen_lines(tmp_path: Path) -> None:
    """A scene, a plan, its gap and a picture, by the face alone."""
    heights = np.zeros((12, 12))
    heights[5:7, 3:9] = 8.0  # a wall
    walk = np.column_stack([np.linspace(2, 9, 7), np.full(7, 10.5), np.zeros(7), np.zeros(7)])
    problem = co.Problem(
        name="yard",
        height_map=co.HeightMap(heights=heights),
        robots=tuple(co.Robot(start=co.State(x, 1)) for x in (2, 9)),
        actors=(co.Actor(poses=walk),),
        horizon=6,
    )
    result = co.plan(problem, "cocap", time_limit=10)
    best = co.solve(problem, time_limit=60, start=result)
    assert result.value <= best.value <= best.bound
    assert best.reason is co.Reason.OPTIMAL
    verified = co.verify(problem, result, best.certificate)
    assert 0 <= verified.gap < 1 and verified.reward == pytest.approx(result.value)
    assert co.check(problem, result).valid
    for content, name in ((problem, "scene"), (best, "plan"), (best.certificate, "proof")):
        co.save(tmp_path / f"{name}.json", content)
    assert co.read(tmp_path / "plan.json") == best.plan
    again = co.read(tmp_path / "scene.json")
    assert isinstance(again, co.Problem)
    assert co.verify(again, co.read(tmp_path / "proof.json")).bound == best.bound
    result.plot().figure.savefig(tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 5_000
    co.show(problem, result, best).save(tmp_path / "plans.html")
    assert "<html" in (tmp_path / "plans.html").read_text()


def test_played_plans_have_titles() -> None:
    """A result is called by its J; a plan, whose J is not known before it is checked, is not."""
    problem = co.load("bottleneck")
    result = co.plan(problem, "cocap")
    lost = co.Result.without_plan(co.Reason.FAILED, "none was found")
    said = repr(co.show(problem, result, lost, result.plan))
    assert ": 1: J = 54,642 | plan 2;" in said


def test_things_describe_themselves() -> None:
    """Problems, plans and results are said in at most five lines, and drawn in notebooks."""
    problem = co.load("tiny-queue")
    result = co.plan(problem)
    for thing in (problem, result.plan, result):
        assert 1 <= len(repr(thing).splitlines()) <= 5
        assert len(repr(thing)) < 400
    for thing in (problem, result):
        assert "<img" in thing._repr_html_()
    assert "J " in result.summary() and "seconds" in result.summary()
    with pytest.raises(ValueError, match="no plan to draw"):
        co.bound(problem, "alone").plot()


def test_methods_and_limits_are_checked() -> None:
    """What is no planner, no method or no limit is refused in words."""
    problem = co.load("tiny-queue")
    with pytest.raises(ValueError, match=r"planner: must be one of greedy, .*, not 'cocop'"):
        co.plan(problem, "cocop")
    with pytest.raises(ValueError, match="method: must be one of"):
        co.solve(problem, "simplex")
    with pytest.raises(ValueError, match="time_limit: must be"):
        co.plan(problem, time_limit=-1)
    with pytest.raises(ValueError, match="gap: must be"):
        co.solve(problem, gap=1.0)
    with pytest.raises(co.FileError, match="no such scene or file"):
        co.load("no-such-scene")
    assert co.plan(problem, time_limit=0).limit is co.Limit.TIME
    assert co.plan(problem, stop=co.WorkLimit(0)).reason in tuple(co.Reason)
    mine = co.plan(problem, lambda problem, stop: co.PLANNERS["greedy"](problem, stop))
    assert mine.value == co.plan(problem, "greedy").value


def test_types_are_known() -> None:
    """The functions' types can be resolved, so that editors show them."""
    for name in ("load", "plan", "bound", "solve", "check", "verify"):
        assert "return" in get_type_hints(getattr(co, name))


def test_the_readme_lives_on_the_face(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The README's Python runs as it stands, and imports nothing else of the project.

    A folder of the user's own that is called `scenarios`, or a module `experiments`, is not in the
    way.
    """
    text = (ROOT / "README.md").read_text()
    blocks = [part.split("```")[0] for part in text.split("```python\n")[1:]]
    assert blocks
    (tmp_path / "scenarios").mkdir()
    (tmp_path / "scenarios" / "__init__.py").write_text("raise ImportError('the user\\'s own')")
    (tmp_path / "experiments.py").write_text("raise ImportError('the user\\'s own')")
    for block in blocks:
        imported = {
            alias.name if isinstance(node, ast.Import) else node.module
            for node in ast.walk(ast.parse(block))
            if isinstance(node, ast.Import | ast.ImportFrom)
            for alias in node.names
        }
        assert imported <= {"cocap_opt", "numpy", "pandas", "matplotlib.pyplot"}
        done = subprocess.run(
            [sys.executable, "-c", block], cwd=tmp_path, capture_output=True, text=True,
            timeout=120, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert "optimal" in done.stdout
        assert len([line for line in block.splitlines() if line.strip()]) <= 15
