"""Plans beside takes: what a plan for one loses in another, and what hedging costs."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from pool import problems
from strategies import examples
from takes import InTakes, in_takes

import cocap_opt as co
from cocap_opt.cli.commands import run
from cocap_opt.footage.quality import Quality
from cocap_opt.run.takes import Hedging, PlanForTake, if_sure, reward_in, take_rows


def two_takes() -> co.Problem:
    """A corridor in which people walk as they do, or two metres farther."""
    problem = co.load("corridor", seed=0)
    usual, rare = co.Take(name="usual", probability=0.75), co.Take(name="rare", probability=0.25)
    ahead = [
        actor.replace(poses=actor.poses + np.array([2.0, 0, 0, 0]), take="rare")
        for actor in problem.actors
    ]
    on_time = [actor.replace(take="usual") for actor in problem.actors]
    return problem.replace(actors=(*on_time, *ahead), takes=(usual, rare))


@pytest.mark.slow(seconds=5)
@examples(12)
@given(in_takes(problems()))
def test_plans_for_takes_are_enclosed(drawn: InTakes) -> None:
    """J in a take is the referee's there, and neither it nor the mean is above its bound."""
    found = co.compare_takes(drawn.problem, seconds=20)
    plan, best = drawn.optimum()
    assert (found.hedged.plan is None) == (plan is None)
    assert found.hedged.bound >= best - 1e-9 * (1 + abs(best)) or plan is None
    if plan is None:
        return
    assert found.hedged.mean == pytest.approx(best, rel=1e-4, abs=1e-6)
    for row in (*found.plans, found.hedged):
        assert row.plan is not None
        rewards = [co.check(part, row.plan).reward for _, part in drawn.alone]
        assert row.rewards == pytest.approx(rewards, rel=1e-9, abs=1e-9)
        assert row.mean == pytest.approx(drawn.mean(row.plan), rel=1e-9, abs=1e-9)
        assert row.mean <= found.hedged.mean + 1e-9 * (1 + abs(best))
        for k, bound in enumerate(other.bound for other in found.plans):
            assert row.rewards[k] <= bound + 1e-9 * (1 + abs(bound))
            assert row.rewards[k] <= found.plans[k].rewards[k] + 1e-9
    assert found.foreknowledge >= found.hedged.mean - 1e-6 * (1 + abs(best))


def test_sentences_say_shares_of_what_could_be_had() -> None:
    """A plan of half of what is proved has at most half less, whoever is compared with."""
    problem = two_takes()
    plan = co.plan(problem, "sequential").plan
    rewards = reward_in(problem, plan)
    mean = 0.75 * rewards[0] + 0.25 * rewards[1]

    def told(factor: float) -> list[str]:
        rows = [
            PlanForTake(name, plan, rewards, mean, factor * reward, None, problem, 1.0)
            for name, reward in (("usual", rewards[0]), ("rare", rewards[1]), ("all takes", mean))
        ]
        return list(Hedging(problem, (rows[0], rows[1]), rows[2]).sentences())

    assert told(2.0)[-1] == (
        "on average the plan for all takes is below the best such plan (proved: at most 50.00 %), "
        "and below plans made for the take if it were known (proved: at most 50.0 %)"
    )
    assert 'hedging costs 0.0 % of J in "rare" (proved: at most 50.0 %)' in told(2.0)
    unproved = 'hedging costs 0.0 % of J in "rare" (no bound proved)'
    assert unproved in told(math.inf)
    assert "nan" not in " ".join(told(math.inf)).lower()
    assert told(1 + 5e-5)[-1].startswith(
        "on average the plan for all takes is below the best such plan (proved: less than 0.01 %, "
        "if at all), and below plans made"
    )
    assert told(1 + 1e-7)[-1] == (
        "on average the plan for all takes is the best such plan (proved, no plan is better), and "
        "as good as plans made for the take if it were known (proved, no plan is better)"
    )


def test_a_plan_for_a_take_keeps_away_from_the_people_of_others() -> None:
    """Else it could not be flown if they came; without such a distance they are left out."""
    problem = two_takes()
    assert len(if_sure(problem, 1).actors) == 2
    near = problem.replace(airspace=co.Airspace(people_aside=0.5))
    sure = if_sure(near, 1)
    assert len(sure.actors) == 4 and sure.chances.tolist() == [0, 0, 1, 1]


def test_the_quality_of_a_plan_is_that_of_takes_on_average() -> None:
    """Shares are weighted by probability; each take has those of its problem alone."""
    problem = two_takes()
    plan = co.plan(problem, "sequential").plan
    assert plan is not None
    found = co.quality(problem, plan)
    alone = [Quality.of(problem.of_take(k), plan).summary for k in range(2)]
    for summary, expected in zip(found.by_take, alone, strict=True):
        assert summary == pytest.approx(expected)
    for name in ("by_two", "by_three", "apart", "infinite"):
        usual, rare = (getattr(summary, name) for summary in alone)
        assert getattr(found.summary, name) == pytest.approx(0.75 * usual + 0.25 * rare)
    assert found.summary.median in found.errors[found.counts]
    assert "take by take" in str(found) and "usual: two see" in str(found)


def test_errors_half_of_which_do_not_exceed_are_weighted() -> None:
    """As if person-steps were there as often as their take is probable."""
    problem = two_takes()
    plan = co.plan(problem, "sequential").plan
    assert plan is not None
    found = co.quality(problem, plan)
    errors, takes = found.errors[1:], found.take_of
    often = np.concatenate([np.repeat(errors[:, takes == 0], 3), errors[:, takes == 1].ravel()])
    for part, told in ((0.5, found.summary.median), (0.9, found.summary.most_of_them)):
        assert told == np.sort(often)[math.ceil(part * len(often)) - 1]


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """The answer of a command that goes well."""
    assert run([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow(seconds=5)
def test_commands_tell_takes_one_by_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """J and quality in each take, by `plan`, `verify` and `quality`; without takes nothing."""
    problem, scene, plan = two_takes(), str(tmp_path / "scene.json"), str(tmp_path / "plan.json")
    co.save(Path(scene), problem)
    made = answer(capsys, "plan", scene, "--planner", "sequential", "-o", plan)
    read = co.read(Path(plan))
    rewards = reward_in(problem, read)
    assert [row["reward"] for row in made["takes"]] == pytest.approx(rewards)
    assert [row["take"] for row in made["takes"]] == ["usual", "rare"]
    assert 0.75 * rewards[0] + 0.25 * rewards[1] == pytest.approx(made["reward"])
    assert answer(capsys, "verify", scene, plan)["takes"] == made["takes"]
    filmed = answer(capsys, "quality", scene, plan)["takes"]
    assert [row["reward"] for row in filmed] == pytest.approx(rewards)
    assert [row["by_two"] for row in filmed] == [row["seen_by_two"] for row in made["takes"]]
    assert run(["plan", scene, "--planner", "sequential"]) == 0
    assert "usual (75 %): J" in capsys.readouterr().out
    assert run(["quality", scene, plan]) == 0
    assert "J take by take: usual" in capsys.readouterr().out
    assert "takes" not in answer(capsys, "plan", "corridor", "--planner", "sequential")
    assert take_rows(co.load("corridor"), read) == []


@pytest.mark.long(seconds=5)
def test_takes_are_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A row for each plan, and what no plan exceeds; files are those of their scenes."""
    scene = str(tmp_path / "scene.json")
    co.save(Path(scene), two_takes())
    found = answer(capsys, "takes", scene, "--seconds", "20", "-o", str(tmp_path / "out"))
    assert [row["plan_for"] for row in found["plans"]] == ["usual", "rare", "all takes"]
    usual, rare, hedged = found["plans"]
    assert usual["rewards"][0] >= hedged["rewards"][0] and rare["rewards"][1] >= usual["rewards"][1]
    assert hedged["mean"] >= max(usual["mean"], rare["mean"])
    assert found["files"][0] == "hedged.bound.json" and len(found["files"]) == 9
    for name in ("hedged", "take-0", "take-1"):
        files = [str(tmp_path / "out" / f"{name}.{kind}.json") for kind in ("scene", "bound")]
        assert answer(capsys, "verify", *files)["valid"]
    hedge = [str(tmp_path / "out" / f"hedged.{kind}.json") for kind in ("scene", "plan", "bound")]
    assert answer(capsys, "verify", *hedge)["gap"] < 1e-4
    assert run(["takes", scene, "--seconds", "20"]) == 0
    told = capsys.readouterr().out
    assert "no plan has more than" in told and "hedging costs" in told


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["corridor"], "SCENE: has no takes; --delay, --aside or --speed draw some"),
        (["corridor", "--aside", "-1"], "--aside: must be 0..100 m, not -1"),
        (["corridor", "--delay", "1"], "--delay: must be 0 s, as the scene defines no step length"),
        (["corridor", "--aside", "1", "--count", "1"], "--count: must be 2..100 takes, not 1"),
        (["corridor", "--aside", "1", "--seconds", "0"], "--seconds: must be more than 0"),
    ],
)
def test_what_cannot_be_compared_is_refused(
    words: list[str], told: str, caplog: pytest.LogCaptureFixture,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    """In a line that names the option."""
    assert run(["takes", *words]) == 2
    assert told in capsys.readouterr().err + caplog.text


def test_scenes_without_people_and_zeros_are_refused_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An option that is 0 was given all the same."""
    scene = str(tmp_path / "scene.json")
    co.save(Path(scene), co.load("corridor").replace(actors=()))
    assert run(["takes", scene, "--aside", "1"]) == 2
    assert "SCENE: must have people, who can walk differently" in capsys.readouterr().err
    co.save(Path(scene), two_takes())
    for option in ("--count", "--draw-seed"):
        assert run(["takes", scene, option, "0"]) == 2
        assert f"{option}: must be left out, as the scene has takes" in capsys.readouterr().err


def test_takes_are_not_drawn_where_there_are_some(tmp_path: Path) -> None:
    """Neither by the command nor by the function, which needs some."""
    co.save(tmp_path / "scene.json", two_takes())
    assert run(["takes", str(tmp_path / "scene.json"), "--aside", "1"]) == 2
    with pytest.raises(
        co.ProblemError, match=r"^problem: must have takes; use `takes` to draw some$"
    ):
        co.compare_takes(co.load("corridor"))
