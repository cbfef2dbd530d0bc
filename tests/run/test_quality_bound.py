"""Bounds on the person-steps that several drones see: no plan has more."""

import numpy as np
import pytest
from brute_force import all_paths, pixels_of
from hypothesis import given
from hypothesis import strategies as st
from pool import problems
from strategies import examples

import cocap_opt as co
from cocap_opt.footage.quality import Assumptions, Quality
from cocap_opt.formulations.certificates import verify
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.run.quality_bound import MostSeen, QualityBound
from cocap_opt.scenarios import load_scene


@st.composite
def weighted(draw: st.DrawFn) -> Problem:
    """Small problems, in which the importance of people may change, and some have no weight."""
    problem = draw(problems(robots=(2, 3), most_plans=600, over_time=True))
    steps = problem.horizon + 1
    amounts = draw(st.sampled_from([(0.7,), (1.0,), (0.0, 0.7), (0.0, 0.3, 1.0, 2.5)]))
    actors = []
    for actor in problem.actors:
        importance = draw(st.lists(st.sampled_from(amounts), min_size=steps, max_size=steps))
        nothing = (0.0,) * len(actor.face_weights)
        weights = draw(st.sampled_from([actor.weights, actor.weights, nothing]))
        actors.append(actor.replace(importance=tuple(importance), weights=weights))
    objective = problem.objective.replace(over_time=False)
    return problem.replace(actors=tuple(actors), objective=objective)


def worth_of(problem: Problem) -> np.ndarray:
    """The weight of each person-step [T+1, A], taken from the actors themselves."""
    rows = [
        [
            (actor.importance or (1.0,) * (t + 1))[t]
            * (any(w > 0 for w in actor.face_weights) and (t > 0 or problem.objective.count_start))
            for actor in problem.actors
        ]
        for t in range(problem.horizon + 1)
    ]
    return np.array(rows)


def best_plan(problem: Problem, paths: list, worth: np.ndarray) -> Plan | None:
    """The plan that obeys the rules and is worth most, of worths by the paths' numbers."""
    for best in np.argsort(-worth, kind="stable"):
        which = np.unravel_index(best, tuple(map(len, paths)))
        plan = Plan(paths=tuple(own[int(i)] for own, i in zip(paths, which, strict=True)))
        if check(problem, plan).valid:
            return plan
    return None


@pytest.mark.parametrize("method", ["alone", "branch-and-price"])
@examples(20)
@given(weighted(), st.sampled_from([1, 2, 3]), st.sampled_from([0.02, 0.3]))
def test_no_plan_has_more(method: str, problem: Problem, cameras: int, at_least: float) -> None:
    """The best plan of all, for each number of drones, has no larger share than the bound."""
    bound = QualityBound.of(problem, cameras, at_least).proved(seconds=1.0, bound=method)
    weights = worth_of(problem)
    assert np.array_equal(bound.weights, weights)
    if not weights.any():
        assert [*bound.sentences()] == ["No person has a weight, so no person-step counts."]
        return
    paths = [all_paths(problem, robot) for robot in range(len(problem.robots))]
    views = np.zeros((1, *weights.shape))  # of each plan
    for robot, own in enumerate(paths):
        seen = pixels_of(bound.scene(1), robot, own)[..., -len(problem.actors) :]
        views = (views[:, None] + seen[None]).reshape(-1, *weights.shape)
    for drones in range(1, cameras + 1):
        worth = ((views >= drones) * weights).sum(axis=(1, 2))
        plan, most = best_plan(problem, paths, worth), bound.most(drones)
        if plan is None:
            continue
        assert not bound.no_plan
        found = Quality.of(problem, plan, assumptions=Assumptions(at_least=at_least))
        seen = found.counts & (found.views >= drones)
        share = bound.share(found, drones)
        assert share == pytest.approx((seen * weights).sum() / weights.sum())
        assert share <= most.share * (1 + 1e-12)
        assert most.person_steps is None or seen.sum() <= most.person_steps


def test_a_bound_is_not_loose_where_all_is_proved() -> None:
    """On a scene whose sums are proved the best plan of one number attains the bound of it."""
    problem = load_scene("bottleneck", 0)
    bound = co.quality_bound(problem, cameras=2)
    assert bound.results[0].plan is not None
    best = co.quality(problem, bound.results[0].plan)
    assert bound.share(best, 1) == bound.most(1).share == 43 / 44
    assert bound.most(2) == MostSeen(2, 41 / 44, 41)
    for number, result in enumerate(bound.results, 1):
        assert result.certificate is not None
        assert verify(bound.scene(number), result.certificate).bound == result.bound
    first, second = bound.sentences(best)
    assert first == (
        "Proved: no plan of these drones has more than 43 of 44 person-steps (97.7 %) seen by "
        "one drone or more. This plan: 43 (97.7 %), and no plan has more."
    )
    assert "41 of 44 person-steps (93.2 %) seen by two drones or more." in second
    broken = list(bound.sentences(best, obeys_rules=False))
    assert broken[0].endswith("This plan, which breaks rules: 43 (97.7 %).")
    with pytest.raises(
        ValueError, match=r"at_least: the bound uses 0\.3, but the plan's quality 0\.5"
    ):
        bound.share(co.quality(problem, bound.results[0].plan, at_least=0.5), 1)


@pytest.mark.slow
def test_weights_speak_of_weights_only() -> None:
    """Sums by importance say so; nothing is rounded down, and more drones than there are see none.

    A number of person-steps does not follow: it is None.
    """
    problem = load_scene("bottleneck", 0)
    steps = problem.horizon + 1
    first, *others = problem.actors
    first = first.replace(importance=(2.0,) * steps)
    problem = problem.replace(actors=(first, *others))
    bound = QualityBound.of(problem, cameras=5).proved(seconds=0.5)
    assert bound.is_weighted and len(bound.results) == len(problem.robots) == 4
    assert bound.most(5) == MostSeen(5, 0.0, None)
    shares = [bound.most(m).share for m in range(1, 6)]
    assert shares == sorted(shares, reverse=True) and 0 < shares[1] < 1
    (_, two, *_) = bound.sentences()
    percent = float(two.split("more than ")[1].split(" %")[0])
    assert shares[1] <= percent / 100 <= shares[1] + 0.00101
    assert "of person-steps, by their importance, seen by two drones or more" in two


def test_nothing_proved_rules_nothing_out() -> None:
    """Without a result the share is 1, and the words say so."""
    bound = QualityBound.of(load_scene("corridor", 0))
    assert [bound.most(m).share for m in (1, 2, 3)] == [1.0, 1.0, 0.0]
    assert str(bound).splitlines() == [
        "Not ruled out: a plan in which every person-step is seen by one drone or more.",
        "Not ruled out: a plan in which every person-step is seen by two drones or more.",
    ]
