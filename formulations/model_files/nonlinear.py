"""Writes AMPL's NL format through Pyomo: roots as u^2 <= z, drones as integers.

By AMPL's convention, names are in two files beside it, with the endings .col and .row.
"""

import importlib.util
import io
from typing import Any

import numpy as np

from cocap_opt.formulations.model_files.endings import NONLINEAR
from cocap_opt.formulations.model_files.model import ModelFile
from cocap_opt.result import UnsupportedError


def require_pyomo() -> None:
    """Raises UnsupportedError if Pyomo is not installed."""
    if importlib.util.find_spec("pyomo") is None:
        raise UnsupportedError(f"{NONLINEAR} needs Pyomo: pip install 'cocap-opt[nl]'")


def nonlinear_files(model_file: ModelFile) -> dict[str, bytes]:
    """Returns the contents of three files by ending: the program, its columns and its rows.

    Raises
    ------
    UnsupportedError
        If Pyomo is not installed.
    """
    require_pyomo()
    from pyomo.repn.plugins.nl_writer import NLWriter

    program, columns, rows = io.StringIO(), io.StringIO(), io.StringIO()
    NLWriter().write(
        _translated(model_file), program, rows, columns,
        symbolic_solver_labels=True, linear_presolve=False, scale_model=False,
        show_section_timing=False,
    )  # fmt: skip
    texts = {NONLINEAR: program, ".col": columns, ".row": rows}
    return {ending: text.getvalue().encode() for ending, text in texts.items()}


def _translated(model_file: ModelFile) -> Any:
    """Returns a program as a Pyomo model."""
    from pyomo.core.expr.numeric_expr import LinearExpression
    from pyomo.environ import (
        ConcreteModel,
        Constraint,
        NonNegativeIntegers,
        NonNegativeReals,
        Objective,
        Var,
        maximize,
    )
    from scipy import sparse

    linear, model = model_file.linear, ConcreteModel()
    variables = []
    bounds = zip(
        model_file.variables, linear.low.tolist(), linear.high.tolist(), linear.integral.tolist(),
        strict=True,
    )  # fmt: skip
    for name, low, high, whole in bounds:
        domain = NonNegativeIntegers if whole else NonNegativeReals
        variable = Var(domain=domain, bounds=(low, high if np.isfinite(high) else None))
        model.add_component(name, variable)
        variables.append(variable)
    rows = sparse.csr_array(linear.rows)
    at, columns, values = (part.tolist() for part in (rows.indptr, rows.indices, rows.data))
    for k, (name, low, high) in enumerate(
        zip(model_file.rows, linear.row_low.tolist(), linear.row_high.tolist(), strict=True)
    ):
        part = slice(at[k], at[k + 1])
        paid = LinearExpression(
            constant=0, linear_coefs=values[part],
            linear_vars=[variables[column] for column in columns[part]],
        )  # fmt: skip
        model.add_component(name, Constraint(expr=paid == high if low == high else paid <= high))
    for u, z in model_file.cones:
        root = Constraint(expr=variables[u] ** 2 <= variables[z])
        model.add_component(f"root_{model_file.variables[u].partition('_')[2]}", root)
    paid = np.flatnonzero(linear.gain).tolist()
    goal = LinearExpression(
        constant=0, linear_coefs=[float(linear.gain[k]) for k in paid],
        linear_vars=[variables[k] for k in paid],
    )  # fmt: skip
    model.add_component("J", Objective(expr=goal, sense=maximize))
    return model
