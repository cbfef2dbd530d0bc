"""The objective of a recipe, in which the weight of views has a default."""

from collections.abc import Sequence
from typing import Literal

from cocap_opt.problem import Actor, Objective, Robot, Views
from cocap_opt.scenarios.tables import Table
from cocap_opt.scenarios.text import naming
from cocap_opt.vision.default_weights import FIRST, Weight, default_weights, weight_before_all


class ViewsTable(Table):
    """The table `views` of the objective, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    cameras: int = 2
    weight: Weight = None
    at_least: float = 0.3
    share: float | None = None

    def views(
        self, actors: Sequence[Actor], factors: Sequence[float], robots: Sequence[Robot],
        horizon: int, objective: Objective, chance: float,
    ) -> Views:  # fmt: skip
        """Returns the views, with a weight for each person.

        Parameters
        ----------
        actors, factors : the people [A], and the factor of each one's weight
        robots : the drones, from whose cameras weights are computed
        horizon, objective : T, and the objective without views
        chance : smallest probability of a take

        Raises
        ------
        ProblemError
            If a number is out of range, there is not one per person, or there is no default.
        """
        weight = self.weight
        if weight is None:
            weight = default_weights(actors, robots)
        elif weight == FIRST:
            weight = weight_before_all(actors, robots, horizon, objective, chance)
        # Each number is checked before it is multiplied, under its name in the recipe.
        given = Views(cameras=self.cameras, weight=weight, at_least=self.at_least, share=self.share)
        given.require_for(len(actors))
        weights = given.weights(len(actors))
        if self.weight == FIRST:  # the smallest factor leaves it unchanged
            least = min((factor for factor in factors if factor > 0), default=1.0)
            factors = [factor / min(least, 1.0) for factor in factors]
        return given.replace(weight=tuple(w * f for w, f in zip(weights, factors, strict=True)))


class ObjectiveTable(Table):
    """The table `objective` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    pixels: float = 1.0
    views: ViewsTable | Literal["first"] | None = None
    stationarity: float = 0.0
    keep_cell: float = 0.0
    keep_heading: float = 0.0
    balanced: float = 0.0
    count_start: bool = False
    over_time: bool = False

    def objective(
        self, actors: Sequence[Actor], factors: Sequence[float | None], robots: Sequence[Robot],
        horizon: int, chance: float = 1.0,
    ) -> Objective:  # fmt: skip
        """Returns the objective, which contains only numbers.

        Parameters
        ----------
        actors : the people [A]
        factors : factor of each person's weight in `views`; None: 1
        robots : the drones
        horizon : T
        chance : smallest probability of a take

        Raises
        ------
        ProblemError
            If a value is out of range; the message names the field.
        """
        plain = {name: getattr(self, name) for name in self.__struct_fields__ if name != "views"}
        objective = Objective(**plain)
        if self.views is None:
            return objective
        with naming("views"):
            table = ViewsTable(weight=FIRST) if self.views == FIRST else self.views
            views = table.views(
                actors,
                [1.0 if f is None else f for f in factors],
                robots,
                horizon,
                objective,
                chance,
            )
        return objective.replace(views=views)
