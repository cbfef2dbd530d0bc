"""What type checkers see of the face: scripts of others, and the examples that help and pages show.

`--follow-imports silent` treats the package as an installed one: its modules are read and not
judged, as they are elsewhere. mypy's cache, in the project's folder, makes a run short.
"""

import doctest
import inspect
import re
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

import cocap_opt as co

ROOT = Path(__file__).parents[2]

SCRIPT = '''"""A shoot of one's own, by the face alone."""

from pathlib import Path

import numpy as np

import cocap_opt as co


def hover(problem: co.Problem, stop: co.Stop) -> co.Result:
    """Let all drones wait."""
    plan = co.Plan(paths=tuple((s,) * (problem.horizon + 1) for s in problem.first_starts))
    reward = co.check(problem, plan).reward
    return co.Result(plan, reward, co.Reason.FINISHED, limit=stop.reached())


def weak(
    problem: co.Problem, stop: co.Stop, start: co.Plan | None, report: object
) -> co.CertifiedResult:
    """Bound a problem as if nobody had to give way."""
    return co.BOUNDS["alone"](problem, stop)


def main(folder: Path) -> None:
    """Plan, bound, prove, check, show and keep."""
    heights = np.zeros((12, 12))
    heights[5:7, 3:9] = 8.0  # m, a wall
    walk = np.column_stack([np.linspace(2, 9, 7), np.full(7, 10.5), np.zeros(7), np.zeros(7)])
    problem = co.Problem(
        name="yard",
        height_map=co.HeightMap(heights=heights, resolution=1.0),
        robots=tuple(co.Robot(start=co.State(x, 1), camera=co.Camera()) for x in (2, 9)),
        actors=(co.Actor(poses=walk, name="Ada"),),
        horizon=6,
    )
    names: list[str] = [*co.PLANNERS, *co.BOUNDS, *co.EXACT, *co.SCENES, *co.FORMATS]
    result: co.Result = co.plan(problem, "cocap", time_limit=10)
    own = co.plan(problem, hover, stop=co.FirstOf(co.TimeLimit(2.0), co.WorkLimit(10)))
    again = co.PLANNERS["greedy"](co.load("bottleneck", seed=3), co.never)
    bound = co.bound(problem, time_limit=5, start=result)
    best = co.solve(problem, gap=0.01, start=own, report=lambda s: print(s.value, s.bound))
    print(names, again.seconds, bound.bound, best.gap, co.bound(problem, weak).bound)
    verified: co.Verified = co.verify(problem, result.plan, best.certificate)
    print(verified.gap, verified.bound, verified.reward, verified.is_optimal)
    verdict: co.Verdict = co.check(problem, result)
    print(verdict.valid, verdict.conflicts, verdict.violations, co.__version__)
    table = co.gap([problem, "corridor"], ["greedy", hover], seeds=range(3))
    print(table["gap"].mean(), co.coverage(problem, 0).groupby(["step"]).pixels.sum())
    player: co.Player = co.show(problem, result, best, certificate=best)
    player.save(folder / "plans.html")
    result.plot().figure.savefig(folder / "plan.png")
    problem.plot(best.plan).set_title("yard")
    for content, name in ((best, "plan"), (best.certificate, "proof"), (problem, "scene")):
        co.save(folder / f"{name}.json", content)
    plan = co.read(folder / "plan.json", co.Plan)
    print(plan.paths[0][0].x, plan.made_for, co.read(folder / "scene.json", co.Problem).name)
    found = co.read(folder / "proof.json")
    if isinstance(found, co.CertificateFile | co.ProofFile):
        print(found.bound, found.digest)
    print(co.explain(problem, result.plan, best).nlargest(5, "amount"))
    print(co.trajectory(problem, co.replans(problem, plan).plan[0], step=1.0).attrs["step"])
    print(result.summary(), result.reason is co.Reason.FINISHED)
    co.show_versions()


if __name__ == "__main__":
    try:
        main(Path("out"))
    except (co.FileError, co.ProblemError, co.CertificateError, co.UnsupportedError) as error:
        print(error)
'''

# What the examples of docstrings and pages take for granted.
AT_HAND = """problem: co.Problem, other: co.Problem, result: co.Result, greedy: co.Result,
    cocap: co.Result, best: co.CertifiedResult, my_planner: co.Planner,
    my_scene: Callable[[int], co.Problem]"""

MISTAKES = """import cocap_opt as co
co.fly_away
co.plan(3)
co.plan(co.load("corridor"), lambda problem: None)
co.load("corridor").plot().figure.save("plan.png")
"""


def checked(folder: Path, **scripts: str) -> list[str]:
    """Returns what mypy --strict says of scripts by name, a line each."""
    for name, text in scripts.items():
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    words = ["-m", "mypy", "--strict", "--follow-imports", "silent", "--no-error-summary"]
    names = [str(folder / f"{name}.py") for name in scripts]
    done = subprocess.run([sys.executable, *words, *names], cwd=ROOT, capture_output=True,
                          text=True, check=False, timeout=300)  # fmt: skip
    assert not done.stderr, done.stderr
    return [Path(line).name for line in done.stdout.splitlines() if ": error:" in line]


def examples() -> str:
    """Returns a script with a function for the examples of each docstring of the face."""
    parts = ["from collections.abc import Callable\n\nimport cocap_opt as co\n"]
    for name in ["cocap_opt", *co.__all__]:
        words = inspect.getdoc(co if name == "cocap_opt" else getattr(co, name)) or ""
        found = doctest.DocTestParser().get_examples(words)
        lines = "".join(textwrap.indent(example.source, "    ") for example in found)
        if lines:
            parts.append(f"\n\ndef of_{name}(\n    {AT_HAND}\n) -> None:\n{lines}")
    assert len(parts) > 15
    return "".join(parts)


def readme() -> str:
    """Returns the README's example of Python."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))


@pytest.mark.slow
def test_scripts_and_examples_pass_strict_type_checkers(tmp_path: Path) -> None:
    """mypy --strict finds nothing in a script of a user's, nor in what docstrings show."""
    assert checked(tmp_path, user=SCRIPT, examples=examples(), readme=readme()) == []


@pytest.mark.slow
def test_type_checkers_find_mistakes(tmp_path: Path) -> None:
    """Types of the face are not all `Any`: each line that is wrong is found."""
    found = checked(tmp_path, mistakes=MISTAKES)
    lines = {int(line.split(":")[1]) for line in found}
    assert lines == set(range(2, MISTAKES.count("\n") + 1)), found


@pytest.mark.slow
def test_the_script_of_type_checkers_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is checked for types is a script that works."""
    (tmp_path / "out").mkdir()
    monkeypatch.chdir(tmp_path)
    exec(compile(SCRIPT, "script.py", "exec"), {"__name__": "__main__"})
    assert "yard" in capsys.readouterr().out
    assert (tmp_path / "out" / "plan.png").stat().st_size > 5_000
