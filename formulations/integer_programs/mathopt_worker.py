"""A process that solves MathOpt's requests, one after the other, until its input ends.

It is started by `mathopt` and imports nothing from this project. Messages on standard input: R,
length (8 bytes), a SolveRequest; or S, which interrupts the solve. Answers on standard output:
length (8 bytes), a SolveResponse.
"""

import os
import queue
import sys
import threading

from ortools.math_opt import callback_pb2, rpc_pb2
from ortools.math_opt.core.python import solver
from ortools.util.python.solve_interrupter import SolveInterrupter


def _answer(data: bytes, interrupter: SolveInterrupter) -> bytes:
    """Solves a request; an error is reported in the response's status."""
    request = rpc_pb2.SolveRequest.FromString(data)
    response = rpc_pb2.SolveResponse()
    try:
        result = solver.solve(
            request.model, request.solver_type, request.initializer, request.parameters,
            request.model_parameters, None, callback_pb2.CallbackRegistrationProto(), None,
            interrupter.pybind_interrupter,
        )  # fmt: skip
        response.result.CopyFrom(result)
    except Exception as error:  # any exception must be reported to the caller
        response.status.code = 2
        response.status.message = str(error)
    return bytes(response.SerializeToString())


def _main() -> None:
    """Serves requests until standard input ends."""
    requests: queue.Queue[tuple[bytes, SolveInterrupter]] = queue.Queue()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # solvers print to standard output

    def listen() -> None:
        interrupter = SolveInterrupter()
        while kind := sys.stdin.buffer.read(1):
            if kind == b"S":
                interrupter.interrupt()
            else:
                size = int.from_bytes(sys.stdin.buffer.read(8), "big")
                interrupter = SolveInterrupter()
                requests.put((sys.stdin.buffer.read(size), interrupter))
        os._exit(0)  # the caller has gone

    threading.Thread(target=listen, daemon=True).start()
    while True:
        data = _answer(*requests.get())
        answers.write(len(data).to_bytes(8, "big") + data)
        answers.flush()


if __name__ == "__main__":
    _main()
