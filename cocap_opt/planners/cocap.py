"""CoCap, Alg. 1: coordinated view planning in the manner of Conflict-Based Search.

Source: Rauniyar, Corah, Scherer 2024 (arXiv 2412.20695). The comments `# 1` .. `# 14` number the
lines of the algorithm as Conflict-Based Search has them (Sharon et al. 2015, Alg. 2), which the
paper follows; it pops the node of greatest J, where its background section speaks of least cost.
Limits, statistics and the plan for emergencies are in `constraint_tree`.

Symbols: N a node of the constraint tree, with N.team (one path and its pixels per robot),
N.constraints (per robot) and N.value (J); A a child of it.
"""

from cocap_opt.model import compiled
from cocap_opt.planners.constraint_tree import ConstraintTree, Node, OpenNodes
from cocap_opt.planners.low_level import LowLevel, value_iteration
from cocap_opt.planners.view_search import Undiscounted, ViewSearch
from cocap_opt.problem import Problem
from cocap_opt.result import Result, timed
from cocap_opt.stop import LimitReached, Stop, never


def algorithm_1(tree: ConstraintTree, open_nodes: OpenNodes) -> Node | None:
    """CoCap's Alg. 1: the conflict-free node found first; None where the tree is exhausted."""
    root = tree.root()  # 1-3  no constraints; greedy paths; J of them
    if root is not None:
        open_nodes.push(root)  # 4
    while open_nodes:  # 5
        N = open_nodes.pop()  # 6  of greatest J
        conflict = tree.first_conflict(N)  # 7
        if conflict is None:  # 8
            return N  # 9
        for robot in conflict.robots:  # 10
            A = tree.child(N, conflict, robot)  # 11-13  one more constraint; this robot again; J
            if A is not None:  # 14  it has a path
                open_nodes.push(A)
    return None


@timed
def cocap(problem: Problem, stop: Stop = never, low_level: LowLevel = value_iteration) -> Result:
    """Plan all robots greedily, then repair conflicts in a constraint tree (Alg. 1).

    Parameters
    ----------
    low_level : plans one robot under constraints

    Returns
    -------
    Result
        The first conflict-free node popped. At a limit, of the last node popped the paths
        that do not collide, and the other robots stay at their starts; or, after many nodes, the
        plan of `sequential` where that is better. `statistics` holds the nodes `generated` and
        `expanded`, the `depth` of the last one popped, and the states `evaluated` by a lazy
        low level. If the tree is exhausted, no plan obeys the rules: a low level fails only where
        there is no path, and every plan meets at least one of the two constraints of a conflict.
    """
    open_nodes = OpenNodes()
    tree = ConstraintTree(compiled(problem), low_level, stop, open_nodes)
    try:
        return tree.result(algorithm_1(tree, open_nodes))
    except LimitReached as reached:
        return tree.stopped(reached.limit)


def cocap_vs(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `cocap` does, with view search (Alg. 2) as the low level."""
    return cocap(problem, stop, low_level=ViewSearch())


def cocap_vs_undiscounted(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `cocap-vs` does, with a discount in the queue's order only, not in the rewards."""
    return cocap(problem, stop, low_level=ViewSearch(Undiscounted()))
