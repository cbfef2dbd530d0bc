"""Reads plans from the solution files of other solvers.

Solvers use different formats, but all write a variable's name and, after it on the same line or the
next, its value. So the reader looks for a name, and takes the first number after it as its value;
in XML, as CPLEX writes it, the value is the attribute `value`. Variables that are not listed are 0.
In CBF, which has no names, variables are numbered: x0, x_0 or C0000000.
"""

import re
from collections.abc import Mapping

import numpy as np

from cocap_opt.data import ProblemError
from cocap_opt.formulations.model_files.model import edge_names, node_names
from cocap_opt.formulations.relaxations.flow import Flow
from cocap_opt.model import compiled
from cocap_opt.problem import Plan, Problem

_WHOLE = 1e-4  # tolerance by which a number of drones may differ from a whole number
_NAME = re.compile(r"\b([xy]_d\d+_[ts]\w+|(?:x_?|C)(\d+))\b")
_DIGITS = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_VALUE = re.compile(rf'\bvalue\s*=\s*"({_DIGITS})"')
_NUMBER = re.compile(rf"(?<![\w.])({_DIGITS})(?![\w.])")


def plan_of_solution(problem: Problem, text: str) -> Plan:
    """Returns the plan that a solver's solution of a problem's program describes.

    The first value of a variable counts: later ones belong to worse solutions, or are duals.

    Raises
    ------
    ProblemError
        If the file contains no plan; the message is one line.
    UnsupportedError
        If the problem is too large for a program.
    """
    model = compiled(problem)
    flow, values = Flow.of(model), _values(text)
    if not values:
        raise ProblemError("contains no variables of a program that `export` has written")
    names = node_names(flow)
    x = np.array([_value(values, f"x_{name}", k) for k, name in enumerate(names)])
    if float(np.abs(x - np.rint(x)).max(initial=0.0)) > _WHOLE:
        raise ProblemError(
            "contains fractional drones: it solves a relaxation, not the integer program"
        )
    y = np.array(
        [_value(values, name, flow.n_nodes + k) for k, name in enumerate(edge_names(flow))]
    )
    known, drones = round(float(x[flow.steps == 0].sum())), len(problem.robots)
    if known != drones:
        raise ProblemError(
            f"has {known} drones at step 0, but {problem.name} has {drones}: the solution "
            "belongs to another scene, or is incomplete"
        )
    try:
        return model.plan(flow.paths(y, np.rint(x)))
    except (ValueError, IndexError):
        raise ProblemError(
            f"has no paths for the drones of {problem.name}: the solution belongs to another "
            "scene, or is incomplete"
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
