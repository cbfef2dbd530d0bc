"""Plans that keep the share of views that is asked for."""

import math
from contextlib import suppress
from itertools import product
from typing import Any

import msgspec
import pytest
from brute_force import all_paths
from hypothesis import given
from hypothesis import strategies as st
from msgspec import UnsetType
from pool import problems
from strategies import SHARE, examples
from trade_offs import crossroads

import cocap_opt as co
from cocap_opt.files.documents import problem_digest
from cocap_opt.problem import Objective, Plan, Problem, Views
from cocap_opt.referee import Verdict, check
from cocap_opt.run.front import Front
from cocap_opt.run.view_share import bound_with_share, keeps_share, missed_share, views_alone

MOST = 300 if SHARE >= 1 else 100  # plans of a problem, each of which is judged by four objectives


@pytest.mark.slow
def test_views_weigh_more_until_the_share_is_kept() -> None:
    """J alone looks at one person, who pays more; two thirds of views need the two others."""
    problem = crossroads()
    for share, views in ((0.3, 2.0), (0.6, 4.0)):
        asked = co.with_views(problem, cameras=1, weight=1.0, share=share)
        result = co.plan(asked)
        assert result.plan is not None and not missed_share(asked, result.plan)
        point = Front.of(asked).point(result.plan)
        assert point is not None and point.views == views
        assert result.value == pytest.approx(point.reward + views)  # by the scene's own weight
        assert ("times the weight" in result.message) == (share == 0.6)


@pytest.mark.long
def test_a_share_that_no_plan_keeps_is_said() -> None:
    """The plan is that of the scene's own weight."""
    asked = co.with_views(co.load("tiny-doorway"), weight=1.0, share=1.0)
    result = co.plan(asked)
    without = asked.objective.views
    assert without is not None and result.plan is not None
    alone = asked.replace(objective=asked.objective.replace(views=without.replace(share=None)))
    assert result.value == co.plan(alone).value
    assert "fewer than 100 %" in result.message


@examples(25)
@given(
    problems(most_plans=MOST), st.sampled_from([1, 2]), st.sampled_from([0.3, 0.6, 0.9]),
    st.sampled_from([0.0, 1.0]),
)  # fmt: skip
def test_no_plan_that_keeps_the_share_exceeds_the_bound(
    problem: Problem, cameras: int, share: float, weight: float
) -> None:
    """Of all plans that obey the rules, by brute force; the certificate is checked, too."""
    asked = co.with_views(problem, cameras=cameras, weight=weight, share=share)
    paths = [all_paths(asked, robot) for robot in range(len(asked.robots))]
    plans = [Plan(paths=chosen) for chosen in product(*paths)]
    best = best_kept(asked, {plan: check(asked, plan) for plan in plans})
    result = co.solve(asked)
    assert result.bound >= best - 1e-9 * (1 + abs(best))
    if result.plan is not None and keeps(asked, result.plan):
        assert check(asked, result.plan).valid
        assert result.value <= best + 1e-9 * (1 + abs(best))
        assert co.verify(asked, result).bound == pytest.approx(result.bound, rel=1e-6)
        if result.reason is co.Reason.OPTIMAL:
            assert result.value == pytest.approx(best)
    elif result.plan is None:
        assert best == -math.inf
        assert result.certificate is None or co.verify(asked, result.certificate).no_plan
    else:
        assert result.reason is not co.Reason.OPTIMAL and best == -math.inf
    assert result.certificate is None or co.verify(asked, result.certificate).bound >= best - 1e-9


@examples(25)
@given(
    problems(most_plans=MOST), st.floats(0, 3), st.floats(0, 3), st.sampled_from([0.3, 0.7, 1.0])
)
def test_a_bound_with_more_weight_of_views_is_one_of_the_share(
    problem: Problem, weight: float, more: float, share: float
) -> None:
    """Of the best plan with that weight, or with views alone; by brute force."""
    people = len(problem.actors)
    views = Views(weight=(weight, 0.0, 1.0, 2.0, 3.0)[:people], share=share)
    asked = problem.replace(objective=problem.objective.replace(views=views))
    weights = tuple(given + more for given in views.weights(people))
    heavier = asked.objective.replace(views=views.replace(weight=weights, share=None))
    others = asked.replace(objective=heavier), views_alone(asked, views.replace(weight=1.0))
    paths = [all_paths(asked, robot) for robot in range(len(asked.robots))]
    plans = [Plan(paths=chosen) for chosen in product(*paths)]
    verdicts = {plan: check(asked, plan) for plan in plans}
    best = best_kept(asked, verdicts)
    valid = [plan for plan, verdict in verdicts.items() if verdict.valid]
    for other in others:
        bound = max((check(other, plan).reward for plan in valid), default=-1.0)
        assert bound_with_share(asked, other, bound) >= best - 1e-9 * (1 + abs(best))


@pytest.mark.long
def test_all_certificates_of_a_share_hold_for_the_scene() -> None:
    """Also where the scene's own weights, one for each person, have the least bound."""
    scene = co.load("tiny-share")
    for method, pixels, share in product(("alone", "concave"), (1.0, 100.0), (0.3, 0.7)):
        given = scene.replace(objective=scene.objective.replace(pixels=pixels))
        asked = co.with_views(given, cameras=2, share=share)
        result = co.bound(asked, method)
        assert co.verify(asked, result.certificate).bound == pytest.approx(result.bound)


def best_kept(problem: Problem, verdicts: dict[Plan, Verdict]) -> float:
    """J of the best plan that obeys the rules and keeps the share, by the referee's verdicts."""
    valid = [plan for plan, verdict in verdicts.items() if verdict.valid]
    return max((verdicts[plan].reward for plan in valid if keeps(problem, plan)), default=-math.inf)


def keeps(problem: Problem, plan: Plan) -> bool:
    """A plan keeps the share, and nothing is said of it."""
    assert keeps_share(problem, plan) == (not missed_share(problem, plan))
    return keeps_share(problem, plan)


@pytest.fixture(scope="module")
def proved() -> tuple[Problem, co.CertifiedResult]:
    """A share that the scene's own weight misses, and the best plan that keeps it."""
    asked = co.with_views(crossroads(), cameras=1, weight=1.0, share=0.6)
    result = co.solve(asked)
    assert result.certificate is not None
    return asked, result


def test_a_proof_has_the_multiplier_of_the_share(
    proved: tuple[Problem, co.CertifiedResult],
) -> None:
    """3.6 of six views are asked for, and so four; the bound is on J and more weight of views."""
    asked, result = proved
    assert result.plan is not None and result.certificate is not None
    objective = result.certificate.objective
    assert not isinstance(objective, UnsetType) and objective.views is not None
    multiplier = result.statistics["multiplier of the share"]
    assert multiplier > 0 and objective.views.weight == 1.0 + multiplier
    assert result.bound == pytest.approx(result.certificate.proved - 4 * multiplier)
    assert result.value == check(asked, result.plan).reward <= result.bound
    verified = co.verify(asked, result)
    assert (verified.reward, verified.bound) == (result.value, result.bound)
    assert verified.gap == result.gap and verified.is_optimal
    explained = co.explain(asked, result)
    assert explained.attrs["bound"] > result.bound
    assert explained.amount.sum() == pytest.approx(explained.attrs["difference"], abs=1e-9)


@pytest.mark.parametrize(
    "change",
    [
        {"pixels": 0.5}, {"stationarity": 1.0}, {"views": None}, {"views": {"cameras": 2}},
        {"views": {"at_least": 0.5}}, {"views": {"weight": 0.5}}, {"views": {"weight": [1.0]}},
    ],
)  # fmt: skip
def test_an_altered_objective_is_refused(
    change: dict[str, Any], proved: tuple[Problem, co.CertifiedResult]
) -> None:
    """Its digest tells; with that of the altered objective its numbers prove less, or no share."""
    asked, result = proved
    file = result.certificate
    assert file is not None and not isinstance(file.objective, UnsetType)
    content = msgspec.to_builtins(file.objective)
    views = change.get("views")
    content |= change if views is None else {"views": content["views"] | views}
    altered = file.with_objective(msgspec.convert(content, Objective))
    with pytest.raises(co.CertificateError, match=r"digest|objective"):
        co.verify(asked, altered)
    with suppress(co.CertificateError):
        digest = problem_digest(altered.problem_of(asked))
        verified = co.verify(asked, msgspec.structs.replace(altered, digest=digest))
        assert verified.bound >= result.value


def test_a_plan_below_the_share_has_no_gap_to_its_bound(
    proved: tuple[Problem, co.CertifiedResult],
) -> None:
    """It may have more J than all plans that keep the share: that contradicts nothing."""
    asked, result = proved
    views = asked.objective.views
    assert views is not None
    alone = asked.replace(objective=asked.objective.replace(views=views.replace(share=None)))
    plan = co.plan(alone).plan
    assert plan is not None and not keeps(asked, plan)
    verified = co.verify(asked, plan, result.certificate)
    assert verified.reward > verified.bound and verified.gap == math.inf
