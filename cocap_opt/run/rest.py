"""The rest of a mission: the scene from a step on, and plans that are cut there and joined again.

A mission is flown up to a step k. The rest is a scene like any other, which begins at step k:
people continue their walks, each drone starts in its state at that step, and T - k moves remain.
Views at step k are fixed by these states; they count as flown. So

    J of the whole flight = J of what was flown, up to step k + J of the rest

if each step has its own returns. If pixels add up over time, the root covers pixels before and
after step k: no such scene exists, and the request is rejected.

A drone may be lost at step k. It contributes nothing from step k on: its views before step k count,
and its moves up to step k. It is removed from the scene; what happens to it is not considered.
"""

from collections.abc import Sequence
from typing import NamedTuple

from cocap_opt.data import FieldError, ProblemError
from cocap_opt.problem import Actor, Plan, Problem, Robot, State
from cocap_opt.referee import check
from cocap_opt.run.view_share import most_views, views_alone, views_asked, views_to_keep
from cocap_opt.text import shortened

_ROUNDING = 1e-9  # relative rounding error of a share of views
_NO_HOMES = "homes and batteries are ignored in the rest: leave time for the flights home"
_MOST_LETTERS = 200  # letters of the name, without the suffix for the rest


class Rest(NamedTuple):
    """The rest of a mission, and the part flown before.

    Attributes
    ----------
    scene : the scene from step k on, with the drones that still fly, without reference to the
        mission
    mission : the whole scene
    flown : [R] states of each drone at steps 0..k
    drones : numbers of the drones that still fly, in the order of the rest's robots
    reward_flown : J of the flown part, with all drones before step k, and at step k with those that
        still fly
    message : what can no longer be reached or is ignored, in words; empty if nothing
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
        mission : the whole scene; its people may walk differently from those in the plan's scene
        plan : the plan whose first steps were flown; its later steps are ignored
        step : k, from 1 to T - 1
        lost : numbers of the drones that are lost at step k

        Raises
        ------
        FieldError
            If the step or a drone does not exist; the message is one line.
        ProblemError
            If the flown part breaks a rule of the scene, or pixels add up over time; the message is
            one line.
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
        """Returns the plan of the whole mission: the flown steps, followed by a plan of the rest.

        Returns None if a drone is lost, since a plan needs states of all drones at all steps.
        """
        if len(self.drones) < len(self.mission.robots):
            return None
        both = zip(self.flown.paths, plan.paths, strict=True)
        return Plan(paths=tuple(path[:-1] + rest for path, rest in both))


def _require(mission: Problem, plan: Plan, step: int, lost: Sequence[int]) -> None:
    """Checks that the step and the drones exist, and that the plan fits the mission."""
    horizon, robots = mission.horizon, len(mission.robots)
    if horizon < 2:
        raise FieldError("from_step", f"must be left out: {mission.name} has only one step")
    if not 1 <= step < horizon:
        words = f"must be a step from 1 to {horizon - 1}, of the steps 0..{horizon}, not {step}"
        raise FieldError("from_step", words)
    if mission.objective.over_time:
        raise ProblemError(
            "objective.over_time: must be false to plan a rest: if pixels add up over time, "
            f"those before step {step} are under the same root as later ones"
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
        raise FieldError("without", "must name each drone only once")
    if len(lost) == robots:
        raise FieldError("without", f"must leave at least one of the {robots} drones")


def _head(mission: Problem, flown: Plan) -> Problem:
    """Returns the mission cut off at the end of the flown part."""
    robots = tuple(robot.replace(goal=None) for robot in mission.robots)
    return mission.replace(robots=robots, horizon=len(flown.paths[0]) - 1)


def _require_flown(mission: Problem, flown: Plan) -> None:
    """Rejects flown steps that cannot be flown in the mission, or that break one of its rules."""
    verdict = check(_head(mission, flown), flown)
    broken = (*verdict.violations, *verdict.conflicts)
    if broken:
        steps = len(flown.paths[0]) - 1
        raise ProblemError(
            f"the steps 0..{steps} cannot have been flown in {mission.name}: {broken[0]}"
        )


def _from_step(mission: Problem, flown: Plan, step: int, drones: Sequence[int]) -> Problem:
    """Returns the scene of the rest, whose objective requires the remaining share of views."""
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
    """Returns a drone in a given state at a step, with its remaining battery.

    With homes, the remaining charge is unknown: flights from home count as well, and batteries may
    have been changed. So the rest has neither homes nor batteries.
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
    """Returns J of the flown part, at whose last step only the drones that still fly count."""
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
    """Returns the share of views that the rest must reach so that the whole mission reaches its
    share.

    Returns None if nothing more is required, or if the share can no longer be reached, with a
    message.
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
            f"{100 * asked.share:g} % of views are out of reach: {had:g} were kept so far, "
            f"and at most {most:g} remain"
        )
    return min(missing / most, 1.0), ""
