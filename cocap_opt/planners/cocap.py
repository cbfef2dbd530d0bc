"""CoCap, Alg. 1: coordinated view planning in the manner of Conflict-Based Search.

Source: Rauniyar, Corah, Scherer 2024. The search pops the node of greatest J (the paper's
algorithm; its background section speaks of least cost).
"""

import heapq
import time
from dataclasses import dataclass, replace

from cocap_opt.constraints import forbid
from cocap_opt.model import Model, compiled
from cocap_opt.plan import Conflict, Plan, conflicts
from cocap_opt.planners.greedy import Team, no_plan
from cocap_opt.planners.single import LowLevel, SingleRobotTask
from cocap_opt.planners.value_iteration import value_iteration
from cocap_opt.problem import Problem
from cocap_opt.result import Limit, Reason, Result
from cocap_opt.stop import Stop, never
from cocap_opt.timegraph import NO_CHARGES, Charges


@dataclass(frozen=True)
class Node:
    """Node of the constraint tree."""

    team: Team  # one path and its pixels per robot
    constraints: tuple[Charges, ...]  # per robot
    value: float  # J
    depth: int  # number of constraints on the way from the root


def cocap(
    problem: Problem,
    stop: Stop = never,
    low_level: LowLevel = value_iteration,
    most_nodes: int | None = None,
) -> Result:
    """Plan all robots greedily, then repair conflicts in a constraint tree.

    Parameters
    ----------
    low_level : plans one robot under constraints
    most_nodes : stop after generating this many nodes

    Returns
    -------
    Result
        The first conflict-free node popped. `statistics` holds the nodes `generated` and
        `expanded`, the `depth` of the last one popped, and the states `evaluated`. If the
        tree is exhausted, no plan obeys the rules: both low levels fail only where there is
        no path, and every constraint of a branch is met by all plans of that branch.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    statistics: dict[str, float] = dict.fromkeys(("generated", "expanded", "depth", "evaluated"), 0)
    root = _root(model, low_level, stop, statistics)
    # Ties in J go to the older node.
    queue = [(-root.value, 0, root)] if root else []
    limit = Limit.NONE
    while queue and (limit := _limit(stop, most_nodes, statistics)) is Limit.NONE:
        _, _, node = heapq.heappop(queue)
        statistics["depth"] = node.depth
        plan = model.plan(node.team.paths)
        conflict = next(conflicts(problem, plan), None)
        if conflict is None:
            return _success(plan, node, begin, statistics)
        statistics["expanded"] += 1
        for which in (0, 1):
            child = _child(node, conflict, which, low_level, stop, statistics)
            if child is not None:
                heapq.heappush(queue, (-child.value, int(statistics["generated"]), child))
    limit = limit if limit is not Limit.NONE else stop()
    words = "no plan obeys the rules: the constraint tree is exhausted"
    return no_plan(limit, begin, (Reason.INFEASIBLE, words), statistics)


def _limit(stop: Stop, most_nodes: int | None, statistics: dict[str, float]) -> Limit:
    if most_nodes is not None and statistics["generated"] >= most_nodes:
        return Limit.NODES
    return stop()


def _root(
    model: Model, low_level: LowLevel, stop: Stop, statistics: dict[str, float]
) -> Node | None:
    """Greedy plan without constraints."""
    team = Team(model, [])
    for robot in range(len(model.problem.robots)):
        single = low_level(SingleRobotTask(model, robot, team.others(robot), stop=stop))
        statistics["evaluated"] += single.evaluated
        if single.path is None:
            return None
        team.found.append(single)
    statistics["generated"] += 1
    return Node(team, (NO_CHARGES,) * len(team.found), team.value, depth=0)


def _child(
    node: Node,
    conflict: Conflict,
    which: int,
    low_level: LowLevel,
    stop: Stop,
    statistics: dict[str, float],
) -> Node | None:
    """The node in which one robot of the conflict gives way; only that robot is planned again."""
    robot, model = conflict.robots[which], node.team.model
    charges = forbid(model, conflict, which, node.constraints[robot])
    single = low_level(SingleRobotTask(model, robot, node.team.others(robot), charges, stop))
    statistics["evaluated"] += single.evaluated
    if single.path is None:
        return None
    statistics["generated"] += 1
    team = Team(model, [*node.team.found])
    team.found[robot] = single
    constraints = (*node.constraints[:robot], charges, *node.constraints[robot + 1 :])
    return replace(node, team=team, constraints=constraints, value=team.value, depth=node.depth + 1)


def _success(plan: Plan, node: Node, begin: float, statistics: dict[str, float]) -> Result:
    seconds = time.perf_counter() - begin
    return Result(plan, node.value, Reason.FINISHED, seconds=seconds, statistics=statistics)
