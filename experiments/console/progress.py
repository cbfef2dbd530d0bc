"""How far a command is, on standard error: two lines that change, or now and then a plain one."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.text import Text

from cocap_opt.experiments.console.streams import say
from cocap_opt.formulations.result import Report, Snapshot
from cocap_opt.model import Model, compiled, nobody
from cocap_opt.problem.problem import Problem

BAR_WIDTH = 40  # columns
SECONDS_BETWEEN_LINES = 10.0  # where standard error is no terminal


class Watch:
    """Is told how far a command is, and shows it.

    Parameters
    ----------
    task : what is being done, such as a scene and its seed
    parts : of how many such tasks; None where there is one
    plain : whether to say it in lines that stay
    """

    def __init__(self, task: str, parts: int | None, plain: bool) -> None:
        self._task = task
        self._parts = parts
        self._plain = plain
        self._finished = 0
        self._status = ""
        self._models: list[Model] = []
        self._begin = self._last = time.monotonic()

    def begin(self, task: str) -> None:
        """Name the part that begins; models of the part before are let go."""
        self.close()
        self._task, self._status = task, ""

    def finish(self) -> None:
        """Count a part as done."""
        self._finished += 1

    def show(self, status: str) -> None:
        """Show how far the task is."""
        self._status = status
        now = time.monotonic()
        if self._plain and now - self._last >= SECONDS_BETWEEN_LINES:
            say(f"{self._head()}: {status}")
            self._last = now

    def count(self, what: str, done: int, total: int) -> None:
        """Show how many things are done."""
        self.show(f"{what} {done}/{total}")

    def coverage_of(self, problem: Problem) -> None:
        """Show how far the coverage of a problem is, while it is being computed."""
        model = compiled(problem)
        model.progress = lambda done, total: self.count("coverage", done, total)
        self._models.append(model)

    def close(self) -> None:
        """Have nothing told to it any more."""
        for model in self._models:
            model.progress = nobody
        self._models.clear()

    def report(self, name: str = "") -> Report:
        """Show what a solver reports, after a name."""
        return lambda snapshot: self.show(f"{name} {status_of(snapshot)}".strip())

    def lines(self) -> RenderableType:
        """What a terminal shows."""
        texts = (self._head(), self._status)
        lines = [Text(text, no_wrap=True, overflow="ellipsis") for text in texts if text]
        if self._parts is None:
            return Group(*lines)
        return Group(ProgressBar(self._parts, self._finished, width=BAR_WIDTH), *lines)

    def _head(self) -> str:
        passed = time.monotonic() - self._begin
        if self._parts is None:
            return f"{self._task}, {passed:.0f} s"
        words = (
            f"{self._task} ({min(self._finished + 1, self._parts)}/{self._parts}), {passed:.0f} s"
        )
        if not self._finished:
            return words
        left = passed / self._finished * (self._parts - self._finished)
        return f"{words}, about {left:.0f} s left"


def status_of(snapshot: Snapshot) -> str:
    """A snapshot in words."""
    value, bound = (
        f"{x:,.2f}" if math.isfinite(x) else "-" for x in (snapshot.value, snapshot.bound)
    )
    # The node that is being solved may already be below the best plan.
    gap = f"{100 * max(snapshot.gap, 0.0):.4f} %" if math.isfinite(snapshot.gap) else "-"
    return (
        f"value {value} bound {bound} gap {gap} columns {snapshot.columns} nodes {snapshot.nodes}"
    )


def unseen() -> Watch:
    """A watch that nobody looks at."""
    return Watch("", None, plain=False)


@contextmanager
def watching(task: str, parts: int | None = None) -> Iterator[Watch]:
    """Show how far a command is.

    On a terminal, lines that change and are gone at the end; otherwise plain lines, at most
    one in ten seconds.
    """
    console = Console(stderr=True)
    watch = Watch(task, parts, plain=not console.is_terminal)
    live = Live(console=console, get_renderable=watch.lines, transient=True)
    with live if console.is_terminal else nullcontext():
        try:
            yield watch
        finally:
            watch.close()
