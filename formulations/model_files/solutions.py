"""Plans from the solution files of other solvers.

Solvers write their solutions in ways of their own, but all of them a variable's name and, after it
on the same line or the next, its value. So a name is looked for, and the first number after it is
its value; in XML, as CPLEX writes it, that is the attribute `value`. What is not listed is 0. Of
CBF, which has no names, variables are numbered, as x0, x_0 or C0000000.
"""

import re
from collections.abc import Mapping

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.formulations.model_files.model import edge_names, node_names
from cocap_opt.formulations.relaxations.flow import Flow
from cocap_opt.model import compiled
from cocap_opt.problem import Plan, Problem

_WHOLE = 1e-4  # by which a number of drones may differ from a whole number
_NAME = re.compile(r"\b([xy]_d\d+_[ts]\w+|(?:x_?|C)(\d+))\b")
_DIGITS = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUE = re.compile(rf'\bvalue\s*=\s*"({_DIGITS})"')
_NUMBER = re.compile(rf"(?<![\w.])({_DIGITS})(?![\w.])")


def plan_of_solution(problem: Problem, text: str) -> Plan:
    """Returns the plan that a solver's solution of a problem's program tells.

    The first value of a variable counts: others are of worse solutions, or duals.

    Raises
    ------
    ProblemError
        If it tells none; one line.
    UnsupportedError
        If the problem is too large for a program.
    """
    model = compiled(problem)
    flow, values = Flow.of(model), _values(text)
    if not values:
        raise ProblemError("has no variables of a program that `export` has written")
    names = node_names(flow)
    x = np.array([_value(values, f"x_{name}", k) for k, name in enumerate(names)])
    if float(np.abs(x - np.rint(x)).max(initial=0.0)) > _WHOLE:
        raise ProblemError("has drones in fractions: it is of a relaxation, not of whole drones")
    y = np.array(
        [_value(values, name, flow.n_nodes + k) for k, name in enumerate(edge_names(flow))]
    )
    known, drones = round(float(x[flow.steps == 0].sum())), len(problem.robots)
    if known != drones:
        raise ProblemError(
            f"has {known} drones at step 0, and {problem.name} has {drones}: it is of another "
            "scene, or not whole"
        )
    try:
        return model.plan(flow.paths(y, np.rint(x)))
    except (ValueError, IndexError):
        raise ProblemError(
            f"has no paths for the drones of {problem.name}: it is of another scene, or not whole"
        ) from None


def _values(text: str) -> Mapping[str | int, float]:
    """Returns the first value of each variable, by its name or its number."""
    found: dict[str | int, float] = {}
    names = list(_NAME.finditer(text))
    ends = [*(match.start() for match in names[1:]), len(text)]
    for match, end in zip(names, ends, strict=False):  # without any name there is one end
        key: str | int = match[1] if match[2] is None else int(match[2])
        if key in found:
            continue
        rest = text[match.end() : end]
        value = _VALUE.search(rest) or _NUMBER.search(rest)
        if value is not None:
            found[key] = float(value[1])
    return found


def _value(values: Mapping[str | int, float], name: str, number: int) -> float:
    """Returns the value of a variable; 0 if none is given."""
    return values.get(name, values.get(number, 0.0))
