"""The face, `import cocap_opt as co`: all that a user, the README and the notebooks need."""

import ast
import dataclasses
import doctest
import inspect
import platform
import re
import subprocess
import sys
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np
import pytest
from scene_files import SEQUENCE, STARTS

import cocap_opt as co
from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.scenarios import load_scene

ROOT = Path(__file__).parents[1]
FUNCTIONS = (
    "load", "plan", "bound", "solve", "check", "verify", "explain", "replans", "gap",
    "show", "save", "read", "team", "trajectory", "robustness", "quality", "quality_bound",
    "coverage", "coverage_digest",
)  # fmt: skip


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
    assert "Parameters\n----" in words
    assert all(f"\n{p} :" in words for p in parameters), name
    assert "Raises\n----" in words
    assert "Examples\n----" in words
    assert set(function.__annotations__) >= set(parameters)


@pytest.mark.parametrize("name", co.__all__)
def test_fields_are_described(name: str) -> None:
    """Help on data of the face says of every field what it is, in which unit or shape."""
    kind = getattr(co, name)
    if not inspect.isclass(kind):
        return
    fields = [*getattr(kind, "_fields", ()), *getattr(kind, "__struct_fields__", ())]
    if dataclasses.is_dataclass(kind):
        fields += [field.name for field in dataclasses.fields(kind)]
    words = "\n".join(inspect.getdoc(one) or "" for one in kind.__mro__)
    lines = re.findall(r"^([\w, ]+) : \S", words, re.MULTILINE)
    told = {field for line in lines for field in line.split(", ")}
    assert {field for field in fields if not field.startswith("_")} <= told


@pytest.mark.slow
def test_examples_of_help_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What docstrings show can be typed as it stands, with a problem and results at hand."""
    monkeypatch.chdir(tmp_path)
    problem = co.load("tiny-queue")
    best = co.solve(problem)
    greedy, cocap = (co.plan(problem, name) for name in ("greedy", "cocap"))
    at_hand = {"co": co, "problem": problem, "greedy": greedy, "cocap": cocap, "result": best,
               "best": best}  # fmt: skip
    ran = 0
    for name in (*FUNCTIONS, "Player", "show_versions"):
        if name != "gap":  # its example takes long; tests of the table are elsewhere
            names: dict[str, Any] = dict(at_hand)
            for example in doctest.DocTestParser().get_examples(getattr(co, name).__doc__ or ""):
                exec(example.source, names)
                ran += 1
    assert ran > 10


@pytest.mark.parametrize("registry", ["PLANNERS", "BOUNDS", "EXACT"])
def test_methods_are_described(registry: str) -> None:
    """Each method can be called with a problem alone, and `help` tells what it does."""
    for name, method in getattr(co, registry).items():
        first, *others = inspect.signature(method).parameters.values()
        assert first.name == "problem", name
        assert all(p.default is not inspect.Parameter.empty for p in others), name
        words = inspect.getdoc(method) or ""
        assert len(words) > 30 and "partial(" not in words, name


@pytest.mark.slow
def test_importing_loads_no_solver() -> None:
    """`import cocap_opt` loads neither NumPy nor a solver; the first use of a name does."""
    code = (
        "import sys, cocap_opt as co;"
        "assert not {'numpy', 'clarabel', 'cvxpy', 'ortools', 'highspy'} & set(sys.modules);"
        "co.load('tiny-queue');"
        "assert not {'clarabel', 'cvxpy', 'ortools', 'highspy', 'matplotlib'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@pytest.mark.slow
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
    terms = co.explain(problem, result, best)
    assert terms.amount.sum() == pytest.approx(best.bound - result.value, abs=1e-9 * best.bound)
    gains = co.replans(problem, result)
    assert gains.gain.max() <= best.bound - result.value + 1e-9 * best.bound
    assert co.check(problem, gains.plan[0]).reward >= result.value
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


def test_options_of_files_are_names_in_python(tmp_path: Path) -> None:
    """Each option of a format, such as start-set, can be given to `load` with underscores."""
    np.save(tmp_path / "map.npy", np.zeros((6, 8)))
    (tmp_path / "seq.yaml").write_text(SEQUENCE)
    (tmp_path / "starts.csv").write_text(STARTS)
    given, chosen = {}, co.FORMATS["greedy-perspectives"].options.allowed
    for name, words in chosen.items():
        for word in words:
            option = {name.replace("-", "_"): word}
            expected = load_scene(str(tmp_path), 0, {name: word})
            assert problem_digest(co.load(tmp_path, **option)) == problem_digest(expected)
        given[name.replace("-", "_")] = words[0]
    assert "start_set" in given
    assert problem_digest(co.load(tmp_path, **given)) == problem_digest(co.load(tmp_path))
    with pytest.raises(co.FileError, match="option 'wings'"):
        co.load(tmp_path, wings="two")


def test_claims_that_cannot_be_verified_are_refused() -> None:
    """Nothing is verified in silence: neither no claim at all, nor a bound that proves itself."""
    problem = co.load("tiny-queue")
    best = co.solve(problem, "brute-force")
    with pytest.raises(ValueError, match="claims: must hold a plan, a certificate or a proof"):
        co.verify(problem)
    with pytest.raises(ValueError, match="claims: must hold"):
        co.verify(problem, co.Result.without_plan(co.Reason.FAILED, "none was found"))
    with pytest.raises(ValueError, match="certificate: the result has none"):
        co.explain(problem, best)
    with pytest.raises(TypeError, match="certificate: must be a certificate, a proof"):
        co.explain(problem, co.plan(problem, "greedy"))
    with pytest.raises(ValueError, match="claims: brute-force's bound has no certificate"):
        co.verify(problem, best)
    assert co.verify(problem, best.plan).bound == float("inf")
    proof = co.bound(problem).certificate
    assert co.verify(problem, best, proof).bound < float("inf")


def test_methods_of_ones_own_give_whole_results() -> None:
    """A result that knows neither its problem nor its seconds nor its method is told of them."""
    problem = co.load("tiny-queue")
    own = co.plan(problem, "greedy").plan
    value = co.check(problem, own).reward

    def hover(problem: co.Problem, stop: co.Stop = co.never) -> co.Result:
        return co.Result(own, value, co.Reason.FINISHED)

    result = co.plan(problem, hover)
    assert result.problem is problem and result.seconds > 0 and result.method == "hover"
    assert co.plan(problem, "greedy").method == "greedy"
    result.plot()
    with pytest.raises(ValueError, match="does not know its problem"):
        hover(problem).plot()

    def nothing(
        problem: co.Problem, stop: co.Stop, start: object, report: object, gap: float = 0
    ) -> co.CertifiedResult:
        return co.CertifiedResult(own, value, co.Reason.FINISHED)

    for found in (co.bound(problem, nothing), co.solve(problem, nothing)):
        assert found.problem is problem and found.seconds > 0 and found.method == "nothing"


def test_progress_is_reported() -> None:
    """`bound` and `solve` tell of their values and bounds as they go on."""
    problem = co.load("tiny-queue")
    seen: list[co.Snapshot] = []
    best = co.solve(problem, report=seen.append)
    assert seen and all(s.value <= best.value and s.bound >= best.value for s in seen)
    seen.clear()
    co.bound(problem, report=seen.append)
    assert seen


def test_saved_plans_name_their_planner(tmp_path: Path) -> None:
    """A result knows the method that made it; of a plan alone nobody is named."""
    problem = co.load("tiny-queue")
    result = co.plan(problem, "greedy")
    for content, planner in ((result, "greedy"), (result.plan, "")):
        co.save(tmp_path / "plan.json", content, problem)
        assert PlanFile.read(tmp_path / "plan.json").planner == planner


def test_stops_say_what_they_are() -> None:
    """A criterion's repr has its limit, and that of several has all of them."""
    both = co.FirstOf(co.never, co.TimeLimit(1.5), co.WorkLimit(100))
    assert repr(both) == "FirstOf(never, TimeLimit(1.5), WorkLimit(100))"


def test_the_gap_table_refuses_in_words() -> None:
    """Wrong planners and limits are errors that name the parameter, as documented."""
    for wrong, words in (
        ({"planners": ["cocop"]}, "planners: must be one of greedy, .*, not 'cocop'"),
        ({"planners": [co.PLANNERS["greedy"]]}, "planners: two are called greedy"),
        ({"planners": [3]}, "planners: must be names or functions, not 3"),
        ({"planners": [lambda p, s: None], "out": "x"}, "planners: <lambda> cannot be stored in"),
        ({"planners": [lambda p: None]}, "planners: <lambda> must be a function of a problem and"),
        ({"planners": ["nowhere:f"]}, "planners: there is no module 'nowhere'"),
        ({"seeds": "0-b"}, "seeds: must be numbers and ranges such as 0-9,12, not '0-b'"),
        ({"planners": _waiting}, r"planners: must be a list, such as \[_waiting\]"),
        ({"time_limit": -1.0}, "time_limit: must be"),
        ({"work_limit": -1}, "work_limit: must be"),
        ({"workers": 10_000}, "workers: must be"),
    ):
        is_of_type = "names or functions" in words or "must be a list" in words
        with pytest.raises(TypeError if is_of_type else ValueError, match=words):
            co.gap("tiny-queue", **wrong)


def _waiting(problem: co.Problem, stop: co.Stop) -> co.Result:
    """Plans all drones to stay."""
    plan = co.Plan(paths=tuple((r.start,) * (problem.horizon + 1) for r in problem.robots))
    return co.Result(plan, co.check(problem, plan).reward, co.Reason.FINISHED)


def _boasting(problem: co.Problem, stop: co.Stop) -> co.Result:
    """Claims more than its plan is worth."""
    waiting = _waiting(problem, stop)
    return co.Result(waiting.plan, waiting.value + 1, co.Reason.FINISHED)


@pytest.mark.slow
def test_the_gap_table_measures_functions() -> None:
    """A planner of one's own has rows like others, judged by the referee; a false claim is said."""
    table = co.gap("tiny-queue", [_waiting, "greedy", _boasting]).set_index("planner")
    assert list(table.index) == ["_waiting", "greedy", "_boasting"]
    assert table.gap["_waiting"] > 0 and table.seconds["_waiting"] < 1
    assert table.reason["_boasting"] == "error" and "claims J" in table.message["_boasting"]


def _short_queue(seed: int) -> co.Problem:
    """Makes a scene of one's own; seeds 1 and 2 make the same."""
    return co.load("tiny-queue").replace(name="short-queue", horizon=2 + min(seed, 1))


def test_the_gap_table_makes_scenes_of_ones_own() -> None:
    """A function of the seed is a scene: each problem that it makes is taken once."""
    table = co.gap([_short_queue, "tiny-share"], ["greedy"], seeds=(0, 1, 2))
    assert list(zip(table.scene, table.seed, strict=True)) == [
        ("short-queue", 0), ("short-queue", 1), ("tiny-share", 0)
    ]  # fmt: skip
    with pytest.raises(TypeError, match="_waiting_scene: must be a function that returns a Prob"):
        co.gap(_waiting_scene, ["greedy"])
    with pytest.raises(ValueError, match="scenes: two are called _short_queue"):
        co.gap([_short_queue, _short_queue], ["greedy"])


def _waiting_scene(seed: int) -> None:
    """Makes nothing."""


@pytest.mark.parametrize("over_time", [False, True])
def test_j_is_made_of_the_coverage(over_time: bool) -> None:
    """Sums of the table's pixels along a plan, their roots weighed, are the referee's J."""
    problem = co.load("tiny-give-way").replace(objective=co.Objective(over_time=over_time))
    plan = co.plan(problem, "greedy").plan
    assert plan is not None
    seen: dict[tuple[int, ...], float] = {}
    for robot, path in enumerate(plan.paths):
        table = co.coverage(problem, robot)
        at = table[["step", *co.State._fields]].itertuples(index=False, name=None)
        own = table[[path[step] == tuple(state) for step, *state in at]]
        for row in own.itertuples():
            key = (0 if over_time else row.step, row.actor, row.face, row.weight)
            seen[key] = seen.get(key, 0.0) + row.pixels
    reward = sum(key[-1] * pixels**0.5 for key, pixels in seen.items())
    verdict = co.check(problem, plan)
    assert reward == pytest.approx(verdict.reward - verdict.reward_moves, rel=1e-12)
    with pytest.raises(ValueError, match=r"robot: must be a number from 0 to \d, not -1"):
        co.coverage(problem, -1)


def test_registries_are_read_only() -> None:
    """What is stored knows planners and scenes by name, so no name means another thing later."""
    for registry in (co.PLANNERS, co.SCENES, co.BOUNDS, co.EXACT, co.FORMATS):
        with pytest.raises(TypeError, match="item assignment"):
            registry["mine"] = None  # type: ignore[index]


def test_played_plans_have_titles() -> None:
    """A result has its planner's name and its J; a plan, which nobody has judged, neither."""
    problem = co.load("bottleneck")
    result = co.plan(problem, "cocap")
    lost = co.Result.without_plan(co.Reason.FAILED, "none was found")
    player = co.show(problem, result, lost, result.plan)
    assert ": 1: J = 54,614 | plan 2;" in repr(player)
    assert [plan["planner"] for plan in player.data()["plans"]] == ["cocap", None]


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


def test_versions_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    """A report of a bug names the versions of all that runs, and nothing that only tests need."""
    co.show_versions()
    shown = dict(line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines())
    assert shown["cocap-opt"] == co.__version__
    assert shown["python"] == platform.python_version()
    assert {"numpy", "highspy", "numba", "system"} <= set(shown)
    assert not {"pytest", "sphinx"} & set(shown)


def test_types_are_known() -> None:
    """The functions' types can be resolved, so that editors show them."""
    for name in ("load", "plan", "bound", "solve", "check", "verify"):
        assert "return" in get_type_hints(getattr(co, name))


@pytest.mark.long
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


def _yard() -> co.Problem:
    return co.load("tiny-queue")


def _flown() -> co.Result:
    return co.plan(_yard(), "sequential")


MISUSES = {
    "a scene's name for a problem": (lambda: co.plan("corridor"), TypeError, "problem: must be"),
    "a file for a claim": (lambda: co.verify(_yard(), "cert.json"), TypeError, "claims: must be"),
    "a problem for a claim": (lambda: co.verify(_yard(), _yard()), TypeError, "claims: must be"),
    "no stop": (lambda: co.plan(_yard(), stop=None), TypeError, "stop: must be"),
    "text for seconds": (lambda: co.plan(_yard(), time_limit="5"), TypeError, "time_limit: must"),
    "text for a gap": (lambda: co.solve(_yard(), gap="0.1"), TypeError, "gap: must be"),
    "no planner": (lambda: co.plan(_yard(), None), TypeError, "planner: must be one of"),
    "a problem for a name": (lambda: co.load(_yard()), TypeError, "^scene: must be a name .*:.*:"),
    "no name": (lambda: co.load(""), ValueError, "^scene: must be a name or a file, not empty"),
    "a recipe for a file": (lambda: co.read("a.toml"), ValueError, "a.toml: is a recipe; `load`"),
    "a solution": (lambda: co.read("a.sol"), ValueError, "a.sol: is a solver's sol.* `plan_of_sol"),
    "a number for seeds": (lambda: co.gap("tiny-queue", seeds=3), TypeError, "seeds: must be"),
    "no report": (lambda: co.bound(_yard(), report=None), TypeError, "report: must be a funct"),
    "half a unit": (lambda: co.WorkLimit(1.5), ValueError, "units: must be a whole number >= 0"),
    "text for a share": (lambda: co.quality(_yard(), _flown(), at_least="1"), TypeError, "at_lea"),
    "no exposure": (lambda: co.quality(_yard(), _flown(), exposure=None), TypeError, "exposure:"),
    "text for a step": (lambda: co.trajectory(_yard(), _flown(), step="1"), TypeError, "step: m"),
    "no seconds": (lambda: co.quality_bound(_yard(), seconds=None), TypeError, "seconds: must"),
    "no directions": (lambda: co.front(_yard(), directions=0), ValueError, "directions: must"),
    "a number for axes": (lambda: _yard().plot(ax=3), TypeError, "ax: must be axes of matplot"),
    "no file for a page": (lambda: co.show(_yard()).save(None), TypeError, "path: must be the"),
    "text for a seed": (lambda: co.load("corridor", seed="1"), TypeError, "seed: must be"),
    "a file for a plan": (lambda: co.check(_yard(), "plan.json"), TypeError, "plan: must be"),
    "text for a start": (lambda: co.solve(_yard(), start="x"), TypeError, "start: must be"),
    "a number for a path": (lambda: co.save(1, _yard()), TypeError, "path: must be"),
    "bytes for a path": (lambda: co.read(b"a.json"), TypeError, "path: must be"),
    "a list for a kind": (lambda: co.read("a.json", []), TypeError, "kind: must be one of"),
    "a long name": (lambda: co.read("x" * 300 + ".json"), co.FileError, "too long"),
    "a number for a folder": (lambda: co.gap("corridor", out=1), TypeError, "out: must be"),
    "NUL in a folder": (lambda: co.team(_yard(), 1, out="\0"), ValueError, "out: must be"),
    "text for a plan flown": (
        lambda: co.plan(_yard(), follow="x", from_step=1), TypeError, "follow: must be",
    ),
    "no plan to go on from": (lambda: co.rest(_yard(), None, 1), ValueError, "plan: must be"),
    "a number for lost drones": (
        lambda: co.plan(_yard(), without=1), TypeError, "without: must be",
    ),
    "half a team": (lambda: co.team(_yard(), 1.5), TypeError, "drones: must be"),
    "no team": (lambda: co.team(_yard(), iter([])), ValueError, "drones: must be at least"),
    "no camera": (lambda: co.team(_yard(), 1, camera=[]), ValueError, "camera: must be at least"),
    "a number for a camera": (lambda: co.team(_yard(), 1, camera=[1]), TypeError, "camera: must"),
    "no height": (lambda: co.team(_yard(), 1, heights=[]), ValueError, "heights: must be at least"),
    "a height alone": (lambda: co.team(_yard(), 1, heights=5.0), TypeError, "heights: must be"),
    "a chance alone": (
        lambda: co.takes(_yard(), 2, probabilities=1), TypeError, "probabilities: must be",
    ),
    "people in text": (lambda: co.takes(_yard(), 2, people="all"), TypeError, "people: must"),
    "half a drone": (lambda: co.coverage(_yard(), 0.5), TypeError, "robot: must be"),
    "a problem for a front": (
        lambda: co.front(_yard(), so_far=_yard()), TypeError, "so_far: must be",
    ),
    "a delay alone": (
        lambda: co.robustness(_yard(), _flown(), step=1.0, late=1), TypeError, "late: must be",
    ),
    "text for smooth": (
        lambda: co.trajectory(_yard(), _flown(), step=1.0, smooth="no"), TypeError, "smooth: must",
    ),
    "rows that never come": (
        lambda: co.trajectory(_yard(), _flown(), step=1.0, every=float("inf")), ValueError,
        "every: must be",
    ),
    "text for a second opinion": (
        lambda: co.verify(_yard(), _flown(), second_opinion="no"), TypeError, "second_opinion: m",
    ),
    "numbers for plans shown": (
        lambda: co.show(_yard(), np.array([1, 2])), TypeError, "plan.*: must be",
    ),
    "units that are none": (lambda: co.WorkLimit(float("nan")), TypeError, "units: must be"),
    "text for a limit": (lambda: co.TimeLimit("5"), TypeError, "seconds: must be"),
    "criteria that are none": (lambda: co.FirstOf("a"), TypeError, "criteria: must be"),
    "text for a focal length": (lambda: co.Camera(focal="x"), co.ProblemError, "focal: must be"),
    "text for a height": (lambda: co.Motion(layers=("x",)), co.ProblemError, "layers: must be"),
    "no planners": (lambda: co.gap("corridor", []), ValueError, "planners: must not be empty"),
    "no seeds": (lambda: co.gap("corridor", seeds=[]), ValueError, "seeds: must not be empty"),
    "no scenes": (lambda: co.gap([]), ValueError, "scenes: must not be empty"),
    "text for seconds of rows": (
        lambda: co.gap("corridor", time_limit="5"), TypeError, "time_limit: must be a number",
    ),
    "a picture's name for a scene": (
        lambda: co.save("b.png", _yard()), ValueError, "must end in .json, .*, not 'b.png'",
    ),
    "states that are none": (
        lambda: co.check(_yard(), co.Plan(paths=[["x"]])), ValueError, "plan: ",
    ),
}  # fmt: skip


@pytest.mark.parametrize("misuse", MISUSES)
def test_misuse_is_said_in_words(misuse: str) -> None:
    """Wrong arguments are refused by name, and never end inside of the program."""
    call, error, words = MISUSES[misuse]
    with pytest.raises(error, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_numbers_may_come_in_arrays() -> None:
    """Arrays and numbers of NumPy are as good as lists and numbers of Python."""
    rows = co.robustness(_yard(), _flown(), step=1.0, late=np.array([1.0]), lag=np.array([0.5]))
    assert rows.equals(co.robustness(_yard(), _flown(), step=1.0, late=[1.0], lag=[0.5]))
    planners = np.array(["greedy", "sequential"])
    assert list(co.gap("tiny-queue", planners, time_limit=5.0).planner) == [*planners]
    left = co.rest(_yard(), _flown(), 1, np.array([1]))
    assert left.name == co.rest(_yard(), _flown(), 1, [1]).name
    assert co.team(_yard(), np.int64(1), time_limit=1.0).table.drones.tolist() == [1]


def test_a_plan_of_another_problem_is_not_shown_or_written(tmp_path: Path) -> None:
    """What cannot be flown in a problem is refused before a page or a file is made."""
    result, other = co.plan(co.load("tiny-queue")), co.load("corridor")
    for call in (
        lambda: co.show(other, result.plan),
        lambda: co.save(tmp_path / "x.json", result.plan, other),
    ):
        with pytest.raises(ValueError, match=r"(plan|content).*: paths"):
            call()
    assert not any(tmp_path.iterdir())
    tuples = co.Plan(paths=[[tuple(state) for state in path] for path in result.plan.paths])
    assert co.check(co.load("tiny-queue"), tuples).reward == pytest.approx(result.value)


def test_results_of_another_scene_are_refused_by_name(tmp_path: Path) -> None:
    """One line names both scenes, wherever a result, its file or its certificate is given."""
    scene, other = co.load("tiny-queue"), co.load("tiny-share")
    result, best = co.plan(other, "greedy"), co.solve(other)
    co.save(tmp_path / "plan.json", best)
    plan = co.read(tmp_path / "plan.json", co.Plan)
    for given in (result, best, plan):
        for use in (
            lambda given: co.verify(scene, given),
            lambda given: co.show(scene, given),
            lambda given: co.check(scene, given),
            lambda given: co.explain(scene, given, best),
            lambda given: co.save(tmp_path / "x.json", given, scene),
        ):
            with pytest.raises(ValueError, match=r"made for tiny-share, not tiny-queue; .* alone"):
                use(given)
        for method in (co.solve, co.bound):
            with pytest.raises(ValueError, match="start: it was made for tiny-share, not tiny"):
                method(scene, start=given)
    with pytest.raises(co.CertificateError, match="was made for tiny-share, not tiny-queue"):
        co.verify(scene, best.certificate)
    longer = scene.replace(horizon=scene.horizon + 1)
    with pytest.raises(ValueError, match="start: it cannot be flown in tiny-queue: "):
        co.solve(longer, start=co.plan(scene).plan)
    free = co.plan(scene.without_rules(), "greedy")
    assert co.solve(scene, start=free).bound < float("inf")


def test_a_bound_below_zero_is_explained() -> None:
    """J is at least 0, so such a bound says that no plan obeys the rules."""
    none = co.Result(None, -float("inf"), co.Reason.INFEASIBLE, bound=-33.0)
    assert "-33.00 (below 0: no plan exists)" in none.summary()
    assert "below 0" not in co.plan(co.load("tiny-queue"), "greedy").summary()


def test_plans_and_certificates_that_are_missing_are_refused(tmp_path: Path) -> None:
    """None stands for the plan or the certificate of a result without one; a line says so."""
    problem = co.load("tiny-queue")
    lost = co.Result.without_plan(co.Reason.FAILED, "none was found")
    with pytest.raises(ValueError, match="claims: must not be None; a result without a plan"):
        co.verify(problem, lost.plan)
    with pytest.raises(ValueError, match="plan: the result has no plan to be checked"):
        co.check(problem, lost.plan)
    with pytest.raises(ValueError, match="content: must not be None; the result has no plan"):
        co.save(tmp_path / "plan.json", lost.plan)


def test_files_are_read_as_the_kind_that_is_asked_for(tmp_path: Path) -> None:
    """Another kind of file is refused, so that type checkers may believe the kind."""
    problem = co.load("tiny-queue")
    best = co.solve(problem)
    for name, content in (("scene", problem), ("plan", best), ("proof", best.certificate)):
        co.save(tmp_path / f"{name}.json", content)
    assert co.read(tmp_path / "plan.json", co.Plan) == best.plan
    assert problem_digest(co.read(tmp_path / "scene.json", co.Problem)) == problem_digest(problem)
    kind = type(best.certificate)
    assert isinstance(co.read(tmp_path / "proof.json", kind), kind)
    with pytest.raises(co.FileError, match="format: must be 'cocap-opt plan', not"):
        co.read(tmp_path / "scene.json", co.Plan)
    with pytest.raises(TypeError, match="kind: must be one of Problem, Plan, Cert"):
        co.read(tmp_path / "scene.json", dict)


def test_a_plan_that_was_read_is_for_the_problem_of_its_file(tmp_path: Path) -> None:
    """Where it happens to fit another one, it is refused there, unless one says it is of none."""
    problem = co.load("tiny-share")
    other = problem.replace(objective=problem.objective.replace(stationarity=1.0))
    made = co.plan(problem, "greedy")
    co.save(tmp_path / "plan.json", made)
    plan = co.read(tmp_path / "plan.json")
    assert isinstance(plan, co.Plan) and plan == made.plan
    assert co.check(problem, plan).reward == made.value
    co.verify(problem.replace(name="other"), plan)
    for use in (co.show, co.check, co.verify):
        with pytest.raises(ValueError, match=r"plan.*: it was made for tiny-share of another seed"):
            use(other, plan)
    with pytest.raises(ValueError, match="content: it was made for tiny-share of another seed"):
        co.save(tmp_path / "again.json", plan, other)
    assert not (tmp_path / "again.json").exists()
    assert co.check(other, co.Plan(paths=plan.paths)).valid


def test_the_planner_of_the_pages_is_one() -> None:
    """The example of a planner works, obeys a stop and is as good as it says."""
    page = (ROOT / "docs" / "extend" / "planner.md").read_text(encoding="utf-8")
    blocks = [part.split("```")[0] for part in page.split("```python\n")[1:3]]
    names: dict[str, Any] = {}
    for block in blocks:
        exec(block, names)
    problem = co.load("tiny-queue")
    assert co.plan(problem, names["still"]).plan == co.plan(problem, "greedy", time_limit=0).plan
    result = co.plan(problem, names["alone"])
    assert result.method == "alone" and co.check(problem, result).reward == result.value > 0
    assert co.plan(problem, names["alone"], time_limit=0).reason == "stopped"


def test_a_planner_that_returns_nothing_is_refused() -> None:
    """The message names the function and says what it must return."""
    with pytest.raises(
        ValueError, match=r"nothing returned nothing \(None\); a planner must return a Result"
    ):
        co.plan(co.load("tiny-queue"), nothing)  # type: ignore[arg-type]


def nothing(problem: co.Problem, stop: co.Stop) -> None:
    """A planner that forgets its result."""


@pytest.mark.parametrize(
    ("use", "method", "words"),
    [
        (co.bound, lambda *given: None, "returned nothing (None); a bound must return a Certif"),
        (co.bound, lambda *given: co.plan(given[0]), "returned a Result; a bound must return a C"),
        (co.bound, lambda problem, stop: None, "must be a function of a problem, a stopping crite"),
        (co.solve, lambda *given: None, "a function to report to, and of `gap` by keyword: got an"),
    ],
)
def test_a_bound_that_is_none_is_refused(use: Any, method: Any, words: str) -> None:
    """What a bound must take and return is not what a planner must."""
    with pytest.raises(ValueError, match=f"^<lambda> .*{re.escape(words)}"):
        use(co.load("tiny-queue"), method)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"value": 1e9}, "reward"),
        ({"bound": 1.0}, "bound"),
    ],
)
def test_verify_compares_what_a_result_claims(changes: dict[str, float], field: str) -> None:
    """Neither its value nor its bound is believed."""
    problem = co.load("tiny-share")
    best = co.solve(problem)
    assert co.verify(problem, best).gap < 1e-6
    with pytest.raises(ValueError, match=f"^{field}: "):
        co.verify(problem, dataclasses.replace(best, **changes))


def test_optimal_is_what_the_bound_proves() -> None:
    """A method that calls its plan optimal by its own word has finished where its bound is open."""
    problem = co.load("tiny-share")
    proved = co.solve(problem)

    def claims(*_: Any, **__: Any) -> co.Result:
        return dataclasses.replace(proved, bound=proved.value, certificate=None)

    assert (proved.reason, co.solve(problem, claims).reason) == ("optimal", "finished")


@pytest.mark.slow
def test_workers_need_a_guard(tmp_path: Path) -> None:
    """A script that every worker would run from its first line on is refused in a sentence."""
    script = tmp_path / "script.py"
    script.write_text('import cocap_opt as co\nco.gap("tiny-share", ["greedy"], workers=1)\n')
    run = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=False
    )  # fmt: skip
    assert "ValueError: workers: each worker imports your script" in run.stderr


@pytest.mark.parametrize(
    "changes",
    [
        {"bound": float("nan")},
        {"certificate": None, "bound": float("-inf")},
        {"plan": None, "value": 1e9},
        {"plan": None, "value": float("-inf"), "reason": co.Reason.INFEASIBLE},
    ],
)
def test_verify_believes_no_word_of_a_result(changes: dict[str, Any]) -> None:
    """Not even one that is no number, or that there is no plan."""
    problem = co.load("tiny-share")
    best = co.solve(problem)
    with pytest.raises(ValueError, match=r"^(bound|reward|reason|claims): "):
        co.verify(problem, dataclasses.replace(best, **changes))


def test_the_old_name_of_the_vertex_rule_says_that_swaps_are_allowed():
    """Whoever set PAPER_RULES for the rules of the built-in scenes allowed swaps unawares."""
    with pytest.raises(AttributeError, match="VERTEX_ONLY, which allows swaps"):
        _ = co.PAPER_RULES
    assert str(co.VERTEX_ONLY) == "vertex"
    assert str(co.load("bottleneck").rules) == "vertex+swap" == str(co.CollisionRules())
