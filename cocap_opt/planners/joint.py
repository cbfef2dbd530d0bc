"""Joint value iteration: the proved optimum for one or two robots.

A step of two robots is the maximum over one robot's moves and then over the other's
(`coordination.pair_iteration`). Rules that hold between steps couple the moves: pairs of places
that are near enough for it are done again, move by move of both, without the forbidden ones.
"""

from cocap_opt.coordination.best_response import best_response
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import objective
from cocap_opt.planners.joint_memory import bytes_needed
from cocap_opt.planners.joint_pair import Pair
from cocap_opt.planners.low_level import PlannedTeam, SingleRobotPath
from cocap_opt.planners.results import result_of, result_without_conflicts
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result, UnsupportedError
from cocap_opt.stop import Limit, LimitReached, Stop, never
from cocap_opt.timing import timed

MEMORY_LIMIT = 8e9  # bytes that the process may have


@timed
def joint(problem: Problem, stop: Stop = never) -> Result:
    """Returns the best plan of one or two robots, proved by value iteration over pairs of states.

    Raises
    ------
    UnsupportedError
        For more than two robots, and where pixels add up over time.
    """
    if len(problem.robots) > 2:
        raise UnsupportedError(f"joint planning takes one or two drones, not {len(problem.robots)}")
    if problem.objective.over_time:
        raise UnsupportedError("joint planning does not support pixels that add up over time")
    model = compiled(problem).covered_by(stop)
    try:
        paths = _best_paths(model, stop)
    except LimitReached as reached:
        if reached.limit is Limit.MEMORY:
            return Result.stopped_without_plan(reached.limit)
        return result_without_conflicts(PlannedTeam.nobody(model), reached.limit, {})
    if paths is None:
        return Result.without_plan(
            Reason.INFEASIBLE, "no plan obeys the rules: no pair of paths is left"
        )
    if model.cut_short_by:
        found = (
            SingleRobotPath(path, model.robot_pixels(i, path), 0) for i, path in enumerate(paths)
        )
        return result_of(PlannedTeam(model, tuple(found)), model.cut_short_by, {})
    value = objective(model, paths)
    return Result(model.plan(paths), value, Reason.OPTIMAL, bound=value)


def _best_paths(model: Model, stop: Stop) -> tuple[Path, ...] | None:
    """Returns the best paths of all robots; None where the rules leave none.

    Raises
    ------
    LimitReached
        Also for memory, before the values of all pairs would take too much of it.
    """
    stop.check()
    if len(model.problem.robots) == 1:
        path = best_response(model, 0, model.problem.no_pixels(), stop=stop)
        return None if path is None else (path,)
    pair = Pair(model, stop)
    if not all(len(places) for side in (pair.a, pair.b) for places in side.places):
        return None  # people leave a robot no way
    if bytes_needed(pair) > MEMORY_LIMIT:
        raise LimitReached(Limit.MEMORY)
    return pair.best_paths(pair.sweep(), pair.starts, pair.positions)
