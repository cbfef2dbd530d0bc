"""Searches where prices point: they only gain, and come to the optimum of small scenes."""

from itertools import islice

import numpy as np
import pytest
from brute_force import optimum
from counting import either
from hypothesis import assume, given, reject
from pool import meetings, problems
from strategies import examples
from test_compositions import Asked

from cocap_opt.coordination.low_level import PlannedTeam
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture_ascent import MixtureProgram, mixture_ascent
from cocap_opt.mixtures.parameters import AscentParameters, PlanSearchParameters
from cocap_opt.mixtures.plan_search import PlanSearch, team_of
from cocap_opt.mixtures.prices import PricedViews, Prices
from cocap_opt.model import compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.planners.cocap_lns import cocap_lns
from cocap_opt.planners.cocap_prices import cocap_prices
from cocap_opt.planners.sequential import sequential_rounds
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, TimeLimit, never


def first_mixture(problem: Problem, steps: int = 3) -> tuple[PlannedTeam, PlanSearch, PricedViews]:
    """A team planned in rounds, and a search that knows the columns of a mixture."""
    model, plan = compiled(problem), sequential_rounds(problem).plan
    if plan is None:
        reject()
    model.prepare_all()
    views = PricedViews(model)
    first = views.priced(Prices.alone(problem))
    raised = mixture_ascent(model, views.priced, first, never, AscentParameters())
    mixture, *_ = list(islice(raised, steps))[-1]
    rng = np.random.default_rng(0)
    search = PlanSearch(model, never, rng, PlanSearchParameters(most_in_vain=3))
    search.add_mixture(mixture)
    columns = (Column.of(model, robot, path) for robot, path in enumerate(model.paths(plan)))
    team = team_of(model, columns)
    search.add_team(team)
    return team, search, views


@examples(10)
@given(problem=either(meetings(team=3)))
def test_each_team_is_better_and_obeys_the_rules(problem: Problem) -> None:
    """With roots and with counts; the search ends, however little there is to find."""
    team, search, views = first_mixture(problem)
    before = team.value
    for better in search.better_teams(team, views.rewards(Prices.alone(problem))):
        verdict = check(problem, better.model.plan(better.paths))
        assert verdict.valid
        assert not verdict.conflicts
        assert verdict.reward == pytest.approx(better.value, rel=1e-9)
        assert better.value > before
        before = better.value


def test_it_finds_better_teams() -> None:
    """Where a plan in rounds leaves much to gain."""
    problem = load_scene("bottleneck", 0).until(6)
    team, search, views = first_mixture(problem)
    better = list(search.better_teams(team, views.rewards(Prices.alone(problem))))
    assert better[-1].value > 1.001 * team.value


@examples(10)
@given(problem=either(problems()))
def test_no_mixture_has_more_than_prices_say(problem: Problem) -> None:
    """The bound at a mixture's prices is above its value; columns are the best at them."""
    model = compiled(problem)
    model.prepare_all()
    views = PricedViews(model)
    first = views.priced(Prices.alone(problem))
    assume(len(first.columns) == len(problem.robots))
    raised = mixture_ascent(model, views.priced, first, never, AscentParameters())
    for mixture, value, priced in islice(raised, 3):
        assert priced.bound >= value * (1 - 1e-9) - 1e-9
        program = MixtureProgram(model, [*mixture.columns, *priced.columns])
        worth = program.priced(*priced.prices)
        for column, best in zip(priced.columns, worth[len(mixture.columns) :], strict=True):
            others = [worth[k] for k, c in enumerate(mixture.columns) if c.robot == column.robot]
            if not problem.objective.over_time:  # where roots of sums are less than sums of roots
                assert best >= max(others) - 1e-9 * (1 + abs(best))


@examples(12)
@given(problem=meetings(team=3))
def test_it_goes_on_from_rounds(problem: Problem) -> None:
    """The plan is no worse than that of sequential planning in rounds."""
    result = cocap_prices(problem)
    assert result.value >= sequential_rounds(problem).value * (1 - 1e-9)
    assert result.reason in (Reason.FINISHED, Reason.INFEASIBLE)


@pytest.mark.long
@examples(12)
@given(problem=meetings(team=2))
def test_it_is_no_worse_than_the_plan_that_it_starts_from(problem: Problem) -> None:
    """Also where a limit stops it at once; a plan that breaks a rule is left aside."""
    best = optimum(problem).plan
    if best is None:
        reject()
    for stop in (never, TimeLimit(0)):
        result = cocap_prices(problem, stop, best)
        assert result.value >= check(problem, best).reward * (1 - 1e-9)
    clash = Plan(paths=(best.paths[0],) * 2)
    assume(not check(problem, clash).valid)
    assert cocap_prices(problem, never, clash).value == cocap_prices(problem).value


@pytest.mark.long
@pytest.mark.parametrize(
    ("scene", "steps"),
    [
        ("corridor-tight", 8),
        ("bottleneck", 11),
        ("field", 5),
        pytest.param("field", 20, marks=pytest.mark.long(seconds=10)),
    ],
)
def test_it_finds_more_than_neighbourhoods_alone(scene: str, steps: int) -> None:
    """It is never behind on these scenes, and says that its last search found none."""
    gains = []
    for seed in range(2):
        problem = load_scene(scene, seed).until(steps)
        result = cocap_prices(problem)
        assert "its last search found no better plan" in result.message
        assert result.statistics["searches"] >= 2
        gains.append(result.value / cocap_lns(problem).value - 1)
    assert min(gains) > -1e-9
    assert scene != "field" or max(gains) > 1e-3


@pytest.mark.long
def test_a_limit_leaves_the_best_plan_so_far() -> None:
    """The search is anytime: stopped later it is better, and never worse than the first plan."""
    problem, values = load_scene("bottleneck", 0), []
    for calls in (400, 1_000, 2_000):
        result = cocap_prices(problem, Asked(calls))
        assert result.limit is Limit.TIME
        assert result.plan is not None
        assert not check(problem, result.plan).conflicts
        values.append(result.value)
    assert values == sorted(values)
    first = PLANNERS["sequential"](problem, never).value
    assert values[0] >= first
    assert values[-1] > first


def test_a_drone_alone_needs_no_prices() -> None:
    """Its first best response is the optimum."""
    result = PLANNERS["cocap-prices"](load_scene("tiny-approach", 0), never)
    assert result.statistics["searches"] == 0
    assert result.reason is Reason.FINISHED
