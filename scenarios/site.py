"""A scene that is looked at before its drones have places."""

from typing import NamedTuple

from cocap_opt.problem import Motion, Problem
from cocap_opt.problem.refusals import Refusal
from cocap_opt.problem.scene import SceneData


class Site(NamedTuple):
    """A recipe to look at before its drones have places: what is there, and who has no place.

    Attributes
    ----------
    problem : None if drones are missing, or have no place
    scene : the same, unchecked, of the drones that a place is known of
    motions : of the drones; that of drones of which nothing is said, if there are none
    refusals : starts in which drones may not be, in the recipe's words
    starts : what the recipe calls the start of each drone
    notes : of tables whose drones have no place, why, in words
    """

    problem: Problem | None
    scene: SceneData
    motions: tuple[Motion, ...]
    refusals: tuple[Refusal, ...]
    starts: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def words(self) -> list[str]:
        """A line for each start that is refused, and each table without places."""
        refused = [f"{self.starts[found.robot]}: {self.why(found)}" for found in self.refusals]
        return [*refused, *self.notes]

    def why(self, refusal: Refusal) -> str:
        """Returns why a start is refused, and the nearest free place."""
        return f"{refusal.why}; {refusal.way_out(self.scene)}"
