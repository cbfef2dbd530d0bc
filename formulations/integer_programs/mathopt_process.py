"""A process that solves MathOpt's requests, and can be ended at any time."""

import contextlib
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

from cocap_opt.formulations.integer_programs.attending import attend
from cocap_opt.stop import Clock, Stop

GRACE = 1.0  # s for a solver to come to an end after its limit, or after it was told to


class SolverProcess:
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

    def solve(self, request: bytes, stop: Stop, tick: Callable[[], None]) -> bytes | None:
        """Returns the response to a request; None where the process ended without one.

        Parameters
        ----------
        tick : called every now and then
        """
        process = self._started()
        told: Clock | None = None

        def interrupt() -> None:
            nonlocal told
            if told is None:
                told = Clock()
                _tell(process, b"S")
            elif told.seconds > GRACE:
                process.kill()

        response = attend(lambda: _exchange(process, request), stop, tick, interrupt)
        if response is None:
            self._end()
        return response

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
    """Sends a request and waits for the whole response; None if the process ends."""
    assert process.stdout is not None
    _tell(process, b"R" + len(request).to_bytes(8, "big") + request)
    size = int.from_bytes(head := process.stdout.read(8), "big")
    body = process.stdout.read(size)
    return body if len(head) == 8 and len(body) == size else None
