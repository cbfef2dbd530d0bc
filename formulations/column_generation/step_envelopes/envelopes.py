"""Step envelopes: the second stage of the root, after its relaxation.

In the relaxation, each face of a step has its own concave envelope; the remaining gap is mostly due
to faces of one step that favour different pairings of the robots. One envelope over all faces of a
step closes it: states have prices instead of pixels, and a step's constant is the height of its
highest joint state (`staged.stages`, `staged.joint_states`).

Each round has three parts: the constants at the current prices are lowered by searches; states that
no better plan visits are closed; and a bundle method (`price_bundle`) finds better prices. Joint
states are found by local search, and by exact search only once local search finds none above the
constants.

If many states remain, each round has a short list of states for each step: those of smallest slack.
Their prices are no lower than before, and those of all other states are so much higher that none of
these is in a joint state above the new constant (`staged.narrowing`); so the search covers only the
list. The next round makes new lists from the new prices, and shortens them if searches took long.
Once the prices of such lists promise or close little, all states get their own prices, if there are
not too many. Local search then looks for better plans in the mixture of paths behind the prices,
and plans are recombined. If a better plan is found, it becomes the target, and all stages are
repeated for it. Once such stages close little, the following ones also bound the moves of the team
between two steps (`move_bundle`).

Before the first stage and after each stage, the remaining joint paths of all robots may be few
enough to explore (`path_trials`), which proves the best plan optimal. Once all states have prices,
and at the end, the losses of tails lower the bound further (`tail_search`).

If a gap is allowed, the target is the cutoff: plans in between need not be excluded.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from cocap_opt.compiling import is_there
from cocap_opt.data import IntArray
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import CertificateFile, Staged
from cocap_opt.formulations.certificates.format import StepConstant
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing
from cocap_opt.formulations.certificates.staged.stages import MOST_STATES
from cocap_opt.formulations.column_generation.master.flow_paths import mixture_of_flow
from cocap_opt.formulations.column_generation.parameters import EnvelopeParameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes.counting import (
    joint_states_left,
    states_left,
)
from cocap_opt.formulations.column_generation.step_envelopes.heights import Heights
from cocap_opt.formulations.column_generation.step_envelopes.known_states import Known
from cocap_opt.formulations.column_generation.step_envelopes.list_lengths import ListLengths
from cocap_opt.formulations.column_generation.step_envelopes.move_bundle import (
    KnownMoves,
    MoveBundle,
)
from cocap_opt.formulations.column_generation.step_envelopes.path_trials import PathTrials
from cocap_opt.formulations.column_generation.step_envelopes.price_bundle import PriceBundle
from cocap_opt.formulations.column_generation.step_envelopes.priced_states import PricedStates
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.step_envelopes.step_searches import StepSearches
from cocap_opt.formulations.column_generation.step_envelopes.tail_search import TailSearch
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.problem import COVERAGE_VERSION
from cocap_opt.stop import Limit, LimitReached

METHOD = "step-envelopes"
# relative: reduction of the bound that stages must achieve; excess of J at which a plan is better
CLEARLY = 1e-9


def step_envelopes(
    search: Search,
    duals: Duals,
    gap: float,
    columns: Iterable[Column] = (),
    most_joint: float = math.inf,
    tries_paths: bool = True,
) -> None:
    """Offers the search a staged certificate with a lower bound, if one is found.

    Parameters
    ----------
    search : a search with an incumbent, whose J is the target; without an incumbent nothing is done
    duals : multipliers of the relaxation without decisions
    gap : relative gap at which the root is closed, as in `Search.cutoff`
    columns : good paths
    most_joint : number of joint states of all steps, including conflicts, above which no stages are
        made, only a trial of all paths
    tries_paths : False: make stages only

    Raises
    ------
    LimitReached
        If a limit is reached; the bound proved so far is offered.
    """
    model, narrowing = search.model, search.narrowing(duals, search.aim(gap))
    if search.incumbent is None or narrowing is None:
        return
    steps = range(model.problem.first_step, model.problem.horizon + 1)
    known = Known(search.rng, search.parameters.bundle)
    known.add_plan(search.incumbent, steps)
    for column in columns:
        known.add_path(column.along.class_number, column.path)
    before = narrowing.pricing.bound
    envelopes = _Envelopes(
        search, gap, Stages(narrowing), duals, known, steps,
        PathTrials(search, is_on=tries_paths), TailSearch(search, is_on=tries_paths),
        ListLengths(len(steps), search.parameters.lists),
    )  # fmt: skip
    try:
        if envelopes.try_paths():
            return
        if most_joint == math.inf or joint_states_left(narrowing) <= most_joint:
            envelopes.run()
    finally:
        if envelopes.bound < before - CLEARLY * abs(before):
            envelopes.offer()


@dataclass
class _Envelopes:
    """The stages so far, and the known joint states and paths.

    Attributes
    ----------
    proved : the stages so far, and the resulting narrowing
    steps : steps at which views count
    trials : trials of the joint paths of all robots
    tails : explorations of the latest steps of plans
    lengths : lengths of the lists of states
    searches : searches for joint states of steps
    responses : budget of the next search for plans, in iterations' worth of best responses
    lists_stall : True once a round of lists has closed little
    """

    search: Search
    gap: float
    proved: Stages
    duals: Duals
    known: Known
    steps: range
    trials: PathTrials
    tails: TailSearch
    lengths: ListLengths
    lists_stall: bool = False
    responses: int = 0
    _before_stages: Narrowing | None = None

    def __post_init__(self) -> None:
        """Sets the initial number of responses from the parameters."""
        self.responses = self._parameters.responses
        self.searches = StepSearches(self.known, self.search)

    @property
    def _parameters(self) -> EnvelopeParameters:
        return self.search.parameters.envelopes

    @property
    def narrowing(self) -> Narrowing:
        """The narrowing to better plans, after the stages so far."""
        return self.proved.narrowing

    def cutoff(self) -> float:
        """Returns the bound at which the root is closed."""
        return self.search.cutoff(self.gap)

    @property
    def bound(self) -> float:
        """The bound that the stages, the trials of paths, or the losses of tails prove."""
        return min(self.narrowing.pricing.bound, self.trials.bound, self.tails.bound)

    def run(self) -> None:
        """Adds stages as long as they close states or lower the bound, then explores tails; raises
        LimitReached.

        Part of a time limit is kept for tails: at the end, they lower the bound by more than one
        more stage.
        """
        left = self.search.stop.seconds_left if self.tails.is_possible else math.inf
        # Infinite without a time limit or without trials: then nothing is kept.
        kept = self.search.parameters.tails.time_kept * left
        try:
            with self.search.ending_before(kept):
                self._add_stages()
                self._add_stages_of_moves()
        except LimitReached as reached:
            self.search.stop.check()
            if kept == math.inf or reached.limit is not Limit.TIME:
                raise
            self._explore_tails(to_the_end=True)
            if self.bound > self.cutoff():  # otherwise tails have closed the gap that stages leave
                self._add_stages()
        self._explore_tails()

    def _explore_tails(self, to_the_end: bool = False) -> None:
        """Explores the tails of plans with ever more nodes; raises LimitReached."""
        is_better = True
        while is_better and self.bound > self.cutoff():
            self._raise_target()
            self.tails.at_the_end(self.proved, self.searches.nodes, self.offer, to_the_end)
            is_better = self._has_better_plan()

    def _add_stages(self) -> None:
        """Adds stages as long as they close states or lower the bound; raises LimitReached."""
        for _ in range(self._parameters.most_rounds):
            self._raise_target()
            before = self.narrowing.pricing.bound
            open_ = before - self.cutoff()
            if open_ <= 0:
                return
            if not (self._is_small() or self._can_be_listed()):
                return
            if self._is_small():
                self._lower_constants()
                if self.narrowing.pricing.bound <= self.cutoff() or self.try_paths():
                    return
            listed = not self._is_small()
            is_wide = listed and self.lengths.widening >= self._parameters.wide
            self._add_priced_stages()
            if self.try_paths() if listed else self._try_tails():
                return
            if self._has_better_plan():
                continue
            closed = (before - self.narrowing.pricing.bound) / open_
            if not self._is_worth_another(closed, listed, is_wide):
                return

    def _add_stages_of_moves(self) -> None:
        """Adds stages with constants of moves as long as they lower the bound; raises
        LimitReached.
        """
        if not (self.search.parameters.moves.most_iterations and is_there() and self.steps[1:]):
            return
        known = KnownMoves()
        while self._is_small() and self._may_have_moves() and self.bound > self.cutoff():
            self._raise_target()
            bundle = MoveBundle(self.narrowing, self.known, known, self.searches)
            is_better = False
            try:
                is_better = bundle.run(self.cutoff, self.report)
            finally:
                if bundle.stage is not None:
                    self.proved = self.proved.then(bundle.stage)
                    known.nodes += bundle.nodes
            self.report()
            if not is_better or self.try_paths():
                return

    def _may_have_moves(self) -> bool:
        """Returns True if no step has more states than a checker searches for moves."""
        return int(states_left(self.narrowing)[self.steps.start :].max()) <= MOST_STATES

    def _is_worth_another(self, closed: float, listed: bool, is_wide: bool) -> bool:
        """Returns True if another round is worthwhile; makes lists longer if they closed little.

        Parameters
        ----------
        closed : share of the gap that the last round has closed
        listed : True if only the states on lists had prices
        is_wide : True if these lists were wide
        """
        if not listed:
            return closed >= self._parameters.least_round
        may_grow = self.lengths.can_grow
        if closed < self._parameters.least_listed:
            self.lists_stall = closed < self._parameters.stalled
            self.lengths.grow()
        if self._is_small():
            return True  # the next round prices all states
        if is_wide and closed < self._parameters.least_wide:
            return False
        return may_grow or closed >= self._parameters.least_round

    def _has_better_plan(self) -> bool:
        """Returns True if a plan is clearly above the target of the stages."""
        return self.search.aim(self.gap) > (1 + CLEARLY) * self.narrowing.target

    def _raise_target(self) -> None:
        """Repeats all stages for the best plan's J, if it is higher: they then close more states.

        Raises
        ------
        LimitReached
            If a limit is reached; the target and the remaining states are then unchanged.
        """
        plan = self.search.incumbent
        if plan is None or not self._has_better_plan():
            return
        narrowing = self.search.narrowing(self.duals, self.search.aim(self.gap))
        if narrowing is None:
            return
        # Of the known paths, those of the plan are certainly among the remaining states.
        self.known.add_plan(plan, self.steps)
        self.proved = self.proved.again(narrowing, self._tell_again)

    def _tell_again(self) -> None:
        """Reports that the search continues; raises LimitReached."""
        self.search.stop.check()
        self.search.report_again()

    def try_paths(self) -> bool:
        """Explores all remaining paths of better plans; returns True if that has ended."""
        has_ended = self.trials.after_stages(self.proved, self.searches.nodes)
        if has_ended:
            self.offer()
        return has_ended

    def _try_tails(self) -> bool:
        """Explores tails; returns True if they prove that no plan is above the target."""
        return self.tails.after_stages(self.proved, self.searches.nodes, self.offer)

    def offer(self) -> None:
        """Offers the search the certificate of the bound proved so far."""
        self.search.offer_spare(self.file())
        self.report()

    def file(self) -> CertificateFile:
        """Returns the certificate of the stages so far, or of the trial of paths."""
        model = self.search.model
        return CertificateFile(
            scene=model.problem.name,
            digest=problem_digest(model.problem),
            method=METHOD,
            coverage_version=COVERAGE_VERSION,
            classes="single" if model.is_disaggregated else "alike",
            bound=self.bound,
            certificate=self._certificate(),
        )

    def _certificate(self) -> Staged:
        """Returns the stages so far, or those before the best trial of paths and that trial."""
        multipliers, target = self.duals.certificate(self.search.model), self.narrowing.target
        trial, tails = self.trials.best, self.tails.best
        if tails is not None and tails.bound <= self.bound:
            return Staged(multipliers, target, tails.stages, tails=tails.tails)
        if trial is not None and trial.bound <= self.bound:
            return Staged(multipliers, target, trial.stages, trial.above, trial.from_step or None)
        return Staged(multipliers, target, self.proved.stages)

    def _is_small(self) -> bool:
        """Returns True if all states get their own prices, since searches of steps may then end."""
        left = states_left(self.narrowing)[self.steps.start :]
        return int(left.sum()) <= self._most_left() and int(left.max()) <= (
            self._parameters.most_at_a_step
        )

    def _most_left(self) -> int:
        """Returns the largest number of remaining states at which all of them get prices."""
        if not self._can_be_listed():
            return self._parameters.most_unlisted
        parameters = self._parameters
        if self.lists_stall:
            return parameters.most_states_left
        is_few = len(self.search.model.problem.robots) <= parameters.few_robots
        return parameters.most_states_of_few if is_few else parameters.few_states_left

    def _can_be_listed(self) -> bool:
        """Returns True if searches over lists may end."""
        robots = len(self.search.model.problem.robots)
        return is_there() and robots <= self._parameters.most_listed_robots

    def _lower_constants(self) -> None:
        """Lowers the constants at the current prices, at steps for which that takes few nodes."""
        constants: list[StepConstant] = []
        try:
            for t in self.steps:
                self.search.report_again()
                least = self.known.highest(self.narrowing.joint_states(t))
                higher = self.narrowing.joint_states(t, least)
                most_nodes = self.searches.few_nodes(len(higher.states))
                found = self.searches.highest(higher, least, most_nodes)
                if found is None:
                    continue
                constants.append(StepConstant(t, found.profit))
        finally:
            # Constants lowered before a limit count, so the certificate has to include them.
            self.proved = self.proved.lowered(constants)
            self.report()

    def report(self) -> None:
        """Reports the bound proved so far."""
        self.search.report(self.search.snapshot(self.bound))

    def _add_priced_stages(self) -> None:
        """Finds better prices and their constants, and adds them as a stage."""
        priced = self._priced()
        if self.narrowing.target > self.search.value:
            self._know_some(priced.joints.values())
        bundle = PriceBundle(priced, self.known, self.search.parameters.bundle)
        for _ in range(self._parameters.most_corrections):
            prices = bundle.run(self.cutoff, self.report)
            if bundle.flow:
                self._look_for_plans(bundle.flow)
            if prices is None or (priced.has_lists and self._is_stalled(bundle.best)):
                return
            heights = Heights(bundle, prices, self.proved, self.searches, self.lengths, self._keep)
            # If no search has ended, nothing is known that could correct the bundle.
            if heights.adopt() or not heights.waiting:
                return

    def _know_some(self, joints: Iterable[JointStates]) -> None:
        """Finds a joint state of each step for the bundle to begin with; above the target of a gap,
        not even those of the best plan count.
        """
        for joint in joints:
            if not self.known.at(joint):
                self.searches.highest(joint, -math.inf, self.searches.many_nodes())

    def _is_stalled(self, bound: float) -> bool:
        """Returns True if a lower bound would close so little that lists count as stalled."""
        before = self.narrowing.pricing.bound
        return before - bound < self._parameters.stalled * (before - self.cutoff())

    def _keep(self, proved: Stages) -> None:
        """Stores the stages so far, and reports their bound; raises LimitReached."""
        self.proved = proved
        self.report()

    def _look_for_plans(self, flow: Mapping[Arc, float]) -> None:
        """Offers plans made from the mixture behind the latest prices.

        Raises
        ------
        LimitReached
            If a limit is reached during recombination.
        """
        before = self.search.value
        self.search.allow_responses(self.responses)
        self.search.round_to_plans(mixture_of_flow(self.search.model, flow))
        self._recombine()
        self.responses = (
            self._parameters.responses
            if self.search.value > before
            else max(self.responses // 2, 1)
        )

    def _recombine(self) -> None:
        """Offers the best plan along the states of several plans; raises LimitReached.

        If a gap is allowed, the stages close the states of plans that are only a little better, so
        these are sought before any stage.
        """
        if self.narrowing.target > self.search.value and self._before_stages is None:
            self._before_stages = self.search.narrowing(self.duals, self.search.value)
        self.search.recombine(self._before_stages or self.narrowing)

    def _priced(self) -> PricedStates:
        """Returns the states that get prices, with ceilings at steps where only some have."""
        narrowing, stop = self.narrowing, self.search.stop
        if self._is_small():
            joints = {t: narrowing.joint_states(t) for t in self.steps}
            return PricedStates(narrowing, joints, {}, stop)
        most = self.lengths.slack(narrowing.pricing.bound - self.cutoff(), self._n_listed)
        joints = {t: narrowing.joint_states_of(t, self._listed(t, most)) for t in self.steps}
        return PricedStates(narrowing, joints, {t: narrowing.ceiling(t) for t in self.steps}, stop)

    def _n_listed(self, most: float) -> int:
        """Returns the number of states of all steps up to a slack."""
        return sum(
            int(np.count_nonzero(left[self.steps.start :] & (slack[self.steps.start :] <= most)))
            for slack, left in zip(self.narrowing.slack, self.narrowing.left, strict=True)
        )

    def _listed(self, t: int, most: float) -> list[IntArray]:
        """Returns, for each class, the states of a step up to a slack: those of smallest slack, but
        not too many.
        """
        slack = [
            np.where(left[t], slack[t], np.inf)
            for slack, left in zip(self.narrowing.slack, self.narrowing.left, strict=True)
        ]
        plan = self.search.incumbent
        for column in () if plan is None else plan.columns:
            number, state = column.along.class_number, column.path[t]
            if self.narrowing.left[number][t, state]:
                slack[number][state] = min(slack[number][state], most)
        order = np.argsort(np.concatenate(slack), kind="stable")
        order = order[: self.lengths.most(t)]
        short = np.zeros(sum(map(len, slack)), dtype=np.bool_)
        short[order] = True
        parts = np.split(short, np.cumsum([len(values) for values in slack])[:-1])
        return [
            np.flatnonzero(part & (values <= most))
            for part, values in zip(parts, slack, strict=True)
        ]
