"""Limits, and stopping criteria: callables that say which limit is reached, and compose.

Solvers ask as often as they like; a time limit starts to count when it is made.
"""

import math
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from types import FrameType


class Limit(StrEnum):
    """Which limit stopped it."""

    NONE = "none"
    TIME = "time"
    NODES = "nodes"
    WORK = "work"  # units of work, which are the same on every machine
    MEMORY = "memory"
    NUMERICS = "numerics"  # a solver's accuracy
    INTERRUPT = "interrupt"


Stop = Callable[[], Limit]


def never() -> Limit:
    """No limit."""
    return Limit.NONE


class TimeLimit:
    """Reached `seconds` after it was made."""

    def __init__(self, seconds: float) -> None:
        self._deadline = time.monotonic() + seconds

    def __call__(self) -> Limit:
        """Say whether the time is up."""
        return Limit.TIME if time.monotonic() >= self._deadline else Limit.NONE

    @property
    def seconds_left(self) -> float:
        """Seconds until the limit, >= 0."""
        return max(0.0, self._deadline - time.monotonic())


class WorkLimit:
    """Reached when more than so many units of work are begun: the same on every machine.

    A unit is a pricing round of column generation or branch-and-price, or a node that CoCap
    generates. What counts no work, such as value iteration or a generic solver, runs to its end.
    """

    def __init__(self, units: int) -> None:
        self._left = units

    def begin_work(self) -> None:
        """Count one more unit."""
        self._left -= 1

    def __call__(self) -> Limit:
        """Say whether more units than allowed have begun."""
        return Limit.WORK if self._left < 0 else Limit.NONE


class FirstOf:
    """Reached when any of its criteria is; all are asked each time."""

    def __init__(self, *criteria: Stop) -> None:
        self._criteria = criteria

    def __call__(self) -> Limit:
        """Ask all criteria; the first that is reached is named."""
        reached = [limit for stop in self._criteria if (limit := stop()) is not Limit.NONE]
        return reached[0] if reached else Limit.NONE

    def begin_work(self) -> None:
        """Count one more unit of work for all criteria."""
        for stop in self._criteria:
            begin_work(stop)

    @property
    def seconds_left(self) -> float:
        """Seconds until the first time limit among the criteria."""
        return min((seconds_left(stop) for stop in self._criteria), default=math.inf)


def seconds_left(stop: Stop) -> float:
    """Seconds until a criterion's time limit, for solvers that take one; infinite without."""
    return float(getattr(stop, "seconds_left", math.inf))


def begin_work(stop: Stop) -> None:
    """Count one more unit of work for criteria that limit it."""
    if callable(count := getattr(stop, "begin_work", None)):
        count()


class Interrupt:
    """Reached after Ctrl-C inside `catch_interrupt`."""

    def __init__(self) -> None:
        self.pressed = False

    def __call__(self) -> Limit:
        """Say whether Ctrl-C was pressed."""
        return Limit.INTERRUPT if self.pressed else Limit.NONE


@contextmanager
def catch_interrupt() -> Iterator[Interrupt]:
    """Turn the first Ctrl-C into a stop; a second one interrupts as usual."""
    interrupt = Interrupt()

    def press(number: int, frame: FrameType | None) -> None:
        interrupt.pressed = True
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, press)
    try:
        yield interrupt
    finally:
        signal.signal(signal.SIGINT, before)
