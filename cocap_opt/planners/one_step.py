"""Plans one step ahead: step by step, each robot in turn takes the best view of the next step.

It is a baseline that shows the value of looking farther ahead.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np

from cocap_opt.coordination.best_response import avoid_paths
from cocap_opt.coordination.low_level import PlannedTeam, SingleRobotPath
from cocap_opt.data import BoolArray, FloatArray, IntArray
from cocap_opt.graph.move_rewards import Bonuses
from cocap_opt.graph.timegraph import CLOSED
from cocap_opt.graph.value_iteration import best_path, leads_to_goal
from cocap_opt.model import Model, RobotClass, compiled
from cocap_opt.objective import marginal_gain
from cocap_opt.planners.lazy_coverage import LazyCoverage
from cocap_opt.planners.results import result_of, without_a_path
from cocap_opt.problem import Cell, Problem, State
from cocap_opt.result import Reason, Result
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed


@dataclass
class _Progress:
    """The progress of one robot."""

    robot_class: RobotClass
    coverage: LazyCoverage  # shared by its class
    leads: BoolArray  # [T+1, S] states from which the goal can be reached by a robot that is alone
    pixels: FloatArray  # [Z] px/m2 seen so far
    path: list[int]  # state numbers, one per step so far
    evaluated: int = 0

    def state(self, t: int) -> State:
        """Returns the state at a step."""
        return self.robot_class.graph.state(self.path[t])

    def look(self, t: int, states: IntArray) -> FloatArray:
        """Returns the coverage [n, F] of states [n] at step t."""
        before = self.coverage.evaluated
        seen = self.coverage(t, states)
        self.evaluated += self.coverage.evaluated - before
        return seen


@timed
def one_step(problem: Problem, stop: Stop = never) -> Result:
    """At each step, move the robots in order, each to the state with the greatest marginal reward.

    If a robot has several starts, it takes the one from which it sees most at the first step that
    counts, clear of the earlier robots and of one possible start for each later robot.

    A robot keeps clear of the next places of earlier robots and the current places of later robots.
    All robots can therefore stay where they are at any time, so without goals there is always a
    plan that obeys the rules; the drawback is that no robot moves into a cell that a later robot is
    about to leave. In a tie it takes the calmest move, as value iteration does. A robot with a goal
    enters only states from which it could reach the goal if it were alone; if other robots then
    block its way, the planner fails. At a limit, all robots stay where they are from then on.

    Returns
    -------
    Result
        `statistics` holds the number of states `evaluated`: those that a robot could go to.
    """
    model, limit = compiled(problem), None
    robots = _at_starts(model)
    for robot, progress in enumerate(robots):
        if not progress.leads[0, progress.path[0]]:
            return without_a_path(robot)
    try:
        for t, robot in product(range(problem.horizon), range(len(robots))):
            stop.check()
            heads = _open_heads(model, robots, robot, t)
            if not heads.size:
                words = f"after step {t}, the other drones keep drone {robot} from its goal"
                return Result.without_plan(Reason.FAILED, words, {"failed_robot": robot})
            _move(model, robots, robot, t + 1, heads)
    except LimitReached as reached:
        limit = reached.limit
        if not _stay(model, robots):
            return Result.stopped_without_plan(limit)
    at_goals = all(progress.leads[-1, progress.path[-1]] for progress in robots)
    if limit is not None and not at_goals:
        return Result.stopped_without_plan(limit)
    found = tuple(SingleRobotPath(tuple(f.path), f.pixels, f.evaluated) for f in robots)
    return result_of(PlannedTeam(model, found), limit)


def _at_starts(model: Model) -> list[_Progress]:
    """Places all robots at their starts, with the pixels that they have there if these count."""
    problem = model.problem
    robots, sources = list[_Progress](), LazyCoverage.of_robots(model)
    for robot, robot_class in enumerate(model.class_of):
        leads = leads_to_goal(robot_class.graph, problem.horizon, robot_class.goal)
        progress = _Progress(robot_class, sources[robot], leads, problem.no_pixels(), [])
        path = [_start(model, robots, robot, progress)]
        progress.path += path
        if problem.first_step == 0:
            progress.pixels[problem.view_sums_at(0)] += progress.look(0, np.array(path))[0]
        robots.append(progress)
    return robots


def _start(model: Model, placed: list[_Progress], robot: int, progress: _Progress) -> int:
    """Chooses the start of a robot, given the robots that are placed already."""
    problem, starts = model.problem, model.starts(robot)
    if len(starts) == 1:
        return int(starts[0])
    others = [problem.cell(k, other.state(0)) for k, other in enumerate(placed)]
    after = range(robot + 1, len(problem.robots))
    others += [problem.cell(k, problem.first_starts[k]) for k in after]
    closed = avoid_paths(model, progress.robot_class, ((cell,) for cell in others))
    is_open = closed.free_states(0, starts, progress.robot_class.graph.n_places)
    starts = starts[is_open & progress.leads[0, starts]]
    if not len(starts):
        return model.first_start(robot)
    t, view_sums = problem.first_step, problem.view_sums_at(problem.first_step)
    seen = np.zeros(problem.step_width)  # pixels of the placed robots if they stay
    for other in placed:
        seen += other.look(t, np.array(other.path[:1]))[0]
    gains = marginal_gain(problem, view_sums, seen, progress.look(t, starts))
    return int(starts[np.argmax(gains @ problem.view_sum_weights[view_sums])])


def _open_heads(model: Model, robots: list[_Progress], robot: int, t: int) -> IntArray:
    """Returns the states to which a robot may go from step t, after the earlier robots have
    moved.
    """
    progress = robots[robot]
    others = _others(model.problem, robots, robot, t)
    closed = avoid_paths(model, progress.robot_class, others)
    graph, tail = progress.robot_class.graph, progress.path[-1]
    heads = graph.successors(t, tail)
    is_free = closed.free_moves(0, tail, heads.tolist(), graph.n_places)
    is_open: BoolArray = progress.leads[t + 1, heads] & is_free
    return heads[is_open]


def _others(
    problem: Problem, robots: list[_Progress], robot: int, t: int
) -> Iterable[tuple[Cell, Cell]]:
    """Yields the cells of the others at step t and at the next; the same cell twice if they have
    not moved yet.
    """
    for other, progress in enumerate(robots):
        if other != robot:
            yield problem.cell(other, progress.state(t)), problem.cell(other, progress.state(-1))


def _stay(model: Model, robots: list[_Progress]) -> bool:
    """Lets all robots stay in place from the last step of each to the horizon.

    Returns False if a person comes too close to one of them.
    """
    for progress in robots:
        graph, place = progress.robot_class.graph, progress.path[-1]
        steps = range(len(progress.path), model.problem.horizon + 1)
        if not all(place in graph.successors(t - 1, place) for t in steps):
            return False
        progress.path += [place] * len(steps)
        before = progress.coverage.evaluated
        progress.pixels = progress.coverage.along(model.problem, tuple(progress.path))
        progress.evaluated += progress.coverage.evaluated - before
    return True


def _move(model: Model, robots: list[_Progress], robot: int, t: int, heads: IntArray) -> None:
    """Takes the best of the heads [n] for step t."""
    problem, progress = model.problem, robots[robot]
    graph, view_sums = progress.robot_class.graph, problem.view_sums_at(t)
    coverage = progress.look(t, heads)
    seen = sum((other.pixels[view_sums] for other in robots), np.zeros(coverage.shape[1]))
    gains = marginal_gain(problem, view_sums, seen, coverage) * problem.view_sum_weights[view_sums]
    # A path of one step, so that bonuses and ties are treated as in all other planners.
    value = np.full((2, graph.n_states), CLOSED)
    value[0, progress.path[-1]] = 0.0
    value[1, heads] = gains.sum(axis=1)
    bonuses = Bonuses.of(problem.objective)
    _, head = best_path(graph, value, progress.path[-1], bonuses, first=t - 1) or []
    progress.path.append(head)
    progress.pixels[view_sums] += coverage[np.flatnonzero(heads == head)[0]]
