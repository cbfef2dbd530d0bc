"""The rest of a mission: the scene from a step on, and plans that are cut there and joined again.

A mission is flown up to a step k. What is left is a scene as any other, which begins at step k:
people walk on from there, each drone starts in the state in which it is, and T - k moves are left.
Views at step k are those of states that nothing can change; they belong to what was flown. So

    J of the whole flight = J of what was flown, up to step k + J of the rest

for returns of each step. Where pixels add up over time, the root includes those from before step k
and those after it: there is no such scene, and it is refused.

A drone may be lost at step k. It contributes nothing from step k on: its views at steps before k
count, and its moves up to there. It has left the scene; what becomes of it is not looked at.
"""

from collections.abc import Sequence
from typing import NamedTuple

from cocap_opt.data import FieldError, ProblemError
from cocap_opt.problem import Actor, Plan, Problem, Robot, State
from cocap_opt.referee import check
from cocap_opt.run.view_share import most_views, views_alone, views_asked, views_to_keep
from cocap_opt.text import shortened

_ROUNDING = 1e-9  # relative, of a share of views
_NO_HOMES = "homes and batteries are not looked at in the rest: leave time for the ways home"
_MOST_LETTERS = 200  # of the name, before the words for the rest


class Rest(NamedTuple):
    """The rest of a mission, and what was flown before.

    Attributes
    ----------
    scene : from step k on, with the drones that still fly; it knows nothing of the mission
    mission : the whole scene
    flown : [R] states of each drone at the steps 0..k
    drones : numbers of those that still fly, in the order of the rest's robots
    reward_flown : J of what was flown, with all drones at the steps before k, and at step k with
        those that still fly
    message : what is out of reach now, or not looked at, in words; empty if nothing is
    """

    scene: Problem
    mission: Problem
    flown: Plan
    drones: tuple[int, ...]
    reward_flown: float
    message: str = ""

    @classmethod
    def of(cls, mission: Problem, plan: Plan, step: int, lost: Sequence[int] = ()) -> "Rest":
        """Returns the rest of a mission from a step on.

        Parameters
        ----------
        mission : the whole scene; its people may walk differently than those that the plan is for
        plan : of which the first steps are flown; what comes after them is not looked at
        step : k, from 1 to T - 1
        lost : numbers of the drones that are lost at step k

        Raises
        ------
        FieldError
            If there is no such step, or there are no such drones; one line.
        ProblemError
            If the flown part breaks a rule of the scene, or pixels add up over time; one line.
        """
        _require(mission, plan, step, lost)
        drones = tuple(i for i in range(len(mission.robots)) if i not in lost)
        flown = Plan(paths=tuple(path[: step + 1] for path in plan.paths))
        _require_flown(mission, flown)
        scene = _from_step(mission, flown, step, drones)
        share, message = _share_left(mission, flown, scene, drones)
        if scene.objective.views is not None:
            views = scene.objective.views.replace(share=share)
            scene = scene.replace(objective=scene.objective.replace(views=views))
        reward = _reward(mission, flown, drones)
        if mission.robots[0].home is not None:
            message = "; ".join(filter(None, (message, _NO_HOMES)))
        return cls(scene, mission, flown, drones, reward, message)

    @property
    def step(self) -> int:
        """The step at which the rest begins, k."""
        return self.mission.horizon - self.scene.horizon

    def of_plan(self, plan: Plan) -> Plan:
        """Returns the rest of a plan of the whole mission."""
        return Plan(paths=tuple(plan.paths[i][self.step :] for i in self.drones))

    def joined(self, plan: Plan) -> Plan | None:
        """Returns the plan of the whole mission: the steps flown, then a plan of the rest.

        None where a drone is lost: a plan has states of all drones at all steps.
        """
        if len(self.drones) < len(self.mission.robots):
            return None
        both = zip(self.flown.paths, plan.paths, strict=True)
        return Plan(paths=tuple(path[:-1] + rest for path, rest in both))


def _require(mission: Problem, plan: Plan, step: int, lost: Sequence[int]) -> None:
    """Checks that there are such a step, such drones, and a plan of so many of both."""
    horizon, robots = mission.horizon, len(mission.robots)
    if horizon < 2:
        raise FieldError("from_step", f"must be left out: {mission.name} has one step only")
    if not 1 <= step < horizon:
        words = f"must be a step from 1 to {horizon - 1}, of the steps 0..{horizon}, not {step}"
        raise FieldError("from_step", words)
    if mission.objective.over_time:
        raise ProblemError(
            "objective.over_time: must be false for a rest to be planned: where pixels add up over "
            f"time, those from before step {step} are under the same root as later ones"
        )
    if len(plan.paths) != robots:
        words = f"must be {robots}, one for each drone, not {len(plan.paths)}"
        raise ProblemError(f"paths: {words}")
    for i, path in enumerate(plan.paths):
        if len(path) != horizon + 1:
            words = f"must have {horizon + 1} states, for the steps 0..{horizon}, not {len(path)}"
            raise ProblemError(f"paths[{i}]: {words}")
    for drone in lost:
        if not 0 <= drone < robots:
            raise FieldError("without", f"must be numbers of drones, 0..{robots - 1}, not {drone}")
    if len(set(lost)) < len(lost):
        raise FieldError("without", "must name each drone once")
    if len(lost) == robots:
        raise FieldError("without", f"must leave a drone of the {robots} that there are")


def _head(mission: Problem, flown: Plan) -> Problem:
    """Returns the mission as if it ended where what was flown ends."""
    robots = tuple(robot.replace(goal=None) for robot in mission.robots)
    return mission.replace(robots=robots, horizon=len(flown.paths[0]) - 1)


def _require_flown(mission: Problem, flown: Plan) -> None:
    """Refuses first steps that cannot be flown in the mission, or break one of its rules."""
    verdict = check(_head(mission, flown), flown)
    broken = (*verdict.violations, *verdict.conflicts)
    if broken:
        steps = len(flown.paths[0]) - 1
        raise ProblemError(
            f"the steps 0..{steps} cannot be those that were flown in {mission.name}: {broken[0]}"
        )


def _from_step(mission: Problem, flown: Plan, step: int, drones: Sequence[int]) -> Problem:
    """Returns the scene of the rest, whose objective asks for the same share of all views."""
    starts = {i: flown.paths[i][-1] for i in drones}
    robots = tuple(_in_the_air(mission, i, step, state) for i, state in starts.items())
    horizon, words = mission.horizon - step, f", from step {step}"
    lost = [i for i in range(len(mission.robots)) if i not in drones]
    if lost:
        words += f", without drone{'s' if len(lost) > 1 else ''} {', '.join(map(str, lost))}"
    return mission.replace(
        name=shortened(mission.name, _MOST_LETTERS) + words,
        robots=robots,
        actors=tuple(_walking_on(actor, mission, step) for actor in mission.actors),
        horizon=horizon,
        objective=mission.objective.replace(count_start=False),
    )


def _in_the_air(mission: Problem, i: int, step: int, state: State) -> Robot:
    """Returns a drone that is in a state at a step, with what is left of its battery.

    With homes the charge that is left is unknown: the flights there count as well, and batteries
    may have been changed. So the rest has neither homes nor batteries.
    """
    robot, seconds = mission.robots[i], step * (mission.step or 0.0)
    limits = robot.limits
    if limits is not None and limits.endurance is not None:
        left = None if robot.home is not None else limits.endurance - seconds
        limits = limits.replace(endurance=left)
    number = i if robot.number is None else robot.number
    return robot.replace(start=state, home=None, limits=limits, number=number)


def _walking_on(actor: Actor, mission: Problem, step: int) -> Actor:
    """Returns a person from a step of the mission on."""
    last, begin = mission.horizon + 1, actor.begin
    if begin is not None:
        begin = None if mission.step is None else begin + step * mission.step
    return actor.replace(
        poses=actor.poses[step:last],
        importance=None if actor.importance is None else actor.importance[step:last],
        begin=begin,
    )


def _reward(mission: Problem, flown: Plan, drones: Sequence[int]) -> float:
    """Returns J of what was flown, in which only those that still fly see anybody at its end."""
    head, last = _head(mission, flown), len(flown.paths[0]) - 1
    verdict = check(head, flown)
    if len(drones) == len(mission.robots):
        return verdict.reward
    left = head.replace(robots=tuple(head.robots[i] for i in drones))
    at_end = check(left, Plan(paths=tuple(flown.paths[i] for i in drones))).reward_per_step
    return sum((
        verdict.reward_at_start, *verdict.reward_per_step[: last - 1], at_end[last - 1],
        verdict.reward_moves,
    ))  # fmt: skip


def _share_left(
    mission: Problem, flown: Plan, scene: Problem, drones: Sequence[int]
) -> tuple[float | None, str]:
    """Returns the share of its views that the rest must keep, so that the whole keeps its own.

    None where it need not keep any, or cannot keep so many, which the words say.
    """
    asked = views_asked(mission)
    if asked.share is None:
        return None, ""
    had = _reward(views_alone(mission, asked), flown, drones)
    missing = views_to_keep(mission, asked) - had
    most = most_views(scene, asked.cameras)
    if missing <= _ROUNDING * most:
        return None, ""
    if missing > most * (1 + _ROUNDING):
        return None, (
            f"{100 * asked.share:g} % of views are out of reach: {had:g} were kept so far, and "
            f"{most:g} at most are left"
        )
    return min(missing / most, 1.0), ""
