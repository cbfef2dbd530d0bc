"""Branch-and-price: proved optima.

A tree of decisions (`branching`) over relaxations (`relaxation`), the node of the largest bound
first. A node is pruned where its bound is at most the incumbent's J. The tree with the
multipliers of its leaves is the proof, whatever stopped the search: the leaves of an unfinished
tree merely prove less. The bookkeeping is in `tree`.

Compare branch-and-cut-and-price for path finding (Lam, Le Bodic, Harabor, Stuckey, BCP-MAPF).
"""

from cocap_opt.formulations.column_generation.parameters import DEFAULTS, Parameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.tree import Tree
from cocap_opt.formulations.early_bound import early_bound
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.model import compiled
from cocap_opt.problem import Plan, Problem
from cocap_opt.stop import Clock, Limit, LimitReached, Stop, never
from cocap_opt.timing import timed

METHOD = "branch-and-price"


@timed
def branch_and_price(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
    parameters: Parameters = DEFAULTS,
) -> CertifiedResult:
    """Returns the best plan, and the proof that none is better by more than the relative gap.

    At a limit, the best plan and the bound so far, with their proof. The parameters guide the
    search; whatever they are, the bound holds.
    """
    model = compiled(problem)
    try:
        model.prepare_all(stop)
        search = Search(model, stop, report, Clock(), parameters=parameters)
    except LimitReached as reached:
        return early_bound(problem, reached.limit).with_start(problem, start)
    message = search.use_start(start)
    tree = Tree(search, gap)
    limit: Limit | None = None
    try:
        tree.solve_root()
        while (node := tree.select()) is not None:
            relaxation = tree.solve(node)
            if not tree.is_pruned(node):
                tree.look_for_plans(relaxation)
            if not tree.is_pruned(node):
                tree.branch(node, relaxation)
            tree.report()
        if tree.has_stuck_leaf:
            limit = Limit.NUMERICS
    except LimitReached as reached:
        limit = reached.limit
    proof = tree.proof(METHOD)
    return tree.search.result(proof, limit, gap, message, tree.statistics(proof))
