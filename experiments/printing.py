"""Printing results and progress: tables, or JSON alone on standard output."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import msgspec
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from cocap_opt.model import compiled
from cocap_opt.problem import Problem
from experiments.report import Row

WIDE = 200  # columns of a table that goes to a file or a pipe


class _Output(Console):
    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # rich would exit with 1, which here means a false claim


def _console() -> Console:
    return _Output() if sys.stdout.isatty() else _Output(width=WIDE)


def print_json(content: Any) -> None:
    """One JSON object on one line; infinite numbers are null."""
    sys.stdout.write(msgspec.json.encode(content).decode() + "\n")


def print_result(row: Row, json: bool) -> None:
    """One result, a line per key."""
    if json:
        print_json(row)
        return
    table = Table(show_header=False, box=None)
    for key, value in row.items():
        if value is not None and value != "":
            table.add_row(key, escape(_text(key, value)))
    _console().print(table)


def print_table(title: str, rows: Sequence[Row]) -> None:
    """Rows that all have the keys of the first."""
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False)
    for key, value in rows[0].items():
        wraps = key in ("about", "message")
        table.add_column(key, justify="left" if isinstance(value, str) else "right",
                         no_wrap=not wraps)  # fmt: skip
    for row in rows:
        table.add_row(*(escape(_text(key, value)) for key, value in row.items()))
    _console().print(table)


def print_gap_table(rows: Sequence[Row]) -> None:
    """The gap table."""
    keys = ["scene", "seed", "planner", "reward", "bound", "gap", "conflicts", "reason"]
    if any(row["limit"] != "none" for row in rows):
        keys.append("limit")
    keys.append("seconds")
    title = f"gap to the certified bound ({rows[0]['bound_method']})" if rows else "no rows"
    print_table(title, [{key: row[key] for key in keys} for row in rows])
    if any(row["conflicts"] for row in rows):
        _console().print(
            "A plan with conflicts breaks the scene's rules: its reward may exceed the bound, "
            "and it has no gap."
        )


def _text(key: str, value: Any) -> str:
    if value is None:
        return "-"
    if key == "gap":
        return f"{100 * value:.3f} %"
    if key == "seconds":
        return f"{value:.3f}"
    if isinstance(value, float):
        return f"{value:,.2f}"
    if isinstance(value, (list, tuple)):
        joint = ", " if all(isinstance(item, float) for item in value) else "\n"
        return joint.join(_text("", item) for item in value) or "none"
    return str(value)


def progress_bar() -> Progress:
    """Progress on standard error; nothing where that is not a terminal."""
    console = Console(stderr=True)
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


@contextmanager
def coverage_progress(problem: Problem) -> Iterator[None]:
    """Show how far the coverage of the scene is, while it is being computed."""
    with progress_bar() as progress:
        task = progress.add_task("coverage", total=problem.horizon + 1)
        compiled(problem).progress = lambda done, total: progress.update(
            task, completed=done, total=total
        )
        yield
