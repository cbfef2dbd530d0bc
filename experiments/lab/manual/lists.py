"""Lists that are made from the code: columns, parameters, scenes, formats, cameras, airframes."""

import re
from collections.abc import Callable, Collection, Mapping
from functools import cache, partial
from itertools import chain
from textwrap import wrap

from cocap_opt.experiments.lab.results import markdown
from cocap_opt.experiments.tables.columns import TableColumn
from cocap_opt.experiments.tables.rows import COLUMNS
from cocap_opt.experiments.tables.teams import COLUMNS as TEAM_COLUMNS
from cocap_opt.formulations import BOUNDS, EXACT
from cocap_opt.formulations.column_generation.parameters import DEFAULTS
from cocap_opt.formulations.model_files.model import ModelFile
from cocap_opt.formulations.result import CertifiedResult
from cocap_opt.method import Method
from cocap_opt.model import compiled
from cocap_opt.output.known_scenes import known_scenes
from cocap_opt.output.long_tables import TABLES
from cocap_opt.output.printing import Record
from cocap_opt.scenarios import load_scene
from cocap_opt.scenarios.recipe import EXAMPLE

_WIDEST = 78  # characters of a line of code that a page shows without scrolling

_PARTS = re.split(r"(?m)(?=^\[\[drones\]\]$)", EXAMPLE, maxsplit=1)  # one page for each part
_COMMENTED = re.compile(r"(.*?\S) +# (.*)")  # a key, possibly commented out, and its comment
_CONTINUED = re.compile(r"#? {8,}# ")

_OF_ROOT = ("root", "large_root", "bundle", "ascent", "ruled_ascent", "relaxation")
_OF_ENVELOPES = ("envelopes", "lists", "trials", "middle")


def _columns(columns: Mapping[str, TableColumn]) -> str:
    rows = [
        {"column": name, "type": column.kind.__name__, "unit": column.unit,
         "meaning": column.meaning}
        for name, column in columns.items()
    ]  # fmt: skip
    return markdown(rows)


def _methods(registry: Mapping[str, Method[CertifiedResult]]) -> str:
    rows = [
        {"method": name, "algorithm": method.made_of, "scenes": method.scenes,
         "guarantees": method.promises}
        for name, method in registry.items()
    ]  # fmt: skip
    return markdown(rows)


def _parameters(sections: Collection[str], others: bool = False) -> str:
    """Returns the parameters of some sections, or those of all others."""
    rows = [
        {"parameter": name, "default": value, "unit": unit, "meaning": meaning}
        for name, value, unit, meaning in DEFAULTS.rows()
        if (name.split(".")[0] in sections) != others
    ]
    return markdown(rows)


def _recipe(part: slice) -> str:
    """Returns a part of the example recipe; comments too wide for a page precede their key."""
    keys: list[list[str]] = []  # each with the lines on which its comment continues
    for line in "".join(_PARTS[part]).strip().splitlines():
        if keys and _CONTINUED.match(line):
            keys[-1].append(line)
        else:
            keys.append([line])
    return "\n".join(["```toml", *chain.from_iterable(map(_narrow, keys)), "```"])


def _narrow(lines: list[str]) -> list[str]:
    """Returns a key of TOML with its comment above it, if it is too wide for a page."""
    found = _COMMENTED.match(lines[0])
    if max(map(len, lines)) <= _WIDEST or not found:
        return lines
    comment = " ".join([found[2], *(line.rpartition("  # ")[2] for line in lines[1:])])
    return [*wrap(comment, _WIDEST, initial_indent="# ", subsequent_indent="# "), found[1]]


def _long_tables() -> str:
    rows = [
        {"table": f"{name}.csv", "columns": ", ".join(table.columns), "a row": table.about}
        for name, table in TABLES.items()
    ]
    return markdown(rows)


def _tangents() -> str:
    """Returns the number of tangents in the program of a small scene, for each error."""
    model, rows = compiled(load_scene("corridor", 0).until(4)), list[Record]()
    for error in (1e-3, 1e-4, 1e-5, 1e-6, 0.0):
        found = ModelFile.with_tangents(model, error)
        rows.append(
            {"--root-error": f"{error:g}", "tangents": f"{found.n_tangents:,}",
             "largest error": f"{found.error:.2g}"}
        )  # fmt: skip
    return markdown(rows)


def _known(kind: str) -> str:
    return markdown(_all_known()[kind])


@cache
def _all_known() -> dict[str, list[Record]]:
    return known_scenes()  # builds every scene


LISTS: dict[str, Callable[[], str]] = {
    "columns": partial(_columns, COLUMNS),
    "team_columns": partial(_columns, TEAM_COLUMNS),
    "bounds_described": partial(_methods, BOUNDS),
    "exact_described": partial(_methods, EXACT),
    "root_parameters": partial(_parameters, _OF_ROOT),
    "envelope_parameters": partial(_parameters, _OF_ENVELOPES),
    "search_parameters": partial(_parameters, (*_OF_ROOT, *_OF_ENVELOPES), others=True),
    "recipe": partial(_recipe, slice(1)),
    "recipe_drones": partial(_recipe, slice(1, None)),
    "long_tables": _long_tables,
    "tangents": _tangents,
    **{
        kind: partial(_known, kind)
        for kind in ("scenes", "formats", "options", "cameras", "airframes")
    },
}
