"""The step from which large trials explore joint paths: the choice, and the nodes it takes."""

import numpy as np
import pytest
from random_certificates import random_narrowing
from strategies import tiny

from cocap_opt.formulations.certificates.staged import Narrowing, NotEndedError
from cocap_opt.formulations.certificates.staged.joint_paths import BestPlan
from cocap_opt.formulations.column_generation.parameters import MiddleParameters
from cocap_opt.formulations.column_generation.step_envelopes import middle_step
from cocap_opt.formulations.column_generation.step_envelopes.middle_step import MiddleStep
from cocap_opt.model import compiled
from cocap_opt.problem import Objective
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import Stop, never

HORIZON = 8


class Explored:
    """Replaces explorations; their number of nodes grows with the distance from the best step.

    Parameters
    ----------
    best : the best step
    nodes : nodes from there at the first target; they double with the room below the bound
    """

    def __init__(self, best: int, nodes: int) -> None:
        self.best, self.nodes = best, nodes
        self.rooms, self.tried, self.spent = list[float](), list[int](), 0

    def __call__(
        self, narrowing: Narrowing, from_step: int, most_nodes: int, stop: Stop
    ) -> BestPlan:
        """Ends unless it needs too many nodes, and records its arguments."""
        self.rooms.append(narrowing.bound - narrowing.target)
        self.tried.append(from_step)
        times = self.rooms[-1] / self.rooms[0] if self.rooms[0] > 0 else 1.0
        nodes = int(self.nodes * times * (1 + abs(from_step - self.best)))
        self.spent += min(nodes, most_nodes)
        if nodes > most_nodes:
            raise NotEndedError
        return BestPlan(narrowing, -np.inf, nodes=nodes)


@pytest.fixture(scope="module")
def narrowing() -> Narrowing:
    """The states that random multipliers leave of a scene with a horizon of `HORIZON`."""
    model = compiled(load_scene("corridor", 0).replace(horizon=HORIZON))
    return random_narrowing(model, 0.0, np.random.default_rng(0))


@pytest.mark.parametrize("best", [0, 5, HORIZON])
@pytest.mark.parametrize("most_steps", [4, 30])
def test_the_step_with_fewest_nodes_is_chosen(
    narrowing: Narrowing, best: int, most_steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even if only its neighbours are tried at first; targets fall until it takes enough nodes."""
    explored = Explored(best, 1000)
    monkeypatch.setattr(middle_step, "best_plan_from", explored)
    middle = MiddleStep(MiddleParameters(most_steps=most_steps))
    middle.choose(narrowing, 1_000_000, never)
    assert middle.from_step == best
    assert middle.nodes == explored.spent
    assert explored.rooms == sorted(explored.rooms)
    at_first = explored.rooms.count(explored.rooms[0])
    assert at_first <= most_steps + 2 + 2 * HORIZON // most_steps
    later = len(explored.rooms) - at_first
    assert 0 < later <= 2 * MiddleParameters().most_kept
    assert explored.nodes * explored.rooms[-1] / explored.rooms[0] >= 3000


def test_the_step_stays_where_no_exploration_ends(
    narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each then counts as the largest number of nodes that it may take."""
    explored = Explored(3, 10**9)
    monkeypatch.setattr(middle_step, "best_plan_from", explored)
    middle = MiddleStep(MiddleParameters(), from_step=7)
    middle.choose(narrowing, 1_000_000, never)
    assert middle.from_step == 7 == explored.tried[0]
    assert middle.nodes == MiddleParameters().many * 1_000_000 * len(explored.tried)


def test_a_bound_that_is_no_more_than_the_best_plan_is_no_error(
    narrowing: Narrowing, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The target is then the best plan's J."""
    explored = Explored(3, 10)
    monkeypatch.setattr(middle_step, "best_plan_from", explored)
    middle = MiddleStep(MiddleParameters())
    middle.choose(narrowing.above(narrowing.bound + 1.0), 10**6, never)
    assert middle.from_step == 3


def test_paths_begin_at_the_start_where_moves_are_rewarded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing is explored then."""
    model = compiled(tiny().replace(objective=Objective(keep_cell=1.0)))
    rewarded = random_narrowing(model, 0.0, np.random.default_rng(0))
    monkeypatch.setattr(middle_step, "best_plan_from", None)
    middle = MiddleStep(MiddleParameters())
    middle.choose(rewarded, 1_000_000, never)
    assert (middle.from_step, middle.nodes) == (0, 0)
