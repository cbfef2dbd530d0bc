"""Memory of coverage tables while they are made and written to the cache, and of planning.

The constant that estimates the memory of coverage in advance comes from here: bytes per entry, i.e.
per face seen from a state. It is the larger of the last two columns. Each scene has its own
process.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, NamedTuple

from cyclopts import Parameter
from rich.console import Console
from rich.table import Table

from cocap_opt.experiments.lab.results import Results
from cocap_opt.experiments.lab.studies.options import Out
from cocap_opt.experiments.lab.studies.runs import BYTES
from cocap_opt.model.coverage_tables import BYTES_PER_STATE

_TABLE = "memory.csv"
_SCENES = ("field-large",)
# A process reports its memory before coverage, and its peak memory after making coverage, after
# writing it, and after planning.
_PROGRAM = f"""\
import json, resource, sys
import psutil
from cocap_opt.graph import value_iteration
from cocap_opt.model import Model, compiled
from cocap_opt.planners import PLANNERS
from cocap_opt.scenarios import load_scene
from cocap_opt.stop import never
from cocap_opt.vision import sights
from cocap_opt.vision.cache import TableCache

def most():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * {BYTES}

scene, plain = sys.argv[1], sys.argv[2] == "plain"
if not plain:
    sights.KERNEL.load()
    value_iteration.KERNEL.load()
problem = load_scene(scene)
model = Model(problem, use_cache=False, plain=plain)
[model.reachable(c) for c in model.classes]
before = psutil.Process().memory_info().rss
model.prepare_all()
made = most()
tables = [model.coverage(c) for c in model.classes]
for number, table in enumerate(tables):
    TableCache.of_user().table(str(number), lambda: (table, 0.0))
written = most()
compiled(problem).tables.take(model.tables)
PLANNERS["greedy"](problem, never)
print(json.dumps({{
    "entries": sum(len(t.pixels) for t in tables),
    "states": sum(model.reachable(c).size for c in model.classes),
    "table": sum(part.nbytes for t in tables for part in t),
    "making": made - before,
    "writing": written - before,
    "planning": most() - before,
}}))
"""


class _Row(NamedTuple):
    scene: str
    way: str  # kernel or plain
    entries: int
    states: int  # at steps
    table: int  # bytes, as all below
    making: int  # peak, as all below
    writing: int  # to the cache, including making
    planning: int  # including coverage


def memory(
    *,
    scene: Annotated[
        tuple[str, ...], Parameter(consume_multiple=True, help="names or files of scenes")
    ] = _SCENES,
    out: Out = None,
) -> None:
    """Measures the memory of coverage and planning, and writes the table (memory.csv)."""
    results = Results.into(None if out is None else out.resolve())
    table = Table(
        "scene", "way", "entries", "table", "making it", "writing it, too", "planning, too",
        "without states", title="memory",
    )  # fmt: skip
    rows = list(_rows(scene))
    for row in rows:
        sizes = *row[4:], row.planning - BYTES_PER_STATE * row.states
        each = (f"{x / max(row.entries, 1):.1f} B" for x in sizes)
        table.add_row(row.scene, row.way, f"{row.entries:,}", *each)
    results.save(_TABLE, rows)
    Console(soft_wrap=True).print(table)
    Console().print(
        "bytes for each entry, a face seen from a state; without states: like planning, minus "
        f"{BYTES_PER_STATE} B for each state at a step"
    )


def _rows(scenes: tuple[str, ...]) -> Iterator[_Row]:
    for scene in scenes:
        place = str(Path(scene).resolve()) if Path(scene).exists() else scene
        for way in ("kernel", "plain"):
            command = [sys.executable, "-c", _PROGRAM, place, way]
            with tempfile.TemporaryDirectory() as empty:
                environment = os.environ | {"COCAP_OPT_CACHE": empty}
                run = subprocess.run(command, check=True, stdout=subprocess.PIPE, env=environment)
            yield _Row(Path(scene).stem, way, **json.loads(run.stdout))
