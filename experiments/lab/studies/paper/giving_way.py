"""Encounters of drones: which of two gives way, and how much of its own reward this costs.

Two drones whose unconstrained plans collide cannot both keep them. In sequential planning, no drone
gives way to a later one, though it may fly elsewhere because of a still earlier one. A coordinated
plan may send the earlier drone elsewhere, at a cost to its own view, for the good of the team. This
is measured here in encounters of two drones that collide with no third drone, so that each drone
counts once. A drone's own reward is J of its path alone.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

from cocap_opt.experiments.tables.statistics import NONE, Mean
from cocap_opt.problem import Plan, Problem
from cocap_opt.referee import check

_GIVES = 1e-6  # share of its own reward; a drone that loses more gives up some of it


class Encounter(NamedTuple):
    """Two drones that collide in the unconstrained plan, and their paths in another plan."""

    scene: str
    seed: int
    robots: tuple[int, int]  # the earlier planned first
    step: int  # step of their first conflict
    own_before: tuple[float, float]  # J of each one's path alone, in the unconstrained plan
    own_after: tuple[float, float]
    moved: tuple[bool, bool]  # True if the path differs
    team: float  # J of the plan

    @property
    def given_up(self) -> tuple[float, float]:
        """Share of its own reward that each loses; negative if it gains."""
        before, after = self.own_before, self.own_after
        return _share_lost(before[0], after[0]), _share_lost(before[1], after[1])

    @property
    def earlier_gives_way(self) -> bool:
        """True if the earlier drone flies elsewhere and loses some of its own reward."""
        return self.moved[0] and self.given_up[0] > _GIVES

    @classmethod
    def all_of(cls, problem: Problem, seed: int, unconstrained: Plan, plan: Plan) -> list[Self]:
        """Finds the pairs of drones that collide in the unconstrained plan, but with no third."""
        team = check(problem, plan).reward
        found = []
        for pair, step in _apart(_first_conflicts(problem, unconstrained)).items():
            before = [_own_reward(problem, robot, unconstrained) for robot in pair]
            after = [_own_reward(problem, robot, plan) for robot in pair]
            moved = [unconstrained.paths[robot] != plan.paths[robot] for robot in pair]
            found.append(
                cls(
                    problem.name, seed, pair, step, (before[0], before[1]), (after[0], after[1]),
                    (moved[0], moved[1]), team,
                )
            )  # fmt: skip
        return found

    @staticmethod
    def most_generous(encounters: Sequence["Encounter"]) -> "Encounter | None":
        """Returns the encounter in which the earlier drone gives up most; None if none does."""
        giving = [e for e in encounters if e.earlier_gives_way]
        return max(giving, key=lambda e: e.given_up[0], default=None)

    @staticmethod
    def counted(planner: str, encounters: Sequence["Encounter"]) -> dict[str, str]:
        """Returns a planner's row: how many drones give way in encounters, and at what cost."""
        moved = [e.moved for e in encounters]
        earlier = [100 * e.given_up[0] for e in encounters if e.earlier_gives_way]
        return {
            "planner": planner,
            "encounters": str(len(encounters)),
            "only the earlier flies elsewhere": str(moved.count((True, False))),
            "only the later": str(moved.count((False, True))),
            "both": str(moved.count((True, True))),
            "earlier gives up own reward": str(len(earlier)),
            "share given up (%)": Mean.in_words(earlier, 2),
            "most (%)": f"{max(earlier):.2f}" if earlier else NONE,
        }


def _own_reward(problem: Problem, robot: int, plan: Plan) -> float:
    """Returns J of one robot's path, as if it were alone."""
    alone = problem.replace(robots=(problem.robots[robot],))
    return check(alone, Plan(paths=(plan.paths[robot],))).reward


def _first_conflicts(problem: Problem, plan: Plan) -> dict[tuple[int, int], int]:
    """Returns the step of each pair's first conflict."""
    steps: dict[tuple[int, int], int] = {}
    for conflict in plan.conflicts(problem):
        steps.setdefault(conflict.robots, conflict.t)
    return steps


def _apart(steps: Mapping[tuple[int, int], int]) -> dict[tuple[int, int], int]:
    """Returns the pairs that share no drone with another pair."""
    partners = Counter(robot for pair in steps for robot in pair)
    return {
        pair: step for pair, step in steps.items() if all(partners[robot] == 1 for robot in pair)
    }


def _share_lost(before: float, after: float) -> float:
    return (before - after) / before if before > 0 else 0.0
