"""The state that all nodes of one search share: model, limits, and the best plan so far."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import msgspec
import numpy as np

from cocap_opt.formulations.certificates import CertificateFile, ProofFile, Staged
from cocap_opt.formulations.certificates.staged import Narrowing
from cocap_opt.formulations.column_generation.master.pricing import Pricer
from cocap_opt.formulations.column_generation.parameters import DEFAULTS, Parameters
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.primal.local_search import LocalSearch, ResponseLimit
from cocap_opt.formulations.column_generation.primal.recombination import Recombination
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.formulations.result import (
    OPTIMALITY,
    CertifiedResult,
    Report,
    Snapshot,
    checked_start,
    proved_by,
    silent,
)
from cocap_opt.mixtures.columns import Column
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.plan_search import PlanSearch, columns_of, team_of
from cocap_opt.mixtures.prices import Prices
from cocap_opt.model import Model
from cocap_opt.problem import Plan
from cocap_opt.result import Reason, relative_gap
from cocap_opt.stop import Clock, Limit, LimitReached, Stop, never


@dataclass
class Search:
    """The state that the relaxations of all nodes of a search share.

    Attributes
    ----------
    report : called with the progress at every iteration
    incumbent : the best plan so far
    columns : total number of columns generated
    spare : file with the lowest bound from other sources than the current relaxation: from step
        envelopes, or from an abandoned relaxation
    lowest : the lowest bound that was reported
    parameters : parameters of the search
    recombination : recombines the plans that local search has found
    pricer : prices multipliers for the model
    local_search : improves plans of the model
    allowance : remaining best responses of local search
    rng : random generator of local search
    largest : [C, Z] largest root of the pixels of one robot, px^0.5/m
    weights : [Z] weights of view sums
    alone : the priced multipliers of the bound of method `alone`, in which every robot is alone
    scale : that bound, if it is positive and finite, otherwise 1
    """

    model: Model
    stop: Stop = never
    report: Report = silent
    clock: Clock = field(default_factory=Clock)
    incumbent: Incumbent | None = None
    columns: int = 0
    spare: CertificateFile | None = None
    lowest: float = np.inf
    parameters: Parameters = DEFAULTS

    def __post_init__(self) -> None:
        """Compiles the parts of the model that pricing needs, and prices `alone`; raises
        LimitReached.
        """
        self._nodes, self._told = 0, 0.0
        self.recombination = Recombination(self.parameters.recombination)
        self.pricer = Pricer(self.model, self.stop)
        self.allowance = ResponseLimit(
            self.parameters.search.first_responses * len(self.model.problem.robots)
        )
        self.rng = np.random.default_rng(0)
        self.local_search = LocalSearch(
            self.model, self.stop, self.allowance, self.rng, self.report_again,
            found=self.recombination.add, parameters=self.parameters.local_search,
        )  # fmt: skip
        self.largest = self.model.largest_roots()
        self.weights = self.model.problem.view_sum_weights
        self.alone = self.pricer(Duals.alone(self.model.problem))
        bound = self.alone.bound
        self.scale = bound if 0 < bound < np.inf else 1.0
        self.offer(Incumbent.of_plan(self.model, Plan.hovering(self.model.problem)))

    @contextmanager
    def ending_before(self, seconds: float) -> Iterator[None]:
        """Within the block, the time limit ends so many seconds earlier.

        Parameters
        ----------
        seconds : s; infinity: the limit stays
        """
        stop = self.stop
        if seconds < np.inf:
            self.stop = stop.before(seconds)
        try:
            yield
        finally:
            self.stop = stop

    @property
    def value(self) -> float:
        """J of the incumbent; -inf if there is none."""
        return -np.inf if self.incumbent is None else self.incumbent.value

    def cutoff(self, gap: float) -> float:
        """Returns the bound at or below which a node is pruned: it contains no better plan, or no
        plan at all.

        J >= 0, so a bound clearly below 0 proves that no plan exists.
        """
        if self.incumbent is None:
            return -self.parameters.search.infeasible * self.scale
        return self.value + max(gap * self.value, self.parameters.search.exact / 2 * self.scale)

    def aim(self, gap: float) -> float:
        """Returns the J above which step envelopes prove that there is no plan: that of the
        incumbent, or the cutoff if a gap is allowed, since plans in between need not be excluded.
        """
        return self.value if gap <= OPTIMALITY else self.cutoff(gap)

    def offer(self, candidate: Incumbent | None) -> None:
        """Makes a candidate the incumbent if it is better."""
        if candidate is not None and candidate.value > self.value:
            self.incumbent = candidate

    def offer_spare(self, file: CertificateFile) -> None:
        """Keeps a file that proves a bound independently of the relaxation, if its bound is the
        lowest.
        """
        if self.spare is None or file.proved < self.spare.proved:
            self.spare = file

    def is_proved(self, cutoff: float) -> bool:
        """Returns True if the spare file proves a bound for all plans that is at most the
        cutoff.
        """
        return self.spare is not None and self.spare.proved <= cutoff

    def use_start(self, start: Plan | None) -> str:
        """Offers an initial plan; returns the reason if it is rejected."""
        plan, message = checked_start(self.model.problem, start)
        self.offer(Incumbent.of_plan(self.model, plan))
        return message

    def snapshot(self, bound: float, nodes: int = 0) -> Snapshot:
        """Returns the state of the search for its report.

        Parameters
        ----------
        bound : largest bound of the open nodes; its maximum with the incumbent's J bounds all plans
        """
        bound = max(bound, self.value)
        if self.spare is not None:
            bound = min(bound, self.spare.proved)
        bound = self.lowest = min(bound, max(self.lowest, self.value))
        self._nodes, self._told = nodes, self.clock.seconds
        return Snapshot(self.value, bound, self._told, self.columns, nodes)

    def report_again(self) -> None:
        """Reports that the search continues, if there has been no report for a while."""
        if self.clock.seconds - self._told > self.parameters.search.report_seconds:
            self.report(self.snapshot(np.inf, self._nodes))

    def round_to_plans(self, mixture: Mixture) -> None:
        """Offers the plan that local search makes from a mixture."""
        self.offer(self.local_search.from_mixture(mixture, self.incumbent))

    def plan_search(self, most_in_vain: int | None = None) -> PlanSearch:
        """Returns a search for plans by prices, which offers the plans that it finds.

        Parameters
        ----------
        most_in_vain : number of plans without an improvement after which the search stops; None: as
            set in the parameters
        """

        def tell(columns: Sequence[Column]) -> None:
            plan = Incumbent.of(self.model, columns)
            if plan is not None:
                self.recombination.add(plan)
                if self.incumbent is None or plan.gains_over(self.incumbent):
                    self.offer(plan)
            self.report_again()

        parameters = self.parameters.plan_search
        if most_in_vain is not None:
            parameters = replace(parameters, most_in_vain=most_in_vain)
        return PlanSearch(self.model, self.stop, self.rng, parameters, tell)

    def search_by_prices(
        self,
        search: PlanSearch,
        duals: Duals,
        most_starts: float = np.inf,
        is_searched: bool = False,
    ) -> None:
        """Offers the plans to which prices lead, starting from the incumbent.

        Parameters
        ----------
        search : a search that `plan_search` returned, with the mixtures whose columns are combined
        duals : multipliers whose prices indicate promising states
        most_starts, is_searched : as of `PlanSearch.better_teams`

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        model, plan = self.model, self.incumbent
        if plan is None or len(plan.columns) < 2:
            return
        team = team_of(model, plan.columns)
        search.add_team(team)
        rewards = self.pricer.views.rewards(Prices(duals.alpha, duals.beta))
        try:
            for better in search.better_teams(team, rewards, most_starts, is_searched):
                team = better
        except LimitReached:
            self.offer(Incumbent.of(model, columns_of(team)))
            raise

    def narrowing(self, duals: Duals, target: float) -> Narrowing | None:
        """Returns, from multipliers, the states that plans with J above a target may visit.

        Returns None if there is no incumbent, if pixels add up over time, or if there are too many
        states.

        Raises
        ------
        LimitReached
            If a limit is reached.
        """
        model = self.model
        states = sum(robot_class.graph.n_states for robot_class in model.classes)
        too_many = states * (model.problem.horizon + 1) > self.parameters.search.most_states
        if self.incumbent is None or model.problem.objective.over_time or too_many:
            return None
        narrowing = Narrowing.of(model, duals.certificate(model), target, self.stop)
        self.stop.check()  # each of these takes a second on large maps
        narrowing = narrowing.closed()
        self.stop.check()
        return narrowing

    @property
    def is_large(self) -> bool:
        """True if masters of the model would take too long."""
        problem, least = self.model.problem, self.parameters.large_root.many_robot_steps
        robots = len(problem.robots)
        is_long = robots > 1 and robots * problem.horizon >= least
        return is_long and not problem.objective.over_time

    @property
    def can_recombine(self) -> bool:
        """True if several plans have been found and joint states determine J."""
        return self.recombination.applies_to(self.model)

    @contextmanager
    def rounding_at_a_limit(self, mixture: Callable[[], Mixture]) -> Iterator[None]:
        """Offers a plan rounded from the current mixture if a limit ends the enclosed work.

        This takes 0.8 s on `field-large`, where otherwise the only plan would be that all drones
        hover.
        """
        try:
            yield
        except LimitReached:
            self.round_to_plans(mixture())
            raise

    def recombine(self, narrowing: Narrowing) -> None:
        """Offers the best plan along the states of the plans found so far; raises LimitReached."""
        before = -np.inf
        while self.incumbent is not None and self.value > before and self.can_recombine:
            before, plan = self.value, self.incumbent
            for better in self.recombination.better_plans(plan, narrowing, self.stop):
                self.offer(better)
            if self.value > before:
                self.offer(self.local_search.with_best_responses(self.incumbent.columns))
                self.recombination.add(self.incumbent)

    def allow_responses(self, times: int = 1) -> None:
        """Allows local search the responses of one iteration of a relaxation, or a multiple of
        them.
        """
        each = len(
            self.model.problem.robots
        ) / 2 + self.parameters.search.responses_per_class * len(self.model.classes)
        self.allowance.left = max(self.allowance.left, 0.0) + times * each

    def perturb(self) -> None:
        """Offers the plan that local search finds from a perturbed incumbent."""
        if self.incumbent is not None:
            self.offer(self.local_search.perturbed(self.incumbent))

    def disaggregated(self) -> "Search":
        """Returns the same search with every robot as a class of its own."""
        model = self.model.disaggregated()
        incumbent = None if self.incumbent is None else self.incumbent.in_model(model)
        # Robots of one class share their states, so failed trials for a class need not fail for
        # single robots.
        kept = self.columns, self.spare, self.lowest, self.parameters
        search = Search(model, self.stop, self.report, self.clock, incumbent, *kept)
        search.recombination.values.update(self.recombination.values)
        return search

    def result(
        self,
        file: CertificateFile | ProofFile,
        limit: Limit | None,
        gap: float,
        message: str,
        statistics: Mapping[str, float],
    ) -> CertifiedResult:
        """Returns the result of the search: its plan, and the bound that a file proves.

        Parameters
        ----------
        limit : the limit that ended the search, if any; it is ignored if the proof was complete
            before
        gap : requested relative gap
        message : the reason why the start was rejected, if it was
        """
        if self.spare is not None and self.spare.proved < file.proved:
            file = msgspec.structs.replace(self.spare, method=file.method)
            statistics = {**statistics, **_staged_statistics(self.spare)}
        plan = None if self.incumbent is None else self.model.plan(self.incumbent.paths)
        reached = relative_gap(self.value, file.proved)
        exact = self.parameters.search.exact * self.scale
        proved = proved_by(self.value, file.proved)
        if proved is Reason.OPTIMAL or file.proved - self.value <= exact:
            reason = Reason.OPTIMAL
        elif proved is not None:
            reason = proved
        elif reached <= gap or limit is None:
            reason = Reason.FINISHED
        else:
            reason = Reason.STOPPED
        result = CertifiedResult(
            plan, self.value, reason, bound=file.proved,
            message=message, statistics=statistics, certificate=file,
        )  # fmt: skip
        return replace(result, limit=limit) if reason is Reason.STOPPED else result


def _staged_statistics(file: CertificateFile) -> dict[str, float]:
    """Returns a certificate's number of stages, and the J above which all plans were explored."""
    staged = file.certificate
    if not isinstance(staged, Staged):
        return {}
    above = {} if staged.paths_above is None else {"paths_above": staged.paths_above}
    return {"stages": len(staged.stages), **above}
