"""The restricted master problem: the best mixture of the paths found so far.

Columns are single-robot paths. The master uses their arcs, so that paths of robots of one class
that meet in a state may be recombined there: an aggregated flow with one unit from each start over
the union of all paths. (Column generation for extended formulations: Sadykov and Vanderbeck 2013.
With long horizons it needs far fewer columns than mixtures of entire paths.) Its conic program is
in `master_program`; any non-negative multipliers of its rows form a certificate.
"""

from collections.abc import Collection, Iterable

from cocap_opt.formulations.certificates import Decision
from cocap_opt.formulations.certificates.resources import Resource
from cocap_opt.formulations.certificates.state_cuts import AnyCut
from cocap_opt.formulations.column_generation.master.flow_paths import LEAST_USE
from cocap_opt.formulations.column_generation.master.master_program import MasterProgram, Solution
from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.model import Model, Path
from cocap_opt.stop import Stop, never

BEST_ACCURACY = 1e-8


class Master:
    """A restricted master problem; rows that its mixture violates are added later.

    Attributes
    ----------
    penalty : cost of violating a conflict row or decision, so that a solution always exists
    rows : resources of the conflict rows
    cuts : the envelope cuts
    """

    def __init__(self, model: Model, penalty: float, decisions: tuple[Decision, ...] = ()) -> None:
        self.model = model
        self.penalty = penalty
        self.decisions = decisions
        self.rows: list[Resource] = []
        self.cuts: list[AnyCut] = []
        self._columns: dict[tuple[int, Path], Column] = {}
        self._idle: dict[Arc, int] = {}  # number of solves since each arc was last used

    @property
    def columns(self) -> list[Column]:
        """Paths whose arcs are all in the master."""
        return list(self._columns.values())

    @property
    def arcs(self) -> Collection[Arc]:
        """The arcs of all paths."""
        return self._idle.keys()

    def add(self, column: Column) -> bool:
        """Adds a path; returns False if it adds no new arc or if a decision closes it."""
        if column.key in self._columns:
            return False
        closed = (decision.resource for decision in self.decisions if decision.closes)
        if any(resource.used_by(self.model, column.along) for resource in closed):
            return False
        self._columns[column.key] = column
        before = len(self._idle)
        for arc in column.arcs:
            self._idle.setdefault(arc, 0)
        return len(self._idle) > before

    def add_row(self, resource: Resource) -> bool:
        """Adds a conflict row; returns False if the row exists already."""
        if resource in self.rows:
            return False
        self.rows.append(resource)
        return True

    def add_all(
        self, columns: Iterable[Column], rows: Iterable[Resource], cuts: Iterable[AnyCut]
    ) -> None:
        """Adds columns, conflict rows and cuts of another master."""
        for column in columns:
            self.add(column)
        for resource in rows:
            self.add_row(resource)
        self.cuts.extend(cuts)

    def drop_idle(self, most_idle: int) -> None:
        """Drops the arcs that the last solves have not used, and the paths over them.

        Arcs that then lead nowhere are dropped, too.
        """
        fresh = [arc for arc, solves in self._idle.items() if solves <= most_idle]
        if len(fresh) == len(self._idle):
            return
        starts = {
            (number, start)
            for number, robot_class in enumerate(self.model.classes)
            for start in robot_class.all_starts.tolist()
        }
        by_step = Arc.on_paths(fresh, starts, self.model.problem.horizon)
        kept = {arc for arcs in by_step for arc in arcs}
        self._idle = {arc: self._idle[arc] for arc in fresh if arc in kept}
        self._columns = {
            key: column
            for key, column in self._columns.items()
            if all(arc in self._idle for arc in column.arcs)
        }

    def used_columns(self, most_idle: int) -> list[Column]:
        """Returns the paths whose arcs have all been used by one of the last solves."""
        return [
            column
            for column in self._columns.values()
            if all(self._idle[arc] <= most_idle for arc in column.arcs)
        ]

    def solve(self, stop: Stop = never, accuracy: float = BEST_ACCURACY) -> Solution:
        """Solves to a relative accuracy of the value, or as far as the stopping criterion
        allows.
        """
        program = MasterProgram(
            self.model, [*self._idle], self.rows, self.decisions, self.cuts, self.penalty
        )
        solution, flow = program.solve(stop, accuracy, self._columns)
        for arc, amount in zip(self._idle, flow.tolist(), strict=True):
            self._idle[arc] = 0 if amount > LEAST_USE else self._idle[arc] + 1
        return solution
