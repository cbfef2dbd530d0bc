"""Small sweeps, and what is compared of their tables."""

import csv
from pathlib import Path

from cocap_opt.experiments.sweeps.instances import Instance, Settings
from cocap_opt.experiments.tables.layout import FOLDERS
from cocap_opt.problem import Problem
from cocap_opt.scenarios.built_in.field import field

PLANNER_NAMES = ("greedy", "sequential", "cocap")
SETTINGS = Settings(time_limit=60.0, bound_time_limit=60.0)
# They depend on how fast a machine is.
TIMES = (
    "seconds", "coverage_seconds", "checking_seconds", "bound_seconds", "bound_free_seconds",
)  # fmt: skip


def instances(
    seeds: range = range(2),
    planners: tuple[str, ...] = PLANNER_NAMES,
    settings: Settings = SETTINGS,
) -> list[Instance]:
    """Two small scenes, which are others for each seed."""
    return [
        Instance(small_field(seed, steps), seed, planners, settings)
        for steps in (2, 3)
        for seed in seeds
    ]


def small_field(seed: int, steps: int = 2) -> Problem:
    """Two drones and a person."""
    return field(seed, robots=2, actors=1, cells=15, steps=steps).replace(name=f"field-{steps}")


def folder_for_a_sweep(path: Path) -> Path:
    """A folder with the folders that a sweep has."""
    for part in FOLDERS:
        (path / part).mkdir(parents=True)
    return path


def small_sweep(*arguments: object) -> list[str]:
    """Command line of a small sweep: a scene without seeds, and one that each seed changes."""
    return [
        "gap", "tiny-queue",
        "corridor", "--seeds", "0-1", "--planner", "greedy", "--planner", "cocap",
        *map(str, arguments),
    ]  # fmt: skip


def csv_rows(folder: Path) -> list[dict[str, str]]:
    """The table in a folder, without what depends on the machine."""
    with (folder / "results.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return [{key: row[key] for key in row if key not in TIMES} for row in rows]
