"""The restricted master problem: the best mixture of the paths found so far.

Columns are single-robot paths. The master takes their arcs, so that paths of one class of
robots that meet in a state may be recombined there: an aggregated flow with one unit from
each start over the union of all paths. (Column generation for extended formulations: Sadykov
and Vanderbeck 2013. With long horizons it needs far fewer columns than mixtures of entire
paths.) Its conic program is in `master_program`; any non-negative multipliers of its rows are a
certificate.
"""

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.column_generation.master.columns import Arc, Column
from cocap_opt.formulations.column_generation.master.master_program import MasterProgram
from cocap_opt.formulations.column_generation.master.mixture import LEAST_USE, Mixture, flow_mixture
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop, never

BEST_ACCURACY = 1e-8
_LEAST_SHARE = 1e-6  # of a cut in a solution, from which on it is kept


class Solution(NamedTuple):
    """An optimal mixture and its multipliers."""

    value: float  # of the master
    mixture: Mixture  # of the paths that the flow splits into
    slack: float  # robots by which conflict rows and decisions are broken, at the penalty's price
    duals: Duals
    is_solved: bool  # the solver says so, be it with reduced accuracy


class Master:
    """A restricted master problem; rows that its mixture breaks are added later.

    Attributes
    ----------
    penalty : cost of a broken conflict row or decision, so that there is always a solution
    """

    def __init__(self, model: Model, penalty: float, decisions: tuple[Decision, ...] = ()) -> None:
        self.model = model
        self.penalty = penalty
        self.decisions = decisions
        self._columns: dict[tuple[int, Path], Column] = {}
        self._pool = _ArcPool()
        self._rows: list[Resource] = []
        self._cuts: list[Cut] = []

    @property
    def columns(self) -> list[Column]:
        """Paths whose arcs are all in the master."""
        return list(self._columns.values())

    @property
    def rows(self) -> tuple[Resource, ...]:
        """Resources of the conflict rows."""
        return tuple(self._rows)

    @property
    def cuts(self) -> tuple[Cut, ...]:
        """The envelope cuts."""
        return tuple(self._cuts)

    @property
    def arcs(self) -> Collection[Arc]:
        """The arcs of all paths."""
        return self._pool.arcs

    def add(self, column: Column) -> bool:
        """Adds a path; returns False if it brings no new arc or a decision closes it."""
        if column.key in self._columns:
            return False
        closed = (decision.resource for decision in self.decisions if decision.closes)
        if any(resource.used_by(self.model, column.along) for resource in closed):
            return False
        self._columns[column.key] = column
        return self._pool.add(column.arcs) > 0

    def add_row(self, resource: Resource) -> bool:
        """Adds a conflict row; returns False if it is there already."""
        if resource in self._rows:
            return False
        self._rows.append(resource)
        return True

    def add_cut(self, cut: Cut) -> None:
        """Adds an envelope cut."""
        self._cuts.append(cut)

    def add_all(
        self, columns: Iterable[Column], rows: Iterable[Resource], cuts: Iterable[Cut]
    ) -> None:
        """Adds columns, conflict rows and cuts, as another master has them."""
        for column in columns:
            self.add(column)
        for resource in rows:
            self.add_row(resource)
        for cut in cuts:
            self.add_cut(cut)

    def drop_cuts(self, duals: Duals) -> None:
        """Drops the cuts that have no share in a solution."""
        self._cuts = [cut for cut, share in duals.cuts if share > _LEAST_SHARE]

    def drop_idle(self, most_idle: int) -> None:
        """Drops the arcs that none of the last solves has used, and the paths over them."""
        if self._pool.drop_idle(self.model, most_idle):
            kept = [c for c in self._columns.values() if self._pool.has_all(c.arcs)]
            self._columns = {column.key: column for column in kept}

    def used_columns(self, most_idle: int) -> list[Column]:
        """Returns the paths all of whose arcs one of the last solves has used."""
        columns = self._columns.values()
        return [column for column in columns if self._pool.has_fresh(column.arcs, most_idle)]

    def solve(self, stop: Stop = never, accuracy: float = BEST_ACCURACY) -> Solution:
        """Solves to a relative accuracy of the value, or to what a stop leaves time for."""
        arcs = list(self.arcs)
        open_ = [decision for decision in self.decisions if not decision.closes]
        program = MasterProgram(self.model, arcs, self._rows, open_, self._cuts, self.penalty)
        solved = program.solve(stop, accuracy)
        self._pool.note_flow(solved.flow)
        flow = dict(zip(arcs, solved.flow.tolist(), strict=True))
        return Solution(
            solved.value,
            flow_mixture(self.model, flow, self._columns),
            solved.slack,
            replace(solved.duals, decisions=self._all_decisions(solved.duals.decisions)),
            solved.is_solved,
        )

    def _all_decisions(self, multipliers: FloatArray) -> FloatArray:
        """Returns multipliers of all decisions; those that close a resource need none."""
        result = np.zeros(len(self.decisions))
        result[[not decision.closes for decision in self.decisions]] = multipliers
        return result


class _ArcPool:
    """The arcs of a master, numbered, and the number of solves for which each has been idle."""

    def __init__(self) -> None:
        self._numbers: dict[Arc, int] = {}
        self._idle = np.zeros(0, dtype=np.int64)

    @property
    def arcs(self) -> Collection[Arc]:
        """The arcs in the order of their numbers."""
        return self._numbers.keys()

    def add(self, arcs: Iterable[Arc]) -> int:
        """Adds arcs, and returns how many of them are new."""
        before = len(self._numbers)
        for arc in arcs:
            self._numbers.setdefault(arc, len(self._numbers))
        new = len(self._numbers) - before
        self._idle = np.append(self._idle, np.zeros(new, dtype=np.int64))
        return new

    def note_flow(self, flow: FloatArray) -> None:
        """Counts one more solve in which the arcs had this flow [n]."""
        self._idle = np.where(flow > LEAST_USE, 0, self._idle + 1)

    def has_fresh(self, arcs: Iterable[Arc], most_idle: int) -> bool:
        """Returns True if each of the arcs was used in one of the last `most_idle` solves."""
        return all(self._idle[self._numbers[arc]] <= most_idle for arc in arcs)

    def has_all(self, arcs: Iterable[Arc]) -> bool:
        """Returns True if all these arcs are in the pool."""
        return all(arc in self._numbers for arc in arcs)

    def drop_idle(self, model: Model, most_idle: int) -> bool:
        """Drops arcs idle for more than `most_idle` solves, and those that lead nowhere then.

        Returns
        -------
        False if nothing was idle for so long.
        """
        if (self._idle <= most_idle).all():
            return False
        idle = dict(zip(self._numbers, self._idle.tolist(), strict=True))
        fresh = [arc for arc, n in idle.items() if n <= most_idle]
        starts = {
            (number, start)
            for number, robot_class in enumerate(model.classes)
            for start in robot_class.starts
        }
        on = Arc.states_on_paths(fresh, starts, model.problem.horizon)
        arcs = [arc for arc in fresh if arc.leaves in on[arc.t] and arc.enters in on[arc.t + 1]]
        self._numbers = {arc: n for n, arc in enumerate(arcs)}
        self._idle = np.array([idle[arc] for arc in arcs], dtype=np.int64)
        return True
