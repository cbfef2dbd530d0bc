"""What all relaxations of one search share: model, limits, the best plan so far."""

import time
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from cocap_opt.formulations.certificates.certificate import CertificateFile
from cocap_opt.formulations.certificates.proof import ProofFile
from cocap_opt.formulations.certificates.resources import flight_of
from cocap_opt.formulations.column_generation.master import Arc, Column
from cocap_opt.formulations.column_generation.pricing import Priced, Pricer
from cocap_opt.formulations.column_generation.primal import (
    Incumbent,
    best_response,
    incumbent_along,
    incumbent_of,
    kicked,
)
from cocap_opt.formulations.relaxations.duals import alone_duals
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    Snapshot,
    hovering,
    silent,
    usable_start,
)
from cocap_opt.model import Model
from cocap_opt.objective import largest_roots, view_sum_weights
from cocap_opt.problem.plan import Plan
from cocap_opt.result import Reason, relative_gap
from cocap_opt.stop import Limit, Stop, never

EXACT = 2e-8  # of what all robots see alone: no solver is more accurate than that
INFEASIBLE = 1e-6  # of what all robots see alone: a bound so far below 0 proves it


@dataclass
class Search:
    """What the relaxations of all nodes of a search share.

    Attributes
    ----------
    incumbent : the best plan so far
    report : told about every iteration
    """

    model: Model
    stop: Stop = never
    report: Report = silent
    begin: float = field(default_factory=time.perf_counter)
    incumbent: Incumbent | None = None
    columns: int = 0  # generated in all

    def __post_init__(self) -> None:
        """Compile what pricing needs."""
        self.pricer = Pricer(self.model)
        self.rng = np.random.default_rng(0)
        self.largest = largest_roots(self.model)
        self.weights = view_sum_weights(self.model.problem)
        alone = self.alone().bound
        self.scale = alone if 0 < alone < np.inf else 1.0

    @property
    def value(self) -> float:
        """J of the incumbent; -inf without one."""
        return -np.inf if self.incumbent is None else self.incumbent.value

    def offer(self, candidate: Incumbent | None) -> None:
        """Take a better plan in."""
        if candidate is not None and candidate.value > self.value:
            self.incumbent = candidate

    def snapshot(self, bound: float, nodes: int = 0) -> Snapshot:
        """How far the search is."""
        seconds = time.perf_counter() - self.begin
        return Snapshot(self.value, bound, seconds, self.columns, nodes)

    def alone(self) -> Priced:
        """The multipliers, and their worth, of the bound in which every robot is alone."""
        return self.pricer(alone_duals(self.model.problem))

    def first_columns(self) -> list[Column]:
        """Each robot's best path that obeys the rules given the earlier ones, and the incumbent's.

        What they make together is offered, and so is that nobody moves.
        """
        robots = range(len(self.model.problem.robots))
        self.offer(_incumbent_of_plan(self.model, hovering(self.model.problem)))
        obeying: list[Column] = []
        for robot in robots:
            if self.stop() is not Limit.NONE:
                break
            answer = best_response(self.model, robot, obeying)
            if answer is None:
                break
            obeying.append(answer)
        if len(obeying) == len(robots):
            self.offer(incumbent_of(self.model, obeying))
        return [*obeying, *(() if self.incumbent is None else self.incumbent.columns)]

    def apart(self) -> "Search":
        """The same search with every robot as a class of its own."""
        model = self.model.apart()
        other = Search(model, self.stop, self.report, self.begin, columns=self.columns)
        if self.incumbent is not None:
            other.incumbent = incumbent_in(model, self.incumbent)
        return other

    def kick(self, arcs: Collection[Arc]) -> None:
        """Offer what local search makes of the incumbent after some robots are planned anew."""
        if self.incumbent is not None:
            self.offer(kicked(self.model, self.incumbent, arcs, self.rng, self.stop))


def incumbent_in(model: Model, incumbent: Incumbent) -> Incumbent:
    """A plan by another model's classes."""
    columns = tuple(column_in(model, column) for column in incumbent.columns)
    return Incumbent(incumbent.value, columns)


def column_in(model: Model, column: Column) -> Column:
    """A column with its flight by another model's classes."""
    return column._replace(flight=flight_of(model, column.robot, column.path))


def cutoff_of(search: Search, gap: float) -> float:
    """Bound at which a node is of no more interest: it holds no better plan, or none at all.

    J >= 0, so that a bound clearly below 0 proves that there is no plan.
    """
    if search.incumbent is None:
        return -INFEASIBLE * search.scale
    return search.value + max(gap * search.value, EXACT / 2 * search.scale)


def use_start(search: Search, start: Plan | None) -> str:
    """Begin with a plan; returns why it is rejected, if it is."""
    plan, message = usable_start(search.model.problem, start)
    search.offer(_incumbent_of_plan(search.model, plan))
    return message


def _incumbent_of_plan(model: Model, plan: Plan | None) -> Incumbent | None:
    return None if plan is None else incumbent_along(model, model.paths(plan))


def result_of(
    search: Search,
    file: CertificateFile | ProofFile,
    limit: Limit,
    gap: float,
    message: str,
    statistics: Mapping[str, float],
) -> CertifiedResult:
    """The result of a search: its plan, and the bound that a file proves."""
    reason = Reason.FINISHED if limit is Limit.NONE else Reason.STOPPED
    reached = relative_gap(search.value, file.proved)
    if reached <= OPTIMALITY or file.proved - search.value <= EXACT * search.scale:
        reason, limit = Reason.OPTIMAL, Limit.NONE
    elif file.proved < 0:  # J >= 0
        reason, limit = Reason.INFEASIBLE, Limit.NONE
    elif reached <= gap:
        reason, limit = Reason.FINISHED, Limit.NONE
    plan = None if search.incumbent is None else search.model.plan(search.incumbent.paths)
    return CertifiedResult(
        plan,
        search.value,
        reason,
        limit,
        file.proved,
        time.perf_counter() - search.begin,
        message,
        statistics,
        file,
    )
