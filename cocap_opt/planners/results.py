"""Makes results from a team, whether complete or not."""

from collections.abc import Mapping
from dataclasses import replace

from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath
from cocap_opt.coordination.team import Team
from cocap_opt.problem import StartSet
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.stop import Limit

_ONE_STEP_AT_A_TIME = (
    "a heuristic: pixels add up over time, but this planner considers one step at a time"
)


def hovering(team: PlannedTeam) -> PlannedTeam:
    """Returns the team in which all robots without a path stay at their starts.

    A robot whose goal is elsewhere still has no path.
    """
    found = (single or _hover(team, i) for i, single in enumerate(team.found))
    return replace(team, found=tuple(found))


def _hover(team: PlannedTeam, robot: int) -> SingleRobotPath:
    """Returns the path that stays at the start, which takes no time to find."""
    problem = team.model.problem
    if not problem.may_hover(robot, StartSet.of([problem.first_starts[robot]]))[0]:
        return SingleRobotPath(None, problem.no_pixels(), 0)
    path = (team.model.first_start(robot),) * (problem.horizon + 1)
    evaluated = problem.horizon + 1 - problem.first_step
    return SingleRobotPath(path, team.model.evaluated_pixels(robot, path), evaluated)


def result_of(
    team: PlannedTeam, limit: Limit | None = None, statistics: Mapping[str, float] | None = None
) -> Result:
    """Make the result of a planner that has planned every robot or left it at its start.

    There is no plan if a robot has no path, because it may not stay at its start.

    Raises
    ------
    UnsupportedError
        If no limit stopped the planner, and it left such a robot without a path.
    """
    if not team.is_whole:
        if limit is None:
            number = next(i for i, single in enumerate(team.found) if not (single and single.path))
            raise UnsupportedError(
                f"drone {number} has no path, and may not stay at its start, as its goal is "
                "elsewhere or people come too close"
            )
        return Result.stopped_without_plan(limit, statistics)
    evaluated = sum(single.evaluated for single in team.found if single is not None)
    model = team.model
    messages = [_ONE_STEP_AT_A_TIME] if model.problem.objective.over_time else []
    early = [single.limit for single in team.found if single and single.limit]
    if early:
        limit = limit or early[0]
        count = f"{len(early)} of {team.size}"
        messages.append(f"{count} paths are based on few evaluated views, as a limit was near")
    if model.cut_short_by:
        limit = limit or model.cut_short_by
        messages.append(
            f"coverage was computed for only {model.covered_steps} of "
            f"{model.problem.horizon + 1} steps; the planner ignored the others"
        )
    return Result(
        plan=model.plan(team.paths),
        value=team.value,
        reason=Reason.STOPPED if limit else Reason.FINISHED,
        limit=limit,
        in_coverage=model.cut_short_by is not None,
        message="; ".join(messages),
        statistics={"evaluated": evaluated} if statistics is None else statistics,
    )


def result_without_conflicts(
    team: PlannedTeam, limit: Limit, statistics: Mapping[str, float]
) -> Result:
    """Make the result of a planner that was stopped before its paths obey the rules.

    Initially all robots stay at their starts, which obeys every rule; then each robot in turn takes
    its path if the path collides with no other robot and increases J. There is no plan if a robot's
    goal is elsewhere.
    """
    safe: PlannedTeam = hovering(Team.nobody(team.model))
    if not safe.is_whole:
        return result_of(safe, limit, statistics)
    cells = [safe.cells(robot) for robot in range(safe.size)]
    for robot, single in enumerate(team.found):
        if single is None:
            continue
        wanted, others = team.cells(robot), cells[:robot] + cells[robot + 1 :]
        if any(team.model.problem.paths_conflict(wanted, other) for other in others):
            continue
        changed = safe.with_path(robot, single)
        if changed.value > safe.value:
            safe, cells[robot] = changed, wanted
    result = result_of(safe, limit, statistics)
    staying = sum(len(set(path)) == 1 for path in safe.paths)
    if not staying or staying == safe.size:  # the latter would be true of any plan
        return result
    words = f"{staying} of {safe.size} drones stay at their starts, clear of the others"
    return with_message(result, words)


def with_message(result: Result, words: str) -> Result:
    """Returns a result with an additional message."""
    return replace(result, message="; ".join(filter(None, (result.message, words))))


def without_a_path(robot: int) -> Result:
    """Make the result of a planner for which one robot has no path even if it is alone."""
    return Result.without_plan(Reason.INFEASIBLE, f"drone {robot} has no path, even alone")
