"""People who may walk differently: J is a mean, and a plan is safe whoever is there."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st
from pool import problems
from strategies import examples, tiny
from takes import InTakes, in_takes, random_plan

from cocap_opt.api.covering import coverage_digest
from cocap_opt.data import ProblemError
from cocap_opt.files.documents import SceneFile, problem_digest
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.certificates.checking import verify
from cocap_opt.model import Model
from cocap_opt.objective import objective
from cocap_opt.planners import PLANNERS
from cocap_opt.problem import Problem, Take, Views
from cocap_opt.referee import check

METHODS = dict(BOUNDS | EXACT)
DRAWN = in_takes(problems(over_time=True))


@pytest.mark.long(seconds=14)
@examples(400)
@given(DRAWN, st.integers(0, 10**6))
def test_j_is_the_mean_over_takes(drawn: InTakes, seed: int) -> None:
    """By the referee and by what planners maximise; and a plan is safe if it is in each take."""
    plan = random_plan(drawn.problem, np.random.default_rng(seed))
    if plan is None:
        reject()
    verdict = check(drawn.problem, plan)
    parts = [check(part, plan) for _, part in drawn.alone]
    assert verdict.valid == all(part.valid for part in parts)
    assert not verdict.violations
    mean = pytest.approx(drawn.mean(plan), rel=1e-9, abs=1e-9)
    assert verdict.reward == mean
    model = Model(drawn.problem, use_cache=False)
    assert objective(model, model.paths(plan)) == mean
    for k, (_, part) in enumerate(drawn.alone):
        assert problem_digest(drawn.problem.of_take(k)) == problem_digest(part)


@pytest.mark.long(seconds=7)
@examples(120)
@given(in_takes(problems()), st.sampled_from(sorted(PLANNERS)))
def test_plans_are_no_better_than_the_best_on_average(drawn: InTakes, name: str) -> None:
    """Of all planners: what they claim is the mean, and the plan is safe in each take."""
    problem = drawn.problem
    most = PLANNERS[name].most_robots
    if most and len(problem.robots) > most:
        return
    result, (_, best) = PLANNERS[name](problem), drawn.optimum()
    if result.plan is None:
        reject()
    assert result.value == pytest.approx(drawn.mean(result.plan), rel=1e-9, abs=1e-9)
    verdicts = [check(part, result.plan) for _, part in drawn.alone]
    assert not any(verdict.violations for verdict in verdicts)
    if all(verdict.valid for verdict in verdicts):
        assert result.value <= best + 1e-9 * (1 + abs(best))


@pytest.mark.parametrize("name", sorted(METHODS))
@pytest.mark.long
@examples(12)
@given(drawn=DRAWN)
def test_bounds_are_no_less_than_the_best_on_average(name: str, drawn: InTakes) -> None:
    """Plan <= optimum <= bound, and the certificate of the mean proves what is claimed."""
    problem, (_, best) = drawn.problem, drawn.optimum()
    most = METHODS[name].most_robots
    if most and len(problem.robots) > most:
        return
    result = METHODS[name](problem)
    size = 1e-9 * (1 + abs(best)) if math.isfinite(best) else 0.0
    assert result.bound >= best - size
    if result.plan is not None:
        assert result.value == pytest.approx(drawn.mean(result.plan), rel=1e-9, abs=1e-9)
        assert result.value <= best + size
    file = result.certificate
    if file is not None and file.bound is not None:
        assert verify(problem, file).bound >= best - size
    if METHODS[name].optimal and result.reason.value == "optimal":
        assert result.value == pytest.approx(best, rel=1e-4, abs=1e-6)


def three_takes() -> Problem:
    """Somebody of all takes, and somebody else of the first of three."""
    problem = tiny()
    person = problem.actors[0]
    return problem.replace(
        actors=(person.replace(name="Ada"), person.replace(take="one", name="Bob")),
        takes=(
            Take(name="one", probability=0.5),
            Take(name="two", probability=0.25),
            Take(name="three", probability=0.25),
        ),
    )


def test_people_of_all_takes_are_in_each() -> None:
    """As a copy in each, one take after the other, with its probability as a factor."""
    problem = three_takes()
    there = [(actor.name, actor.take) for actor in problem.actors]
    assert there == [("Ada", "one"), ("Bob", "one"), ("Ada", "two"), ("Ada", "three")]
    assert problem.take_of.tolist() == [0, 0, 1, 2]
    assert problem.importance[1].tolist() == [0.5, 0.5, 0.25, 0.25]
    assert problem.person(2) == "Ada (2, take two)"
    assert [actor.name for actor in problem.of_take(0).actors] == ["Ada", "Bob"]
    with pytest.raises(ProblemError, match=r"take: must be 0\.\.2, not -1"):
        problem.of_take(-1)
    with pytest.raises(ProblemError, match=r"take: must be 0\.\.0, not 1"):
        tiny().of_take(1)
    assert problem.of_take(2).takes == () and problem.of_take(2) is problem.of_take(2)
    assert len(problem.distinct_people) == 1
    assert problem.numbers_in_take.tolist() == [0, 1, 0, 0]


def test_each_copy_has_the_weight_of_the_person_s_views() -> None:
    """A weight for each person as they are given, and then one for each copy."""
    problem = tiny()
    person = problem.actors[0]
    given_ = problem.replace(
        actors=(person, person.replace(take="b")),
        takes=(Take(name="a", probability=0.9), Take(name="b", probability=0.1)),
        objective=problem.objective.replace(views=Views(weight=(3.0, 5.0))),
    )
    views = given_.objective.views
    assert views is not None and views.weight == (3.0, 3.0, 5.0)
    assert given_.count_weights[0].tolist() == pytest.approx([2.7, 0.3, 0.5])
    alone = given_.of_take(1).objective.views
    assert alone is not None and alone.weight == (3.0, 5.0)


def test_two_drones_in_two_takes_are_no_two_views() -> None:
    """The root of a mean is no mean of roots: each take has view sums of its own."""
    problem = tiny()
    halves = (Take(name="a", probability=0.5), Take(name="b", probability=0.5))
    twice = problem.replace(takes=halves)
    plan = PLANNERS["sequential"](problem).plan
    assert plan is not None
    assert check(twice, plan).reward == pytest.approx(check(problem, plan).reward, rel=1e-12)


@pytest.mark.parametrize(
    ("names", "probabilities", "of", "words"),
    [
        ("ab", (0.5, 0.4), "a", r"^takes: probabilities must sum to 1, not 0\.9$"),
        ("aa", (0.5, 0.5), "a", r"^takes: must have distinct names; two are 'a'$"),
        ("ab", (0.5, 0.5), "c", r"^actors\[0\]\.take: must be one of 'a', 'b', not 'c'$"),
        ("", (), "c", r"^actors\[0\]\.take: needs takes, not 'c'$"),
        ("ab", (0.5, 1.5), "a", r"^probability: must be 0\.\.1, not 1\.5$"),
        (" ", (1.0,), "a", r"^name: must not be empty$"),
    ],
)
def test_wrong_takes_are_refused(
    names: str, probabilities: tuple[float, ...], of: str, words: str
) -> None:
    """In a line that says what is allowed."""
    problem = tiny()

    def changed() -> Problem:
        takes = tuple(
            Take(name=name, probability=p) for name, p in zip(names, probabilities, strict=True)
        )
        return problem.replace(takes=takes, actors=(problem.actors[0].replace(take=of),))

    with pytest.raises(ProblemError, match=words):
        changed()


def test_scene_files_keep_takes(tmp_path: Path) -> None:
    """Bit for bit; a person of no take in a file is in all; files of before are read."""
    problem = three_takes()
    SceneFile(problem=problem).save(tmp_path / "scene.json")
    read = SceneFile.read(tmp_path / "scene.json").problem
    assert problem_digest(read) == problem_digest(problem)
    assert [actor.take for actor in read.actors] == [actor.take for actor in problem.actors]
    written = json.loads((tmp_path / "scene.json").read_text())
    del written["problem"]["actors"][2:]
    written["problem"]["actors"][0]["take"] = None
    (tmp_path / "scene.json").write_text(json.dumps(written))
    again = SceneFile.read(tmp_path / "scene.json").problem
    assert problem_digest(again) == problem_digest(problem)
    SceneFile(problem=tiny()).save(tmp_path / "before.json")
    written = json.loads((tmp_path / "before.json").read_text())
    del written["problem"]["takes"], written["problem"]["actors"][0]["take"]
    (tmp_path / "before.json").write_text(json.dumps(written))
    before = SceneFile.read(tmp_path / "before.json").problem
    assert before.takes == () and problem_digest(before) == problem_digest(tiny())


def test_digests_know_who_is_there_and_how_probably() -> None:
    """Not what takes are called."""
    problem = three_takes()
    other = [take.replace(name=take.name.upper()) for take in problem.takes]
    renamed = problem.replace(
        takes=tuple(other),
        actors=tuple(actor.replace(take=(actor.take or "").upper()) for actor in problem.actors),
    )
    assert problem_digest(renamed) == problem_digest(problem)
    one, two, three = problem.takes
    likelier = problem.replace(
        takes=(one.replace(probability=0.25), two.replace(probability=0.5), three)
    )
    assert problem_digest(likelier) != problem_digest(problem)
    assert coverage_digest(likelier) == coverage_digest(problem)
