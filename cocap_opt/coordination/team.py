"""A plan in progress: the paths of a team, found robot by robot.

Planners use it for the paths found so far, column generation for its best plan. Both compare plans
with `Team.gains_over`.
"""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Generic, Protocol, Self, TypeVar

from cocap_opt.coordination.best_response import avoid_paths
from cocap_opt.data import FloatArray
from cocap_opt.graph.charges import Charges
from cocap_opt.model import Model, Path
from cocap_opt.objective import objective
from cocap_opt.problem import Cell, Conflict

# Relative. J is a sum of thousands of roots, each accurate to 1e-16: smaller differences do not
# count as gains, otherwise rounds of best responses might never end.
_LEAST_GAIN = 1e-12


class _FoundPath(Protocol):
    """A path of one robot and its view sums, as a planner or column generation stores it."""

    @property
    def path(self) -> Path | None:
        """State numbers at steps 0..T; None if the robot has no path."""

    def add_to(self, pixels: FloatArray) -> None:
        """Adds the view sums along this path to view sums [Z]."""


P = TypeVar("P", bound=_FoundPath)


@dataclass(frozen=True)
class Team(Generic[P]):
    """Paths found so far and their pixels, robot by robot.

    Attributes
    ----------
    found : [R] the path of each robot; None if it is not planned yet
    """

    model: Model
    found: tuple[P | None, ...]

    @classmethod
    def nobody(cls, model: Model) -> Self:
        """Returns a team in which no robot is planned."""
        return cls(model, (None,) * len(model.problem.robots))

    @property
    def size(self) -> int:
        """R, the number of robots, planned or not."""
        return len(self.found)

    @property
    def is_whole(self) -> bool:
        """True if every robot has a path."""
        return all(single is not None and single.path is not None for single in self.found)

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of all robots, which must all have been found."""
        return tuple(single.path for single in self.found if single is not None and single.path)

    def path(self, robot: int) -> Path:
        """Returns a robot's path, which must have been found."""
        single = self.found[robot]
        return () if single is None else single.path or ()

    def cells(self, robot: int) -> tuple[Cell, ...]:
        """Returns the cells of a robot's path, which must have been found."""
        return self.model.places.cells_along(robot, self.path(robot))

    def pixels(self, without: int | None = None) -> FloatArray:
        """Returns the view sums [Z] of all planned robots, or of all but one."""
        pixels = self.model.problem.no_pixels()
        for i, single in enumerate(self.found):
            if i != without and single is not None:
                single.add_to(pixels)
        return pixels

    def avoiding(self, robot: int, waiting: Iterable[int] = ()) -> Charges:
        """Returns charges that keep a robot clear of the paths of all other planned robots.

        Parameters
        ----------
        waiting : further robots, which stay at their first starts all the time
        """
        problem = self.model.problem
        paths = [self.cells(i) for i in range(self.size) if i != robot and self.found[i]]
        starts = (problem.cell(i, problem.first_starts[i]) for i in waiting)
        paths += [(cell,) * (problem.horizon + 1) for cell in starts]
        return avoid_paths(self.model, self.model.class_of[robot], paths)

    @cached_property
    def value(self) -> float:
        """J."""
        return objective(self.model, self.paths, self.pixels())

    @cached_property
    def conflicts(self) -> tuple[Conflict, ...]:
        """Conflicts of the whole team, earliest step first."""
        return tuple(self._conflicts())

    @property
    def obeys_the_rules(self) -> bool:
        """True if the whole team has no conflicts."""
        return next(self._conflicts(), None) is None

    def _conflicts(self) -> Iterator[Conflict]:
        return self.model.plan(self.paths).conflicts(self.model.problem)

    def with_path(self, robot: int, single: P | None) -> Self:
        """Returns the team with a new path for one robot; None: with no path."""
        return replace(self, found=(*self.found[:robot], single, *self.found[robot + 1 :]))

    def without(self, robots: Collection[int]) -> Self:
        """Returns the team in which the given robots are not planned."""
        found = (None if i in robots else single for i, single in enumerate(self.found))
        return replace(self, found=tuple(found))

    def gains_over(self, other: "Team[P]") -> bool:
        """Returns True if J exceeds another team's J by more than rounding."""
        return self.value > other.value * (1 + _LEAST_GAIN)
