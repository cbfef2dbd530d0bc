"""A plan, and the conflicts between its robots."""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

import msgspec
import numpy as np

from cocap_opt.data import BoolArray
from cocap_opt.problem.motion import Cell, State
from cocap_opt.problem.problem import Problem
from cocap_opt.problem.starts import StartSet
from cocap_opt.stop import Limit, Reason
from cocap_opt.text import counted

NO_PLAN = "no plan"  # first words of the message for a plan in which nobody moves for lack of time


class VertexConflict(NamedTuple):
    """Two robots are in one cell, or closer than the separation, at step t.

    Attributes
    ----------
    t : step
    robots : their numbers, the lower first
    cells : their cells, in the order of `robots`
    """

    t: int
    robots: tuple[int, int]
    cells: tuple[Cell, Cell]


class PassConflict(NamedTuple):
    """Two robots pass each other closer than the separation between t and t+1, but obey it at both
    steps.

    Attributes
    ----------
    t : the step before
    robots : their numbers, the lower first
    moves : the cells that each robot leaves and enters, in the order of `robots`
    """

    t: int
    robots: tuple[int, int]
    moves: tuple[tuple[Cell, Cell], tuple[Cell, Cell]]


class SwapConflict(NamedTuple):
    """Two robots exchange cells between t and t+1.

    Attributes
    ----------
    t : the step before
    robots : their numbers, the lower first
    cells : the cells that they leave, in the order of `robots`
    """

    t: int
    robots: tuple[int, int]
    cells: tuple[Cell, Cell]

    @property
    def moves(self) -> tuple[tuple[Cell, Cell], tuple[Cell, Cell]]:
        """The moves of both robots."""
        return self.cells, self.cells[::-1]


Conflict = VertexConflict | SwapConflict | PassConflict


class Ending(NamedTuple):
    """The end of the search for a plan, as its result or its file records it.

    Attributes
    ----------
    reason : why it ended
    limit : the limit that stopped it; None if none did
    in_coverage : True if the limit was reached before coverage was complete
    told : the remark in the plan's file on how complete the plan was at the limit; empty without a
        file
    """

    reason: Reason
    limit: Limit | None = None
    in_coverage: bool = False
    told: str = ""

    def left_of(self, plan: "Plan") -> str:
        """Returns a message on how complete the plan was at the limit; empty without a limit.

        If all drones stay at their starts for lack of time, the message says that there is no plan.
        """
        if self.told or self.limit is None:
            return self.told
        is_interrupt = self.limit is Limit.INTERRUPT
        what = "interrupted" if is_interrupt else f"stopped by the {self.limit} limit"
        words = f"{what} during {'coverage' if self.in_coverage else 'the search'}"
        robots, staying = len(plan.paths), plan.staying
        if plan.stays:
            return f"{NO_PLAN}: {words}; all drones stay at their starts"
        still = f"; {staying} of {robots} drones stay at their starts" if staying else ""
        return f"cut short: {words}{still}"


class Plan(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, dict=True):
    """The paths of all robots.

    Attributes
    ----------
    paths : [R] paths of states [T+1]: `paths[i][t]` is the state of robot i at step t = 0..T
    """

    paths: tuple[tuple[State, ...], ...]

    @property
    def made_for(self) -> str:
        """Digest of the problem that the plan's file names; empty if it names none."""
        return str(vars(self).get("_made_for", ""))

    @property
    def scene(self) -> str:
        """Name of the problem that the plan's file names; empty if it names none."""
        return str(vars(self).get("_scene", ""))

    @property
    def ending(self) -> Ending | None:
        """The end of the search for the plan, as its file records it; None if unspecified."""
        ending: Ending | None = vars(self).get("_ending")
        return ending

    @property
    def cut_short(self) -> str:
        """The remark in the plan's file on how complete the plan was at a limit; empty if there is
        none.
        """
        return "" if self.ending is None else self.ending.left_of(self)

    def of_problem(self, digest: str, scene: str, ending: Ending | None = None) -> "Plan":
        """Returns an equal plan with the information from its file.

        Parameters
        ----------
        digest, scene : digest and name of the problem for which the plan was made
        ending : the end of the search for the plan
        """
        plan = Plan(paths=self.paths)
        # These are not fields, as they are not part of the flight.
        vars(plan).update(_made_for=digest, _scene=scene, _ending=ending)
        return plan

    def __repr__(self) -> str:
        steps = max(map(len, self.paths), default=1) - 1
        return f"Plan of {counted(len(self.paths), 'drone')} over {counted(steps, 'step')}"

    @property
    def stays(self) -> bool:
        """True if nobody moves or turns."""
        return self.staying == len(self.paths)

    @property
    def staying(self) -> int:
        """Number of drones that neither move nor turn."""
        return sum(len(set(path)) <= 1 for path in self.paths)

    @classmethod
    def hovering(cls, problem: Problem) -> "Plan | None":
        """Returns the plan in which no robot moves, which obeys all rules because starts do.

        Returns None if a robot may not stay because its goal is elsewhere or people come too close.
        """
        starts = problem.first_starts
        if not all(problem.may_hover(i, StartSet.of([state]))[0] for i, state in enumerate(starts)):
            return None
        return cls(paths=tuple((state,) * (problem.horizon + 1) for state in starts))

    def conflicts(self, problem: Problem) -> Iterator[Conflict]:
        """Yields all conflicts under the problem's rules, ordered by step, then by robots."""
        if problem.rules.none or len(self.paths) < 2:
            return
        cells = [[problem.cell(i, state) for state in path] for i, path in enumerate(self.paths)]
        first, second = np.array(list(combinations(range(len(cells)), 2))).T
        at = np.array([problem.positions(row) for row in cells])  # [R, T+1, 3] m
        moves = (at[first, :-1], at[first, 1:]), (at[second, :-1], at[second, 1:])
        near = problem.rules.too_near(at[second] - at[first])
        between = problem.rules.conflict_between(*moves)
        # For each step, first the robots that are too close at the step, then those that are so
        # before the next.
        for n, which in np.argwhere(_alternated(near, between).T).tolist():
            t, (i, k) = n // 2, (int(first[which]), int(second[which]))
            here = cells[i][t], cells[k][t]
            if n % 2 == 0:
                yield VertexConflict(t, (i, k), here)
                continue
            there = cells[i][t + 1], cells[k][t + 1]
            if problem.rules.swap and here == there[::-1]:
                yield SwapConflict(t, (i, k), here)
            else:
                yield PassConflict(t, (i, k), ((here[0], there[0]), (here[1], there[1])))


def _alternated(at: BoolArray, between: BoolArray) -> BoolArray:
    """Returns columns [n, 2 T + 1]: those at steps [n, T+1], alternating with those in between."""
    result = np.zeros((len(at), 2 * at.shape[1] - 1), dtype=np.bool_)
    result[:, ::2], result[:, 1::2] = at, between
    return result
