"""Trials of the paths of all robots together: when they are made, and what they prove."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from roots import solved_root

from cocap_opt.compiling import Kernel, functions, marks
from cocap_opt.formulations.certificates import Staged, verify
from cocap_opt.formulations.certificates.staged import (
    Narrowing,
    NotEndedError,
    compiled_search,
)
from cocap_opt.formulations.certificates.staged.joint_paths import BestPlan
from cocap_opt.formulations.column_generation.parameters import (
    DEFAULTS,
    EnvelopeParameters,
    MoveParameters,
    Parameters,
)
from cocap_opt.formulations.column_generation.primal.incumbent import Incumbent
from cocap_opt.formulations.column_generation.step_envelopes import envelopes, path_trials
from cocap_opt.formulations.column_generation.step_envelopes.counting import states_left
from cocap_opt.formulations.column_generation.step_envelopes.middle_step import MiddleStep
from cocap_opt.formulations.column_generation.step_envelopes.path_trials import (
    PathTrials,
)
from cocap_opt.formulations.column_generation.step_envelopes.stages import Stages
from cocap_opt.formulations.column_generation.step_envelopes.tail_search import (
    ProvedTails,
    TailSearch,
)
from cocap_opt.formulations.result import certify
from cocap_opt.problem import Plan
from cocap_opt.stop import Limit, Stop, TimeLimit


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

    def add_stages(self: envelopes._Envelopes) -> None:
        told.append(("stages", self.search.stop.seconds_left))
        stop.left = min(stop.left, 10.0)
        self.search.stop.check()

    def explore_tails(self: envelopes._Envelopes, to_the_end: bool = False) -> None:
        told.append(("paths", self.search.stop.seconds_left))

    monkeypatch.setattr(envelopes._Envelopes, "_add_stages", add_stages)
    monkeypatch.setattr(envelopes._Envelopes, "_explore_tails", explore_tails)
    monkeypatch.setattr(envelopes._Envelopes, "try_paths", lambda _: False)
    duals = root.relaxation.best.duals
    envelopes.step_envelopes(root.search, duals, root.gap, tries_paths=tries_paths)
    kept = DEFAULTS.tails.time_kept * seconds
    if tries_paths and seconds < np.inf:
        before = [("stages", seconds - kept), ("paths", 10.0)]
        assert told == [*before, ("stages", 10.0), ("paths", 10.0)]
    else:
        assert told == [("stages", seconds), ("paths", 10.0)]
    assert root.search.stop is stop


def test_no_stages_follow_tails_that_have_closed_the_gap(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The bound of the tails counts, not only that of the stages, which would use up the time."""
    root, told = solved_root(), list[str]()
    root.search.stop = stop = Countdown(100.0)

    def add_stages(self: envelopes._Envelopes) -> None:
        told.append("stages")
        stop.left = 10.0
        self.search.stop.check()

    def at_the_end(self: TailSearch, *_: object) -> None:
        told.append("tails")
        self.best = ProvedTails(self.search.value, (), ())

    monkeypatch.setattr(envelopes._Envelopes, "_add_stages", add_stages)
    monkeypatch.setattr(TailSearch, "at_the_end", at_the_end)
    monkeypatch.setattr(envelopes._Envelopes, "try_paths", lambda _: False)
    envelopes.step_envelopes(root.search, root.relaxation.best.duals, root.gap)
    assert told == ["stages", "tails"]
    assert root.search.spare is not None
    assert root.search.spare.proved <= root.cutoff()


@pytest.mark.long
def test_stages_are_repeated_for_a_better_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """They close more states for its J, and a file claims what they prove then."""
    monkeypatch.setattr(envelopes._Envelopes, "_look_for_plans", lambda *_: None)
    root = solved_root()
    search, duals = root.search, root.relaxation.best.duals
    better = search.incumbent
    assert better is not None
    search.incumbent = Incumbent.of_plan(search.model, Plan.hovering(search.model.problem))
    narrowing = search.narrowing(duals, search.value)
    search.parameters = Parameters(
        envelopes=EnvelopeParameters(most_rounds=1), moves=MoveParameters(most_iterations=0)
    )
    envelopes.step_envelopes(search, duals, root.gap, tries_paths=False)
    assert narrowing is not None and search.spare is not None
    proved = Stages(narrowing)
    for stage in search.spare.certificate.stages:
        proved = proved.then(stage)
    before = proved.narrowing
    assert len(proved.stages) == 2 and before.pricing.bound == search.spare.proved
    search.offer(better)
    higher = search.narrowing(duals, search.value)
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

    def finding(self: envelopes._Envelopes) -> None:
        targets.append(self.narrowing.target)
        paths.append({path for _, path in self.known.paths})
        search.offer(better)

    monkeypatch.setattr(envelopes._Envelopes, "_add_priced_stages", finding)
    envelopes.step_envelopes(search, duals, root.gap, tries_paths=False)
    assert targets[0] < better.value
    assert targets[1] == better.value
    assert paths[1] >= set(better.paths)
