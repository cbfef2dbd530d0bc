"""The names of the files in a sweep's folder, which depend only on the row."""

import hashlib
import re
from pathlib import Path

from cocap_opt.experiments.tables.rows import PlanRow

CELLS, _CERTIFICATES, _PLANS, _SCENES, TRACES = FOLDERS = (
    "cells", "certificates", "plans", "scenes", "traces",
)  # fmt: skip


class Paths:
    """The files that belong to a row; paths are relative to the sweep's folder."""

    def __init__(self, row: PlanRow) -> None:
        seed = "own" if row.seed is None else row.seed
        self._stem, self._planner = f"{_file_name(row.scene)}-{seed}", row.planner

    @property
    def scene(self) -> Path:
        """The scene, in cocap-opt's own format."""
        return Path(_SCENES, f"{self._stem}.json")

    @property
    def plan(self) -> Path:
        """The planner's plan; there is no such file if the row has no reward."""
        assert self._planner is not None
        return Path(_PLANS, f"{self._stem}-{_file_name(self._planner)}.json")

    def certificate(self, free: bool) -> Path:
        """The certificate of the bound under the rules, or of the bound without collision rules."""
        return Path(_CERTIFICATES, f"{self._stem}{_suffix(free)}.json")

    def trace(self, free: bool) -> Path:
        """The value and the bound over time, in the search for one of the two bounds."""
        return Path(TRACES, f"{self._stem}{_suffix(free)}.csv")


def _suffix(free: bool) -> str:
    return "-free" if free else ""


def _file_name(name: str) -> str:
    """Returns a name that is safe on any file system; a digest keeps changed names distinct."""
    plain = re.sub(r"[^a-z0-9._-]+", "_", name.lower()).strip("_.-")[:60] or "scene"
    if plain == name:
        return plain
    return f"{plain}-{hashlib.sha256(name.encode()).hexdigest()[:12]}"
