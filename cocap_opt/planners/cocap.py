"""CoCap, Alg. 1: coordinated view planning in the manner of Conflict-Based Search.

Source: Rauniyar, Corah, Scherer 2024. The search pops the node of greatest J (the paper's
algorithm; its background section speaks of least cost).
"""

import heapq
import time
from dataclasses import asdict, dataclass, replace

from cocap_opt.coordination.constraints import forbid
from cocap_opt.graph.timegraph import NO_CHARGES, Charges
from cocap_opt.model import compiled
from cocap_opt.planners.sequential import sequential
from cocap_opt.planners.single import LowLevel, SingleRobotTask
from cocap_opt.planners.team import Team, no_plan, remark, stopped
from cocap_opt.planners.value_iteration import value_iteration
from cocap_opt.problem.plan import Conflict, Plan, conflicts
from cocap_opt.problem.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import Limit, Stop, begin_work, never

SPARE_FROM = 64  # nodes generated from which on a spare plan costs little


@dataclass(frozen=True)
class Node:
    """Node of the constraint tree."""

    team: Team  # one path and its pixels per robot
    constraints: tuple[Charges, ...]  # per robot
    value: float  # J
    depth: int  # number of constraints on the way from the root


@dataclass
class Counts:
    """How much work a search has done."""

    generated: int = 0
    expanded: int = 0
    depth: int = 0  # of the last node popped
    evaluated: int = 0  # states whose coverage was needed by a lazy low level


def cocap(
    problem: Problem,
    stop: Stop = never,
    low_level: LowLevel = value_iteration,
    most_nodes: int | None = None,
) -> Result:
    """Plan all robots greedily, then repair conflicts in a constraint tree (Alg. 1).

    Parameters
    ----------
    low_level : plans one robot under constraints
    most_nodes : stop after generating this many nodes

    Returns
    -------
    Result
        The first conflict-free node popped; at a limit, of the last node popped the paths
        that do not collide, and the other robots stay where they are. A search that is stopped
        after many nodes returns the plan of `sequential` where that is better.
        `statistics` holds the nodes `generated` and `expanded`, the `depth` of the last one
        popped, and the states `evaluated` by a lazy low level. If the tree is exhausted, no
        plan obeys the rules: a low level fails only where there is no path, and of the two
        constraints of a conflict every plan meets at least one.
    """
    begin = time.perf_counter()
    model, counts, limit = compiled(problem), Counts(), Limit.NONE
    spare: Result | None = None
    # The root: every robot's best path given the earlier ones, without constraints.
    queue: list[tuple[float, int, Node]] = []
    last = root = Node(Team(model, []), (NO_CHARGES,) * len(problem.robots), 0.0, depth=0)
    for robot in range(len(problem.robots)):
        single = low_level(SingleRobotTask(model, robot, root.team.others(robot), stop=stop))
        counts.evaluated += single.evaluated
        limit = single.limit
        if single.path is None:
            break
        root.team.found.append(single)
    else:
        counts.generated = 1
        queue = [(-root.team.value, 0, replace(root, value=root.team.value))]
    while queue and limit is Limit.NONE:
        # Pop the node of greatest J; ties go to the older one.
        node = last = heapq.heappop(queue)[2]
        counts.depth = node.depth
        plan = model.plan(node.team.paths)
        conflict = next(conflicts(problem, plan), None)
        if conflict is None:
            return _found(plan, node, begin, counts)
        counts.expanded += 1
        if spare is None and counts.generated >= SPARE_FROM:
            spare = sequential(problem, stop, low_level)
            counts.evaluated += int(spare.statistics.get("evaluated", 0))
        # Branch: one robot of the first conflict gives way in each child.
        for which in (0, 1):
            limit = limit if limit is not Limit.NONE else _limit(stop, most_nodes, counts)
            if limit is Limit.NONE:
                child, limit = _child(node, conflict, which, low_level, stop, counts)
                if child is not None:
                    counts.generated += 1
                    heapq.heappush(queue, (-child.value, counts.generated, child))
    if limit is not Limit.NONE:
        result = stopped(model, limit, begin, asdict(counts), last.team)
        if spare is not None and spare.value > result.value:
            words = "stopped: this is the plan of sequential planning"
            return replace(result, plan=spare.plan, value=spare.value, message=words)
        return result
    words = "no plan obeys the rules: the constraint tree is exhausted"
    return no_plan(limit, begin, (Reason.INFEASIBLE, words), asdict(counts))


def _limit(stop: Stop, most_nodes: int | None, counts: Counts) -> Limit:
    if most_nodes is not None and counts.generated >= most_nodes:
        return Limit.NODES
    begin_work(stop)
    return stop()


def _child(
    node: Node, conflict: Conflict, which: int, low_level: LowLevel, stop: Stop, counts: Counts
) -> tuple[Node | None, Limit]:
    """The node in which one robot of the conflict gives way; only that robot is planned again.

    None where that leaves it no path, or where a limit is reached.
    """
    robot, model = conflict.robots[which], node.team.model
    charges = forbid(model, conflict, which, node.constraints[robot])
    single = low_level(SingleRobotTask(model, robot, node.team.others(robot), charges, stop))
    counts.evaluated += single.evaluated
    if single.path is None:
        return None, single.limit
    team = node.team.with_path(robot, single)
    constraints = (*node.constraints[:robot], charges, *node.constraints[robot + 1 :])
    return Node(team, constraints, team.value, node.depth + 1), Limit.NONE


def _found(plan: Plan, node: Node, begin: float, counts: Counts) -> Result:
    seconds = time.perf_counter() - begin
    return Result(
        plan, node.value, Reason.FINISHED, seconds=seconds,
        message=remark(node.team.model.problem), statistics=asdict(counts),
    )  # fmt: skip
