"""The root of the search: the relaxation without decisions."""

from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from cocap_opt.formulations.certificates.envelope import Cut
from cocap_opt.formulations.certificates.state_cuts import AnyCut, CutByStates
from cocap_opt.formulations.column_generation.master.master import Master
from cocap_opt.formulations.column_generation.parameters import RootParameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.envelopes import step_envelopes
from cocap_opt.formulations.column_generation.tree.large_root import LargeRoot
from cocap_opt.formulations.column_generation.tree.relaxation import Relaxation
from cocap_opt.mixtures.mixture import Mixture
from cocap_opt.mixtures.mixture_ascent import is_slow, mixture_ascent


@dataclass
class Root:
    """The root of a search: its relaxation, aggregated or disaggregated.

    Attributes
    ----------
    relaxation : the relaxation that gives the bound; `solve` may replace it
    gap : relative gap at which the root counts as closed, as in `Search.cutoff`
    rough : share of the remaining gap at which convergence is sufficient, as in `Relaxation.solve`
    at_once : True: try the paths of better plans as soon as there is a plan, which gives the
        earliest proof, but multipliers that explain less
    tried : the gap at which the paths of all better plans were last tried
    """

    relaxation: Relaxation
    gap: float
    rough: float = 0.0
    at_once: bool = False
    tried: float = np.inf

    @classmethod
    def of(cls, search: Search, gap: float, rough: float = 0.0, *, at_once: bool = False) -> "Root":
        """Returns the relaxation without decisions, not yet solved."""
        # Twice the J that all robots can see is usually more than a violated rule can gain.
        master = Master(search.model, penalty=2 * search.scale)
        return cls(Relaxation(search, master, search.alone), gap, rough, at_once)

    @property
    def search(self) -> Search:
        """The search of the relaxation, whose model has the same robot classes."""
        return self.relaxation.search

    @property
    def _parameters(self) -> RootParameters:
        return self.search.parameters.root

    def cutoff(self) -> float:
        """Returns the bound at which the root is closed."""
        return self.search.cutoff(self.gap)

    def solve_aggregated(self, by_cuts_only: bool = False) -> None:
        """Solves the relaxation with the given robot classes; raises LimitReached.

        Parameters
        ----------
        by_cuts_only : True: do not try paths or step envelopes before adding cuts
        """
        if self.relaxation.best.bound == -np.inf:
            return
        if self.search.is_large:
            self._solve_large()
        else:
            mixture = self._ascend(self._parameters.enough)
            self.search.round_to_plans(mixture)
            self._begin(mixture)
            if not by_cuts_only and self.at_once and self._try_paths_of_first_plan():
                return
        if by_cuts_only or self.search.is_large:
            self.relaxation.solve(self.cutoff, self.rough)
        elif not self._close_before_cuts():
            self.relaxation.solve(self.cutoff, self.rough, try_to_prove=self._try_paths)

    def _close_before_cuts(self) -> bool:
        """Solves the relaxation without cuts and searches for plans; returns True if the root is
        closed.
        """
        self.relaxation.solve(self.cutoff, self.rough, until_cuts=True)
        self._try_step_envelopes(self._parameters.few_joint_states)
        # In a small scene the best plan is found quickly; further search would be in vain.
        self._search_by_prices(is_quick=True)
        if not self._try_paths():
            self._search_by_prices()
        return self._try_paths()

    def _ascend(self, enough: float) -> Mixture:
        """Improves a mixture until it is within `enough` of the best bound.

        Raises
        ------
        LimitReached
            If a limit is reached; the plan that the current mixture gives is offered.
        """
        search, relaxation = self.search, self.relaxation
        steps = mixture_ascent(
            search.model,
            search.pricer.of_prices,
            relaxation.best,
            search.stop,
            search.parameters.ascent,
        )
        parameters = self._parameters
        mixture, open_ = Mixture([], np.zeros(0)), list[float]()
        with search.rounding_at_a_limit(lambda: mixture):
            for mixture, value, priced in islice(steps, parameters.most_raises):  # noqa: B007
                relaxation.offer(priced)
                search.report(search.snapshot(relaxation.best.bound))
                open_.append(relaxation.best.bound - value)
                if open_[-1] <= enough * relaxation.best.bound or is_slow(
                    open_, parameters.patience, 1 - parameters.least_closed
                ):
                    break
        return mixture

    def _begin(self, mixture: Mixture) -> None:
        """Adds a mixture's columns and those of the best plan to the master."""
        search, master = self.search, self.relaxation.master
        search.columns += sum(
            master.add(column) for column, _ in mixture.used(self._parameters.least_amount)
        )
        search.report(search.snapshot(self.relaxation.best.bound))
        for column in () if search.incumbent is None else search.incumbent.columns:
            master.add(column)

    def _solve_large(self) -> None:
        """Lowers the bound and searches for plans in turn; raises LimitReached."""
        mixture = self._ascend(self._parameters.enough_large)
        if self._is_closed():
            return
        large = LargeRoot(self.relaxation, mixture, self.cutoff, self.rough)
        large.begin()
        # Best responses over all states take too long here, so the first plan is only rounded.
        self.search.offer(self.search.local_search.rounded(large.ascent.mixture))
        self._begin(large.ascent.mixture)
        large.solve()

    def solve(self) -> None:
        """Solves the relaxation; if it is tighter, with every robot as a class of its own.

        Disaggregated robots need more columns and larger masters. One round of cuts shows whether
        that helps: robots that start side by side are almost interchangeable.

        Raises
        ------
        LimitReached
            If a limit is reached; `relaxation` is then the one that was being solved.
        """
        self.solve_aggregated()
        if self.relaxation.is_stuck or self._is_closed() or self._try_paths():
            return
        self._search_by_prices()
        self._try_step_envelopes()
        if self.search.is_proved(self.cutoff()) or not self._can_disaggregate():
            return
        aggregated = self.relaxation
        self.relaxation = _disaggregated(aggregated)
        self.relaxation.solve(self.cutoff, self.rough, rounds=1)
        if self.relaxation.is_stuck:
            return
        if self._gains_enough(aggregated):
            self.relaxation.solve(self.cutoff, self.rough)
            self._try_step_envelopes()
            return
        if self.search.incumbent is not None:
            model = aggregated.search.model
            aggregated.search.offer(self.search.incumbent.in_model(model))
        if self.relaxation.best.bound < aggregated.best.bound:
            aggregated.search.offer_spare(self.relaxation.certificate("column-generation"))
        self.relaxation = aggregated

    def _search_by_prices(self, *, is_quick: bool = False) -> None:
        """Searches for plans where the current prices suggest, unless the root is closed."""
        if not self.relaxation.is_stuck and not self._is_closed():
            self.relaxation.search_by_prices(is_quick=is_quick)

    def _try_step_envelopes(self, most_joint: float = np.inf) -> None:
        """Tries to lower the bound by step envelopes, unless too many joint states remain."""
        if not self.relaxation.is_stuck and not self._is_closed():
            columns = self.relaxation.master.used_columns(
                self.search.parameters.relaxation.most_idle
            )
            # step envelopes begin by trying paths
            self.tried = self.relaxation.best.bound - self.search.value
            duals = self.relaxation.best.duals
            step_envelopes(self.search, duals, self.gap, columns, most_joint)

    def _try_paths_of_first_plan(self) -> bool:
        """Tries the paths of plans better than the first plan; returns True if none exists.

        In scene `corridor` the first plan is the best. The relaxations of smaller scenes take less
        time, and bounds of multipliers alone are the easiest to check. If the gap is large,
        multipliers would explain little of it.
        """
        states = sum(group.graph.n_states for group in self.search.model.classes)
        bound = self.relaxation.best.bound
        is_near = bound - self.search.value <= self._parameters.at_once * abs(bound)
        return is_near and states >= self._parameters.many_states and self._try_paths()

    def _try_paths(self) -> bool:
        """Tries the paths of all better plans, if the gap has shrunk enough since the last trial.

        If there are too many paths, this takes a tenth of a second and fails. Returns True if it
        proves that no plan is better.
        """
        open_ = self.relaxation.best.bound - self.search.value
        if not self._is_closed() and open_ <= self._parameters.less_open * self.tried:
            self.tried = open_
            step_envelopes(self.search, self.relaxation.best.duals, self.gap, most_joint=0)
        return self.search.is_proved(self.cutoff())

    def _is_closed(self) -> bool:
        """Returns True if the root is closed."""
        cutoff = self.cutoff()
        return self.relaxation.best.bound <= cutoff or self.search.is_proved(cutoff)

    def _can_disaggregate(self) -> bool:
        """Returns True if the root is open and its robots can be disaggregated."""
        model = self.search.model
        states = sum(len(group.robots) * group.graph.n_states for group in model.classes)
        return (
            self.relaxation.best.bound > self.cutoff()
            and self.search.incumbent is not None
            and len(model.classes) < len(model.problem.robots)
            and states * (model.problem.horizon + 1) <= self._parameters.most_disaggregated
        )

    def _gains_enough(self, aggregated: Relaxation) -> bool:
        """Returns True if the disaggregated relaxation closes enough for its size."""
        before = aggregated.best.bound
        open_ = before - self.cutoff()
        larger = len(self.relaxation.master.arcs) / len(aggregated.master.arcs)
        share = (
            self._parameters.least_gain * larger
            if open_ < self._parameters.far * before
            else self._parameters.least_gain_far
        )
        return before - self.relaxation.best.bound >= share * open_


def _disaggregated(relaxation: Relaxation) -> Relaxation:
    """Returns the same relaxation with every robot as a class of its own, for which envelopes are
    lower.
    """
    old, solution = relaxation.master, relaxation.solution
    search, duals = relaxation.search.disaggregated(), relaxation.best.duals
    cuts = {
        id(cut): _disaggregated_cut(relaxation, cut)
        for cut in (*old.cuts, *(cut for cut, _ in duals.cuts))
    }
    used = [] if solution is None else solution.mixture.columns
    incumbent = () if search.incumbent is None else search.incumbent.columns
    columns = (*used, *incumbent, *old.used_columns(2))
    master = Master(search.model, old.penalty)
    master.add_all(
        (column.in_model(search.model) for column in columns),
        old.rows,
        (cuts[id(cut)] for cut in old.cuts),
    )
    shares = tuple((cuts[id(cut)], share) for cut, share in duals.cuts)
    best = relaxation.best._replace(duals=replace(duals, cuts=shares))
    return Relaxation(search, master, best, iterations=relaxation.iterations)


def _disaggregated_cut(relaxation: Relaxation, cut: AnyCut) -> AnyCut:
    """Returns a cut in which each robot has phi of its class."""
    if isinstance(cut, CutByStates):
        listed = {
            robot: cut.listed[robot_class.number]
            for robot_class in relaxation.search.model.classes
            if robot_class.number in cut.listed
            for robot in robot_class.robots
        }
        return replace(cut, listed=dict(sorted(listed.items())))
    curves = {
        robot: cut.curves[number]
        for number, robot_class in enumerate(relaxation.search.model.classes)
        if number in cut.curves
        for robot in robot_class.robots
    }
    return Cut(cut.view_sum, dict(sorted(curves.items())), cut.constant)
