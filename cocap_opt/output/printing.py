"""Prints tables and sentences on standard output, fitted to the terminal."""

import html
import os
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from cocap_opt.letters import columns_of, folded
from cocap_opt.text import printable, shortened

Record = dict[str, Any]  # a row of a small table, or the answer of a command

_WRAPPED = (
    "scene",
    "about",
    "message",
    "worst moment",
    "limits",
    "program",
)  # columns of small tables
_MOST_NAMES = 0.6  # share of the width for columns that are repeated if a table is split
_FOLDED = 16  # smallest width in characters of text that is folded
_UNBOUNDED = 10_000  # characters of a line that is only measured
_WIDE = 200  # characters of a line in a file or a pipe
_USUAL = 80  # default number of characters per line of a terminal
_BREAK = "\n"
_FEW_NOTES = 3  # sentences below a table; more are printed as a list
_MARKS = "|`*[]\\"  # characters with a meaning in Markdown, besides HTML
# Forms of numbers in tables: marks, a sign, digits, a unit; several; a share of something; a note.
_ONE = (
    r"[*\\]*(?:&lt;|[<~±+-])?\s?\d[\d.,:]*(?:e[+-]?\d+)?(?:\s?[^\s\d(,.]{1,5})?(?:\s?&#42;|[*\\])*"
)
_NUMBER = re.compile(rf"{_ONE}(?:(?:,\s| ± | to | of |\.\.){_ONE})*(?: \([^()]*\))?[*\\]*")
_NO_NUMBER = (
    "none",
    "no plan",
    "proved",
    "unknown",
    "above 100",
    "inf",
    "nan",
)  # other cells in columns of numbers

# Descriptions of bound methods with uninformative names; JSON uses the names.
_METHODS = {
    "step-envelopes": "column-generation, with step envelopes",
    "step-multipliers": "a simple bound, with one multiplier for all faces of a step",
    "optimistic": "a simple bound, as if nothing hid anybody at some steps",
}
_NAMES = ("seed", "draw")  # numbers that are names, whose digits are not grouped
_SHARES = ("gap", "gap without\nrules", "largest gap")  # printed in %


class _Output(Console):
    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # rich would exit with 1, which means a false claim in this program


def _has_width() -> bool:
    """Returns True if lines have a width: that of a terminal, or the one that COLUMNS sets."""
    columns = os.environ.get("COLUMNS", "")
    return sys.stdout.isatty() or (columns.isdecimal() and int(columns) > 0)


def terminal(least: int = 0) -> Console:
    """Returns standard output with at least this width; longer text is folded."""
    console = _Output() if _has_width() else _Output(width=_WIDE)
    # some programs that start others set COLUMNS to 0, which leaves no room for a letter
    console.width = max(console.width or _USUAL, least)
    return console


def rounded(amount: float) -> str:
    """Returns an amount with two decimals; amounts near 0 have no sign."""
    return f"{round(amount, 2) + 0.0:,.2f}"


def print_line(text: str) -> None:
    """Prints a line unchanged."""
    terminal().print(text, markup=False, highlight=False, soft_wrap=True)


def print_texts(tables: Sequence[str], sentences: Sequence[str]) -> None:
    """Prints tables unchanged, followed by sentences, each on its own line."""
    for text in tables:
        print_line(f"\n{printable(text, _BREAK)}")
    if tables:
        print_line("")
    for text in sentences:
        _print_folded(text)


def print_list(sentences: Iterable[str]) -> None:
    """Prints sentences, each after a hyphen."""
    for text in sentences:
        _print_folded(text, "- ", "  ")


def _print_folded(text: str, first: str = "", indent: str = "") -> None:
    """Prints folded text, with a prefix for the first line and an indent for all others."""
    width = terminal().width
    for line in printable(text, _BREAK).split(_BREAK):
        print_line(folded(line, width, first, indent))
        first = indent


def line_width() -> int:
    """Returns the number of characters per line of the terminal, or the default."""
    console = terminal()
    return _USUAL if console.width == _WIDE and not console.is_terminal else console.width


def markdown_table(rows: Sequence[Mapping[str, str]]) -> str:
    """Returns rows that all have the keys of the first as a Markdown table, its columns aligned.

    Numbers are right-aligned, everything else is left-aligned.

    Parameters
    ----------
    rows : text that may contain Markdown; `Listing.cell` escapes other text
    """
    from pandas import DataFrame  # takes long to import

    heads = [Listing.cell(key) for key in rows[0]]
    frame = DataFrame([list(row.values()) for row in rows], columns=heads)
    sides = ["right" if _are_numbers(row[key] for row in rows) else "left" for key in rows[0]]
    return str(frame.to_markdown(index=False, disable_numparse=True, colalign=sides))


def _are_numbers(cells: Iterable[str]) -> bool:
    """Returns True if all cells are numbers, possibly with units and notes in brackets."""
    filled = [cell for cell in cells if cell.strip("- ") and cell not in _NO_NUMBER]
    return bool(filled) and all(_NUMBER.fullmatch(cell) for cell in filled)


class Listing(NamedTuple):
    """A small table for printing; its rows all have the keys of the first.

    Attributes
    ----------
    notes : sentences below the table
    """

    title: str
    rows: Sequence[Record]
    notes: Sequence[str] = ()

    def print(self) -> None:
        """Prints the table on standard output, split into several tables if lines are too
        narrow.
        """
        for part in self._folded() if _has_width() else [self]:
            terminal(part._least_width).print(part._table())
        is_text = all(words.endswith(".") for words in self.notes)
        if len(self.notes) > (_FEW_NOTES if is_text else 1):
            print_list(self.notes)
        else:
            print_texts([], self.notes)

    def first(self, number: int, what: str) -> "Listing":
        """Returns the table with only its first rows, and a note that says so.

        Parameters
        ----------
        what : description of the kept rows
        """
        if len(self.rows) <= number:
            return self
        note = f"{what}: {number} of {len(self.rows)}; --json has all"
        return self._replace(rows=self.rows[:number], notes=[note, *self.notes])

    def fitted(self, spare: Sequence[str], whole: str = "a wider one") -> "Listing":
        """Returns the table without some columns, as many as necessary to fit a narrow terminal, in
        order.

        A note names them. If standard output is not a terminal, the table is complete.

        Parameters
        ----------
        whole : option that shows all columns, for the note
        """
        listing, gone = self, []
        for key in spare if sys.stdout.isatty() and self.rows else ():
            if listing._least_width <= terminal().width:
                break
            if key in listing.rows[0]:
                gone.append(key)
                rows = [{k: v for k, v in row.items() if k != key} for row in listing.rows]
                listing = listing._replace(rows=rows)
        if not gone:
            return self
        hidden = [key for key in self.rows[0] if key in gone]
        words = f"Hidden (terminal too narrow): {', '.join(map(_in_a_line, hidden))}"
        return listing._replace(notes=[f"{words}; {whole} shows all columns.", *listing.notes])

    def _folded(self) -> "list[Listing]":
        """Returns the table in parts that fit the terminal, if single columns do.

        Columns that identify rows are in all parts; only the first of them, if the others leave no
        room.
        """
        keys, width = list(self.rows[0]) if self.rows else [], terminal().width
        count = next((k for k in range(1, len(keys)) if self._differ_by(keys[:k])), len(keys))
        if self._only(keys[:count])._least_width > _MOST_NAMES * width:
            count = 1
        parts, shown = list[Listing](), keys[:count]
        for key in keys[count:]:
            if len(shown) > count and self._only([*shown, key])._least_width > width:
                parts.append(self._only(shown))
                shown = keys[:count]
            shown.append(key)
        first, *others = [*parts, self._only(shown)]
        return [first, *(other._replace(title="") for other in others)]

    def _differ_by(self, keys: Sequence[str]) -> bool:
        """Returns True if the text of some columns distinguishes all rows."""
        texts = {tuple(cell_text(key, row[key]) for key in keys) for row in self.rows}
        return len(texts) == len(self.rows)

    def _only(self, keys: Sequence[str]) -> "Listing":
        """Returns the table with some of its columns, without notes."""
        rows = [{key: row[key] for key in keys} for row in self.rows]
        return self._replace(rows=rows, notes=())

    @property
    def _least_width(self) -> int:
        """The smallest number of characters per line."""
        console = terminal()
        # otherwise limited to the terminal
        unbounded = console.options.update(max_width=_UNBOUNDED)
        return console.measure(self._table(), options=unbounded).minimum

    def _table(self) -> Table:
        title = escape(printable(self.title)) or None
        table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, pad_edge=False,
                      collapse_padding=True)  # fmt: skip
        for key, value in self.rows[0].items() if self.rows else ():
            wraps, widest = key in _WRAPPED, self._widest(key)
            table.add_column(key, justify="left" if _is_name(value) else "right",
                             no_wrap=not wraps, overflow="fold",
                             min_width=min(_FOLDED, widest) if wraps else widest)  # fmt: skip
        for row in self.rows:
            table.add_row(*(escape(cell_text(key, value)) for key, value in row.items()))
        return table

    def _widest(self, key: str) -> int:
        """Returns the smallest width of a column, in terminal columns."""
        texts = [key, *(cell_text(key, row[key]) for row in self.rows)]
        return max(columns_of(part) for text in texts for part in (text.splitlines() or [""]))

    @property
    def markdown(self) -> str:
        """The same rows in Markdown."""
        if not self.rows:
            return ""
        cells = [
            {key: self.cell(cell_text(key, value)) for key, value in row.items()}
            for row in self.rows
        ]
        return markdown_table(cells) + "\n"

    @staticmethod
    def cell(text: str) -> str:
        """Returns text for a cell of a Markdown table, with special characters escaped."""
        escaped = html.escape(printable(text), quote=False)
        return "".join(f"&#{ord(c)};" if c in _MARKS else c for c in escaped)


def _in_a_line(key: str) -> str:
    return key.replace(_BREAK, " ")


def _is_name(value: object) -> bool:
    """Returns True for text, which is left-aligned; numbers are right-aligned."""
    return isinstance(value, str) and not (value[:1].isdigit() or value[:1] == "-")


class Marked(NamedTuple):
    """A number, or text in its place, printed with a mark after it."""

    value: float | str | None
    mark: str


def path_text(value: object) -> str:
    """Returns the name of a file; characters that would control a terminal are escaped."""
    assert isinstance(value, Path), f"{value!r} cannot be printed"
    return printable(str(value))


def cell_text(key: str, value: Any) -> str:
    """Returns a value as text, by its key."""
    if isinstance(value, Path):
        return path_text(value)
    if isinstance(value, Marked):
        return cell_text(key, value.value) + value.mark
    if value is None:
        return "-"
    if key == "method":
        return printable(_METHODS.get(value, value))
    if key in _SHARES:
        return f"{100 * value:.3f} %"
    if key == "seconds" or key.endswith("_seconds"):
        return f"{value:.3f}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:,.2f}"
    if isinstance(value, int):
        return str(value) if key in _NAMES else f"{value:,}"
    if isinstance(value, (list, tuple)):
        if value and all(isinstance(item, float) for item in value):
            return "  ".join(f"{item:,.2f}" for item in value)
        return "\n".join(cell_text("", item) for item in value) or "none"
    return shortened(printable(value)) if key == "scene" else printable(str(value))
