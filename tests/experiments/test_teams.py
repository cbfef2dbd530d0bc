"""Teams of other sizes, cameras and heights: their rows against brute force, words, files."""

import csv
import json
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from pathlib import Path

import brute_force
import numpy as np
import pytest
from goals import with_areas
from hypothesis import assume, given
from hypothesis import strategies as st
from pool import problems
from strategies import examples, number_of_plans

import cocap_opt as co
from cocap_opt.cli.main import main
from cocap_opt.data import ProblemError
from cocap_opt.experiments.sweeps.teams import Asked, compare_teams, team_settings
from cocap_opt.experiments.tables.teams import TEAMS, TeamRow, load_teams, sentences
from cocap_opt.footage.quality import person_steps
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.teams import TeamChoice, seen_alone

MOST_PLANS = 3_000


def said(capsys: pytest.CaptureFixture[str], *words: object) -> tuple[int, str, str]:
    """Runs the program; returns the exit code, standard output and standard error."""
    with pytest.raises(SystemExit) as caught:
        main([*map(str, words)])
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def row(drones: int, seen: float, bound: float, camera: str = "") -> TeamRow:
    """A row of a team that reaches a share of views, and never more than a bound."""
    return TeamRow(
        scene="s", seed=0, camera=camera, height=None, drones=drones, seen_most=seen,
        seen_bound=bound, reason_seen="stopped",
    )  # fmt: skip


def plans(scene: Problem) -> Iterator[Plan]:
    """All plans that obey the rules."""
    paths = [brute_force.all_paths(scene, robot) for robot in range(len(scene.robots))]
    for chosen in product(*paths):
        if check(scene, plan := Plan(paths=chosen)).valid:
            yield plan


def most_seen(scene: Problem, cameras: int) -> float:
    """The largest share of person-steps, by importance, that so many drones see in any plan."""
    weights = np.where(person_steps(scene), scene.importance, 0.0)
    paths = brute_force.all_paths(scene, 0)  # all drones are alike
    seen = dict(zip(paths, brute_force.pixels_of(scene, 0, paths), strict=True))
    people = slice(len(scene.face_weights), None)
    best = -math.inf
    for plan in plans(scene):
        views = sum(seen[path][:, people] for path in plan.paths)
        best = max(best, float(weights[views >= cameras].sum() / weights.sum()))
    return best


@given(
    st.one_of(problems([1], goals=False, over_time=True), with_areas((1,))),
    st.integers(1, 2), st.integers(1, 2),
)  # fmt: skip
@examples(12)
def test_rows_hold_against_brute_force(problem: Problem, drones: int, cameras: int) -> None:
    """J is the optimum over all starts, and no plan lets more be seen than the bound says."""
    team = TeamChoice(drones)
    try:
        scene = team.scene(problem)
        views = seen_alone(scene, cameras)
    except ProblemError:
        assume(False)
    assume(number_of_plans(scene) <= MOST_PLANS)
    asked = Asked([drones], seen_by=cameras)
    (found,), _ = compare_teams(
        problem, 0, asked, team_settings(60.0, None, kept=False), quiet=True
    )
    best = brute_force.search(scene)
    if best.plan is None:
        assert found.reward is None
        return
    assert found.reward is not None and found.bound is not None
    assert found.reward == pytest.approx(best.value, rel=1e-6, abs=1e-6)
    assert found.bound >= best.value * (1 - 1e-9) - 1e-9
    if not (person_steps(scene) * scene.importance).any():
        assert found.seen is None
        return
    most = most_seen(views, cameras)
    assert found.seen_bound is not None and found.seen_bound >= most - 1e-9
    assert found.reached <= most + 1e-9


def test_gains_are_of_one_drone_more() -> None:
    """They add up to J, and no drone gains more than its bound."""
    teams = co.team(co.load("tiny-share", 0), range(1, 4), time_limit=10)
    rows = teams.rows
    assert [r.drones for r in rows] == [1, 2, 3] and all(r.reason == "optimal" for r in rows)
    assert sum(r.gain or 0.0 for r in rows) == pytest.approx(rows[-1].reward)
    assert all((r.gain or 0.0) <= (r.gain_bound or 0.0) + 1e-9 for r in rows)
    assert list(teams.table["drones"]) == [1, 2, 3]
    assert teams.sentences == list(sentences(rows, 0.95)) == str(teams).splitlines()
    skipped = co.team(co.load("tiny-share", 0), [1, 3], time_limit=10).rows
    assert skipped[1].gain is None


def test_words_say_what_is_proved_and_what_is_not() -> None:
    """Of fewer drones than are enough, and of those that nobody asked about."""
    proved = [row(1, 0.0, 0.0), row(2, 0.88, 0.91), row(3, 0.97, 1.0)]
    (words,) = sentences(proved, 0.95)
    assert words == (
        "The smallest team found to film 95 % of person-steps by two drones: 3 drones (97.0 %). "
        "Proved: no plan of 2 drones exceeds 91.0 %."
    )
    (words,) = sentences([*proved[:1], row(2, 0.88, 0.96), proved[2]], 0.95)
    assert words.endswith(
        "Proved: no plan of 2 drones exceeds 96.0 %, which does not rule out such a team."
    )
    (words,) = sentences([*proved[:1], row(2, 0.88, 1.0), proved[2]], 0.95)
    assert words.endswith("Open: 2 drones may be able to film all person-steps like this.")
    (words,) = sentences([row(2, 0.88, 0.91), row(5, 0.97, 1.0)], 0.95)
    assert words.endswith("Proved: no plan of 2 drones exceeds 91.0 %. Not asked about: 3-4.")
    (words,) = sentences([*proved[:2], row(3, 0.9, 0.92)], 0.95)
    assert words == (
        "No team was found that films 95 % of person-steps by two drones. The most is 90.0 %, "
        "with 3 drones. Proved: no plan of 3 drones or fewer exceeds 92.0 %."
    )
    (words,) = sentences([row(2, 0.9541, 0.9541)], 0.95)
    assert words.endswith("2 drones (95.4 %).")
    two = [row(2, 0.5, 0.5, "airsim"), row(2, 1.0, 1.0, "skydio-2")]
    *each, best = sentences(two, 0.95)
    assert [words.split(":")[0] for words in each] == ["airsim", "skydio-2"]
    assert best == "The smallest of all these teams: 2 drones, skydio-2 (100 %)."
    *_, best = sentences([two[0], row(2, 0.6, 0.6, "skydio-2")], 0.95)
    assert best == "The best of all these teams: 2 drones, skydio-2 (60.0 %)."
    (words,) = sentences([row(2, 0.5, 0.6), row(9, 0.97, 1.0)], 0.95)
    assert words.endswith("Not asked about: 3-8.")
    refused = TeamRow(scene="s", seed=0, camera="", height=None, drones=9, message="no room")
    assert list(sentences([*proved, refused], 0.95)) == list(sentences(proved, 0.95))
    (words,) = sentences([row(2, 0.88, 0.91), replace(refused, drones=3), row(5, 0.97, 1.0)], 0.95)
    assert words.endswith("No answer for: 3. Not asked about: 4.")


@pytest.mark.parametrize(
    ("reached", "bound", "told"),
    [
        (0.8732, 0.8732, "87.4"),
        (0.9996, 0.9996, "100.0"),
        (0.75, 0.75, "75.0"),
        (0.5, 0.91, "91.0"),
    ],
)
def test_a_share_that_no_plan_exceeds_is_told_no_lower(
    reached: float, bound: float, told: str
) -> None:
    """It is rounded upwards, also where a plan attains it."""
    assert row(2, reached, bound).told_bound == told


@pytest.mark.slow
def test_the_command_keeps_what_it_found(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A second call computes nothing; certificates prove the rows; the figure is drawn of them."""
    words = ("team", "tiny-doorway", "--drones", "1-2", "--time-limit", 10, "--out", tmp_path)
    code, out, _ = said(capsys, *words)
    assert code == 0 and "by two drones: 2 drones (100 %)" in " ".join(out.split())
    cells = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "cells").iterdir()}
    code, out, err = said(capsys, *words, "--json")
    assert code == 0 and "are in" in err
    assert cells == {p.name: p.stat().st_mtime_ns for p in (tmp_path / "cells").iterdir()}
    rows = json.loads(out)["rows"]
    assert [r["drones"] for r in rows] == [1, 2]
    kept = load_teams(tmp_path)
    assert [r.reward for r in kept] == [r["reward"] for r in rows]
    for found in kept:
        for plan, certificate in (
            (found.plan, found.certificate),
            (found.plan_seen, found.certificate_seen),
        ):
            name = Path(certificate).name
            files = [tmp_path / part for part in (f"scenes/{name}", plan, certificate)]
            code, out, _ = said(capsys, "verify", *files, "--json")
            assert code == 0 and json.loads(out)["optimal"]
    code, _, _ = said(capsys, "figure", "teams", tmp_path, "-o", tmp_path / "t.svg")
    assert code == 0 and (tmp_path / "t.svg").stat().st_size > 1000


@pytest.mark.long
def test_cameras_and_heights_are_teams_of_their_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each in its row; what is the scene's is left empty."""
    code, out, _ = said(
        capsys, "team", "bottleneck", "--drones", 1, "--camera", "airsim,skydio-2", "--heights",
        "5,7.5", "--time-limit", 0, "--out", tmp_path,
    )  # fmt: skip
    assert code == 0 and "airsim, at 7.5 m" in out
    with (tmp_path / TEAMS).open() as file:
        table = list(csv.DictReader(file))
    assert [(r["camera"], r["height"]) for r in table] == [
        ("airsim", "5.0"), ("airsim", "7.5"), ("skydio-2", "5.0"), ("skydio-2", "7.5"),
    ]  # fmt: skip


def test_too_many_drones_are_a_row_and_no_error(capsys: pytest.CaptureFixture[str]) -> None:
    """A team for which there is no room says so; if there is room for none, that is the error."""
    code, out, _ = said(capsys, "team", "tiny-turn", "--drones", "1-2", "--time-limit", 5)
    assert code == 0 and "2 drones: robots: must have a start" in out
    assert "not at the scene's starts; use -o FOLDER to store plans" in " ".join(out.split())
    code, _, err = said(capsys, "team", "tiny-turn", "--drones", "2", "--time-limit", 5)
    assert code == 2 and err.count("\n") == 1 and "2 drones: robots: must have a start" in err


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (("--drones", "0"), "--drones"),
        (("--drones", "2000"), "--drones"),
        (("--drones", "two"), "--drones"),
        (("--camera", "leica"), "--camera"),
        (("--heights", "high"), "--heights"),
        (("--heights", "nan"), "--heights"),
        (("--cameras", "0"), "--cameras"),
        (("--share", "0"), "--share"),
        (("--share", "95"), "--share"),
        (("--at-least", "2"), "--at-least"),
        (("--time-limit", "-1"), "--time-limit"),
        (("--retry",), "--retry"),
    ],
)
def test_wrong_options_are_one_line(
    words: tuple[str, ...], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is computed, and the option is named."""
    code, out, err = said(capsys, "team", "tiny-share", *words)
    assert code == 2 and not out and err.count("\n") == 1 and named in err


def test_drones_that_are_not_alike_make_no_teams() -> None:
    """The drone that differs is named, and its fields, as in a scene and as in a recipe."""
    problem = co.load("tiny-share", 0)
    first, second = problem.robots
    other = problem.replace(robots=(first, second.replace(motion=second.motion.replace(radius=2))))
    with pytest.raises(
        ProblemError,
        match=r"^robots: .* drone 1 differs from drone 0 in motion; .* the same \[drones.motion\]$",
    ):
        TeamChoice(2).scene(other)
    tilted = second.camera.replace(tilts=(0.1, 0.2))
    other = other.replace(robots=(first, other.robots[1].replace(camera=tilted)))
    with pytest.raises(ProblemError, match="in motion and camera; in a recipe"):
        TeamChoice(2).scene(other)
    goal = problem.replace(robots=(first.replace(goal=(first.start.x, first.start.y)), second))
    with pytest.raises(ProblemError, match=r"robots\[0\].goal"):
        TeamChoice(2).scene(goal)
    ends = co.GoalArea(cells=((0, 0), (1, 0))), co.GoalArea(cells=((0, 0), (2, 0)))
    areas = problem.replace(
        robots=tuple(r.replace(goal=end) for r, end in zip(problem.robots, ends, strict=True))
    )
    with pytest.raises(ProblemError, match=r"robots\[1\].goal: .* the same for all"):
        TeamChoice(2).scene(areas)
    area = first.replace(start=co.StartArea(cells=((0, 0), (1, 0))))
    two = problem.replace(robots=(area, second.replace(start=co.StartArea(cells=((2, 0), (2, 1))))))
    with pytest.raises(ProblemError, match="choices of starts"):
        TeamChoice(2).scene(two)
    mixed = problem.replace(robots=(area, second))
    assert TeamChoice(2).scene(mixed).robots == (area, area)


def test_teams_end_where_they_can_land() -> None:
    """Ground to land on is the goal of each drone of a team, at another height, too."""
    problem = co.load("delft", 0)
    goals = {robot.goal for robot in problem.robots}
    for team in (TeamChoice(2), TeamChoice(3, height=9.0)):
        assert {robot.goal for robot in team.scene(problem).robots} == goals
