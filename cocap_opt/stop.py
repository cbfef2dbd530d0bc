"""Stopping criteria that can be combined, the reasons why methods stop, and a clock.

Long computations call `stop.check()` often, which raises `LimitReached` at the limit; a method that
has a result by then catches it. A time limit starts when the object is created.
"""

import math
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from numbers import Real
from types import FrameType


class Limit(StrEnum):
    """The limit that stopped a computation; None is used if there was none."""

    TIME = "time"
    WORK = "work"  # units of work, which are the same on every machine
    MEMORY = "memory"
    NUMERICS = "numerics"  # a solver's accuracy
    INTERRUPT = "interrupt"

    @staticmethod
    def written(limit: "Limit | None") -> str:
        """Returns the word for a limit in files and tables, or NO_LIMIT if there is none."""
        return NO_LIMIT if limit is None else str(limit)


NO_LIMIT = "none"  # word for "no limit" in files and tables


class Reason(StrEnum):
    """The reason why a method stopped; `limit` of its result names the limit, if any."""

    OPTIMAL = "optimal"  # the value is proved to be the best
    FINISHED = "finished"  # the method ran to its end; it proves nothing
    INFEASIBLE = "infeasible"  # proved: no plan obeys the rules
    FAILED = "failed"  # the method ran to its end without a plan; one may exist
    UNSUPPORTED = "unsupported"  # the method does not support such problems
    STOPPED = "stopped"  # a limit stopped it; `limit` says which


class LimitReached(Exception):  # noqa: N818  it is no error
    """A limit was reached during the work; `limit` names it."""

    def __init__(self, limit: Limit) -> None:
        super().__init__(limit)
        self.limit = limit


class Stop:
    """A stopping criterion; this one never stops. Others override `reached`."""

    def reached(self) -> Limit | None:
        """Return the limit that was reached, such as `Limit.TIME`, or None if none was yet."""
        return None

    def check(self) -> None:
        """Raise LimitReached if the limit is reached."""
        if limit := self.reached():
            raise LimitReached(limit)

    def begin_work(self) -> None:
        """Count one more unit of work, and raise LimitReached if it exceeds the limit."""
        self.count_work()
        self.check()

    def count_work(self) -> None:
        """Count one more unit of work."""

    @property
    def seconds_left(self) -> float:
        """Seconds until the time limit, for solvers that take one; infinite without one."""
        return math.inf

    def put_off(self, seconds: float) -> None:
        """Delay the effect of Ctrl-C by so many seconds, once; other limits are unchanged.

        After Ctrl-C during preparations, this leaves time for a quick result.
        """

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Stop the clock of time limits inside; other limits are unchanged.

        It is for work that is done once per machine, such as compiling code.
        """
        yield

    def before(self, seconds: float) -> "Stop":
        """Return a stop that is reached with this one, or so many seconds before its time limit.

        It is for intermediate work, which is useless unless time is left to use its result.
        """
        return _Before(self, seconds)

    def __repr__(self) -> str:
        return "never" if type(self) is Stop else f"{type(self).__name__}(..)"


class _Before(Stop):
    """Reached with another stop, or some seconds before its time limit."""

    def __init__(self, stop: Stop, seconds: float) -> None:
        self._stop, self._seconds = stop, seconds

    def reached(self) -> Limit | None:
        """Return the limit that the other stop has reached, or that of time once little is left."""
        early = Limit.TIME if self._stop.seconds_left <= self._seconds else None
        return self._stop.reached() or early

    def count_work(self) -> None:
        """Count one more unit of work for the other stop."""
        self._stop.count_work()

    def put_off(self, seconds: float) -> None:
        """Delay Ctrl-C in the other stop."""
        self._stop.put_off(seconds)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Stop the clock inside, in the other stop."""
        with self._stop.paused():
            yield

    @property
    def seconds_left(self) -> float:
        """Seconds until this stop is reached, >= 0."""
        return max(self._stop.seconds_left - self._seconds, 0.0)


never = Stop()


def _require_number(name: str, value: float) -> None:
    if not isinstance(value, Real) or math.isnan(value):
        raise TypeError(f"{name}: must be a number, not {value!r}")


class TimeLimit(Stop):
    """Reached `seconds` after the object was created."""

    def __init__(self, seconds: float) -> None:
        _require_number("seconds", seconds)
        self._seconds = seconds
        self._deadline = time.monotonic() + seconds

    def reached(self) -> Limit | None:
        """Return `Limit.TIME` once the time is up."""
        return Limit.TIME if time.monotonic() >= self._deadline else None

    @property
    def seconds_left(self) -> float:
        """Seconds until the limit, >= 0; infinite while it is paused."""
        return max(0.0, self._deadline - time.monotonic())

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Stop the clock inside."""
        left, self._deadline = self._deadline - time.monotonic(), math.inf
        try:
            yield
        finally:
            self._deadline = time.monotonic() + left

    def __repr__(self) -> str:
        return f"TimeLimit({self._seconds})"


class WorkLimit(Stop):
    """Reached when more than `units` units of work have begun, which is the same on every machine.

    A unit is a pricing round of column generation or branch-and-price, or a node that CoCap
    generates. Methods that do not count work, such as value iteration or a generic solver, run to
    their end.
    """

    def __init__(self, units: int) -> None:
        _require_number("units", units)
        if units < 0 or units % 1:
            raise ValueError(f"units: must be a whole number >= 0, not {units!r}")
        self._units = self._left = units

    def reached(self) -> Limit | None:
        """Return `Limit.WORK` once more units than allowed have begun."""
        return Limit.WORK if self._left < 0 else None

    def count_work(self) -> None:
        """Count one more unit of work."""
        self._left -= 1

    def __repr__(self) -> str:
        return f"WorkLimit({self._units})"


class FirstOf(Stop):
    """Reached when any of its criteria is reached; each check asks all of them."""

    def __init__(self, *criteria: Stop) -> None:
        if wrong := [stop for stop in criteria if not isinstance(stop, Stop)]:
            raise TypeError(f"criteria: must be stopping criteria, not {wrong[0]!r}")
        self._criteria = criteria

    def reached(self) -> Limit | None:
        """Return the first limit that is reached among the criteria."""
        limits = [stop.reached() for stop in self._criteria]
        return next(filter(None, limits), None)

    def count_work(self) -> None:
        """Count one more unit of work for all criteria."""
        for stop in self._criteria:
            stop.count_work()

    def put_off(self, seconds: float) -> None:
        """Delay Ctrl-C in all criteria."""
        for stop in self._criteria:
            stop.put_off(seconds)

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Stop the clock inside, in all criteria."""
        with ExitStack() as stack:
            for stop in self._criteria:
                stack.enter_context(stop.paused())
            yield

    @property
    def seconds_left(self) -> float:
        """Seconds until the first time limit among the criteria."""
        return min((stop.seconds_left for stop in self._criteria), default=math.inf)

    def __repr__(self) -> str:
        return f"FirstOf({', '.join(map(repr, self._criteria))})"


class Interrupt(Stop):
    """Reached after Ctrl-C inside `caught`."""

    def __init__(self) -> None:
        self.pressed = False
        self._waits_until = -math.inf

    def reached(self) -> Limit | None:
        """Return `Limit.INTERRUPT` once Ctrl-C was pressed."""
        waits = time.monotonic() < self._waits_until
        return Limit.INTERRUPT if self.pressed and not waits else None

    def put_off(self, seconds: float) -> None:
        """Delay Ctrl-C by so many seconds from now on, only once; a second Ctrl-C does not wait."""
        if self._waits_until == -math.inf:
            self._waits_until = time.monotonic() + seconds

    @classmethod
    @contextmanager
    def caught(cls) -> "Iterator[Interrupt]":
        """Turn the first Ctrl-C into a stop; a second one interrupts as usual.

        Only the main thread receives Ctrl-C; in another thread the stop is never reached.
        """
        interrupt = cls()
        if threading.current_thread() is not threading.main_thread():
            yield interrupt
            return

        def press(number: int, frame: FrameType | None) -> None:
            interrupt.pressed = True
            signal.signal(signal.SIGINT, before)

        before = signal.signal(signal.SIGINT, press)
        try:
            yield interrupt
        finally:
            signal.signal(signal.SIGINT, before)

    @staticmethod
    @contextmanager
    def held_back() -> Iterator[None]:
        """Delay Ctrl-C until the code inside, which must be quick, is done."""
        before = signal.getsignal(signal.SIGINT)
        if threading.current_thread() is not threading.main_thread() or not callable(before):
            yield
            return
        pressed: list[int] = []
        signal.signal(signal.SIGINT, lambda number, frame: pressed.append(number))
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)
        for number in pressed:
            signal.raise_signal(number)


class Clock:
    """Seconds of wall-clock time since it was made."""

    def __init__(self) -> None:
        self._begin = time.perf_counter()

    @property
    def seconds(self) -> float:
        """Seconds so far."""
        return time.perf_counter() - self._begin
