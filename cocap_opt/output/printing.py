"""Results on standard output: tables, or one JSON object and nothing else."""

import html
import os
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from json import dumps
from math import fsum
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from cocap_opt.output.conflicts import grouped_conflicts
from cocap_opt.stop import NO_LIMIT
from cocap_opt.text import printable, shortened

Record = dict[str, Any]  # a row of a small table, or the answer of a command

_WRAPPED = ("scene", "about", "message", "worst moment")  # columns of small tables
_FOLDED = 16  # least width, in characters, of text that goes on in the next line
_UNBOUNDED = 10_000  # characters of a line that is measured only
_WIDE = 200  # characters of a line that goes to a file or a pipe
_USUAL = 80  # characters of a line of a terminal
_BREAK = "\n"
_FEW_NOTES = 3  # below a table: more of them are a list, so that one sees where each begins
_MARKS = "|`*[]\\"  # what Markdown gives a meaning besides HTML
# Names of statistics, as people read them; JSON has the keys.
# Numbers as tables have them: marks, a sign, digits, a unit; several; a share of something; a note.
_ONE = r"[*\\]*(?:&lt;|[<~±+-])?\s?\d[\d.,:]*(?:e[+-]?\d+)?(?:\s?[^\s\d(,.]{1,5})?[*\\]*"
_NUMBER = re.compile(rf"{_ONE}(?:(?:,\s| ± | to | of |\.\.){_ONE})*(?: \([^()]*\))?[*\\]*")
_NO_NUMBER = ("none", "no plan", "unknown", "above 100", "inf", "nan")  # cells among numbers

_LABELS = {
    "cut_short": "attention",
    "plain": "checked without compiled code",
    "generated": "tree: nodes made",
    "expanded": "tree: nodes expanded",
    "depth": "tree: depth of the plan",
    "evaluated": "single views evaluated",
    "leaves": "leaves of the proof",
    "iterations": "pricing rounds",
    "columns": "columns (paths) made",
    "rows": "collision rows",
    "cuts": "envelope cuts",
    "stages": "stages of step envelopes",
    "paths_above": "J above which all plans were tried",
    "step": "seconds of a step",
    "duration": "seconds of the flight",
    "deviation": "most from the straight flight at any moment (m)",
    "least_distance": "least distance of two drones at any moment (m)",
    "people_distance": "least distance to a person at any moment, from above (m)",
    "delay_tolerance": "delay tolerance: drones may be apart in time by less than (s)",
    "delay_tolerance_to_people": "delay tolerance to people: drones may be ahead or behind by (s)",
    "from_step": "the rest begins at step",
    "drones": "drones that fly it",
    "flown_reward": "J of what was flown",
    "whole_reward": "J of the whole mission",
    "old_reward": "J of the old rest",
    "bound_seconds": "seconds of the bound",
    "items": "items of the longest mission",
    "late": "late at the end at most, for legs that cannot be flown in time (s)",
    "slowed": "steps at which a drone passes more slowly, to be safe",
    "shortened": "steps at which a drone changes speed in less time, to be safe",
    "reward_straight": "J, straight, between the steps too",
    "reward_smooth": "J, smooth, between the steps too",
    "takes": "take by take",
    "smoothing_cost": "J of the smooth flight against that of the straight one",
    "states_reached": "states at steps that drones reach",
    "states_that_see": "of these, states that see anything",
    "near_people_undecided": "places and moves too near to a least distance to be decided",
    "draw": "seed of what is drawn (--draw)",
    "views_enclosed": "states at steps whose coverage is enclosed",
    "numbers_enclosed": "numbers of them that are not 0 on both sides",
    "numbers_undecided": "numbers whose enclosure is too wide to decide",
    "widest_share": "widest of the other enclosures, as a share",
    "widest_pixels": "widest of the other enclosures (px/m2)",
    "rewards_enclosed": "J of each plan, by the scene alone",
    "agrees": "the instance is the scene's",
    "accuracy": "latitudes and longitudes may be off by (m)",
}
# Methods of bounds whose names say little; JSON has the names.
_METHODS = {
    "step-envelopes": "column-generation, with step envelopes",
    "step-multipliers": "a simple bound, with one multiplier for all faces of a step",
    "optimistic": "a simple bound, as if nothing hid anybody at some steps",
}
# Lists of rewards: what each is of, and the number of the first.
_SERIES = {"reward_per_step": ("step", 1), "reward_per_person": ("person", 0)}
_FEW = 12  # rewards that are listed; of more there is a summary, and JSON has them
# Values that say nothing, by their keys; JSON has them.
_SILENT = {"limit": NO_LIMIT, "evaluated": 0, "reward_at_start": 0.0, "late": 0.0}
_ONLY_JSON = ("digest", "seen_by_two", "seen_by_three", "median_error")
_SHARES = ("gap", "gap_free", "largest gap", "largest gap_free")  # printed in %


class _Output(Console):
    def on_broken_pipe(self) -> None:
        raise BrokenPipeError  # rich would exit with 1, which here means a false claim


def _console(least: int = 0) -> Console:
    """Returns standard output, at least so wide; text that is too long goes on in the next line."""
    known = sys.stdout.isatty() or os.environ.get("COLUMNS", "").isdecimal()
    console = _Output() if known else _Output(width=_WIDE)
    console.width = max(console.width, least)
    return console


def counted(number: int, noun: str) -> str:
    """Returns a number with its noun, as in "1 row" and "2 rows"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def rounded(amount: float) -> str:
    """Returns an amount with two decimals; next to nothing has no sign."""
    return f"{round(amount, 2) + 0.0:,.2f}"


def print_result(row: Record, json: bool) -> None:
    """Prints the answer of a command: a line per key, or one JSON object on one line.

    Infinite numbers are null in JSON; what is no text, or would steer a terminal, is escaped.
    """
    if json:
        sys.stdout.write(_harmless(msgspec.json.encode(row, enc_hook=_path_text).decode()) + "\n")
        return
    table = Table(show_header=False, box=None)
    table.add_column()
    table.add_column(overflow="fold")  # nothing is cut off: names of files are to be copied
    for key, value in row.items():
        silent = value is None or value == "" or _SILENT.get(key) == value
        if not silent and key not in _ONLY_JSON:
            table.add_row(_LABELS.get(key, key), escape(_shown(key, value)))
    _console().print(table)


def _shown(key: str, value: Any) -> str:
    """Returns a value as people read it: conflicts in groups, and long lists summed up."""
    if key == "smoothing_cost":  # which is below 0 where smoothness gains
        return f"{-100 * value:+.3f} %"
    if key == "takes":
        return told_takes(value)
    if key == "violations":
        return _text(key, grouped_conflicts(value))
    if key in _SERIES and len(value) > _FEW:
        return _summary(value, *_SERIES[key])
    return _text(key, value)


def told_takes(rows: Sequence[Mapping[str, Any]]) -> str:
    """Returns J and the quality of a plan in each take, a line each."""
    return _BREAK.join(
        "; ".join(filter(None, [
            f"{row['take']} ({100 * row['probability']:.3g} %): J {rounded(row['reward'])}",
            row["cameras"],
        ]))
        for row in rows
    )  # fmt: skip


def _summary(rewards: Sequence[float], noun: str, first: int) -> str:
    """Returns the mean of rewards, and which is the least and which the largest."""
    least, most = (rewards.index(end(rewards)) for end in (min, max))
    return "\n".join([
        f"mean {fsum(rewards) / len(rewards):,.2f} over {len(rewards)}; --json has all",
        f"least {rewards[least]:,.2f}, {noun} {least + first}",
        f"most {rewards[most]:,.2f}, {noun} {most + first}",
    ])  # fmt: skip


def print_texts(tables: Sequence[str], sentences: Sequence[str]) -> None:
    """Prints tables as they are, and sentences below each other."""
    console = _console()
    for text in tables:
        console.print(f"\n{printable(text, _BREAK)}", markup=False, highlight=False, soft_wrap=True)
    console.print()
    for text in sentences:
        console.print(printable(text, _BREAK), markup=False, highlight=False)


def line_width() -> int:
    """Returns the characters of a line of a terminal; of a usual one where there is none."""
    console = _console()
    return _USUAL if console.width == _WIDE and not console.is_terminal else console.width


def markdown_table(rows: Sequence[Mapping[str, str]]) -> str:
    """Returns rows that all have the keys of the first as a Markdown table, its columns aligned.

    Numbers end where their column ends, all else begins where it begins.

    Parameters
    ----------
    rows : text that may have marks of Markdown; `Listing.cell` escapes what must not
    """
    from pandas import DataFrame  # slow to import

    heads = [Listing.cell(key) for key in rows[0]]
    frame = DataFrame([list(row.values()) for row in rows], columns=heads)
    sides = ["right" if _are_numbers(row[key] for row in rows) else "left" for key in rows[0]]
    return str(frame.to_markdown(index=False, disable_numparse=True, colalign=sides))


def _are_numbers(cells: Iterable[str]) -> bool:
    """Returns True if there are numbers, with units and notes in brackets, and nothing else."""
    filled = [cell for cell in cells if cell.strip("- ") and cell not in _NO_NUMBER]
    return bool(filled) and all(_NUMBER.fullmatch(cell) for cell in filled)


class Listing(NamedTuple):
    """A small table to be printed; its rows all have the keys of the first.

    Attributes
    ----------
    notes : sentences below it
    """

    title: str
    rows: Sequence[Record]
    notes: Sequence[str] = ()

    def print(self) -> None:
        """Prints it on standard output."""
        _console(self._least_width).print(self._table())
        console = _console()
        if len(self.notes) <= _FEW_NOTES:
            for words in self.notes:
                console.print(printable(words, _BREAK), markup=False)
            return
        listed = Table.grid(padding=(0, 1))
        for words in self.notes:
            listed.add_row("-", Text(printable(words, _BREAK)))
        console.print(listed)

    def first(self, number: int, what: str) -> "Listing":
        """Returns it with its first rows only, and a note that says so.

        Parameters
        ----------
        what : the rows that are kept, in words
        """
        if len(self.rows) <= number:
            return self
        note = f"{what}: {number} of {len(self.rows)}; --json has all"
        return self._replace(rows=self.rows[:number], notes=[note, *self.notes])

    def fitted(self, spare: Sequence[str], whole: str = "") -> "Listing":
        """Returns it without as many of some columns, the first first, as a terminal is too narrow.

        A note names them. Where standard output is no terminal, it is whole.

        Parameters
        ----------
        whole : what shows all columns, as the note says
        """
        listing, gone = self, []
        for key in spare if sys.stdout.isatty() and self.rows else ():
            if listing._least_width <= _console().width:
                break
            if key in listing.rows[0]:
                gone.append(key)
                rows = [{k: v for k, v in row.items() if k != key} for row in listing.rows]
                listing = listing._replace(rows=rows)
        if not gone:
            return self
        words = f"Hidden (terminal too narrow): {', '.join(k for k in self.rows[0] if k in gone)}"
        note = f"{words}; {whole} shows all columns." if whole else f"{words}."
        return listing._replace(notes=[note, *listing.notes])

    @property
    def _least_width(self) -> int:
        """The number of characters in a line, at least."""
        console = _console()
        unbounded = console.options.update(max_width=_UNBOUNDED)  # else clamped to the terminal
        return console.measure(self._table(), options=unbounded).minimum

    def _table(self) -> Table:
        table = Table(title=escape(printable(self.title)), title_justify="left", box=SIMPLE_HEAD,
                      pad_edge=False, collapse_padding=True)  # fmt: skip
        for key, value in self.rows[0].items() if self.rows else ():
            wraps, widest = key in _WRAPPED, self._widest(key)
            table.add_column(key, justify="left" if _is_name(value) else "right",
                             no_wrap=not wraps, overflow="fold",
                             min_width=min(_FOLDED, widest) if wraps else widest)  # fmt: skip
        for row in self.rows:
            table.add_row(*(escape(_text(key, value)) for key, value in row.items()))
        return table

    def _widest(self, key: str) -> int:
        """Returns the number of characters that a column needs."""
        texts = [key, *(_text(key, row[key]) for row in self.rows)]
        return max(len(part) for text in texts for part in (text.splitlines() or [""]))

    @property
    def markdown(self) -> str:
        """The same rows in Markdown."""
        if not self.rows:
            return ""
        cells = [
            {key: self.cell(_text(key, value)) for key, value in row.items()} for row in self.rows
        ]
        return markdown_table(cells) + "\n"

    @staticmethod
    def cell(text: str) -> str:
        """Returns text for a cell of a Markdown table, in which no character has a meaning."""
        escaped = html.escape(printable(text), quote=False)
        return "".join(f"&#{ord(c)};" if c in _MARKS else c for c in escaped)


def _is_name(value: object) -> bool:
    """Returns True for words, which begin where their column begins; numbers end where it ends."""
    return isinstance(value, str) and not (value[:1].isdigit() or value[:1] == "-")


class Marked(NamedTuple):
    """A number, or words in its place, printed with a mark behind it."""

    value: float | str | None
    mark: str


def _harmless(json: str) -> str:
    """Returns JSON whose characters that are no text are escaped, as JSON escapes them."""
    return "".join(c if c.isprintable() else dumps(c)[1:-1] for c in json)


def _path_text(value: object) -> str:
    assert isinstance(value, Path), f"{value!r} is nothing that can be printed"
    return printable(str(value))


def _text(key: str, value: Any) -> str:
    if isinstance(value, Path):
        return _path_text(value)
    if isinstance(value, Marked):
        return _text(key, value.value) + value.mark
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
    if isinstance(value, (list, tuple)):
        if value and all(isinstance(item, float) for item in value):
            return "  ".join(f"{item:,.2f}" for item in value)
        return "\n".join(_text("", item) for item in value) or "none"
    return shortened(printable(value)) if key == "scene" else printable(str(value))
