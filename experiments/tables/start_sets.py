"""The table that compares start positions: the best plan and the bound of each choice."""

import math
from collections.abc import Mapping, Sequence

from cocap_opt.experiments.tables.gap_table import PROVED
from cocap_opt.experiments.tables.rows import GapRow
from cocap_opt.output.printing import Listing, Record

_Groups = Mapping[tuple[str, int], Mapping[str, Sequence[tuple[str, int]]]]
_NOTE = (
    "Best J: the best plan found, by a planner or by the search for the bound. Bound: no plan from "
    "any of these starts has a higher J. Of the best: best J as a share of the highest in this "
    "table."
)


def print_start_sets(groups: _Groups, rows: Sequence[GapRow]) -> None:
    """Prints the best J and the bound of each choice of starts, scene by scene.

    Parameters
    ----------
    groups : by scene and seed, then by choice: the names and seeds of the choice's problems
    rows : of all these problems
    """
    table = [record for group in groups.items() for record in _compared(*group, rows)]
    if table:
        listing = Listing("where drones start", table)
        listing._replace(notes=[*listing.notes, _NOTE]).print()


def _compared(
    scene: tuple[str, int],
    choices: Mapping[str, Sequence[tuple[str, int]]],
    rows: Sequence[GapRow],
) -> list[Record]:
    best, found = -math.inf, []
    for choice, problems in choices.items():
        of_choice = [row for row in rows if (row.scene, row.seed) in problems]
        found_in = (value for row in of_choice for value in (_reward(row), row.optimum))
        values = [value for value in found_in if value is not None]
        bounds = [row.bound for row in of_choice if row.bound is not None]
        bound = max(bounds) if len(bounds) == len(of_choice) > 0 else None
        value = max(values, default=None)
        proved = bool(of_choice) and all(row.bound_reason in PROVED for row in of_choice)
        best = max(best, -math.inf if value is None else value)
        found.append((choice, len(problems), value, bound, proved))
    return [
        {
            "scene": scene[0],
            "seed": scene[1],
            "starts": choice if count == 1 else f"{choice}, best of {count}",
            "best J": value,
            "bound": bound,
            "proved": "yes" if proved else "no",
            "of the best": f"{100 * value / best:.1f} %"
            if value is not None and best > 0
            else None,
        }
        for choice, count, value, bound, proved in found
    ]


def _reward(row: GapRow) -> float | None:
    """Returns J of a plan that obeys the rules."""
    return row.reward if row.valid else None
