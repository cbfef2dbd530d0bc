"""Progress on standard error: two lines that change in place, or a plain line from time to time."""

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.text import Text

from cocap_opt.compiling import tally
from cocap_opt.console.streams import say
from cocap_opt.formulations.result import Report, Snapshot
from cocap_opt.stop import Clock
from cocap_opt.text import printable

_SECONDS_TO_A_PACE = 1.0  # after which the remaining time can be estimated
_WIDTH, _BAR_WIDTH = 80, 40  # characters
# If standard error is not a terminal: a line at least every 5 s, and the first one earlier.
SECONDS_BETWEEN_LINES, SECONDS_TO_FIRST_LINE = 4.0, 2.0


class Watch:
    """Shows the reported progress of a command; nothing is shown outside of `on_terminal`.

    Parameters
    ----------
    task : the current task, such as a scene and its seed
    parts : the number of tasks; None if there is only one
    plain : True: print plain lines instead of updating them in place
    """

    def __init__(self, task: str = "", parts: int | None = None, plain: bool = False) -> None:
        self._task = task
        self._parts = parts
        self._plain = plain
        self._finished, self._finished_at = 0, 0.0
        self._status = ""
        self._clock = Clock()
        # Time of the next line, on that clock.
        self._due = min(SECONDS_TO_FIRST_LINE, SECONDS_BETWEEN_LINES)

    @contextmanager
    def _ticking(self) -> Iterator[None]:
        """Prints the progress from time to time, even if nothing is reported."""
        ended = Event()

        def tick() -> None:
            while not ended.wait(max(self._due - self._clock.seconds, 0.0)):
                self._say()

        ticker = Thread(target=tick, daemon=True)
        ticker.start()
        try:
            yield
        finally:
            ended.set()
            ticker.join()

    @classmethod
    @contextmanager
    def on_terminal(cls, task: str, parts: int | None = None) -> "Iterator[Watch]":
        """Yields a watch that is shown on standard error.

        On a terminal its lines are updated in place and removed at the end; otherwise plain lines
        are printed, the first after two seconds and then one every four seconds.
        """
        console = Console(stderr=True)
        console.width = console.width or _WIDTH  # COLUMNS may be 0
        watch = cls(task, parts, plain=not console.is_terminal)
        live = Live(console=console, get_renderable=watch.lines, transient=True)
        with live if console.is_terminal else watch._ticking():
            yield watch

    def begin(self, task: str) -> None:
        """Starts a part, and shows its name."""
        self._task, self._status = task, ""

    def finish(self) -> None:
        """Counts a part as finished."""
        self._finished, self._finished_at = self._finished + 1, self._clock.seconds

    def show(self, status: str) -> None:
        """Shows the status of the task."""
        self._status = status
        if self._plain and self._clock.seconds >= self._due:
            self._say()

    def _say(self) -> None:
        self._due = self._clock.seconds + SECONDS_BETWEEN_LINES
        say(": ".join(self._texts()))

    def counter(self, noun: str) -> Callable[[int, int], None]:
        """Returns a function to call with the number of finished items, and the total."""
        return lambda done, total: self.show(f"{noun} {done}/{total}")

    def countdown(self, noun: str) -> Callable[[int, int], None]:
        """Returns a function that shows the finished share, and the remaining seconds.

        It is called with the number of finished items, which take about equally long, and the
        total; if the number has not increased, new items have begun.
        """
        pace = _Pace()

        def show(done: int, total: int) -> None:
            words = f"{noun} {100 * done / max(total, 1):.0f} %"
            left = pace.left(done, total)
            self.show(words if left is None else f"{words}, about {left:.0f} s left")

        return show

    def report(self, name: str = "") -> Report:
        """Returns a function that shows the reports of a solver, after a name."""
        return lambda snapshot: self.show(f"{name} {_words(snapshot)}".strip())

    def lines(self) -> RenderableType:
        """Returns the lines for a terminal."""
        texts = map(printable, self._texts())
        lines = [Text(text, no_wrap=True, overflow="ellipsis") for text in texts]
        if self._parts is None:
            return Group(*lines)
        # There is no line break after a bar.
        return Group(*lines, ProgressBar(self._parts, self._finished, width=_BAR_WIDTH))

    def _texts(self) -> list[str]:
        """Returns the task, and its status unless the task's name contains it.

        While code is compiled there is no progress, and the last status no longer applies.
        """
        status = "compiling" if tally.is_compiling else self._status
        is_told = not status or status in self._task
        return [self._head()] if is_told else [self._head(), status]

    def _head(self) -> str:
        """Returns the task, its time, and the remaining time unless parts have become slower."""
        passed = self._clock.seconds
        if self._parts is None:
            return f"{self._task}, {passed:.0f} s"
        words = f"{self._task}, {self._finished} of {self._parts} done, {passed:.0f} s"
        if not self._finished or tally.is_compiling:
            return words
        each = self._finished_at / self._finished
        left = each * (self._parts - self._finished) - (passed - self._finished_at)
        return f"{words}, about {max(left, 1):.0f} s left" if left > 0 else words


class _Pace:
    """The pace in the last half of the time, as the first items may take longer than most.

    It is measured anew after code was compiled, as items are then faster.
    """

    def __init__(self) -> None:
        self._begin_with(0)

    def _begin_with(self, done: int) -> None:
        self._clock, self._marks = Clock(), deque([(0.0, done)])
        self._compiled = tally.ended

    def left(self, done: int, total: int) -> float | None:
        """Returns the remaining seconds; None while the pace is unknown."""
        if done <= self._marks[-1][1] or tally.ended > self._compiled:
            self._begin_with(done)
        now, marks = self._clock.seconds, self._marks
        marks.append((now, done))
        while len(marks) > 1 and marks[1][0] <= now / 2:
            marks.popleft()
        before, fewer = marks[0]
        if now < _SECONDS_TO_A_PACE or done in (fewer, total):
            return None
        return (now - before) / (done - fewer) * (total - done)


def _words(snapshot: Snapshot) -> str:
    value, bound = (
        f"{x:,.2f}" if math.isfinite(x) else "-" for x in (snapshot.value, snapshot.bound)
    )
    # The node that is being solved may already be below the best plan.
    gap = f"{100 * max(snapshot.gap, 0.0):.4f} %" if math.isfinite(snapshot.gap) else "-"
    return f"J {value}, bound {bound}, gap {gap}"
