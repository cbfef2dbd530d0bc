"""Searches for plans guided by a mixture: roundings, best responses over few states,
neighbourhoods.

The prices of a mixture indicate promising states; best responses over these take a millisecond or
two. Repeatedly, the best of some random roundings of all known columns (`column_pool`) is selected:
its robots respond to each other until none gains, and a short large neighbourhood search continues
from there. The columns of each plan that is found join the pool, so roundings combine parts of good
plans.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np

from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath
from cocap_opt.coordination.neighbourhoods import neighbourhood_search
from cocap_opt.coordination.responses import Responses, in_rounds
from cocap_opt.coordination.restricted_value_iteration import RestrictedValueIteration
from cocap_opt.data import FloatArray
from cocap_opt.mixtures.column_pool import ColumnPool, LocalOptimum, PlanKey
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.parameters import PlanSearchParameters
from cocap_opt.model import Model
from cocap_opt.stop import Stop


def team_of(model: Model, columns: Iterable[Column]) -> PlannedTeam:
    """Returns the team that flies one column per robot, in the robots' order."""
    found = []
    for column in columns:
        column.add_to(pixels := model.problem.no_pixels())
        found.append(SingleRobotPath(column.path, pixels, 0))
    return PlannedTeam(model, tuple(found))


def columns_of(team: PlannedTeam) -> list[Column]:
    """Returns the columns of a whole team."""
    return [Column.of(team.model, robot, path) for robot, path in enumerate(team.paths)]


def tell_nobody(*_: object) -> None:
    """Ignores its arguments."""


class PlanSearch:
    """Searches for plans with a pool of columns.

    Parameters
    ----------
    model : a model in which every robot has a path
    stop : stopping criterion
    rng : random generator of roundings and neighbourhoods
    parameters : parameters of the search
    tell : called with the columns of each plan in which the search from a start ends
    """

    def __init__(
        self,
        model: Model,
        stop: Stop,
        rng: np.random.Generator,
        parameters: PlanSearchParameters,
        tell: Callable[[Sequence[Column]], None] = tell_nobody,
    ) -> None:
        self._model, self._stop, self._rng, self._parameters = model, stop, rng, parameters
        self._tell = tell
        self._pool, self._taken_up = ColumnPool(model), set[PlanKey]()
        self._known = [
            np.zeros((model.problem.horizon + 1, c.graph.n_states), dtype=np.bool_)
            for c in model.classes
        ]

    def add_mixture(self, mixture: Mixture) -> None:
        """Adds the columns of a mixture to the pool, with their amounts."""
        for column, amount in mixture.used(self._parameters.least_amount):
            self._add(column, amount)

    def add_team(self, team: PlannedTeam) -> None:
        """Adds the columns of a whole team to the pool."""
        self._add_plan(columns_of(team))

    def _add_plan(self, columns: Sequence[Column]) -> None:
        for column in columns:
            self._add(column, self._parameters.found_amount)

    def _add(self, column: Column, amount: float) -> None:
        self._pool.add(column, amount)
        path = column.path
        self._known[column.along.class_number][np.arange(len(path)), list(path)] = True

    def better_teams(
        self,
        team: PlannedTeam,
        rewards: Sequence[FloatArray],
        most_starts: float = math.inf,
        is_searched: bool = False,
    ) -> Iterator[PlannedTeam]:
        """Yields each team that is better than a given whole team, until the search makes no more
        progress.

        Parameters
        ----------
        rewards : for each class, the rewards of its states [T+1, S], which indicate promising
            states
        most_starts : number of plans after whose improvement the search ends, in any case
        is_searched : True: the search from this team has ended before, so it begins with a rounding

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        parameters = self._parameters
        low_level = RestrictedValueIteration.at_rewards(
            team, rewards, self._known, self._stop, parameters.width
        )
        responses, in_vain, starts = Responses(low_level, self._stop), 0, 0
        start = (self._drawn() or team) if is_searched else team
        while in_vain < parameters.most_in_vain and starts < most_starts:
            in_vain, starts, found = in_vain + 1, starts + 1, start
            for better in self._improved(found, responses):
                found = better
                if found.gains_over(team):
                    team, in_vain = found, 0
                    yield team
            self._taken_up.add(found.paths)
            columns = columns_of(found)
            self._add_plan(columns)
            self._tell(columns)
            start = self._drawn() or team

    def _improved(self, team: PlannedTeam, responses: Responses) -> Iterator[PlannedTeam]:
        """Yields a team, and each better team that responses and neighbourhoods lead to."""
        yield team
        for better in in_rounds(team, responses):
            yield (team := better)
        asked = responses.asked + self._parameters.responses * team.size
        yield from neighbourhood_search(team, responses, asked, self._rng)

    def _drawn(self) -> PlannedTeam | None:
        """Returns the best of some roundings that has not been used yet; None if there is none."""
        best: LocalOptimum | None = None
        for found in self._pool.drawn(self._rng, self._parameters.draws):
            self._stop.check()
            key = tuple(column.path for column in found[1])
            if key not in self._taken_up and (best is None or found[0] > best[0]):
                best = found
        if best is None:
            return None
        self._taken_up.add(tuple(column.path for column in best[1]))
        return team_of(self._model, best[1])
