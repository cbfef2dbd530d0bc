"""Generic solvers: one integer program of the whole instance, given to a solver.

The programs are those of `integer_programs.outer_approximation`. Alone, a solver has only its own
bound and cuts. With our root, it begins with the bound and the cuts of column generation, and
stops once its plan meets that bound.
"""

from functools import partial

from cocap_opt.formulations.integer_programs.cp_sat import cp_sat
from cocap_opt.formulations.integer_programs.mathopt import highs, scip
from cocap_opt.formulations.integer_programs.outer_approximation import Root, certified_root
from cocap_opt.formulations.result import BoundMethod


def _all(root: Root | None) -> dict[str, BoundMethod]:
    return {
        "highs": partial(highs, root=root),
        "scip": partial(scip, root=root),
        "cp-sat": partial(cp_sat, root=root),
    }


ALONE = _all(None)
WITH_OUR_ROOT = _all(certified_root)
