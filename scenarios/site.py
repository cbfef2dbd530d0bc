"""A scene that is examined before its drones have places."""

from typing import NamedTuple

from cocap_opt.problem import Motion, Problem
from cocap_opt.problem.refusals import Refusal
from cocap_opt.problem.scene import SceneData


class Site(NamedTuple):
    """A recipe that is examined before all of its drones have places.

    Attributes
    ----------
    problem : None if drones are missing, or have no place
    scene : the unchecked scene, with the drones whose places are known
    motions : motions of the drones; the default motion if there are none
    refusals : rejected starts, named as in the recipe
    starts : the recipe's field of each drone's start
    notes : why the drones of some tables have no place, in words
    """

    problem: Problem | None
    scene: SceneData
    motions: tuple[Motion, ...]
    refusals: tuple[Refusal, ...]
    starts: tuple[str, ...]
    notes: tuple[str, ...]

    @property
    def words(self) -> list[str]:
        """A line for each rejected start, and for each table without places."""
        refused = [f"{self.starts[found.robot]}: {self.why(found)}" for found in self.refusals]
        return [*refused, *self.notes]

    def why(self, refusal: Refusal) -> str:
        """Returns why a start is rejected, and the nearest free place."""
        return f"{refusal.why}; {refusal.way_out(self.scene)}"
