"""Branch-and-price: proved optima; and its root alone, column generation: bounds.

A tree of decisions over relaxations (`tree`), the node of the largest bound first. A node is pruned
where its bound is at most the incumbent's J. The tree with the multipliers of its leaves is the
proof, whatever stopped the search: the leaves of an unfinished tree merely prove less.

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

# With no states left to be narrowed down there are neither stages nor trials.
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
    solve_root : `Root.solve`, or `Root.solve_aggregated` to leave robots of a class together
    parameters : that guide the search; whatever they are, the bound holds

    Returns
    -------
    CertifiedResult
        The best certificate found, also where a limit stopped it. A negative bound proves
        that there is no plan, since J >= 0.
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
            root.relaxation.look_for_plans()
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

    At a limit, the best plan and the bound so far, with their proof. The parameters guide the
    search; whatever they are, the bound holds.
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
    """Returns the best plan as branch-and-price does, with a proof that needs no search.

    It is a tree of decisions with multipliers at its leaves: there are no step envelopes, no paths
    of all robots are tried, and plans are not recombined. Such trees take longer to be found, and
    grow large where many robots have much to choose; `independent.cocap_check` takes them.
    """
    return branch_and_price(problem, stop, start, report, gap, _SEARCHLESS)


def _begun(problem: Problem, stop: Stop, report: Report, parameters: Parameters) -> Search | Limit:
    """Returns a search with the plan of robots that hover; the limit if one was reached before."""
    model = compiled(problem)
    try:
        model.prepare_all(stop)
        return Search(model, stop, report, parameters=parameters)
    except LimitReached as reached:
        return reached.limit
