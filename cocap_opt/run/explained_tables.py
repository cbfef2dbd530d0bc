"""Tables that explain a gap: its parts, drones and people by step, rows with prices."""

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from cocap_opt.data import FloatArray
from cocap_opt.formulations.explanation import Term
from cocap_opt.letters import columns_of
from cocap_opt.output.printing import rounded
from cocap_opt.run.explained import SHOWN, Explained
from cocap_opt.text import counted

_LINES = 20  # rows of a table
_WIDTH = 5  # characters of a number


def explained_tables(explained: Explained, width: int) -> list[str]:
    """Returns the tables as text: the parts of the gap, drones and people by step, priced rows.

    Parameters
    ----------
    width : largest number of characters per line; the least informative columns are omitted first
    """
    return [
        _parts(explained, width),
        *_drones(explained, width),
        *_people(explained, width),
        *_rows(explained, width),
    ]


def _parts(explained: Explained, width: int) -> str:
    found = explained.explanation
    rows = list(explained.parts().items())
    rows += [("sum", found.total()), ("bound - J", found.gap)]
    return _table(
        "Parts of the gap",
        ["", "amount", "% of bound"],
        [[words, rounded(amount), _percent(explained, amount)] for words, amount in rows],
        width,
        spare=["amount"],
    )


def _percent(explained: Explained, amount: float) -> str:
    return f"{round(100 * explained.explanation.share(amount), 4) + 0.0:.4f}"


def _drones(explained: Explained, width: int) -> list[str]:
    losses = explained.explanation.losses()
    title = "Cost of each drone's moves, % of the bound"
    names = [str(robot) for robot in range(len(losses))]
    return _grid(explained, title, "drone", names, losses, list(range(losses.shape[1])), width)


def _people(explained: Explained, width: int) -> list[str]:
    """Tabulates how much the bound overestimates people's rewards, by side and step."""
    problem = explained.problem
    steps = [None] if problem.objective.over_time else list(range(problem.horizon + 1))
    sides = [(j, name) for j, a in enumerate(problem.actors) for name in a.shape.face_names]
    first = np.searchsorted(problem.face_owner, np.arange(len(problem.actors)))
    paid = np.zeros((len(sides), len(steps)))
    for term in explained.explanation.of_kind("face"):
        assert term.actor is not None
        assert term.face is not None
        paid[first[term.actor] + term.face, term.step or 0] += term.amount
    title = "Overestimated reward of people's sides, % of the bound"
    names = [f"{j} {name}" for j, name in sides]
    return _grid(explained, title, "person", names, paid, steps, width)


def _grid(
    explained: Explained,
    title: str,
    noun: str,
    names: Sequence[str],
    amounts: FloatArray,
    steps: Sequence[int | None],
    width: int,
) -> list[str]:
    """Returns amounts [n, steps] as tables of some steps each, without empty lines."""
    shares = explained.explanation.share(1.0) * amounts
    sums = shares.sum(axis=1)
    heavy = np.flatnonzero(np.abs(shares).max(axis=1, initial=0.0) >= SHOWN)
    lines = sorted(heavy[np.argsort(-sums[heavy], kind="stable")][:_LINES].tolist())
    if not lines:
        return []
    note = ""
    if others := len(shares) - len(lines):
        rest = round(100 * (sums.sum() - sums[lines].sum()), 3) + 0.0
        note = f"{counted(others, 'other line')}: {rest:.3f}"
    head = [*(["sum"] if len(steps) > 1 else []), *map(_step, steps)]
    cells = [
        (names[line], [_cell(x) for x in (sums[line], *shares[line])][-len(head) :])
        for line in lines
    ]
    most = (width - max(map(columns_of, (noun, *(names[line] for line in lines))))) // (_WIDTH + 2)
    parts = [slice(n, n + most) for n in range(0, len(head), most)]
    return [
        _table(
            title if part is parts[0] else "",
            [noun, *head[part]],
            [[name, *amounts[part]] for name, amounts in cells],
            width,
            note if part is parts[-1] else "",
            over=None if None in steps else _over(head[part]),
        )
        for part in parts
    ]


def _rows(explained: Explained, width: int) -> list[str]:
    """Returns the rules and decisions with a price, highest price first."""
    terms = explained.explanation.of_kind("row", "decision")
    if not terms:
        return []
    order = sorted(terms, key=lambda term: (-abs(term.amount), -(term.price or 0.0)))
    shown = [
        term
        for term in order[:_LINES]
        if explained.explanation.share(max(abs(term.amount), term.price or 0.0)) >= SHOWN
    ]
    rows = [
        [
            _row(explained, term),
            str(term.step),
            _drones_named(term.users or ()),
            rounded(term.price or 0.0),
            rounded(term.amount),
            _percent(explained, term.amount),
        ]
        for term in shown
    ]
    more = order[len(shown) :]
    rest = sum(term.amount for term in more)
    note = f"{counted(len(more), 'more row')}: {_percent(explained, rest)}" if more else ""
    title = "Rules (at most one drone) and decisions with a price, % of the bound"
    head = ["", "step", "which drones", "price", "amount", "%"]
    return [_table(title, head, rows, width, note, spare=["price", "amount", "step"])]


def _drones_named(users: Sequence[int]) -> str:
    """Returns drones by number, in a form that does not read as a count."""
    if not users:
        return "none"
    return f"drone{'' if len(users) == 1 else 's'} {', '.join(map(str, users))}"


def _row(explained: Explained, term: Term) -> str:
    """Returns a rule, or a decision with its number of drones, in a few characters."""
    if term.kind == "row":
        return explained.named(term.resource)
    sign = "<=" if term.sense == "at most" else ">="
    return f"{sign} {term.robots} {explained.named(term.resource)}"


def _table(
    title: str,
    head: list[str],
    rows: list[list[str]],
    width: int,
    note: str = "",
    spare: Sequence[str] = (),
    hidden: Sequence[str] = (),
    over: list[str] | None = None,
) -> str:
    """Returns a table as text, with the first column left-aligned and the others right-aligned.

    Parameters
    ----------
    over : words above the column heads, if any
    spare : columns to omit if the table is too wide, in order
    hidden : omitted columns, which a line below the table names
    """
    widths = [max(map(columns_of, column)) for column in zip(head, *rows, strict=True)]
    widths[1:] = [max(most, _WIDTH) for most in widths[1:]]
    if spare and sum(widths) + 2 * (len(widths) - 1) > width:
        gone = head.index(spare[0])
        fewer = [line[:gone] + line[gone + 1 :] for line in (head, *rows)]
        return _table(title, fewer[0], fewer[1:], width, note, spare[1:], [*hidden, spare[0]])
    lines = [
        "  ".join(
            [line[0] + " " * (widths[0] - columns_of(line[0]))]
            + [
                " " * (most - columns_of(cell)) + cell
                for cell, most in zip(line[1:], widths[1:], strict=True)
            ]
        )
        for line in ([over] if over else []) + [head, *rows]
    ]
    absent = f"Hidden (terminal too narrow): {', '.join(hidden)}; --json has all." if hidden else ""
    return "\n".join([*wrap(title, width), *lines, *wrap(note, width), *wrap(absent, width)])


def _over(head: Sequence[str]) -> list[str]:
    """Returns the line above a head, with "step" above the first step number."""
    number = next((k for k, cell in enumerate(head) if cell.isdecimal()), len(head))
    return ["", *("step" if k == number else "" for k in range(len(head)))]


def _step(step: int | None) -> str:
    return "all steps" if step is None else str(step)


def _cell(share: Any) -> str:
    return "." if abs(share) < SHOWN else f"{100 * float(share):.3f}"
