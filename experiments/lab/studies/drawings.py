"""The drawings of the pages, each made anew from stored results or from plans made on the spot.

`cocap-opt study pictures` writes them, and so does Sphinx before it builds the pages: no drawing
can be older than its numbers.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.experiments.lab.results import STORED
from cocap_opt.experiments.lab.studies.flight.figure import flight_figure
from cocap_opt.experiments.lab.studies.flight.flight import stored_flights
from cocap_opt.experiments.lab.studies.growth.figure import growth_figure
from cocap_opt.experiments.lab.studies.growth.points import GrowthPoint, Sample
from cocap_opt.experiments.lab.studies.options import chromium
from cocap_opt.experiments.lab.studies.paper.conditions import read_trials
from cocap_opt.experiments.lab.studies.paper.figures import (
    StepReward,
    ablation_figure,
    conditions_figure,
    curves_figure,
    curves_of,
    encounter_figure,
)
from cocap_opt.experiments.lab.studies.paper.giving_way import Encounter
from cocap_opt.experiments.lab.studies.paper.measured import read_rows
from cocap_opt.experiments.lab.studies.paper.reproduction import effects_of
from cocap_opt.experiments.lab.studies.separation.figure import separation_figure
from cocap_opt.experiments.lab.studies.separation.points import SeparationPoint
from cocap_opt.experiments.report.charts import gaps_figure
from cocap_opt.experiments.tables.rows import Row
from cocap_opt.output.files import make_folder, save_files
from cocap_opt.pictures.figures import picture, plan_picture
from cocap_opt.pictures.rendering import drone_view
from cocap_opt.planners import RECOMMENDED
from cocap_opt.problem import Plan, Problem
from cocap_opt.run.engine import run
from cocap_opt.scenarios import load_scene

_SUFFIX = ".png"
_GAPS_OF = ("greedy", "sequential", "sequential-rounds", "cocap", "cocap-vs", RECOMMENDED)
_GAPS_IN = ("bottleneck", "passage")
_GIVING_WAY = ("greedy", "sequential", "cocap")


def _gaps() -> bytes:
    rows = [row for row in _paper() if row.scene in _GAPS_IN and row.planner in _GAPS_OF]
    return picture(gaps_figure(rows), _SUFFIX)


def _curves() -> bytes:
    rewards = StepReward.read(STORED / "curves.csv")
    return picture(curves_figure(curves_of(rewards)), _SUFFIX)


def _ablation() -> bytes:
    return picture(ablation_figure(effects_of(_paper())), _SUFFIX)


def _conditions() -> bytes:
    return picture(conditions_figure(read_trials(STORED / "paper-conditions.csv")), _SUFFIX)


def _separation() -> bytes:
    return picture(separation_figure(SeparationPoint.read(STORED / "separation.csv")), _SUFFIX)


def _flight() -> bytes:
    return picture(flight_figure(stored_flights()), _SUFFIX)


def _growth() -> bytes:
    samples = Sample.read(STORED / "growth.csv")
    return picture(growth_figure(GrowthPoint.all_of(samples), samples[0].limit), _SUFFIX)


def _giving_way() -> bytes:
    """Draws the encounter of ten seeds in which a drone gives up most for its team."""
    found: list[Encounter] = []
    for seed in range(10):
        problem = load_scene("bottleneck", seed)
        found += Encounter.all_of(problem, seed, _plan(problem, "greedy"), _plan(problem, "cocap"))
    most = Encounter.most_generous(found)
    assert most is not None, "nobody gives way"
    problem = load_scene("bottleneck", most.seed)
    plans = {name: _plan(problem, name) for name in _GIVING_WAY}
    return picture(encounter_figure(problem, most, plans), _SUFFIX)


def _top_view(scene: str, *steps: int) -> bytes:
    return plan_picture(*recommended(scene), _SUFFIX, steps)


def _view() -> bytes:
    return drone_view(*recommended("bottleneck"), robot=0, t=5, width=500)


@cache  # the gallery shows the plans of pictures, too
def recommended(scene: str) -> tuple[Problem, Plan]:
    """Returns a scene, with seed 0, and its plan by the recommended planner."""
    problem = load_scene(scene, 0)
    return problem, _plan(problem, RECOMMENDED)


@cache
def _paper() -> list[Row]:
    return read_rows(STORED / "paper.csv")


def _plan(problem: Problem, planner: str) -> Plan:
    plan: Plan | None = run(problem, planner).result.plan
    assert plan is not None, f"{problem.name}: {planner} has no plan"
    return plan


DRAWINGS: dict[str, Callable[[], bytes]] = {
    "gaps": _gaps,
    "curves": _curves,
    "ablation": _ablation,
    "conditions": _conditions,
    "giving-way": _giving_way,
    "separation": _separation,
    "flight": _flight,
    "growth": _growth,
    "view": _view,
    "bridge": lambda: _top_view("bridge"),
    "bottleneck": lambda: _top_view("bottleneck", 0, 4, 8, 11),
}


def pictures(folder: Annotated[Path, Parameter(help="folder for the pictures")], /) -> None:
    """Writes all drawings, and the pictures of the player."""
    write_drawings(folder)
    with chromium("player.png"):
        from cocap_opt.experiments.lab.studies.pictures import write_pictures

        write_pictures(folder)


def write_drawings(folder: Path) -> None:
    """Writes all drawings into a folder, which is made."""
    make_folder(folder)
    save_files({folder / f"{name}{_SUFFIX}": draw() for name, draw in DRAWINGS.items()})
