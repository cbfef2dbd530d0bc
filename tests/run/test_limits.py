"""Limits: what is said before coverage begins, and of plans that limits have cut short."""

import json
import logging
import math
import re
import types
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import cocap_opt as co
from cocap_opt import memory
from cocap_opt.cli.main import main
from cocap_opt.compiling import Kernel
from cocap_opt.console import progress
from cocap_opt.files.documents import PlanFile, problem_digest
from cocap_opt.model import CoverageEstimate, Model, compiled, coverage_estimate, coverage_tables
from cocap_opt.model.coverage_estimate import BYTES_PER_ENTRY, room_of
from cocap_opt.model.coverage_tables import BYTES_PER_STATE, CoverageTables
from cocap_opt.player.player import Player
from cocap_opt.problem import Ending, Plan
from cocap_opt.result import Result
from cocap_opt.run import forecast
from cocap_opt.run.forecast import Forecast, RecipeTrial, duration
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.recipe.lighter import lighter
from cocap_opt.stop import Limit, Reason, Stop, TimeLimit, never
from cocap_opt.vision.coverage import GrowingTable

RECIPE = """\
steps = 7
[map]
file = "town.asc"
[[walk]]
points = [[40, 40], [60, 46]]
shape = { type = "cuboid", length = 0.4, width = 0.5, height = 1.8 }
[[walk]]
points = [[44, 38], [52, 58]]
shape = { type = "cuboid", length = 0.4, width = 0.5, height = 1.8 }
[[drones]]
count = 3
near = 20
camera = "dji-mavic-pro"
tilts = [10, 30, 50]
[drones.motion]
layers = [6, 9, 12]
radius = 3
headings = 8
"""


def run(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Returns exit code, output and messages of a command."""
    capsys.readouterr()
    with pytest.raises(SystemExit) as caught:
        main([str(word) for word in words])
    out, err = capsys.readouterr()
    assert isinstance(caught.value.code, int)
    return caught.value.code, out, err


@pytest.fixture
def town(tmp_path: Path) -> Path:
    """Returns a recipe of a town of 100 x 100 m with blocks of houses and three layers."""
    heights = np.zeros((100, 100))
    for x in range(4, 100, 16):
        for y in range(4, 100, 16):
            heights[y : y + 6, x : x + 6] = 4 + (x * 7 + y) % 9
    rows = "\n".join(" ".join(f"{h:g}" for h in row) for row in heights)
    head = "ncols 100\nnrows 100\nxllcorner 0\nyllcorner 0\ncellsize 1\nNODATA_value -9\n"
    (tmp_path / "town.asc").write_text(head + rows + "\n")
    (tmp_path / "town.toml").write_text(RECIPE)
    return tmp_path / "town.toml"


# -- the estimate ---------------------------------------------------------------------------


@pytest.mark.parametrize("scene", ["corridor", "passage", "bottleneck"])
def test_an_estimate_counts_all_views_and_meets_their_entries(scene: str) -> None:
    """It knows how many views there are, and by a sample how many faces they see."""
    model = Model(load_scene(scene), use_cache=False)
    found = model.tables.estimate()
    assert found.views == model.reachable_views
    tables = [model.coverage(c) for c in model.classes]
    horizon = model.problem.horizon
    states = sum((horizon + 1) * c.graph.n_states for c in model.classes)
    entries = sum(len(table.pixels) for table in tables)
    lists = 0.0
    for c in model.classes:
        sizes = np.count_nonzero(model.reachable(c), axis=1)
        sizes[: model.problem.first_step] = 0
        lists += room_of(model.views(c), sizes)
    assert 0 < lists < 3e6  # bodies are few, as on small maps
    table = found.memory - BYTES_PER_STATE * states - lists
    assert 0.5 < table / (BYTES_PER_ENTRY * entries) < 2


def test_an_estimate_changes_no_number() -> None:
    """Coverage is the same bit for bit with and without one before."""
    one, other = (Model(load_scene("corridor"), use_cache=False) for _ in range(2))
    one.tables.estimate()
    for a, b in zip(one.coverage(one.classes[0]), other.coverage(other.classes[0]), strict=True):
        assert np.array_equal(a, b)


def test_of_coverage_that_is_there_nothing_is_estimated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither of what is in memory, nor of what is in the cache; a part of it counts."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    model = Model(load_scene("corridor"))
    assert model.tables.estimate().views > 0
    model.prepare_all()
    assert model.tables.estimate() == CoverageEstimate()
    assert Model(load_scene("corridor")).tables.estimate() == CoverageEstimate()
    assert Model(load_scene("corridor"), use_cache=False).tables.estimate().views > 0


@pytest.mark.parametrize("scene", ["corridor", "corridor-tight"])
def test_an_estimate_counts_the_views_that_are_computed(scene: str) -> None:
    """All of them, each once; its seconds are those of a sample, times their number."""
    model = Model(load_scene(scene), use_cache=False)
    before = model.tables.estimate().views
    model.prepare_all()
    assert before == model.covered_views


@pytest.fixture
def now(monkeypatch: pytest.MonkeyPatch) -> types.SimpleNamespace:
    """The time (s) by the clocks of progress."""
    now = types.SimpleNamespace(seconds=0.0)

    class FakeClock:
        def __init__(self) -> None:
            self._begin = now.seconds

        @property
        def seconds(self) -> float:
            return float(now.seconds - self._begin)

    monkeypatch.setattr(progress, "Clock", FakeClock)
    return now


def test_the_time_left_follows_the_last_half(
    now: types.SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What took long at first is no measure of the rest; a second class begins anew."""
    said, watch = list[str](), progress.Watch()
    monkeypatch.setattr(watch, "show", said.append)
    show = watch.countdown("coverage")
    for _ in range(2):
        now.seconds += 100.0  # of something else, such as compiling
        for done in range(11):
            show(done, 10)
            now.seconds += 4.0 if done < 2 else 1.0
    assert said[:11] == said[11:]
    assert said[0] == "coverage 0 %" and said[10] == "coverage 100 %"
    assert said[1] == "coverage 10 %, about 36 s left"
    assert said[9] == "coverage 90 %, about 1 s left"


def test_parts_that_take_longer_than_before_are_not_estimated(now: types.SimpleNamespace) -> None:
    """What is left shrinks while nothing ends, and is not told once it should have ended."""
    watch, said = progress.Watch("scene", 4), list[str]()
    for _ in range(3):
        now.seconds += 4.0
        watch.finish()
    for _ in range(4):
        said += watch._texts()
        now.seconds += 2.0
    assert said == [
        "scene, 3 of 4 done, 12 s, about 4 s left", "scene, 3 of 4 done, 14 s, about 2 s left",
        "scene, 3 of 4 done, 16 s", "scene, 3 of 4 done, 18 s",
    ]  # fmt: skip


def test_nothing_is_estimated_while_code_is_compiled(
    now: types.SimpleNamespace, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is said instead, and the pace from before does not count afterwards."""
    kernel = Kernel("module", "what cameras see", 1.0)
    said, watch = list[str](), progress.Watch("scene")
    show = watch.countdown("coverage")

    def tell() -> None:
        said.append(watch._texts()[1])

    def compile_(stop: Stop) -> None:
        now.seconds += 20.0
        tell()

    monkeypatch.setattr(kernel, "_made", compile_)
    for done in (0, 10, 20):
        show(done, 100)
        tell()
        now.seconds += 2.0
    kernel._compile(never)
    show(30, 100)
    tell()
    before = "coverage 10 %, about 18 s left", "coverage 20 %, about 16 s left"
    assert said == ["coverage 0 %", *before, "compiling", "coverage 30 %"]


# -- warnings and remedies --------------------------------------------------------------------


def test_seconds_are_said_with_two_digits() -> None:
    """Nobody needs more of an estimate."""
    assert [duration(s) for s in (0.2, 7.25, 64.4, 130, 9000)] == [
        "less than 1 s", "7.2 s", "64 s", "2 min", "2.5 h",
    ]  # fmt: skip


def test_a_limit_that_will_do_is_not_doubted() -> None:
    """With a longer limit nothing is said; the limit that is advised is long enough."""
    found = Forecast(CoverageEstimate(views=10, seconds=50.0), planning=4.0)
    assert found.doubts(100.0, "--time-limit", None) == ""
    words = found.doubts(60.0, "--time-limit", None)
    assert "coverage takes about 50 s" in words
    advised = float(words.rpartition("--time-limit ")[2])
    assert found.doubts(advised, "--time-limit", None) == ""


@pytest.mark.long(seconds=20)
def test_changes_of_a_recipe_are_read_as_they_are_written(town: Path) -> None:
    """Who writes a change into the recipe, as its words say, has the scene that was tried."""
    problem = load_scene(str(town))
    kinds, views = lighter(town, problem), Model(problem).reachable_views
    assert all(kinds)
    for change in (change for kind in kinds for change in kind):
        written = town.with_name("written.toml")
        written.write_text(written_into(RECIPE, change.words))
        own, tried = load_scene(str(written)), change.scene(town, 0)
        assert problem_digest(own) == problem_digest(tried)
        assert Model(tried).reachable_views < views


@pytest.mark.slow
def test_a_resolution_at_which_drones_fly_farther_says_so(town: Path) -> None:
    """A step of three cells is one of two that are 1.5 times as large; one of one cell is not."""
    for radius, first in ((3, "radius = 2 in [drones.motion]"), (1, "1.5 times as far in a step)")):
        town.write_text(RECIPE.replace("radius = 3", f"radius = {radius}"))
        assert lighter(town, load_scene(str(town)))[0][0].words.endswith(first)


def written_into(recipe: str, words: str) -> str:
    """Returns a recipe with the fields of a change, each in the table that it names."""
    for fields, table in re.findall(r"(\w+ = .+?) in (\[+[\w.]+\]+)", words):
        for line in re.split(r", (?=\w+ = )", fields):
            field = line.partition(" = ")[0]
            recipe = re.sub(rf"^{field} = .*\n", "", recipe, flags=re.MULTILINE)
            recipe = recipe.replace(f"{table}\n", f"{table}\n{line}\n", 1)
    return recipe


def test_changes_of_several_fields_are_written_each_on_a_line() -> None:
    """A table may have several of them, and values have commas of their own."""
    words = "window = [20, 10, 60, 65], resolution = 1.5 in [map] and radius = 2 in [drones.motion]"
    lines = written_into(RECIPE, words).splitlines()
    assert lines[1:4] == ["[map]", "resolution = 1.5", "window = [20, 10, 60, 65]"]
    assert "radius = 2" in lines
    assert "radius = 3" not in lines


def forecast_by_views(monkeypatch: pytest.MonkeyPatch, scene: Path, seconds: float) -> None:
    """Forecasts that long for a scene, and for others by their views, whatever the machine does."""
    views = Model(load_scene(str(scene))).reachable_views

    def counted(model: Model) -> Forecast:
        return Forecast(CoverageEstimate(1, seconds * model.reachable_views / views))

    monkeypatch.setattr(Forecast, "of", counted)


@pytest.mark.slow(seconds=7)
def test_changes_that_fit_alone_are_the_mildest_of_their_kind(
    town: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each is tried; where none does alone, one of several kinds together is named."""
    forecast_by_views(monkeypatch, town, 100.0)
    now, tried = Forecast(CoverageEstimate(1, 100.0)), RecipeTrial(town, 0, load_scene(str(town)))
    words = [change.words for change, _ in tried.that_fit(now, 120.0)]
    assert "layers = [6, 9] in [drones.motion]" in words
    assert "headings = 4 in [drones.motion]" in words
    [(change, found)] = tried.that_fit(now, 6.0)
    assert " and " in change.words
    assert found.fits(6.0)
    words = [change.words for change, _ in tried.that_fit(now, 120.0, TimeLimit(0))]
    assert len(words) == 1  # a limit of time ends the trials after the first


@pytest.mark.slow
def test_python_warns_before_coverage_too(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A limit that will not do is named; without one it says how long coverage takes."""
    problem = load_scene("tiny-queue")
    monkeypatch.setattr(forecast, "_SLOWEST", math.inf)  # as if it had many views
    monkeypatch.setattr(Forecast, "of", lambda model: Forecast(CoverageEstimate(9, 500.0)))
    with caplog.at_level(logging.WARNING):
        co.plan(problem, "cocap-vs", time_limit=60)
        assert caplog.text == ""
        co.plan(problem, time_limit=60)
        assert "time_limit = 850" in caplog.text
        caplog.clear()
        co.plan(problem)
    assert "coverage takes about 8 min and 0.1 GB; stop it early with Ctrl-C or" in caplog.text


def test_little_coverage_is_computed_and_not_estimated(monkeypatch: pytest.MonkeyPatch) -> None:
    """An estimate would take longer; with next to no time left it is worth that all the same."""
    asked: list[str] = []

    def estimate(tables: CoverageTables) -> CoverageEstimate:
        asked.append(tables.problem.name)
        return CoverageEstimate()

    monkeypatch.setattr(CoverageTables, "estimate", estimate)
    co.plan(load_scene("corridor"), "greedy", time_limit=60)
    co.plan(load_scene("corridor"), "greedy")
    assert not asked
    co.plan(load_scene("corridor"), "greedy", time_limit=0.1)
    assert asked == ["corridor"]


def test_gap_says_how_long_coverage_takes_which_no_limit_ends(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Once for each scene, before it begins; with workers by what they allow a cell."""
    monkeypatch.setattr(forecast, "_SLOWEST", math.inf)  # as if it had many views
    monkeypatch.setattr(CoverageTables, "estimate", lambda tables: CoverageEstimate(9, 500.0))
    assert len(co.gap("corridor", ["formation"], "0-1", time_limit=0)) == 2
    told = "corridor, seed 0: coverage takes about 8 min and 0.1 GB, before any time limit begins"
    assert [record.message for record in caplog.records if "coverage" in record.message] == [told]
    caplog.clear()
    forecast.warn_before_limits(load_scene("corridor"), 0, cell_limit=600.0, cores=2)
    assert "17 min and 0.1 GB, but workers are stopped after 10 min; use --cell" in caplog.text


@pytest.mark.long(seconds=60)
def test_advice_that_is_followed_leads_to_a_plan_that_moves(
    town: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The warning comes before coverage; each change that it names gives such a plan in time."""
    forecast_by_views(monkeypatch, town, 16.0)  # much more than it takes
    limit = 8.0
    plan = town.with_name("plan.json")
    assert run(capsys, "plan", town, "--time-limit", limit, "-o", plan)[0] == 0
    assert "too long for a limit" in caplog.text
    told = caplog.text.partition("starts; use ")[2].splitlines()[0].split("; or ")
    assert len(told) > 1, caplog.text
    for words in told[1:]:
        changed = town.with_name("changed.toml")
        changed.write_text(written_into(RECIPE, words))
        code, out, _ = run(capsys, "plan", changed, "--time-limit", limit, "-o", plan, "--json")
        assert code == 0
        assert not PlanFile.read(plan).plan.stays, words
        assert json.loads(out)["reward"] > 0


# -- plans that are cut short -----------------------------------------------------------------


def still(scene: str = "corridor") -> Plan:
    """Returns the plan in which nobody moves."""
    plan = Plan.hovering(load_scene(scene))
    assert plan is not None
    return plan


def test_what_a_limit_has_left_of_a_plan_is_said_in_words() -> None:
    """All, some or none of the drones stay at their starts; without a limit nothing is said."""
    plan = still()
    moves = (*plan.paths[0][:-1], plan.paths[0][-1]._replace(heading=7))
    some = Plan(paths=(moves, *plan.paths[1:]))
    assert Ending(Reason.FINISHED).left_of(plan) == ""
    assert Ending(Reason.STOPPED, Limit.TIME, in_coverage=True).left_of(plan) == (
        "no plan: stopped by the time limit during coverage; all drones stay at their starts"
    )
    n = len(plan.paths)
    assert Ending(Reason.STOPPED, Limit.INTERRUPT).left_of(some) == (
        f"cut short: interrupted during the search; {n - 1} of {n} drones stay at their starts"
    )


def test_a_plan_cut_short_says_so_first_everywhere(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """In output, JSON, file, gap table and rows; it is no error, and the file is written."""
    path = tmp_path / "plan.json"
    code, out, _ = run(capsys, "plan", "corridor", "--time-limit", 0, "-o", path)
    assert code == 0
    assert out.split()[:3] == ["attention", "no", "plan:"]
    assert "all drones stay" in PlanFile.read(path).cut_short
    code, out, _ = run(capsys, "plan", "corridor", "--time-limit", 0, "--json")
    assert next(iter(json.loads(out))) == "cut_short"
    code, out, _ = run(
        capsys, "gap", "corridor", "--seeds", "0", "--planner", "cocap",
        "--time-limit", 0, "--bound-limit", 0,
    )  # fmt: skip
    assert code == 0
    assert "cocap !" in out
    assert "! cocap on corridor seed 0: no plan: stopped by the time limit" in " ".join(out.split())


def test_a_plan_says_in_tables_what_its_file_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether a limit came during coverage is not lost on the way."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    path, told = tmp_path / "plan.json", "no plan: stopped by the time limit during coverage"
    run(capsys, "plan", "corridor", "--time-limit", 0, "-o", path)
    assert PlanFile.read(path).cut_short.startswith(told)
    words = ("--planner", "formation", "--plan", path, "--time-limit", 0, "--bound-limit", 0)
    _, out, _ = run(capsys, "gap", "corridor", *words, "--json")
    (given,) = (row for row in json.loads(out)["rows"] if row["planner"] != "formation")
    assert given["cut_short"].startswith(told)


def test_views_that_were_not_evaluated_are_not_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plan that was made without them owes them nothing."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    views = []
    for limit in (0, 60):
        out = run(capsys, "plan", "corridor", "--time-limit", limit, "--json")[1]
        views.append(json.loads(out)["views"])
    assert views[0] < views[1] == Model(load_scene("corridor")).reachable_views


def test_bounds_of_python_know_that_coverage_was_not_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As those of commands do, so both say the same of their plans."""
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    problem = load_scene("corridor").replace(name="again")
    assert co.solve(problem, time_limit=0).in_coverage
    assert not co.solve(load_scene("tiny-queue")).in_coverage


def test_without_a_limit_nothing_is_cut_short(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A limit of `inf` is none, and the plan's file says so; a table needs one."""
    path = tmp_path / "plan.json"
    for command in ("plan", "bound", "solve"):
        words = (command, "tiny-queue", "--time-limit", "inf", "-o", path)
        assert run(capsys, *words)[0] == 0
        if command != "bound":
            assert PlanFile.read(path).time_limit is None
            assert PlanFile.read(path).limit is None
    code, _, err = run(capsys, "plan", "tiny-queue", "--time-limit", "nan")
    assert code == 2 and "0 or more, or inf for no limit, not nan" in err
    code, _, err = run(capsys, "gap", "tiny-queue", "--time-limit", "inf")
    assert code == 2 and "--time-limit: must be a finite number of seconds" in err


def test_a_limit_that_left_no_plan_comes_with_what_to_do() -> None:
    """So it is if nothing was found and if all drones stay; Ctrl-C has no advice."""
    ways = "set a larger --time-limit, and run `cocap-opt compile`"
    found = Result.stopped_without_plan(Limit.TIME)
    assert found.message.startswith(f"no plan was found before the time limit: {ways}")
    assert ways in co.plan(load_scene("corridor"), "sequential", time_limit=0).message
    assert Result.stopped_without_plan(Limit.WORK).message.endswith("set a larger --work-limit")
    assert Result.stopped_without_plan(Limit.INTERRUPT).message.endswith(
        "before it was interrupted"
    )


def test_results_say_first_that_a_limit_cut_them_short() -> None:
    """In summary and repr of Python."""
    result = co.plan(load_scene("corridor"), "sequential", time_limit=0)
    assert result.summary().startswith("no plan: stopped by the time limit during")
    assert repr(result).startswith("Result(no plan: stopped by the time limit")
    assert not co.plan(load_scene("tiny-queue")).cut_short


def test_files_of_older_versions_say_it_too(tmp_path: Path) -> None:
    """A limit and a plan are enough; who has no limit has a whole plan."""
    parts: dict[str, Any] = {"scene": "s", "digest": "d", "planner": "p", "reward": 1.0}
    old = PlanFile(version=3, limit=Limit.TIME, plan=still(), **parts)
    old.save(tmp_path / "old.json")
    ending = PlanFile.read(tmp_path / "old.json").ending
    assert ending.reason is Reason.STOPPED
    assert ending.left_of(still()).startswith("no plan: stopped by the time")
    assert PlanFile(plan=still(), **parts).ending == Ending(Reason.FINISHED)


def test_the_player_is_told_what_limits_have_left() -> None:
    """Its sign is not green then."""
    player = Player(load_scene("corridor"), [("a", still())], cut_short=["cut short: x"])
    assert player.data()["plans"][0]["cutShort"] == "cut short: x"
    assert Player(load_scene("corridor"), [("a", still())]).data()["plans"][0]["cutShort"] == ""


def test_a_plan_that_is_read_says_what_its_file_does(tmp_path: Path) -> None:
    """In the player, where it is refused, and in a file that it is written to again."""
    problem = load_scene("corridor")
    co.save(tmp_path / "plan.json", co.plan(problem, "sequential", time_limit=0))
    plan = co.read(tmp_path / "plan.json", co.Plan)
    assert (
        co.show(problem, plan)
        .data()["plans"][0]["cutShort"]
        .startswith("no plan: stopped by the time")
    )
    with pytest.raises(ValueError, match=r"no drone moves .no plan: stopped by the time limit"):
        co.trajectory(problem, plan, step=1.0)
    co.save(tmp_path / "again.json", plan, problem)
    again = co.read(tmp_path / "again.json", co.Plan)
    assert again.cut_short == plan.cut_short != ""
    assert again == plan


# -- fly ----------------------------------------------------------------------------------------


def test_plans_in_which_no_drone_moves_are_not_flown(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    """One line says why and the way out, unless that is what is wanted."""
    plan, flight = tmp_path / "plan.json", tmp_path / "flight.csv"
    run(capsys, "plan", "corridor", "--time-limit", 0, "-o", plan)
    words = ("fly", "corridor", plan, "--step", 1, "-o", flight)
    code, out, err = run(capsys, *words)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1
    assert "no drone moves (no plan: stopped by the time limit" in err
    assert "--hovering" in err
    assert not flight.exists()
    code, out, err = run(capsys, *words, "--hovering")
    assert code == 0
    assert out.split()[0] == "ATTENTION:" and out.count("no plan: ") == 1
    assert f"{plan}: no plan: stopped by the time limit" in caplog.text
    assert flight.exists()


def test_python_flies_no_plan_in_which_no_drone_moves() -> None:
    """`hovering=True` does."""
    problem = load_scene("corridor")
    with pytest.raises(ValueError, match="no drone moves"):
        co.trajectory(problem, still(), step=1.0)
    assert len(co.trajectory(problem, still(), step=1.0, hovering=True))


# -- verify -------------------------------------------------------------------------------------


@pytest.fixture
def proof(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """The file of a certificate for the scene tiny-queue."""
    path = tmp_path / "proof.json"
    run(capsys, "bound", "tiny-queue", "-o", path)
    return path


def test_verify_has_a_limit_and_warns_if_it_will_not_do(
    proof: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """It is ten minutes; `inf` is none. A remedy is named before it begins."""
    assert run(capsys, "verify", "tiny-queue", proof)[0] == 0
    monkeypatch.setattr(
        CoverageTables, "estimate", lambda tables: CoverageEstimate(10, seconds=700.0)
    )
    assert run(capsys, "verify", "tiny-queue", proof, "--time-limit", "inf")[0] == 0
    assert "takes about" not in caplog.text
    assert run(capsys, "verify", "tiny-queue", proof)[0] == 0
    assert "checking takes about 12 min" in caplog.text
    assert "--time-limit 1200" in caplog.text
    assert run(capsys, "verify", "tiny-queue", proof, "--time-limit", "nan")[0] == 2


@pytest.mark.long
@pytest.mark.parametrize("command", ["plan", "solve", "bound", "gap", "verify"])
def test_a_table_larger_than_the_memory_is_refused_before_it_is_begun(
    command: str,
    proof: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """By what a sample says of it, in one line: value iteration alone would fit.

    What is a little smaller than the memory is computed.
    """
    monkeypatch.setenv("COCAP_OPT_CACHE", str(tmp_path))
    for module in (coverage_estimate, coverage_tables):  # so that the table is what is large
        monkeypatch.setattr(module, "BYTES_PER_ENTRY", 1e6)
    needed = Model(load_scene("tiny-queue"), use_cache=False).tables.estimate().memory
    monkeypatch.setattr(forecast, "_SLOWEST", math.inf)  # as if it had many views
    words = {"verify": ("tiny-queue", proof), "gap": ("tiny-queue", "--seeds", "0")}
    grow = GrowingTable.grow
    compiled.cache_clear()
    for share, code in ((1.05, 2), (0.95, 0)):
        free = types.SimpleNamespace(available=needed / share / 0.9)
        monkeypatch.setattr(memory.psutil, "virtual_memory", partial(lambda free: free, free))
        monkeypatch.setattr(GrowingTable, "grow", None if code else grow)
        ended, _, err = run(capsys, command, *words.get(command, ("tiny-queue",)))
        assert ended == code, err
        if code:
            line = err.strip().splitlines()[-1]
            assert re.search("coverage and value iteration of .* needs about .* GB", line)
            assert "use larger cells" in line
    compiled.cache_clear()


def test_sampling_is_left_where_any_table_would_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coverage of all faces from everywhere fits into the memory: nothing is estimated."""
    monkeypatch.setattr(CoverageEstimate, "of", None)
    model = Model(load_scene("tiny-queue"), use_cache=False)
    model.prepare_all()
    assert model.covered_steps == model.problem.horizon + 1
