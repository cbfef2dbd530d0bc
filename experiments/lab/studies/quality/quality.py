"""Predicted accuracy compared with triangulated walkers, and quality compared with J."""

import math
from collections.abc import Sequence
from functools import partial
from typing import Annotated

from cyclopts import Parameter

from cocap_opt.console.streams import say
from cocap_opt.experiments.lab.results import STORED, Results
from cocap_opt.experiments.lab.studies.options import Out, Scenes, Seconds, Seeds
from cocap_opt.experiments.lab.studies.quality.plans import ALL, TRIANGULATED, plans_of
from cocap_opt.experiments.lab.studies.quality.rows import PersonStep, PlanRow
from cocap_opt.experiments.lab.studies.quality.tables import (
    accuracy_in_markdown,
    accuracy_rows,
    agreement_rows,
    angle_rows,
    choice_rows,
    objective_in_markdown,
    sentences,
)
from cocap_opt.experiments.lab.studies.quality.trials import Trials, person_steps
from cocap_opt.experiments.lab.studies.quality.triangulation import has_library
from cocap_opt.footage.quality import Assumptions
from cocap_opt.output.printing import Listing, print_texts
from cocap_opt.problem import Camera, Problem
from cocap_opt.run.options import Option, UsageError
from cocap_opt.scenarios import SCENES, load_scene

_STEPS, _PLANS, _FIGURE = "quality.csv", "quality-plans.csv", "quality.png"
_LARGE = ("field-long", "field-large")  # built-in scenes for which one seed is enough
_LARGEST = "field-large"  # only plans that are triangulated are made for it
_MOST = 30  # person-steps of a plan that are triangulated
_MOST_DRAWS = 10_000
_EXACT = Assumptions()
_POSED = Assumptions(position_error=0.05, attitude_error=math.radians(0.5))


def quality(
    *,
    scene: Scenes = None,
    seeds: Seeds = "0-2",
    draws: Annotated[int, Parameter(help="number of noise samples for each joint")] = 20,
    limit: Seconds = 10.0,
    out: Out = None,
    stored: Annotated[
        bool, Parameter(negative="", help="only print tables and figure of the stored results")
    ] = False,
) -> None:
    """Measures, prints, and writes tables (quality.csv, quality-plans.csv) and the figure."""
    if not 2 <= draws <= _MOST_DRAWS:
        raise UsageError(f"--draws: must be 2..{_MOST_DRAWS}, not {draws}")
    numbers = Option("--seeds").numbers(seeds)
    results = Results.into(out)
    if stored:
        _tell(stored_steps(), stored_plans(), results)
        return
    library = has_library()
    if not library:
        say(
            "the library's column is left empty: aniposelib is not installed: "
            "pip install -e '.[triangulation]'"
        )
    trials = Trials(draws, _MOST, _EXACT, _POSED, library)
    steps, plans = list[PersonStep](), list[PlanRow]()
    for name in scene or SCENES:
        for seed in numbers if scene else _seeds_of(name, numbers):
            problem = load_scene(name, seed)
            if not _has_pictures(problem):
                if scene:
                    say(f"{name}: left out, as it has fewer than two drones with pinhole cameras")
                continue
            new_steps, new_plans = _measured(problem, seed, trials, limit)
            say(f"{name} seed {seed}: {len(new_plans)} plans, {len(new_steps)} person-steps")
            steps += new_steps
            plans += new_plans
            results.save(_STEPS, steps)
            results.save(_PLANS, plans)
    _tell(steps, plans, results)


def stored_steps() -> list[PersonStep]:
    """Returns the stored person-steps."""
    return PersonStep.read(STORED / _STEPS)


def stored_plans() -> list[PlanRow]:
    """Returns the stored plans."""
    return PlanRow.read(STORED / _PLANS)


def stored_accuracy() -> str:
    """Returns the stored accuracy in Markdown."""
    return accuracy_in_markdown(stored_steps())


def stored_agreement() -> str:
    """Returns the stored comparison of J with quality, in Markdown."""
    return objective_in_markdown(stored_plans())


def _tell(steps: Sequence[PersonStep], plans: Sequence[PlanRow], results: Results) -> None:
    """Prints tables and sentences, and draws the figure."""
    from cocap_opt.experiments.lab.studies.quality.figure import quality_figure

    for title, rows in (
        ("errors of joints: median, and 10 to 90 %, of person-steps", accuracy_rows(steps)),
        ("by the widest angle between two rays", angle_rows(steps)),
        ("rank correlations with J, of all plans and of good ones", agreement_rows(plans)),
        ("the plan with the largest J, and that with the most views by two", choice_rows(plans)),
    ):
        if rows:
            Listing(title, rows).print()
    print_texts([], sentences(steps, plans))
    if plans:
        results.draw(_FIGURE, partial(quality_figure, steps, plans))


def _measured(
    problem: Problem, seed: int, trials: Trials, limit: float
) -> tuple[list[PersonStep], list[PlanRow]]:
    """Plans a scene in many ways, and triangulates the walkers of some of these plans."""
    steps, rows = list[PersonStep](), list[PlanRow]()
    for planned in plans_of(
        problem, seed, TRIANGULATED if problem.name == _LARGEST else ALL, limit
    ):
        rows.append(planned.row)
        if planned.planner in TRIANGULATED:
            steps += person_steps(problem, seed, planned, trials)
    return steps, rows


def _seeds_of(name: str, seeds: Sequence[int]) -> Sequence[int]:
    """Returns the seeds of a built-in scene: one if it is large, or the same for every seed."""
    return seeds[:1] if name in _LARGE or name.startswith("tiny-") else seeds


def _has_pictures(problem: Problem) -> bool:
    """Returns True if there are at least two drones, and all of them have pinhole cameras."""
    cameras = [robot.camera for robot in problem.robots]
    return len(cameras) >= 2 and all(isinstance(camera, Camera) for camera in cameras)
