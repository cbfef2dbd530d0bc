"""Rewards per step of the paper's planners, as a table that figures are drawn from."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple, Self

from cocap_opt.output.files import load_csv
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check

CURVES = "curves.csv"


class StepReward(NamedTuple):
    """The view reward of a plan at one step."""

    scene: str
    seed: int
    planner: str
    step: int
    reward: float  # sqrt(px/m2), or as the scene counts

    @classmethod
    def all_of(cls, problem: Problem, seed: int, planner: str, plan: Plan) -> list[Self]:
        """Returns the rewards of a plan at the steps 1..T."""
        rewards = check(problem, plan).reward_per_step
        return [cls(problem.name, seed, planner, t, r) for t, r in enumerate(rewards, start=1)]

    @classmethod
    def read(cls, path: Path) -> list[Self]:
        """Returns the rewards that are stored in a file."""
        return load_csv(path, cls, "cocap-opt study paper")


Curves = dict[str, dict[int, list[float]]]  # rewards at the steps 1..T by planner and seed


def curves_of(rewards: Sequence[StepReward]) -> dict[str, Curves]:
    """Returns the curves of each scene."""
    found: dict[str, Curves] = {}
    for one in sorted(rewards, key=lambda one: one.step):
        planners = found.setdefault(one.scene, {})
        planners.setdefault(one.planner, {}).setdefault(one.seed, []).append(one.reward)
    return found
