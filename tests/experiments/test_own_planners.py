import json
import pickle
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from importlib.metadata import EntryPoint
from pathlib import Path

import cloudpickle
import pytest
from sweeps import SETTINGS, folder_for_a_sweep, small_field
from test_sweeps import computed

from cocap_opt.api.measuring import gap as gap_frame
from cocap_opt.api.methods import plan as plan_by
from cocap_opt.cli import commands
from cocap_opt.experiments.sweeps.cells import Store
from cocap_opt.experiments.sweeps.cluster import Cluster, _run_task
from cocap_opt.experiments.sweeps.crew import ClusterError
from cocap_opt.experiments.sweeps.instances import Instance
from cocap_opt.experiments.sweeps.results import load_results
from cocap_opt.experiments.sweeps.work import Task
from cocap_opt.files.documents import PlanFile
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan, Problem
from cocap_opt.result import Reason, Result
from cocap_opt.run import named_planners, own_planners
from cocap_opt.run.engine import run
from cocap_opt.run.own_code import OwnCode, OwnPlannerError
from cocap_opt.run.own_planners import OwnPlanner
from cocap_opt.stop import Stop, never

MINE = '''
"""Planners of somebody's own."""
import os
from os.path import join
from pickings import PICKED
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Plan
from cocap_opt.result import Reason, Result
from cocap_opt.stop import LimitReached

three = 3


def best(problem, stop):
    return PLANNERS[PICKED](problem, stop)


def seeded(problem, stop, seed=-1):
    result = PLANNERS["greedy"](problem, stop)
    return Result(result.plan, result.value, result.reason, message=f"seed {seed}")


def nothing(problem, stop):
    pass


def plan_only(problem, stop):
    return Plan.hovering(problem)


def number(problem, stop):
    return 3


def words(problem, stop):
    return Result(Plan.hovering(problem), "much", Reason.FINISHED)


def exits(problem, stop):
    raise SystemExit(3)


def dies(problem, stop):
    os._exit(1)


def raises(problem, stop):
    return {}["shape"]


def leaks(problem, stop):
    raise LimitReached("time")


def boasts(problem, stop):
    result = PLANNERS["greedy"](problem, stop)
    return Result(result.plan, result.value + 1, result.reason)


def alone(problem):
    pass
'''


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder with planners of somebody's own, which is the current one; nothing stays of it."""
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "mymodule.py").write_text(MINE)
    (folder / "pickings.py").write_text("PICKED = 'greedy'\n")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    before = set(sys.modules)
    yield folder
    forget(set(sys.modules) - before)
    own_planners._imported.clear()
    own_planners._put.clear()


def forget(names: set[str]) -> None:
    """Let modules be imported again."""
    for name in names:
        if name.partition(".")[0] in ("mymodule", "pickings", "mypackage", "broken", "lacking"):
            del sys.modules[name]


def own(reference: str) -> OwnPlanner:
    """A planner by module:name, whose modules are imported anew."""
    forget(set(sys.modules))
    return OwnPlanner.found(reference, reference)


# -- by name ----------------------------------------------------------------------------------


@pytest.mark.long
def test_a_planner_has_a_row_by_module_and_name(
    mine: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In `gap` and `plan`, from the current folder; the row has its digest, and its seed."""
    words = ["--planner", "mymodule:seeded", "--json"]
    assert commands.run(["gap", "corridor", "--seeds", "1-2", "--time-limit", "9", *words]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert [(row["planner"], row["message"]) for row in rows] == [
        ("mymodule:seeded", f"seed {seed}") for seed in (1, 2)
    ]
    assert {row["planner_digest"] for row in rows} == {own("mymodule:seeded").digest}
    file = str(tmp_path / "plan.json")
    assert commands.run(["plan", "corridor", "--seed", "2", "-o", file, *words]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["planner"], answer["message"]) == ("mymodule:seeded", "seed 2")
    assert PlanFile.read(Path(file)).planner == "mymodule:seeded"
    assert commands.run(["gap", "corridor", "--seeds", "2", "--plan", file, "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["rows"]
    assert rows[-1]["planner"] == "mymodule:seeded (plan.json)"
    assert rows[-1]["seconds"] == answer["seconds"] and rows[-1]["time_limit"] == 60


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("mymodule:sedeed", "mymodule has no 'sedeed'; did you mean seeded?"),
        ("nowhere:f", "there is no module 'nowhere'"),
        ("mypackage.nowhere:f", "there is no module 'mypackage.nowhere'"),
        ("broken:f", "broken cannot be imported: ZeroDivisionError: division by zero (broken.py, "),
        ("lacking:f", "lacking cannot be imported: No module named 'nowhere'"),
        ("mymodule:three", "mymodule:three must be a function, not 3"),
        ("mymodule:alone", "must be a function of a problem and a stop"),
        ("mymodule:", "must be module:function"),
        (":f", "must be module:function"),
        ("my module:f", "must be module:function"),
        ("mymodule", "must be one of greedy, "),
        ("bound", "must be one of greedy, "),
    ],
)
def test_a_planner_that_cannot_be_found_is_refused(
    name: str, words: str, mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One line says what is wrong with it, in both commands and in Python."""
    (mine / "broken.py").write_text("1 / 0\n")
    (mine / "lacking.py").write_text("import nowhere\n")
    (mine / "mypackage").mkdir()
    (mine / "mypackage" / "__init__.py").touch()
    for command in ("gap", "plan"):
        assert commands.run([command, "tiny-queue", "--planner", name]) == 2
        message = capsys.readouterr().err
        assert len(message.splitlines()) == 1 and f"--planner: {words}" in message.replace(
            f"{name} {words}", words
        )
    with pytest.raises(ValueError, match=r"^planners: "):
        gap_frame("tiny-queue", [name])


def test_python_plans_by_module_and_name(mine: Path) -> None:
    """As the commands do; a planner that takes a seed gets 0."""
    assert plan_by(small_field(0), "mymodule:seeded").message == "seed 0"
    with pytest.raises(ValueError, match=r"^planner: mymodule has no 'seded'; did you mean seeded"):
        plan_by(small_field(0), "mymodule:seded")
    with pytest.raises(ValueError, match=r"mymodule:nothing returned nothing \(None\); a planner"):
        plan_by(small_field(0), "mymodule:nothing")
    with pytest.raises(ValueError, match=r"^planner: must be one of greedy, .*not 'nobody'"):
        plan_by(small_field(0), "nobody")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nothing", "mymodule:nothing returned nothing (None); a planner must return a Result, "),
        ("plan_only", "mymodule:plan_only returned a Plan; a planner must return a Result, "),
        ("number", "mymodule:number returned an int; a planner must return a Result, "),
        ("words", "mymodule:words returned a Result whose value is a str, not a number; "),
        ("exits", "mymodule:exits tried to end the process: SystemExit(3)"),
        ("boasts", "claims J = "),
        ("raises", "mymodule:raises raised KeyError: 'shape' (mymodule.py, line "),
        ("leaks", "mymodule:leaks does not catch LimitReached; it must, and return a Result "),
    ],
)
def test_what_is_no_result_is_said(
    name: str, words: str, mine: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The planner and what it must return are named; the other planners' rows are there."""
    reference = f"mymodule:{name}"
    frame = gap_frame("tiny-queue", [reference, "greedy"])
    assert list(frame.reason) == ["error", "finished"] and words in frame.message[0]
    assert commands.run(["plan", "tiny-queue", "--planner", reference]) == 2
    message = capsys.readouterr().err
    assert len(message.splitlines()) == 1 and words in message


# -- entry points -----------------------------------------------------------------------------


@pytest.fixture
def offered(mine: Path, monkeypatch: pytest.MonkeyPatch) -> list[EntryPoint]:
    """What installed packages offer."""
    points = [
        EntryPoint("mine", "mymodule:best", named_planners.GROUP),
        EntryPoint("mine", "mymodule:best", named_planners.GROUP),  # two records of one package
        EntryPoint("cocap", "mymodule:best", named_planners.GROUP),
        EntryPoint("bound", "mymodule:best", named_planners.GROUP),
        EntryPoint("twice", "mymodule:best", named_planners.GROUP),
        EntryPoint("twice", "mymodule:seeded", named_planners.GROUP),
        EntryPoint("broken", "nowhere:f", named_planners.GROUP),
        EntryPoint("whole", "mymodule", named_planners.GROUP),
    ]
    monkeypatch.setattr(named_planners, "entry_points", lambda group: points)
    return points


def test_installed_packages_offer_planners(
    offered: list[EntryPoint], capsys: pytest.CaptureFixture[str]
) -> None:
    """By their names; our own names cannot be taken, and those of two packages are refused."""
    frame = gap_frame("tiny-queue", ["mine", "greedy"])
    assert list(frame.planner) == ["mine", "greedy"] and frame.reward[0] == frame.reward[1]
    for name, words in (
        ("twice", "several packages provide 'twice'"),
        ("broken", "there is no module 'nowhere'"),
        ("whole", "which is not a module:function"),
        ("bound", "must be one of "),
        ("mne", "did you mean mine?"),
    ):
        with pytest.raises(ValueError, match=words.replace("?", r"\?")):
            gap_frame("tiny-queue", [name])
    capsys.readouterr()
    assert commands.run(["plan", "tiny-queue", "--planner", "cocap"]) == 0
    assert (
        "cocap is the name of a built-in planner; for that of a package, use mymodule:best"
        in capsys.readouterr().err
    )


def test_a_broken_record_of_a_package_breaks_no_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Who does not name its planners does not meet it."""

    def broken(group: str) -> None:
        raise OSError(group)

    monkeypatch.setattr(named_planners, "entry_points", broken)
    assert commands.run(["plan", "tiny-queue", "--planner", "greedy"]) == 0


# -- keys -------------------------------------------------------------------------------------


def test_a_cell_depends_on_the_code_of_its_planner(mine: Path, tmp_path: Path) -> None:
    """Its module's, and what that imports from beside it, comments aside; nothing else."""
    folder = folder_for_a_sweep(tmp_path / "run")

    def again(name: str = "best") -> list[str]:
        planner = own(f"mymodule:{name}")
        some = Instance(small_field(0), 0, ["mymodule"], SETTINGS, foreign={"mymodule": planner})
        return [one for one in computed([some], folder) if one == "mymodule"]

    assert again() and not again()
    assert again("seeded") and not again("seeded")  # another function of the same name in tables
    (mine / "beside.py").write_text("x = 1\n")
    (mine / "pickings.py").write_text("# Which?\nPICKED = 'greedy'\n")
    assert not again()
    (mine / "pickings.py").write_text("PICKED = 'cocap'\n")
    assert again() and not again()
    (mine / "mymodule.py").write_text(MINE.replace("three = 3", "three = 4"))
    assert again() and not again()


@pytest.mark.slow
def test_a_package_counts_as_a_whole(mine: Path) -> None:
    """All of its files, and the versions of what it imports; relative imports are its own."""
    package = mine / "mypackage"
    (package / "deep").mkdir(parents=True)
    (package / "__init__.py").touch()
    (package / "deep" / "__init__.py").touch()
    (package / "deep" / "planner.py").write_text(
        "from ..tools import f\nimport numpy\ndef plan(problem, stop): return f(problem, stop)\n"
    )
    (package / "tools.py").write_text("def f(problem, stop): pass\n")
    reference = "mypackage.deep.planner:plan"
    code = own(reference).code
    assert code is not None and set(code.names) == {"mypackage"}
    assert {"mypackage/tools.py", "mypackage/deep/planner.py"} <= set(code.files)
    assert code.roots == (str(mine.resolve()),)
    (package / "tools.py").write_text("def f(problem, stop): return 1\n")
    assert own(reference).digest != code.digest


def test_a_module_that_has_changed_since_is_not_kept(mine: Path) -> None:
    """What runs is not what its file says: that would be kept under a wrong key."""
    planner = own("mymodule:best")
    assert OwnCode.of("mymodule") == planner.code
    (mine / "mymodule.py").write_text(MINE.replace("seed {seed}", "number {seed}"))
    with pytest.raises(OwnPlannerError, match="seeded differs"):
        OwnCode.of("mymodule")


def test_a_helper_that_has_changed_since_is_not_kept(mine: Path) -> None:
    """Nor is what its planner calls, in a function or a method of a class."""
    helper = "class Picks:\n    @staticmethod\n    def one(): return 1\nPICKED = 'greedy'\n"
    (mine / "pickings.py").write_text(helper)
    planner = own("mymodule:best")
    assert OwnCode.of("mymodule") == planner.code
    (mine / "pickings.py").write_text(helper.replace("return 1", "return 2"))
    with pytest.raises(OwnPlannerError, match=r"pickings\.py has changed .*one differs"):
        OwnCode.of("mymodule")


def test_modules_of_other_folders_count(mine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is on the path, and not installed, has no version by which it would be known."""
    elsewhere = mine.parent / "elsewhere"
    elsewhere.mkdir()
    (mine / "pickings.py").rename(elsewhere / "pickings.py")
    monkeypatch.setattr(sys, "path", [str(elsewhere), *sys.path])
    first = own("mymodule:seeded")
    assert first.code is not None and {"mymodule", "pickings"} <= first.code.names
    assert first.code.roots == (str(mine.resolve()), str(elsewhere.resolve()))
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p not in (str(elsewhere), str(mine))])
    assert message(sent(first)) == "seed 5"
    assert str(sys.modules["pickings"].__file__).startswith(str(elsewhere.resolve()))
    (elsewhere / "pickings.py").write_text("PICKED = 'cocap'\n")
    monkeypatch.setattr(sys, "path", [str(elsewhere), str(mine), *sys.path])
    assert own("mymodule:seeded").digest != first.digest


def test_rows_of_own_planners_stay(mine: Path, tmp_path: Path) -> None:
    """A command that does not name them takes their rows along, with what they were made of."""
    gap_frame("tiny-queue", ["mymodule:best", "mymodule:nothing"], out=tmp_path / "out")
    first = {row.planner: row for row in load_results(tmp_path / "out")}
    gap_frame("tiny-queue", ["cocap"], out=tmp_path / "out")
    again = {row.planner: row for row in load_results(tmp_path / "out")}
    assert set(again) == {"mymodule:best", "mymodule:nothing", "cocap"}
    for name, row in first.items():
        assert (again[name].reward, again[name].reason) == (row.reward, row.reason)
        assert again[name].planner_digest == row.planner_digest != ""
    assert not again["cocap"].planner_digest


def staying(problem: Problem, stop: Stop) -> Result:
    """A planner at the top level of a module."""
    return PLANNERS["greedy"](problem, stop)


@pytest.mark.slow
def test_functions_are_kept_where_they_are_known_again(mine: Path, tmp_path: Path) -> None:
    """At the top level of a file; all others are refused in words, and measured without `out`."""

    def inner(problem: Problem, stop: Stop) -> Result:
        return PLANNERS["greedy"](problem, stop)

    frame = gap_frame("tiny-queue", [staying], out=tmp_path / "out")
    assert list(frame.planner) == ["staying"] and len(frame.planner_digest[0]) == 64
    typed: dict[str, object] = {"__name__": "typed"}
    exec("def at_a_prompt(problem, stop): pass", typed)
    for unknown in (inner, partial(staying), lambda p, s: inner(p, s), typed["at_a_prompt"]):
        with pytest.raises(ValueError, match="cannot be stored in `out`"):
            gap_frame("tiny-queue", [unknown], out=tmp_path / "out")  # type: ignore[list-item]
    assert list(gap_frame("tiny-queue", [inner]).reason) == ["finished"]


# -- elsewhere --------------------------------------------------------------------------------


def sent(planner: OwnPlanner) -> OwnPlanner:
    """The planner as another process gets it, which has none of its modules yet."""
    content = cloudpickle.dumps(planner.to_be_sent())
    forget(set(sys.modules))
    received: OwnPlanner = pickle.loads(content)
    assert received.call is None and "mymodule" not in sys.modules  # it is not loaded on the way
    return received


def message(planner: OwnPlanner) -> str:
    """What the result of a planner says on a small scene with seed 5."""
    result = run(small_field(0), planner.method, seed=5).result
    assert isinstance(result.plan, Plan) and result.reason is Reason.FINISHED
    return result.message


def test_workers_import_what_the_command_has(mine: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From its folder, or where they have none from the files that came along; never stale code."""
    one = own("mymodule:seeded")
    monkeypatch.setattr(sys, "path", [p for p in sys.path if p != str(mine)])
    assert message(sent(one)) == "seed 5"
    assert str(sys.modules["mymodule"].__file__).startswith(str(mine))
    (mine / "mymodule.py").write_text(MINE.replace("seed {seed}", "number {seed}"))
    other = own("mymodule:seeded")
    assert message(sent(other)) == "number 5"
    assert message(sent(one)) == "seed 5"  # whose file is another by now
    assert not str(sys.modules["mymodule"].__file__).startswith(str(mine))
    for unusable in ("raise SystemExit", "def (", None):
        (mine / "mymodule.py").unlink()
        if unusable is not None:  # what is there by now is not run
            (mine / "mymodule.py").write_text(unusable)
        own_planners._imported.clear()
        assert message(sent(other)) == "number 5"


def test_functions_without_a_module_are_sent() -> None:
    """Lambdas and inner functions go to workers themselves; what cannot go is said."""
    planner = OwnPlanner.of_function(lambda p, s: staying(p, s), "mine", kept=False)
    assert planner.digest == "" and message(sent(planner)) == ""
    generator = (n for n in range(3))
    stuck = OwnPlanner.of_function(lambda p, s: generator, "mine", kept=False)
    with pytest.raises(OwnPlannerError, match="mine cannot be sent to workers"):
        stuck.to_be_sent()


def test_modules_of_ours_are_neither_sent_nor_imported_anew() -> None:
    """A planner of ours by module and name is what every worker has."""
    planner = own("cocap_opt.planners.greedy:greedy")
    assert planner.code is not None and not planner.code.files and planner.digest
    before = sys.modules["cocap_opt.planners.greedy"]
    assert sent(planner).ready().call is PLANNERS["greedy"].function
    assert sys.modules["cocap_opt.planners.greedy"] is before


def test_a_worker_without_the_planner_is_refused(mine: Path) -> None:
    """It is no cell's fault that a worker cannot import it, or has another version."""
    planner = own("mymodule:best")
    assert planner.code is not None
    (mine / "pickings.py").write_text("PICKED = 'cocap'\n")
    elsewhere = sent(OwnPlanner("best", planner.reference, planner.code._replace(files={})))
    instance = Instance(small_field(0), 0, ["best"], SETTINGS, foreign={"best": elsewhere})
    with pytest.raises(ClusterError, match="another version of mymodule"):
        _run_task(instance.missing()[0])


@pytest.mark.slow(seconds=2)
def test_workers_run_own_planners(mine: Path, local: Cluster, tmp_path: Path) -> None:
    """Those of modules and those without; what has a module is kept."""
    names = ("mymodule:seeded", "inner")
    inner = OwnPlanner.of_function(lambda p, s: staying(p, s), "inner", kept=False)
    planners = {names[0]: own(names[0]), "inner": inner.to_be_sent()}
    instance = Instance(small_field(3), 3, names, SETTINGS, foreign=planners)
    folder = folder_for_a_sweep(tmp_path / "run")
    local.run([instance], Store(folder), never, lambda content: None)
    rows = {row.planner: row for row in instance.rows()}
    assert rows["mymodule:seeded"].message.startswith("seed 3")
    assert rows["inner"].reward == rows["mymodule:seeded"].reward
    again = Instance(small_field(3), 3, names[:1], SETTINGS, foreign=planners)
    again.recall(Store(folder))
    assert [cell.planner for cell in again.found] == ["mymodule:seeded"]


SCRIPT = """
import cocap_opt as co

def mine(problem, stop, seed=0):
    return co.PLANNERS["greedy"](problem, stop)

if __name__ == "__main__":
    for workers in (1, None):
        frame = co.gap("tiny-queue", [mine, "greedy"], seeds="0-0", out="out", workers=workers)
        print(list(frame.planner), frame.reward[0] == frame.reward[1], frame.seconds[0])
"""


@pytest.mark.long(seconds=8)
def test_a_script_measures_its_own_function(tmp_path: Path) -> None:
    """With workers and a folder; the second time its cell is there already."""
    (tmp_path / "script.py").write_text(SCRIPT)
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    first, second = done.stdout.splitlines()
    assert first == second and first.startswith("['mine', 'greedy'] True")
    assert len(list((tmp_path / "out" / "cells").iterdir())) == 3


def test_an_error_in_a_planner_says_where_it_is(mine: Path) -> None:
    """As for ours: its function and line are in the message, and the traceback is kept."""
    (mine / "mymodule.py").write_text(MINE.replace("PLANNERS[PICKED]", "PLANNERS['none']"))
    task = Instance(
        small_field(0), 0, ["best"], SETTINGS, foreign={"best": own("mymodule:best")}
    ).missing()[0]
    assert isinstance(task, Task)
    content = task.run()
    assert "raised KeyError: 'none' (mymodule.py, line" in content.message
    assert ", in best)" in content.message and "KeyError: 'none'" in content.traceback
