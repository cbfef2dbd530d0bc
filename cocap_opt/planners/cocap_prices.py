"""Searches for plans guided by prices, starting from a plan made drone by drone.

A mixture assigns each drone several paths with weights. Finding the best mixture without rules is a
concave program, and mixture ascent comes near its optimum within dozens of steps. Its prices
indicate the value of a view if the other drones fly well, and its paths are parts of good plans
(`mixtures.plan_search`). Each time the search makes no more progress, the mixture is improved with
twice as many steps, and the search continues with the new paths and prices, until this gains
nothing or a maximum number of rounds is reached. Each search ends with rounds of best responses
over all states. A given plan replaces the first one, made drone by drone, if it obeys the rules.

Source: the restricted master heuristics of column generation, Joncour et al. 2010; here the mixture
is improved without a linear program.
"""

from collections.abc import Iterator

import numpy as np

from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath, value_iteration
from cocap_opt.coordination.responses import Responses, followed, in_rounds, one_by_one
from cocap_opt.mixtures.mixture_ascent import is_slow, mixture_ascent
from cocap_opt.mixtures.parameters import AscentParameters, PlanSearchParameters
from cocap_opt.mixtures.plan_search import PlanSearch
from cocap_opt.mixtures.prices import PricedViews, Prices
from cocap_opt.planners.cocap import EXHAUSTED
from cocap_opt.planners.cocap_lns import first_plan
from cocap_opt.planners.results import hovering, result_of, with_message
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Stop, never
from cocap_opt.timing import timed

# Measured on `field`, `field-long` and scenes of Hughes et al.: with 0.02, long scenes lose 0.15 %
# of J after ten seconds.
# relative to the bound on mixtures: gap at which the ascent of the first mixture ends
_ENOUGH = 0.01
# The ascent also ends when it is slow: when so many steps leave so large a share of the gap.
_PATIENCE, _SLOW = 8, 0.8
_MOST_SEARCHES = 8

_STANDS_STILL = "it stopped by itself: its last search found no better plan"


@timed
def cocap_prices(problem: Problem, stop: Stop = never, start: Plan | None = None) -> Result:
    """Plan each robot in turn, as `sequential` does, then search guided by prices of mixtures.

    If sequential planning fails, the constraint tree takes over, as in `cocap_lns`.

    Parameters
    ----------
    start : a plan to start from; the result is no worse. It is ignored if it cannot be flown here
        or breaks a rule

    Returns
    -------
    Result
        A plan that no robot can improve by changing its own path alone, or, if a limit was reached,
        the best plan so far. `statistics` holds the numbers of `responses` over all states, of
        `mixtures` and of `searches`; `message` says whether the planner stopped making progress.
    """
    learning = _Learning(Responses(value_iteration, stop), stop)
    nobody = learning.responses.nobody(problem)
    begin = None if start is None or not check(problem, start).valid else start
    team, limit = followed(nobody, learning.better_and_better(nobody, begin))
    if limit is None and not team.is_whole:
        return Result.without_plan(Reason.INFEASIBLE, EXHAUSTED)
    result = result_of(hovering(team), limit, learning.statistics)
    if limit is None and learning.stands_still:
        return with_message(result, _STANDS_STILL)
    return result


class _Learning:
    """A plan that is improved with the prices and paths of mixtures.

    Attributes
    ----------
    responses : number of responses over all states
    searches : number of searches begun
    stands_still : True if the last search gained nothing, even after the mixture was improved again
    """

    def __init__(self, responses: Responses, stop: Stop) -> None:
        self.responses, self._stop = responses, stop
        self.searches = self._mixtures = 0
        self.stands_still = False

    @property
    def statistics(self) -> dict[str, float]:
        """Counts of responses, mixtures and searches so far."""
        asked = self.responses.asked
        return {"responses": asked, "mixtures": self._mixtures, "searches": self.searches}

    def better_and_better(
        self, nobody: PlannedTeam, start: Plan | None = None
    ) -> Iterator[PlannedTeam]:
        """Yields the team while it is planned, or the given start, and then each better team."""
        team, first = nobody, first_plan(nobody, self.responses, self._stop, one_by_one)
        if start is not None:
            first = self._from(nobody, start)
        for team in first:
            yield team
        if team.is_whole and team.size > 1:
            yield from self._searched(team)

    def _from(self, nobody: PlannedTeam, start: Plan) -> Iterator[PlannedTeam]:
        """Yields the team that flies a plan, and then the team after each best response that
        gains.
        """
        model, team = nobody.model, nobody
        for robot, path in enumerate(model.paths(start)):
            team = team.with_path(robot, SingleRobotPath.of(model, robot, path))
        yield team
        yield from in_rounds(team, self.responses)

    def _searched(self, team: PlannedTeam) -> Iterator[PlannedTeam]:
        """Yields each better team, until searches make no more progress."""
        model = team.model
        views = PricedViews(model, self._stop)
        rng = np.random.default_rng(0)
        search = PlanSearch(model, self._stop, rng, PlanSearchParameters())
        search.add_team(team)
        best = first = views.priced(Prices.alone(model.problem))
        raised = mixture_ascent(model, views.priced, first, self._stop, AscentParameters())
        open_, next_search = [np.inf], 0
        for mixture, value, priced in raised:
            self._mixtures += 1
            best = min(best, priced, key=lambda found: found.bound)
            open_.append(best.bound - value)
            is_near = open_[-1] <= _ENOUGH * best.bound or is_slow(open_, _PATIENCE, _SLOW)
            if self._mixtures < next_search or not (next_search or is_near):
                continue
            before, self.searches = team, self.searches + 1
            search.add_mixture(mixture)
            for better in search.better_teams(team, views.rewards(best.prices)):
                yield (team := better)
            for better in in_rounds(team, self.responses):
                yield (team := better)
            self.stands_still = self.searches > 1 and team is before
            if self.stands_still or self.searches == _MOST_SEARCHES:
                return
            next_search = 2 * self._mixtures
