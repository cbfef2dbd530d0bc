"""Printing results: tables, or JSON alone on standard output."""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cocap_opt.data import printable
from cocap_opt.experiments.results.rows import Row

FOLDED = 16  # columns of text that goes on in the next line, at least
WIDE = 200  # columns of a table that goes to a file or a pipe
OPEN = "*"  # marks a bound that a limit stopped
PROVED = ("optimal", "infeasible")
MISSING = {  # why there is no bound
    "stopped": "a limit stopped its search before there was one",
    "error": "its search ended in an error",
    "exceeded": "its search took longer than a cell may",
    "died": "the process of its search died",
}
NAMED = 3  # cases that are named in a sentence
SHARES = ("gap", "gap_free", "largest gap", "largest gap_free")  # printed in %


class _Output(Console):
    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # rich would exit with 1, which here means a false claim


def _console(least: int = 0) -> Console:
    """Standard output, of at least so many columns: what is too long goes on in the next line."""
    console = _Output() if sys.stdout.isatty() else _Output(width=WIDE)
    console.width = max(console.width, least)
    return console


def print_json(content: Any) -> None:
    """One JSON object on one line; infinite numbers are null."""
    sys.stdout.write(msgspec.json.encode(content).decode() + "\n")


def path_text(path: Path) -> str:
    """A path as text; what cannot be printed is escaped."""
    return printable(str(path))


def counted(number: int, what: str) -> str:
    """So many of something, in words."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def titles(paths: Sequence[Path]) -> list[str]:
    """What to call plans: the names of their files, with their folders if some are alike."""
    names = [path.name for path in paths]
    return [path_text(path if names.count(path.name) > 1 else Path(path.name)) for path in paths]


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
    widest = {
        key: max(len(part) for row in rows for part in (key, *_text(key, row[key]).splitlines()))
        for key in (rows[0] if rows else ())
    }
    table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False,
                  collapse_padding=True)  # fmt: skip
    for key, value in rows[0].items() if rows else ():
        wraps = key in ("scene", "about", "message")
        table.add_column(key, justify="left" if isinstance(value, str) else "right",
                         no_wrap=not wraps, overflow="fold",
                         min_width=min(FOLDED, widest[key]) if wraps else widest[key])  # fmt: skip
    for row in rows:
        table.add_row(*(escape(_text(key, value)) for key, value in row.items()))
    console = _console()
    _console(console.measure(table).minimum).print(table)


def markdown(rows: Sequence[Row]) -> str:
    """The table that `print_table` prints, in Markdown."""
    if not rows:
        return ""
    lines = [list(rows[0]), ["---" if isinstance(v, str) else "--:" for v in rows[0].values()]]
    lines += [[_text(key, value) for key, value in row.items()] for row in rows]
    return "".join(
        f"| {' | '.join(cell.replace('|', '&#124;') for cell in line)} |\n" for line in lines
    )


class Marked(NamedTuple):
    """A number with a mark behind it."""

    value: float | None
    mark: str


def print_gap_table(rows: Sequence[Row]) -> None:
    """The gap table."""
    keys = ["scene", "seed", "planner", "reward"]
    keys += ["reward_rendered"] if rows and "reward_rendered" in rows[0] else []
    keys += ["bound", "gap", "gap_free", "conflicts", "reason"]
    if any(row["limit"] != "none" for row in rows):
        keys.append("limit")
    keys.append("seconds")
    table = [{key: row[key] for key in keys} for row in rows]
    for shown, row in zip(table, rows, strict=True):
        for key, reason in (("bound", "bound_reason"), ("gap_free", "bound_free_reason")):
            is_open = row[key] is not None and row[reason] not in PROVED
            shown[key] = Marked(row[key], OPEN if is_open else " ")
    print_table(gap_title(rows), table)
    if any(OPEN in (shown["bound"].mark, shown["gap_free"].mark) for shown in table):
        _console().print(
            f"{OPEN} A limit stopped the search for this bound: it is certified, but the optimum "
            "may be lower."
        )
    for words in _missing_bounds(rows):
        _console().print(words, markup=False)
    if any(row["conflicts"] for row in rows):
        _console().print(
            "A plan with conflicts breaks the scene's rules: its reward may exceed the bound, "
            "and it has no gap."
        )


def gap_title(rows: Sequence[Row]) -> str:
    """What the bounds of a gap table are."""
    if not rows:
        return "no rows"
    proved = [row for row in rows if row["bound_reason"] in PROVED]
    others = [r for r in rows if r["bound"] is not None and r["bound_reason"] not in PROVED]
    methods = ", ".join(dict.fromkeys(row["bound_method"] for row in (*proved, *others)))
    if not others:
        return f"gap to the proved optimum ({methods})" if proved else "no bounds"
    if proved:
        return f"gap to the proved optimum, or where marked {OPEN} to a certified bound ({methods})"
    return f"gap to a certified bound ({methods})"


def _missing_bounds(rows: Sequence[Row]) -> list[str]:
    """Sentences that say which bounds are missing, and why."""
    found: dict[tuple[str, str], dict[str, None]] = {}
    for row in rows:
        what, key = "No bound", "bound"
        if row[key] is not None:
            what, key = "No bound without rules", "bound_free"
        reason = row[f"{key}_reason"]
        if row[key] is None and reason not in PROVED:
            found.setdefault((what, reason), {})[f"{row['scene']} seed {row['seed']}"] = None
    return [
        f"{what} for {_some(list(cases))}: {MISSING.get(reason, reason)}."
        for (what, reason), cases in found.items()
    ]


def _some(names: Sequence[str]) -> str:
    """The first names, and how many more there are."""
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")


def _text(key: str, value: Any) -> str:
    if isinstance(value, Marked):
        return _text(key, value.value) + value.mark
    if value is None:
        return "-"
    if key in SHARES:
        return f"{100 * value:.3f} %"
    if key == "seconds":
        return f"{value:.3f}"
    if isinstance(value, float):
        return f"{value:,.2f}"
    if isinstance(value, (list, tuple)):
        joint = ", " if all(isinstance(item, float) for item in value) else "\n"
        return joint.join(_text("", item) for item in value) or "none"
    return str(value)
