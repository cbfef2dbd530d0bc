"""Column generation: the bound of the relaxation at the root, and the plans found on the way."""

from collections.abc import Callable

from cocap_opt.formulations.column_generation.parameters import DEFAULTS, Parameters
from cocap_opt.formulations.column_generation.search import Search
from cocap_opt.formulations.column_generation.tree.root import Root
from cocap_opt.formulations.early_bound import early_bound
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.model import compiled
from cocap_opt.problem import Plan, Problem
from cocap_opt.stop import Clock, Limit, LimitReached, Stop, never
from cocap_opt.timing import timed

METHOD = "column-generation"


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
    model = compiled(problem)
    try:
        model.prepare_all(stop)
        search = Search(model, stop, report, Clock(), parameters=parameters)
    except LimitReached as reached:
        return early_bound(problem, reached.limit).with_start(problem, start)
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
    return search.result(relaxation.certificate(METHOD), limit, OPTIMALITY, message, {
        "iterations": relaxation.iterations, "columns": search.columns,
        "rows": len(relaxation.master.rows), "cuts": len(relaxation.master.cuts),
    })  # fmt: skip
