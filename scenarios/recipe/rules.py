"""The table of a recipe that says how far drones keep from each other."""

from cocap_opt.problem import SEPARATION, CollisionRules
from cocap_opt.scenarios.tables import Size, Table


class RulesTable(Table):
    """The collision rules of a scene that is to be flown: drones are never nearer than that."""

    vertex: bool = True
    swap: bool = True
    separation: Size | None = None  # m; None: SEPARATION, if drones may not share a cell
    vertical: Size = 0.0  # m

    def rules(self) -> CollisionRules:
        """Returns the collision rules."""
        separation = self.separation
        if separation is None:
            separation = SEPARATION if self.vertex else 0.0
        return CollisionRules(self.vertex, self.swap, separation, self.vertical)
