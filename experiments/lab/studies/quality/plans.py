"""Plans of a scene by good and by bad planners, with their quality and J."""

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from cocap_opt.coordination.low_level import SingleRobotPath, SingleRobotTask, value_iteration
from cocap_opt.coordination.responses import Responses, followed, one_by_one
from cocap_opt.experiments.lab.studies.quality.rows import PlanRow, rounded
from cocap_opt.footage.quality import Quality
from cocap_opt.graph.value_iteration import backward_sweep, best_path
from cocap_opt.model import compiled
from cocap_opt.planners.sequential import sequential
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.engine import run
from cocap_opt.run.judged import Judged
from cocap_opt.stop import TimeLimit, never

ORDER, RANDOM, HOVERING = "order", "random", "hovering"
# The recommended planner at the time when the stored results were made.
SEARCHED = "cocap-lns"
TRIANGULATED = ("sequential", SEARCHED, "formation", f"{RANDOM} 0")
_GOOD = ("sequential", "sequential-rounds", SEARCHED)
_ORDERS, _WANDERERS = 8, 3
ALL = (
    *_GOOD, "formation", "one-step", HOVERING,
    *(f"{RANDOM} {k}" for k in range(_WANDERERS)), *(f"{ORDER} {k}" for k in range(_ORDERS)),
)  # fmt: skip


class PlannedQuality(NamedTuple):
    """A plan and its quality."""

    planner: str
    plan: Plan
    quality: Quality
    row: PlanRow


def is_good(planner: str) -> bool:
    """Returns True for planners that maximise J over all steps."""
    return planner in _GOOD or planner.startswith(ORDER)


def plans_of(
    problem: Problem, seed: int, names: Sequence[str], limit: float
) -> Iterator[PlannedQuality]:
    """Yields plans that obey the rules; planners that find none are omitted.

    Parameters
    ----------
    seed : of the problem
    names : names in `ALL`, or of any planner
    limit : time limit (s) of each planner that has one
    """
    for name in names:
        plan = _planned(problem, name, limit)
        judged = None if plan is None else Judged.of_plan(problem, plan)
        if plan is not None and judged is not None and judged.valid:
            quality = Quality.of(problem, plan)
            found = quality.summary
            row = PlanRow(
                problem.name, seed, name, rounded(judged.reward, 8), rounded(found.by_two),
                rounded(found.apart), rounded(found.median),
            )  # fmt: skip
            yield PlannedQuality(name, plan, quality, row)


def random_plan(problem: Problem, seed: int) -> Plan | None:
    """Returns a random plan that obeys the rules; None if there is none.

    Each drone takes its best path for random rewards, clear of the drones before it.
    """
    rng = np.random.default_rng([seed, 1])

    def wander(task: SingleRobotTask) -> SingleRobotPath:
        model, robot_class = task.model, task.model.class_of[task.robot]
        reward = robot_class.graph.no_reward(model.problem.horizon)
        reward += rng.random(reward.shape)
        value = backward_sweep(
            robot_class.graph, reward, charges=task.charges, goal=robot_class.goal
        )
        path = best_path(robot_class.graph, value, model.starts(task.robot), charges=task.charges)
        if path is None:
            return SingleRobotPath(None, model.problem.no_pixels(), 0)
        return SingleRobotPath(tuple(path), model.robot_pixels(task.robot, tuple(path)), 0)

    return sequential(problem, low_level=wander).plan


def plan_in_order(problem: Problem, seed: int) -> Plan | None:
    """Returns the plan of sequential planning in a random order; None if it finds none."""
    order = np.random.default_rng([seed, 2]).permutation(len(problem.robots)).tolist()
    responses = Responses(value_iteration, never)
    nobody = responses.nobody(problem)
    team, _ = followed(nobody, one_by_one(nobody, responses, order))
    return compiled(problem).plan(team.paths) if team.is_whole else None


def _planned(problem: Problem, name: str, limit: float) -> Plan | None:
    """Returns the plan of a name; None if there is none."""
    kind, _, number = name.partition(" ")
    if name == HOVERING:
        return Plan.hovering(problem)
    if kind in _DRAWN:
        return _DRAWN[kind](problem, int(number))
    compiled(problem).prepare_all()
    plan: Plan | None = run(problem, name, TimeLimit(limit)).result.plan
    return plan


_DRAWN: dict[str, Callable[[Problem, int], Plan | None]] = {
    RANDOM: random_plan, ORDER: plan_in_order
}  # fmt: skip
