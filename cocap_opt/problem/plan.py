"""A plan, and the conflicts between its robots."""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import msgspec

from cocap_opt.problem.motion import Cell, State
from cocap_opt.problem.problem import Problem


class VertexConflict(NamedTuple):
    """Two robots are in one cell, or nearer than the separation, at step t."""

    t: int
    robots: tuple[int, int]
    cells: tuple[Cell, Cell]


class SwapConflict(NamedTuple):
    """Two robots exchange cells between t and t+1; `cells` are the ones that they leave."""

    t: int
    robots: tuple[int, int]
    cells: tuple[Cell, Cell]


Conflict = VertexConflict | SwapConflict


class Plan(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One path per robot: `paths[i][t]` is robot i's state at step t = 0..T."""

    paths: tuple[tuple[State, ...], ...]

    def __repr__(self) -> str:
        steps = max(map(len, self.paths), default=1) - 1
        return f"Plan of {len(self.paths)} drones over {steps} steps"

    @property
    def stays(self) -> bool:
        """True if nobody moves or turns."""
        return all(len(set(path)) <= 1 for path in self.paths)

    @classmethod
    def hovering(cls, problem: Problem) -> "Plan | None":
        """Returns the plan in which nobody moves, which obeys all rules, as starts do.

        None where a robot's goal is not its start.
        """
        if not all(robot.may_hover for robot in problem.robots):
            return None
        return cls(paths=tuple((r.start,) * (problem.horizon + 1) for r in problem.robots))

    def conflicts(self, problem: Problem) -> Iterator[Conflict]:
        """Yields all conflicts under the problem's rules, earliest step first, then by robots."""
        if problem.rules.none:
            return
        cells = [
            [problem.cell(i, state) for state in path] for i, path in enumerate(self.paths)
        ]  # [R][T+1]
        pairs = list(combinations(range(len(cells)), 2))
        for t in range(problem.horizon + 1):
            for i, k in pairs:
                here = cells[i][t], cells[k][t]
                if problem.too_close(*here):
                    yield VertexConflict(t, (i, k), here)
            if t < problem.horizon and problem.rules.swap:
                for i, k in pairs:
                    here, there = (cells[i][t], cells[k][t]), (cells[i][t + 1], cells[k][t + 1])
                    if here == there[::-1] and here[0] != here[1]:
                        yield SwapConflict(t, (i, k), here)
