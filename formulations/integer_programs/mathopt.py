"""Runs HiGHS and SCIP through OR-tools' MathOpt, in a process of their own.

MathOpt cannot interrupt HiGHS (and silently ignores callbacks), so only ending the process stops it
at once. A separate process also keeps its library apart from the HiGHS that cvxpy installs.
"""

import contextlib
import math
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np

from cocap_opt.formulations.integer_programs.outer_approximation import OuterApproximation
from cocap_opt.formulations.integer_programs.program import (
    Answer,
    Call,
    LinearProgram,
    Program,
    Solver,
)
from cocap_opt.formulations.relaxations.flow import Amounts
from cocap_opt.formulations.solvers import ending, options
from cocap_opt.stop import Clock, Limit
from cocap_opt.text import printable

__all__ = ["highs", "scip"]

GRACE = 1.0  # s that a solver may take to end after its limit, or after an interruption


@contextlib.contextmanager
def _solver(name: str) -> Iterator[Solver]:
    """Provides the solver with this MathOpt name, in a process that ends with the context."""

    def solve(program: Program, call: Call) -> Answer:
        response = process.solve(_request(name, program, call), call)
        if response is None:
            return process.failure(call.stop.reached())
        return _answer(name, program, response, late=bool(call.stop.reached()))

    with contextlib.closing(_SolverProcess()) as process:
        yield solve


highs = OuterApproximation(partial(_solver, "HIGHS"))  # plans found before an interruption are lost
scip = OuterApproximation(partial(_solver, "GSCIP"))


def _request(name: str, program: Program, call: Call) -> bytes:
    """Returns the message that asks a solver to solve a program."""
    from ortools.math_opt import parameters_pb2, rpc_pb2

    request = rpc_pb2.SolveRequest(
        solver_type=parameters_pb2.SolverTypeProto.Value(f"SOLVER_TYPE_{name}"),
        parameters=options(name, call.stop, call.tolerance),
    )
    _fill_model(request.model, LinearProgram.of(program))
    if call.hint is not None:
        values = program.point(call.hint)
        hint = request.model_parameters.solution_hints.add()
        hint.variable_values.ids.extend(range(len(values)))
        hint.variable_values.values.extend(values.tolist())
    return bytes(request.SerializeToString())


def _answer(name: str, program: Program, data: bytes, late: bool) -> Answer:
    """Reads a response.

    Parameters
    ----------
    late : True if a limit had been reached when the solve ended
    """
    from ortools.math_opt import result_pb2, rpc_pb2

    response = rpc_pb2.SolveResponse.FromString(data)
    if response.status.code:
        return Answer.failed(f"the solver failed: {response.status.message}")
    result, why = response.result, response.result.termination
    status = (
        result_pb2.LimitProto.Name(why.limit)
        if why.limit
        else result_pb2.TerminationReasonProto.Name(why.reason)
    )
    dual_bound = float(why.objective_bounds.dual_bound)
    bound = math.inf if math.isnan(dual_bound) else dual_bound * program.unit
    nodes = int(result.solve_stats.node_count)
    end = ending(name, status)
    return Answer.ended(end, _solution(program, result), bound, nodes, why.detail, late)


def _fill_model(model: Any, linear: LinearProgram) -> None:
    n, m = len(linear.gain), len(linear.row_low)
    variables = model.variables
    variables.ids.extend(range(n))
    variables.lower_bounds.extend(linear.low.tolist())
    variables.upper_bounds.extend(linear.high.tolist())
    variables.integers.extend(linear.integral.tolist())
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


def _solution(program: Program, result: Any) -> Amounts | None:
    """Returns the first solution."""
    n, e = program.flow.n_nodes, program.flow.n_edges
    if not result.solutions or not result.solutions[0].HasField("primal_solution"):
        return None
    given = result.solutions[0].primal_solution.variable_values
    values = np.zeros(n + e + 3 * len(program.roots.used))
    values[np.array(given.ids, dtype=np.int64)] = np.array(given.values)
    return values[:n], values[n : n + e]


# -- the process ------------------------------------------------------------------------------


class _SolverProcess:
    """A process that solves MathOpt's requests; it is started at the first request."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None  # what it prints as errors

    def solve(self, request: bytes, call: Call) -> bytes | None:
        """Returns the response to a request, or None if the process ended without one."""
        process = self._started()
        told: Clock | None = None

        def interrupt() -> None:
            nonlocal told
            if told is None:
                told = Clock()
                _tell(process, b"S")
            elif told.seconds > GRACE:
                process.kill()

        return call.attend(lambda: _exchange(process, request), interrupt)

    def failure(self, limit: Limit | None) -> Answer:
        """Ends the process, which has not answered, and returns the reason: a limit, if reached."""
        assert self._process is not None
        assert self._errors is not None
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(GRACE)
        code = self._process.poll()
        self._errors.seek(0)
        last = (self._errors.read().decode(errors="replace").splitlines() or [""])[-1].strip()
        self.close()
        if limit is not None:
            return Answer(None, math.inf, limit)
        if code == -signal.SIGKILL:
            message = "the solver's process was killed: was there too little memory?"
            return Answer(None, math.inf, Limit.MEMORY, message=message)
        told = f": {printable(last)}" if last else ""
        return Answer.failed(f"the solver's process ended without an answer, code {code}{told}")

    def _started(self) -> "subprocess.Popen[bytes]":
        if self._process is None:
            self._errors = tempfile.TemporaryFile()  # noqa: SIM115  `close` closes it
            script = Path(__file__).with_name("mathopt_worker.py")
            self._process = subprocess.Popen(
                [sys.executable, "-P", str(script)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                start_new_session=True,  # this process handles Ctrl-C
            )
        return self._process

    def close(self) -> None:
        """Ends the process if it is running; it can be started again."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout, self._errors):
                # Unwritten data is discarded.
                with contextlib.suppress(OSError):
                    if stream is not None:
                        stream.close()
            self._process = None


def _tell(process: "subprocess.Popen[bytes]", message: bytes) -> None:
    assert process.stdin is not None
    with contextlib.suppress(OSError):  # the process has ended, which the reader notices
        process.stdin.write(message)
        process.stdin.flush()


def _exchange(process: "subprocess.Popen[bytes]", request: bytes) -> bytes | None:
    """Sends a request and waits for the whole response; None if the process ends."""
    assert process.stdout is not None
    _tell(process, b"R" + len(request).to_bytes(8, "big") + request)
    size = int.from_bytes(head := process.stdout.read(8), "big")
    body = process.stdout.read(size)
    return body if len(head) == 8 and len(body) == size else None
