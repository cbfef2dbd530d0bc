"""What is where in a sweep's folder. All paths are relative to it, and follow from a row alone."""

import hashlib
import re
from pathlib import Path

from cocap_opt.experiments.results.rows import Row

CELLS, CERTIFICATES, PLANS, SCENES, TRACES = FOLDERS = (
    "cells", "certificates", "plans", "scenes", "traces",
)  # fmt: skip


def plan_path(row: Row) -> Path:
    """The planner's plan; there is none where the row has no reward."""
    return Path(PLANS, f"{_stem(row)}-{file_name(row['planner'])}.json")


def scene_path(row: Row) -> Path:
    """The scene as a file of cocap-opt."""
    return Path(SCENES, f"{_stem(row)}.json")


def certificate_path(row: Row, free: bool) -> Path:
    """The certificate of the bound under the rules, or of that without any rules."""
    return Path(CERTIFICATES, f"{_stem(row)}{_suffix(free)}.json")


def trace_path(row: Row, free: bool) -> Path:
    """Value and bound over time, in the search for one of the two bounds."""
    return Path(TRACES, f"{_stem(row)}{_suffix(free)}.csv")


def stem_of(scene: str, seed: int | None) -> str:
    """What the names of a scene's and seed's files begin with.

    Parameters
    ----------
    scene : its name
    seed : None where the starts are those in the scene's own file
    """
    return f"{file_name(scene)}-{'own' if seed is None else seed}"


def file_name(name: str) -> str:
    """The name where any file system tells it from others, else what is left and a digest."""
    plain = re.sub(r"[^a-z0-9._-]+", "_", name.lower()).strip("_.-")[:60] or "scene"
    if plain == name:
        return plain
    return f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:12]}"


def _stem(row: Row) -> str:
    return stem_of(row["scene"], row["seed"])


def _suffix(free: bool) -> str:
    return "-free" if free else ""
