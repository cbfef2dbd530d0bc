"""Step envelopes: the second stage of the root, after its relaxation.

Each face of a step has a concave envelope of its own in the relaxation; what is left open is
mostly that the faces of one step want different pairings of the robots. One envelope over all faces
of a step closes that: states have prices, not pixels, and a step's constant is the
height of its highest joint state (`staged.stages`, `staged.joint_states`).

Each round has three parts: the constants of the present prices are lowered by search; states that
no better plan visits are closed; and a bundle method (`price_bundle`) finds better prices.
Joint states are looked for by local search, and only once that finds none above the constants, by
the exact one.

Where many states are left, each round has a short list of states for each step: those of the least
slack. Their prices are no lower than before, and those of all other states so much higher that
none of these is in a joint state above the new constant (`staged.narrowing`); so the search is over
the list alone. The next round's lists are those of the new prices, shorter where searches took
long. Once the prices of such lists promise or close little, all states get prices of their own, if
there are not too many.
Local search then looks for better plans in the mixture of paths behind the prices, and plans are
recombined. Once one is better, it is the target, and all stages are repeated for it.

Before the first stage and after each the paths of all robots together may be few enough to be tried
(`path_trials`), which proves what the best plan is. Where stages close no more, those of plans
above higher targets are tried.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from cocap_opt.compiling import is_there
from cocap_opt.data import IntArray
from cocap_opt.files.documents import problem_digest
from cocap_opt.formulations.certificates import CertificateFile, Staged
from cocap_opt.formulations.certificates.format import StepConstant
from cocap_opt.formulations.certificates.staged import JointStates, Narrowing
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
from cocap_opt.formulations.column_generation.step_envelopes.path_trials import PathTrials
from cocap_opt.formulations.column_generation.step_envelopes.price_bundle import PriceBundle
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.step_envelopes.step_searches import StepSearches
from cocap_opt.formulations.relaxations.duals import Duals
from cocap_opt.mixtures.columns import Arc, Column
from cocap_opt.problem import COVERAGE_VERSION

METHOD = "step-envelopes"
CLEARLY = 1e-9  # of the bound, that stages must take off it; of J, above which a plan is better


def step_envelopes(
    search: Search,
    duals: Duals,
    cutoff: Callable[[], float],
    columns: Iterable[Column] = (),
    most_joint: float = math.inf,
    tries_paths: bool = True,
) -> None:
    """Offers the search a staged certificate of a lower bound, if it finds one.

    Parameters
    ----------
    search : with an incumbent, whose J is the target; without one nothing is done
    duals : of the relaxation without decisions
    columns : good paths
    cutoff : bound at which nothing is open
    most_joint : joint states of all steps, conflicts included; where more are left, there are no
        stages, only a trial of all paths
    tries_paths : False: there are stages only

    Raises
    ------
    LimitReached
        At a limit; what is proved until then is offered.
    """
    model, narrowing = search.model, search.narrowing(duals)
    if search.incumbent is None or narrowing is None:
        return
    steps = range(model.problem.first_step, model.problem.horizon + 1)
    known = Known(search.rng, search.parameters.bundle)
    known.add_plan(search.incumbent, steps)
    for column in columns:
        known.add_path(column.along.class_number, column.path)
    before = narrowing.pricing.bound
    envelopes = _Envelopes(
        search, Stages(narrowing), duals, known, steps,
        PathTrials(search, is_on=tries_paths), ListLengths(len(steps), search.parameters.lists),
    )  # fmt: skip
    try:
        if envelopes.try_paths():
            return
        if most_joint == math.inf or joint_states_left(narrowing) <= most_joint:
            envelopes.run(cutoff)
    finally:
        if envelopes.bound < before - CLEARLY * abs(before):
            envelopes.offer()


@dataclass
class _Envelopes:
    """The stages so far, and what is known of joint states and paths.

    Attributes
    ----------
    proved : the stages so far, and what they leave
    steps : at which views count
    trials : of the paths of all robots together
    lengths : of the lists of states
    searches : for joint states, of steps
    responses : iterations' worth of best responses for the next look for plans
    lists_stall : true once a round of lists has closed little
    """

    search: Search
    proved: Stages
    duals: Duals
    known: Known
    steps: range
    trials: PathTrials
    lengths: ListLengths
    lists_stall: bool = False
    responses: int = 0

    def __post_init__(self) -> None:
        """Begins with as many responses as the parameters say."""
        self.responses = self._parameters.responses
        self.searches = StepSearches(self.known, self.search.stop, self._parameters)

    @property
    def _parameters(self) -> EnvelopeParameters:
        return self.search.parameters.envelopes

    @property
    def narrowing(self) -> Narrowing:
        """The narrowing to better plans, after the stages so far."""
        return self.proved.narrowing

    @property
    def bound(self) -> float:
        """The bound that the stages or the paths that were tried prove."""
        return min(self.narrowing.pricing.bound, self.trials.bound)

    def run(self, cutoff: Callable[[], float]) -> None:
        """Adds stages as long as they close something; raises LimitReached."""
        for _ in range(self._parameters.most_rounds):
            self._raise_target()
            before = self.narrowing.pricing.bound
            open_ = before - cutoff()
            if open_ <= 0:
                return
            if not (self._is_small() or self._can_be_listed()):
                break
            if self._is_small():
                self._lower()
                if self.narrowing.pricing.bound <= cutoff() or self.try_paths():
                    return
            listed = not self._is_small()
            is_wide = listed and self.lengths.widening >= self._parameters.wide
            self._pay(cutoff)
            if listed and self.try_paths():
                return
            if self._has_better_plan():
                continue
            closed = (before - self.narrowing.pricing.bound) / open_
            may_grow = listed and self.lengths.can_grow
            if listed and closed < self._parameters.least_listed:
                self.lists_stall = closed < self._parameters.stalled
                self.lengths.grow()
            if listed and self._is_small():
                continue  # the next round prices all states
            if is_wide and closed < self._parameters.least_wide:
                break
            if closed < self._parameters.least_round and not may_grow:
                break
        self._raise_target()
        if self.bound > cutoff():
            self.trials.for_higher_targets(
                self.narrowing, len(self.proved.stages), self.searches.nodes, self.offer
            )

    def _has_better_plan(self) -> bool:
        """Returns True if a plan is clearly above the target of the stages."""
        return self.search.value > (1 + CLEARLY) * self.narrowing.target

    def _raise_target(self) -> None:
        """Repeats all stages for the best plan's J, if it is more: they close more states then.

        Raises
        ------
        LimitReached
            At a limit; the target and what is left are as before.
        """
        plan = self.search.incumbent
        narrowing = self.search.narrowing(self.duals) if self._has_better_plan() else None
        if plan is None or narrowing is None:
            return
        # Of the paths that are known, these are sure to be among the states that are left.
        self.known.add_plan(plan, self.steps)
        self.proved = self.proved.again(narrowing, self._tell_again)

    def _tell_again(self) -> None:
        """Reports that the search goes on; raises LimitReached."""
        self.search.stop.check()
        self.search.report_again()

    def try_paths(self) -> bool:
        """Tries all paths of better plans that are left; returns True if that has ended."""
        has_ended = self.trials.after_stages(
            self.narrowing, len(self.proved.stages), self.searches.nodes
        )
        if has_ended:
            self.offer()
        return has_ended

    def offer(self) -> None:
        """Offers the search the certificate of what is proved so far."""
        self.search.offer_spare(self.file())
        self.report()

    def file(self) -> CertificateFile:
        """Returns the certificate of the stages so far, or of the paths that were tried."""
        model, trials = self.search.model, self.trials
        is_tried = trials.bound < self.narrowing.pricing.bound
        return CertificateFile(
            scene=model.problem.name,
            digest=problem_digest(model.problem),
            method=METHOD,
            coverage_version=COVERAGE_VERSION,
            classes="single" if model.is_disaggregated else "alike",
            bound=self.bound,
            certificate=Staged(
                self.duals.certificate(model),
                self.narrowing.target,
                self.proved.stages[: trials.stages if is_tried else None],
                trials.above if is_tried else None,
            ),
        )

    def _is_small(self) -> bool:
        """Returns True if all states have prices of their own, as the searches of steps may end."""
        left = states_left(self.narrowing)[self.steps.start :]
        return int(left.sum()) <= self._most_left() and int(left.max()) <= (
            self._parameters.most_at_a_step
        )

    def _most_left(self) -> int:
        """Returns the largest number of states left at which all of them have prices."""
        if not self._can_be_listed():
            return self._parameters.most_unlisted
        parameters = self._parameters
        if self.lists_stall:
            return parameters.most_states_left
        is_few = len(self.search.model.problem.robots) <= parameters.few_robots
        return parameters.most_states_of_few if is_few else parameters.few_states_left

    def _can_be_listed(self) -> bool:
        """Returns True if searches of lists may end."""
        robots = len(self.search.model.problem.robots)
        return is_there() and robots <= self._parameters.most_listed_robots

    def _lower(self) -> None:
        """Lowers the constants of the present prices, where that takes few nodes."""
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
            # What was lowered before a limit counts, so that the certificate has to tell of it.
            self.proved = self.proved.lowered(constants)
            self.report()

    def report(self) -> None:
        """Tells what is proved so far."""
        self.search.report(self.search.snapshot(self.bound))

    def _pay(self, cutoff: Callable[[], float]) -> None:
        """Finds better prices and their constants, and adds them as a stage."""
        joints, ceilings = self._joints(cutoff)
        bundle = PriceBundle(
            self.narrowing, self.known, joints, ceilings, self.search.stop,
            self.search.parameters.bundle,
        )  # fmt: skip
        for _ in range(self._parameters.most_corrections):
            prices = bundle.run(cutoff, self.report)
            if bundle.flow:
                self._look_for_plans(bundle.flow)
            if prices is None or (bundle.has_lists and self._is_stalled(bundle.best, cutoff)):
                return
            heights = Heights(bundle, prices, self.proved, self.searches, self.lengths, self._keep)
            # If no search has ended, nothing is known that could correct the bundle.
            if heights.adopt() or not heights.waiting:
                return

    def _is_stalled(self, bound: float, cutoff: Callable[[], float]) -> bool:
        """Returns True if a lower bound would close so little that lists count as stalled."""
        before = self.narrowing.pricing.bound
        return before - bound < self._parameters.stalled * (before - cutoff())

    def _keep(self, proved: Stages) -> None:
        """Takes the stages so far, and tells what they prove; raises LimitReached."""
        self.proved = proved
        self.report()

    def _look_for_plans(self, flow: Mapping[Arc, float]) -> None:
        """Offers plans that are made of the mixture behind the latest prices.

        Raises
        ------
        LimitReached
            At a limit, in recombination.
        """
        before = self.search.value
        self.search.allow_responses(self.responses)
        self.search.look_for_plans(mixture_of_flow(self.search.model, flow))
        self.search.recombine(self.narrowing)
        self.responses = (
            self._parameters.responses
            if self.search.value > before
            else max(self.responses // 2, 1)
        )

    def _joints(
        self, cutoff: Callable[[], float]
    ) -> tuple[dict[int, JointStates], dict[int, float]]:
        """Returns the joint states with prices, and the ceilings where these are not all."""
        narrowing = self.narrowing
        if self._is_small():
            return {t: narrowing.joint_states(t) for t in self.steps}, {}
        most = self.lengths.slack(narrowing.pricing.bound - cutoff(), self._n_listed)
        joints = {t: narrowing.joint_states_of(t, self._listed(t, most)) for t in self.steps}
        return joints, {t: narrowing.ceiling(t) for t in self.steps}

    def _n_listed(self, most: float) -> int:
        """Returns the number of states up to a slack, at all steps."""
        return sum(
            int(np.count_nonzero(left[self.steps.start :] & (slack[self.steps.start :] <= most)))
            for slack, left in zip(self.narrowing.slack, self.narrowing.left, strict=True)
        )

    def _listed(self, t: int, most: float) -> list[IntArray]:
        """Returns of each class the states of a step up to a slack, not too many of the least."""
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
