"""The gap table, cell by cell: a scene and a seed, one bound, and a plan per planner."""

import csv
import io
import re
from collections.abc import Sequence
from pathlib import Path

from cocap_opt.cache import write_atomically
from cocap_opt.io import encode
from cocap_opt.problem import Problem
from cocap_opt.stop import Stop
from experiments.files import save_plan, write
from experiments.report import Row, gap_row, run_bound, run_planner

BOUND_METHOD = "column-generation"


def gap_cell(
    problem: Problem,
    seed: int,
    planners: Sequence[str],
    seconds: float,
    interrupt: Stop,
    folder: Path | None,
) -> list[Row]:
    """Rows of one scene and seed; with a folder, the plans and the certificate as files."""
    bounded = run_bound(problem, BOUND_METHOD, seconds, interrupt)
    stem, path = f"{_file_name(problem.name)}-{seed}", ""
    certificate = bounded.certificate
    if folder is not None and certificate is not None:
        path = f"certificates/{stem}.json"
        target, content = folder / path, encode(certificate)
        write(target, lambda: write_atomically(target, content))
    rows = []
    for name in planners:
        judged = run_planner(problem, name, seconds, interrupt)
        if folder is not None and judged.result.plan is not None:
            save_plan(folder / f"plans/{stem}-{name}.json", problem, name, judged)
        rows.append(gap_row(problem, seed, name, judged, bounded, path))
    return rows


def told_apart(problems: dict[tuple[str, int], Problem]) -> dict[tuple[str, int], Problem]:
    """Problems by (scene as typed, seed); scenes of one name are called as they were typed.

    The name is no part of a problem's digest, so certificates and plans still fit.
    """
    typed: dict[str, set[str]] = {}
    for (scene, _), problem in problems.items():
        typed.setdefault(problem.name, set()).add(scene)
    return {
        (scene, seed): problem.replace(name=scene) if len(typed[problem.name]) > 1 else problem
        for (scene, seed), problem in problems.items()
    }


def _file_name(scene: str) -> str:
    return re.sub(r"[^\w.-]+", "_", scene).strip("_.") or "scene"


def save_rows(path: Path, rows: Sequence[Row]) -> None:
    """Write rows as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, fieldnames=list(rows[0]) if rows else [])
    writer.writeheader()
    writer.writerows(rows)
    write(path, lambda: write_atomically(path, text.getvalue().encode()))
