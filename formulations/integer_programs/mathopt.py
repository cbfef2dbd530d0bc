"""HiGHS and SCIP through OR-tools' MathOpt, in a process of their own.

HiGHS takes no interrupter there (and drops callbacks without a word), so that only the end of
its process stops it at once; and its library cannot clash with the HiGHS that cvxpy brings.
"""

import contextlib
import math
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.integer_programs.attending import attend
from cocap_opt.formulations.integer_programs.linear_program import LinearProgram, linear_program
from cocap_opt.formulations.integer_programs.outer_approximation import (
    Root,
    certified_root,
    outer_approximation,
)
from cocap_opt.formulations.integer_programs.program import Answer, Call, Program
from cocap_opt.formulations.result import OPTIMALITY, CertifiedResult, Report, silent
from cocap_opt.problem.plan import Plan
from cocap_opt.problem.problem import Problem
from cocap_opt.stop import Limit, Stop, never, seconds_left

GRACE = 1.0  # s for a solver to come to an end after its limit, or after it was told to


def mathopt(
    problem: Problem,
    stop: Stop = never,
    start: Plan | None = None,
    report: Report = silent,
    gap: float = OPTIMALITY,
    root: Root = certified_root,
    *,
    solver: str,
) -> CertifiedResult:
    """Optimum by outer approximation.

    Parameters
    ----------
    solver : the name that MathOpt has for it

    Raises
    ------
    UnsupportedError
        If the scene is too large for a flow model (see `cocap_opt.formulations.relaxations.flow`).
    """
    with Worker() as worker:

        def solve(program: Program, call: Call) -> Answer:
            request = request_of(solver, program, call)
            response, limit = worker.solve(request, call.stop, call.tick)
            limit = limit if limit is not Limit.NONE else call.stop()
            return answer_of(program, response, limit)

        return outer_approximation(problem, stop, start, report, gap, solve, root)


highs = partial(mathopt, solver="HIGHS")  # what it finds while it is interrupted is lost
scip = partial(mathopt, solver="GSCIP")


class Worker:
    """A process that solves MathOpt's requests; started when it is first asked."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end()

    def solve(
        self, request: bytes, stop: Stop, tick: Callable[[], None]
    ) -> tuple[bytes | None, Limit]:
        """Response to a request; None and the limit where it was stopped without one."""
        process, told = self._started(), math.inf

        def interrupt() -> None:
            nonlocal told
            if told == math.inf:
                told = time.monotonic()
                _tell(process, b"S")
            elif time.monotonic() > told + GRACE:
                process.kill()

        response, limit = attend(lambda: _exchange(process, request), stop, tick, interrupt)
        if response is None:
            self._end()
        return response, limit

    def _started(self) -> "subprocess.Popen[bytes]":
        if self._process is None:
            script = Path(__file__).with_name("mathopt_worker.py")
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(script)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                start_new_session=True,  # Ctrl-C in a terminal is for us to handle
            )
        return self._process

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout):
                # What was not yet written goes nowhere.
                with contextlib.suppress(OSError):
                    if stream is not None:
                        stream.close()
            self._process = None


def _tell(process: "subprocess.Popen[bytes]", message: bytes) -> None:
    assert process.stdin is not None
    with contextlib.suppress(OSError):  # it is gone; the reader sees that
        process.stdin.write(message)
        process.stdin.flush()


def _exchange(process: "subprocess.Popen[bytes]", request: bytes) -> bytes | None:
    """Send a request and wait for the whole response; none if the process ends."""
    assert process.stdout is not None
    _tell(process, b"R" + len(request).to_bytes(8, "big") + request)
    size = int.from_bytes(head := process.stdout.read(8), "big")
    body = process.stdout.read(size)
    return body if len(head) == 8 and len(body) == size else None


# -- programs as MathOpt has them ---------------------------------------------------------------


def request_of(name: str, program: Program, call: Call) -> bytes:
    """Solve request for a program."""
    from ortools.math_opt import parameters_pb2, rpc_pb2

    request = rpc_pb2.SolveRequest(
        solver_type=parameters_pb2.SolverTypeProto.Value(f"SOLVER_TYPE_{name}")
    )
    _fill_model(request.model, linear_program(program))
    parameters = request.parameters
    parameters.relative_gap_tolerance = call.tolerance
    parameters.absolute_gap_tolerance = 0.0
    if math.isfinite(seconds := seconds_left(call.stop)):
        parameters.time_limit.FromNanoseconds(int(1e9 * max(seconds, 0.0)))
    if name == "HIGHS":
        # MathOpt's own parameter for threads is an error with HiGHS.
        parameters.highs.int_options["threads"] = 1
    else:
        parameters.threads = 1
        # SCIP's presolve takes minutes and all memory on flows that it solves in a second.
        parameters.presolve = parameters_pb2.EMPHASIS_OFF
    if call.hint is not None:
        values = program.point(*call.hint)
        hint = request.model_parameters.solution_hints.add()
        hint.variable_values.ids.extend(range(len(values)))
        hint.variable_values.values.extend(values.tolist())
    return bytes(request.SerializeToString())


def _fill_model(model: Any, linear: LinearProgram) -> None:
    n, m = len(linear.gain), len(linear.row_low)
    variables = model.variables
    variables.ids.extend(range(n))
    variables.lower_bounds.extend(linear.low.tolist())
    variables.upper_bounds.extend(linear.high.tolist())
    variables.integers.extend(linear.whole.tolist())
    paying = np.flatnonzero(linear.gain)
    model.objective.maximize = True
    model.objective.linear_coefficients.ids.extend(paying.tolist())
    model.objective.linear_coefficients.values.extend(linear.gain[paying].tolist())
    rows = model.linear_constraints
    rows.ids.extend(range(m))
    rows.lower_bounds.extend(linear.row_low.tolist())
    rows.upper_bounds.extend(linear.row_high.tolist())
    entries = linear.rows.tocoo()
    order = np.lexsort((entries.col, entries.row))
    matrix = model.linear_constraint_matrix
    matrix.row_ids.extend(entries.row[order].tolist())
    matrix.column_ids.extend(entries.col[order].tolist())
    matrix.coefficients.extend(entries.data[order].tolist())


def answer_of(program: Program, data: bytes | None, limit: Limit) -> Answer:
    """What a response says; None: there is none.

    Parameters
    ----------
    limit : reached by the end of the solve. Then no proof is believed: where its time ends in
        the root node, HiGHS drops that node, calls its start optimal or finds no plan.
    """
    from ortools.math_opt import result_pb2, rpc_pb2

    if data is None:
        ended = limit if limit is not Limit.NONE else Limit.NUMERICS
        return Answer(None, None, math.inf, ended, message="the solver's process has ended")
    response = rpc_pb2.SolveResponse.FromString(data)
    if response.status.code:
        message = f"the solver failed: {response.status.message}"
        return Answer(None, None, math.inf, Limit.NUMERICS, message=message)
    result, why = response.result, response.result.termination
    nodes, reasons = int(result.solve_stats.node_count), result_pb2.TerminationReasonProto
    proofs = {
        reasons.TERMINATION_REASON_OPTIMAL: float(why.objective_bounds.dual_bound),
        # The roots are bounded, so that it cannot be unbounded.
        reasons.TERMINATION_REASON_INFEASIBLE: -math.inf,
        reasons.TERMINATION_REASON_INFEASIBLE_OR_UNBOUNDED: -math.inf,
    }
    x, y = _solution(program, result)
    if why.reason in proofs:
        bound = proofs[why.reason] if limit is Limit.NONE else math.inf
        return Answer(x, y, bound * program.unit, limit, nodes)
    if limit is Limit.NONE:
        stopped = why.limit == result_pb2.LimitProto.LIMIT_TIME
        limit = Limit.TIME if stopped else Limit.NUMERICS
    bound = float(why.objective_bounds.dual_bound)
    bound = math.inf if math.isnan(bound) else bound * program.unit
    return Answer(x, y, bound, limit, nodes, why.detail)


def _solution(program: Program, result: Any) -> tuple[FloatArray | None, FloatArray | None]:
    """Nodes and edges of the first solution."""
    n, e = program.flow.n_nodes, program.flow.n_edges
    if not result.solutions or not result.solutions[0].HasField("primal_solution"):
        return None, None
    given = result.solutions[0].primal_solution.variable_values
    values = np.zeros(n + e + 3 * len(program.roots.used))
    values[np.array(given.ids, dtype=np.int64)] = np.array(given.values)
    return values[:n], values[n : n + e]
