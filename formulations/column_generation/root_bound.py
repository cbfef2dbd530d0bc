"""Column generation: the bound of the relaxation at the root, and the plans found on the way.

The relaxation is over whole paths (`relaxation`); its root is in `root`.
"""

import time
from collections.abc import Callable

from cocap_opt.formulations.certificates.certificate import certify
from cocap_opt.formulations.column_generation.relaxation import Relaxation
from cocap_opt.formulations.column_generation.root import solved_root
from cocap_opt.formulations.column_generation.search import Search, result_of, use_start
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, only_start, silent
from cocap_opt.model import compiled
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.stop import Limit, Stop, never

METHOD = "column-generation"


def column_generation(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    make_root: Callable[[Search, float], Relaxation] = solved_root,
) -> CertifiedResult:
    """Bound of the relaxation with all cuts at the root, and the best plan found on the way.

    Parameters
    ----------
    make_root : solves the relaxation to a relative gap

    Returns
    -------
    CertifiedResult
        The best certificate found, also where a limit stopped it. A negative bound proves
        that there is no plan, since J >= 0.
    """
    begin = time.perf_counter()
    model = compiled(problem)
    limit = model.prepare_all(stop)
    if limit is not Limit.NONE:
        return only_start(problem, start, limit, time.perf_counter() - begin)
    search = Search(model, stop, report, begin)
    message = use_start(search, start)
    root = make_root(search, OPTIMALITY / 2)
    search, model = root.search, root.search.model
    if root.limit is Limit.NONE:
        root.look_for_plans()
    file = certify(problem, model, METHOD, root.best.duals.certificate(model))
    return result_of(search, file, root.limit, OPTIMALITY, message, {
        "iterations": root.iterations, "columns": search.columns,
        "rows": len(root.master.rows), "cuts": len(root.master.cuts),
    })  # fmt: skip
