"""CoCap, Alg. 1: coordinated view planning in the manner of Conflict-Based Search.

     1  Root.constraints <- none
     2  Root.team <- greedy paths, robot by robot, conflicts ignored
     3  Root.value <- J of them
     4  insert Root into OPEN
     5  while OPEN is not empty
     6      N <- the node of greatest J in OPEN
     7      find the first conflict of N
     8      if there is none
     9          return N
    10      for each robot of the conflict
    11          A.constraints <- N.constraints, plus: this robot keeps out of the conflict
    12          A.team <- N.team, with this robot replanned
    13          A.value <- J of it
    14          if the robot has a path, insert A into OPEN

Source: Rauniyar, Corah, Scherer 2024 (arXiv 2412.20695), after the high level of Conflict-Based
Search (Sharon et al. 2015). The listing is our wording, the same as in docs/concepts/cocap.md; its
numbers are beside the lines of `algorithm_1`. It takes the greatest J, whereas the paper's
background section speaks of least cost. `constraint_tree` makes the nodes, and a fallback plan for
when time runs out.
"""

from collections.abc import Iterator

from cocap_opt.coordination.low_level import LowLevel, PlannedTeam, value_iteration
from cocap_opt.coordination.responses import (
    Planning,
    Responses,
    followed,
    greedily,
    greedily_in_rounds,
    in_rounds,
)
from cocap_opt.planners.constraint_tree import (
    ConstraintTree,
    FocalNodes,
    Node,
    OpenNodes,
    SparePlan,
)
from cocap_opt.planners.lazy_value_iteration import LazyValueIteration
from cocap_opt.planners.results import result_of, result_without_conflicts
from cocap_opt.planners.view_search import Undiscounted, ViewSearch
from cocap_opt.problem import Problem
from cocap_opt.result import Reason, Result
from cocap_opt.stop import LimitReached, Stop, never
from cocap_opt.timing import timed

EXHAUSTED = "no plan obeys the rules: the constraint tree is exhausted"


def algorithm_1(tree: ConstraintTree) -> Node | None:
    """CoCap's Alg. 1: returns the first conflict-free node that is found; None if the tree is
    exhausted.
    """
    root, OPEN = tree.root(), tree.open  # 1-3
    if root is not None:
        OPEN.push(root)  # 4
    while OPEN:  # 5
        N = OPEN.pop()  # 6
        conflict = tree.first_conflict(N)  # 7
        if conflict is None:  # 8
            return N  # 9
        for robot in conflict.robots:  # 10
            A = tree.child(N, conflict, robot)  # 11-13
            if A is not None:  # 14
                OPEN.push(A)
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
        The plan of the first conflict-free node popped. At a limit, the paths of the last node
        popped that do not collide, while all other robots stay at their starts; or, after many
        nodes or when little time is left, the plan of sequential planning with the same low level,
        if that is better. `statistics` holds the numbers of nodes `generated` and `expanded`, the
        `depth` of the last one popped, and the number of states `evaluated` by a lazy low level. If
        the tree is exhausted, no plan obeys the rules: a low level fails only if there is no path,
        and every plan satisfies at least one of the two constraints of a conflict.
    """
    return _searched(problem, stop, low_level, OpenNodes())


def cocap_lazy(problem: Problem, stop: Stop = never) -> Result:
    """Find the same plan as `cocap`, but evaluate only the views that decide it."""
    return cocap(problem, stop, low_level=LazyValueIteration())


def cocap_vs(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `cocap` does, with view search (Alg. 2) as the low level."""
    return cocap(problem, stop, low_level=ViewSearch())


def cocap_vs_undiscounted(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `cocap-vs` does, but discount only the order of the queue, not the rewards."""
    return cocap(problem, stop, low_level=ViewSearch(Undiscounted()))


@timed
def cocap_rounds(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `cocap` does, from a root that is planned in rounds of best responses."""
    return _searched(problem, stop, value_iteration, OpenNodes(), greedily_in_rounds)


@timed
def cocap_focal(problem: Problem, stop: Stop = never) -> Result:
    """Plan as `cocap-rounds` does, with a focal list, and finally with rounds that obey the rules.

    Among open nodes within 1 % of the greatest J, the one with the fewest conflicts comes first.
    """
    return _searched(problem, stop, value_iteration, FocalNodes(), greedily_in_rounds, in_rounds)


def _as_it_is(team: PlannedTeam, responses: Responses) -> Iterator[PlannedTeam]:
    return iter(())


def _searched(
    problem: Problem,
    stop: Stop,
    low_level: LowLevel,
    open_nodes: OpenNodes,
    plan_root: Planning = greedily,
    ending: Planning = _as_it_is,
) -> Result:
    """Returns the result of Alg. 1.

    Parameters
    ----------
    plan_root : plans the team of the root, ignoring conflicts
    ending : improves the resulting plan under the rules
    """
    responses = Responses(low_level, stop)
    nobody = responses.nobody(problem)
    spare = SparePlan(nobody, responses, stop)
    tree = ConstraintTree(nobody, responses, stop, open_nodes, plan_root, spare.keep)
    try:
        found = algorithm_1(tree)
    except LimitReached as reached:
        limit, statistics = reached.limit, tree.statistics(open_nodes.popped)
        stopped_at = result_without_conflicts(tree.team, limit, statistics)
        return spare.or_better(stopped_at, limit)
    if found is None:
        statistics = tree.statistics(open_nodes.popped)
        return Result.without_plan(Reason.INFEASIBLE, EXHAUSTED, statistics)
    team, stopped = followed(found.team, ending(found.team, responses))
    # A path chosen after few evaluated views may have misled the search, even if no robot follows
    # it now.
    statistics = tree.statistics(open_nodes.popped - 1)
    return result_of(team, stopped or responses.limit, statistics)
