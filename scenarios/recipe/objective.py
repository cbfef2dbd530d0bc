"""The objective of a recipe, in which the weight of views may be left out."""

from collections.abc import Sequence

from cocap_opt.problem import Actor, Objective, Robot, Views
from cocap_opt.scenarios.tables import Table
from cocap_opt.scenarios.text import naming
from cocap_opt.vision.default_weights import default_weights


class ViewsTable(Table):
    """The table `views` of the objective, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    cameras: int = 2
    weight: float | tuple[float, ...] | None = None  # None: each person's default
    at_least: float = 0.3

    def views(
        self, actors: Sequence[Actor], factors: Sequence[float], robots: Sequence[Robot]
    ) -> Views:
        """Returns the views, with a number for each person.

        Parameters
        ----------
        actors, factors : the people [A], and the factor of each one's weight
        robots : whose cameras the default is computed of

        Raises
        ------
        ProblemError
            If a number is out of range, there are not as many as people, or there is no default.
        """
        weight = default_weights(actors, robots) if self.weight is None else self.weight
        # Each number is checked before it is multiplied, under the name that the recipe has.
        given = Views(cameras=self.cameras, weight=weight, at_least=self.at_least)
        given.require_for(len(actors))
        weights = given.weights(len(actors))
        return given.replace(weight=tuple(w * f for w, f in zip(weights, factors, strict=True)))


class ObjectiveTable(Table):
    """The table `objective` of a recipe, see `cocap_opt.scenarios.recipe.EXAMPLE`."""

    pixels: float = 1.0
    views: ViewsTable | None = None
    stationarity: float = 0.0
    keep_cell: float = 0.0
    keep_heading: float = 0.0
    balanced: float = 0.0
    count_start: bool = False
    over_time: bool = False

    def objective(
        self, actors: Sequence[Actor], factors: Sequence[float | None], robots: Sequence[Robot]
    ) -> Objective:
        """Returns the objective, which holds numbers only.

        Parameters
        ----------
        actors : the people [A]
        factors : of each one's weight in `views`; None: 1
        robots : the drones

        Raises
        ------
        ProblemError
            If something is out of range; the message names the field.
        """
        plain = {name: getattr(self, name) for name in self.__struct_fields__ if name != "views"}
        objective = Objective(**plain)
        if self.views is None:
            return objective
        with naming("views"):
            views = self.views.views(actors, [1.0 if f is None else f for f in factors], robots)
        return objective.replace(views=views)
