"""Branch-and-price, which proves optima, and column generation at its root alone, which gives
bounds.

The method solves relaxations in a tree of decisions (`tree`), taking the node with the largest
bound first. A node is pruned if its bound is at most the incumbent's J. The tree, with the
multipliers of its leaves, is the proof, no matter why the search stopped: the leaves of an
unfinished tree merely prove a weaker bound.

Compare branch-and-cut-and-price for path finding (Lam, Le Bodic, Harabor, Stuckey, BCP-MAPF).
"""

from collections.abc import Callable
from dataclasses import replace

from cocap_opt.formulations.column_generation.parameters import DEFAULTS, Parameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.column_generation.tree.tree import Tree
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.formulations.simple_bounds import early_bound
from cocap_opt.model import compiled
from cocap_opt.problem import Plan, Problem
from cocap_opt.stop import Limit, LimitReached, Stop, never
from cocap_opt.timing import timed

# If no states may be narrowed down, there are neither stages nor trials.
_SEARCHLESS = replace(DEFAULTS, search=replace(DEFAULTS.search, most_states=0))


@timed
def column_generation(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    solve_root: Callable[[Root], None] = Root.solve,
    parameters: Parameters = DEFAULTS,
) -> CertifiedResult:
    """Returns the bound of the relaxation with all cuts at the root, and the best plan found.

    Parameters
    ----------
    solve_root : `Root.solve`, or `Root.solve_aggregated` to keep the robots of a class together
    parameters : parameters of the search; they do not affect the validity of the bound

    Returns
    -------
    CertifiedResult
        The best certificate found, even if a limit stopped the search. A negative bound proves that
        no plan exists, since J >= 0.
    """
    search = _begun(problem, stop, report, parameters)
    if isinstance(search, Limit):
        return early_bound(problem, search).with_start(problem, start)
    message = search.use_start(start)
    root = Root.of(search, OPTIMALITY / 2)
    limit: Limit | None = None
    try:
        solve_root(root)
        if root.relaxation.is_stuck:
            limit = Limit.NUMERICS
        else:
            root.relaxation.round_to_plans()
    except LimitReached as reached:
        limit = reached.limit
    relaxation, search = root.relaxation, root.search
    certificate = relaxation.certificate("column-generation")
    return search.result(certificate, limit, OPTIMALITY, message, {
        "iterations": relaxation.iterations, "columns": search.columns,
        "rows": len(relaxation.master.rows), "cuts": len(relaxation.master.cuts),
    })  # fmt: skip


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

    At a limit, returns the best plan and the bound so far, with its proof. The parameters of the
    search do not affect the validity of the bound.
    """
    search = _begun(problem, stop, report, parameters)
    if isinstance(search, Limit):
        return early_bound(problem, search).with_start(problem, start)
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
    proof = tree.proof("branch-and-price")
    return tree.search.result(proof, limit, gap, message, tree.statistics(proof))


def searchless(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
) -> CertifiedResult:
    """Returns the best plan by branch-and-price, with a proof that can be checked without a search.

    The proof is a tree of decisions with multipliers at its leaves: there are no step envelopes,
    the joint paths of all robots are not explored, and plans are not recombined. Such trees take
    longer to find, and grow large if many robots have many choices; `independent.cocap_check`
    checks them.
    """
    return branch_and_price(problem, stop, start, report, gap, _SEARCHLESS)


def _begun(problem: Problem, stop: Stop, report: Report, parameters: Parameters) -> Search | Limit:
    """Returns a search that starts from the plan in which all robots hover, or the limit if one was
    reached.
    """
    model = compiled(problem)
    try:
        model.prepare_all(stop)
        return Search(model, stop, report, parameters=parameters)
    except LimitReached as reached:
        return reached.limit
