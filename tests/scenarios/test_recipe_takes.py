"""Recipes whose people may walk differently: takes that are said, and takes that are drawn."""

from pathlib import Path

import pytest

from cocap_opt.data import ProblemError
from cocap_opt.problem import Problem
from cocap_opt.scenarios.recipe import read

RECIPE = """
steps = 6
[map]
size = [20, 12]
resolution = 1
[[walk]]
points = [[4, 3], [14, 4]]
name = "Ada"
{first}
[[walk]]
points = [[4, 8], [14, 8]]
name = "Bob"
{second}
[[drones]]
starts = [{ x = 1.5, y = 10.5, height = 4 }]
motion = { layers = [4], headings = 4 }
"""
TWO = """
[[take]]
name = "usual"
probability = 0.75
[[take]]
name = "late"
probability = 0.25
"""


def recipe(folder: Path, first: str = "", second: str = "", more: str = "") -> Problem:
    """A scene of two people, with more fields of each and more tables."""
    path = folder / "scene.toml"
    path.write_text(RECIPE.replace("{first}", first).replace("{second}", second) + more)
    return read(path, seed=0)


def test_people_name_the_takes_that_they_are_in(tmp_path: Path) -> None:
    """One, several, or all of them where they name none."""
    problem = recipe(tmp_path, 'take = "late"', more=TWO)
    there = [(actor.take, actor.name) for actor in problem.actors]
    assert there == [("usual", "Bob"), ("late", "Ada"), ("late", "Bob")]
    assert problem.chances.tolist() == [0.75, 0.25, 0.25]
    both = recipe(tmp_path, 'take = ["usual", "late"]', 'take = "usual"', TWO)
    assert sorted((a.take, a.name) for a in both.actors if a.take) == [
        ("late", "Ada"), ("usual", "Ada"), ("usual", "Bob"),
    ]  # fmt: skip


def test_weights_of_views_are_those_of_each_person(tmp_path: Path) -> None:
    """Of a list as people stand in the recipe, whatever takes they are in."""
    views = "[objective.views]\nweight = [3, 5]\n"
    said = recipe(tmp_path, more=TWO + views).objective.views
    assert said is not None and said.weight == (3.0, 5.0, 3.0, 5.0)
    drawn = recipe(tmp_path, more=f"[spread]\ntakes = 3\naside = 0.2\n{views}").objective.views
    assert drawn is not None and drawn.weight == (3.0, 5.0) * 3
    first = recipe(tmp_path, more=TWO + '[objective]\nviews = "first"\n').objective.views
    plain = recipe(tmp_path, more='[objective]\nviews = "first"\n').objective.views
    assert first is not None and plain is not None
    assert max(first.weights(4)) == pytest.approx(4 * max(plain.weights(2)), rel=1e-3)


def test_a_spread_draws_takes(tmp_path: Path) -> None:
    """The first is as the recipe has it; another seed draws others."""
    table = "[spread]\ntakes = 4\ndelay = 1\naside = 0.3\nspeed = 0.1\n"
    problem, plain = recipe(tmp_path, more=table), recipe(tmp_path)
    assert [take.name for take in problem.takes] == ["as given", "take 1", "take 2", "take 3"]
    assert problem.chances.tolist() == [0.25] * 8
    walks = [actor.poses.tolist() for actor in problem.actors]
    assert walks[:2] == [actor.poses.tolist() for actor in plain.actors]
    assert walks[2:] != [actor.poses.tolist() for actor in plain.actors] * 3
    again, other = recipe(tmp_path, more=table), recipe(tmp_path, more=f"{table}seed = 1\n")
    assert [actor.poses.tolist() for actor in again.actors] == walks
    assert [actor.poses.tolist() for actor in other.actors] != walks


@pytest.mark.parametrize(
    ("first", "more", "words"),
    [
        ('take = "late"', "", r"walk\[0\].take: needs \[\[take\]\], not 'late'$"),
        ('take = "no"', TWO, r"walk\[0\].take: must be one of 'usual', 'late', not 'no'$"),
        ('take = ["late", "late"]', TWO, r"walk\[0\].take: names must be different$"),
        ("", TWO.replace("0.25", "0.3"), r"take: probabilities must sum to 1, not 1\.05$"),
        ("", TWO.replace("0.25", "-1"), r"take\[1\].probability: must be 0\.\.1, not -1\.0$"),
        ("", TWO.replace("late", "usual"), r"take: must have distinct names; two are 'usual'$"),
        ("", "[spread]\n", r"spread.delay: must be more than 0 if aside and speed are 0"),
        ("", "[spread]\naside = -1\n", r"spread.aside: must be 0\.\.100 m, not -1\.0$"),
        ("", "[spread]\naside = 1\ntakes = 1\n", r"spread.takes: must be 2\.\.100, not 1$"),
        ("", "[spread]\naside = 1\nseed = -1\n", r"spread.seed: must be 0 or more, not -1$"),
        ("", f"{TWO}[spread]\naside = 1\n", r"spread: must be left out beside \[\[take\]\], which"),
    ],
)
def test_takes_that_do_not_fit_are_refused(
    first: str, more: str, words: str, tmp_path: Path
) -> None:
    """In a line that names the table."""
    with pytest.raises(ProblemError, match=words):
        recipe(tmp_path, first, more=more)
