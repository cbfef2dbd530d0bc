"""Memory of coverage tables while they are made, and of planning with them.

The constants by which coverage is estimated before it begins come from here: bytes of an entry, a
face seen from a state, and of a state at a step. Each scene has a process of its own.
"""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from cocap_opt.experiments.lab.results import Results
from cocap_opt.experiments.lab.studies.options import Out
from cocap_opt.experiments.lab.studies.runs import BYTES

_TABLE = "memory.csv"
_SCENES = ("field-large",)
# A process reports its memory before, and the most it has had after coverage and after planning.
_PROGRAM = f"""\
import json, resource, sys
import psutil
from cocap_opt.graph import value_iteration
from cocap_opt.model import Model, compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never
from cocap_opt.vision import views

def most():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * {BYTES}

scene, plain = sys.argv[1], sys.argv[2] == "plain"
if not plain:
    views.KERNEL.load()
    value_iteration.KERNEL.load()
problem = load_scene(scene)
model = Model(problem, use_cache=False, plain=plain)
[model.reachable(c) for c in model.classes]
before = psutil.Process().memory_info().rss
model.prepare_all()
made = most()
tables = [model.coverage(c) for c in model.classes]
compiled(problem).tables.take(model.tables)
PLANNERS["greedy"](problem, never)
print(json.dumps({{
    "entries": sum(len(t.pixels) for t in tables),
    "states": sum(model.reachable(c).size for c in model.classes),
    "table": sum(part.nbytes for t in tables for part in t),
    "making": made - before,
    "planning": most() - before,
}}))
"""


class _Row(NamedTuple):
    scene: str
    way: str  # kernel or plain
    entries: int
    states: int  # at steps
    table: int  # bytes, and those below
    making: int
    planning: int  # at the most, coverage included


def memory(
    *,
    scene: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="names or files of scenes")
    ] = _SCENES,
    out: Out = None,
) -> None:
    """Measures the memory of coverage and planning, and writes the table (memory.csv)."""
    results = Results.into(None if out is None else out.resolve())
    table = Table("scene", "way", "entries", "table", "making it", "planning, too", title="memory")
    rows = list(_rows(scene))
    for row in rows:
        each = (f"{x / max(row.entries, 1):.1f} B" for x in row[4:])
        table.add_row(row.scene, row.way, f"{row.entries:,}", *each)
    results.save(_TABLE, rows)
    Console(soft_wrap=True).print(table)
    Console().print("bytes for each entry, a face seen from a state")


def _rows(scenes: tuple[str, ...]) -> Iterator[_Row]:
    for scene in scenes:
        place = str(Path(scene).resolve()) if Path(scene).exists() else scene
        for way in ("kernel", "plain"):
            command = [sys.executable, "-c", _PROGRAM, place, way]
            run = subprocess.run(
                command,
                check=True,
                stdout=subprocess.PIPE,
                env=os.environ | {"COCAP_OPT_CACHE": ""},
            )
            yield _Row(Path(scene).stem, way, **json.loads(run.stdout))
