"""Trials of the paths of all robots together: when they are made, and what they prove."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from cocap_opt.compiling import Kernel, functions, marks
from cocap_opt.formulations.certificates import Staged, verify
from cocap_opt.formulations.certificates.format import Stage
from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    best_plan_from,
    compiled_search,
)
from cocap_opt.formulations.certificates.staged.joint_paths import BestPlan
from cocap_opt.formulations.column_generation.parameters import (
    DEFAULTS,
    EnvelopeParameters,
    MoveParameters,
    Parameters,
    TrialParameters,
)
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.step_envelopes import envelopes, path_trials
from cocap_opt.formulations.column_generation.step_envelopes.counting import states_left
from cocap_opt.formulations.column_generation.step_envelopes.middle_step import MiddleStep
from cocap_opt.formulations.column_generation.step_envelopes.path_trials import (
    EndedTrial,
    PathTrials,
)
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.result import OPTIMALITY, certify
from cocap_opt.model import compiled
from cocap_opt.problem import Plan
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Limit, LimitReached, Stop, TimeLimit


def solved_root() -> Root:
    """The root of the bottleneck before its cuts, with a plan."""
    root = Root.of(Search(compiled(load_scene("bottleneck", 0).replace(horizon=6))), OPTIMALITY)
    for column in root.search.alone.columns:
        root.relaxation.master.add(column)
    root.relaxation.solve(root.cutoff, until_cuts=True)
    root.relaxation.round_to_plans()
    return root


@pytest.fixture
def trials() -> PathTrials:
    """The trials of a root that has no stages yet."""
    return PathTrials(solved_root().search)


@pytest.fixture
def narrowing() -> Narrowing:
    """What the root leaves, before any state is closed."""
    root = solved_root()
    duals = root.relaxation.best.duals.certificate(root.search.model)
    return Narrowing.of(root.search.model, duals, root.search.value)


class Ending:
    """Takes the place of the trials' searches: those of targets below one do not end.

    Parameters
    ----------
    doubling : by how much lower a target must be for a trial to take twice the nodes
    """

    def __init__(self, least: float, doubling: float = np.inf) -> None:
        self.least, self.doubling = least, doubling
        self.allowed, self.targets = list[int](), list[float]()

    def __call__(
        self, narrowing: Narrowing, from_step: int, most_nodes: int, stop: Stop
    ) -> BestPlan:
        """Ends unless the target is too low, and records its arguments."""
        assert from_step == 0
        self.allowed.append(most_nodes)
        self.targets.append(narrowing.target)
        if narrowing.target < self.least:
            raise NotEndedError
        lower = (self.targets[0] - narrowing.target) / self.doubling
        return BestPlan(narrowing, -np.inf, nodes=int(1000 * 2**lower))


def replace_trials(monkeypatch: pytest.MonkeyPatch, explored: Callable[..., BestPlan]) -> None:
    """Replaces the explorations of all trials; no step in the middle is looked for."""
    monkeypatch.setattr(path_trials, "best_plan_from", explored)
    monkeypatch.setattr(MiddleStep, "choose", lambda *_: None)


def test_failed_trials_are_made_again_once_more_is_allowed_or_less_is_open(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not otherwise, as they would fail again."""
    ending = Ending(np.inf)
    replace_trials(monkeypatch, ending)
    fewest = trials._fewest_nodes()
    assert not trials.after_stages(Stages(narrowing), 0)
    assert ending.allowed == [fewest]
    assert not trials.after_stages(
        Stages(narrowing), int(2.5 * fewest / DEFAULTS.trials.times_nodes)
    )
    assert len(ending.allowed) == 1
    assert not trials.after_stages(Stages(narrowing), 100 * fewest)
    assert len(ending.allowed) == 2 and ending.allowed[1] > 2 * fewest
    constants = narrowing.constants - 0.5 * narrowing.room_above(narrowing.target) / len(
        narrowing.constants
    )
    narrowing = replace(narrowing, constants=constants)
    assert not trials.after_stages(Stages(narrowing), 100 * fewest)
    assert len(ending.allowed) == 3
    assert trials.best is None and trials.nodes == sum(ending.allowed)


def test_trials_are_short_where_there_is_no_time_to_compile(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Plain searches of as many nodes as compiled ones would take all of a short limit; stored code
    is loaded at once.
    """
    ending = Ending(np.inf)
    replace_trials(monkeypatch, ending)
    monkeypatch.setattr(functions, "is_there", lambda: True)
    for is_kept in (False, True):
        monkeypatch.setattr(marks, "is_marked", lambda module, is_kept=is_kept: is_kept)
        monkeypatch.setattr(compiled_search, "KERNEL", Kernel("any", "a search", compiling=5.0))
        trials.search.stop = TimeLimit(1.0)
        assert not trials.after_stages(Stages(narrowing), 0)
    assert ending.allowed == [DEFAULTS.trials.fewest_plain_nodes, DEFAULTS.trials.fewest_nodes]


def test_higher_targets_come_down_until_a_trial_fails(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bound is the last target for which one has ended."""
    value, bound = trials.search.value, narrowing.bound
    ending = Ending(value + 0.4 * (bound - value))
    replace_trials(monkeypatch, ending)
    told: list[float] = []
    proved = Stages(narrowing, (Stage(),))
    trials.for_higher_targets(proved, 10, lambda: told.append(trials.bound))
    shares = [(target - value) / (bound - value) for target in ending.targets]
    less, least = DEFAULTS.trials.less, DEFAULTS.trials.least_less
    ended = [share for share in shares if share >= 0.4 - 1e-9]
    assert ended == pytest.approx([1 - less * k for k in range(1, len(ended) + 1)])
    # What has not ended is tried again with smaller steps.
    failed = [ended[-1] - share for share in shares[len(ended) :]]
    assert failed == pytest.approx([less / 2**k for k in range(len(failed))])
    assert failed[-1] == pytest.approx(least)
    assert trials.best is not None and trials.best.stages == proved.stages
    last = ending.targets[len(ended) - 1]
    assert trials.bound == pytest.approx(last, rel=1e-9) and trials.best.above == last
    assert told == sorted(told, reverse=True) and told[-1] == trials.bound
    assert min(ending.allowed) >= DEFAULTS.trials.fewest_nodes // 20


def test_targets_begin_below_what_earlier_trials_have_proved(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They lie between the best plan and the lowest bound so far."""
    value, bound = trials.search.value, narrowing.bound
    ending = Ending(-np.inf)
    replace_trials(monkeypatch, ending)
    trials.best = EndedTrial(value + 0.4 * (bound - value), value, 0, ())
    trials.for_higher_targets(Stages(narrowing), 10, lambda: None)
    shares = [(target - value) / (bound - value) for target in ending.targets]
    assert shares[0] == pytest.approx(0.4 - DEFAULTS.trials.less)


def test_another_step_in_the_middle_is_tried_once_a_trial_fails(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each step fails once at the same target; then trials end."""
    tried: list[int] = []

    def failing(narrowing: Narrowing, from_step: int, most_nodes: int, stop: Stop) -> BestPlan:
        tried.append(from_step)
        raise NotEndedError

    def choose(self: MiddleStep, *_: object) -> None:
        self.from_step = (self.from_step + 1) % 3

    monkeypatch.setattr(path_trials, "best_plan_from", failing)
    monkeypatch.setattr(MiddleStep, "choose", choose)
    trials.for_higher_targets(Stages(narrowing), 10**7, lambda: None)
    assert [*dict.fromkeys(tried)] == [1, 2, 0]
    assert tried[-2:] == [2, 0] and trials.best is None


def test_higher_targets_come_down_in_larger_steps_where_trials_grow_slowly(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each takes about as many times the nodes as is aimed at; a step too far is halved."""
    value, bound = trials.search.value, narrowing.bound
    ending = Ending(value + 0.3 * (bound - value), doubling=0.08 * (bound - value))
    replace_trials(monkeypatch, ending)
    trials.for_higher_targets(Stages(narrowing), 10, lambda: None)
    shares = [(target - value) / (bound - value) for target in ending.targets]
    times = DEFAULTS.trials.aimed_times
    step = 0.08 * np.log2(times)
    # The first trials only show how fast nodes grow; those below 0.3 do not end.
    assert shares[:2] == pytest.approx([0.95, 0.9])
    ended = [share for share in shares if share >= 0.3]
    assert np.diff(ended[1:4]) == pytest.approx(-step, rel=0.02)
    assert trials.bound == pytest.approx(value + ended[-1] * (bound - value), rel=1e-9)
    assert ended[-1] < 0.3 + 2 * DEFAULTS.trials.least_less


def test_trials_end_before_they_are_long_unless_time_is_kept_for_them(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A few times the nodes of the stages, or of the smallest trial."""
    value, bound = trials.search.value, narrowing.bound
    most = DEFAULTS.trials.times_stages * DEFAULTS.trials.fewest_nodes
    shares = []
    for to_the_end in (False, True):
        ending = Ending(-np.inf, doubling=0.04 * (bound - value))
        replace_trials(monkeypatch, ending)
        trials.for_higher_targets(Stages(narrowing), 10, lambda: None, to_the_end)
        shares.append((ending.targets[-1] - value) / (bound - value))
    assert 1000 * 2 ** ((0.95 - shares[0]) / 0.04) == pytest.approx(most, rel=0.5)
    assert shares[1] == pytest.approx(0.0)


def test_a_limit_ends_trials_and_keeps_what_they_proved(
    trials: PathTrials, narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bound of the targets before stays."""
    ending = Ending(-np.inf)

    def limited(narrowing: Narrowing, from_step: int, most_nodes: int, stop: Stop) -> BestPlan:
        if len(ending.targets) == 2:
            raise LimitReached(Limit.TIME)
        return ending(narrowing, from_step, most_nodes, stop)

    replace_trials(monkeypatch, limited)
    with pytest.raises(LimitReached):
        trials.for_higher_targets(Stages(narrowing), 0, lambda: None)
    assert trials.best is not None and trials.best.above == ending.targets[1]


class Countdown(Stop):
    """A limit whose time passes only when it is told."""

    def __init__(self, seconds: float) -> None:
        self.left = seconds

    def reached(self) -> Limit | None:
        """The limit, once no time is left."""
        return None if self.left > 0 else Limit.TIME

    @property
    def seconds_left(self) -> float:
        """What is left."""
        return self.left


@pytest.mark.parametrize("seconds", [100.0, np.inf])
@pytest.mark.parametrize("tries_paths", [True, False])
def test_part_of_a_time_limit_is_kept_for_paths(
    seconds: float, tries_paths: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stages end before the limit, and go on if paths leave time; nothing is kept in vain."""
    root, told = solved_root(), list[tuple[str, float]]()
    root.search.stop = stop = Countdown(seconds)

    def add_stages(self: envelopes._Envelopes, cutoff: object) -> None:
        told.append(("stages", self.search.stop.seconds_left))
        stop.left = min(stop.left, 10.0)
        self.search.stop.check()

    def explore_paths(self: envelopes._Envelopes, cutoff: object, to_the_end: bool = False) -> None:
        told.append(("paths", self.search.stop.seconds_left))

    monkeypatch.setattr(envelopes._Envelopes, "_add_stages", add_stages)
    monkeypatch.setattr(envelopes._Envelopes, "_explore_paths", explore_paths)
    monkeypatch.setattr(envelopes._Envelopes, "try_paths", lambda _: False)
    duals = root.relaxation.best.duals
    envelopes.step_envelopes(root.search, duals, root.cutoff, tries_paths=tries_paths)
    kept = DEFAULTS.trials.time_kept * seconds
    if tries_paths and seconds < np.inf:
        before = [("stages", seconds - kept), ("paths", 10.0)]
        assert told == [*before, ("stages", 10.0), ("paths", 10.0)]
    else:
        assert told == [("stages", seconds), ("paths", 10.0)]
    assert root.search.stop is stop


def test_no_stages_follow_paths_that_have_closed_the_gap(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The bound of the trials counts, not only that of the stages, which would use up the time."""
    root, told = solved_root(), list[str]()
    root.search.stop = stop = Countdown(100.0)

    def add_stages(self: envelopes._Envelopes, cutoff: object) -> None:
        told.append("stages")
        stop.left = 10.0
        self.search.stop.check()

    def higher_targets(self: PathTrials, *_: object) -> None:
        told.append("paths")
        self.best = EndedTrial(self.search.value, self.search.value, 0, ())

    monkeypatch.setattr(envelopes._Envelopes, "_add_stages", add_stages)
    monkeypatch.setattr(PathTrials, "for_higher_targets", higher_targets)
    monkeypatch.setattr(envelopes._Envelopes, "try_paths", lambda _: False)
    envelopes.step_envelopes(root.search, root.relaxation.best.duals, root.cutoff)
    assert told == ["stages", "paths"]
    assert root.search.spare is not None
    assert root.search.spare.proved <= root.cutoff()


@pytest.mark.slow
@pytest.mark.parametrize(("share", "middle"), [(0.75, 0), (0.25, 0), (0.25, 4)])
def test_what_trials_for_higher_targets_prove_is_verified(
    share: float, middle: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file says above which J plans were tried, and its bound is that."""
    root = solved_root()
    root.search.parameters = Parameters(
        trials=TrialParameters(less=1 - share),
        envelopes=EnvelopeParameters(most_rounds=0),
        moves=MoveParameters(most_iterations=0),
    )
    bound = root.relaxation.best.bound
    above = root.search.value + share * (bound - root.search.value)

    def only_first(narrowing: Narrowing, from_step: int, most_nodes: int, stop: Stop) -> BestPlan:
        if narrowing.target < above * (1 - 1e-12):
            raise NotEndedError
        return best_plan_from(narrowing, middle, most_nodes, stop)

    replace_trials(monkeypatch, only_first)
    monkeypatch.setattr(MiddleStep, "choose", lambda self, *_: setattr(self, "from_step", middle))
    monkeypatch.setattr(PathTrials, "after_stages", lambda *_: False)
    envelopes.step_envelopes(root.search, root.relaxation.best.duals, root.cutoff)
    file = root.search.spare
    assert file is not None and root.search.value < file.proved < bound
    assert file.certificate.paths_above == pytest.approx(above, rel=1e-9)
    assert file.certificate.paths_from == (middle or None)
    assert file.proved == pytest.approx(above, rel=1e-9)
    assert verify(root.search.model.problem, file).bound == file.proved


@pytest.mark.long
def test_stages_are_repeated_for_a_better_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """They close more states for its J, and a file claims what they prove then."""
    monkeypatch.setattr(envelopes._Envelopes, "_look_for_plans", lambda *_: None)
    root = solved_root()
    search, duals = root.search, root.relaxation.best.duals
    better = search.incumbent
    assert better is not None
    search.incumbent = Incumbent.of_plan(search.model, Plan.hovering(search.model.problem))
    narrowing = search.narrowing(duals)
    search.parameters = Parameters(
        envelopes=EnvelopeParameters(most_rounds=1), moves=MoveParameters(most_iterations=0)
    )
    envelopes.step_envelopes(search, duals, root.cutoff, tries_paths=False)
    assert narrowing is not None and search.spare is not None
    proved = Stages(narrowing)
    for stage in search.spare.certificate.stages:
        proved = proved.then(stage)
    before = proved.narrowing
    assert len(proved.stages) == 2 and before.pricing.bound == search.spare.proved
    search.offer(better)
    higher = search.narrowing(duals)
    assert higher is not None
    asked: list[None] = []
    after = proved.again(higher, lambda: asked.append(None)).narrowing
    assert len(asked) == len(proved.stages)
    assert after.target == better.value > before.target
    assert states_left(after).sum() < states_left(before).sum()
    assert after.bound <= before.bound + before.rounding
    numbers = Staged(duals.certificate(search.model), after.target, proved.stages)
    file = certify(search.model.problem, search.model, "again", numbers)
    assert verify(search.model.problem, file, model=search.model).bound == file.bound
    assert file.bound == after.pricing.bound


def test_a_better_plan_found_in_a_round_is_the_target_of_the_next(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also where the round has closed nothing, after which there would be none."""
    root = solved_root()
    search, duals = root.search, root.relaxation.best.duals
    better = search.incumbent
    assert better is not None
    search.incumbent = Incumbent.of_plan(search.model, Plan.hovering(search.model.problem))
    targets, paths = [], []

    def finding(self: envelopes._Envelopes, _: object) -> None:
        targets.append(self.narrowing.target)
        paths.append({path for _, path in self.known.paths})
        search.offer(better)

    monkeypatch.setattr(envelopes._Envelopes, "_add_priced_stages", finding)
    envelopes.step_envelopes(search, duals, root.cutoff, tries_paths=False)
    assert targets[0] < better.value
    assert targets[1] == better.value
    assert paths[1] >= set(better.paths)
