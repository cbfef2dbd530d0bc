"""Joint value iteration: the proved optimum for one or two robots.

A step of two robots is the maximum over one robot's moves and then over the other's
(`coordination.pair_iteration`). Rules that hold between steps couple the moves: pairs of places
that are near enough for it are done again, move by move of both, without the forbidden ones.

The memory that it takes is known before: it is that of the arrays which `joint_pair` holds at once,
as tests/core/test_joint.py measures.
"""

from cocap_opt.coordination.best_response import best_response
from cocap_opt.model import Model, Path, compiled
from cocap_opt.objective import objective
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


PROCESS = 100e6  # bytes, about: Python, the libraries, the problem, and what is freed but kept
_BYTES = 8.0  # of a number
_TEMPORARIES = 5  # arrays of a step's size that one step back needs at once
_PER_FACE = 2.0  # of each state and face: the coverage and the root of it
_PER_STATE = 40.0  # of each state besides, to spare
_PER_MOVE = 5.0  # of each move from each place: where it leads, while it is found
_PER_PAIR = 6.0  # of each pair of places: whether it is near, while that is found
_PER_VALUE = 2.0  # of each way of b from a near pair and its orientations: values, and the best
_PER_WAY = 20.0  # of each way of b from a near pair: where it leads, and whether it conflicts


def bytes_needed(pair: Pair) -> float:
    """Returns the peak of the process's memory: values of later steps, and the work on one."""
    peak = later = 0.0
    for t in range(pair.horizon, -1, -1):
        (o_a, n_a), (o_b, n_b) = pair.a.sizes(t), pair.b.sizes(t)
        work = (_PER_FACE * pair.model.n_faces + _PER_STATE) * (o_a * n_a + o_b * n_b)
        if t < pair.horizon:
            work += _numbers_of_step_back(pair, t)
        peak = max(peak, later + work)
        later += float(o_a * n_a) * float(o_b * n_b)
    return PROCESS + _BYTES * peak


def _numbers_of_step_back(pair: Pair, t: int) -> float:
    """Returns how many numbers a step back from t+1 to t holds at most."""
    (o_a, n_a), (o_b, n_b) = pair.a.sizes(t), pair.b.sizes(t)
    ahead_a, ahead_b = len(pair.a.places[t + 1]), len(pair.b.places[t + 1])
    whole = float(o_a * (ahead_a + 1)) * float(o_b * (ahead_b + 1))
    ways_a, ways_b = len(pair.a.robot_class.graph.moves), len(pair.b.robot_class.graph.moves)
    numbers = _TEMPORARIES * whole
    numbers += _PER_MOVE * ways_a * n_a
    numbers += _PER_MOVE * ways_b * n_b
    if pair.model.problem.rules.hold_between_steps:
        kept = 2 if pair.bonuses.stationarity else 1
        numbers += kept * kept * whole + kept * float(o_a * (ahead_a + 1)) * float(o_b * n_b)
        pairs = n_a * n_b
        numbers += _PER_PAIR * pairs
        per_way = _PER_VALUE * o_a * o_b + _PER_WAY
        numbers += min(pairs, pair.pairs_at_once()) * ways_b * per_way
    return numbers
